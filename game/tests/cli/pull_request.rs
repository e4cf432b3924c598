//! Tests that a change which breaks levels is distinguished from noise.

use std::{collections::BTreeSet, fs, path::Path};

use playbot::prelude::*;
use playbot_games::coinrun::CoinRun;
use playbot_harness::inspect::LevelRequest;
use serde_json::{Value, json};

use crate::program::ended;

const FILES: &str = "files:levels/*.json";

fn name(seed: u64) -> String {
    format!("levels/{seed:03}.json")
}

/// Writes unmutated levels into files, as `playbot level --json` prints them.
fn draw(folder: &Path, seeds: impl IntoIterator<Item = u64>) {
    fs::create_dir_all(folder.join("levels")).expect("writable");
    let game = CoinRun::default();
    for seed in seeds {
        let request = LevelRequest { mode: Some("hard"), level: Some(seed), ..LevelRequest::default() };
        let shown = game.show_level(&request).unwrap_or_else(|error| panic!("{seed}: {error}"));
        fs::write(folder.join(name(seed)), shown.json).expect("writable");
    }
}

fn read(folder: &Path, seed: u64) -> Value {
    let text = fs::read_to_string(folder.join(name(seed))).expect("a level");
    serde_json::from_str(&text).expect("JSON")
}

fn coin(level: &Value) -> (usize, usize) {
    let number = |place: usize| level["coin"][place].as_u64().expect("a number") as usize;
    (number(0), number(1))
}

/// Writes other letters into a level: by column, row and letter.
fn paint(level: &mut Value, other: impl Fn(usize, usize, char) -> char) {
    for (y, row) in level["rows"].as_array_mut().expect("rows").iter_mut().enumerate() {
        let letters = row.as_str().expect("a row").chars().enumerate();
        *row = letters.map(|(x, letter)| other(x, y, letter)).collect::<String>().into();
    }
}

/// Puts walls of the level's whole height on both sides of the coin.
fn wall_in(level: &mut Value) {
    let (at, _) = coin(level);
    paint(level, |x, _, letter| if x.abs_diff(at) == 2 { '#' } else { letter });
}

/// Hangs the coin out of reach of every jump.
fn lift(level: &mut Value) {
    let (at, up) = coin(level);
    paint(level, |x, y, letter| match (x, y) {
        (x, 60) if x == at => 'C',
        (x, y) if (x, y) == (at, up) => '.',
        _ => letter,
    });
    level["coin"] = json!([at, 60]);
}

/// Floods everything between the start and the coin.
fn flood(level: &mut Value) {
    let (at, _) = coin(level);
    paint(level, |x, y, letter| match (x, y) {
        (x, _) if x < 3 || x + 1 >= at => letter,
        (_, 0) => '^',
        _ => '.',
    });
    for bodies in ["saws", "crates", "crate_sprites", "enemies", "enemy_sprites"] {
        level[bodies] = json!([]);
    }
    level["order"] = "".into();
}

/// Returns the levels in lists of a comparison.
fn named(folder: &Path, out: &str, lists: &[&str]) -> BTreeSet<String> {
    let text = fs::read_to_string(folder.join(out).join("against.json")).expect("a comparison");
    let comparison: Value = serde_json::from_str(&text).expect("JSON");
    let changes = lists.iter().flat_map(|list| comparison[*list].as_array().expect("a list"));
    changes.map(|change| change["level"].as_str().expect("a name").to_owned()).collect()
}

#[test]
fn the_three_of_five_hundred_levels_that_a_change_breaks_are_named_and_no_other() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    draw(folder, 0..500);
    let test = |out: &str, more: &[&str], wanted: i32| {
        ended(folder, &[&["test", "coinrun", "--levels", FILES, "--out", out], more].concat(), wanted)
    };
    let search = ["--bot", "search"];
    let random = ["--bot", "search,random", "--episodes", "2", "--no-detect", "all"];
    test("search", &search, 0);
    test("random", &random, 0);
    // The lake has to be wide.
    let far = (300..500).find(|&seed| coin(&read(folder, seed)).0 >= 30).expect("a long level");
    let changes: [(u64, fn(&mut Value)); 3] = [(17, wall_in), (203, lift), (far, flood)];
    for (seed, change) in changes {
        let mut level = read(folder, seed);
        change(&mut level);
        fs::write(folder.join(name(seed)), level.to_string()).expect("writable");
    }
    let broken: BTreeSet<String> = changes.iter().map(|&(seed, _)| name(seed)).collect();
    for (before, more) in [("search", &search[..]), ("random", &random[..])] {
        let out = format!("{before} now");
        let (_, words) = test(&out, &[more, &["--seed", "9", "--against", before]].concat(), 1);
        assert_eq!(named(folder, &out, &["unsolvable", "harder"]), broken, "{words}");
        assert!(named(folder, &out, &["new_findings"]).is_subset(&broken), "{words}");
        assert!(named(folder, &out, &["easier", "gone_findings"]).is_empty(), "{words}");
        let summary = fs::read_to_string(folder.join(&out).join("summary.md")).expect("a summary");
        assert!(broken.iter().all(|level| summary.contains(level)), "{summary}");
    }
    // The change is taken back.
    draw(folder, changes.map(|(seed, _)| seed));
    test("mended", &[&search[..], &["--against", "search"]].concat(), 0);
}

#[test]
fn the_same_code_raises_no_alarm_with_twenty_other_seeds() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    draw(folder, 0..25);
    // Fewer episodes would leave noise in so many levels, and would prove nothing here.
    let plan = [
        "test",
        "coinrun",
        "--levels",
        FILES,
        "--bot",
        "random,right-jump",
        "--episodes",
        "8",
        "--no-detect",
        "all",
        "--force",
    ];
    let solved = |out: &str| -> Vec<Option<u64>> {
        let text = fs::read_to_string(folder.join(out).join("results.json")).expect("results");
        let results: Value = serde_json::from_str(&text).expect("JSON");
        results["levels"].as_array().expect("levels").iter().map(|level| level["solved"].as_u64()).collect()
    };
    ended(folder, &[&plan[..], &["--out", "before"]].concat(), 1);
    let before = solved("before");
    for seed in 1..=20 {
        let (out, seed) = (format!("seed {seed}"), seed.to_string());
        let (_, words) =
            ended(folder, &[&plan[..], &["--out", &out, "--seed", &seed, "--against", "before"]].concat(), 0);
        assert!(words.contains("nothing has changed by more than chance in 25 levels"), "{seed}: {words}");
        assert_ne!(solved(&out), before, "{seed}: chance has its part in it");
    }
}
