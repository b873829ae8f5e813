//! The modules of one crate, the files they stand in, and the names they hold.
//!
//! *Design.* The tree is built as the compiler does it: from the root through each
//! `mod`. An inline module is a scope of its own in its parent's file.
//!
//! *Limits.* `cfg` is not evaluated except for tests, so a name may have several
//! definitions, and all of them count. A `use` inside a function belongs to the whole
//! module here. What `include!` or a macro call defines is not seen.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use syn::punctuated::Punctuated;
use syn::visit::Visit;
use syn::{Expr, ForeignItem, Ident, Item, ItemMod, ItemUse, Lit, Meta, Token};

use super::imports::{self, Brought};
use super::source;

/// A file of a crate, by its place in [`Crate::files`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FileId(pub usize);

/// A module of a crate, by its place in [`Crate::modules`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ModuleId(pub usize);

/// A crate as its sources have it.
#[derive(Default)]
pub struct Crate {
    /// Each file once, the root first.
    pub files: Vec<PathBuf>,
    /// Each module, the root first.
    pub modules: Vec<Module>,
}

/// A module.
pub struct Module {
    /// Where its items stand.
    pub file: FileId,
    /// The module around it; the root's is the root.
    pub parent: ModuleId,
    /// What each name in it may stand for.
    pub names: HashMap<String, Vec<Definition>>,
    /// The paths of its glob imports.
    pub globs: Vec<Vec<String>>,
    /// What is written in it.
    pub items: Vec<Item>,
}

/// What a name stands for.
#[derive(Clone, Debug)]
pub enum Definition {
    /// An item of this file.
    Item(FileId),
    /// A module.
    Module(ModuleId),
    /// Whatever this path leads to, seen from the module that holds the name.
    Import(Vec<String>),
}

/// The module at the top of every crate.
pub const ROOT: ModuleId = ModuleId(0);

/// Where the files of a module's own `mod` lines are looked for.
struct Folders {
    /// Those with a `#[path]`.
    by_attribute: PathBuf,
    /// Those without.
    by_name: PathBuf,
}

impl Crate {
    /// Reads the crate whose root file is `root`.
    ///
    /// # Errors
    ///
    /// When a file is missing, cannot be read or is no Rust.
    pub fn read(root: &Path) -> Result<Self> {
        let mut this = Self::default();
        this.read_file(root, folder_of(root), ROOT)?;
        Ok(this)
    }

    /// The file where `module` stands.
    pub fn file_of(&self, module: ModuleId) -> FileId {
        self.modules[module.0].file
    }

    fn read_file(&mut self, path: &Path, by_name: PathBuf, parent: ModuleId) -> Result<ModuleId> {
        let items = source::read(path)?;
        let known = self.files.iter().position(|file| file == path);
        let file = FileId(known.unwrap_or(self.files.len()));
        if known.is_none() {
            self.files.push(path.to_owned());
        }
        let folders = Folders {
            by_attribute: folder_of(path),
            by_name,
        };
        self.add(file, parent, &folders, items)
    }

    fn add(
        &mut self,
        file: FileId,
        parent: ModuleId,
        folders: &Folders,
        mut items: Vec<Item>,
    ) -> Result<ModuleId> {
        let id = ModuleId(self.modules.len());
        self.modules.push(Module {
            file,
            parent,
            names: HashMap::new(),
            globs: Vec::new(),
            items: Vec::new(),
        });
        for item in &mut items {
            if let Item::Mod(item) = item {
                self.add_child(file, id, folders, item)?;
            } else {
                self.declare(id, file, item);
            }
        }
        let mut uses = Uses(Vec::new());
        items.iter().for_each(|item| uses.visit_item(item));
        for import in uses.0.into_iter().flat_map(imports::of) {
            match import.name {
                Brought::Name(name) => self.modules[id.0]
                    .names
                    .entry(name)
                    .or_default()
                    .push(Definition::Import(import.path)),
                Brought::Everything => self.modules[id.0].globs.push(import.path),
                Brought::Methods => {}
            }
        }
        self.modules[id.0].items = items;
        Ok(id)
    }
    /// Reads what stands behind `mod name`: each of the files if `cfg` chooses among
    /// several.
    fn add_child(
        &mut self,
        file: FileId,
        parent: ModuleId,
        folders: &Folders,
        item: &mut ItemMod,
    ) -> Result<()> {
        let inside = folders.by_name.join(unraw(&item.ident));
        let mut children = Vec::new();
        if let Some((_, items)) = &mut item.content {
            let folders = Folders {
                by_attribute: inside.clone(),
                by_name: inside,
            };
            children.push(self.add(file, parent, &folders, std::mem::take(items))?);
        } else {
            for path in path_attributes(item) {
                let path = folders.by_attribute.join(path);
                children.push(self.read_file(&path, folder_of(&path), parent)?);
            }
            let by_name = [inside.with_extension("rs"), inside.join("mod.rs")];
            if let Some(path) = by_name.iter().find(|path| path.exists()) {
                children.push(self.read_file(path, inside, parent)?);
            }
        }
        if children.is_empty() {
            bail!(
                "{} declares the module {}, which has no file",
                self.files[file.0].display(),
                item.ident
            );
        }
        for child in children {
            self.name(parent, &item.ident, Definition::Module(child));
        }
        Ok(())
    }

    /// Notes what `item`, no module, defines.
    fn declare(&mut self, module: ModuleId, file: FileId, item: &Item) {
        let ident = match item {
            Item::Const(item) => &item.ident,
            Item::Enum(item) => &item.ident,
            Item::Fn(item) => &item.sig.ident,
            Item::Static(item) => &item.ident,
            Item::Struct(item) => &item.ident,
            Item::Trait(item) => &item.ident,
            Item::TraitAlias(item) => &item.ident,
            Item::Type(item) => &item.ident,
            Item::Union(item) => &item.ident,
            Item::Macro(item) => {
                let Some(ident) = &item.ident else { return };
                let exported =
                    |attribute: &syn::Attribute| attribute.path().is_ident("macro_export");
                if module != ROOT && item.attrs.iter().any(exported) {
                    self.name(ROOT, ident, Definition::Item(file));
                }
                ident
            }
            Item::ForeignMod(block) => {
                for item in &block.items {
                    match item {
                        ForeignItem::Fn(item) => {
                            self.name(module, &item.sig.ident, Definition::Item(file));
                        }
                        ForeignItem::Static(item) => {
                            self.name(module, &item.ident, Definition::Item(file));
                        }
                        _ => {}
                    }
                }
                return;
            }
            _ => return,
        };
        self.name(module, ident, Definition::Item(file));
    }

    fn name(&mut self, module: ModuleId, ident: &Ident, definition: Definition) {
        let names = &mut self.modules[module.0].names;
        names.entry(ident.to_string()).or_default().push(definition);
    }
}

/// The `use` items of a module, those inside its functions included.
struct Uses<'a>(Vec<&'a ItemUse>);

impl<'a> Visit<'a> for Uses<'a> {
    fn visit_item_use(&mut self, item: &'a ItemUse) {
        self.0.push(item);
    }
}

/// The files that `#[path = "…"]` names, inside `cfg_attr` too.
fn path_attributes(item: &ItemMod) -> Vec<String> {
    let path_of = |meta: &Meta| match meta {
        Meta::NameValue(pair) if pair.path.is_ident("path") => match &pair.value {
            Expr::Lit(literal) => match &literal.lit {
                Lit::Str(text) => Some(text.value()),
                _ => None,
            },
            _ => None,
        },
        _ => None,
    };
    let mut paths = Vec::new();
    for attribute in &item.attrs {
        paths.extend(path_of(&attribute.meta));
        if attribute.path().is_ident("cfg_attr")
            && let Ok(parts) =
                attribute.parse_args_with(Punctuated::<Meta, Token![,]>::parse_terminated)
        {
            paths.extend(parts.iter().skip(1).filter_map(path_of));
        }
    }
    paths
}

/// `r#name` is looked for as `name.rs`.
fn unraw(ident: &Ident) -> String {
    ident.to_string().trim_start_matches("r#").to_owned()
}

fn folder_of(file: &Path) -> PathBuf {
    file.parent().unwrap_or(Path::new("")).to_owned()
}
