//! The start: board, executors, tasks; and the alarm.

use core::arch::naked_asm;

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::{NVIC, SCB};
use stm32f4xx_hal::pac::Interrupt;

use crate::board::CrystalStart;
use crate::bring_up::{self, Hardware};
use crate::clock_events::{self, ClockEvent};
use crate::drivers::{pulse, time};
use crate::executors::{self, spawn};
use crate::image_words;
use crate::samples::SAMPLES;
use crate::settings::VARIANT;
use crate::tasks::mavlink::Port;
use crate::tasks::{gnss, led, mavlink, paper, ready as ready_task, status, usb as usb_task};
use crate::{board, fault, lines, storage, story, supervision};

#[cortex_m_rt::entry]
fn main() -> ! {
    let Hardware {
        lines,
        pulse,
        samples,
        card,
        usb,
        led,
        ready,
        crystal,
    } = bring_up::bring_up();
    SAMPLES.open(samples);
    log_identity();
    if let CrystalStart::Late { after_us } = crystal {
        defmt::warn!(
            "the crystal was ready after {=u32} us, which is late",
            after_us
        );
        clock_events::push(ClockEvent::CrystalLate { after_us });
    }
    if let Some(reason) = story::report() {
        fault::stop(reason);
    }
    let high = executors::start_high();
    if VARIANT.is_papers() {
        spawn(&high, paper::run(lines.gnss));
    } else {
        spawn(&high, gnss::run(lines.gnss, pulse));
    }
    #[cfg(not(loaded))]
    let of_mavlink = high;
    #[cfg(loaded)]
    let of_mavlink = executors::start_mavlink();
    let usb = usb.map(|(device, port)| {
        // Device and port share what one executor may.
        spawn(&of_mavlink, usb_task::run(device));
        Port::Usb(port)
    });
    let telem1 = Some(Port::Serial(lines.telem1));
    #[cfg(not(stanag))]
    let links = mavlink::Lines {
        mavlink: [telem1, Some(Port::Serial(lines.telem2)), usb],
    };
    #[cfg(stanag)]
    let links = mavlink::Lines {
        mavlink: [telem1, usb],
        stanag: lines.telem2,
    };
    spawn(&of_mavlink, mavlink::run(links));
    let low = executors::start_low();
    spawn(&low, led::run(led));
    spawn(&low, status::run());
    spawn(&low, ready_task::run(ready));
    #[cfg(feature = "bench")]
    spawn(&low, crate::bench::run());
    storage::run(card)
}

/// The log's first lines: what this image is. In the paper's variants, which are about priorities, also
/// these, as they stand in the registers.
fn log_identity() {
    defmt::info!(
        "pixclock {=str} on {=str}, variant {}, tick {=u32} us, system {=u8}",
        env!("CARGO_PKG_VERSION"),
        board::NAME,
        VARIANT,
        VARIANT.tick_us(),
        image_words::system_id()
    );
    let (kind, revision) = board::silicon();
    defmt::info!(
        "chip {=u16:#05x}, revision {=u16:#06x}, number {=[u8; 12]:02x}",
        kind,
        revision,
        board::unique_id()
    );
    if VARIANT.is_papers() {
        defmt::info!(
            "priorities: SysTick {=u8:#04x}, PendSV {=u8:#04x}, UART4 {=u8:#04x}, USART2 {=u8:#04x}, TIM4 {=u8:#04x}, tasks {=u8:#04x} and {=u8:#04x}",
            SCB::get_priority(SystemHandler::SysTick),
            SCB::get_priority(SystemHandler::PendSV),
            NVIC::get_priority(Interrupt::UART4),
            NVIC::get_priority(Interrupt::USART2),
            NVIC::get_priority(Interrupt::TIM4),
            NVIC::get_priority(executors::HIGH_INTERRUPT),
            NVIC::get_priority(executors::LOW_INTERRUPT)
        );
    }
    #[cfg(loaded)]
    crate::load::log_identity();
}

/// The alarm's exception, with the place of its frame: there it is seen what was interrupted.
#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn PendSV() {
    naked_asm!("mov r0, sp", "b {alarm}", alarm = sym on_alarm)
}

/// The alarm: at least once a ms, and when a timer is due.
extern "C" fn on_alarm(sp: u32) {
    supervision::look(sp);
    lines::wake_readers();
    pulse::enable();
    time::on_alarm();
}
