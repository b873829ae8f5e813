//! `qemu-ticks`: the interrupts per second of each tick setting, counted by QEMU.
//!
//! *Design.* QEMU runs with `-icount`, so that its virtual time depends on nothing
//! outside, and traces each interrupt that its SysTick raises into a file, and each
//! exception. The status line, which the firmware logs once a second of its own
//! time, shows there as semihosting calls: what lies between two of them is a second.
//!
//! *Limits.* Interrupts raised, not taken: with `sleep=off` QEMU 7.2 lets two go by
//! while the core sleeps and takes them as one, which the firmware makes good.

use std::fs;
use std::thread;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use variant::{TICKS_US, Variant};

use crate::image;
use crate::qemu::machine::{self, Running};

/// SysTick's interrupt (`-trace`) and semihosting (`-d int`) in QEMU's log.
const TICK: &str = "systick_timer_tick";
const SEMIHOSTING: &str = "Taking exception 16 [Semihosting call]";

/// The least ticks between two status lines, at the slowest setting.
const APART: usize = 900;

/// How long a run may take before it is given up.
const PATIENCE: Duration = Duration::from_secs(120);

/// Counts at every setting and holds it against the setting.
///
/// # Errors
///
/// When a count is wrong, or QEMU is not there.
pub fn check() -> Result<()> {
    machine::check()?;
    for tick_us in TICKS_US {
        let expected = 1_000_000 / tick_us as usize;
        let counted = count(tick_us)?;
        console::print_line!(
            "tick {tick_us:>4} µs: {counted} interrupts in a second, {expected} wanted"
        );
        if counted.abs_diff(expected) > expected / 1_000 + 1 {
            bail!("the tick of {tick_us} µs does not come as often as it should");
        }
    }
    Ok(())
}

/// Interrupts of SysTick in the second between two status lines.
fn count(tick_us: u32) -> Result<usize> {
    let image = machine::build(Variant::Pixclock { tick_us })?;
    let log = image::target_dir()?.join(format!("qemu-ticks-{tick_us}us.log"));
    let qemu = Running(
        machine::command(&image)
            .args([
                "-icount",
                "shift=3,sleep=off",
                "-trace",
                TICK,
                "-d",
                "int",
                "-D",
            ])
            .arg(&log)
            .args([
                "-serial", "null", "-serial", "null", "-serial", "null", "-serial", "null",
            ])
            .stdout(std::process::Stdio::null())
            .spawn()
            .context("cannot start QEMU")?,
    );
    let started = Instant::now();
    let counted = loop {
        thread::sleep(Duration::from_millis(500));
        let text = fs::read_to_string(&log).unwrap_or_default();
        if let Some(counted) = between_status_lines(&text) {
            break counted;
        }
        if started.elapsed() > PATIENCE {
            bail!("no two status lines in {} s", PATIENCE.as_secs());
        }
    };
    drop(qemu);
    fs::remove_file(&log)?;
    Ok(counted)
}

/// Ticks from the second status line to the third, if the third has come: by the
/// second the firmware has settled.
fn between_status_lines(log: &str) -> Option<usize> {
    let mut seconds = Vec::new();
    let mut ticks = 0;
    for line in log.lines() {
        if line.starts_with(TICK) {
            ticks += 1;
        } else if line.starts_with(SEMIHOSTING) {
            if ticks >= APART {
                seconds.push(ticks);
            }
            if ticks >= APART || seconds.is_empty() {
                ticks = 0;
            }
        }
    }
    seconds.get(2).copied()
}
