//! What the run before left behind: kept, read, and reported.
//!
//! *Purpose.* A fault is over when a person looks. So the next run reports it: in the log, in a
//! STATUSTEXT, and as the parameter `PC_FAULT`.
//!
//! *Design.* The record is valid for the image that wrote it only, because it may name a file by its
//! place in that image. A run that began without a fault forgets the record, and with it how often the
//! board had restarted (`fault_record`).

use core::slice;
use core::str;

use fault_record::{Hang, History, Place, Reason, Record, Registers};

use crate::clock_events::{self, ClockEvent};
use crate::drivers::{backup, watchdog};
use crate::latest::Latest;

/// Exception numbers of interrupts begin here.
const FIRST_INTERRUPT: u16 = 16;

/// Words of the vector table of this chip, as its description has them.
const VECTORS: usize = 16 + 87;

/// Why this run began, and where the one before ended, if a fault ended it.
static BEFORE: Latest<(Reason, Place)> = Latest::new();

unsafe extern "C" {
    static __vector_table: [u32; VECTORS];
    static __sidata: u32;
    static __srodata: u8;
    static __erodata: u8;
}

/// The record in the backup registers, if this image has written one.
pub fn recorded() -> Option<Record> {
    Record::from_words(&backup::record(), image())
}

/// Writes the record into the backup registers, which are open.
pub fn keep(record: &Record) {
    backup::set_record(&record.to_words(image()));
}

/// Reports the fault that ended the run before, if one did. To be called once, before the first task. The
/// backup registers are open. The reason to stop the board for, when the watchdog has reset it too
/// often.
pub fn report() -> Option<Reason> {
    let mut found = recorded();
    let last_up_ms = backup::up_ms();
    backup::set_up_ms(0);
    // A fault has left its record, whatever has reset the board after that.
    let by_watchdog = watchdog::take_was_reset() && found.is_none_or(|record| record.is_reported);
    if by_watchdog {
        let reason = Reason::Watchdog;
        let before = found.map(|record| (record.reason, record.history));
        found = Some(Record {
            reason,
            place: Place::Unknown,
            registers: Registers::default(),
            up_ms: last_up_ms,
            history: History::at(reason, last_up_ms, before),
            is_reported: false,
        });
    }
    let record = found?;
    if record.is_reported {
        backup::set_record(&[0; fault_record::WORDS]);
        return None;
    }
    BEFORE.set((record.reason, record.place));
    log("before the restart: ", &record);
    keep(&Record {
        is_reported: true,
        ..record
    });
    clock_events::push(ClockEvent::Restarted {
        reason: record.reason,
        place: record.place,
    });
    (by_watchdog && record.history.is_enough()).then_some(record.reason)
}

/// Why and where the run before ended, if a fault ended it.
pub fn before() -> Option<(Reason, Place)> {
    BEFORE.get()
}

/// The task's name.
pub const fn task_name(which: Hang) -> &'static str {
    match which {
        Hang::Gnss => "GNSS",
        Hang::Mavlink => "MAVLink",
    }
}

/// The name of the source file at `file`, if this image has one there.
pub fn file_name(file: u32, len: u16) -> &'static str {
    let (start, end) = (
        (&raw const __srodata).addr() as u32,
        (&raw const __erodata).addr() as u32,
    );
    let is_ours = file >= start && file.saturating_add(len.into()) <= end;
    if !is_ours {
        return "?";
    }
    let first = core::ptr::with_exposed_provenance(file as usize);
    // SAFETY: as just found, these bytes are constants of this image.
    let bytes = unsafe { slice::from_raw_parts(first, len.into()) };
    str::from_utf8(bytes).unwrap_or("?")
}

/// Logs a record, in the words of the reason.
pub fn log(prefix: &str, record: &Record) {
    let Record {
        reason,
        place,
        registers,
        up_ms,
        ..
    } = *record;
    match reason {
        Reason::Panic => match place {
            Place::Source { file, len, line } => defmt::error!(
                "{=str}panic at {=str}:{=u16}, after {=u32} ms",
                prefix,
                file_name(file, len),
                line,
                up_ms
            ),
            _ => defmt::error!("{=str}panic, after {=u32} ms", prefix, up_ms),
        },
        Reason::HardFault => match place {
            Place::StackOverflow => defmt::error!(
                "{=str}hard fault: stack overflow, SP {=u32:#010x}, CFSR {=u32:#010x}, after {=u32} ms",
                prefix,
                registers.sp,
                registers.cfsr,
                up_ms
            ),
            _ => defmt::error!(
                "{=str}hard fault at {=u32:#010x}, called from {=u32:#010x}, CFSR {=u32:#010x}, address {=u32:#010x}, after {=u32} ms",
                prefix,
                address(place),
                registers.lr,
                registers.cfsr,
                registers.address,
                up_ms
            ),
        },
        Reason::Unexpected(exception) => match exception.checked_sub(FIRST_INTERRUPT) {
            Some(interrupt) => defmt::error!(
                "{=str}interrupt {=u16} has no handler; it came at {=u32:#010x}, after {=u32} ms",
                prefix,
                interrupt,
                address(place),
                up_ms
            ),
            None => defmt::error!(
                "{=str}exception {=u16} has no handler; it came at {=u32:#010x}, after {=u32} ms",
                prefix,
                exception,
                address(place),
                up_ms
            ),
        },
        Reason::Crystal => {
            defmt::error!("{=str}the crystal failed, after {=u32} ms", prefix, up_ms);
        }
        Reason::Task(which) => defmt::error!(
            "{=str}the {=str} task stopped; found at {=u32:#010x}, after {=u32} ms",
            prefix,
            task_name(which),
            address(place),
            up_ms
        ),
        Reason::Watchdog => match place {
            Place::Instruction(address) => defmt::error!(
                "{=str}the tick stopped; found at {=u32:#010x}, after {=u32} ms",
                prefix,
                address,
                up_ms
            ),
            _ => defmt::error!(
                "{=str}the watchdog was not fed: tick or interrupts stopped, after {=u32} ms",
                prefix,
                up_ms
            ),
        },
    }
    if registers != Registers::default() {
        let [r0, r1, r2, r3] = registers.r;
        defmt::error!(
            "{=str}r0 {=u32:#010x}, r1 {=u32:#010x}, r2 {=u32:#010x}, r3 {=u32:#010x}, r12 {=u32:#010x}, lr {=u32:#010x}, sp {=u32:#010x}, xPSR {=u32:#010x}",
            prefix,
            r0,
            r1,
            r2,
            r3,
            registers.r12,
            registers.lr,
            registers.sp,
            registers.xpsr
        );
    }
}

const fn address(place: Place) -> u32 {
    match place {
        Place::Instruction(address) => address,
        _ => 0,
    }
}

/// A number that another image hardly has: made of its handlers' addresses and its length.
fn image() -> u32 {
    let length = (&raw const __sidata).addr() as u32;
    // SAFETY: the table is where the linker has put it, and never changes.
    let vectors = unsafe { &__vector_table };
    let fold = |number: u32, vector: &u32| number.rotate_left(5) ^ vector;
    vectors.iter().fold(length, fold)
}
