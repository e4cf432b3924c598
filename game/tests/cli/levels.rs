//! Tests of audits of levels.

use std::{fs, path::Path};

use serde_json::{Value, json};

use crate::program::{done, ended};

fn audit(folder: &Path, args: &[&str], wanted: i32) -> Value {
    let (data, _) = ended(folder, &[&["levels"], args, &["--json"]].concat(), wanted);
    serde_json::from_str(&data).expect("one line of JSON")
}

#[test]
fn equal_levels_are_counted_and_named_within_a_set_and_among_another() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // Counted from the JSON of the levels by another program.
    let all = audit(folder, &["coinrun", "--levels", "hard:0..1087", "--layouts-only"], 1);
    assert_eq!((&all["count"], &all["layouts"]), (&json!(1088), &json!(869)));
    let groups = all["equal"].as_array().expect("groups");
    assert!(groups.iter().any(|group| group.as_array().is_some_and(|all| all.contains(&json!(142)))));
    assert_eq!(all["solved_without_action"], Value::Null);
    assert!(all["equal_plans"].is_array(), "levels of one floor plan and of different layouts");
    let among = ["--among", "hard:0..63", "--among", "easy:0..499"];
    let held_out =
        audit(folder, &[&["coinrun", "--levels", "hard:64..1087", "--layouts-only"], &among[..]].concat(), 1);
    let counts = [0, 1].map(|at: usize| held_out["among"][at]["levels"].as_array().map(Vec::len));
    assert_eq!(counts, [Some(46), Some(222)]);
    assert_eq!((&held_out["layouts"], held_out["equal"][0].as_array().map(Vec::len)), (&json!(816), Some(12)));
    let (text, _) = ended(folder, &["levels", "coinrun", "--levels", "hard:0..1087", "--layouts-only"], 1);
    assert!(text.contains("layouts: 869; ") && text.contains("(--json has all)"), "{text}");
}

#[test]
fn levels_that_one_held_action_solves_are_those_of_the_bot_that_holds_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let found = audit(folder, &["coinrun", "--levels", "hard:0..63"], 1);
    let held = found["solved_by_one_action"].as_array().expect("actions");
    let held = held.iter().find(|one| one["action"] == "right+jump").expect("the bot's action");
    // The return of right-jump on these levels is 6.40625 in the original, and a coin is worth 10.
    assert_eq!(held["levels"].as_array().map(Vec::len), Some(41));
    assert_eq!(found["solved_without_action"], json!([]));
    // Start and goal of these are in one cell, so that no action is needed.
    let (mazes, _) = ended(folder, &["levels", "maze2d", "--levels", "medium:0..49"], 1);
    assert!(mazes.contains("solved without an action: 3: 17, 35, 39\n"), "{mazes}");
    // Each of them has a start and a goal of its own, to the last bit.
    let words = "layouts: 50, by the state of the game in up to 600 ticks; 0 of the levels share theirs with another";
    assert!(mazes.contains(words), "{mazes}");
    let (unplayed, _) = ended(folder, &["levels", "maze2d", "--levels", "medium:0..49", "--layouts-only"], 0);
    assert!(unplayed.contains("equal levels: unknown"), "{unplayed}");
}

#[test]
fn copies_of_a_file_and_of_a_numbered_level_are_found() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (level, _) = done(folder, &["level", "coinrun", "--level", "81", "--json"]);
    for name in ["a.json", "b.json"] {
        fs::write(folder.join(name), &level).expect("writable");
    }
    let args = ["coinrun", "--levels", "files:*.json", "--layouts-only", "--among", "hard:140..145"];
    let found = audit(folder, &args, 1);
    assert_eq!((&found["layouts"], &found["equal"]), (&json!(1), &json!([[0, 1]])));
    assert_eq!((&found["names"], &found["compared_by"]), (&json!({ "0": "a.json", "1": "b.json" }), &json!("layout")));
    let (text, _) = ended(folder, &[&["levels"][..], &args].concat(), 1);
    assert!(text.contains("\n  equal: a.json, b.json\n"), "{text}");
    assert!(text.ends_with("among hard:140..145: 2: a.json, b.json\n"), "{text}");
    assert_eq!(found["among"][0]["levels"], json!([0, 1]), "level 142 has the same layout");
    let clean = audit(folder, &["coinrun", "--levels", "files:a.json", "--layouts-only"], 0);
    assert_eq!(clean["equal"], json!([]));
    let (_, words) = done(folder, &["test", "coinrun", "--levels", "files:*.json", "--bot", "search", "--out", "t"]);
    assert!(words.contains("2 levels have 1 layout"), "{words}");
}

#[test]
fn a_level_that_is_solved_in_its_first_tick_has_a_warning_while_it_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("beside.json"), json!({"rows": ["####", "#.C#"]}).to_string()).expect("writable");
    let (far, _) = done(folder, &["level", "coinrun", "--mode", "easy", "--level", "3", "--json"]);
    fs::write(folder.join("far.json"), far).expect("writable");
    let (words, _) = done(folder, &["watch", "coinrun", "--levels", "files:*.json", "--once"]);
    let warned: Vec<&str> =
        words.lines().filter(|line| line.contains("warning: it is solved in its first tick")).collect();
    assert!(warned.len() == 1 && warned[0].starts_with("beside.json: solved in 1 tick by search; "), "{words}");
}
