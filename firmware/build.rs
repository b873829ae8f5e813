//! Build settings, and the linker's arguments.
//!
//! *Design.* Settings come from the environment, so that one command builds one image:
//! `PIXCLOCK_TICK_US=200 cargo build -p firmware …`. What the crate `variant` does not allow is refused
//! with the list of what it does.

use std::fmt::Write as _;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::Command;
use std::{env, fs};

use variant::{Load, Variant};

/// How a PING is answered: with the board's time (the default), or as the MAVLink guide's echo.
const PINGS: [&str; 2] = ["rtos", "echo"];

/// Rates of the MAVLink line, the default first; 57 600 is what SiK radios have out of their box.
const MAVLINK_BAUDS: [u32; 2] = [115_200, 57_600];

/// Lines that can speak STANAG 4586 instead of MAVLink, the default first: none.
const STANAG_LINES: [&str; 2] = ["none", "telem2"];

/// Characters of a string of USB's: its descriptor, of two bytes for each and two more, fits into a packet.
const USB_STRING: usize = 31;

/// Settings that have another name now, and that name.
const RENAMED: [(&str, &str); 1] = [("PIXCLOCK_WAY", "PIXCLOCK_VARIANT")];

fn main() {
    refuse_old_names();
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("settings.rs"), settings()).expect("OUT_DIR can be written");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        link();
    }
}

/// The constants of `settings.rs`.
fn settings() -> String {
    let mut settings = String::new();
    let name = choice(
        "PIXCLOCK_VARIANT",
        Variant::STANDARD.name(),
        Variant::NAMES,
        "",
    );
    let variant = Variant::named(name).expect("it is one of the names");
    let with_variant = format!(" with PIXCLOCK_VARIANT={name}");
    let tick_us = choice(
        "PIXCLOCK_TICK_US",
        variant.tick_us(),
        variant.ticks_us(),
        &with_variant,
    );
    let variant = variant
        .with_tick_us(tick_us)
        .expect("it is one of the ticks");
    constant(
        &mut settings,
        "How the clock is kept, and the tick (`PIXCLOCK_VARIANT`, `PIXCLOCK_TICK_US`).",
        &format!("VARIANT: Variant = Variant::{variant:?}"),
    );
    let [default, ..] = *variant.gps_bauds() else {
        panic!("{variant} has no baud rate");
    };
    let gps_baud: u32 = choice(
        "PIXCLOCK_GPS_BAUD",
        default,
        variant.gps_bauds().iter().copied(),
        &with_variant,
    );
    constant(
        &mut settings,
        "The rate of the receiver's line (`PIXCLOCK_GPS_BAUD`). [Bd]",
        &format!("GPS_BAUD: u32 = {gps_baud}"),
    );
    let [default, ..] = MAVLINK_BAUDS;
    let mavlink_baud = choice("PIXCLOCK_MAVLINK_BAUD", default, MAVLINK_BAUDS, "");
    constant(
        &mut settings,
        "The rate of the MAVLink line (`PIXCLOCK_MAVLINK_BAUD`). [Bd]",
        &format!("MAVLINK_BAUD: u32 = {mavlink_baud}"),
    );
    let [none, _] = STANAG_LINES;
    println!("cargo:rustc-check-cfg=cfg(stanag)");
    if choice("PIXCLOCK_STANAG", none, STANAG_LINES, "") != none {
        println!("cargo:rustc-cfg=stanag");
        constant(
            &mut settings,
            "The first 32 bits of the commit's hash; 0 outside of a repository.",
            &format!("GIT_HASH: u32 = {}", git_hash()),
        );
    }
    let manufacturer = text("PIXCLOCK_USB_MANUFACTURER", "pixclock");
    constant(
        &mut settings,
        "The manufacturer that the USB device names (`PIXCLOCK_USB_MANUFACTURER`).",
        &format!("USB_MANUFACTURER: &str = {manufacturer:?}"),
    );
    let product = text("PIXCLOCK_USB_PRODUCT", "pixclock on a Pixhawk 1");
    constant(
        &mut settings,
        "The product that the USB device names (`PIXCLOCK_USB_PRODUCT`).",
        &format!("USB_PRODUCT: &str = {product:?}"),
    );
    let [ping, _] = PINGS;
    let echo = choice("PIXCLOCK_PING", ping, PINGS, "") == "echo";
    constant(
        &mut settings,
        "Whether a PING is echoed instead of answered with the board's time (`PIXCLOCK_PING`).",
        &format!("PING_ECHO: bool = {echo}"),
    );
    let system_id: u8 = number("PIXCLOCK_SYSTEM_ID", 1, 1..=254, "");
    constant(
        &mut settings,
        "The value of the image's word for its MAVLink system id (`PIXCLOCK_SYSTEM_ID`).",
        &format!("SYSTEM_ID: u8 = {system_id}"),
    );
    let latency_us: u32 = number(
        "PIXCLOCK_LATENCY_US",
        0,
        0..=variant.max_latency_us(),
        &with_variant,
    );
    constant(
        &mut settings,
        "From a solution's epoch to its message's first byte (`PIXCLOCK_LATENCY_US`). [ns]",
        &format!("LATENCY_NS: u32 = {}", latency_us * 1_000),
    );
    if let Some(load) = load() {
        println!("cargo:rustc-cfg=loaded");
        constant(
            &mut settings,
            "What else keeps the core busy (`PIXCLOCK_LOAD`).",
            &format!("LOAD: &str = \"{load}\""),
        );
    }
    settings
}

/// The load beside the clock, if there is to be one: without the setting the image has nothing of it.
fn load() -> Option<Load> {
    println!("cargo:rerun-if-env-changed=PIXCLOCK_LOAD");
    println!("cargo:rustc-check-cfg=cfg(loaded)");
    let text = env::var("PIXCLOCK_LOAD").ok()?;
    match text.parse() {
        Ok(load) => Some(load),
        Err(refusal) => panic!("PIXCLOCK_LOAD is `{text}`: {refusal}"),
    }
}

/// An old name would otherwise be ignored, and the image would be another one than was meant.
fn refuse_old_names() {
    for (old, new) in RENAMED {
        println!("cargo:rerun-if-env-changed={old}");
        assert!(env::var_os(old).is_none(), "{old} has the name {new} now");
    }
}

/// The first 32 bits of the commit that is built.
fn git_hash() -> u32 {
    println!("cargo:rerun-if-changed=../.git/logs/HEAD");
    let git = Command::new("git")
        .args(["rev-parse", "--short=8", "HEAD"])
        .output();
    let hash = git.ok().and_then(|it| String::from_utf8(it.stdout).ok());
    hash.and_then(|it| u32::from_str_radix(it.trim().get(..8)?, 16).ok())
        .unwrap_or(0)
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

/// The value of the setting `name`, which is one of `allowed`. `with` says what that depends on.
fn choice<T>(name: &str, default: T, allowed: impl IntoIterator<Item = T>, with: &str) -> T
where
    T: std::fmt::Display,
{
    println!("cargo:rerun-if-env-changed={name}");
    let value = env::var(name).unwrap_or_else(|_| default.to_string());
    let mut names = Vec::new();
    for choice in allowed {
        if choice.to_string() == value {
            return choice;
        }
        names.push(choice.to_string());
    }
    panic!("{name} is `{value}`; allowed{with}: {}", names.join(", "))
}

/// The value of the setting `name`, which is a number in a range. `with` says what that depends on.
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

/// The value of the setting `name`, which is a string of USB's.
fn text(name: &str, default: &str) -> String {
    println!("cargo:rerun-if-env-changed={name}");
    let text = env::var(name).unwrap_or_else(|_| default.to_owned());
    let is_printable = text.bytes().all(|byte| matches!(byte, b' '..=b'~'));
    assert!(
        is_printable && (1..=USB_STRING).contains(&text.len()),
        "{name} is `{text}`; allowed: 1 to {USB_STRING} printable ASCII characters"
    );
    text
}

fn constant(settings: &mut String, doc: &str, definition: &str) {
    writeln!(settings, "/// {doc}\npub const {definition};").expect("a string takes it");
}
