//! Needs between modules: `use` declarations, and paths that are written out.

use std::path::PathBuf;

use crate::{
    items::Item,
    modules::{ModulePath, Modules},
    tokens::Token,
    use_tree::imports,
};

/// A module names something of another module.
#[derive(Clone, Debug)]
pub struct Need {
    pub from: ModulePath,
    pub to: ModulePath,
    /// As written.
    pub path: String,
    pub file: PathBuf,
    pub line: usize,
}

/// Everything that modules of the crate need of one another, tests left out.
pub fn needs(modules: &Modules) -> Vec<Need> {
    let mut found = Vec::new();
    for (from, module) in &modules.0 {
        for (path, line) in module.items.iter().filter(|item| item.inline_module().is_none()).flat_map(paths) {
            let Some(target) = modules.resolve(from, &path) else { continue };
            let (to, path, file) = (target.module().clone(), path.join("::"), module.file.clone());
            found.push(Need { from: from.clone(), to, path, file, line });
        }
    }
    found
}

/// The paths of an item that begin with `crate`, `self` or `super`, and all that it imports.
fn paths(item: &Item) -> Vec<(Vec<String>, usize)> {
    if item.keyword == "use" {
        return imports(&item.body).into_iter().map(|import| (import.path, import.line)).collect();
    }
    [paths_in(&item.attribute_tokens), paths_in(&item.body)].concat()
}

fn paths_in(tokens: &[Token]) -> Vec<(Vec<String>, usize)> {
    let (mut found, mut at) = (Vec::new(), 0);
    let text = |at: usize| tokens.get(at).map_or("", |token| token.text.as_str());
    while let Some(token) = tokens.get(at) {
        let is_path = text(at + 1) == ":" && text(at + 2) == ":";
        match token.text.as_str() {
            // `use` within a function, and not `impl Trait + use<>`.
            "use" if text(at + 1) != "<" => {
                let length = tokens[at..].iter().take_while(|token| token.text != ";").count();
                let tree = &tokens[at + 1..at + length];
                found.extend(imports(tree).into_iter().map(|import| (import.path, import.line)));
                at += length;
            }
            "crate" | "self" | "super" if is_path && !(at >= 2 && text(at - 1) == ":") => {
                let (path, length) = path(&tokens[at..]);
                found.push((path, token.line));
                at += length;
            }
            _ => at += 1,
        }
    }
    found
}

/// The path that begins with the first token, and how many tokens it has.
fn path(tokens: &[Token]) -> (Vec<String>, usize) {
    let (mut path, mut at) = (vec![tokens[0].text.clone()], 1);
    while let [colon, again, word, ..] = &tokens[at..] {
        if colon.text != ":" || again.text != ":" || !word.is_word() {
            break;
        }
        path.push(word.text.clone());
        at += 3;
    }
    (path, at)
}
