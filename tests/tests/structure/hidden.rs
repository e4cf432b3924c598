//! What the documentation of a crate hides is recommended nowhere.

use std::{collections::BTreeSet, fs, slice};

use crate::{
    files::{files, shown},
    items::Visibility,
    modules::{ModulePath, Modules},
    packages::{packages, workspace},
    use_tree::imports,
};

/// Names of what is `#[doc(hidden)]`, and of what hidden modules hold.
fn hidden(modules: &Modules) -> BTreeSet<String> {
    let (mut names, mut closed) = (BTreeSet::new(), Vec::<ModulePath>::new());
    // A module comes before those below it.
    for (path, module) in &modules.0 {
        let is_below = closed.iter().any(|hidden| path.starts_with(hidden));
        for item in &module.items {
            let is_hidden = item.is_hidden() || (is_below && item.visibility == Visibility::Public);
            if !is_hidden {
                continue;
            }
            if item.keyword == "mod" {
                closed.push([path.as_slice(), slice::from_ref(&item.name)].concat());
            }
            match item.keyword.as_str() {
                "use" => names.extend(imports(&item.body).into_iter().filter_map(|import| import.name)),
                _ => names.extend((!item.name.is_empty()).then(|| item.name.clone())),
            }
        }
    }
    names
}

/// Whether a document names an item. A name that may be a plain word, such as `repair`, counts within a path alone.
fn is_named(document: &str, name: &str) -> bool {
    let is_plain = !name.contains('_') && !name.chars().skip(1).any(char::is_uppercase);
    let is_part = |letter: char| letter.is_alphanumeric() || letter == '_';
    document.match_indices(name).any(|(at, _)| {
        let (before, after) = (&document[..at], &document[at + name.len()..]);
        let is_whole = !before.ends_with(is_part) && !after.starts_with(is_part);
        // The lab has modules of the same names, for everybody.
        let is_of_lab = before.ends_with("playbot_lab::");
        is_whole && !is_of_lab && (!is_plain || before.ends_with("::") || after.starts_with("::"))
    })
}

/// READMEs and all that lies in `docs`. What they name, a game developer has to find in the documentation.
#[test]
fn documents_name_nothing_that_is_hidden() {
    let package =
        packages(&workspace()).into_iter().find(|package| package.name == "bevy_playbot").expect("it is there");
    let hidden = hidden(&Modules::read(&package.root().expect("a library")));
    assert!(hidden.len() > 20, "only {hidden:?} are hidden: does the reader still see them?");
    let mut faults = Vec::new();
    let documents = [files(&workspace(), "README.md"), files(&workspace().join("docs"), ".md")].concat();
    for file in documents {
        let text = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let named = hidden.iter().filter(|name| is_named(&text, name));
        faults.extend(named.map(|name| format!("{}: {name}", shown(&workspace(), &file))));
    }
    assert!(
        faults.is_empty(),
        "{} to mend\n{}\nShow these in the documentation, or recommend something else.\n",
        faults.len(),
        faults.join("\n")
    );
}

#[test]
fn what_is_hidden_is_found_where_it_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = folder.path().join("lib.rs");
    let source = "#[doc(hidden)] pub use a::{B, c as d}; #[doc(hidden)] pub mod e { pub fn f_g() {} fn h() {} }
        mod a { pub struct B; #[doc(hidden)] pub fn repair() {} pub fn shown() {} }";
    fs::write(&root, source).expect("writable");
    let hidden = hidden(&Modules::read(&root));
    assert_eq!(hidden.iter().map(String::as_str).collect::<Vec<_>>(), ["B", "d", "e", "f_g", "repair"]);
    for (name, document, is) in [
        ("f_g", "call `f_g` first", true),
        ("f_g", "call `f_gs` or `of_g`", false),
        ("CamelCase", "Without<CamelCase>", true),
        ("repair", "`demo repair` recovers a recording", false),
        ("repair", "file::repair(path)", true),
        ("renewal", "use bevy_playbot::{renewal::Renewal}", true),
    ] {
        assert_eq!(is_named(document, name), is, "{name} in {document}");
    }
}
