//! Tests that experiments of foreign games can be read, and that the commands in them can be called.

use std::{
    fs,
    path::{Path, PathBuf},
};

use playbot_harness::split::LevelSplit;
use playbot_train::experiment::file::read_experiment;

/// Returns every `experiment.ron` below `foreign`, with the name of its folder.
fn experiments() -> Vec<(String, PathBuf)> {
    let below = |folder: &str| fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder)).expect("it is there");
    let entries = below("foreign").chain(below("foreign/default_features"));
    let folders = entries.map(|entry| entry.expect("readable"));
    let files =
        folders.map(|folder| (folder.file_name().to_string_lossy().into_owned(), folder.path().join("experiment.ron")));
    let mut found: Vec<_> = files.filter(|(_, file)| file.exists()).collect();
    found.sort();
    found
}

/// Returns the text of comments, after `//`.
fn comments(text: &str) -> impl Iterator<Item = &str> {
    text.lines().filter_map(|line| line.trim().strip_prefix("//")).map(str::trim)
}

#[test]
fn every_experiment_of_a_foreign_game_makes_sense() {
    let all = experiments();
    assert!(all.len() > 3, "{all:?}");
    for (game, file) in all {
        let experiment = read_experiment(&file).unwrap_or_else(|error| panic!("{error}"));
        experiment.check().unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        assert_eq!(experiment.game, game, "{}", file.display());
        assert!(!experiment.train.overlaps(&experiment.test), "{game} trains on what is held out");
    }
}

#[test]
fn the_demonstrations_of_an_experiment_are_made_as_it_says() {
    for (game, file) in experiments() {
        let text = fs::read_to_string(&file).expect("readable");
        let experiment = read_experiment(&file).unwrap_or_else(|error| panic!("{error}"));
        if experiment.demos.is_none() {
            continue;
        }
        let program = format!("foreign_{game}");
        let mut commands = comments(&text).filter(|line| line.starts_with(&program));
        let words: Vec<&str> = commands.next().expect("a command that records").split_whitespace().collect();
        playbot::check_usage(&words).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        let after = |word: &str| words[words.iter().position(|other| *other == word).expect(word) + 1];
        assert_eq!((after("record"), Some(Path::new(after("--out")))), (game.as_str(), experiment.demos.as_deref()));
        let levels: LevelSplit = after("--levels").parse().expect("levels");
        assert!(!levels.overlaps(&experiment.test), "{game} shows what is held out");
    }
}
