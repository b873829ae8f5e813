//! No circle of files: two files that need each other are one idea in two places, and
//! neither can be read, tested or moved alone.
//!
//! *Design.* A file needs the file that *defines* what it names, however many
//! re-exports lie between. `mod` alone needs nothing, and neither does a path that ends
//! at a module; a re-export needs what it hands on.
//!
//! *Limits.* Those of [`modules`](super::modules), [`names`](super::names) and
//! [`mentions`]. An inherent `impl` in another file than its type's is
//! seen from its own side only: who calls such a method needs the type's file.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;

use super::graph::Graph;
use super::mentions::{self, Mention};
use super::modules::{Crate, FileId, ModuleId};
use super::names::Target;

/// Each circle in the crate whose root file is `root`, in words, with paths as seen from
/// `base`.
///
/// # Errors
///
/// When the crate's sources cannot be read.
pub fn of_crate(root: &Path, base: &Path) -> Result<Vec<String>> {
    let sources = Crate::read(root)?;
    let needs = needs(&sources);
    let mut graph = Graph::default();
    for &(from, to) in needs.keys() {
        graph.add(from, to);
    }
    let shown = |file: FileId| {
        let path = &sources.files[file.0];
        path.strip_prefix(base).unwrap_or(path).display()
    };
    Ok(graph
        .circles()
        .into_iter()
        .map(|circle| {
            let mut text = format!("{} files need each other:", circle.files.len());
            let next = circle.shortest.iter().cycle().skip(1);
            for (&from, &to) in circle.shortest.iter().zip(next) {
                let reason = &needs[&(from, to)];
                let _ = write!(
                    text,
                    "\n  {}:{} uses `{}` of {}",
                    shown(from),
                    reason.line,
                    reason.path.join("::"),
                    shown(to),
                );
            }
            for &file in &circle.files {
                if !circle.shortest.contains(&file) {
                    let _ = write!(text, "\n  {} is in a longer circle", shown(file));
                }
            }
            text
        })
        .collect())
}

/// Which file needs which, with the first mention that says so.
fn needs(sources: &Crate) -> BTreeMap<(FileId, FileId), Mention> {
    let mut needs = BTreeMap::new();
    for (index, module) in sources.modules.iter().enumerate() {
        for mention in mentions::of(&module.items) {
            for target in sources.resolve(ModuleId(index), &mention.path) {
                let to = match target {
                    Target::File(file) => file,
                    Target::Module(module) if mention.whole => sources.file_of(module),
                    Target::Module(_) | Target::Outside => continue,
                };
                if to != module.file {
                    needs
                        .entry((module.file, to))
                        .or_insert_with(|| mention.clone());
                }
            }
        }
    }
    needs
}
