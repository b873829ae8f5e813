//! `ci`: everything that has to hold, in one go.
//!
//! *Design.* The quick checks come first. Each step is a command that a person can
//! give alone; its name and its time are printed.

use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use serde_json::Value;
use variant::Variant;

use crate::image::{TARGET, cargo, run, target_dir};

/// Runs every check, and stops at the first that fails.
///
/// # Errors
///
/// Names the step that failed.
pub fn run_all() -> Result<()> {
    let started = Instant::now();
    step("format", cargo().args(["fmt", "--all", "--check"]))?;
    step("dependency rule", xtask().arg("deps"))?;
    step(
        "clippy on the host",
        cargo()
            .args(["clippy", "--workspace", "--all-targets", "--locked"])
            .args(DENY_WARNINGS),
    )?;
    for (features, variant) in [
        ("pixhawk1", Variant::STANDARD),
        ("pixhawk1,bench", Variant::STANDARD),
        ("qemu", Variant::STANDARD),
        ("pixhawk1", Variant::PaperStep1),
    ] {
        step(
            &format!("clippy on the target, {features}, {variant}"),
            cargo()
                .args([
                    "clippy",
                    "--package",
                    "firmware",
                    "--release",
                    "--target",
                    TARGET,
                ])
                .args(["--no-default-features", "--features", features, "--locked"])
                .env("PIXCLOCK_VARIANT", variant.name())
                .args(DENY_WARNINGS),
        )?;
    }
    step("tests", cargo().args(["test", "--locked"]))?;
    step(
        "tests of the tools",
        cargo().args(["test", "--locked", "--package", "virtual-pixhawk", "--lib"]),
    )?;
    step(
        "docs",
        cargo()
            .args(["doc", "--workspace", "--no-deps", "--locked"])
            .env("RUSTDOCFLAGS", "--deny warnings"),
    )?;
    step("bounds", xtask().args(["compare", "--check"]))?;
    step("size", xtask().arg("size"))?;
    step("board tests", xtask().arg("board-test"))?;
    step(
        "the paper's experiment",
        xtask()
            .args(["testbed", "--check", "--duration", "60", "--method"])
            .arg(JUDGED_WAYS),
    )?;
    // As many PINGs as no board may lose one of, and more than the line carries.
    for rate in ["100", "1000"] {
        step(
            &format!("{rate} PINGs a second"),
            xtask()
                .args(["testbed", "--check", "--duration", "10"])
                .args(["--method", "pixclock", "--rate", rate]),
        )?;
    }
    the_same_files_again()?;
    step("cost", xtask().arg("bench"))?;
    step("sim", xtask().args(["sim", "--duration", "10"]))?;
    sim_follows_a_pulse()?;
    step("qemu", xtask().args(["qemu", "--duration", "10"]))?;
    step(
        "qemu in one of the paper's variants",
        xtask().args(["qemu", "--variant", "paper-step1", "--duration", "10"]),
    )?;
    step("ticks on qemu", xtask().arg("qemu-ticks"))?;
    step("pymavlink", xtask().arg("pymavlink"))?;
    println!("all of it holds, after {} s", started.elapsed().as_secs());
    Ok(())
}

/// The methods of the testbed that have bounds.
const JUDGED_WAYS: &str = "paper-default-mixed,paper-step1,paper-step2:50,pixclock,pixclock-pps";

/// Runs a short experiment twice, of methods with one image: its folders have to be the same,
/// byte for byte.
fn the_same_files_again() -> Result<()> {
    let place = target_dir()?.join("same-files");
    let folders = ["one", "other"].map(|name| place.join(name));
    for folder in &folders {
        // Of an earlier call.
        let _ = std::fs::remove_dir_all(folder);
        step(
            "a short experiment",
            xtask()
                .args(["testbed", "--duration", "10", "--settle", "10"])
                .args(["--method", "pixclock,pixclock-pps", "--out"])
                .arg(folder),
        )?;
    }
    let mut compare = Command::new("diff");
    step(
        "the same files again",
        compare.arg("--recursive").args(folders),
    )
}

/// Runs a virtual board with a pulse, which has to steer its clock in the end.
fn sim_follows_a_pulse() -> Result<()> {
    println!("== sim with a pulse");
    let output = xtask()
        .args(["sim", "--pulse", "--duration", "15", "--json"])
        .stderr(Stdio::inherit())
        .output()?;
    let told: Value = serde_json::from_slice(&output.stdout)?;
    let source = &told["boards"][0]["last_status"]["source"];
    ensure!(
        output.status.success() && source == "pulse",
        "step `sim with a pulse`: {source} steers"
    );
    Ok(())
}

/// What makes clippy fail on a warning.
const DENY_WARNINGS: [&str; 3] = ["--", "--deny", "warnings"];

fn xtask() -> Command {
    let mut cargo = cargo();
    cargo.args([
        "run",
        "--quiet",
        "--locked",
        "--package",
        "xtask",
        "--bin",
        "xtask",
        "--",
    ]);
    cargo
}

fn step(name: &str, command: &mut Command) -> Result<()> {
    println!("== {name}");
    let started = Instant::now();
    run(command).with_context(|| format!("step `{name}`"))?;
    println!("== {name}: {} s", started.elapsed().as_secs());
    Ok(())
}
