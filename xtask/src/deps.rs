//! `deps`: who may know whom.
//!
//! *Purpose.* The rooms of the project are kept apart by what their packages may
//! depend on; this is the list, and the check.
//!
//! *Limits.* Normal dependencies only: tests may use what they like.

use anyhow::{Context, Result, bail};

use crate::image;

/// Our packages and what each may depend on. The logic crates are listed with
/// their outside crates too: no HAL, no embassy, no executor may get in.
const ALLOWED: [(&str, &[&str]); 6] = [
    ("timebase", &[]),
    ("utc-clock", &["timebase", "libm"]),
    ("ubx-link", &["timebase", "ublox"]),
    ("mavlink-node", &["timebase", "mavlink"]),
    ("sample-log", &[]),
    ("card-file", &["timebase", "embedded-sdmmc", "heapless"]),
];

/// Packages that nobody may depend on: what runs is never a library.
const NOBODYS: [&str; 2] = ["firmware", "xtask"];

/// Checks the rule over the whole workspace.
///
/// # Errors
///
/// Names every dependency that the rule forbids.
pub fn check() -> Result<()> {
    let metadata = image::metadata()?;
    let packages = metadata["packages"]
        .as_array()
        .context("cargo's metadata have no packages")?;
    let mut broken = Vec::new();
    let mut checked = 0;
    for package in packages {
        let name = package["name"].as_str().unwrap_or_default();
        let allowed = ALLOWED.iter().find(|(package, _)| *package == name);
        let dependencies = package["dependencies"].as_array().into_iter().flatten();
        for dependency in dependencies.filter(|dependency| dependency["kind"].is_null()) {
            let on = dependency["name"].as_str().unwrap_or_default();
            checked += 1;
            if NOBODYS.contains(&on) || allowed.is_some_and(|(_, list)| !list.contains(&on)) {
                broken.push(format!("{name} must not depend on {on}"));
            }
        }
    }
    for (name, _) in ALLOWED {
        if !packages.iter().any(|package| package["name"] == name) {
            broken.push(format!("{name} is in the rule but not in the workspace"));
        }
    }
    if !broken.is_empty() {
        bail!("{}", broken.join("\n"));
    }
    println!(
        "{} packages, {checked} dependencies: the rule holds",
        packages.len()
    );
    Ok(())
}
