//! Tests of the path from recordings to reports.

use std::process::Output;

#[cfg(target_os = "linux")]
use crate::program::command;
use crate::program::{code, errors, lines, playbot, said, unsealed};

#[cfg(target_os = "linux")]
const TINY: &str = r#"(
    game: "coinrun", train: "hard:0..3", test: "hard:64..65", demos: "demos", steps: 512, arenas: 8, worlds: 2,
    skills: (window: 5, epochs: 1, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
    ppo: (num_steps: 16, minibatches: 2, hidden: [16, 16]),
    eval: (episodes_per_level: 1),
)"#;

/// Returns a folder with the tiny experiment, and one in it for its recordings.
fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("tiny.ron"), TINY).expect("writable");
    std::fs::create_dir(folder.path().join("demos")).expect("writable");
    folder
}

#[test]
fn work_goes_on_without_a_reader() {
    let folder = tempfile::tempdir().expect("a folder");
    let deaf = |args: &[&str]| {
        let full = std::fs::File::create("/dev/full").expect("a disk that is always full");
        command(folder.path(), args).stderr(full).output().expect("the program starts")
    };
    let recorded = deaf(&["record", "coinrun", "--levels", "easy:0..3", "--out", "a.demo"]);
    assert_eq!(code(&recorded), 0);
    let learned = deaf(&["learn-skills", "--demos", "a.demo", "--epochs", "1", "--out", "skills"]);
    assert_eq!(code(&learned), 0);
    assert!(folder.path().join("skills").exists());
    assert_eq!(
        code(&deaf(&["level", "maze2d", "--map", "nope"])),
        3,
        "a mistake is one even if standard error is closed"
    );
}

#[test]
fn recording_verifying_and_repairing_from_the_shell() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = |args: &[&str]| playbot(folder.path(), args);
    let output = run(&["record", "coinrun", "--levels", "easy:0..3", "--noise", "0.2", "--out", "a.demo"]);
    assert_eq!(code(&output), 0, "{}", errors(&output));
    let again = run(&["record", "coinrun", "--levels", "easy:0..3", "--out", "a.demo"]);
    assert_eq!(code(&again), 3, "an existing recording is not overwritten");
    let verified = run(&["demo", "verify", "a.demo", "--json"]);
    assert_eq!(code(&verified), 0, "{}", errors(&verified));
    assert_eq!(lines(&verified)[0]["report"]["episodes"], 4);
    assert_eq!(lines(&run(&["demo", "ls", "a.demo", "--json"]))[0]["episodes"], 4);
    assert_eq!(lines(&run(&["demo", "ls", "a.demo", "a.demo", "--json"])).len(), 2, "a line for each that is named");
    assert_eq!(lines(&run(&["demo", "show", "a.demo", "--json"])).len(), 4);

    let bytes = std::fs::read(folder.path().join("a.demo")).expect("readable");
    std::fs::write(folder.path().join("torn.demo"), &bytes[..bytes.len() - 5]).expect("writable");
    let torn = run(&["demo", "verify", "torn.demo"]);
    assert_eq!(code(&torn), 1, "damage is a finding: {}", errors(&torn));
    assert!(said(&torn).contains("playbot demo repair"), "{}", said(&torn));
    let mended = run(&["demo", "repair", "torn.demo", "--out", "mended.demo", "--json"]);
    assert_eq!(lines(&mended)[0]["kept_episodes"], 3);
    let taken = run(&["demo", "repair", "torn.demo", "--out", "a.demo"]);
    assert!(code(&taken) == 3 && errors(&taken).contains("name another --out"), "{}", errors(&taken));
    assert_eq!(code(&run(&["demo", "verify", "mended.demo"])), 0);

    let mut flipped = bytes;
    let middle = flipped.len() / 2;
    flipped[middle] ^= 16;
    std::fs::write(folder.path().join("flipped.demo"), flipped).expect("writable");
    let flipped = run(&["demo", "verify", "flipped.demo"]);
    assert_eq!(code(&flipped), 1);
    assert!(said(&flipped).contains("byte"), "{}", said(&flipped));
}

#[test]
fn a_small_run_from_demonstrations_to_evaluation() {
    let folder = prepared();
    let run = |args: &[&str]| playbot(folder.path(), args);
    let ok = |output: Output| {
        assert_eq!(code(&output), 0, "{}", errors(&output));
        output
    };
    ok(run(&["record", "coinrun", "--levels", "easy:0..7", "--out", "demos/a.demo"]));
    ok(run(&["learn-skills", "--experiment", "tiny.ron", "--out", "skills.safetensors"]));
    let train = ["train", "--experiment", "tiny.ron", "--skills", "skills.safetensors", "--run", "runs/a"];
    ok(run(&train));
    let again = run(&train);
    assert_eq!(code(&again), 3);
    assert!(errors(&again).contains("--force"), "{}", errors(&again));
    ok(run(&["train", "--run", "runs/a", "--resume", "--steps", "1024"]));
    let rows =
        lines(&ok(run(&["eval", "--run", "runs/a", "--skills", "skills.safetensors", "--bot", "random", "--json"])));
    let methods: Vec<_> = rows.iter().filter_map(|row| row["method"].as_str()).collect();
    assert_eq!(methods, ["score-ppo", "bc", "random"]);
    assert!(rows.iter().all(|row| row["split"] == "hard:64..65" && row["episodes"] == 2));

    let mut swapped = vec!["train", "--experiment", "tiny.ron", "--algorithm", "ppo", "--run", "runs/b"];
    swapped.extend(["--set", "train=hard:64..65", "--set", "test=hard:0..3", "--steps", "128"]);
    ok(run(&swapped));
    let eval = |more: &[&str]| run(&[&["eval", "--run", "runs/a", "--run", "runs/b", "--json"], more].concat());
    let seen = eval(&[]);
    assert_eq!(code(&seen), 3);
    for words in ["runs/b has learned from hard:64..65", "held-out levels hard:64..65", "--levels"] {
        assert!(errors(&seen).contains(words), "{}", errors(&seen));
    }
    let on_purpose = ok(eval(&["--levels", "hard:64..65"]));
    assert_eq!(lines(&on_purpose).len(), 2);
    let reported = "runs/b has learned from hard:64..65, and the levels hard:64..65 have some of these: not all of them are unseen";
    assert!(errors(&on_purpose).contains(reported), "{}", errors(&on_purpose));

    // Levels 81 and 142 differ in their pictures only.
    let mut twins = vec!["train", "--experiment", "tiny.ron", "--algorithm", "ppo", "--run", "runs/c"];
    twins.extend(["--set", "train=hard:81..81", "--set", "test=hard:142..145", "--steps", "128"]);
    ok(run(&twins));
    let measured = |more: &[&str]| ok(run(&[&["eval", "--run", "runs/c", "--bot", "random", "--json"], more].concat()));
    let known = "runs/c knows 1 of the 4 levels hard:142..145: by number or layout they are among hard:81..81";
    for (more, left_out, words) in [
        (&[][..], true, "1 level of hard:142..145 is left out"),
        (&["--include-seen"][..], false, "1 level of hard:142..145 is measured with the others, though no unseen one"),
        (&["--levels", "hard:142..145"][..], false, "--new-layouts leaves it out"),
        (&["--levels", "hard:142..145", "--new-layouts"][..], true, "1 level of hard:142..145 is left out"),
    ] {
        let output = measured(more);
        assert!(errors(&output).contains(known) && errors(&output).contains(words), "{}", errors(&output));
        let (one, levels) = (|is: bool| is.then_some(1), if left_out { 3 } else { 4 });
        for row in lines(&output) {
            assert_eq!((row["left_out"].as_u64(), row["seen"].as_u64()), (one(left_out), one(!left_out)), "{row}");
            assert_eq!((&row["levels"], &row["layouts"]), (&levels.into(), &levels.into()), "{row}");
        }
    }
    let exported = ok(run(&["policy", "export", "--run", "runs/c", "--out", "c.policy"]));
    let command = "eval --policy c.policy --levels hard:142..145 --new-layouts`";
    assert!(errors(&exported).contains(command), "{}", errors(&exported));
    let table = ok(run(&["eval", "--run", "runs/c", "--include-seen"]));
    assert!(said(&table).contains("hard:142..145 with 1 seen"), "{}", said(&table));
    let both = run(&["eval", "--run", "runs/c", "--include-seen", "--new-layouts"]);
    assert_eq!(code(&both), 3, "{}", errors(&both));
    let all_known = run(&["eval", "--run", "runs/c", "--levels", "hard:142..142", "--new-layouts"]);
    assert_eq!(code(&all_known), 3);
    assert!(errors(&all_known).contains("every one of the levels hard:142..142"), "{}", errors(&all_known));
    let tested = run(&["test", "coinrun", "--run", "runs/c", "--levels", "hard:142..145", "--out", "runs/tested"]);
    assert!(errors(&tested).contains(known), "{}", errors(&tested));
    let written = |name: &str| std::fs::read_to_string(folder.path().join("runs/tested").join(name)).expect("written");
    for name in ["summary.md", "report.html"] {
        assert!(written(name).contains("c has learned from 1 level of this test, or from equal ones."), "{name}");
    }
    assert!(written("results.json").contains("\"known\":1"), "{}", written("results.json"));

    let saved = folder.path().join("runs/b/experiment.ron");
    let text = unsealed(&std::fs::read_to_string(&saved).expect("written")).replace("\"coinrun\"", "\"maze\"");
    std::fs::write(&saved, text).expect("writable");
    let foreign = eval(&["--levels", "hard:64..65"]);
    assert_eq!(code(&foreign), 3);
    assert!(
        errors(&foreign).contains("runs/b: a run of the game `maze`, not of `coinrun`: name a run"),
        "{}",
        errors(&foreign)
    );

    let quick = ok(run(&["quickstart", "--experiment", "tiny.ron", "--run", "runs/quick", "--json"]));
    let methods: Vec<_> = lines(&quick).iter().filter_map(|row| row["method"].as_str().map(str::to_owned)).collect();
    assert_eq!(methods, ["score-ppo", "ppo", "bc", "right-jump", "random"]);
    let report = std::fs::read_to_string(folder.path().join("runs/quick/report.html")).expect("written");
    assert!(report.contains("score-ppo") && report.contains("<svg"));
    let headline = "steps to 80 % success in training: score-ppo ";
    assert!(report.contains(headline) && errors(&quick).contains(headline), "{}", errors(&quick));

    std::fs::write(folder.path().join("not.safetensors"), b"nothing of the kind").expect("writable");
    let foreign = run(&["eval", "--skills", "not.safetensors"]);
    assert_eq!(code(&foreign), 3, "{}", errors(&foreign));
}

#[test]
fn skills_remember_the_levels_that_they_were_learned_on() {
    let folder = prepared();
    let run = |args: &[&str]| playbot(folder.path(), args);
    let with = |verb: &str, more: &[&str]| {
        let output = run(&[&[verb, "--experiment", "tiny.ron"], more].concat());
        (code(&output), errors(&output))
    };
    let (skills, shown) = (["--skills", "skills.safetensors"], "skills.safetensors");
    assert_eq!(code(&run(&["record", "coinrun", "--levels", "hard:8..11", "--out", "demos/a.demo"])), 0);
    // The levels that are kept apart for the held-out NLL were shown too.
    assert_eq!(with("learn-skills", &["--out", shown, "--set", "skills.held_out=0.5"]).0, 0);

    let other = ["--set", "test=hard:10..20", "--run", "runs/a"];
    let (refused, words) = with("train", &[&skills[..], &other].concat());
    assert_eq!(refused, 3, "{words}");
    for part in [shown, "demonstrations of hard:8..11", "held-out levels hard:10..20 of `test` have some"] {
        assert!(words.contains(part), "{words}");
    }
    assert!(!folder.path().join("runs/a").exists(), "no run is begun");
    let (refused, words) = with("eval", &[&skills[..], &["--set", "test=hard:11..12"]].concat());
    assert!(refused == 3 && words.contains("and the held-out levels hard:11..12 have some of these"), "{words}");
    let (measured, words) = with("eval", &[&skills[..], &["--levels", "hard:11..12"]].concat());
    assert!(measured == 0 && words.contains("not all of them are unseen"), "{words}");

    let export = ["policy", "export", "--experiment", "tiny.ron", "--skills", shown, "--out", "bc.policy"];
    assert_eq!(code(&run(&export)), 0);
    let shown = run(&["policy", "show", "bc.policy"]);
    assert!(said(&shown).contains("demonstrations of hard:8..11"), "{}", said(&shown));
    let seen_one = ["--set", "test=hard:11..12", "--force"];
    let exported = errors(&run(&[&export[..], &seen_one].concat()));
    assert!(
        exported
            .contains("--levels MODE:FIRST..LAST`, on levels that it has not learned from, as it has from hard:8..11"),
        "{exported}"
    );

    // The metadata of a run has the levels of its skills, though it was trained on other levels.
    let train = [&skills[..], &["--run", "runs/b"]].concat();
    assert_eq!(with("train", &train).0, 0);
    let (refused, words) = with("eval", &["--run", "runs/b", "--set", "test=hard:11..12"]);
    assert!(refused == 3 && words.contains("runs/b has learned from hard:8..11, among others,"), "{words}");
    assert_eq!(with("eval", &["--run", "runs/b"]).0, 0);

    // The metadata of a policy file has both.
    let exported = run(&["policy", "export", "--run", "runs/b", "--out", "b.policy"]);
    assert!(errors(&exported).contains("eval --policy b.policy --levels hard:64..65`"), "{}", errors(&exported));
    let shown = run(&["policy", "show", "b.policy"]);
    assert!(said(&shown).contains("has seen      hard:0..3 and hard:8..11"), "{}", said(&shown));
    for (test, own) in [("hard:11..12", "hard:8..11"), ("hard:3..4", "hard:0..3")] {
        let test = format!("test={test}");
        let sets = ["--set", "train=hard:30..33", "--set", &test];
        let (refused, words) = with("eval", &[&["--policy", "b.policy"][..], &sets].concat());
        assert!(refused == 3 && words.contains(&format!("b.policy has learned from {own}, among others,")), "{words}");
    }
    assert_eq!(with("eval", &["--policy", "b.policy"]).0, 0);
    let (refused, words) = with("eval", &["--policy", "bc.policy", "--set", "test=hard:11..12"]);
    assert!(refused == 3 && words.contains("bc.policy has learned from hard:8..11,"), "{words}");

    // Recordings of it have seen them too, which is not noted: `record` warns of it.
    let recorded = run(&["record", "coinrun", "--run", "runs/b", "--levels", "hard:200..201", "--out", "pupil.demo"]);
    let reported = "the player has learned from hard:0..3 and hard:8..11: hold none of these out";
    assert!(code(&recorded) == 0 && errors(&recorded).contains(reported), "{}", errors(&recorded));

    // A run whose last checkpoint is not of its end is distinguished from one that is.
    let reported = "runs/b is not trained to its end: it has ";
    assert!(!errors(&run(&["eval", "--run", "runs/b"])).contains(reported));
    let mut checkpoints: Vec<_> = std::fs::read_dir(folder.path().join("runs/b/checkpoints"))
        .expect("checkpoints")
        .map(|entry| entry.expect("readable").path())
        .collect();
    checkpoints.sort();
    assert!(checkpoints.len() > 1, "{checkpoints:?}");
    std::fs::remove_dir_all(checkpoints.last().expect("one")).expect("removable");
    let (measured, words) = with("eval", &["--run", "runs/b"]);
    assert!(measured == 0 && words.contains(reported), "{words}");

    // Settings of algorithms that are not trained are reported.
    let (trained, words) = with("train", &[&train[..], &["--force", "--set", "rlpd.critics=3"]].concat());
    assert!(
        trained == 0 && words.contains("--set rlpd.critics=3 changes nothing: score-ppo does not read `rlpd.critics`"),
        "{words}"
    );

    // Differences from the settings of the skills are refused; the same settings may be given again.
    let (refused, words) = with("train", &[&skills[..], &["--set", "skills.latent=4", "--run", "runs/c"]].concat());
    let reported = "`--set skills.latent=4` asks for skills.latent=4, and the skill model has 2; drop the option";
    assert!(refused == 3 && words.contains(reported), "{words}");
    assert_eq!(with("train", &[&skills[..], &["--set", "skills.latent=2", "--run", "runs/c"]].concat()).0, 0);

    // Skills of another game are reported before any other mistake.
    let (refused, words) = with(
        "train",
        &[
            &skills[..],
            &["--set", "game=maze2d", "--set", "train=medium:0..3", "--set", "test=large:0..3", "--run", "runs/d"],
        ]
        .concat(),
    );
    assert!(refused == 3 && words.contains("skills.safetensors: the skill model was learned for 563"), "{words}");
}
