//! pixclock on the board: wiring only.
//!
//! The data flow, from module to module:
//!
//! ```text
//! lines (interrupts, stamps) ─▶ tasks::gnss ─▶ clock::CLOCK ─▶ tasks::mavlink
//! drivers::time (SysTick) ──────── every stamp and every reading ─┘
//! ```
//!
//! Below the tasks stand the lines and drivers, below these the board's constants; `bring_up`
//! knows them all. On the host this package is a stub, so that a cargo call over the whole workspace
//! passes there too.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod base_time;
#[cfg(all(target_os = "none", feature = "bench"))]
mod bench;
#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
mod bootloader;
#[cfg(target_os = "none")]
mod bring_up;
#[cfg(target_os = "none")]
mod clock;
#[cfg(target_os = "none")]
mod clock_events;
#[cfg(target_os = "none")]
mod clock_news;
#[cfg(target_os = "none")]
mod devices;
#[cfg(target_os = "none")]
mod drivers;
#[cfg(target_os = "none")]
mod executors;
#[cfg(target_os = "none")]
mod fault;
#[cfg(target_os = "none")]
mod image_words;
#[cfg(target_os = "none")]
mod latest;
#[cfg(target_os = "none")]
mod lines;
#[cfg(all(target_os = "none", loaded))]
mod load;
#[cfg(target_os = "none")]
mod logger;
#[cfg(target_os = "none")]
mod masks;
#[cfg(target_os = "none")]
mod not_saved;
#[cfg(target_os = "none")]
mod priorities;
#[cfg(target_os = "none")]
mod reports;
#[cfg(target_os = "none")]
mod reset;
#[cfg(target_os = "none")]
mod sample_memory;
#[cfg(target_os = "none")]
mod samples;
#[cfg(target_os = "none")]
mod settings;
#[cfg(target_os = "none")]
mod stack;
#[cfg(target_os = "none")]
mod start;
#[cfg(target_os = "none")]
mod storage;
#[cfg(target_os = "none")]
mod story;
#[cfg(target_os = "none")]
mod supervision;
#[cfg(target_os = "none")]
mod tasks;
#[cfg(target_os = "none")]
mod thread;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "this is firmware for a Pixhawk 1; `cargo run` flashes it, `cargo xtask sim` runs it here"
    );
    std::process::exit(2);
}
