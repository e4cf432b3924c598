//! Tests of switches: each changes the file, the number or the player that it names.

use std::{fs, path::Path, time::Instant};

use serde_json::{Value, json};

use crate::program::{code, command, done, errors, json_lines, lines, playbot};

/// Returns the standard output of a call that passes, line by line as JSON.
fn rows(folder: &Path, args: &[&str]) -> Vec<Value> {
    json_lines(&done(folder, args).0)
}

fn bytes(folder: &Path, file: &str) -> Vec<u8> {
    fs::read(folder.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
}

/// Writes an experiment: PPO on two levels, updates of 128 steps, and skills that are learned very fast.
fn write_experiment(folder: &Path) {
    let text = r#"(
        game: "coinrun", train: "easy:0..3", test: "easy:64..65", demos: "few.demo", steps: 256, arenas: 8, worlds: 2,
        skills: (window: 5, epochs: 1, batch: 16, hidden: [8], encoder_hidden: 8, gru_hidden: 8, latent: 2),
        ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8], lr: 0.05), eval: (episodes_per_level: 1),
    )"#;
    fs::write(folder.join("small.ron"), text).expect("writable");
}

#[test]
fn a_game_that_is_set_brings_its_own_experiment() {
    let temporary = tempfile::tempdir().expect("a folder");
    let shown = |set: &str| done(temporary.path(), &["config", "show", "--set", set]).0;
    let medium = "medium+fixed-start+limit=1000";
    let (train, test) = (format!("train: \"{medium}:0..9999\""), format!("test: \"{medium}:10000..10099\""));
    for set in ["game=maze2d", "game=\"maze2d\""] {
        let shown = shown(set);
        for part in [&*train, &*test, "demos: \"demos/maze2d/medium.demo\"", "action_noise: 0.0"] {
            assert!(shown.contains(part), "{part}: {shown}");
        }
    }
    let plainest = shown("game=maze2d-sighted");
    for part in ["train: \"umaze:0..63\"", "test: \"umaze:64..127\"", "demos: \"demos/maze2d-sighted\""] {
        assert!(plainest.contains(part), "{part}: {plainest}");
    }
    assert_eq!(shown("game=maze2d-with-rays"), plainest, "another name of it");
    assert_eq!(shown("game=coinrun"), shown("seed=1"), "the program's first game");
}

#[test]
fn a_recording_holds_what_the_switches_of_record_say() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let record = |file: &str, more: &[&str]| {
        done(folder, &[&["record", "coinrun", "--out", file], more].concat());
        rows(folder, &["demo", "ls", file, "--json"]).remove(0)
    };
    let levels = |file: &str| -> Vec<u64> {
        let shown = rows(folder, &["demo", "show", file, "--json"]);
        shown.iter().map(|episode| episode["level"].as_u64().expect("a number")).collect()
    };
    let actions = |file: &str| -> Vec<Value> {
        let shown = rows(folder, &["demo", "show", file, "--episode", "0", "--json"]);
        shown.iter().map(|tick| tick["action"].clone()).collect()
    };
    let three = ["--levels", "easy:4..6"];
    let plain = record("plain.demo", &three);
    assert_eq!((levels("plain.demo"), &plain["header"]["action_noise"]), (vec![4, 5, 6], &json!(0.0)));
    record("held.demo", &["--levels", "easy:4..6", "--hold-out", "easy:5..5"]);
    assert_eq!(levels("held.demo"), [4, 6]);
    assert_eq!(record("short.demo", &["--levels", "easy:4..6", "--steps", "30"])["steps"], 30);

    let noisy = |file: &str, seed: &str| record(file, &[&three[..], &["--noise", "0.5", "--seed", seed]].concat());
    assert_eq!(noisy("one.demo", "1")["header"]["action_noise"], 0.5);
    noisy("again.demo", "1");
    noisy("two.demo", "2");
    assert_ne!(actions("one.demo"), actions("plain.demo"), "--noise");
    assert_ne!(actions("one.demo"), actions("two.demo"), "--seed");
    assert!(bytes(folder, "one.demo") == bytes(folder, "again.demo"), "the same seed, the same bytes");

    let seen = record("seen.demo", &[&three[..], &["--observations"]].concat());
    assert_eq!(plain["header"]["observation_names"], json!([]));
    let names = seen["header"]["observation_names"].as_array().map_or(0, Vec::len) as u64;
    let (more, steps) = (seen["bytes"].as_u64(), seen["steps"].as_u64().expect("a number"));
    assert!(names > 0 && more > plain["bytes"].as_u64().map(|bytes| bytes + steps * names), "{seen}");

    let append =
        |file: &str, more: &[&str]| done(folder, &[&["record", "coinrun", "--out", file, "--append"], more].concat()).1;
    assert!(!append("plain.demo", &["--levels", "easy:9..9"]).contains("equal"));
    assert_eq!(levels("plain.demo"), [4, 5, 6, 9]);
    record("plain.demo", &["--levels", "easy:9..9", "--force"]);
    assert_eq!(levels("plain.demo"), [9]);
    let words = append("plain.demo", &["--levels", "easy:8..9"]);
    assert!(words.contains("1 episode is equal to one that was there before") && words.contains("--levels"), "{words}");
    let half = ["--noise", "0.5"];
    let words = append("two.demo", &[&three[..], &half, &["--seed", "2"]].concat());
    assert!(words.contains("3 episodes are equal to ones that were there before"), "{words}");
    assert!(words.contains("such as --seed 3"), "{words}");
    assert!(!append("two.demo", &[&three[..], &half, &["--seed", "3"]].concat()).contains("equal"));
}

#[test]
fn a_run_is_what_the_switches_of_train_say() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    write_experiment(folder);
    let train = |run: &str, more: &[&str]| {
        let args = ["train", "--experiment", "small.ron", "--algorithm", "ppo", "--run", run];
        done(folder, &[&args[..], more].concat());
        let info: Value = serde_json::from_slice(&bytes(folder, &format!("{run}/run.json"))).expect("JSON");
        let metrics = String::from_utf8(bytes(folder, &format!("{run}/metrics.jsonl"))).expect("Unicode");
        (info, metrics)
    };
    let checkpoints = |run: &str| -> Vec<String> {
        let entries = fs::read_dir(folder.join(run).join("checkpoints")).expect("there");
        let mut names: Vec<_> = entries.map(|entry| entry.expect("listed").file_name()).collect();
        names.sort();
        names.into_iter().map(|name| name.to_string_lossy().trim_start_matches("step-0000000").to_owned()).collect()
    };
    let (info, metrics) = train("a", &["--threads", "1", "--set", "checkpoints.keep=9"]);
    assert_eq!((&info["algorithm"], &info["device"], metrics.lines().count()), (&json!("ppo"), &json!("flex"), 2));
    let saved = checkpoints("a");
    assert_eq!(saved, ["00000", "00256"], "before the first update and at the end");

    let (_, on_two) = train("b", &["--threads", "2"]);
    assert_eq!(on_two, metrics, "--threads changes nothing but the time");
    let (other, seeded) = train("c", &["--seed", "7"]);
    assert_eq!(other["seed"], 7);
    assert_ne!(seeded, metrics, "--seed");
    let (_, long) = train("d", &["--steps", "384", "--checkpoint-every", "1", "--set", "checkpoints.keep=9"]);
    assert_eq!(long.lines().count(), 3, "--steps");
    assert_eq!(checkpoints("d"), ["00000", "00128", "00256", "00384"], "--checkpoint-every");
    let (elsewhere, computed) = train("e", &["--device", "ndarray"]);
    assert_eq!(elsewhere["device"], "ndarray");
    assert_eq!(computed.lines().count(), 2);
}

#[test]
fn a_measurement_is_of_what_the_switches_of_eval_say() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    write_experiment(folder);
    let train = ["train", "--experiment", "small.ron", "--algorithm", "ppo", "--run", "run", "--checkpoint-every", "1"];
    done(folder, &[&train[..], &["--set", "checkpoints.keep=9"]].concat());
    let eval = |more: &[&str]| {
        let args = ["eval", "--levels", "easy:64..67", "--json"];
        let rows = rows(folder, &[&args[..], more].concat());
        assert_eq!(rows.len(), 1, "{rows:?}");
        rows.into_iter().next().expect("one")
    };
    let last = eval(&["--run", "run"]);
    assert_eq!((&last["method"], &last["split"], &last["episodes"]), (&json!("ppo"), &json!("easy:64..67"), &json!(4)));
    assert_eq!(eval(&["--run", "run", "--checkpoint", "last"]), last);
    assert_eq!(eval(&["--run", "run", "--checkpoint", "256"]), last);
    assert_ne!(eval(&["--run", "run", "--checkpoint", "0"]), last, "--checkpoint: the policy before it learned");
    assert_ne!(eval(&["--run", "run", "--greedy"]), last, "--greedy");
    assert_ne!(eval(&["--run", "run", "--seed", "9"]), last, "--seed");
    for threads in ["1", "2"] {
        assert_eq!(eval(&["--run", "run", "--threads", threads]), last, "--threads changes nothing but the time");
    }
    assert_eq!(eval(&["--run", "run", "--episodes-per-level", "3"])["episodes"], 12);
    assert_eq!(eval(&["--bot", "random"])["method"], "random");
    let near = eval(&["--run", "run", "--device", "ndarray", "--greedy"]);
    assert_eq!(near["episodes"], 4, "{near}");

    let missing = playbot(folder, &["eval", "--run", "run", "--checkpoint", "100"]);
    assert_eq!(code(&missing), 3);
    assert!(errors(&missing).contains("0, 128, 256"), "{}", errors(&missing));
    let unknown = playbot(folder, &["eval", "--run", "run", "--device", "cuda"]);
    assert_eq!(code(&unknown), 3);
    assert!(errors(&unknown).contains("flex") && errors(&unknown).contains("ndarray"), "{}", errors(&unknown));
}

#[test]
fn skills_and_quickstarts_are_as_long_as_their_switches_say() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    write_experiment(folder);
    done(folder, &["record", "coinrun", "--levels", "easy:0..3", "--out", "few.demo"]);
    done(folder, &["record", "coinrun", "--levels", "easy:4..4", "--out", "one.demo"]);
    let learn = |out: &str, more: &[&str]| {
        done(folder, &[&["learn-skills", "--experiment", "small.ron", "--out", out, "--json"], more].concat())
    };
    let (one, reported) = learn("a", &[]);
    assert!(one.lines().count() == 1 && reported.contains("4 episodes from few.demo"), "{one}{reported}");
    let (three, _) = learn("b", &["--epochs", "3"]);
    let epochs: Vec<Value> = three.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(epochs.iter().map(|epoch| epoch["epoch"].as_u64()).collect::<Vec<_>>(), [Some(1), Some(2), Some(3)]);
    assert_eq!(three.lines().next(), one.lines().next(), "the first epoch is the same");
    assert!(learn("c", &["--demos", "one.demo"]).1.contains("1 episode from one.demo"));
    assert!(learn("d", &["--max-steps", "1"]).1.contains("1 episode from few.demo"));
    learn("e", &["--threads", "1"]);
    assert!(bytes(folder, "a") == bytes(folder, "e"), "--threads changes nothing but the time");

    let quick = ["quickstart", "--experiment", "small.ron", "--run", "quick", "--json"];
    let measured = rows(folder, &[&quick[..], &["--seed", "5", "--steps", "128", "--epochs", "2"]].concat());
    assert!(measured.iter().all(|row| row["split"] == "easy:64..65"), "{measured:?}");
    assert_eq!(String::from_utf8_lossy(&bytes(folder, "quick/skills.jsonl")).lines().count(), 2, "--epochs");
    for run in ["quick/ppo", "quick/score-ppo"] {
        let metrics = bytes(folder, &format!("{run}/metrics.jsonl"));
        assert_eq!(String::from_utf8_lossy(&metrics).lines().count(), 1, "--steps");
        let info: Value = serde_json::from_slice(&bytes(folder, &format!("{run}/run.json"))).expect("JSON");
        assert_eq!(info["seed"], 5, "--seed");
    }
}

#[test]
fn skills_say_how_they_do_on_what_is_held_out() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    write_experiment(folder);
    done(folder, &["record", "coinrun", "--levels", "easy:0..7", "--noise", "0.5", "--out", "few.demo"]);
    let apart = ["--experiment", "small.ron", "--set", "skills.held_out=0.25"];
    let nlls = |text: &str| -> Vec<f64> {
        json_lines(text).iter().map(|epoch| epoch["held_out_nll"].as_f64().expect("measured")).collect()
    };
    let learn = |out: &str, more: &[&str]| {
        let learn = ["learn-skills", "--epochs", "3", "--json", "--out", out];
        let (text, reported) = done(folder, &[&learn[..], &apart, more].concat());
        (nlls(&text), reported)
    };
    let (all, reported) = learn("a", &[]);
    let words = format!("held-out NLL {:.2} after epoch 3, the last, whose model is kept", all[2]);
    assert!(all.len() == 3 && reported.contains(&words), "{words}: {reported}");

    let (all, reported) = learn("b", &["--set", "skills.patience=3", "--set", "skills.lr=0.1"]);
    let best = (0..3).min_by(|&a, &b| all[a].total_cmp(&all[b])).expect("three epochs");
    let words = format!("held-out NLL {:.2} after epoch {}, the best of 3, whose model is kept", all[best], best + 1);
    assert!(reported.contains(&words), "{words}: {reported}");

    done(folder, &[&["quickstart", "--run", "quick", "--steps", "128", "--seeds", "1"][..], &apart].concat());
    assert_eq!(nlls(&String::from_utf8_lossy(&bytes(folder, "quick/skills.jsonl"))).len(), 1);
}

#[test]
fn bench_measures_the_requested_case_for_the_requested_time() {
    let temporary = tempfile::tempdir().expect("a folder");
    let bench = |more: &[&str]| {
        let args = ["bench", "--case", "sim/maze2d", "--arenas", "4", "--threads", "2", "--json"];
        let begun = Instant::now();
        (rows(temporary.path(), &[&args[..], more].concat()), begun.elapsed().as_secs_f64())
    };
    let (cases, _) = bench(&["--seconds", "0.01"]);
    let names: Vec<_> = cases.iter().filter_map(|case| case["case"].as_str()).collect();
    assert!(!names.is_empty() && names.iter().all(|name| name.contains("sim/maze2d")), "--case: {names:?}");
    for case in &cases {
        assert_eq!((&case["arenas"], &case["threads"]), (&json!(4), &json!(2)), "{case}");
        assert!(case["steps_per_s"].as_f64().is_some_and(|speed| speed > 0.0), "{case}");
        assert_eq!((&case["device"], &case["seconds"], &case["set"]), (&json!("flex"), &json!(0.01), &json!([])));
    }
    let (listed, _) = done(temporary.path(), &["bench", "--case", "sim/maze2d", "--list"]);
    assert_eq!(listed.lines().collect::<Vec<_>>(), names, "--list");
    let (of_game, _) = done(temporary.path(), &["bench", "maze2d", "--case", "sim/", "--list"]);
    assert_eq!(of_game, listed);
    let (listed, _) = done(temporary.path(), &["bench", "--case", "sim/maze2d", "--list", "--json"]);
    assert_eq!(listed.lines().next(), Some(&*json!({ "case": names[0] }).to_string()));
    let (_, took) = bench(&["--seconds", "0.5"]);
    assert!(took >= 0.5 * cases.len() as f64, "--seconds: {took} for {names:?}");
}

#[test]
fn levels_and_traces_are_those_of_the_mode_and_the_seed() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let level = |more: &[&str]| done(folder, &[&["level", "coinrun"], more].concat()).0;
    let plain = level(&["--level", "3"]);
    assert_ne!(level(&["--level", "4"]), plain);
    assert_ne!(level(&["--level", "3", "--mode", "easy"]), plain);
    assert_eq!(level(&["--level", "3", "--mode", "hard"]), plain, "that is the default");
    let reported = |args: &[&str]| done(folder, args).1;
    assert!(
        reported(&["level", "coinrun", "--level", "3"])
            .contains("no --mode is named: level 3 of hard, the mode that `train` trains in")
    );
    assert!(reported(&["level", "maze2d", "--level", "3"]).contains("no --mode is named: level 3 of medium"));
    assert_eq!(level(&["--levels", "hard:3..9"]), plain);
    let (old, warning) = done(folder, &["level", "coinrun", "--seed", "3"]);
    assert_eq!(old, plain, "--seed names the level for one more version");
    assert!(warning.contains("warning: --seed 3") && warning.contains("for a level use --level 3"), "{warning}");
    assert!(!reported(&["level", "coinrun", "--level", "3"]).contains("warning"));
    let recorded = reported(&["record", "coinrun", "--steps", "20", "--out", "default.demo"]);
    assert!(recorded.contains("recording hard:0..499, but for the held-out levels hard:64..1087"), "{recorded}");
    let seen = reported(&["record", "coinrun", "--levels", "hard:60..70", "--steps", "20", "--out", "seen.demo"]);
    assert!(seen.contains("level 64 is one") && seen.contains("--hold-out hard:64..1087"), "{seen}");
    let described: Value = serde_json::from_str(&level(&["--level", "3", "--json"])).expect("one line of JSON");
    assert!(described.is_object(), "{described}");

    // Long enough to meet the differences between levels.
    let actions = ["8"; 60].join(",");
    let trace = |more: &[&str]| done(folder, &[&["trace", "coinrun", "--actions", &actions], more].concat()).0;
    let here = trace(&["--mode", "hard", "--level", "2", "--json"]);
    assert!(here.lines().all(|step| serde_json::from_str::<Value>(step).is_ok_and(|step| step.is_array())), "{here}");
    assert_eq!(trace(&["--level", "2", "--json"]), here, "hard is the default");
    assert_ne!(trace(&["--mode", "easy", "--level", "2", "--json"]), here);
    let table = trace(&["--level", "2"]);
    assert!(table.lines().count() > here.lines().count(), "a head, and a line for each step: {table}");
    assert!(table.lines().all(|line| serde_json::from_str::<Value>(line).is_err()), "{table}");
}

#[test]
fn what_happens_inside_is_reported_on_request() {
    let temporary = tempfile::tempdir().expect("a folder");
    let reported = |more: &[&str]| {
        let doctor = ["doctor", "maze2d", "--ticks", "2", "--level", "6", "--seed", "5", "--json"];
        let mut command = command(temporary.path(), &[&doctor[..], more].concat());
        let output = command.env_remove("RUST_LOG").output().expect("the program starts");
        assert_eq!(code(&output), 0, "{}", errors(&output));
        let report = lines(&output).remove(0);
        assert_eq!((&report["ticks"], &report["mode"]), (&json!(2), &json!("medium")));
        assert_eq!((&report["level"], &report["seed"]), (&json!(6), &json!(5)));
        errors(&output)
    };
    assert!(!reported(&[]).contains("DEBUG"));
    assert!(reported(&["-vv"]).contains("DEBUG"));
}
