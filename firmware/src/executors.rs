//! The two executors, each in an interrupt of a peripheral that this firmware does not use: the camera
//! interface and the second CAN.
//!
//! *Design.* The high one runs what must be prompt: the GNSS and the MAVLink task. The low one runs
//! what may take its time: the LED and the status line. So the first two never wait for the others. In
//! an image with a load the MAVLink task has an executor of its own, in the second CAN's reception, as PX4
//! has it below the GNSS task.

use embassy_executor::{InterruptExecutor, SendSpawner, SpawnError, SpawnToken};
use stm32f4xx_hal::pac::{Interrupt, interrupt};

/// The interrupt of the high executor, at [`priorities::EXECUTOR_HIGH`](crate::priorities::EXECUTOR_HIGH).
pub const HIGH_INTERRUPT: Interrupt = Interrupt::DCMI;

/// The interrupt of the low executor, at [`priorities::EXECUTOR_LOW`](crate::priorities::EXECUTOR_LOW).
pub const LOW_INTERRUPT: Interrupt = Interrupt::CAN2_TX;

/// The interrupt of the MAVLink task's executor, at
/// [`priorities::EXECUTOR_MAVLINK`](crate::priorities::EXECUTOR_MAVLINK).
#[cfg(loaded)]
pub const MAVLINK_INTERRUPT: Interrupt = Interrupt::CAN2_RX0;

static HIGH: InterruptExecutor = InterruptExecutor::new();
static LOW: InterruptExecutor = InterruptExecutor::new();
#[cfg(loaded)]
static MAVLINK: InterruptExecutor = InterruptExecutor::new();

/// Starts the high executor.
pub fn start_high() -> SendSpawner {
    HIGH.start(HIGH_INTERRUPT)
}

/// Starts the MAVLink task's executor.
#[cfg(loaded)]
pub fn start_mavlink() -> SendSpawner {
    MAVLINK.start(MAVLINK_INTERRUPT)
}

/// Starts the low executor.
pub fn start_low() -> SendSpawner {
    LOW.start(LOW_INTERRUPT)
}

/// Starts a task on `executor`. Panics when the task runs already.
#[inline(always)]
pub fn spawn<S: Send>(executor: &SendSpawner, task: Result<SpawnToken<S>, SpawnError>) {
    match task {
        Ok(task) => executor.spawn(task),
        Err(_) => panic!("a task was started twice"),
    }
}

#[interrupt]
fn DCMI() {
    // SAFETY: this is the executor's one handler, and `start` enables it.
    unsafe { HIGH.on_interrupt() }
}

#[interrupt]
fn CAN2_TX() {
    // SAFETY: this is the executor's one handler, and `start` enables it.
    unsafe { LOW.on_interrupt() }
}

#[cfg(loaded)]
#[interrupt]
fn CAN2_RX0() {
    // SAFETY: this is the executor's one handler, and `start` enables it.
    unsafe { MAVLINK.on_interrupt() }
}
