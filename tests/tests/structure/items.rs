//! The items of a file or of a module in braces.

use crate::tokens::Token;

/// Who may name an item.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// `pub`.
    Public,
    /// Nothing, or `pub(crate)` and its kin.
    Restricted,
}

/// An item with its attributes.
#[derive(Clone, Debug)]
pub struct Item {
    pub line: usize,
    /// Without blanks, such as `cfg(feature="camera")`.
    pub attributes: Vec<String>,
    /// The same in tokens: `#[require(crate::a::B)]` names a module too.
    pub attribute_tokens: Vec<Token>,
    pub visibility: Visibility,
    /// `mod`, `use`, `struct`, …; `macro_rules` and, for a macro that is called, its name.
    pub keyword: String,
    /// Empty where an item has none.
    pub name: String,
    /// Everything behind the keyword.
    pub body: Vec<Token>,
}

impl Item {
    /// Whether it is compiled for tests alone.
    pub fn is_for_tests(&self) -> bool {
        let is_test = |attribute: &String| {
            attribute == "test"
                || ["cfg(test", "cfg(all(test", "cfg(doctest"].iter().any(|of| attribute.starts_with(of))
        };
        self.attributes.iter().any(is_test)
    }

    /// Whether the documentation leaves it out.
    pub fn is_hidden(&self) -> bool {
        self.attributes.iter().any(|attribute| attribute.starts_with("doc(hidden"))
    }

    /// What stands in the braces of `mod name { … }`.
    pub fn inline_module(&self) -> Option<&[Token]> {
        let is_inline = self.keyword == "mod" && self.body.get(1).is_some_and(|token| token.text == "{");
        is_inline.then(|| &self.body[2..self.body.len() - 1])
    }
}

/// The items of these tokens, in their order. Attributes of the file itself are passed over.
pub fn items(tokens: &[Token]) -> Vec<Item> {
    let (mut found, mut at) = (Vec::new(), 0);
    while at < tokens.len() {
        let (mut attributes, mut attribute_tokens) = (Vec::new(), Vec::new());
        let line = tokens[at].line;
        while text(tokens, at) == "#" {
            let is_inner = text(tokens, at + 1) == "!";
            let open = at + 1 + usize::from(is_inner);
            let close = closing(tokens, open);
            if !is_inner {
                attributes.push(tokens[open + 1..close].iter().map(|token| token.text.as_str()).collect());
                attribute_tokens.extend_from_slice(&tokens[open + 1..close]);
            }
            at = close + 1;
        }
        if at >= tokens.len() {
            break;
        }
        let mut visibility = Visibility::Restricted;
        if text(tokens, at) == "pub" {
            at += 1;
            if text(tokens, at) == "(" {
                at = closing(tokens, at) + 1;
            } else {
                visibility = Visibility::Public;
            }
        }
        while is_qualifier(tokens, at) {
            at += 1;
        }
        let (keyword, end) = (text(tokens, at).to_owned(), end_of(tokens, at));
        let body = tokens[(at + 1).min(end)..end].to_vec();
        let name = body.iter().find(|token| token.is_word() && token.text != "mut").map(|token| token.text.clone());
        let name = if matches!(keyword.as_str(), "impl" | "use") { String::new() } else { name.unwrap_or_default() };
        found.push(Item { line, attributes, attribute_tokens, visibility, keyword, name, body });
        at = end;
    }
    found
}

fn text(tokens: &[Token], at: usize) -> &str {
    tokens.get(at).map_or("", |token| token.text.as_str())
}

/// `const`, `unsafe`, `async` and `extern "C"` before a function, and `unsafe` before an implementation.
fn is_qualifier(tokens: &[Token], at: usize) -> bool {
    let next = text(tokens, at + 1);
    match text(tokens, at) {
        "const" => matches!(next, "fn" | "unsafe" | "async" | "extern"),
        "unsafe" | "async" | "auto" => true,
        "extern" => next.starts_with('"') && text(tokens, at + 2) == "fn",
        literal => literal.starts_with('"'),
    }
}

/// Behind the last token of the item whose keyword is at `at`.
fn end_of(tokens: &[Token], at: usize) -> usize {
    let until_semicolon = matches!(text(tokens, at), "use" | "const" | "static" | "type");
    let mut here = at;
    while here < tokens.len() {
        match text(tokens, here) {
            ";" => return here + 1,
            "{" if !until_semicolon => return closing(tokens, here) + 1,
            "{" | "(" | "[" => here = closing(tokens, here),
            _ => {}
        }
        here += 1;
    }
    tokens.len()
}

/// The bracket that closes the one at `open`.
fn closing(tokens: &[Token], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        match token.text.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return at;
        }
    }
    tokens.len().saturating_sub(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tokens::tokens;

    #[test]
    fn every_item_begins_and_ends_where_it_does() {
        let source = "#![allow(x)] pub mod a; #[cfg(test)] mod b { fn c() {} } pub(crate) const fn d() -> [u8; 2] { [0; 2] }
            pub const E: F = F { g: 1 }; pub struct H(u8); impl<T> I for H where T: J {} pub unsafe extern \"C\" fn k() {}
            macro_rules! l { () => {} } pub static mut M: u8 = { 1 };";
        let found = items(&tokens(source));
        let shown: Vec<_> = found
            .iter()
            .map(|item| (item.keyword.as_str(), item.name.as_str(), item.visibility == Visibility::Public))
            .collect();
        assert_eq!(
            shown,
            [
                ("mod", "a", true),
                ("mod", "b", false),
                ("fn", "d", false),
                ("const", "E", true),
                ("struct", "H", true),
                ("impl", "", false),
                ("fn", "k", true),
                ("macro_rules", "l", false),
                ("static", "M", true),
            ]
        );
        assert!(found[1].is_for_tests() && found[1].inline_module().is_some_and(|tokens| tokens[0].text == "fn"));
    }
}
