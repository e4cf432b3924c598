//! Tests of trainings.

use std::path::{Path, PathBuf};

use playbot_learner::{
    DeviceKind,
    disk::{DiskOperation, DiskRecording},
};
use playbot_tests::{
    Corridor,
    power_cut::{PaperDisk, PowerCut, after_each, distinct_power_cuts},
    training::{run_info, train, written},
};
use playbot_train::{
    Algorithm, Experiment, Trainer,
    checkpoint::CheckpointChoice,
    experiment::file::parse_experiment,
    run_dir::{RunDir, RunError},
};

use super::tree::tree;

/// Updates between checkpoints.
const EVERY: u64 = 2;

const EXPERIMENT: &str = r#"(
    game: "corridor", train: "plain:0..7", test: "plain:8..15", steps: 320, arenas: 2, worlds: 1, algorithm: "ppo",
    ppo: (num_steps: 8, minibatches: 2, epochs: 1, hidden: [4], lr: 0.003),
    checkpoints: (keep: 2),
)"#;

pub fn experiment(seed: u64) -> Experiment {
    let experiment = parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid");
    Experiment { seed, algorithm: Algorithm::Ppo, ..experiment }
}

pub fn fresh(seed: u64) -> Trainer {
    Trainer::new(&Corridor, &experiment(seed), None, DeviceKind::Flex, 1).expect("fits")
}

/// Trains to the end, with a checkpoint after every second update.
pub fn train_on(folder: &Path, mut trainer: Trainer) {
    while !trainer.is_done() {
        let stop_after = (trainer.updates() / EVERY + 1) * EVERY;
        trainer = train(folder, trainer, Some(stop_after));
    }
}

/// Returns the name of the last checkpoint that was in its place by then, if one was.
fn last_checkpoint(operations: &[DiskOperation]) -> Option<PathBuf> {
    operations.iter().rev().find_map(|operation| match operation {
        DiskOperation::Rename { from, to } if from.ends_with("unfinished") && to.starts_with(from.parent()?) => {
            let name = to.file_name()?.to_string_lossy().into_owned();
            name.starts_with("step-").then(|| name.into())
        }
        _ => None,
    })
}

/// Resumes the training after a power cut, to the end.
fn go_on(folder: &Path, operations: &[DiskOperation], cut: &PowerCut) {
    let begun = last_checkpoint(&operations[..cut.operations]);
    let opened = match RunDir::open_to_write(folder) {
        Ok(opened) => opened,
        Err(RunError::NoRun { .. }) => {
            assert_eq!(begun, None, "{cut:?}: the run is gone");
            let run = RunDir::create(folder, &experiment(1), &run_info(&experiment(1)), false);
            drop(run.unwrap_or_else(|error| panic!("{cut:?}: {error}")));
            return train_on(folder, fresh(1));
        }
        Err(error) => panic!("{cut:?}: {error}"),
    };
    let trainer = match opened.run.resume(&Corridor, &opened.experiment, DeviceKind::Flex, 1) {
        Ok(trainer) => trainer,
        Err(RunError::NoCheckpoint { .. }) => {
            assert_eq!(begun, None, "{cut:?}: the checkpoint is gone");
            drop(opened);
            drop(RunDir::create(folder, &experiment(1), &run_info(&experiment(1)), true).expect("replaceable"));
            return train_on(folder, fresh(1));
        }
        Err(error) => panic!("{cut:?}: {error}"),
    };
    let last = opened.run.checkpoint(CheckpointChoice::Last).expect("resumed from it");
    let name = last.path.file_name().map(PathBuf::from);
    assert!(name >= begun, "{cut:?}: {name:?} is older than {begun:?}");
    drop(opened);
    train_on(folder, trainer);
}

#[test]
fn a_training_goes_on_to_the_same_bytes_wherever_the_power_failed() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let recording = DiskRecording::of(folder.path());
    train_on(&run, fresh(1));
    let operations = recording.operations();
    let (undisturbed, files) = (written(&run), tree(folder.path()));
    let cuts = distinct_power_cuts(&PaperDisk::default(), &operations);
    assert!(cuts.len() > 300, "{} states", cuts.len());
    after_each(&cuts, |cut| {
        let left = tempfile::tempdir().expect("a folder");
        PaperDisk::default().after(&operations, cut).write(folder.path(), left.path());
        let run = left.path().join("run");
        go_on(&run, &operations, cut);
        assert!(written(&run) == undisturbed, "{cut:?} after {:?}", operations[..cut.operations].last());
        assert_eq!(tree(left.path()), files, "{cut:?}: something is left over");
    });
}
