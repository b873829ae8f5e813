//! pixclock on the board: wiring only.
//!
//! The way of the data, from module to module:
//!
//! ```text
//! board::lines (interrupts, stamps) ─▶ tasks::gnss ─▶ shared::CLOCK ─▶ tasks::mavlink
//! drivers::time (SysTick) ─────────────── every stamp and every reading ─┘
//! ```
//!
//! On the host this package is a stub, so that a call over the whole workspace
//! passes there too.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", feature = "bench"))]
mod bench;
#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod drivers;
#[cfg(target_os = "none")]
mod fault;
#[cfg(target_os = "none")]
mod holdings;
#[cfg(target_os = "none")]
mod priorities;
#[cfg(target_os = "none")]
mod samples;
#[cfg(target_os = "none")]
mod settings;
#[cfg(target_os = "none")]
mod shared;
#[cfg(target_os = "none")]
mod start;
#[cfg(target_os = "none")]
mod storage;
#[cfg(target_os = "none")]
mod system_id;
#[cfg(target_os = "none")]
mod tasks;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "this is firmware for a Pixhawk 1; `cargo run` flashes it, `cargo xtask sim` runs it here"
    );
    std::process::exit(2);
}
