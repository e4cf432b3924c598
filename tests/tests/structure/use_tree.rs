//! `use` declarations as single paths.

use crate::tokens::Token;

/// One name that a `use` brings in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Import {
    /// All segments, as written; without the last one if that is `self` or `*`.
    pub path: Vec<String>,
    /// Under which name it is known afterwards; none after `*`.
    pub name: Option<String>,
    pub line: usize,
}

/// All imports of the tree that begins with the first token and ends before `;` or with the tokens.
pub fn imports(tree: &[Token]) -> Vec<Import> {
    let mut found = Vec::new();
    read(tree, &mut 0, &[], &mut found);
    found
}

fn read(tree: &[Token], at: &mut usize, before: &[String], found: &mut Vec<Import>) {
    let mut path = before.to_vec();
    while let Some(token) = tree.get(*at) {
        *at += 1;
        match token.text.as_str() {
            ":" => {}
            "{" => {
                while tree.get(*at).is_some_and(|token| token.text != "}") {
                    read(tree, at, &path, found);
                    *at += usize::from(tree.get(*at).is_some_and(|token| token.text == ","));
                }
                *at += 1;
                return;
            }
            "*" => {
                found.push(Import { path, name: None, line: token.line });
                return;
            }
            "," | "}" | ";" => {
                *at -= 1;
                return;
            }
            word => {
                if word != "self" || path.is_empty() {
                    path.push(word.to_owned());
                }
                let next = |ahead: usize| tree.get(*at + ahead).map(|token| token.text.as_str());
                let (is_end, alias) = match next(0) {
                    Some(":") => (false, None),
                    Some("as") => (true, next(1).map(str::to_owned)),
                    _ => (true, None),
                };
                if is_end {
                    *at += if alias.is_some() { 2 } else { 0 };
                    let name = alias.or_else(|| path.last().cloned());
                    found.push(Import { path, name, line: token.line });
                    return;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tokens::tokens;

    #[test]
    fn braces_aliases_globs_and_self() {
        let tree = tokens("crate::{a::{self, B as C}, d::*, e};");
        let shown: Vec<String> = imports(&tree)
            .iter()
            .map(|import| format!("{}={}", import.path.join("::"), import.name.as_deref().unwrap_or("*")))
            .collect();
        assert_eq!(shown, ["crate::a=a", "crate::a::B=C", "crate::d=*", "crate::e=e"]);
    }
}
