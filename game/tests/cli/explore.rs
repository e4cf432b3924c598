//! Tests of exploring a level from the shell.

use std::fs;

use serde_json::Value;

use crate::program::{code, done, ended, errors, json_lines, playbot};

const MAZE: [&str; 6] = ["explore", "maze2d", "--level", "random+size=7x7:3", "--steps", "1000000"];

#[test]
fn a_maze_is_covered_and_its_solution_recorded_and_drawn() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let files = ["--out", "new/way.demo", "--png", "new/way.png", "--json"];
    let (out, reported) = done(folder, &[&MAZE[..], &files, &["--threads", "2"]].concat());
    assert!(reported.contains("recorded: new/way.demo, ") && reported.contains("drawn: new/way.png"), "{reported}");
    let found = json_lines(&out).remove(0);
    assert_eq!((found["coverage"].as_f64(), found["stop"].as_str()), (Some(1.0), Some("covered")), "{found}");
    assert!(found["open_cells"].as_u64().is_some_and(|open| open >= 17), "{found}");
    let ticks = found["solution_ticks"].as_u64().expect("a goal in reach");
    let shown = json_lines(&done(folder, &["demo", "show", "new/way.demo", "--json"]).0);
    assert_eq!((shown.len(), shown[0]["level"].as_u64()), (1, Some(3)));
    assert_eq!(shown[0]["steps"].as_u64(), Some(ticks), "{}", shown[0]);
    done(folder, &["demo", "verify", "new/way.demo"]);
    let png = fs::read(folder.join("new/way.png")).expect("drawn");
    assert!(png.starts_with(b"\x89PNG"));
    let left: Vec<_> = fs::read_dir(folder.join("new")).expect("a folder").collect();
    assert_eq!(left.len(), 2, "nothing else is left there: {left:?}");

    let (again, _) = done(folder, &[&MAZE[..], &["--json", "--threads", "1"]].concat());
    assert_eq!(again, out, "threads change nothing");
    let taken = playbot(folder, &[&MAZE[..], &files].concat());
    assert_eq!(code(&taken), 3);
    assert!(errors(&taken).contains("--force"), "{}", errors(&taken));
    done(folder, &[&MAZE[..], &["--out", "new/way.demo", "--force"]].concat());
}

#[test]
fn snapshots_change_the_speed_and_not_the_result() {
    let temporary = tempfile::tempdir().expect("a folder");
    let explored = |more: &[&str]| done(temporary.path(), &[&MAZE[..], &["--json"], more].concat());
    let (restored, fast) = explored(&[]);
    let (replayed, slow) = explored(&["--no-snapshots"]);
    assert_eq!(restored, replayed);
    assert!(json_lines(&restored)[0]["exhausted"].is_null(), "continuous actions: {restored}");
    assert!(fast.contains(" cells in ") && fast.contains("; snapshots restored "), "{fast}");
    assert!(!fast.contains("snapshots restored 0 % of the steps"), "{fast}");
    assert!(slow.contains("snapshots restored 0 % of the steps"), "{slow}");
}

#[test]
fn a_goal_that_is_not_found_is_a_finding() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let args = ["explore", "coinrun", "--level", "hard:0", "--steps", "1", "--out", "none.demo"];
    let (out, reported) = ended(folder, &args, 1);
    assert!(out.contains("solution  none was found") && out.contains("coinrun hard:0"), "{out}");
    assert!(reported.contains("nothing is recorded: no solution was found"), "{reported}");
    assert!(!folder.join("none.demo").exists());
    // The outer wall.
    let cell = |cell: &str, json: &[&str], code: i32| {
        ended(folder, &[&MAZE[..], &["--until", "solved", "--cell", cell], json].concat(), code)
    };
    let (reported, words) = cell("0,0", &[], 1);
    assert!(reported.contains("cell 0,0 was not reached"), "{reported}");
    assert!(words.contains("by the level's plan, cell 0,0 is a wall, or walls cut it off from the start"), "{words}");
    assert_eq!(json_lines(&cell("0,0", &["--json"], 1).0)[0]["cell"]["ticks"], Value::Null);
    let reached = json_lines(&cell("1,1", &["--json"], 0).0)[0]["cell"]["ticks"].as_u64().expect("it is free");
    let (reported, words) = cell("1,1", &[], 0);
    assert!(!words.contains("by the level's plan"), "{words}");
    assert!(reported.contains(&format!("cell 1,1 is reached in {reached} tick")), "{reported}");
}

#[test]
fn mistakes_are_reported_before_anything_is_explored() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    for (args, words) in [
        (&["maze2d", "--level", "medum:1"][..], "did you mean `medium`?"),
        (&["coinrun", "--level", "hard:0..3"], "one at a time is explored, such as hard:0"),
        (&["coinrun", "--level", "hard"], "`hard` names no level: write its mode and its number, such as hard:7"),
        (
            &["coinrun", "--level", "hard:0", "--cell", "900,4"],
            "cell 900,4 lies outside of the level: its cells go from 0,0",
        ),
        (&["coinrun", "--level", "hard:0", "--cell", "4"], "cells of this level have 2, such as"),
        (&["coinrun", "--sticky", "2"], "write a number from 0 to 1"),
        (&["coinrun", "--cell-size", "0"], "the size of a cell is 0"),
        (&["coinrun", "--steps", "0"], "--steps"),
        (&["coinrun", "--until", "solvd"], "did you mean `solved`?"),
        (&["coinrun", "--skills", "s", "--policy", "p"], "cannot be used with"),
        (&["coinrun", "--policy", "none.policy"], "`playbot policy export --run RUN --out none.policy`"),
        (&["coinrun", "--png", "x.svg"], "written as .png"),
        (&["ant", "--level", "chase:0", "--png", "x.png"], "leave --png out, or add one to its adapter with `.plan`"),
        (&["coinrun", "--force"], "--out <FILE>"),
        (&["coinrun", "--cell", "a", "--out", "a.demo"], "`a` is not a cell"),
        (&["coinrun", "--beside", "none"], "none"),
        (&["coinrn"], "did you mean `coinrun`?"),
    ] {
        let output = playbot(folder, &[&["explore"], args].concat());
        assert_eq!(code(&output), 3, "{args:?}: {}", errors(&output));
        assert!(errors(&output).contains(words), "{args:?}: {}", errors(&output));
        assert!(output.stdout.is_empty(), "{args:?}");
    }
    assert_eq!(fs::read_dir(folder).expect("a folder").count(), 0, "nothing is left behind");
}

#[test]
fn a_policy_is_played_beside_an_exploration_for_as_many_ticks() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let levels = "random+size=7x7+sparse+end-at-goal:3..3";
    let settings = ["--set", "arenas=4", "--set", "ppo.num_steps=64", "--set", "ppo.curiosity=Rnd(hidden: [16])"];
    let train = ["train", "maze2d", "--algorithm", "ppo", "--run", "runs/curious", "--steps", "2048"];
    let test_levels = "test=random+size=7x7+sparse+end-at-goal:40..41";
    done(folder, &[&train[..], &settings, &["--set", &format!("train={levels}"), "--set", test_levels]].concat());
    let explore = ["explore", "maze2d", "--level", "random+size=7x7+sparse+end-at-goal:3", "--steps", "20000"];
    let beside = |more: &[&str]| ended(folder, &[&explore[..], &["--until", "spent"], more].concat(), 0);
    let (alone, _) = beside(&["--json"]);
    let (both, reported) = beside(&["--json", "--beside", "runs/curious", "--png", "both.png"]);
    assert!(reported.contains("drawn: both.png"), "{reported}");
    let (mut found, alone) = (json_lines(&both).remove(0), json_lines(&alone).remove(0));
    let played = found.as_object_mut().and_then(|found| found.remove("beside")).expect("it was played");
    assert_eq!(found, alone, "the exploration stays the same");
    assert_eq!(played["player"], "runs/curious");
    let number = |name: &str| played["cells"][name].as_u64().expect("a number");
    assert_eq!(Some(number("ticks")), found["steps"].as_u64());
    assert!(number("episodes") > 1 && number("open_cells_reached") >= 1, "{played}");
    assert_eq!(number("both") + number("only_player"), number("cells"));
    assert_eq!(Some(number("both") + number("only_explorer")), found["cells"].as_u64());
    let (again, _) = beside(&["--json", "--beside", "runs/curious", "--threads", "1"]);
    assert_eq!(json_lines(&again), json_lines(&both), "threads change nothing");
    let (words, _) = beside(&["--beside", "runs/curious"]);
    assert!(words.contains("beside    runs/curious: "), "{words}");
    let size = |name: &str| {
        let png = fs::read(folder.join(name)).expect("drawn");
        // The width is in bytes 16 to 19 of a PNG.
        u32::from_be_bytes([png[16], png[17], png[18], png[19]])
    };
    beside(&["--png", "one.png"]);
    assert!(size("both.png") > size("one.png") * 3 / 2, "both are drawn");
    let mistaken = playbot(folder, &["explore", "coinrun", "--beside", "runs/curious"]);
    assert_eq!((code(&mistaken), mistaken.stdout.is_empty()), (3, true), "{}", errors(&mistaken));
    assert!(errors(&mistaken).contains("a run of the game `maze2d`, not of `coinrun`"), "{}", errors(&mistaken));
}
