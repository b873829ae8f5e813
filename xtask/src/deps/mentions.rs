//! The paths that a module mentions.
//!
//! *Design.* Paths in types, expressions, patterns and imports are taken from the
//! syntax tree. Arguments of macros and attributes, and the bodies of `macro_rules!`,
//! are tokens to everybody but the macro: there each `a::b::c` counts as a path.
//!
//! *Limits.* Macros are not expanded. Methods have no path, so a call of one mentions
//! nothing; nor do a documentation's links.

use proc_macro2::{Spacing, TokenStream, TokenTree};
use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemMod, ItemUse, Visibility};

use super::imports::{self, Brought};

/// A path and where it stands.
#[derive(Clone)]
pub struct Mention {
    /// Its words, without generic arguments.
    pub path: Vec<String>,
    /// Its line in the file, from 1.
    pub line: usize,
    /// Whether it is handed on with all that it holds: `pub use path::*`.
    pub whole: bool,
}

/// Each path in `items`; inline modules are left to themselves.
pub fn of(items: &[Item]) -> Vec<Mention> {
    let mut visitor = Mentions(Vec::new());
    for item in items {
        visitor.visit_item(item);
    }
    visitor.0
}

struct Mentions(Vec<Mention>);

impl<'a> Visit<'a> for Mentions {
    fn visit_item_mod(&mut self, _: &'a ItemMod) {}

    fn visit_item_use(&mut self, item: &'a ItemUse) {
        let is_public = !matches!(item.vis, Visibility::Inherited);
        for import in imports::of(item) {
            self.0.push(Mention {
                path: import.path,
                line: import.line,
                whole: is_public && matches!(import.name, Brought::Everything),
            });
        }
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        // `::name` is another crate's.
        if let (None, Some(first)) = (&path.leading_colon, path.segments.first()) {
            self.0.push(Mention {
                path: path
                    .segments
                    .iter()
                    .map(|segment| segment.ident.to_string())
                    .collect(),
                line: first.ident.span().start().line,
                whole: false,
            });
        }
        visit::visit_path(self, path);
    }

    fn visit_token_stream(&mut self, tokens: &'a TokenStream) {
        scan(tokens.clone(), &mut self.0);
    }

    fn visit_attribute(&mut self, attribute: &'a Attribute) {
        if !attribute.path().is_ident("doc") {
            visit::visit_attribute(self, attribute);
        }
    }

    fn visit_visibility(&mut self, _: &'a Visibility) {}
}

/// Each run of words with `::` between them.
fn scan(tokens: TokenStream, mentions: &mut Vec<Mention>) {
    let mut path: Option<Mention> = None;
    // How much of `::` the last tokens were.
    let mut colons = 0;
    for token in tokens {
        match token {
            TokenTree::Punct(punct)
                if punct.as_char() == ':'
                    && (colons == 1 || colons == 0 && punct.spacing() == Spacing::Joint) =>
            {
                colons += 1;
                continue;
            }
            TokenTree::Ident(ident) => {
                let word = ident.to_string();
                match &mut path {
                    Some(path) if colons == 2 => path.path.push(word),
                    _ => {
                        mentions.extend(path.take());
                        // Behind a bare `::` another crate's path begins.
                        path = (colons != 2).then(|| Mention {
                            path: vec![word],
                            line: ident.span().start().line,
                            whole: false,
                        });
                    }
                }
            }
            other => {
                mentions.extend(path.take());
                if let TokenTree::Group(group) = other {
                    scan(group.stream(), mentions);
                }
            }
        }
        colons = 0;
    }
    mentions.extend(path);
}
