//! Who interrupts whom: the one table of priorities.
//!
//! *Design.* The tick stands above everything (Shim, Joo, Kim 2021, step II: the
//! NVIC priority of SysTick at 0). Below it the serial lines, which stamp and
//! store and wake nobody; then the alarm, which wakes tasks, and beside it the pulse,
//! whose stamp is the hardware's and can wait 774 µs; then the executor
//! of what must be prompt, and last that of what may take its time. Thread level
//! sleeps, so that an interrupt which wakes nobody goes back to sleep at once.
//!
//! *Limits.* The STM32F427 has the upper four bits of each priority. Nothing that
//! reads the clock may stand above the tick (`timebase::tick`).

/// SysTick: counts time.
pub const TICK: u8 = 0x00;
/// UART4 and USART2: stamp and store bytes.
pub const SERIAL: u8 = 0x10;
/// PendSV: due timers, and tasks whose ring has bytes.
pub const ALARM: u8 = 0x20;
/// TIM4: names the round of a captured edge, and wakes its task. Not above the alarm,
/// which turns it on.
pub const PULSE: u8 = ALARM;
/// The executor of the GNSS and MAVLink tasks.
pub const PROMPT: u8 = 0x30;
/// The executor of the status line and the LED, and of all that may block.
pub const PATIENT: u8 = 0x40;
