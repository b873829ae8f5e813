//! The flashed image on the virtual board, behind each bootloader's stand-in: it boots, it reports, it
//! can be trusted.

use crate::common::{MS, SECOND, START_UTC_NS, image, pings, receiver_settings};
use console::{Level, Status};
use mavlink_node::Version;
use virtual_pixhawk::{Bootloader, Builder, Connector, Firmware, Logged, Pixhawk, Script};
use world::{Receiver, Transmission, WorldNanos};

/// What the firmware may reach though no model answers: `(INSTANCE.REGISTER, whether
/// it may be written, why a run can be believed all the same)`.
const EXPLAINED: [(&str, bool, &str); 0] = [];

/// A board with a receiver from its box, with requests in both versions of MAVLink
/// and with noise on both lines: everything that the firmware does.
fn busy_board(firmware: Firmware, bootloader: Bootloader) -> Pixhawk {
    let at = |n: u64| WorldNanos(SECOND + n * 300 * MS);
    let mut telem1 = pings(Version::V2, (0..6).map(at));
    telem1.extend(pings(Version::V1, (6..12).map(at)));
    telem1.push(Transmission {
        start: WorldNanos(4_950 * MS),
        bytes: (0..200).map(|n: u8| n.wrapping_mul(73)).collect(),
        baud: 9_600,
    });
    Builder::new(firmware)
        .bootloader(bootloader)
        .crystal_ppb(-23_000)
        .gps(Receiver::new(receiver_settings()))
        .telem1(Script::new(telem1))
        .power_on()
        .expect("the board has power")
}

fn statuses(log: &[Logged]) -> Vec<Status> {
    log.iter()
        .filter_map(|logged| Status::parse(&logged.line.text))
        .collect()
}

#[test]
fn it_boots_and_reports_once_a_second() {
    let Some(firmware) = image() else { return };
    for bootloader in Bootloader::ALL {
        let mut board = Builder::new(firmware.clone())
            .bootloader(bootloader)
            .power_on()
            .unwrap();
        board.run_to(WorldNanos(3 * SECOND + 500 * MS)).unwrap();
        let log = board.take_log().unwrap();
        assert!(log[0].line.text.starts_with("pixclock "), "{:?}", log[0]);
        assert_eq!(statuses(&log).len(), 3, "{bootloader:?}");
        let worse = log
            .iter()
            .find(|logged| logged.line.level >= Some(Level::Warn));
        assert_eq!(worse, None, "{bootloader:?}");
        assert_eq!(board.damaged_log_frames().unwrap(), 0);
        assert_eq!(board.gaps().unwrap().resets, 0);
    }
}

/// Bits of registers of the part that the image has to set, whatever it finds: the address, the bits,
/// their value, and what it is.
const REGISTERS: [(u64, u32, u32, &str); 15] = [
    (0x4000_7000, 0b11 << 14, 0b11 << 14, "PWR_CR.VOS: scale 1"),
    (0x4002_388C, 1 << 24, 0, "RCC_DCKCFGR.TIMPRE"),
    (0x4002_3804, 0x0F43_7FFF, 0x0740_2A0C, "RCC_PLLCFGR"),
    (0x4002_3808, 0xFCFF, 0x940A, "RCC_CFGR: PLL, its dividers"),
    (0x4002_3800, 1 << 19, 1 << 19, "RCC_CR.CSSON"),
    (0x4002_3C00, 0xF, 5, "FLASH_ACR.LATENCY"),
    (0x4002_000C, 0b11 << 2, 0b01 << 2, "GPIOA_PUPDR: PA1 up"),
    (0x4002_0C0C, 0b11 << 12, 0b01 << 12, "GPIOD_PUPDR: PD6 up"),
    (0x4002_0C0C, 0b11 << 18, 0b01 << 18, "GPIOD_PUPDR: PD9 up"),
    (0x4002_0C00, 0b11 << 8, 0b01 << 8, "GPIOD_MODER: PD4, RTS"),
    (0x4002_0C14, 1 << 4, 0, "GPIOD_ODR: PD4 low"),
    (
        0x4002_0C00,
        0b11 << 24,
        0b01 << 24,
        "GPIOD_MODER: PD12, RTS",
    ),
    (0x4002_0C14, 1 << 12, 0, "GPIOD_ODR: PD12 low"),
    (0x4002_0014, 1 << 8, 0, "GPIOA_ODR: PA8 low"),
    (0xE004_2008, 0x100C, 0x100C, "DBGMCU_APB1_FZ"),
];

#[test]
fn clocks_pins_and_freeze_bits_are_its_own_behind_every_bootloader() {
    let Some(firmware) = image() else { return };
    for bootloader in Bootloader::ALL {
        let mut board = Builder::new(firmware.clone())
            .bootloader(bootloader)
            .power_on()
            .unwrap();
        board.run_to(WorldNanos(SECOND)).unwrap();
        for (address, bits, expected, name) in REGISTERS {
            let found = board.peek(address).unwrap() & bits;
            assert_eq!(found, expected, "{name}, {bootloader:?}: {found:#x}");
        }
    }
}

#[test]
fn the_radios_may_send_when_they_have_started() {
    const GPIOD: u64 = 0x4002_0C00;
    const READY: [u32; 2] = [4, 12];
    let Some(firmware) = image() else { return };
    let mut board = Builder::new(firmware).power_on().unwrap();
    let mut levels = READY.map(|_| Vec::new());
    for ms in (5..400).step_by(5) {
        board.run_to(WorldNanos(ms * MS)).unwrap();
        for (pin, levels) in READY.into_iter().zip(&mut levels) {
            let mode = board.peek(GPIOD).unwrap() >> (2 * pin) & 0b11;
            let pull = board.peek(GPIOD + 0x0C).unwrap() >> (2 * pin) & 0b11;
            let out = board.peek(GPIOD + 0x14).unwrap() >> pin & 1;
            levels.push((ms, (mode, pull, out)));
        }
    }
    for (pin, levels) in READY.into_iter().zip(levels) {
        let (pulled, driven): (Vec<_>, Vec<_>) =
            levels.into_iter().partition(|(_, (mode, ..))| *mode == 0);
        // An input with a pull-up, then an output that is low.
        assert!(pulled.iter().all(|(_, (_, pull, _))| *pull == 0b01));
        assert!(
            driven
                .iter()
                .all(|(_, (mode, _, out))| (*mode, *out) == (1, 0))
        );
        let (at_ms, _) = driven[0];
        assert!((200..=215).contains(&at_ms), "PD{pin}: {at_ms} ms");
        assert!(pulled.iter().all(|(ms, _)| *ms < at_ms), "PD{pin}");
    }
}

#[test]
fn every_register_that_is_reached_has_a_model_or_an_explanation() {
    let Some(firmware) = image() else { return };
    let mut board = busy_board(firmware, Bootloader::Px4);
    board.run_to(WorldNanos(6 * SECOND)).unwrap();
    let last = statuses(&board.take_log().unwrap()).pop().unwrap();
    assert!(last.is_set(), "it has not done all that it does: {last:?}");
    let gaps = board.gaps().unwrap();
    for (register, written) in &gaps.unmodelled {
        println!("no model behind {register}, written: {written}");
    }
    let unexplained: Vec<_> = gaps
        .unmodelled
        .iter()
        .filter(|(register, written)| {
            !EXPLAINED
                .iter()
                .any(|&(known, may_write, _)| known == register && (may_write || !written))
        })
        .collect();
    assert!(unexplained.is_empty(), "{unexplained:?}");
    assert!(gaps.refused.is_empty(), "{:?}", gaps.refused);
    assert!(gaps.misuse.is_empty(), "{:?}", gaps.misuse);
}

/// All that a run leaves behind.
#[derive(Debug, PartialEq)]
struct Traces {
    log: Vec<Logged>,
    sent: Vec<(u64, u8)>,
    instructions: u64,
}

fn traces(mut board: Pixhawk, meets: impl Fn(&mut Pixhawk)) -> Traces {
    meets(&mut board);
    let received = board.take_received(Connector::Telem1).unwrap();
    Traces {
        log: board.take_log().unwrap(),
        sent: received
            .iter()
            .map(|received| (received.at.0, received.byte))
            .collect(),
        instructions: board.instructions().unwrap(),
    }
}

#[test]
fn the_same_script_leaves_the_same_traces_however_it_is_watched() {
    let Some(firmware) = image() else { return };
    for bootloader in Bootloader::ALL {
        leaves_the_same_traces(&|| busy_board(firmware.clone(), bootloader));
    }
}

fn leaves_the_same_traces(power_on: &dyn Fn() -> Pixhawk) {
    let end = WorldNanos(5 * SECOND);
    let first = traces(power_on(), |board| {
        board.run_to(end).unwrap();
    });
    assert!(first.log.len() >= 5 && first.sent.len() > 100);

    let again = traces(power_on(), |board| {
        board.run_to(end).unwrap();
    });
    assert_eq!(first, again);

    let in_pieces = traces(power_on(), |board| {
        for piece in 1..=50 {
            board
                .run_to(WorldNanos(end.0 / 50 * piece + piece % 7))
                .unwrap();
        }
        board.run_to(end).unwrap();
    });
    assert_eq!(first, in_pieces);

    let metered = traces(power_on(), |board| {
        board.run_to(WorldNanos(4 * SECOND)).unwrap();
        board.start_meter(&[]).unwrap();
        board.run_to(WorldNanos(4 * SECOND + 400 * MS)).unwrap();
        assert!(board.stop_meter().instructions > 10_000);
        board.run_to(end).unwrap();
    });
    assert_eq!(first, metered);
}

#[test]
fn statics_are_read_where_the_board_stands() {
    let Some(firmware) = image() else { return };
    for bootloader in Bootloader::ALL {
        let board = Builder::new(firmware.clone()).bootloader(bootloader);
        reads_its_clock(board.power_on().unwrap());
    }
}

fn reads_its_clock(mut board: Pixhawk) {
    board.run_to(WorldNanos(SECOND)).unwrap();
    let early = board.clock().unwrap();
    board.run_to(WorldNanos(2 * SECOND)).unwrap();
    let late = board.clock().unwrap();
    // A perfect crystal: 21 cycles are 125 ns.
    let passed_ns = late.at.0 - early.at.0;
    let counted_ns = (late.cycles.0 - early.cycles.0) * 125 / 21;
    assert!(
        passed_ns.abs_diff(counted_ns) < 50,
        "{passed_ns} {counted_ns}"
    );
    assert!(late.reading.utc.0 < START_UTC_NS, "no receiver has set it");
}
