//! Tests of the length of an adapter of a foreign game: at most 25 lines, and none in the game itself.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// Foreign games.
const GAMES: [&str; 6] =
    ["alien_cake_addict", "breakout", "default_features/cellar", "default_features/orchard", "gem_hop", "slide"];

fn crate_of(game: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("foreign").join(game)
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("cannot read {}: {error}", path.display()))
}

/// Returns the files below a folder.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("cannot read {}: {error}", folder.display()));
    let paths = entries.map(|entry| entry.expect("a folder of the repository can be listed").path());
    paths.flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] }).collect()
}

/// Modules without a part in playing: the planted defects of the benchmark of testers, and a detector of the game's
/// rules with bots that test them.
const APART: [&str; 2] = ["defects", "rules"];

fn is_named_apart(path: &Path) -> bool {
    APART.iter().any(|name| path.ends_with(format!("src/{name}.rs")))
}

/// Returns the lines that count: not blank, no comment, no import, not closing brackets only, not the name of one of
/// [`APART`].
fn lines_that_count(source: &str) -> Vec<&str> {
    let mut in_use = false;
    let mut counted = Vec::new();
    for line in source.lines().map(str::trim) {
        in_use |= line.starts_with("use ");
        let closes = line.chars().all(|c| ")]};,".contains(c));
        let is_apart = APART.iter().any(|name| line == format!("mod {name};"));
        if !in_use && !closes && !line.starts_with("//") && !is_apart {
            counted.push(line);
        }
        in_use &= !line.ends_with(';');
    }
    counted
}

#[test]
fn blank_lines_comments_imports_and_closing_brackets_do_not_count() {
    let source = "//! A game.\nmod defects;\nmod rules;\n\nuse std::{\n    fs,\n};\n\
                  fn main() {\n    play([\n        1, // one\n    ]);\n}\n";
    assert_eq!(lines_that_count(source), ["fn main() {", "play([", "1, // one"]);
}

#[test]
fn no_adapter_has_more_than_25_lines() {
    for game in GAMES {
        let source = read(&crate_of(game).join("src/main.rs"));
        let lines = lines_that_count(&source);
        assert!(lines.len() <= 25, "{game}: {} lines\n{}", lines.len(), lines.join("\n"));
        assert!(lines.len() > 5, "{game}: {} lines are no adapter\n{}", lines.len(), lines.join("\n"));
        assert!(lines.iter().all(|line| line.len() <= 120), "{game}: lines are as long as elsewhere");
        assert!(lines.iter().all(|line| line.matches(';').count() <= 1), "{game}: one statement to a line");
    }
}

#[test]
fn all_of_an_adapter_is_in_its_main() {
    for game in GAMES {
        let folder = crate_of(game);
        let others = files(&folder).into_iter().filter(|path| path.extension().is_some_and(|ext| ext == "rs"));
        // Tests of its verbs are no part of an adapter, either.
        let is_apart = |path: &PathBuf| {
            path.ends_with("src/main.rs") || is_named_apart(path) || path.starts_with(folder.join("tests"))
        };
        for path in others.filter(|path| !is_apart(path)) {
            assert!(!read(&path).contains("playbot"), "{} knows of the plugin", path.display());
        }
    }
}

#[test]
fn no_adapter_needs_unsafe_code() {
    for game in GAMES {
        for path in files(&crate_of(game)).iter().filter(|path| path.extension().is_some_and(|ext| ext == "rs")) {
            let is_unsafe = read(path).lines().any(|line| line.contains("unsafe {") && !line.trim().starts_with("//"));
            assert!(!is_unsafe, "{}", path.display());
        }
    }
}

#[test]
fn nothing_of_the_examples_of_bevy_is_kept_here() {
    for (game, allowed) in [("alien_cake_addict", ["build.rs", "seeded.rs"]), ("breakout", ["build.rs", "silence.rs"])]
    {
        let folder = crate_of(game);
        for path in files(&folder).iter().filter(|path| path.extension().is_some_and(|ext| ext == "rs")) {
            let name = path.strip_prefix(&folder).expect("it was found there").display().to_string();
            let is_ours = ["src/main.rs", "tests/shell.rs"].contains(&name.as_str()) || is_named_apart(path);
            assert!(is_ours || allowed.contains(&name.as_str()), "{game} has a file {name}");
        }
    }
}
