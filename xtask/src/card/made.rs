//! A log that no board has recorded: the same each time.

use sample_log::{Sample, csv};
use timebase::ClockState;

/// As many as a board has room for.
const SAMPLES: u32 = 8_192;

/// The file of a log of [`SAMPLES`], a PING each 100 ms.
pub fn log() -> Vec<u8> {
    let mut file = vec![0; csv::file_len(SAMPLES) as usize];
    let made = csv::read(0, &mut file, SAMPLES, |index| Some(sample(index)));
    file.truncate(made);
    file
}

fn sample(index: u32) -> Sample {
    /// A moment in November 2026. \[ns\]
    const BEGAN_NS: i64 = 1_795_309_322_000_000_000;
    const APART_NS: i64 = 100_000_000;
    let sent_ns = BEGAN_NS + i64::from(index) * APART_NS;
    // Some µs on the way, and not the same for each.
    let way_ns = 87_000 + i64::from(index) * 7_919 % 1_000;
    Sample {
        board_ns: sent_ns + way_ns,
        ping_us: (sent_ns / 1_000).cast_unsigned(),
        sequence: index,
        state: ClockState::Set,
        uncertainty_ns: 60,
    }
}

/// Fills blocks with pieces of a file.
pub fn reader(file: &[u8]) -> impl FnMut(u32, &mut [u8]) -> usize {
    |offset, block| {
        let rest = file.get(offset as usize..).unwrap_or_default();
        let count = rest.len().min(block.len());
        block[..count].copy_from_slice(&rest[..count]);
        count
    }
}
