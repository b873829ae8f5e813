//! The table of steps: what has to hold, and by which command a person checks it alone.
//!
//! *Design.* The quick checks come first. What computes runs in turn, because each of it uses every
//! core. What runs in real time mostly waits, so all of it runs side by side, on ports of its own;
//! what it needs was built by the steps before.

use std::fmt::Display;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};
use variant::Variant;

use super::checks;
use crate::image::{TARGET, cargo, metadata, target_dir};

/// A command that has to succeed.
pub struct Step {
    /// What it is called in the output.
    pub name: String,
    /// What a person would type.
    pub command: Command,
    /// What its standard output has to be, too.
    pub check: Option<fn(&str) -> Result<()>>,
    /// A program that is not everywhere: without it the step is skipped, but not in CI.
    pub needs: Option<&'static str>,
}

/// Steps that belong together.
pub enum Group {
    /// One after the other.
    InTurn(Vec<Step>),
    /// All at once.
    SideBySide(Vec<Step>),
}

impl Step {
    fn new(name: impl Display, command: Command) -> Self {
        Self {
            name: name.to_string(),
            command,
            check: None,
            needs: None,
        }
    }

    fn cargo(name: impl Display, arguments: &[&str]) -> Self {
        let mut command = cargo();
        command.args(arguments);
        Self::new(name, command)
    }

    fn xtask(name: impl Display, arguments: &[&str]) -> Self {
        let run = [
            "run",
            "--quiet",
            "--locked",
            "--package",
            "xtask",
            "--bin",
            "xtask",
            "--",
        ];
        let mut step = Self::cargo(name, &run);
        step.command.args(arguments);
        step
    }

    fn arg(mut self, argument: impl AsRef<std::ffi::OsStr>) -> Self {
        self.command.arg(argument);
        self
    }

    fn env(mut self, name: &str, value: &str) -> Self {
        self.command.env(name, value);
        self
    }

    fn needs(self, program: &'static str) -> Self {
        let needs = Some(program);
        Self { needs, ..self }
    }

    fn check(self, check: fn(&str) -> Result<()>) -> Self {
        let check = Some(check);
        Self { check, ..self }
    }
}

/// Everything that has to hold.
///
/// # Errors
///
/// When cargo does not say what is in the workspace.
pub fn all() -> Result<Vec<Group>> {
    Ok(vec![
        Group::InTurn(rules()),
        Group::InTurn(lints()),
        Group::SideBySide(other_systems()),
        Group::InTurn(tests()?),
        Group::InTurn(figures()),
        Group::InTurn(same_files_again(&target_dir()?.join("same-files"))),
        Group::SideBySide(in_real_time()),
    ])
}

/// What needs no build of ours but xtask's.
fn rules() -> Vec<Step> {
    vec![
        Step::cargo("format", &["fmt", "--all", "--check"]),
        Step::xtask("dependencies and circles", &["deps"]),
        Step::cargo(
            "licences, sources, bans",
            &["deny", "check", "bans", "licenses", "sources"],
        )
        .needs("cargo-deny"),
    ]
}

fn lints() -> Vec<Step> {
    let host = [
        "clippy",
        "--workspace",
        "--all-targets",
        "--locked",
        "--",
        "--deny",
        "warnings",
    ];
    let mut steps = vec![Step::cargo("clippy on the host", &host)];
    for (features, variant) in [
        ("pixhawk1", Variant::STANDARD),
        ("pixhawk1,bench", Variant::STANDARD),
        ("qemu", Variant::STANDARD),
        ("pixhawk1", Variant::PaperStep1),
    ] {
        let firmware = [
            "clippy",
            "--package",
            "firmware",
            "--release",
            "--target",
            TARGET,
        ];
        let step = Step::cargo(
            format!("clippy on the target, {features}, {variant}"),
            &firmware,
        )
        .env("PIXCLOCK_VARIANT", variant.name());
        let rest = ["--no-default-features", "--features", features, "--locked"];
        let rest = rest.into_iter().chain(["--", "--deny", "warnings"]);
        steps.push(rest.fold(step, Step::arg));
    }
    steps
}

/// The verbs for Windows and macOS, which no test of ours runs on.
fn other_systems() -> Vec<Step> {
    /// What rustup has of each: the standard library; nothing is linked.
    const TARGETS: [&str; 3] = [
        "x86_64-pc-windows-gnu",
        "x86_64-pc-windows-msvc",
        "aarch64-apple-darwin",
    ];
    let check = ["check", "--package", "xtask", "--locked", "--target"];
    let of = |target| Step::cargo(format!("check for {target}"), &check).arg(target);
    TARGETS.map(of).into()
}

fn tests() -> Result<Vec<Step>> {
    let tools = [
        "test",
        "--locked",
        "--package",
        "virtual-pixhawk",
        "--lib",
        "--bins",
    ];
    let mut steps = vec![
        Step::cargo("tests", &["test", "--locked"]),
        Step::cargo("tests of the tools", &tools),
    ];
    steps.extend(cards());
    for name in logic_crates()? {
        let alone = ["test", "--doc", "--locked", "--package", &name];
        steps.push(Step::cargo(format!("doctests of {name} alone"), &alone));
    }
    // The emulator's own documentation would be built for nothing.
    let docs = [
        "doc",
        "--workspace",
        "--exclude",
        "virtual-pixhawk",
        "--no-deps",
        "--locked",
    ];
    steps.push(Step::cargo("docs", &docs).env("RUSTDOCFLAGS", "--deny warnings"));
    Ok(steps)
}

/// Damaged cards, and some as people have them where the script that makes these is there.
fn cards() -> Vec<Step> {
    /// One of each kind, without those that are large.
    const SOME: [&str; 12] = [
        "mbr_fat16",
        "superfloppy_fat32",
        "linux_first_fat_second",
        "fat16_64k_4gb",
        "fat32_few_clusters",
        "one_table",
        "dirty_fat32",
        "full_fat32",
        "root_clusters_full_fat32",
        "name_9999",
        "cross_linked",
        "root_loops",
    ];
    let mut steps = vec![Step::xtask("damaged cards", &["card-faults", "--check"])];
    let script = std::env::var_os("PIXCLOCK_CAPTURES")
        .map(|captures| Path::new(&captures).join("cards/cards.py"));
    if let Some(script) = script.filter(|script| script.exists()) {
        let some = Step::xtask("cards as people have them", &["card-faults", "--images"]);
        let named = |step: Step, name: &str| step.arg("--only").arg(name);
        steps.push(
            SOME.into_iter()
                .fold(some.arg(script), named)
                .needs("mtools"),
        );
    }
    steps
}

/// The names of the packages below `firmware/crates`.
fn logic_crates() -> Result<Vec<String>> {
    let metadata = metadata()?;
    let packages = metadata["packages"]
        .as_array()
        .context("cargo names no packages")?;
    let is_logic = |package: &&serde_json::Value| {
        let manifest = package["manifest_path"].as_str().map(Path::new);
        manifest.is_some_and(|path| path.components().any(|part| part.as_os_str() == "crates"))
    };
    let names = packages.iter().filter(is_logic);
    let names = names.map(|package| package["name"].as_str().map(str::to_owned));
    names
        .collect::<Option<_>>()
        .context("a package has no name")
}

/// Accuracy, size, cost, and what the flashed image does.
fn figures() -> Vec<Step> {
    // The methods of the testbed that have bounds.
    const JUDGED: &str = "paper-default-mixed,paper-step1,paper-step2:50,pixclock,pixclock-pps";
    let experiment = ["testbed", "--check", "--duration", "60", "--method", JUDGED];
    let mut steps = vec![
        Step::xtask("bounds", &["compare", "--check"]),
        Step::xtask("integrity", &["integrity", "--check"]),
        Step::xtask("size", &["size"]),
        Step::xtask("a firmware file", &["px4", "target/pixclock.px4"]),
        // Both paces, 1.0 and 1.6, by hand: one takes as long as all other steps of this group.
        Step::xtask("board tests", &["board-test", "--cpi", "1.0"]),
        Step::xtask("the paper's experiment", &experiment),
    ];
    // One run of each method under PX4's load; the whole table is in docs/results.
    let mut loaded = Step::xtask("the paper's experiment under load", &["testbed", "--check"]);
    for option in ["--load", "px4", "--duration", "20", "--settle", "30"] {
        loaded = loaded.arg(option);
    }
    steps.push(loaded);
    let by_usb = [
        "testbed",
        "--check",
        "--link",
        "usb",
        "--method",
        "pixclock-pps",
    ];
    let by_usb = Step::xtask("the paper's experiment by USB", &by_usb);
    let by_usb = by_usb.arg("--duration").arg("60");
    steps.push(by_usb.arg("--settle").arg("60"));
    // As many PINGs as no board may lose one of, and more than the line carries.
    for rate in ["100", "1000"] {
        let test = [
            "testbed",
            "--check",
            "--duration",
            "10",
            "--method",
            "pixclock",
            "--rate",
            rate,
        ];
        steps.push(Step::xtask(format!("{rate} PINGs a second"), &test));
    }
    steps.push(Step::xtask("cost", &["bench"]));
    steps
}

/// A short experiment twice, of methods with one image: its folders, in `place`, have to be the
/// same, byte for byte.
fn same_files_again(place: &Path) -> Vec<Step> {
    let folders = ["one", "other"].map(|name| place.join(name));
    let mut remove = Command::new("rm");
    remove.args(["--recursive", "--force"]).arg(place);
    let mut steps = vec![Step::new("no files of an earlier run", remove)];
    for folder in &folders {
        let short = ["testbed", "--duration", "10", "--settle", "10", "--method"];
        let short = Step::xtask("a short experiment", &short);
        steps.push(short.arg("pixclock,pixclock-pps").arg("--out").arg(folder));
    }
    let mut compare = Command::new("diff");
    compare.arg("--recursive").args(folders);
    steps.push(Step::new("the same files again", compare));
    steps
}

/// What takes as long as it takes, whatever the machine. The ports are apart; pymavlink has 5790 and
/// 5791, the clients 5792, synapse-cdm 5793.
fn in_real_time() -> Vec<Step> {
    let pulse = [
        "sim",
        "--pulse",
        "--duration",
        "20",
        "--json",
        "--mavlink-port",
        "5762",
    ];
    let paper = [
        "qemu",
        "--variant",
        "paper-step1",
        "--duration",
        "10",
        "--mavlink-port",
        "5766",
    ];
    vec![
        Step::xtask("sim", &["sim", "--duration", "10"]).check(checks::two_boards_are_apart),
        Step::xtask("sim with a pulse", &pulse).check(checks::boards_follow_the_pulse),
        Step::xtask(
            "qemu",
            &["qemu", "--duration", "10", "--mavlink-port", "5764"],
        ),
        Step::xtask("qemu in one of the paper's variants", &paper),
        Step::xtask("ticks on qemu", &["qemu-ticks"]),
        Step::xtask("pymavlink", &["pymavlink"]),
        Step::xtask("MAVProxy and MAVSDK", &["clients"]),
        Step::xtask("synapse-cdm", &["synapse"]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    fn words(step: &Step) -> Vec<String> {
        let words = step.command.get_args();
        words
            .map(|word| word.to_string_lossy().into_owned())
            .collect()
    }

    #[test]
    fn each_logic_crate_has_its_doctests_run_alone() {
        let names = logic_crates().unwrap();
        for name in [
            "timebase",
            "utc-clock",
            "ubx-link",
            "mavlink-node",
            "sample-log",
        ] {
            assert!(
                names.iter().any(|crate_| crate_ == name),
                "{name} in {names:?}"
            );
        }
        assert!(
            !names
                .iter()
                .any(|name| name == "xtask" || name == "firmware")
        );
    }

    #[test]
    fn what_runs_side_by_side_has_ports_of_its_own() {
        let mut ports = BTreeSet::from([5_790, 5_791, 5_792, 5_793]);
        for step in in_real_time() {
            let words = words(&step);
            let Some(verb) = words
                .iter()
                .find(|word| ["sim", "qemu"].contains(&word.as_str()))
            else {
                continue;
            };
            let option = words.iter().position(|word| word == "--mavlink-port");
            let first: u16 = option.map_or(5_760, |at| words[at + 1].parse().unwrap());
            let boards = if verb == "sim" { 2 } else { 1 };
            for port in first..first + boards {
                assert!(ports.insert(port), "{port} of {}", step.name);
            }
        }
        assert_eq!(ports.len(), 10);
    }
}
