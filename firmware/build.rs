//! Build settings, and the linker's part.
//!
//! Settings come from the environment, so that one command builds one variant:
//! `PIXCLOCK_TICK_US=200 cargo build -p firmware …`. What is not allowed is refused here
//! with the list of what is.

use std::fmt::Write as _;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::{env, fs};

/// How the clock is kept, with the settings that it allows; the first of each list is
/// its default.
struct Variant {
    /// What `PIXCLOCK_VARIANT` says.
    name: &'static str,
    /// What `settings::Variant` says.
    variant: &'static str,
    /// Tick intervals in µs: those of Shim, Joo, Kim 2021, table 3.
    ticks_us: &'static [&'static str],
    /// Rates of the receiver's line.
    gps_bauds: &'static [&'static str],
    /// The most that the latency may be corrected by, in µs.
    latency_us: u32,
}

/// The paper's are PX4's rates: the one that it fixed, and a Here+'s own.
const PAPERS_BAUDS: &[&str] = &["115200", "38400"];

/// The first is the default.
const VARIANTS: [Variant; 4] = [
    Variant {
        name: "pixclock",
        variant: "Pixclock",
        ticks_us: &["50", "200", "500", "1000"],
        gps_bauds: &["115200"],
        latency_us: 500_000,
    },
    Variant {
        name: "paper-default",
        variant: "PaperDefault",
        ticks_us: &["1000"],
        gps_bauds: PAPERS_BAUDS,
        latency_us: 0,
    },
    Variant {
        name: "paper-step1",
        variant: "PaperStep1",
        ticks_us: &["1000"],
        gps_bauds: PAPERS_BAUDS,
        latency_us: 0,
    },
    Variant {
        name: "paper-step2",
        variant: "PaperStep2",
        ticks_us: &["50", "200", "500"],
        gps_bauds: PAPERS_BAUDS,
        latency_us: 0,
    },
];
/// How a PING is answered: with the board's time, or as the MAVLink guide's echo.
const PINGS: [&str; 2] = ["rtos", "echo"];

fn main() {
    let mut settings = String::new();
    let name = choice(
        "PIXCLOCK_VARIANT",
        &VARIANTS.map(|variant| variant.name),
        "",
    );
    let variant = VARIANTS
        .iter()
        .find(|variant| variant.name == name)
        .unwrap_or(&VARIANTS[0]);
    let with_variant = format!(" with PIXCLOCK_VARIANT={name}");
    constant(
        &mut settings,
        "How the clock is kept (`PIXCLOCK_VARIANT`).",
        &format!("VARIANT: Variant = Variant::{}", variant.variant),
    );
    constant(
        &mut settings,
        "Its name.",
        &format!("VARIANT_NAME: &str = \"{name}\""),
    );
    let tick_us = choice("PIXCLOCK_TICK_US", variant.ticks_us, &with_variant);
    constant(
        &mut settings,
        "From one tick to the next, in µs (`PIXCLOCK_TICK_US`).",
        &format!("TICK_US: u32 = {tick_us}"),
    );
    let gps_baud = choice("PIXCLOCK_GPS_BAUD", variant.gps_bauds, &with_variant);
    constant(
        &mut settings,
        "The rate of the receiver's line, in Bd (`PIXCLOCK_GPS_BAUD`).",
        &format!("GPS_BAUD: u32 = {gps_baud}"),
    );
    let echo = choice("PIXCLOCK_PING", &PINGS, "") == "echo";
    constant(
        &mut settings,
        "Whether a PING is echoed instead of answered with our time (`PIXCLOCK_PING`).",
        &format!("PING_ECHO: bool = {echo}"),
    );
    let system_id: u8 = number("PIXCLOCK_SYSTEM_ID", 1, 1..=254, "");
    constant(
        &mut settings,
        "The MAVLink system id that the image begins with (`PIXCLOCK_SYSTEM_ID`).",
        &format!("SYSTEM_ID: u8 = {system_id}"),
    );
    let latency_us: u32 = number(
        "PIXCLOCK_LATENCY_US",
        0,
        0..=variant.latency_us,
        &with_variant,
    );
    constant(
        &mut settings,
        "From a solution's epoch to its message's first byte, in ns (`PIXCLOCK_LATENCY_US`).",
        &format!("LATENCY_NS: u32 = {}", latency_us * 1_000),
    );
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("settings.rs"), settings).expect("OUT_DIR can be written");

    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        link();
    }
}

/// One memory map for both boards; the Pixhawk's image stands behind its bootloader.
fn link() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("..");
    println!("cargo:rustc-link-search={}", root.display());
    println!("cargo:rerun-if-changed=../memory.x");
    let on_pixhawk = env::var_os("CARGO_FEATURE_PIXHAWK1").is_some();
    let on_qemu = env::var_os("CARGO_FEATURE_QEMU").is_some();
    assert!(
        on_pixhawk != on_qemu,
        "exactly one board: the default feature `pixhawk1`, or `--no-default-features --features qemu`"
    );
    if on_pixhawk {
        println!("cargo:rustc-link-arg-bins=--defsym=_app_offset=0x4000");
    }
    for script in ["link.x", "defmt.x"] {
        println!("cargo:rustc-link-arg-bins=-T{script}");
    }
    println!("cargo:rustc-link-arg-bins=--nmagic");
}

/// The value of a setting that is one of a list, the first being the default. `with` says what
/// the list depends on.
fn choice(name: &str, allowed: &[&str], with: &str) -> String {
    println!("cargo:rerun-if-env-changed={name}");
    let value = env::var(name).unwrap_or_else(|_| allowed[0].to_owned());
    assert!(
        allowed.contains(&value.as_str()),
        "{name} is `{value}`; allowed{with}: {}",
        allowed.join(", ")
    );
    value
}

/// The value of a setting that is a number in a range. `with` says what that depends on.
fn number<T>(name: &str, default: T, allowed: RangeInclusive<T>, with: &str) -> T
where
    T: std::str::FromStr + PartialOrd + std::fmt::Display + Copy,
{
    println!("cargo:rerun-if-env-changed={name}");
    let Ok(text) = env::var(name) else {
        return default;
    };
    match text.parse() {
        Ok(value) if allowed.contains(&value) => value,
        _ => panic!(
            "{name} is `{text}`; allowed{with}: whole numbers from {} to {}",
            allowed.start(),
            allowed.end()
        ),
    }
}

fn constant(settings: &mut String, doc: &str, definition: &str) {
    writeln!(settings, "/// {doc}\npub const {definition};").expect("a string takes it");
}
