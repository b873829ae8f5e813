//! The end of a run: shown by the LED, recorded for the next run, logged, and then a restart.
//!
//! | the end | comes from |
//! |---|---|
//! | a panic | the program |
//! | a hard fault | the core; bus, memory and usage faults are not enabled, and so become one |
//! | an exception or interrupt without a handler | the core |
//! | the crystal failed | the clock security system's NMI, or the start |
//! | a task that did not come by | [`supervision`](crate::supervision) |
//! | a tick or an alarm that stopped | [`time`](crate::drivers::time), by the witness; where interrupts are masked, the watchdog |
//!
//! *Design.* Nothing of the running system is trusted. Interrupts are off, the stack is another one, the
//! LED is set by its registers. First the LED is lit, then the record is written, and the log comes
//! last, because a fault may have come in the middle of its frame. A fault in here leads to the LED at
//! once.
//!
//! The LED flashes twice shortly and once long, as nothing else does; then the board restarts. The
//! third restart for one reason within a minute is not made: the board stops, and goes on flashing, and after each
//! such group it flashes the reason's number ([`Reason::number`]). Time is counted by TIM5 at the rate of the clock
//! that the core has just now; should that timer stand still, passes of a loop are counted in its
//! place. So the shape of the pattern needs no particular clock. A board that has stopped says the reason
//! on its MAVLink line, too, after each group; so does each run that a crystal ends, since none of them
//! comes to report it.
//!
//! *Limits.* A fault with the fault handler's priority, or above it, locks the core up; then the watchdog
//! resets the board, and the next run reports that.

use core::arch::naked_asm;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

use cortex_m::peripheral::SCB;
use embassy_time::Instant;
use fault_record::{Hang, History, Place, Reason, Record, Registers};
use mavlink_node::Address;
use stm32f4xx_hal::pac::{RCC, TIM5};
use timebase::divide;

use crate::drivers::{backup, last_words, led, watchdog};
use crate::{board, image_words, logger, story};

/// The group that says that a run has ended: two short flashes, one long. For how long the LED is lit and
/// dark in turns. \[ms\]
const ENDED: [u32; 6] = [100, 100, 100, 100, 400, 400];

/// After that group, before the reason's number and behind it: dark. \[ms\]
const PAUSE_MS: u32 = 600;

/// Each flash of the number: lit, and dark. \[ms\]
const DIGIT_MS: (u32, u32) = (150, 250);

/// From look to look at the timer, in cycles; the timer counts at least every second one.
const PASS: u32 = 8_000;

/// Exceptions that say that the core cannot go on: hard fault, and MPU, bus and usage faults.
const FAULTS: core::ops::RangeInclusive<u16> = 3..=6;

/// The exception of the clock security system.
const NMI: u16 = 2;

/// CFSR: the frame could not be written, by a bus or an MPU error, and so is not there.
const NOT_STACKED: u32 = 1 << 12 | 1 << 4;

/// CFSR: BFAR, MMFAR is valid.
const BFAR_VALID: u32 = 1 << 15;
const MMFAR_VALID: u32 = 1 << 7;

/// A fault is being reported: another one meanwhile comes from that.
static IS_ENDING: AtomicBool = AtomicBool::new(false);

unsafe extern "C" {
    static _stack_end: u32;
    static _stack_start: u32;
}

/// All exceptions and interrupts without a handler of their own come here, NMI among them.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn DefaultHandler() {
    naked_asm!("b HardFault")
}

/// Leaves the stack, which may be full, before anything is pushed. It is neither read nor written.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn HardFault() -> ! {
    naked_asm!(
        "cpsid i",
        "tst lr, #4",
        "ite eq",
        "mrseq r0, MSP",
        "mrsne r0, PSP",
        "ldr r1, =_fault_stack_start",
        "msr MSP, r1",
        "b {on_exception}",
        on_exception = sym on_exception,
    )
}

/// Tells the exception that has its frame at `sp`.
extern "C" fn on_exception(sp: u32) -> ! {
    // SAFETY: reading these has no side effect.
    let (exception, cfsr, bfar, mmfar) = unsafe {
        let scb = &*SCB::PTR;
        (
            (scb.icsr.read() & 0x1FF) as u16,
            scb.cfsr.read(),
            scb.bfar.read(),
            scb.mmfar.read(),
        )
    };
    let reason = match exception {
        NMI if board::take_crystal_failure() => Reason::Crystal,
        _ if FAULTS.contains(&exception) => Reason::HardFault,
        _ => Reason::Unexpected(exception),
    };
    let (place, mut registers) = if cfsr & NOT_STACKED == 0 {
        interrupted(sp)
    } else {
        (Place::StackOverflow, Registers::default())
    };
    registers.sp = sp;
    registers.cfsr = cfsr;
    registers.address = match cfsr {
        _ if cfsr & BFAR_VALID != 0 => bfar,
        _ if cfsr & MMFAR_VALID != 0 => mmfar,
        _ => 0,
    };
    end(reason, place, registers)
}

/// What an exception whose frame is at `sp` has interrupted. A pointer below the stack is what an
/// overflow leaves; anywhere else outside it, it is of no use.
fn interrupted(sp: u32) -> (Place, Registers) {
    /// r0 to r3, r12, lr, pc, xPSR.
    const FRAME: usize = 8;
    let lowest = (&raw const _stack_end).addr() as u32;
    let highest = (&raw const _stack_start).addr() as u32 - FRAME as u32 * 4;
    if sp < lowest {
        return (Place::StackOverflow, Registers::default());
    }
    if sp > highest || !sp.is_multiple_of(4) {
        return (Place::Unknown, Registers::default());
    }
    // SAFETY: as just found, these words lie within the stack and are aligned.
    let frame = unsafe { core::ptr::with_exposed_provenance::<[u32; FRAME]>(sp as usize).read() };
    let [r0, r1, r2, r3, r12, lr, pc, xpsr] = frame;
    let registers = Registers {
        r: [r0, r1, r2, r3],
        r12,
        lr,
        sp,
        xpsr,
        ..Registers::default()
    };
    (Place::Instruction(pc), registers)
}

#[panic_handler]
fn panic(info: &PanicInfo) -> ! {
    cortex_m::interrupt::disable();
    let place = info.location().map_or(Place::Unknown, |location| {
        let file = location.file();
        Place::Source {
            file: file.as_ptr().addr() as u32,
            len: u16::try_from(file.len()).unwrap_or(u16::MAX),
            line: u16::try_from(location.line()).unwrap_or(u16::MAX),
        }
    });
    let registers = Registers {
        sp: cortex_m::register::msp::read(),
        ..Registers::default()
    };
    // Without what is formatted: that would bring core's whole machinery of it, and the line of the
    // source says the same.
    let message = info.message().as_str().unwrap_or_default();
    end_with(Reason::Panic, place, registers, message)
}

/// Ends the run because the crystal does not start.
pub fn crystal_failed() -> ! {
    end(Reason::Crystal, Place::Unknown, Registers::default())
}

/// Ends the run because a task did not come by; `sp` is where the exception that found this has its
/// frame.
#[cold]
pub fn task_stopped(which: Hang, sp: u32) -> ! {
    cortex_m::interrupt::disable();
    let (place, registers) = interrupted(sp);
    end(Reason::Task(which), place, registers)
}

/// Ends the run because tick or alarm stopped; `sp` is where the exception that found this has its frame.
pub extern "C" fn alarm_stopped(sp: u32) -> ! {
    cortex_m::interrupt::disable();
    let (place, registers) = interrupted(sp);
    end(Reason::Watchdog, place, registers)
}

/// Stops the board for a `reason` that is recorded already.
pub fn stop(reason: Reason) -> ! {
    defmt::error!("stopped: restarting does not help");
    cortex_m::interrupt::disable();
    IS_ENDING.store(true, Relaxed);
    show_for_ever(reason)
}

fn end(reason: Reason, place: Place, registers: Registers) -> ! {
    end_with(reason, place, registers, "")
}

/// Shows, records and logs the end of the run; the log has the `message`, too.
#[inline(never)]
fn end_with(reason: Reason, place: Place, registers: Registers, message: &str) -> ! {
    cortex_m::interrupt::disable();
    light(true);
    if IS_ENDING.swap(true, Relaxed) {
        // The record was written, or could not be.
        restart()
    }
    let up_ms = up_ms();
    backup::open();
    let before = story::recorded().map(|record| (record.reason, record.history));
    let record = Record {
        reason,
        place,
        registers,
        up_ms,
        history: History::at(reason, up_ms, before),
        is_reported: false,
    };
    story::keep(&record);
    // SAFETY: interrupts are off, and this never returns.
    unsafe { logger::seize() };
    if !message.is_empty() {
        defmt::error!("panicked: {=str}", message);
    }
    story::log("", &record);
    if reason == Reason::Crystal {
        // No run gets as far as the MAVLink task, where others are reported after the restart.
        say(reason);
    }
    if record.history.is_enough() {
        defmt::error!("stopped: restarting does not help");
        show_for_ever(reason)
    } else {
        restart()
    }
}

/// How long the run has lasted. \[ms\]
#[inline(never)]
pub fn up_ms() -> u32 {
    u32::try_from(divide::<1_000>(Instant::now().as_micros())).unwrap_or(u32::MAX)
}

fn restart() -> ! {
    // Without the dark time behind the long flash: the restart is dark itself.
    let [flashes @ .., _] = &ENDED;
    show(flashes);
    SCB::sys_reset()
}

#[inline(never)]
fn show_for_ever(reason: Reason) -> ! {
    let (lit, dark) = DIGIT_MS;
    loop {
        show(&ENDED);
        show(&[0, PAUSE_MS]);
        for _ in 0..reason.number() {
            show(&[lit, dark]);
        }
        say(reason);
        show(&[0, PAUSE_MS]);
    }
}

/// Says on the MAVLink line why the run has ended: it takes 10 ms.
#[inline(never)]
fn say(reason: Reason) {
    let mut text = heapless::String::<50>::new();
    // All of it fits.
    let _ = text.push_str("stopped by a fault: ");
    let _ = text.push_str(reason.as_str());
    let from = Address {
        system: image_words::system_id(),
        component: 1,
    };
    for frame in mavlink_node::last_words(from, &text) {
        // SAFETY: interrupts are off, and whoever calls this never returns.
        unsafe { last_words::send(&frame) };
    }
}

/// Lights the LED and leaves it dark in turns.
#[inline(never)]
fn show(times_ms: &[u32]) {
    for (n, &ms) in times_ms.iter().enumerate() {
        light(n % 2 == 0 && ms > 0);
        wait(ms);
    }
}

fn light(is_lit: bool) {
    // SAFETY: interrupts are off, and whoever calls this never returns.
    unsafe { led::force(is_lit) }
}

/// Waits, and feeds the watchdog meanwhile.
fn wait(ms: u32) {
    // SAFETY: nothing else runs any more, so the timer has no other user.
    let tim5 = unsafe {
        let rcc = &*RCC::ptr();
        rcc.apb1enr().modify(|_, w| w.tim5en().enabled());
        rcc.apb1enr().read();
        &*TIM5::ptr()
    };
    let counts_a_ms = board::witness_khz();
    tim5.psc().write(|w| w.psc().set(0));
    tim5.egr().write(|w| w.ug().update());
    tim5.cr1().write(|w| w.cen().enabled());
    let counts = ms * counts_a_ms;
    // On the chip a pass takes at least sixteen times as many counts, so that this is only for a timer
    // that stands still. (The emulator's core keeps its pace on HSI, and its passes are shorter then.)
    for _ in 0..counts / (PASS / 32) {
        watchdog::feed();
        if tim5.cnt().read().bits() >= counts {
            break;
        }
        cortex_m::asm::delay(PASS);
    }
}
