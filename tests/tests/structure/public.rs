//! The items that a user of a crate can name.

use std::{collections::BTreeSet, slice};

use crate::{
    items::{Item, Visibility},
    modules::{ModulePath, Modules},
    resolve::Target,
    use_tree::imports,
};

/// Kinds of items that are counted.
const KINDS: [&str; 8] = ["struct", "enum", "union", "trait", "fn", "type", "const", "static"];

/// Public items of a crate by the path where they are defined, `module::Name`.
#[derive(Debug, Default)]
pub struct Public {
    pub items: BTreeSet<String>,
    /// Re-exports that show more than can be counted: all of another crate, or all that a module of it has.
    pub boundless: BTreeSet<String>,
    seen: BTreeSet<ModulePath>,
}

impl Public {
    /// Looks through the public modules of a crate, from its root on, and through everything that they re-export.
    pub fn of(modules: &Modules) -> Self {
        let mut public = Self::default();
        public.look_through(modules, &Vec::new());
        public
    }

    fn look_through(&mut self, modules: &Modules, path: &ModulePath) {
        if !self.seen.insert(path.clone()) {
            return;
        }
        let module = &modules.0[path];
        for item in module.items.iter().filter(|item| !item.is_hidden()) {
            let is_exported = item.attributes.iter().any(|attribute| attribute == "macro_export");
            match item.keyword.as_str() {
                "macro_rules" if is_exported => drop(self.items.insert(format!("{}!", item.name))),
                _ if item.visibility != Visibility::Public => {}
                "mod" => self.look_through(modules, &[path.as_slice(), slice::from_ref(&item.name)].concat()),
                "use" => self.look_at_use(modules, path, item),
                kind if KINDS.contains(&kind) => drop(self.items.insert(shown(path, &item.name))),
                _ => {}
            }
        }
    }

    fn look_at_use(&mut self, modules: &Modules, path: &ModulePath, item: &Item) {
        for import in imports(&item.body) {
            let written = import.path.join("::");
            match (modules.resolve(path, &import.path), import.name) {
                (Some(Target::Module(module)), _) => self.look_through(modules, &module),
                (Some(Target::Item(module, name)), _) => drop(self.items.insert(shown(&module, &name))),
                (None, Some(_)) if import.path.len() > 1 => drop(self.items.insert(written)),
                (None, _) => drop(self.boundless.insert(written)),
            }
        }
    }
}

fn shown(path: &ModulePath, name: &str) -> String {
    [path.as_slice(), &[name.to_owned()]].concat().join("::")
}
