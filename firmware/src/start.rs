//! The start: board, executors, tasks; and the two interrupts that run them.

use cortex_m::peripheral::scb::SystemHandler;
use cortex_m::peripheral::{NVIC, SCB};
use cortex_m_rt::exception;
#[cfg(feature = "pixhawk1")]
use defmt_rtt as _;
#[cfg(feature = "qemu")]
use defmt_semihosting as _;
use embassy_executor::{InterruptExecutor, SendSpawner, SpawnError, SpawnToken};
use stm32f4xx_hal::pac::{Interrupt, interrupt};

use crate::board::{self, Board};
use crate::drivers::{pulse, time};
use crate::samples::SAMPLES;
use crate::settings;
use crate::storage;
use crate::system_id::system_id;
use crate::tasks::{gnss, led, mavlink, paper, status};

/// Runs what must be prompt, at [`priorities::EXECUTOR_HIGH`](crate::priorities::EXECUTOR_HIGH).
static EXECUTOR_HIGH: InterruptExecutor = InterruptExecutor::new();
/// Runs what may take its time, at [`priorities::EXECUTOR_LOW`](crate::priorities::EXECUTOR_LOW).
static EXECUTOR_LOW: InterruptExecutor = InterruptExecutor::new();

#[cortex_m_rt::entry]
fn main() -> ! {
    let Board {
        gnss: (gnss_reader, gnss_writer),
        mavlink: (mavlink_reader, mavlink_writer),
        pulse,
        samples,
        card,
        led,
    } = board::init();
    SAMPLES.open(samples);
    tell_what_runs();
    let prompt = EXECUTOR_HIGH.start(board::EXECUTOR_HIGH);
    if settings::VARIANT.is_papers() {
        spawn(&prompt, paper::run(gnss_reader, gnss_writer));
    } else {
        spawn(&prompt, gnss::run(gnss_reader, gnss_writer, pulse));
    }
    spawn(&prompt, mavlink::run(mavlink_reader, mavlink_writer));
    let patient = EXECUTOR_LOW.start(board::EXECUTOR_LOW);
    spawn(&patient, led::run(led));
    spawn(&patient, status::run());
    #[cfg(feature = "bench")]
    spawn(&patient, crate::bench::run());
    storage::run(card)
}

/// The log's first lines: what this image is. In the paper's variants also who interrupts whom, as it
/// stands in the registers: it is what they are about.
fn tell_what_runs() {
    defmt::info!(
        "pixclock {=str} on {=str}, variant {}, tick {=u32} us, system {=u8}",
        env!("CARGO_PKG_VERSION"),
        board::NAME,
        settings::VARIANT,
        settings::VARIANT.tick_us(),
        system_id()
    );
    if settings::VARIANT.is_papers() {
        defmt::info!(
            "priorities: SysTick {=u8:#04x}, PendSV {=u8:#04x}, UART4 {=u8:#04x}, USART2 {=u8:#04x}, TIM4 {=u8:#04x}, tasks {=u8:#04x} and {=u8:#04x}",
            SCB::get_priority(SystemHandler::SysTick),
            SCB::get_priority(SystemHandler::PendSV),
            NVIC::get_priority(Interrupt::UART4),
            NVIC::get_priority(Interrupt::USART2),
            NVIC::get_priority(Interrupt::TIM4),
            NVIC::get_priority(board::EXECUTOR_HIGH),
            NVIC::get_priority(board::EXECUTOR_LOW)
        );
    }
}

/// Hands a task to its executor.
#[inline(always)]
fn spawn<S: Send>(executor: &SendSpawner, task: Result<SpawnToken<S>, SpawnError>) {
    match task {
        Ok(task) => executor.spawn(task),
        Err(_) => defmt::panic!("a task was started twice"),
    }
}

/// The executor of the GNSS and MAVLink tasks; see [`board::EXECUTOR_HIGH`].
#[interrupt]
fn DCMI() {
    // SAFETY: this is its one handler, and it is enabled by `start`.
    unsafe { EXECUTOR_HIGH.on_interrupt() }
}

/// The executor of the LED and the status line; see [`board::EXECUTOR_LOW`].
#[interrupt]
fn CAN2_TX() {
    // SAFETY: this is its one handler, and it is enabled by `start`.
    unsafe { EXECUTOR_LOW.on_interrupt() }
}

/// The alarm: at least once a ms, and when a timer is due.
#[exception]
fn PendSV() {
    board::wake_readers();
    pulse::listen();
    time::on_alarm();
}
