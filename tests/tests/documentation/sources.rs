//! Tests that programs in documents are excerpts of compiled and tested sources.

use super::blocks::{Document, SHOWN, blocks, documents, read};

/// Returns the block between `<!-- name -->` and `<!-- /name -->`.
pub fn between_markers(document: &str, name: &str) -> String {
    let text = read(document);
    let (start, end) = (format!("<!-- {name} -->"), format!("<!-- /{name} -->"));
    let marked = text.split_once(&start).and_then(|(_, rest)| rest.split_once(&end));
    let (marked, _) = marked.unwrap_or_else(|| panic!("{document} lacks {start} or {end}"));
    let mut found = blocks(marked);
    assert_eq!(found.len(), 1, "{document}: one block between {start} and {end}");
    found.remove(0).text
}

/// Returns true if a block is an excerpt of a source, wherever it is indented. `#[test]` is left aside: a test that
/// fails by design has none here.
fn is_excerpt(block: &str, source: &str) -> bool {
    let lines = |text: &str| text.lines().map(|line| format!("{}\n", line.trim())).collect::<String>();
    let block = lines(block).replace("#[test]\n", "");
    block.lines().count() >= 3 && lines(source).contains(&block)
}

#[test]
fn programs_in_documents_are_the_ones_that_are_compiled() {
    for (document, name, source) in SHOWN {
        let shown = between_markers(document, name);
        assert!(is_excerpt(&shown, &read(source)), "{document}: the block `{name}` is not in {source}");
    }
}

#[test]
fn another_program_is_no_excerpt() {
    let source = "fn a() {\n    one();\n}\n";
    assert!(is_excerpt(source, source) && is_excerpt("#[test]\nfn a() {\n    one();\n}\n", source));
    assert!(!is_excerpt("fn a() {\n    two();\n}\n", source) && !is_excerpt("", source));
}

/// A path in this repository in a `Cargo.toml` or `cargo add` is a crate of that name, with these features.
#[test]
fn dependencies_that_are_shown_exist() {
    let mut checked = 0;
    for Document { path, text } in documents() {
        for block in blocks(&text) {
            for line in block.text.lines() {
                let folder = match line.split_once("../bevy_playbot/") {
                    Some((_, rest)) => rest.split(['"', ' ']).next().unwrap_or_default(),
                    None if line.contains("git = \"<this repository>\"") => "plugin/cli",
                    None => continue,
                };
                let manifest = read(&format!("{folder}/Cargo.toml"));
                if let Some((name, _)) = line.split_once(" = {") {
                    assert!(manifest.contains(&format!("name = \"{}\"", name.trim())), "{path}: {line}");
                }
                let (_, features) = line.split_once("features").unwrap_or_default();
                let words = features.split(|letter: char| !(letter.is_alphanumeric() || "_-".contains(letter)));
                for feature in words.filter(|word| !word.is_empty()) {
                    assert!(manifest.contains(&format!("\n{feature} = [")), "{path}: {line}: no feature {feature}");
                }
                checked += 1;
            }
        }
    }
    assert!(checked >= 4, "only {checked} dependencies were found");
}
