//! What a `use` brings: its tree as plain paths.

use syn::{Ident, ItemUse, UseTree};

/// One name that a `use` brings, or all names of a module.
pub struct Import {
    /// The whole path, without a closing `self` or `*`.
    pub path: Vec<String>,
    /// The name by which the scope knows it.
    pub name: Brought,
    /// The line of the path's last word, from 1.
    pub line: usize,
}

/// What an import adds to its scope.
pub enum Brought {
    /// One name, the import's own or another.
    Name(String),
    /// `as _`: a trait's methods, and no name.
    Methods,
    /// `*`: each name of the module or enum.
    Everything,
}

/// Each import of `item`, its braces multiplied out.
pub fn of(item: &ItemUse) -> Vec<Import> {
    let mut imports = Vec::new();
    // A word that no scope holds, so that the path leads out of the crate.
    let prefix = item.leading_colon.as_ref().map(|_| "::".into());
    walk(
        &item.tree,
        &prefix.into_iter().collect::<Vec<_>>(),
        &mut imports,
    );
    imports
}

fn walk(tree: &UseTree, prefix: &[String], imports: &mut Vec<Import>) {
    match tree {
        UseTree::Path(path) => walk(&path.tree, &longer(prefix, &path.ident), imports),
        UseTree::Group(group) => {
            for tree in &group.items {
                walk(tree, prefix, imports);
            }
        }
        UseTree::Glob(glob) => imports.push(Import {
            path: prefix.to_vec(),
            name: Brought::Everything,
            line: glob.star_token.spans[0].start().line,
        }),
        UseTree::Name(leaf) => imports.extend(named(prefix, &leaf.ident, None)),
        UseTree::Rename(leaf) => imports.extend(named(prefix, &leaf.ident, Some(&leaf.rename))),
    }
}

/// The import of `ident` from `prefix`; none for a bare `self`, which is no path.
fn named(prefix: &[String], ident: &Ident, rename: Option<&Ident>) -> Option<Import> {
    let path = if ident == "self" && !prefix.is_empty() {
        prefix.to_vec()
    } else {
        longer(prefix, ident)
    };
    let name = match rename {
        Some(rename) => rename.to_string(),
        None => path.last()?.clone(),
    };
    Some(Import {
        path,
        name: if name == "_" {
            Brought::Methods
        } else {
            Brought::Name(name)
        },
        line: ident.span().start().line,
    })
}

fn longer(prefix: &[String], ident: &Ident) -> Vec<String> {
    let mut path = prefix.to_vec();
    path.push(ident.to_string());
    path
}
