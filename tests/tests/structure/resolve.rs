//! The module that an imported name comes from, through re-exports.

use crate::{
    modules::{ModulePath, Modules},
    use_tree::Import,
};

/// Re-exports of re-exports are followed this far.
const DEPTH: u32 = 32;

/// What a path within the crate leads to.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// A module.
    Module(ModulePath),
    /// An item of a module.
    Item(ModulePath, String),
}

impl Target {
    /// The module that it is, or that holds it.
    pub fn module(&self) -> &ModulePath {
        match self {
            Self::Module(path) | Self::Item(path, _) => path,
        }
    }
}

impl Modules {
    /// What a path means that is written in module `from`; none if it leads out of the crate.
    pub fn resolve(&self, from: &ModulePath, path: &[String]) -> Option<Target> {
        self.resolve_within(from, path, DEPTH)
    }

    fn resolve_within(&self, from: &ModulePath, path: &[String], depth: u32) -> Option<Target> {
        let mut at = from.clone();
        let mut rest = path;
        let mut is_within = false;
        while let [first, others @ ..] = rest {
            match first.as_str() {
                "crate" => at.clear(),
                "self" => {}
                "super" => drop(at.pop()),
                _ => break,
            }
            (rest, is_within) = (others, true);
        }
        let [first, ..] = rest else { return Some(Target::Module(at)) };
        // Without `crate`, `self` or `super`, the first name is one of this module's or another crate's.
        let is_known = is_within || self.0.contains_key(&child(&at, first)) || self.import(&at, first).is_some();
        if is_known && depth > 0 { self.walk(at, rest, depth) } else { None }
    }

    fn walk(&self, mut at: ModulePath, path: &[String], depth: u32) -> Option<Target> {
        for (index, name) in path.iter().enumerate() {
            let (below, rest) = (child(&at, name), &path[index + 1..]);
            let is_module = self.0.contains_key(&below);
            // A module and what is re-exported from it may share a name: `mod plan; pub use plan::plan;`.
            let import = self.import(&at, name).filter(|_| !is_module || rest.is_empty());
            if let Some(import) = import {
                let full = [import.path.as_slice(), rest].concat();
                return self.resolve_within(&at, &full, depth - 1);
            }
            if is_module {
                at = below;
                continue;
            }
            if !self.defines(&at, name)
                && let Some(found) = self.through_globs(&at, &path[index..], depth)
            {
                return Some(found);
            }
            return Some(Target::Item(at, name.clone()));
        }
        Some(Target::Module(at))
    }

    /// What `pub use module::*` brings in.
    fn through_globs(&self, at: &ModulePath, path: &[String], depth: u32) -> Option<Target> {
        let globs = self.0.get(at)?.imports.iter().filter(|import| import.name.is_none());
        globs.filter_map(|glob| self.resolve_within(at, &glob.path, depth.checked_sub(1)?)).find_map(|target| {
            let Target::Module(module) = target else { return None };
            let name = &path[0];
            let is_there = self.defines(&module, name)
                || self.import(&module, name).is_some()
                || self.0.contains_key(&child(&module, name));
            if is_there { self.walk(module, path, depth - 1) } else { None }
        })
    }

    fn import(&self, at: &ModulePath, name: &str) -> Option<&Import> {
        let is_it = |import: &&Import| import.name.as_deref() == Some(name) && import.path != [name];
        self.0.get(at)?.imports.iter().find(is_it)
    }

    fn defines(&self, at: &ModulePath, name: &str) -> bool {
        self.0.get(at).is_some_and(|module| module.items.iter().any(|item| item.name == name))
    }
}

fn child(at: &ModulePath, name: &str) -> ModulePath {
    [at.as_slice(), &[name.to_owned()]].concat()
}
