//! CFG-VALSET: configuration by keys, for receivers after the M8.
//!
//! *Purpose.* The tables of keys, and the frame that carries them.
//!
//! *Design.* A key holds the size of its value in bits 30 to 28, so that a table is pairs of numbers.
//! A receiver that does not know one key of a frame refuses the whole frame: what only some
//! know is sent alone. Keys and values are from the interface descriptions of F9 HPG 1.32, M10 SPG
//! 5.10 and X20 HPG 2.00; a test compares the frames to the byte with those of `pyubx2`.
//!
//! *Limits.* Values of up to four bytes. UART1 only.

use crate::frame_buffer::{Buffer, sum};
use crate::kind::{CHECKSUM_LEN, HEADER_LEN, SYNC_1, SYNC_2};

/// What takes effect at once, and is forgotten at a restart.
pub(crate) const RAM: u8 = 1;
/// What takes effect at the next start, as long as the backup battery lasts.
pub(crate) const BATTERY_BACKED: u8 = 2;

/// CFG-UART1-BAUDRATE.
pub(crate) const BAUD: u32 = 0x4052_0001;
/// CFG-UART1OUTPROT-RTCM3X: F9 and X20 have it.
pub(crate) const RTCM3_OUT: u32 = 0x1074_0004;
/// CFG-INFMSG-UBX_UART1.
pub(crate) const NOTICES: u32 = 0x2092_0002;

/// CFG-UART1INPROT-UBX, CFG-UART1OUTPROT-UBX and CFG-UART1OUTPROT-NMEA.
const PROTOCOLS: [(u32, u32); 3] = [(0x1073_0001, 1), (0x1074_0001, 1), (0x1074_0002, 0)];

/// CFG-NAVSPG-DYNMODEL airborne below 2 g, CFG-NAVSPG-FIXMODE 3D only.
pub(crate) const NAVIGATION: [(u32, u32); 2] = [(0x2011_0021, 7), (0x2011_0011, 2)];

/// CFG-RATE-MEAS in ms, CFG-RATE-NAV, and CFG-RATE-TIMEREF: UTC.
pub(crate) const fn rate(period_ms: u16) -> [(u32, u32); 3] {
    [
        (0x3021_0001, period_ms as u32),
        (0x3021_0002, 1),
        (0x2021_0003, 0),
    ]
}

/// CFG-TP: a pulse of `width_us` at each second of UTC, none while GNSS time is not known.
pub(crate) const fn pulse(width_us: u32) -> [(u32, u32); 12] {
    const SECOND_US: u32 = 1_000_000;
    [
        (0x2005_0023, 0),         // PULSE_DEF: a period
        (0x2005_0030, 1),         // PULSE_LENGTH_DEF: a length
        (0x4005_0002, SECOND_US), // PERIOD_TP1
        (0x4005_0003, SECOND_US), // PERIOD_LOCK_TP1
        (0x4005_0004, 0),         // LEN_TP1
        (0x4005_0005, width_us),  // LEN_LOCK_TP1
        (0x1005_0007, 1),         // TP1_ENA
        (0x1005_0008, 1),         // SYNC_GNSS_TP1
        (0x1005_0009, 1),         // USE_LOCKED_TP1
        (0x1005_000a, 1),         // ALIGN_TO_TOW_TP1
        (0x1005_000b, 1),         // POL_TP1: rising
        (0x2005_000c, 0),         // TIMEGRID_TP1: UTC
    ]
}

/// What the keys of messages on UART1 have in common.
const MESSAGE: u32 = 0x2091_0000;

/// Class and id of a message, and the rest of its key.
const MESSAGES: [(u8, u8, u16); 23] = [
    (0x01, 0x02, 0x002a), // NAV-POSLLH
    (0x01, 0x03, 0x001b), // NAV-STATUS
    (0x01, 0x04, 0x0039), // NAV-DOP
    (0x01, 0x07, 0x0007), // NAV-PVT
    (0x01, 0x12, 0x0043), // NAV-VELNED
    (0x01, 0x20, 0x0048), // NAV-TIMEGPS
    (0x01, 0x21, 0x005c), // NAV-TIMEUTC
    (0x01, 0x22, 0x0066), // NAV-CLOCK
    (0x01, 0x26, 0x0061), // NAV-TIMELS
    (0x01, 0x35, 0x0016), // NAV-SAT
    (0x01, 0x3b, 0x0089), // NAV-SVIN
    (0x01, 0x3c, 0x008e), // NAV-RELPOSNED
    (0x01, 0x43, 0x0346), // NAV-SIG
    (0x01, 0x61, 0x0160), // NAV-EOE
    (0x02, 0x13, 0x0232), // RXM-SFRBX
    (0x02, 0x14, 0x0205), // RXM-MEASX
    (0x02, 0x15, 0x02a5), // RXM-RAWX
    (0x0a, 0x09, 0x01b5), // MON-HW
    (0x0a, 0x31, 0x038c), // MON-SPAN
    (0x0a, 0x38, 0x035a), // MON-RF
    (0x0a, 0x39, 0x069e), // MON-SYS
    (0x0d, 0x01, 0x017e), // TIM-TP
    (0x0d, 0x03, 0x0179), // TIM-TM2
];

/// The key of a message's rate; `None` if it is not in the table.
#[inline(never)]
pub(crate) fn of_message(message: (u8, u8)) -> Option<u32> {
    let mut known = MESSAGES.iter();
    let (_, _, rest) = known.find(|(class, id, _)| (*class, *id) == message)?;
    Some(MESSAGE | u32::from(*rest))
}

/// A frame in the making.
pub(crate) struct Keys<'a> {
    buffer: &'a mut Buffer,
    length: usize,
}

impl<'a> Keys<'a> {
    /// One for these layers.
    pub(crate) fn begin(buffer: &'a mut Buffer, layers: u8) -> Self {
        let mut frame = Self { buffer, length: 0 };
        frame.put(&[SYNC_1, SYNC_2, 0x06, 0x8a, 0, 0, 0, layers, 0, 0]);
        frame
    }

    #[inline(never)]
    fn put(&mut self, bytes: &[u8]) {
        let end = self.length.wrapping_add(bytes.len());
        if let Some(space) = self.buffer.get_mut(self.length..end) {
            space.copy_from_slice(bytes);
            self.length = end;
        }
    }

    /// Adds a key and the low bytes of its value, as many as the key says.
    #[inline(never)]
    pub(crate) fn add(&mut self, key: u32, value: u32) {
        self.put(&key.to_le_bytes());
        let size = match key >> 28 & 7 {
            4 => 4,
            3 => 2,
            _ => 1,
        };
        let bytes = value.to_le_bytes();
        self.put(bytes.get(..size).unwrap_or_default());
    }

    #[inline(never)]
    pub(crate) fn add_all(&mut self, pairs: &[(u32, u32)]) {
        for (key, value) in pairs {
            self.add(*key, *value);
        }
    }

    /// The line's rate, and UBX alone.
    #[inline(never)]
    pub(crate) fn add_port(&mut self, baud: u32) {
        self.add(BAUD, baud);
        self.add_all(&PROTOCOLS);
    }

    /// Its length, in bytes, once its header and checksum are right.
    #[inline(never)]
    pub(crate) fn finish(mut self) -> usize {
        self.put(&[0; CHECKSUM_LEN]);
        let payload = self.length.saturating_sub(HEADER_LEN + CHECKSUM_LEN);
        if let Some(length) = self.buffer.get_mut(4) {
            *length = payload as u8;
        }
        if let Some(frame) = self.buffer.get_mut(..self.length) {
            sum(frame);
        }
        self.length
    }
}
