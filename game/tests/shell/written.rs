//! Tests that output files are tested before the work.

use std::fs;

#[cfg(unix)]
use crate::program::on_full_disk;
use crate::program::{code, errors, playbot};

#[test]
fn a_file_that_cannot_be_written_is_refused_before_anything_is_read() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::write(folder.join("file"), "").expect("writable");
    fs::create_dir(folder.join("folder")).expect("writable");
    for verb in [&["learn-skills", "--demos", "missing"][..], &["policy", "export", "--run", "missing"]] {
        for (out, exit, words) in [("file/out", 2, "cannot create file"), ("folder", 3, "folder is a folder")] {
            let output = playbot(folder, &[verb, &["--out", out, "--force"]].concat());
            assert_eq!(code(&output), exit, "{verb:?}: {}", errors(&output));
            assert!(errors(&output).contains(words), "{verb:?}: {}", errors(&output));
        }
    }
}

#[test]
fn the_folder_of_a_skill_model_is_made() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let recorded = playbot(folder, &["record", "coinrun", "--levels", "easy:0..3", "--out", "few.demo"]);
    assert_eq!(code(&recorded), 0, "{}", errors(&recorded));
    let sets = ["hidden=[16]", "encoder_hidden=8", "gru_hidden=8", "window=5", "epochs=1"];
    let sets = sets.iter().flat_map(|set| ["--set".to_owned(), format!("skills.{set}")]).collect::<Vec<_>>();
    let mut args = vec!["learn-skills", "--demos", "few.demo", "--out", "new/folder/skills", "--max-steps", "10"];
    args.extend(sets.iter().map(String::as_str));
    let output = playbot(folder, &args);
    assert_eq!(code(&output), 0, "{}", errors(&output));
    assert!(
        errors(&output).contains("steps in 1 episode from few.demo (more than was asked for"),
        "{}",
        errors(&output)
    );
    let names: Vec<_> =
        fs::read_dir(folder.join("new/folder")).expect("made").flatten().map(|e| e.file_name()).collect();
    assert_eq!(names, ["skills"], "nothing else is left there");
}

#[test]
fn a_quickstart_without_recordings_leaves_no_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let output = playbot(folder.path(), &["quickstart", "--set", "demos=none", "--run", "runs/quick"]);
    assert_eq!(code(&output), 3, "{}", errors(&output));
    assert!(errors(&output).contains("`playbot record coinrun --levels hard:0..63"), "{}", errors(&output));
    assert!(!folder.path().join("runs").exists(), "nothing was begun");
}

/// The first checkpoint is the first large file of a run.
#[cfg(unix)]
#[test]
fn a_training_that_was_never_saved_is_started_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let text = r#"(game: "coinrun", train: "hard:0..7", test: "hard:64..71", demos: "none", steps: 256, arenas: 8, worlds: 2,
        ppo: (num_steps: 32, minibatches: 4, hidden: [32, 32]))"#;
    fs::write(folder.path().join("small.ron"), text).expect("writable");
    let train = "train --algorithm ppo --experiment small.ron --run full";
    let output = on_full_disk(folder.path(), 64, train);
    assert_eq!(code(&output), 2, "{}", errors(&output));
    let words = errors(&output);
    assert!(words.contains("cannot write") && words.contains("start again (`train` with --force"), "{words}");
    let again: Vec<&str> = train.split(' ').chain(["--force"]).collect();
    let output = playbot(folder.path(), &again);
    assert_eq!(code(&output), 0, "as it was reported to: {}", errors(&output));
}
