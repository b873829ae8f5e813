//! `deps`: who may know whom, among the packages and among the files of each.
//!
//! *Purpose.* What depends on nothing below it can be read, tested and moved alone.
//! Between packages a table says what is allowed ([`rule`]); between the files of a
//! crate it is enough that there is no circle ([`circles`]).

mod circles;
mod graph;
mod imports;
mod mentions;
mod modules;
mod names;
mod rule;
mod source;
#[cfg(test)]
mod tests;

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde_json::Value;

use crate::image;

/// The page that has the rule.
const PAGE: &str = "docs/architecture.md";

/// Checks the whole workspace.
///
/// # Errors
///
/// Names every dependency that the rule forbids, and shows each circle of files.
pub fn check() -> Result<()> {
    let metadata = image::metadata()?;
    let root = image::root().canonicalize()?;
    let mut broken = forbidden_dependencies(&metadata, &root)?;
    broken.extend(circles_of_files(&metadata, &root)?);
    if !broken.is_empty() {
        bail!("{}", broken.join("\n"));
    }
    Ok(())
}

fn forbidden_dependencies(metadata: &Value, root: &Path) -> Result<Vec<String>> {
    let page =
        std::fs::read_to_string(root.join(PAGE)).with_context(|| format!("cannot read {PAGE}"))?;
    let packages = rule::packages(metadata)?;
    let mut broken = rule::violations(&page, &packages);
    if broken.is_empty() {
        let dependencies: usize = packages
            .iter()
            .map(|package| package.dependencies.len())
            .sum();
        console::print_line!(
            "{} packages, {dependencies} dependencies: as {PAGE} has them",
            packages.len()
        );
    } else {
        broken.push(format!("Only what the table in {PAGE} names is allowed."));
    }
    Ok(broken)
}

fn circles_of_files(metadata: &Value, root: &Path) -> Result<Vec<String>> {
    let mut circles = Vec::new();
    let mut crates = 0;
    for package in metadata["packages"].as_array().into_iter().flatten() {
        for target in package["targets"].as_array().into_iter().flatten() {
            let kind = target["kind"][0].as_str().unwrap_or_default();
            if !["lib", "bin", "custom-build"].contains(&kind) {
                continue;
            }
            crates += 1;
            let source = target["src_path"].as_str().unwrap_or_default();
            for circle in circles::of_crate(source.as_ref(), root)? {
                let name = package["name"].as_str().unwrap_or_default();
                circles.push(format!("{name}: {circle}"));
            }
        }
    }
    if circles.is_empty() {
        console::print_line!("{crates} crates: no circle of files");
    } else {
        circles.push("Move what one file needs of the other into a file below both.".to_owned());
    }
    Ok(circles)
}
