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

use anyhow::{Context, Result, bail};

use crate::image;

/// The page that has the rule.
const PAGE: &str = "docs/architecture.md";

/// Checks the rule over the whole workspace.
///
/// # Errors
///
/// Names every dependency that the rule forbids.
pub fn check() -> Result<()> {
    let page = std::fs::read_to_string(image::root().join(PAGE))
        .with_context(|| format!("cannot read {PAGE}"))?;
    let packages = rule::packages(&image::metadata()?)?;
    let broken = rule::violations(&page, &packages);
    if !broken.is_empty() {
        bail!("the table in {PAGE}:\n{}", broken.join("\n"));
    }
    let dependencies: usize = packages
        .iter()
        .map(|package| package.dependencies.len())
        .sum();
    println!(
        "{} packages, {dependencies} dependencies: as {PAGE} has them",
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
    let mut found = Vec::new();
    let mut crates = 0;
    for package in metadata["packages"].as_array().into_iter().flatten() {
        for target in package["targets"].as_array().into_iter().flatten() {
            let kind = target["kind"][0].as_str().unwrap_or_default();
            if !["lib", "bin", "custom-build"].contains(&kind) {
                continue;
            }
            crates += 1;
            let root = target["src_path"].as_str().unwrap_or_default();
            for circle in circles::of_crate(root.as_ref(), &base)? {
                let name = package["name"].as_str().unwrap_or_default();
                found.push(format!("{name}: {circle}"));
            }
        }
    }
    if !found.is_empty() {
        bail!(
            "circles of files: {}\n{}\n\
             Move what one file needs of the other into a file of its own, below both.",
            found.len(),
            found.join("\n")
        );
    }
    println!("{crates} crates: no circle of files");
    Ok(())
}
