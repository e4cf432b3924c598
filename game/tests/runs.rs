//! Tests of `playbot train` and `playbot runs` through the command line: the files of a run, and their display.

#[path = "shared/program.rs"]
mod program;

use std::{fs, path::Path};

use program::{command, ended, json_lines, unsealed};

/// Trains PPO for four updates of 128 steps, three runs: two seeds, and another learning rate.
fn three_runs(folder: &Path) {
    let config = |lr: &str| {
        format!(
            r#"(game: "coinrun", train: "easy:0..3", test: "easy:4..5", demos: "none", steps: 512, arenas: 8, worlds: 2,
            study: (threshold: 0.25), ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8], lr: {lr}))"#
        )
    };
    fs::write(folder.join("a.ron"), config("0.001")).expect("writable");
    fs::write(folder.join("b.ron"), config("0.002")).expect("writable");
    for (experiment, seed, run) in [("a.ron", "2", "runs/a/2"), ("a.ron", "1", "runs/a/1"), ("b.ron", "1", "runs/b")] {
        ended(folder, &["train", "--algorithm", "ppo", "--experiment", experiment, "--seed", seed, "--run", run], 0);
    }
}

#[test]
fn runs_are_listed_shown_and_compared() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_runs(folder);

    let (listed, _) = ended(folder, &["runs", "ls"], 0);
    assert_eq!(listed.lines().filter(|line| line.starts_with("runs/") && line.contains("512")).count(), 3, "{listed}");
    let (alone, _) = ended(folder, &["runs"], 0);
    assert_eq!(alone.lines().count(), listed.lines().count(), "without a verb of its own it lists: {alone}");
    let rows = json_lines(&ended(folder, &["runs", "ls", "--json"], 0).0);
    let paths: Vec<_> = rows.iter().filter_map(|row| row["path"].as_str()).collect();
    assert_eq!(paths, ["runs/a/1", "runs/a/2", "runs/b"]);
    assert!(rows.iter().all(|row| row["finished"] == true && row["steps"] == 512 && row["steps_per_s"].is_f64()));

    let (shown, _) = ended(folder, &["runs", "show", "runs/b", "--metric", "losses/entropy", "--plot", "b.svg"], 0);
    assert!(shown.contains("ppo.lr=0.002") && shown.contains("losses/value_loss"), "{shown}");
    assert!(fs::read_to_string(folder.join("b.svg")).expect("written").contains("losses/entropy"));
    let all = &json_lines(&ended(folder, &["runs", "show", "runs/b", "--json"], 0).0)[0];
    assert_eq!(all["metrics"]["losses/entropy"]["last"]["step"], 512);
    assert_eq!(all["experiment"]["ppo"]["num_steps"], 16);

    let compare = ["runs", "compare", "runs", "--metric", "losses/entropy", "--threshold", "0", "--plot", "c.svg"];
    let (compared, _) = ended(folder, &compare, 0);
    assert!(compared.contains("ppo ppo.lr=0.001") && compared.contains("1 2"), "{compared}");
    assert!(compared.contains("128 (128 to 128)"), "{compared}");
    let svg = fs::read_to_string(folder.join("c.svg")).expect("written");
    assert_eq!((svg.matches("class=\"band").count(), svg.matches("class=\"line").count()), (1, 4), "two are keys");
    let groups = json_lines(&ended(folder, &[&compare[..3], &["--metric", "losses/entropy", "--json"]].concat(), 0).0);
    assert_eq!(groups[0]["group"]["seeds"], serde_json::json!([1, 2]));
    assert!(groups[0]["threshold"].is_null(), "the threshold of an experiment is a success rate");
    let last = |run: &str| -> f64 {
        let text = fs::read_to_string(folder.join(run).join("metrics.jsonl")).expect("written");
        json_lines(&text).last().and_then(|line| line["losses/entropy"].as_f64()).expect("a number")
    };
    let mean = (last("runs/a/1") + last("runs/a/2")) / 2.0;
    assert_eq!(groups[0]["group"]["last_mean"].as_f64(), Some(mean));
    assert_eq!(groups[1]["group"]["last_sd"].as_f64(), Some(0.0), "one seed");
}

#[test]
fn a_new_run_begins_with_the_weights_of_another_and_notes_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_runs(folder);
    let begin = ["train", "--experiment", "b.ron", "--from", "runs/a/1", "--run", "runs/c"];
    let train = |more: &[&str], wanted| ended(folder, &[&begin[..], more].concat(), wanted).1;
    for (more, words) in [
        (&["--algorithm", "sac"][..], "it was trained by ppo, and the new one is by sac: add --algorithm ppo"),
        (
            &["--algorithm", "ppo", "--set", "ppo.hidden=[4]"],
            "no layer of its policy fits: its hidden layers are [8, 8], and those of the new run [4]",
        ),
        (
            &["--algorithm", "ppo", "--set", "train=easy:4..5", "--set", "test=easy:0..1"],
            "it has learned from easy:0..3, and the new run holds out easy:0..1 (`test`)",
        ),
    ] {
        let refused = train(more, 3);
        assert!(
            refused.contains("no run can begin with the weights of runs/a/1: ") && refused.contains(words),
            "{refused}"
        );
        assert!(!folder.join("runs/c").exists(), "{more:?}");
    }
    let reported = train(&["--algorithm", "ppo"], 0);
    assert!(reported.contains("beginning with the weights of runs/a/1: taken: actor.l0, actor.l1"), "{reported}");
    assert!(reported.contains("the first policy gives the same outputs as the old one, to the bit"), "{reported}");
    let row = &json_lines(&ended(folder, &["runs", "ls", "runs/c", "--json"], 0).0)[0];
    let begun = &row["begun_from"];
    assert_eq!((&begun["run"], &begun["step"], &begun["algorithm"]), (&"runs/a/1".into(), &512.into(), &"ppo".into()));
    assert_eq!(begun["checksum"].as_str().map(str::len), Some(8));
    let (shown, _) = ended(folder, &["runs", "show", "runs/c"], 0);
    assert!(shown.contains("begun with the weights of runs/a/1 at step 512"), "{shown}");
    let (_, refused) = ended(folder, &["train", "--run", "runs/c", "--resume", "--set", "ppo.lr=0.5"], 3);
    assert!(refused.contains("--from runs/c to begin with the weights of this one"), "{refused}");
}

#[test]
fn a_prolonged_run_goes_on_from_its_last_learning_rate() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let settings = r#"(game: "coinrun", train: "easy:0..3", test: "easy:4..5", demos: "none", steps: 256, arenas: 8,
        worlds: 2, ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8], lr: 0.001, anneal_lr: true))"#;
    fs::write(folder.join("a.ron"), settings).expect("writable");
    ended(folder, &["train", "--algorithm", "ppo", "--experiment", "a.ron", "--run", "runs/a"], 0);
    let (_, reported) = ended(folder, &["train", "--run", "runs/a", "--resume", "--steps", "512"], 0);
    let words =
        "the length is new: until step 512 the learning rate falls from 5.00e-4 to 0, beginning with the last value";
    assert!(reported.contains(words), "{reported}");
    let text = fs::read_to_string(folder.join("runs/a/metrics.jsonl")).expect("written");
    let rates = json_lines(&text).iter().filter_map(|line| line["charts/learning_rate"].as_f64()).collect::<Vec<_>>();
    // Of updates 1 and 2 of two, then of two that begin with the second rate.
    let expected = [0.001, 0.0005, 0.0005, 0.000_25];
    assert!(
        rates.len() == 4 && rates.iter().zip(expected).all(|(rate, wanted)| (rate - wanted).abs() < 1e-9),
        "{rates:?}"
    );
}

#[test]
fn a_run_goes_on_where_there_is_no_such_device_any_more() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let settings = r#"(game: "coinrun", train: "easy:0..3", test: "easy:4..5", demos: "none", steps: 256, arenas: 8,
        worlds: 2, ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8]))"#;
    fs::write(folder.join("a.ron"), settings).expect("writable");
    let begin = ["train", "--algorithm", "ppo", "--experiment", "a.ron", "--run", "runs/a", "--device", "ndarray"];
    ended(folder, &begin, 0);
    let (_, reported) =
        ended(folder, &["train", "--run", "runs/a", "--resume", "--steps", "512", "--device", "flex"], 0);
    assert!(reported.contains("begun on ndarray and goes on on flex"), "{reported}");
    let rows = json_lines(&ended(folder, &["runs", "ls", "--json"], 0).0);
    assert!(rows.iter().any(|row| row["path"] == "runs/a" && row["steps"] == 512), "{rows:?}");
}

#[test]
fn runs_without_an_episode_are_left_out_and_early_ones_say_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_runs(folder);
    let (nothing, why) = ended(folder, &["runs", "compare", "runs"], 0);
    assert!(nothing.is_empty() && why.contains("nothing to compare yet"), "{why}");
    assert!(why.contains("runs/b is left out: it has no charts/success_rate, since no episode has ended"), "{why}");
    let (_, blank) = ended(folder, &["runs", "show", "runs/b", "--plot", "none.svg"], 3);
    assert!(blank.contains("no episode has ended yet") && !folder.join("none.svg").exists(), "{blank}");

    let metrics = |run: &str, episodes: &str, rate: &str| {
        let lines = [128, 256, 384, 512]
            .map(|step| format!("{{\"step\":{step},\"charts/episodes\":{episodes},\"charts/success_rate\":{rate}}}\n"));
        fs::write(folder.join(run).join("metrics.jsonl"), lines.concat()).expect("writable");
    };
    metrics("runs/a/1", "40", "0.9");
    metrics("runs/a/2", "200", "0");
    let (table, warnings) = ended(folder, &["runs", "compare", "runs", "--plot", "c.svg"], 0);
    assert!(warnings.contains("runs/b is left out") && !warnings.contains("runs/a"), "{warnings}");
    assert!(table.contains("never in 1 of 2, too few episodes in 1 of 2"), "{table}");
    metrics("runs/a/1", "200", "0");
    ended(folder, &["runs", "compare", "runs", "--plot", "c.svg"], 0);
    let svg = fs::read_to_string(folder.join("c.svg")).expect("written");
    assert!(svg.contains(">1.0<") && !svg.contains("−") && !svg.contains(">-"), "a rate lies in 0..1: {svg}");
}

#[test]
fn a_run_stands_where_it_goes_on_and_is_in_training_while_somebody_has_its_lock() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_runs(folder);
    // The state after a kill behind another update of a longer training.
    let (experiment, metrics) = (folder.join("runs/b/experiment.ron"), folder.join("runs/b/metrics.jsonl"));
    let text = unsealed(&fs::read_to_string(&experiment).expect("written"));
    assert!(text.contains(" steps: 512,"), "{text}");
    fs::write(&experiment, text.replace(" steps: 512,", " steps: 1024,")).expect("writable");
    let text = fs::read_to_string(&metrics).expect("written");
    fs::write(&metrics, text + "{\"step\":640}\n").expect("writable");

    let (table, _) = ended(folder, &["runs", "ls", "runs/b"], 0);
    assert!(table.contains(" 512 ") && table.contains("can be resumed"), "{table}");
    let row = &json_lines(&ended(folder, &["runs", "ls", "runs/b", "--json"], 0).0)[0];
    assert!(row["steps"] == 512 && row["steps_logged"] == 640 && row["training"] == false, "{row}");
    let (shown, _) = ended(folder, &["runs", "show", "runs/b"], 0);
    assert!(shown.contains("512 of 1,024 steps (those after it, up to 640, are not saved), not finished"), "{shown}");

    let lock = fs::File::open(folder.join("runs/b/run.lock")).expect("there");
    lock.lock().expect("the lock is free");
    let (table, _) = ended(folder, &["runs", "ls", "runs/b"], 0);
    assert!(table.contains(" 640 ") && table.contains("training") && !table.contains("resumed"), "{table}");
    let (shown, _) = ended(folder, &["runs", "show", "runs/b"], 0);
    assert!(shown.contains("640 of 1,024 steps, training"), "{shown}");
}

#[test]
fn the_threshold_is_that_of_the_experiments() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_runs(folder);
    let edit = |file: &str, from: &str, to: &str| {
        let text = unsealed(&fs::read_to_string(folder.join(file)).expect("written"));
        assert!(text.contains(from), "{text}");
        fs::write(folder.join(file), text.replace(from, to)).expect("writable");
    };
    // So short a training ends no episode: another curve stands in for the success rate.
    for run in ["runs/a/1", "runs/a/2", "runs/b"] {
        edit(&format!("{run}/metrics.jsonl"), "losses/entropy", "charts/success_rate");
    }
    let compare = |more: &[&str]| ended(folder, &[&["runs", "compare", "runs", "--json"], more].concat(), 0);
    assert_eq!(json_lines(&compare(&[]).0)[0]["threshold"], 0.25);
    assert_eq!(json_lines(&compare(&["--threshold", "0.5"]).0)[0]["threshold"], 0.5);
    edit("runs/b/experiment.ron", "threshold: 0.25", "threshold: 0.75");
    let (groups, warnings) = compare(&[]);
    assert!(
        json_lines(&groups)[0]["threshold"].is_null() && warnings.contains("differ in study.threshold"),
        "{warnings}"
    );
}

#[test]
fn damaged_runs_are_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let (_, missing) = ended(folder, &["runs", "ls"], 3);
    assert!(missing.contains("no folder runs"), "{missing}");
    fs::create_dir_all(folder.join("runs/empty")).expect("created");
    let (_, nothing) = ended(folder, &["runs", "ls"], 3);
    assert!(nothing.contains("no runs in runs"), "{nothing}");
    let (_, foreign) = ended(folder, &["runs", "show", "runs/empty"], 3);
    assert!(foreign.contains("no run at runs/empty: the folder exists"), "{foreign}");

    three_runs(folder);
    for verb in [&["runs", "show"][..], &["runs", "compare", "runs/b"], &["train", "--resume", "--run"]] {
        let (_, none) = ended(folder, &[verb, &["runs/bb"]].concat(), 3);
        let words = "no run at runs/bb: there is no such folder (did you mean runs/b?); `playbot runs ls` lists";
        assert!(none.contains(words), "{verb:?}: {none}");
    }
    let metrics = folder.join("runs/b/metrics.jsonl");
    let whole = fs::read(&metrics).expect("written");
    fs::write(&metrics, &whole[..whole.len() - 9]).expect("writable");
    let (shown, torn) = ended(folder, &["runs", "show", "runs/b", "--json"], 0);
    assert!(torn.contains("metrics.jsonl: line 4 is damaged"), "{torn}");
    assert_eq!(json_lines(&shown)[0]["metrics"]["losses/entropy"]["last"]["step"], 384);
    let (_, unknown) = ended(folder, &["runs", "compare", "runs", "--metric", "losses/entrpy"], 3);
    assert!(unknown.contains("did you mean `losses/entropy`?"), "{unknown}");

    fs::write(folder.join("runs/b/run.json"), "{").expect("writable");
    let (listed, _) = ended(folder, &["runs", "ls"], 1);
    assert!(listed.contains("runs/a/1") && listed.contains("damaged: runs/b/run.json"), "{listed}");
    assert!(listed.contains("bring it back from a copy"), "{listed}");
    assert!(json_lines(&ended(folder, &["runs", "ls", "--json"], 1).0)[2]["error"].is_string());
    let (others, left_out) = ended(folder, &["runs", "compare", "runs", "--metric", "losses/entropy"], 0);
    assert!(others.contains("1 2") && left_out.contains("runs/b is left out: runs/b/run.json"), "{others}{left_out}");
    for alone in ["runs/b", "runs/b/."] {
        let (_, damaged) = ended(folder, &["runs", "compare", alone], 3);
        assert!(damaged.contains("run.json") && damaged.contains("bring it back"), "{damaged}");
    }
    let forget = |run: &str| {
        for file in ["metrics.jsonl", "timing.jsonl"] {
            fs::remove_file(folder.join(run).join(file)).expect("removed");
        }
    };
    forget("runs/a/1");
    let (_, partly) = ended(folder, &["runs", "compare", "runs/a", "--metric", "losses/entropy"], 0);
    assert!(partly.contains("runs/a/1 is left out"), "{partly}");
    forget("runs/a/2");
    let (_, early) = ended(folder, &["runs", "compare", "runs/a"], 3);
    assert!(early.contains("runs/a/1 has no metrics yet"), "{early}");
}

/// Returns the framed records: 12 bytes, the content, 4 bytes.
fn records(bytes: &[u8]) -> Vec<&[u8]> {
    let (mut records, mut rest) = (Vec::new(), bytes);
    while let Some((length, tail)) = rest.split_first_chunk() {
        let length = u64::from_le_bytes(*length) as usize;
        records.push(&tail[4..4 + length]);
        rest = &tail[8 + length..];
    }
    records
}

#[test]
fn a_resumed_run_shows_each_update_once_in_tensorboard() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_runs(folder);
    let events = |run: &str| -> Vec<Vec<u8>> {
        let files: Vec<_> = fs::read_dir(folder.join(run).join("tensorboard")).expect("listed").collect();
        assert_eq!(files.len(), 1, "{files:?}");
        let bytes = fs::read(files[0].as_ref().expect("listed").path()).expect("readable");
        records(&bytes).into_iter().map(<[u8]>::to_vec).collect()
    };
    let before = events("runs/b");
    assert_eq!(before.len(), 2 + 4, "version, start, four updates");
    // The whole command again: nothing is left to do.
    let begun = ["train", "--algorithm", "ppo", "--experiment", "b.ron", "--seed", "1", "--run", "runs/b", "--resume"];
    let (_, finished) = ended(folder, &begun, 0);
    for words in ["runs/b is finished: it was trained for 512 steps", "--resume --steps N`, where N is more than 512"] {
        assert!(finished.contains(words), "{finished}");
    }
    let (_, other) = ended(folder, &[&begun[..], &["--set", "ppo.lr=0.5"]].concat(), 3);
    assert!(other.contains("`--set ppo.lr=0.5` asks for ppo.lr=0.5, and the run has 0.002"), "{other}");
    ended(folder, &["train", "--run", "runs/b", "--resume", "--steps", "640"], 0);
    let after = events("runs/b");
    assert_eq!(after.len(), 2 + 5);
    assert!(after[2..6] == before[2..], "the same updates at the same times");
}

#[test]
fn what_a_run_has_lost_and_what_is_left_of_another_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    three_runs(folder);
    let path = |name: &str| folder.join("runs").join(name);
    // Cut off between two lines, gone, not finished, and moved aside by a process that was killed.
    let metrics = fs::read_to_string(path("b/metrics.jsonl")).expect("written");
    let first_two: String = metrics.split_inclusive('\n').take(2).collect();
    fs::write(path("b/metrics.jsonl"), first_two).expect("writable");
    fs::remove_file(path("b/timing.jsonl")).expect("removed");
    fs::write(path("b/run.json.tmp7"), "{").expect("writable");
    fs::create_dir(path("b.replaced-7")).expect("writable");
    fs::copy(path("b/run.json"), path("b.replaced-7/run.json")).expect("copied");

    let (listed, _) = ended(folder, &["runs", "ls"], 0);
    let words = "left over: runs/b.replaced-7 holds old files of runs/b, whose replacement was stopped: \
                 `playbot train --run runs/b --resume` brings";
    assert!(listed.contains(words), "{listed}");
    let rows = json_lines(&ended(folder, &["runs", "ls", "--json"], 0).0);
    assert_eq!((rows.len(), &rows[3]["left_of"]), (4, &serde_json::json!("runs/b")));

    let (_, reported) = ended(folder, &["train", "--run", "runs/b", "--resume"], 0);
    for words in [
        "runs/b/metrics.jsonl: metrics are missing for 2 updates, those of the steps 384 to 512",
        "runs/b/timing.jsonl: metrics are missing for 4 updates, those of the steps 128 to 512",
        "runs/b/run.json.tmp7 is unfinished",
        "runs/b.replaced-7 holds the replaced files of runs/b, and is removed",
    ] {
        assert!(reported.contains(words), "{words}: {reported}");
    }
    assert!(!path("b/run.json.tmp7").exists() && !path("b.replaced-7").exists());
    let (listed, _) = ended(folder, &["runs", "ls"], 0);
    assert!(!listed.contains("left over"), "{listed}");
}

/// Returns a file's FNV-1a hash.
fn hash(path: &Path) -> u64 {
    let bytes = fs::read(path).expect("written");
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

#[test]
fn a_short_quickstart_has_the_same_bytes_on_every_machine() {
    let folder = tempfile::tempdir().expect("a folder");
    let record = ["record", "coinrun", "--levels", "easy:0..9", "--noise", "0.2", "--out", "few.demo"];
    ended(folder.path(), &record, 0);
    let demos = format!("demos={}", folder.path().join("few.demo").display());
    let short = ["--epochs", "1", "--steps", "8192", "--seeds", "1", "--set", "test=hard:64..67", "--set", &demos];
    for (threads, instructions) in [("1", "widest"), ("2", "avx2"), ("2", "portable")] {
        let run = format!("{threads}-{instructions}");
        let mut program =
            command(folder.path(), &[&["quickstart", "--threads", threads, "--run", &run], &short[..]].concat());
        program.env("PLAYBOT_INSTRUCTIONS", instructions);
        playbot_shell::ended(program, 0);
        let files = [
            "skills.safetensors",
            "score-ppo/checkpoints/step-000000008192/learner.safetensors",
            "score-ppo/metrics.jsonl",
            "ppo/checkpoints/step-000000008192/learner.safetensors",
            "ppo/metrics.jsonl",
        ];
        let found = files.map(|file| hash(&folder.path().join(&run).join(file)));
        let wanted = [
            0x0519_6a0f_9220_91f0,
            0x538e_08a6_aaaa_9d8a,
            0xe0fd_4f75_da2f_93d5,
            0x86ff_e6a7_8dcb_6881,
            0x65b0_a1b7_e603_b82e,
        ];
        assert_eq!(found, wanted, "{found:#x?} on {threads} threads, {instructions}");
    }
}

#[test]
fn a_demonstrator_is_asked_and_its_policy_is_measured_and_trained_further() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let settings = r#"(game: "coinrun", train: "easy:0..4", test: "easy:5..6", demos: None, steps: 256, arenas: 4, worlds: 2,
        algorithm: "ppo", ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8]), imitation: (steps: 64, rounds: 2))"#;
    fs::write(folder.join("a.ron"), settings).expect("writable");
    let begin = ["imitate", "--experiment", "a.ron", "--run", "runs/asked"];
    let (_, refused) = ended(folder, &begin, 3);
    assert!(
        refused.contains("nothing to imitate: name recordings with --demos, or ask the game's demonstrator"),
        "{refused}"
    );
    let (_, reported) = ended(folder, &[&begin[..], &["--dagger"]].concat(), 0);
    let words = [
        "imitating on easy:0..3, and measuring rounds on easy:4..4",
        "round 2: 128 steps, loss ",
        "the policy of round ",
    ];
    assert!(words.iter().all(|words| reported.contains(words)), "{reported}");
    let (measured, _) = ended(folder, &["eval", "--run", "runs/asked", "--json"], 0);
    assert_eq!(json_lines(&measured)[0]["method"], "imitation");
    let (_, finished) = ended(folder, &["imitate", "--run", "runs/asked", "--resume"], 0);
    assert!(finished.contains("runs/asked is finished"), "{finished}");
    let (_, refused) = ended(folder, &["imitate", "--run", "runs/asked", "--resume", "--set", "imitation.lr=0.1"], 3);
    assert!(refused.contains("is resumed with its own settings: leave out"), "{refused}");
    let (_, refused) = ended(folder, &["train", "--run", "runs/asked", "--resume"], 3);
    assert!(refused.contains("is a run of imitation: go on with `"), "{refused}");

    let further = ["train", "--experiment", "a.ron", "--from", "runs/asked", "--run", "runs/further"];
    let (_, reported) = ended(folder, &further, 0);
    assert!(reported.contains("critic.l0 (the other run has not trained it)"), "{reported}");
    let (shown, _) = ended(folder, &["runs", "show", "runs/further"], 0);
    assert!(shown.contains("begun with the weights of runs/asked at step 128 (imitation, checksum "), "{shown}");
    let (_, refused) = ended(folder, &["imitate", "--run", "runs/further", "--resume"], 3);
    assert!(refused.contains("runs/further is a run of ppo, not of imitation"), "{refused}");
}
