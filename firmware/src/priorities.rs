//! Who interrupts whom: the one table of priorities.
//!
//! *Design.* The tick stands above everything (Shim, Joo, Kim 2021, step II: the NVIC priority of
//! SysTick at 0). Below it stand the serial lines, which stamp and store and wake no task; then USB, which
//! stamps and wakes, and whose packet waits in a FIFO; then the
//! alarm, which wakes tasks, and beside it the pulse, whose stamp is the hardware's and can wait
//! 774 µs; then the executor of what must be prompt, and last that of what may take its time. Thread
//! level sleeps, so that after an interrupt which wakes no task the core sleeps again at once.
//!
//! In the paper's variants all interrupts have the one priority of NuttX, so that none preempts
//! another, except SysTick in step II. The executors stand below them: on NuttX tasks run at thread
//! level, where every interrupt preempts them.
//!
//! An image with a load (`PIXCLOCK_LOAD`) makes room for it as a user with sensors would: ours between the
//! alarm and the tasks, the paper's among NuttX's interrupts, with PX4's tasks round GNSS and MAVLink in the
//! order of their priorities. PX4 receives by DMA, so there the lines stand above the load and its masks: a
//! late interrupt loses no byte. Without a load nothing moves.
//!
//! *Limits.* The STM32F427 has the upper four bits of each priority. No code above the tick may read
//! the clock (`timebase::tick`). NuttX masks interrupts by `BASEPRI`, which leaves step II's SysTick
//! enabled; here all are masked, for less than a tick.

use variant::Variant;

use crate::settings::VARIANT;

/// NuttX's priority of every interrupt (7, `arch/arm/include/stm32/chip.h`,
/// `NVIC_SYSH_PRIORITY_DEFAULT`).
const NUTTX: u8 = 0x80;

/// SysTick, which counts time.
pub const TICK: u8 = match VARIANT {
    Variant::Pixclock { .. } | Variant::PaperStep2 { .. } => 0x00,
    Variant::PaperDefault | Variant::PaperStep1 | Variant::PaperTickOnly { .. } => NUTTX,
};
/// TIM5, which finds that the tick or the alarm has stopped: above all that may have stopped them, but for
/// the tick's own handler, and seldom enough to disturb nobody.
pub const WATCH: u8 = 0x00;
/// UART4, USART2 and USART3, which stamp and store bytes.
pub const SERIAL: u8 = ours_or(0x10, if cfg!(loaded) { NUTTX - 0x10 } else { NUTTX });
/// OTG_FS, which stamps packets and empties the FIFO.
pub const USB: u8 = ours_or(0x20, NUTTX);
/// PendSV, which wakes tasks for due timers and for bytes in their ring.
pub const ALARM: u8 = ours_or(0x30, NUTTX);
/// TIM4, which finds the round of a captured edge and wakes its task. Not above the alarm, which
/// enables it.
pub const PULSE: u8 = ALARM;
/// The load's interrupts, and what its masked sections mask.
#[cfg(loaded)]
pub const LOAD: u8 = ours_or(0x40, NUTTX);
/// The load's tasks above the GNSS task.
#[cfg(loaded)]
pub const LOAD_ABOVE: u8 = ours_or(LOAD, NUTTX + 0x10);
/// The load's tasks between the GNSS and the MAVLink task: in ours, where these two stand alike, below both.
#[cfg(loaded)]
pub const LOAD_BETWEEN: u8 = ours_or(EXECUTOR_LOW, NUTTX + 0x30);
/// The load's tasks below both.
#[cfg(loaded)]
pub const LOAD_BELOW: u8 = EXECUTOR_LOW;
/// The executor of the GNSS task, and without a load of the MAVLink task.
pub const EXECUTOR_HIGH: u8 = if cfg!(loaded) {
    ours_or(0x50, NUTTX + 0x20)
} else {
    ours_or(0x40, NUTTX + 0x10)
};
/// The executor of the MAVLink task in an image with a load.
#[cfg(loaded)]
pub const EXECUTOR_MAVLINK: u8 = ours_or(EXECUTOR_HIGH, NUTTX + 0x40);
/// The executor of the status line and the LED.
pub const EXECUTOR_LOW: u8 = if cfg!(loaded) {
    ours_or(0x60, NUTTX + 0x50)
} else {
    ours_or(0x50, NUTTX + 0x20)
};

/// The priority of our variant, or that of the paper's.
const fn ours_or(ours: u8, papers: u8) -> u8 {
    if VARIANT.is_papers() { papers } else { ours }
}
