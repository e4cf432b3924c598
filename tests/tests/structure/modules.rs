//! The modules of a crate.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    slice,
};

use crate::{
    items::{Item, items},
    tokens::tokens,
    use_tree::{Import, imports},
};

/// Where a module stands: the names of the modules around it and its own. The crate itself has none.
pub type ModulePath = Vec<String>;

/// A module: a file, or what stands in its braces.
#[derive(Debug)]
pub struct Module {
    pub file: PathBuf,
    /// Without those for tests.
    pub items: Vec<Item>,
    /// What its `use` declarations bring in.
    pub imports: Vec<Import>,
}

/// All modules of a crate, whatever features they need.
#[derive(Debug)]
pub struct Modules(pub BTreeMap<ModulePath, Module>);

impl Modules {
    /// Reads the crate whose root is this file, `src/lib.rs` or `src/main.rs`.
    pub fn read(root: &Path) -> Self {
        let mut modules = Self(BTreeMap::new());
        let folder = root.parent().expect("a file is in a folder");
        modules.read_file(root, folder, Vec::new());
        modules
    }

    fn read_file(&mut self, file: &Path, folder: &Path, path: ModulePath) {
        let source = fs::read_to_string(file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        self.add(file, folder, path, items(&tokens(&source)));
    }

    fn add(&mut self, file: &Path, folder: &Path, path: ModulePath, mut items_here: Vec<Item>) {
        items_here.retain(|item| !item.is_for_tests());
        for item in items_here.iter().filter(|item| item.keyword == "mod") {
            let child = [path.as_slice(), slice::from_ref(&item.name)].concat();
            let inside = folder.join(&item.name);
            match item.inline_module() {
                Some(tokens) => self.add(file, &inside, child, items(tokens)),
                None => {
                    let (flat, nested) = (folder.join(format!("{}.rs", item.name)), inside.join("mod.rs"));
                    self.read_file(if nested.exists() { &nested } else { &flat }, &inside, child);
                }
            }
        }
        let uses = items_here.iter().filter(|item| item.keyword == "use");
        let imports = uses.flat_map(|item| imports(&item.body)).collect();
        self.0.insert(path, Module { file: file.to_owned(), items: items_here, imports });
    }
}
