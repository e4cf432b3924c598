//! Tests of `playbot study` through its command line: the same files in one go, after a kill, and when nothing is left
//! to do.

#[path = "shared/program.rs"]
mod program;

use std::{
    fs,
    io::{BufRead, BufReader},
    path::Path,
    process::{Output, Stdio},
    time::{Duration, Instant},
};

use program::{code, command, done, errors, playbot, said};
use serde_json::Value;

const TINY: &str = r#"(
    game: "coinrun", train: "hard:0..3", test: "hard:64..65", demos: "demos", steps: 1024, arenas: 8, worlds: 2,
    seeds: [1, 2],
    variants: [
        (name: "full"),
        (name: "no-kl", set: ["score.kl=false"]),
        (name: "plain", set: ["algorithm=ppo"]),
        (name: "chosen", set: ["algorithm=spirl-ppo"]),
        (name: "recorded", set: ["algorithm=rlpd"]),
        (name: "cloned", set: ["algorithm=bc"]),
        (name: "imitated", set: ["algorithm=imitation"]),
        (name: "asked", set: ["algorithm=imitation", "imitation.dagger=true"]),
    ],
    skills: (window: 5, epochs: 1, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
    ppo: (num_steps: 16, minibatches: 2, hidden: [16, 16]),
    sac: (num_steps: 16, learning_starts: 500, updates_per_step: 0.02, batch: 16, hidden: [16, 16]),
    rlpd: (critics: 3), imitation: (rounds: 2, steps: 128),
    eval: (episodes_per_level: 1),
    checkpoints: (every: 2),
)"#;

fn study(folder: &Path, runs: &str, more: &[&str]) -> Output {
    let args = ["study", "--experiment", "tiny.ron", "--out", "out", "--runs", runs];
    playbot(folder, &[&args, more].concat())
}

fn ok(output: Output) -> Output {
    assert_eq!(code(&output), 0, "{}", errors(&output));
    output
}

fn refused(output: &Output, words: &str) {
    let errors = errors(output);
    assert_eq!(code(output), 3, "{errors}");
    assert!(errors.contains(words), "{errors}");
}

/// Returns a folder with the tiny experiment and a few recordings.
fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("tiny.ron"), TINY).expect("writable");
    fs::create_dir(folder.path().join("demos")).expect("writable");
    let record = ["record", "coinrun", "--levels", "easy:0..7", "--out", "demos/a.demo"];
    done(folder.path(), &record);
    folder
}

/// Returns all files that a study writes for its readers.
fn written(folder: &Path) -> Vec<String> {
    let read = |name| fs::read_to_string(folder.join("out").join(name)).expect("written");
    ["table.md", "curves.svg", "results.json", "experiment.ron"].map(read).into()
}

#[test]
fn a_killed_study_goes_on_to_the_same_files_and_repeats_nothing() {
    let folder = prepared();
    let folder = folder.path();
    let whole = ok(study(folder, "whole", &[]));
    let expected = written(folder);
    let table = said(&whole);
    assert_eq!(table.lines().count(), 10, "headings, rule and eight variants: {table}");
    assert!(
        expected[0].contains(table.trim()) && expected[0].contains("playbot study --experiment tiny.ron --out out")
    );

    assert!(expected[0].ends_with("\nAll values are in [experiment.ron](experiment.ron).\n"), "{}", expected[0]);
    let drawn = &expected[1];
    assert!(
        !drawn.contains("var(") && drawn.contains("Curves begin once 100 training episodes have ended."),
        "{drawn}"
    );
    let file = &expected[3];
    assert!(file.contains("`playbot study --experiment out/experiment.ron`\n// repeats it."), "{file}");
    assert!(file.contains("    seeds: [1, 2],\n") && file.contains("(name: \"full\", set: []),\n"), "{file}");
    let results: Value = serde_json::from_str(&expected[2]).expect("JSON");
    let rows = results["results"].as_array().expect("rows");
    let names: Vec<_> = rows.iter().filter_map(|row| Some((row["variant"].as_str()?, row["seed"].as_u64()?))).collect();
    let all = ["full", "no-kl", "plain", "chosen", "recorded", "cloned", "imitated", "asked"]
        .map(|name| [(name, 1), (name, 2)]);
    assert_eq!(names, all.concat());
    assert!(rows.iter().all(|row| row["test"]["episodes"] == 2));
    assert!(rows[..10].iter().all(|row| row["training"]["steps"] == 1024) && rows[10]["training"].is_null());
    assert_eq!(rows[14]["training"]["steps"], 256, "two rounds of 128 labels");
    let models = fs::read_dir(folder.join("whole")).expect("there").flatten();
    let models = models.filter(|entry| entry.file_name().to_string_lossy().starts_with("skills-")).count();
    assert_eq!(models, 2, "one for each seed, shared by the variants");
    let cost = fs::read_to_string(folder.join("out/cost.md")).expect("written");
    assert!(cost.contains("| recorded |") && cost.contains("2048 |") && !cost.contains('–'), "{cost}");
    let saved = fs::read_to_string(folder.join("whole/no-kl-seed2/experiment.ron")).expect("written");
    assert!(saved.contains("variants: []") && saved.contains("kl: false") && saved.contains("seed: 2"), "{saved}");

    let args = ["study", "--experiment", "tiny.ron", "--out", "out", "--runs", "killed"];
    let mut child = command(folder, &args).stderr(Stdio::piped()).stdout(Stdio::null()).spawn().expect("starts");
    let mut said = BufReader::new(child.stderr.take().expect("piped")).lines().map_while(Result::ok);
    assert!(said.any(|line| line.starts_with("full-seed2: ")), "two runs of sixteen are done");
    let begun = Instant::now();
    while !folder.join("killed/no-kl-seed1/checkpoints").exists() && begun.elapsed() < Duration::from_secs(60) {
        std::thread::yield_now();
    }
    child.kill().expect("killed or done");
    child.wait().expect("ended");
    assert!(!folder.join("killed/cloned-seed2/result.json").exists(), "it was killed before its end");
    fs::remove_dir_all(folder.join("out")).expect("there");
    refused(&study(folder, "killed", &[]), "--resume");
    // Another process trains in one of its folders.
    let lock = fs::File::open(folder.join("killed/no-kl-seed1/run.lock")).expect("there");
    lock.lock().expect("the lock is free");
    refused(&study(folder, "killed", &["--resume"]), "no-kl-seed1 is in use by another process");
    drop(lock);
    ok(study(folder, "killed", &["--resume"]));
    assert!(written(folder) == expected, "the kill changed the results");

    let metrics = folder.join("killed/full-seed1/metrics.jsonl");
    let before = fs::metadata(&metrics).and_then(|data| data.modified()).expect("there");
    ok(study(folder, "killed", &["--resume"]));
    assert!(written(folder) == expected);
    assert_eq!(fs::metadata(&metrics).and_then(|data| data.modified()).expect("there"), before, "it ran again");
    let other = study(folder, "killed", &["--resume", "--set", "ppo.lr=0.1"]);
    refused(&other, "other settings: `--set ppo.lr=0.1` asks for ppo.lr=0.1, and the run has 0.0005; ");
}

#[test]
fn runs_side_by_side_give_the_files_of_runs_in_turn() {
    let folder = prepared();
    let folder = folder.path();
    let in_turn = ok(study(folder, "in-turn", &["--threads", "4", "--side-by-side", "1"]));
    let expected = (written(folder), said(&in_turn));
    // Four runs on a thread each, then two on two each; the seeds share their skills.
    for runs in ["4", "2"] {
        let beside = ok(study(folder, runs, &["--threads", "4", "--side-by-side", runs]));
        assert_eq!((written(folder), said(&beside)), expected, "{runs} runs side by side");
        let models = fs::read_dir(folder.join(runs)).expect("there").flatten();
        let models = models.filter(|entry| entry.file_name().to_string_lossy().starts_with("skills-")).count();
        assert_eq!(models, 2, "one for each seed, learned once");
        let cost = fs::read_to_string(folder.join("out/cost.md")).expect("written");
        assert!(!cost.contains('–'), "each run knows its cost: {cost}");
    }
}

#[test]
fn what_is_there_is_not_replaced_before_everything_can_be_read() {
    let folder = prepared();
    let folder = folder.path();
    let small = |more: &[&str]| {
        let variants = r#"variants=[(name: "plain", set: ["algorithm=ppo"]), (name: "full")]"#;
        study(folder, "runs", &[&["--seeds", "1", "--set", "steps=128", "--set", variants], more].concat())
    };
    ok(small(&[]));
    let results = ["plain-seed1", "full-seed1"].map(|run| folder.join("runs").join(run).join("result.json"));
    refused(&small(&["--force", "--set", "demos=nowhere"]), "nowhere");
    refused(&small(&["--force", "--set", "test=easy:4..9"]), "level 4 is one of the held-out levels easy:4..9");
    assert!(results.iter().all(|result| result.exists()), "finished runs were lost");

    let one = |more: &[&str]| small(&[&["--resume", "--variant", "full"], more].concat());
    refused(&one(&[]), "holds results that this study lacks: plain with seed 1; choose another folder with --out");
    fs::remove_file(folder.join("out/results.json")).expect("there");
    let only = String::from_utf8(ok(one(&["--json"])).stdout).expect("Unicode");
    assert!(only.lines().count() == 1 && only.contains("\"variant\":\"full\""), "{only}");
    assert!(written(folder)[0].contains("--variant full --seeds 1"), "{}", written(folder)[0]);
    refused(&one(&["--variant", "ful"]), "did you mean `full`?");

    let foreign = folder.join("foreign/plain-seed1/notes.txt");
    fs::create_dir_all(foreign.parent().expect("a folder")).expect("writable");
    fs::write(&foreign, "mine").expect("writable");
    let variants = r#"variants=[(name: "plain", set: ["algorithm=ppo"])]"#;
    let over = study(folder, "foreign", &["--seeds", "1", "--set", "steps=128", "--set", variants, "--force"]);
    refused(&over, "plain-seed1 is not the folder of a run");
    assert!(foreign.exists(), "what is no run was replaced");

    let description = |run: &str| folder.join("runs").join(run).join("run.json");
    let info = |run| -> Value { serde_json::from_slice(&fs::read(description(run)).expect("there")).expect("JSON") };
    let made = info("full-seed1");
    assert!(made["skills"].as_str().is_some_and(|checksum| checksum.len() == 8) && made["device"] == "flex", "{made}");
    assert!(info("plain-seed1")["skills"].is_null(), "PPO has no skills");
    let mut foreign = made.clone();
    foreign["revision"] = "another".into();
    fs::write(description("full-seed1"), foreign.to_string()).expect("writable");
    let resumed = ok(small(&["--resume"]));
    let warnings = errors(&resumed);
    assert!(warnings.contains("full-seed1 was made by revision another"), "{warnings}");
    assert!(!warnings.contains("plain-seed1 was made"), "{warnings}");

    // Killed before there was a run.json.
    let run = folder.join("runs/full-seed1");
    for entry in fs::read_dir(&run).expect("there").flatten().filter(|entry| entry.file_name() != "experiment.ron") {
        let path = entry.path();
        if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) }.expect("removed");
    }
    ok(small(&["--force"]));
    assert_eq!(info("full-seed1"), made, "the same skills again");

    let kept = ["old", "old.checkpoint"].map(|name| folder.join(name));
    kept.iter().for_each(|file| fs::write(file, "old").expect("writable"));
    let learn = ["learn-skills", "--experiment", "tiny.ron", "--demos", "nowhere", "--out", "old", "--force"];
    refused(&playbot(folder, &learn), "nowhere");
    assert!(kept.iter().all(|file| file.exists()), "an unfinished training was lost");
    let learn = ["learn-skills", "--experiment", "tiny.ron", "--out", "old", "--force"];
    done(folder, &learn);
    assert!(kept[0].exists() && !kept[1].exists());
}

#[test]
fn what_does_not_fit_a_variant_matters_only_where_that_is_run() {
    let folder = prepared();
    let folder = folder.path();
    let ending = |more: &[&str]| {
        let set = ["--seeds", "1", "--set", "steps=128", "--set", "score.kl_coef_end=Some(0.0)"];
        study(folder, "runs", &[&set, more].concat())
    };
    refused(&ending(&[]), "variant `no-kl`");
    ok(ending(&["--variant", "cloned"]));
    // Runs of other variants may lie in the same folder.
    refused(&ending(&["--variant", "cloned"]), "cloned-seed1 is there already: go on with --resume");
    fs::remove_dir_all(folder.join("out")).expect("there");
    ok(ending(&["--variant", "plain"]));
}

#[test]
fn what_any_variant_lacks_is_said_before_the_first_one_begins() {
    let folder = prepared();
    let folder = folder.path();
    let refuse = |variant: &str, words: &str| {
        let text = TINY
            .replace("(name: \"cloned\"", &format!("(name: \"late\", set: [{variant}]),\n        (name: \"cloned\""));
        fs::write(folder.join("tiny.ron"), text).expect("writable");
        refused(&study(folder, "runs", &[]), words);
        let begun = fs::read_dir(folder.join("runs")).map_or(0, Iterator::count);
        assert_eq!(begun, 0, "nothing is begun where {variant} does not work");
    };
    refuse(r#""demos=elsewhere""#, "elsewhere");
    refuse(r#""algorithm=rlpd", "demos=elsewhere""#, "elsewhere");
    refuse(r#""ppo.augment=[Translate(2)]""#, "changes images");
    refuse(r#""skills.augment=[Cutout(0.5)]""#, "changes images");
    refuse(r#""algorithm=score-sac", "observation=Raster""#, "`observation` is Raster");
    refuse(r#""algorithm=spirl-sac", "skills.tanh_latent=false""#, "`skills.tanh_latent` is false");
}

#[test]
fn held_out_levels_of_a_known_layout_are_left_out_and_measured_apart_if_wanted() {
    let folder = prepared();
    let folder = folder.path();
    // Levels 81 and 142 differ in their pictures only.
    let twins = |more: &[&str]| {
        let set = ["--seeds", "1", "--set", "steps=128", "--set", "train=hard:81..82", "--set", "test=hard:142..145"];
        study(folder, "runs", &[&set, &["--variant", "plain", "--variant", "cloned"][..], more].concat())
    };
    let results = || -> Value {
        serde_json::from_slice(&fs::read(folder.join("out/results.json")).expect("written")).expect("JSON")
    };
    let table = || fs::read_to_string(folder.join("out/table.md")).expect("written");
    let without = ok(twins(&[]));
    assert!(errors(&without).contains("left out of hard:142..145: 1 level of a layout that"), "{}", errors(&without));
    let words =
        "Measured on 3 levels of hard:142..145, which have 3 different layouts, each level once. 1 level is left out, ";
    assert!(table().contains(words) && !table().contains("All 4 levels"), "{}", table());
    let expected = (written(folder), results());
    for row in expected.1["results"].as_array().expect("rows") {
        // Behaviour cloning has not seen it, and is measured on the levels of the others.
        assert_eq!((&row["left_out"], row["with_seen"].is_null()), (&Value::from(vec![142]), true), "{row}");
        assert_eq!((row["test"]["layouts"].as_u64(), row["test"]["episodes"].as_u64()), (Some(3), Some(3)), "{row}");
    }

    let checkpoint = folder.join("runs/plain-seed1/checkpoints/step-000000000128/learner.safetensors");
    let written_at = || fs::metadata(&checkpoint).and_then(|data| data.modified()).expect("there");
    let before = written_at();
    let with = ok(twins(&["--resume", "--include-seen"]));
    assert!(errors(&with).contains("measured apart of hard:142..145: 1 level"), "{}", errors(&with));
    let words = "All 4 levels of hard:142..145, with the 1 that some run knows.";
    assert!(table().contains(words) && table().contains(" --include-seen --out out\n"), "{}", table());
    assert!(said(&with).contains(words), "{}", said(&with));
    for (row, known) in results()["results"].as_array().expect("rows").iter().zip(&[0, 1]) {
        assert_eq!(row["test"], expected.1["results"][*known]["test"], "the others are measured as they were");
        assert_eq!((&row["with_seen"]["layouts"], &row["with_seen"]["seen"]), (&4.into(), &1.into()), "{row}");
        assert_eq!(row["with_seen"]["level_returns"].as_array().map(Vec::len), Some(4), "{row}");
    }
    assert_eq!(written_at(), before, "it was trained again");
    ok(twins(&["--resume"]));
    assert!(written(folder) == expected.0, "the table of all levels left something behind");

    // Level 501 has the layout of the recorded level 4 of the other mode, and there is no other.
    let recorded = |more: &[&str]| {
        let set = ["--seeds", "1", "--set", "test=hard:501..501", "--variant", "cloned", "--force"];
        study(folder, "others", &[&set, more].concat())
    };
    refused(&recorded(&[]), "each of the held-out levels hard:501..501 has a layout that this study trains on or");
    assert!(!folder.join("others/cloned-seed1/result.json").exists());
    ok(recorded(&["--include-seen"]));
    let words = "Measured on hard:501..501, 1 level of 1 different layout, each level once. Some run of the study knows each of \
                 them: none is new.";
    assert!(table().contains(words), "{}", table());
}

#[test]
fn the_table_follows_from_the_results() {
    let folder = prepared();
    let folder = folder.path();
    ok(study(folder, "runs", &["--variant", "full", "--variant", "cloned"]));
    let (table, experiment) = (folder.join("out/table.md"), folder.join("out/experiment.ron"));
    let written = [&table, &experiment].map(|file| fs::read(file).expect("written"));
    // Studies of older versions have no file of the experiment.
    for file in [&table, &experiment] {
        fs::remove_file(file).expect("there");
    }
    let rewrite = || playbot(folder, &["study", "--out", "out", "--rewrite"]);
    ok(rewrite());
    assert!([&table, &experiment].map(|file| fs::read(file).expect("written again")) == written);
    // The file repeats the study: its runs are those that are there.
    let again = ["study", "--experiment", "out/experiment.ron", "--out", "again", "--runs", "runs", "--resume"];
    ok(playbot(folder, &again));
    let results = |out: &str| -> Value {
        serde_json::from_slice(&fs::read(folder.join(out).join("results.json")).expect("written")).expect("JSON")
    };
    assert_eq!(results("again")["results"], results("out")["results"]);
    assert_eq!(results("again")["experiment"], results("out")["experiment"]);
    // Somebody else's file of that name is not replaced, neither by a study nor by a table.
    fs::rename(&experiment, folder.join("kept")).expect("there");
    fs::copy(folder.join("tiny.ron"), &experiment).expect("writable");
    refused(&rewrite(), "experiment.ron is not from a study");
    refused(&study(folder, "runs", &["--variant", "full", "--variant", "cloned", "--resume"]), "rename it, or choose");
    assert_eq!(fs::read_to_string(&experiment).expect("kept"), TINY);
    fs::rename(folder.join("kept"), &experiment).expect("writable");
    // Behaviour cloning trains nothing: an error names the file of its policy.
    let cloned = playbot(folder, &["eval", "--run", "runs/cloned-seed1"]);
    let words = errors(&cloned);
    let skills = words.split("--skills ").nth(1).and_then(|rest| rest.split('`').next()).expect("a file");
    refused(&cloned, "runs/cloned-seed1 is a run of bc, which trains nothing and has no checkpoint");
    ok(playbot(folder, &["eval", "--experiment", "tiny.ron", "--skills", skills]));
    // Its skills are not measured by another study on levels that they were learned on.
    let other = TINY.replace("hard:64..65", "easy:4..5").replace("cloned", "seen");
    fs::write(folder.join("other.ron"), other).expect("writable");
    let other = ["study", "--experiment", "other.ron", "--out", "seen", "--runs", "runs", "--variant", "seen"];
    refused(
        &playbot(folder, &other),
        "was learned from demonstrations of easy:0..7, and the held-out levels easy:4..5",
    );
    assert!(!folder.join("runs/seen-seed1/result.json").exists());
    // A setting of the variant itself stays as it is, and a `--set` of it is reported.
    let set = study(
        folder,
        "others",
        &["--variant", "cloned", "--set", "algorithm=ppo", "--set", "rlpd.critics=3", "--force"],
    );
    assert!(errors(&set).contains("--set algorithm=ppo does not change cloned"), "{}", errors(&set));
    assert!(
        errors(&set).contains("--set rlpd.critics=3 changes nothing: bc does not read `rlpd.critics`"),
        "{}",
        errors(&set)
    );
    fs::write(folder.join("out/results.json"), "{").expect("writable");
    refused(&rewrite(), "results.json");
    fs::remove_file(folder.join("out/results.json")).expect("there");
    refused(&rewrite(), "results.json");
    assert!(fs::read(&table).expect("kept").starts_with(b"# coinrun: cloned"));
}
