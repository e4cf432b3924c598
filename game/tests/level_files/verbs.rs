//! Tests that every verb with levels accepts files.

use std::{fs, path::Path};

use serde_json::{Value, json};

use crate::program::{done, ended};

fn level(folder: &Path, args: &[&str]) -> Value {
    let (line, _) = done(folder, &[&["level"], args, &["--json"]].concat());
    serde_json::from_str(&line).expect("a line of JSON")
}

fn write(folder: &Path, name: &str, level: &Value) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("below the folder")).expect("writable");
    fs::write(path, serde_json::to_string_pretty(level).expect("text")).expect("writable");
}

/// Puts walls of the level's whole height on both sides of the coin.
fn wall_in(level: &mut Value) {
    let coin = level["coin"][0].as_u64().expect("a number") as usize;
    for row in level["rows"].as_array_mut().expect("rows") {
        let letters = row.as_str().expect("a row").chars().enumerate();
        let walled = letters.map(|(x, letter)| if x.abs_diff(coin) == 2 { '#' } else { letter });
        *row = walled.collect::<String>().into();
    }
}

fn success(folder: &Path, args: &[&str]) -> f64 {
    let (row, _) = done(folder, &[&["eval", "--episodes-per-level", "1", "--json"], args].concat());
    serde_json::from_str::<Value>(row.trim()).expect("a row")["success"].as_f64().expect("a share")
}

#[test]
fn the_search_bot_solves_sound_files_and_no_walled_coin() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    for seed in ["1", "2", "3"] {
        let mut drawn = level(folder, &["coinrun", "--mode", "easy", "--level", seed]);
        write(folder, &format!("sound/inner/{seed}.json"), &drawn);
        wall_in(&mut drawn);
        write(folder, &format!("walled/{seed}.json"), &drawn);
    }
    assert_eq!(success(folder, &["--bot", "search", "--levels", "files:sound/**/*.json"]), 1.0);
    assert_eq!(success(folder, &["--bot", "search", "--levels", "files:walled/*.json"]), 0.0);
    let (row, _) = done(folder, &["eval", "--bot", "search", "--levels", "files:sound/**/*.json", "--json"]);
    assert_eq!(serde_json::from_str::<Value>(row.trim()).expect("a row")["split"], "files:sound/**/*.json:0..2");
    done(folder, &["eval", "--bot", "search", "--levels", "files:walled/1.json", "--plot", "where.png"]);
}

#[test]
fn the_waypoint_bot_solves_sound_mazes_and_no_sealed_one() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let rules = "sparse+end-at-goal";
    let open = ["#######", "#SOO#G#", "#O#OOO#", "#######"];
    let sealed = ["#######", "#SOO#G#", "#O#O###", "#######"];
    write(folder, "open.json", &json!({ "rows": open, "rules": rules }));
    write(folder, "sealed.json", &json!({ "rows": sealed, "rules": rules }));
    let of_maze2d = |file: &str| success(folder, &["--set", "game=maze2d", "--bot", "waypoints", "--levels", file]);
    assert_eq!((of_maze2d("files:open.json"), of_maze2d("files:sealed.json")), (1.0, 0.0));
    let shown = done(folder, &["level", "maze2d", "--file", "sealed.json"]).0;
    assert!(shown.contains("no path from the start to the goal"), "{shown}");
    assert!(level(folder, &["maze2d", "--file", "sealed.json"]).get("shortest_path_length").is_none());
    write(folder, "plain.json", &json!({ "rows": sealed }));
    done(folder, &["level", "antmaze", "--file", "plain.json", "--png", "sealed.svg"]);
}

#[test]
fn levels_are_shown_traced_and_viewed_from_files() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    for seed in ["4", "5"] {
        write(folder, &format!("levels/{seed}.json"), &level(folder, &["coinrun", "--level", seed]));
    }
    let plain = done(folder, &["level", "coinrun", "--level", "5", "--png", "a.png"]).0;
    assert_eq!(done(folder, &["level", "coinrun", "--file", "levels/5.json", "--png", "b.png"]).0, plain);
    assert_eq!(done(folder, &["level", "coinrun", "--mode", "files:levels/*.json", "--level", "1"]).0, plain);
    assert_eq!(fs::read(folder.join("a.png")).expect("drawn"), fs::read(folder.join("b.png")).expect("drawn"));

    let actions = ["8"; 40].join(",");
    let trace =
        |more: &[&str]| done(folder, &[&["trace", "coinrun", "--actions", &actions, "--json"], more].concat()).0;
    let fifth = trace(&["--level", "5"]);
    assert_eq!(trace(&["--levels", "files:levels/5.json"]), fifth);
    assert_eq!(trace(&["--levels", "files:levels/*.json", "--level", "1"]), fifth);
    assert_eq!(trace(&["--levels", "files:levels/*.json"]), trace(&["--level", "4"]));
    assert_eq!(trace(&["--mode", "files:levels/*.json", "--level", "1"]), fifth);

    let view = |more: &[&str]| {
        done(folder, &[&["view", "coinrun", "--tick", "9", "--out", "view.png"], more].concat());
        fs::read(folder.join("view.png")).expect("drawn")
    };
    assert_eq!(view(&["--levels", "files:levels/*.json", "--level", "1"]), view(&["--level", "5"]));

    fs::write(folder.join("pushes.txt"), "1 0\n0 1\n").expect("writable");
    write(folder, "maze.json", &level(folder, &["maze2d", "--map", "medium+sparse", "--level", "3"]));
    let pushes = |more: &[&str]| {
        done(folder, &[&["trace", "maze2d", "--actions-file", "pushes.txt", "--json"], more].concat()).0
    };
    assert_eq!(pushes(&["--levels", "files:maze.json"]), pushes(&["--map", "medium+sparse", "--level", "3"]));
}

#[test]
fn training_takes_files_too() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    for seed in ["1", "2", "3"] {
        let drawn = level(folder, &["coinrun", "--mode", "easy", "--level", seed]);
        let part = if seed == "3" { "test" } else { "train" };
        write(folder, &format!("{part}/{seed}.json"), &drawn);
    }
    fs::write(
        folder.join("tiny.ron"),
        r#"(game: "coinrun", train: "files:train/*.json", test: "files:test/*.json", arenas: 4, worlds: 1, steps: 128,
            ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8]), eval: (episodes_per_level: 1))"#,
    )
    .expect("writable");
    let train = |more: &[&'static str]| {
        [&["train", "--experiment", "tiny.ron", "--algorithm", "ppo", "--steps", "128"], more].concat()
    };
    done(folder, &train(&["--run", "run"]));
    done(folder, &["eval", "--run", "run", "--json"]);
    let (_, words) = ended(folder, &train(&["--run", "leak", "--set", "test=files:train/2.json"]), 3);
    assert!(words.contains("files:train/2.json"), "{words}");
}

#[test]
fn what_is_wrong_with_files_is_said() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::write(folder.join("bad.json"), "{\n\"rows\": [\n\"####\",\n\"#?C#\"]}").expect("writable");
    fs::write(folder.join("good.json"), "{ \"rows\": [\"####\", \"#.C#\"] }").expect("writable");
    for (args, words) in [
        (&["eval", "--bot", "search", "--levels", "files:none/*.json"][..], "files:none/*.json matches no file"),
        (&["eval", "--bot", "search", "--levels", "files:*.json"], "bad.json, line 4: unknown letter `?`"),
        (&["eval", "--bot", "search", "--levels", "files:good.json:0..4"], "there is no level 4 in files:good.json"),
        (&["record", "coinrun", "--levels", "files:bad.json", "--out", "a.demo"], "bad.json, line 4"),
        (&["level", "coinrun", "--file", "bad.json"], "bad.json, line 4"),
        (&["level", "coinrun", "--file", "none.json"], "cannot read none.json"),
        (&["level", "coinrun", "--file", "good.json", "--level", "1"], "--level"),
        (&["view", "coinrun", "--levels", "files:bad.json"], "bad.json, line 4"),
        (&["view", "coinrun", "--levels", "files:good.json", "--level", "1"], "--level 1 is none of the levels"),
        (&["view", "coinrun", "--levels", "files:good.json", "--mode", "easy"], "--mode"),
        (&["trace", "coinrun", "--levels", "files:bad.json", "--actions", "1"], "bad.json, line 4"),
        (&["record", "ant", "--levels", "files:good.json", "--out", "a.demo"], "`ant` has no level files"),
    ] {
        let (_, errors) = ended(folder, args, 3);
        assert!(errors.contains(words), "{args:?}: {errors}");
    }
}
