//! The rules.

use std::{
    collections::BTreeMap,
    fs,
    path::{Component, Path, PathBuf},
    slice,
};

use crate::{
    circles::{circles, folders},
    doctests::without_example,
    files::{files, shown},
    imports::needs,
    items::{Visibility, items},
    modules::Modules,
    packages::{Package, packages, workspace},
    tokens::tokens,
};

/// Lines of a product file without its tests, at most: what is longer is no longer read from top to bottom.
const MAX_LINES: usize = 800;
/// A product file with fewer lines is a splinter, unless it is the door of a folder.
const SMALL: usize = 40;
/// Product files with fewer lines than [`SMALL`], at most.
const MAX_SMALL: usize = 40;
/// Product files of the workspace, at most.
const MAX_FILES: usize = 598;
/// Public items that the documentation hides, at most.
const MAX_HIDDEN: usize = 5;

fn fail_if_any(faults: &[String], advice: &str) {
    assert!(faults.is_empty(), "{} to mend\n{}\n{advice}\n", faults.len(), faults.join("\n"));
}

/// Every crate with its modules.
fn crates() -> Vec<(Package, Modules)> {
    let with_root = packages(&workspace()).into_iter().filter_map(|package| Some((package.root()?, package)));
    with_root.map(|(root, package)| (package, Modules::read(&root))).collect()
}

/// A module may name another, or be named by it, not both, whether directly or through others. `use` declarations and
/// paths with `crate::`, `self::` and `super::` count, by the module in which the item is defined; tests do not. A
/// folder's door is above its files: it may name them, and they may name it.
#[test]
fn files_of_a_folder_need_one_another_in_no_circle() {
    let mut faults = Vec::new();
    for (package, modules) in crates() {
        let needs = needs(&modules);
        for (folder, edges) in folders(&needs) {
            for circle in circles(&edges) {
                let depth = folder.len();
                let names = circle.iter().map(|need| need.from[depth].as_str());
                let path = names.chain([circle[0].from[depth].as_str()]).collect::<Vec<_>>().join(" -> ");
                let place = [slice::from_ref(&package.name), folder].concat().join("::");
                faults.push(format!("{place}: {path}"));
                for need in circle {
                    let file = shown(&workspace(), &need.file);
                    faults.push(format!("    {file}:{} names {}", need.line, need.path));
                }
            }
        }
    }
    fail_if_any(&faults, "Move what both sides need into a file of its own, or turn one import round.");
}

/// Product sources with their lines, tests left out: all modules of published crates that are files.
fn product_files() -> Vec<(PathBuf, usize)> {
    let mut found = BTreeMap::new();
    for (package, modules) in crates().into_iter().filter(|(package, _)| package.is_published) {
        for module in modules.0.into_values().filter(|module| module.file.starts_with(&package.folder)) {
            found.entry(module.file.clone()).or_insert_with(|| {
                let source = fs::read_to_string(&module.file).expect("readable");
                source.lines().count() - lines_of_tests(&source)
            });
        }
    }
    found.into_iter().collect()
}

/// Lines of a source that are compiled for tests alone.
fn lines_of_tests(source: &str) -> usize {
    let all = tokens(source);
    let of_tests = items(&all).into_iter().filter(|item| item.is_for_tests());
    of_tests.map(|item| item.body.last().map_or(1, |last| last.line + 1 - item.line)).sum()
}

#[test]
fn files_are_neither_long_nor_splinters() {
    let files = product_files();
    let line = |(file, lines): &(PathBuf, usize)| format!("{}: {lines} lines", shown(&workspace(), file));
    let long: Vec<String> = files.iter().filter(|(_, lines)| *lines > MAX_LINES).map(line).collect();
    fail_if_any(&long, &format!("At most {MAX_LINES} lines without tests: find the second concept, give it a file."));
    let small: Vec<String> = files.iter().filter(|(_, lines)| *lines < SMALL).map(line).collect();
    assert!(small.len() <= MAX_SMALL, "{} files of less than {SMALL} lines:\n{}", small.len(), small.join("\n"));
    assert!(
        files.len() <= MAX_FILES,
        "{} product files, at most {MAX_FILES}: merge what is read together",
        files.len()
    );
    assert!(files.len() > 300, "only {} product files are seen: does the reader still find them?", files.len());
}

/// A folder's door is the file beside it that has its name. Examples are left out: Cargo takes a file beside theirs for
/// a program.
#[test]
fn modules_have_one_style() {
    let found: Vec<String> = files(&workspace(), "mod.rs")
        .iter()
        .filter(|file| file.file_name().is_some_and(|name| name == "mod.rs"))
        .filter(|file| !file.components().any(|part| part.as_os_str() == "examples"))
        .map(|file| shown(&workspace(), file).to_string())
        .collect();
    fail_if_any(&found, "Call `folder/mod.rs` `folder.rs`.");
}

/// What trainers need of `bevy_playbot` is documented in its module `engine`, and not hidden.
#[test]
fn hardly_anything_public_is_hidden() {
    let mut hidden = Vec::new();
    for (package, modules) in crates().into_iter().filter(|(package, _)| package.is_published) {
        for (path, module) in &modules.0 {
            let items = module.items.iter().filter(|item| item.is_hidden() && item.visibility == Visibility::Public);
            hidden.extend(items.map(|item| format!("{} {}: {}", package.name, path.join("::"), item.name)));
        }
    }
    assert!(hidden.len() <= MAX_HIDDEN, "{} hidden items:\n{}", hidden.len(), hidden.join("\n"));
}

/// The first line of a module's documentation names what is in it.
#[test]
fn modules_begin_with_a_noun() {
    const QUESTIONS: [&str; 8] = ["What", "Who", "Whoever", "Where", "How", "Which", "Whether", "Why"];
    let mut faults = Vec::new();
    for file in files(&workspace(), ".rs") {
        let source = fs::read_to_string(&file).expect("readable");
        let Some(first) = source.lines().next().and_then(|line| line.strip_prefix("//! ")) else { continue };
        if QUESTIONS.iter().any(|word| first.split(' ').next() == Some(word)) {
            faults.push(format!("{}: {first}", shown(&workspace(), &file)));
        }
    }
    fail_if_any(&faults, "Say what is in it with a noun phrase: \"Wilson intervals\".");
}

/// One short example at least, compiled as a documentation test, in every module of `bevy_playbot` that can be named
/// from outside, or below it. What is `#[doc(hidden)]` needs none.
#[test]
fn every_concept_has_an_example() {
    let (_, modules) = crates().into_iter().find(|(package, _)| package.name == "bevy_playbot").expect("it is there");
    let engine = fs::read_to_string(workspace().join("plugin/src/engine.rs")).expect("it is there");
    // Programs that train meet these in `engine`, whose documentation has an example.
    let is_of_engine =
        |module: &String| engine.contains(&format!("    {module},")) || engine.contains(&format!("    {module}::"));
    let bare = without_example(&modules).into_iter().filter(|module| !is_of_engine(module));
    let faults: Vec<String> = bare.map(|module| format!("bevy_playbot::{module}: no example")).collect();
    fail_if_any(&faults, "Show in ten to twenty lines of the module's documentation how it is used.");
}

/// What `include_str!`, `include_bytes!` and `include!` read lies in the package: otherwise it is missing from what
/// `cargo package` packs. Paths in `concat!` are read up to the first piece that is no literal.
#[test]
fn included_files_lie_in_their_package() {
    let mut faults = Vec::new();
    let published = packages(&workspace()).into_iter().filter(|package| package.is_published);
    for package in published {
        for file in files(&package.folder, ".rs") {
            let all = tokens(&fs::read_to_string(&file).expect("readable"));
            for (at, token) in all.iter().enumerate() {
                if !matches!(token.text.as_str(), "include_str" | "include_bytes" | "include") {
                    continue;
                }
                let literal = all[at..].iter().take(8).find(|token| token.text.starts_with('"'));
                let Some(path) = literal.map(|literal| literal.text.trim_matches('"')) else { continue };
                let folder = file.parent().expect("a file is in a folder");
                if !plain(&folder.join(path)).starts_with(&package.folder) {
                    faults.push(format!("{}:{}: {path}", shown(&workspace(), &file), token.line));
                }
            }
        }
    }
    fail_if_any(&faults, "Move the file into the package, or embed it in playbot_assets (assets/src/lib.rs).");
}

/// A path without `..`.
fn plain(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::ParentDir => drop(plain.pop()),
            other => plain.push(other),
        }
    }
    plain
}

/// Registries want a description, keywords, categories and a README of its own for each package.
#[test]
fn published_packages_say_what_they_are() {
    let mut faults = Vec::new();
    for package in packages(&workspace()).into_iter().filter(|package| package.is_published) {
        for key in ["description", "keywords", "categories", "license"] {
            let is_given = package.manifest.lines().any(|line| line.starts_with(key));
            if !is_given {
                faults.push(format!("{}: no {key}", shown(&workspace(), &package.folder.join("Cargo.toml"))));
            }
        }
        if !package.folder.join("README.md").exists() {
            faults.push(format!("{}: no README.md", shown(&workspace(), &package.folder)));
        }
    }
    fail_if_any(&faults, "Say it in the package's Cargo.toml, or say publish = false.");
}
