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
    items::items,
    modules::Modules,
    packages::{Package, packages, workspace},
    public::Public,
    tokens::tokens,
};

/// A file with more lines holds more than one concept.
const MAX_LINES: usize = 300;
/// Public items of `bevy_playbot`: what a game developer may have to look at.
const MAX_PUBLIC: usize = 120;

fn fail_if_any(faults: &[String], advice: &str) {
    assert!(faults.is_empty(), "{} to mend\n{}\n{advice}\n", faults.len(), faults.join("\n"));
}

/// Every crate with its modules.
fn crates() -> Vec<(Package, Modules)> {
    let with_root = packages(&workspace()).into_iter().filter_map(|package| Some((package.root()?, package)));
    with_root.map(|(root, package)| (package, Modules::read(&root))).collect()
}

/// Circles of the folders that are asked for, by package and path: how the way leads round and where it is written.
fn describe_circles(wanted: impl Fn(&str, &[String]) -> bool) -> Vec<String> {
    let mut faults = Vec::new();
    for (package, modules) in crates() {
        let needs = needs(&modules);
        for (folder, edges) in folders(&needs).into_iter().filter(|(folder, _)| wanted(&package.name, folder)) {
            for circle in circles(&edges) {
                let depth = folder.len();
                let names = circle.iter().map(|need| need.from[depth].as_str());
                let way = names.chain([circle[0].from[depth].as_str()]).collect::<Vec<_>>().join(" -> ");
                let place = [slice::from_ref(&package.name), folder].concat().join("::");
                faults.push(format!("{place}: {way}"));
                for need in circle {
                    let file = shown(&workspace(), &need.file);
                    faults.push(format!("    {file}:{} names {}", need.line, need.path));
                }
            }
        }
    }
    faults
}

/// A module may name another, or that one it, not both, whether directly or through others. `use` declarations and paths
/// with `crate::`, `self::` and `super::` count, by the module in which the item is defined; tests do not.
#[test]
fn top_level_modules_need_one_another_in_no_circle() {
    let faults = describe_circles(|_, folder| folder.is_empty());
    fail_if_any(&faults, "Move what both sides need into a module of its own, or turn one import round.");
}

/// The same for the files of each folder of the games, which others read to write theirs.
#[test]
fn modules_of_a_folder_need_one_another_in_no_circle() {
    let faults = describe_circles(|package, folder| package == "playbot_games" && !folder.is_empty());
    fail_if_any(&faults, "Move what both sides need into a file of its own, or turn one import round.");
}

/// Every `*.rs`, whether source, test or example.
#[test]
fn files_are_short() {
    let mut faults = Vec::new();
    for file in files(&workspace(), ".rs") {
        let lines = fs::read_to_string(&file).expect("readable").lines().count();
        if lines > MAX_LINES {
            faults.push(format!("{}:{MAX_LINES}: {lines} lines", shown(&workspace(), &file)));
        }
    }
    fail_if_any(&faults, &format!("At most {MAX_LINES} lines: find the second concept and give it a file of its own."));
}

/// `mod.rs` and `lib.rs` have documentation and attributes, `mod name;`, `use`, `extern crate`, modules in braces that keep
/// to the same rule, and items for documentation tests (`#[cfg(doctest)]`); nothing else, not even for tests.
#[test]
fn mod_rs_and_lib_rs_only_declare() {
    let mut faults = Vec::new();
    for file in files(&workspace(), ".rs") {
        if file.file_name().is_some_and(|name| name == "mod.rs" || name == "lib.rs") {
            let source = fs::read_to_string(&file).expect("readable");
            let mut queue = items(&tokens(&source));
            while let Some(item) = queue.pop() {
                let is_doctest = item.attributes.iter().any(|attribute| attribute == "cfg(doctest)");
                match item.inline_module() {
                    Some(tokens) => queue.extend(items(tokens)),
                    None if is_doctest || matches!(item.keyword.as_str(), "mod" | "use" | "extern") => {}
                    None => {
                        let file = shown(&workspace(), &file);
                        faults.push(format!("{file}:{}: {} {}", item.line, item.keyword, item.name));
                    }
                }
            }
        }
    }
    faults.sort();
    fail_if_any(&faults, "Move these into files that are named for what they hold; re-export what others need.");
}

/// Structs, enums, unions, traits, functions, types, constants, statics and exported macros that can be named from outside:
/// `pub` in a module that is `pub` up to the root, or re-exported from one, each once, whatever features it needs. Neither
/// methods, fields and variants count, nor what is `#[doc(hidden)]`. A named re-export from another crate counts as one;
/// one of a whole crate, or with `*`, is a fault.
#[test]
fn a_game_developer_meets_few_items() {
    let (_, modules) = crates().into_iter().find(|(package, _)| package.name == "bevy_playbot").expect("it is there");
    let public = Public::of(&modules);
    let mut by_module: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for item in &public.items {
        let (module, name) = item.split_once("::").unwrap_or(("", item));
        by_module.entry(module).or_default().push(name);
    }
    let boundless = public.boundless.iter().map(|path| format!("plugin/src: re-exports all of {path}"));
    let mut faults: Vec<String> = boundless.collect();
    if public.items.len() > MAX_PUBLIC {
        faults.push(format!("bevy_playbot has {} public items, at most {MAX_PUBLIC}:", public.items.len()));
        faults.extend(
            by_module.iter().map(|(module, names)| format!("    {module} {}: {}", names.len(), names.join(" "))),
        );
    }
    fail_if_any(&faults, "Make what games do not need pub(crate) or #[doc(hidden)], or move it to playbot_lab.");
}

/// One short example at least, compiled as a documentation test, in every module of `bevy_playbot` that can be named from
/// outside, or below it. What is `#[doc(hidden)]` needs none.
#[test]
fn every_concept_has_an_example() {
    let (_, modules) = crates().into_iter().find(|(package, _)| package.name == "bevy_playbot").expect("it is there");
    let faults: Vec<String> =
        without_example(&modules).into_iter().map(|module| format!("bevy_playbot::{module}: no example")).collect();
    fail_if_any(&faults, "Show in ten to twenty lines of the module's documentation how it is used.");
}

/// What `include_str!`, `include_bytes!` and `include!` read lies in the package, or is linked into it: otherwise it is
/// missing from what `cargo package` packs. Paths in `concat!` are read up to the first piece that is no literal.
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
    fail_if_any(&faults, "Link the folder into the package (ln -s ../assets assets) and include through the link.");
}

/// A path without `..`, links not followed.
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
