//! Where a path leads: to the file that defines what it names.
//!
//! *Design.* As the compiler does it, a name is looked up in its module first and in
//! the module's glob imports then, and each import is followed to its end, so that a
//! re-export is transparent however often it is repeated.
//!
//! *Limits.* Visibility is not looked at: code that compiles does not name what it may
//! not. A glob import of an enum's variants leads nowhere; the path of that import
//! itself counts.

use super::modules::{Crate, Definition, FileId, ModuleId, ROOT};

/// What a path leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// An item, or something of it (a variant, an associated function), of this file.
    File(FileId),
    /// A module.
    Module(ModuleId),
    /// Another crate's item, a generic parameter, a local variable.
    Outside,
}

impl Crate {
    /// What `path` may lead to, written in the module `from`.
    pub fn resolve(&self, from: ModuleId, path: &[String]) -> Vec<Target> {
        Search {
            sources: self,
            under_way: Vec::new(),
        }
        .path(from, path)
    }
}

struct Search<'a> {
    sources: &'a Crate,
    /// The names whose imports are being followed: what leads back to one of them by an
    /// import alone leads nowhere.
    under_way: Vec<(ModuleId, &'a str)>,
}

impl<'a> Search<'a> {
    fn path(&mut self, from: ModuleId, path: &'a [String]) -> Vec<Target> {
        let Some((first, rest)) = path.split_first() else {
            return vec![Target::Outside];
        };
        let mut targets = match self.keyword(from, first) {
            Some(module) => vec![Target::Module(module)],
            None => self.name(from, first),
        };
        if targets.is_empty() {
            return vec![Target::Outside];
        }
        for word in rest {
            targets = targets
                .into_iter()
                .flat_map(|target| self.step(target, word))
                .collect();
        }
        targets
    }

    /// From `target` on by `word`.
    fn step(&mut self, target: Target, word: &'a str) -> Vec<Target> {
        let Target::Module(module) = target else {
            return vec![target];
        };
        if let Some(module) = self.keyword(module, word) {
            return vec![Target::Module(module)];
        }
        let found = self.name(module, word);
        if found.is_empty() {
            // Made by a macro or an `include!` there.
            return vec![Target::File(self.sources.file_of(module))];
        }
        found
    }

    fn keyword(&self, from: ModuleId, word: &str) -> Option<ModuleId> {
        match word {
            "crate" => Some(ROOT),
            "self" => Some(from),
            "super" => Some(self.sources.modules[from.0].parent),
            _ => None,
        }
    }

    /// What `name` may stand for in `module`: nothing if the module does not hold it.
    fn name(&mut self, module: ModuleId, name: &'a str) -> Vec<Target> {
        let sources = self.sources;
        let scope = &sources.modules[module.0];
        let again = self.under_way.contains(&(module, name));
        let mut found = Vec::new();
        self.under_way.push((module, name));
        if let Some(definitions) = scope.names.get(name) {
            for definition in definitions {
                match definition {
                    Definition::Item(file) => found.push(Target::File(*file)),
                    Definition::Module(module) => found.push(Target::Module(*module)),
                    Definition::Import(_) if again => {}
                    Definition::Import(path) => found.extend(self.path(module, path)),
                }
            }
        } else if !again {
            for glob in &scope.globs {
                for target in self.path(module, glob) {
                    if let Target::Module(module) = target {
                        found.extend(self.name(module, name));
                    }
                }
            }
        }
        self.under_way.pop();
        found
    }
}
