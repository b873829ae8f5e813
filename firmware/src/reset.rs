//! From the bootloader's jump to a core in a known state, before any variable is initialized.
//!
//! *Purpose.* Nothing is taken on trust but that the first instruction runs: a Pixhawk 1 may have the
//! bootloader of PX4, which leaves the core as a reset does, or that of ArduPilot, which jumps with
//! interrupts masked twice, on the process stack and with interrupts enabled and pending
//! (`Tools/AP_Bootloader/bl_protocol.cpp`, `jump_to_app`; ChibiOS `port_disable`, `port_lock`).
//!
//! *Design.* cortex-m-rt calls [`__pre_init`] by its first instruction. It is assembly throughout,
//! because neither stack nor variables are there yet. Interrupts stay masked until
//! [`bring_up`](crate::bring_up) has set their priorities.
//!
//! Two more things are done here because they have to be done early and once. Stores are not buffered
//! (ACTLR.DISDEFWBUF): that is ARM's way around erratum 838869, in which a handler that ends behind a
//! store may be entered again, and it makes every bus fault name the instruction that caused it. And
//! the stack is painted, for [`stack`](crate::stack).
//!
//! *Limits.* A bootloader that jumps from an exception's handler, or without privileges, is not
//! provided for: none is known. The other peripherals are the board's
//! ([`take_over`](crate::board::take_over)).

use core::arch::naked_asm;

/// What unused words of the stack hold.
pub const PAINT: u32 = 0xC1C1_C1C1;

#[unsafe(naked)]
#[unsafe(no_mangle)]
unsafe extern "C" fn __pre_init() {
    naked_asm!(
        // Masked, on the main stack, privileged, without a pending floating-point context.
        "cpsid i",
        "movs r0, #0",
        "msr BASEPRI, r0",
        // MSR could not: with FAULTMASK set it has no effect (ARMv7-M, B5.2.3).
        "cpsie f",
        "ldr r1, =_stack_start",
        "msr MSP, r1",
        "msr CONTROL, r0",
        "isb",
        // r2: the system control space. SysTick off, ACTLR.DISDEFWBUF on, FPCCR as after a reset.
        "ldr r2, =0xE000E000",
        "str r0, [r2, #0x10]",
        "movs r3, #2",
        "str r3, [r2, #0x08]",
        "ldr r3, =0xC0000000",
        "str r3, [r2, #0xF34]",
        // r1: the system control block. VTOR; PendSV and SysTick not pending; no sub-priorities; no
        // deep sleep; faults escalate; no MPU.
        "add r1, r2, #0xD00",
        "ldr r3, =__vector_table",
        "str r3, [r1, #0x08]",
        "ldr r3, =0x0A000000",
        "str r3, [r1, #0x04]",
        "ldr r3, =0x05FA0000",
        "str r3, [r1, #0x0C]",
        "str r0, [r1, #0x10]",
        "str r0, [r1, #0x24]",
        "str r0, [r1, #0x94]",
        // ICER and ICPR, eight words each: no interrupt is enabled or pending.
        "add r1, r2, #0x180",
        "mvn r3, r0",
        "movs r0, #8",
        "1:",
        "str r3, [r1, #0x100]",
        "str r3, [r1], #4",
        "subs r0, #1",
        "bne 1b",
        "dsb",
        "isb",
        // The whole stack is unused.
        "ldr r0, =_stack_end",
        "ldr r1, =_stack_start",
        "ldr r2, ={paint}",
        "mov r3, r2",
        "2:",
        "stm r0!, {{r2, r3}}",
        "stm r0!, {{r2, r3}}",
        "cmp r0, r1",
        "blo 2b",
        "bx lr",
        paint = const PAINT,
    )
}
