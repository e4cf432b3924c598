//! Tests of recordings that are trained on: they earn the game's present rewards, and must be of the present game.

use std::{fs, path::Path};

use bevy_playbot::demo::file::{DemoEpisode, DemoReader, DemoWriter};

use crate::program::{done, ended};

const TINY: &str = r#"(
    game: "coinrun", train: "hard:0..3", test: "hard:64..65", demos: "played", steps: 512, arenas: 8, worlds: 2,
    seeds: [1],
    variants: [(name: "recorded", set: ["algorithm=rlpd"])],
    sac: (num_steps: 16, learning_starts: 128, updates_per_step: 0.05, batch: 16, hidden: [16, 16]),
    rlpd: (critics: 3),
    eval: (episodes_per_level: 1),
    checkpoints: (every: 2),
)"#;

/// Returns a folder with the tiny experiment and a recording of a few levels, `played/a.demo`.
fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    fs::write(folder.path().join("tiny.ron"), TINY).expect("writable");
    fs::create_dir(folder.path().join("played")).expect("writable");
    done(folder.path(), &["record", "coinrun", "--levels", "easy:0..3", "--out", "played/a.demo"]);
    folder
}

/// Writes the recording into another folder, each episode changed.
fn alter(folder: &Path, name: &str, change: impl Fn(usize, &mut DemoEpisode)) {
    let reader = DemoReader::open(folder.join("played/a.demo")).expect("readable");
    fs::create_dir(folder.join(name)).expect("writable");
    let mut writer = DemoWriter::create(folder.join(name).join("a.demo"), reader.header().clone()).expect("fresh");
    for (index, mut episode) in reader.read_all().expect("whole").into_iter().enumerate() {
        change(index, &mut episode);
        writer.push(&episode).expect("writable");
    }
}

/// Returns the arguments that train on the recordings in a folder, into a run of the same name.
fn training<'a>(demos: &'a str, run: &'a str) -> [&'a str; 9] {
    ["train", "--experiment", "tiny.ron", "--algorithm", "rlpd", "--set", demos, "--run", run]
}

#[test]
fn what_recordings_earn_is_what_the_game_pays_now() {
    let folder = prepared();
    let folder = folder.path();
    alter(folder, "unpaid", |_, episode| episode.rewards.fill(0.0));
    alter(folder, "overpaid", |_, episode| episode.rewards.iter_mut().for_each(|reward| *reward = 3.0 * *reward - 1.0));
    let metrics = ["played", "unpaid", "overpaid"].map(|name| {
        done(folder, &training(&format!("demos={name}"), &format!("runs/{name}")));
        fs::read_to_string(folder.join("runs").join(name).join("metrics.jsonl")).expect("written")
    });
    assert!(metrics[0].contains("losses/qf_loss"), "nothing was learned: {}", metrics[0]);
    assert!(metrics[0] == metrics[1], "recordings without rewards earn something else");
    assert!(metrics[0] == metrics[2], "recordings of another reward earn something else");
}

#[test]
fn recordings_that_earn_nothing_are_named_before_a_run_begins() {
    let folder = prepared();
    let folder = folder.path();
    done(
        folder,
        &["record", "coinrun", "--bot", "random", "--levels", "easy:0..0", "--steps", "20", "--out", "poor/a.demo"],
    );
    let (_, words) = ended(folder, &training("demos=poor", "runs/poor"), 3);
    assert!(words.contains("poor: nothing in these recordings is ever rewarded, and rlpd learns from"), "{words}");
    assert!(!folder.join("runs/poor").exists(), "no run is begun");
}

#[test]
fn recordings_of_another_game_are_named_and_nothing_is_lost() {
    let folder = prepared();
    let folder = folder.path();
    alter(folder, "bent", |index, episode| episode.state_hashes[3] ^= u32::from(index == 2));
    let refused = |args: &[&str]| {
        let words = ended(folder, args, 3).1;
        for part in ["bent/a.demo: episode 2 does not replay", "tick 3", "state hash", "record it again"] {
            assert!(words.contains(part), "{words}");
        }
    };
    refused(&training("demos=bent", "runs/bent"));
    assert!(!folder.join("runs/bent").exists(), "no run is begun");

    let study = ["study", "--experiment", "tiny.ron", "--out", "out", "--runs", "studied"];
    refused(&[&study[..], &["--set", "demos=bent"]].concat());
    assert!(!folder.join("studied/recorded-seed1/checkpoints").exists(), "no run is begun");
    done(folder, &study);
    refused(&[&study[..], &["--set", "demos=bent", "--force"]].concat());
    assert!(folder.join("studied/recorded-seed1/result.json").exists(), "a finished run was lost");
}

#[test]
fn recordings_of_another_task_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::write(folder.join("tiny.ron"), TINY).expect("writable");
    fs::create_dir(folder.join("played")).expect("writable");
    done(folder, &["record", "maze2d", "--levels", "umaze+retarget:0..1", "--steps", "400", "--out", "played/a.demo"]);
    let maze = ["game=maze2d", "train=umaze:0..3", "test=medium:0..1"];
    let sets = maze.iter().flat_map(|set| ["--set", set]);
    let train: Vec<_> = training("demos=played", "runs/maze").into_iter().chain(sets).collect();
    let (_, words) = ended(folder, &train, 0);
    assert!(
        words.contains(
            "some recordings are of umaze+retarget, and the training is of umaze: their rewards are those of "
        ),
        "{words}"
    );
}
