//! Examples in documentation that are compiled.

use std::{fs, slice};

use crate::{
    items::Visibility,
    modules::{ModulePath, Modules},
};

/// Public modules without an example: it may stand in their own documentation, in that of an item, or in a module below
/// them.
pub fn without_example(modules: &Modules) -> Vec<String> {
    let is_shown = |path: &ModulePath| {
        let below = modules.0.iter().filter(|(of, _)| of.starts_with(path));
        below.into_iter().any(|(_, module)| has_doctest(&fs::read_to_string(&module.file).expect("readable")))
    };
    public(modules, &Vec::new()).into_iter().filter(|path| !is_shown(path)).map(|path| path.join("::")).collect()
}

/// The modules below this one that can be named from outside.
fn public(modules: &Modules, path: &ModulePath) -> Vec<ModulePath> {
    let items = modules.0[path].items.iter();
    let open = items.filter(|item| item.keyword == "mod" && item.visibility == Visibility::Public && !item.is_hidden());
    let children = open.map(|item| [path.as_slice(), slice::from_ref(&item.name)].concat());
    children.flat_map(|child| [vec![child.clone()], public(modules, &child)].concat()).collect()
}

/// Whether an example in the documentation of this source is compiled.
fn has_doctest(source: &str) -> bool {
    let docs = source.lines().map(str::trim_start);
    let docs = docs.filter_map(|line| line.strip_prefix("//!").or_else(|| line.strip_prefix("///")));
    let fences = docs.filter_map(|line| line.trim().strip_prefix("```"));
    // Every second one closes a block.
    fences.step_by(2).any(is_compiled)
}

/// What stands behind a fence: Rust, and not passed over.
fn is_compiled(words: &str) -> bool {
    words.split(',').all(|word| matches!(word.trim(), "" | "rust" | "no_run" | "should_panic" | "compile_fail"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_ignored_blocks_and_ends_of_blocks_are_no_examples() {
        for (source, is) in [
            ("//! ```\n//! let a = 1;\n//! ```", true),
            ("    /// ```no_run\n    /// f();\n    /// ```\n    fn f() {}", true),
            ("//! ```text\n//! a\n//! ```\n/// ```\n/// f();\n/// ```", true),
            ("//! ```text\n//! a\n//! ```", false),
            ("/// ```ignore\n/// f();\n/// ```", false),
            ("// ```\n// f();\n// ```", false),
        ] {
            assert_eq!(has_doctest(source), is, "{source}");
        }
    }
}
