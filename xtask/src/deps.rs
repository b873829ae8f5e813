//! `deps`: who may know whom.
//!
//! *Purpose.* The rooms of the project are kept apart by what their packages may
//! depend on; this is the list, and the check.
//!
//! *Limits.* Normal dependencies only: tests may use what they like.

mod circles;
mod graph;
mod imports;
mod mentions;
mod modules;
mod names;
mod source;
#[cfg(test)]
mod tests;

use anyhow::{Context, Result, bail};

use crate::image;

/// Our packages and what each may depend on. The logic crates are listed with
/// their outside crates too: no HAL, no embassy, no executor may get in. `defmt` may be
/// a feature of each: it turns values into log frames and runs nothing.
const ALLOWED: [(&str, &[&str]); 6] = [
    ("timebase", &[]),
    ("utc-clock", &["timebase", "libm"]),
    ("ubx-link", &["timebase", "ublox"]),
    ("mavlink-node", &["timebase", "sample-log", "mavlink"]),
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
            if on == "defmt" && dependency["optional"] == true {
                continue;
            }
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

/// Checks every crate of the workspace for circles of files.
///
/// # Errors
///
/// Shows one of the shortest rounds of each circle.
pub fn check_circles() -> Result<()> {
    let metadata = image::metadata()?;
    let base = image::root().canonicalize()?;
    let packages = metadata["packages"]
        .as_array()
        .context("cargo's metadata have no packages")?;
    let mut found = Vec::new();
    let mut crates = 0;
    for package in packages {
        for target in package["targets"].as_array().into_iter().flatten() {
            let kind = target["kind"][0].as_str().unwrap_or_default();
            if !["lib", "bin", "custom-build"].contains(&kind) {
                continue;
            }
            crates += 1;
            let root = target["src_path"].as_str().unwrap_or_default();
            for circle in circles::of_crate(root.as_ref(), &base)? {
                found.push(format!(
                    "{}: {circle}",
                    package["name"].as_str().unwrap_or_default()
                ));
            }
        }
    }
    if !found.is_empty() {
        bail!(
            "{}\nMove what one file needs of the other into a file of its own, below both",
            found.join("\n")
        );
    }
    println!("{crates} crates: no circle of files");
    Ok(())
}
