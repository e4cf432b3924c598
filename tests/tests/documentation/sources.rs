//! Programs that documents show are those that are compiled and tested.

use super::blocks::{blocks, read};

/// The block between `<!-- name -->` and `<!-- /name -->`.
fn between_markers(document: &str, name: &str) -> String {
    let text = read(document);
    let (start, end) = (format!("<!-- {name} -->"), format!("<!-- /{name} -->"));
    let marked = text.split_once(&start).and_then(|(_, rest)| rest.split_once(&end));
    let (marked, _) = marked.unwrap_or_else(|| panic!("{document} lacks {start} or {end}"));
    let mut found = blocks(marked);
    assert_eq!(found.len(), 1, "{document}: one block between {start} and {end}");
    found.remove(0).text
}

/// A program without what its head says of it.
fn program(path: &str) -> String {
    let source = read(path);
    let lines = source.lines().skip_while(|line| line.starts_with("//!") || line.is_empty());
    lines.map(|line| format!("{line}\n")).collect()
}

#[test]
fn programs_in_documents_are_the_ones_that_are_compiled() {
    for (document, name, source) in [
        ("README.md", "breakout", "tests/foreign/breakout/src/main.rs"),
        ("docs/tutorial.md", "runner", "tests/tests/documentation/runner.rs"),
    ] {
        let (shown, compiled) = (between_markers(document, name), program(source));
        assert!(shown == compiled, "{document} shows another {name} than {source}: copy it there, without its head");
    }
}
