//! Tests of the files of a run with one flipped bit: reported, skipped or left out, and never taken for the original.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use playbot_games::coinrun::CoinRun;
use playbot_learner::DeviceKind;
use playbot_train::{
    Algorithm, Experiment, Trainer,
    experiment::file::parse_experiment,
    run_dir::{RunDir, RunInfo},
};

use crate::dice::Dice;

const UPDATES: u64 = 4;

fn experiment() -> Experiment {
    let text = r#"(
        game: "coinrun", train: "hard:0..1", test: "hard:64..65", algorithm: "ppo", steps: 32, arenas: 2, worlds: 1,
        ppo: (num_steps: 4, minibatches: 1, epochs: 1, hidden: [4]), checkpoints: (every: 1, keep: 3),
    )"#;
    parse_experiment(text, Path::new("x.ron")).expect("sound")
}

/// Trains a run to its end, in a folder of its own.
fn trained(path: &Path) {
    let (game, experiment) = (CoinRun::default(), experiment());
    let mut trainer = Trainer::new(&game, &experiment, None, DeviceKind::Flex, 1).expect("it fits");
    let info = RunInfo {
        algorithm: Algorithm::Ppo,
        seed: 1,
        version: "0".to_owned(),
        revision: "r".to_owned(),
        game_version: 1,
        skills: None,
        seen: None,
        begun_from: None,
        observed: Vec::new(),
        device: DeviceKind::Flex,
    };
    let run = RunDir::create(path, &experiment, &info, false).expect("writable");
    for _ in 0..UPDATES {
        let report = trainer.update().expect("finite");
        run.log(&report, experiment.steps_per_update()).expect("writable");
        run.save(&mut trainer).expect("writable");
    }
}

/// Returns all files in a folder, by their path in it, without the event files, which are written and not read.
fn files(folder: &Path) -> Vec<PathBuf> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).expect("listed").map(|entry| entry.expect("an entry").path()) {
            if entry.is_dir() { folders.push(entry) } else { files.push(entry) }
        }
    }
    files
        .retain(|file| !file.components().any(|part| part.as_os_str() == "tensorboard") && !file.ends_with("run.lock"));
    files.sort();
    files.into_iter().map(|file| file.strip_prefix(folder).expect("in it").to_owned()).collect()
}

fn copy(from: &Path, to: &Path) {
    for file in files(from) {
        let path = to.join(&file);
        fs::create_dir_all(path.parent().expect("in the run")).expect("writable");
        fs::copy(from.join(&file), path).expect("copied");
    }
}

/// Returns the lines of the metrics.
fn lines(run: &Path, file: &str) -> BTreeSet<String> {
    fs::read_to_string(run.join(file)).expect("text").lines().map(str::to_owned).collect()
}

/// Returns the steps of the checkpoint from which a run is resumed.
fn resumed(run: &Path) -> Result<u64, String> {
    let opened = RunDir::open_to_write(run).map_err(|error| error.to_string())?;
    let trainer = opened.run.resume(&CoinRun::default(), &opened.experiment, DeviceKind::Flex, 1);
    trainer.map(|trainer| trainer.steps()).map_err(|error| error.to_string())
}

#[test]
fn one_flipped_bit_is_never_taken_for_what_was_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let (whole, damaged) = (folder.path().join("whole"), folder.path().join("damaged"));
    trained(&whole);
    let last = UPDATES * experiment().steps_per_update();
    copy(&whole, &damaged);
    assert_eq!(resumed(&damaged), Ok(last));
    let mut dice = Dice(3);
    for file in files(&whole) {
        let bytes = fs::read(whole.join(&file)).expect("written");
        for _ in 0..30 {
            fs::remove_dir_all(&damaged).expect("removed");
            copy(&whole, &damaged);
            let at = dice.roll(bytes.len() * 8);
            let mut changed = bytes.clone();
            changed[at / 8] ^= 1 << (at % 8);
            fs::write(damaged.join(&file), changed).expect("written");
            let (name, went_on) = (file.display().to_string(), resumed(&damaged));
            let where_ = format!("{name}, bit {at}: {went_on:?}");
            match name.as_str() {
                "run.json" | "experiment.ron" => {
                    let error = went_on.expect_err(&where_);
                    assert!(error.contains(&name) && error.contains("--force"), "{error}");
                }
                "metrics.jsonl" | "timing.jsonl" => {
                    assert_eq!(went_on, Ok(last), "{where_}");
                    let (before, after) = (lines(&whole, &name), lines(&damaged, &name));
                    // A damaged line feed damages two lines.
                    assert!(after.is_subset(&before) && after.len() + 2 >= before.len(), "{where_}");
                    assert!(after.len() < before.len() || at / 8 == bytes.len() - 1, "{where_}");
                }
                _ if name.contains(&format!("step-{last:012}")) => {
                    assert!(went_on.is_ok_and(|step| step < last), "{where_}");
                }
                // An earlier checkpoint is not used while the last one is whole.
                _ => assert_eq!(went_on, Ok(last), "{where_}"),
            }
        }
    }
}
