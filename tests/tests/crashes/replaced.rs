//! Tests of trainings that replace another one.

use std::path::Path;

use playbot_learner::disk::DiskRecording;
use playbot_tests::{
    power_cut::{PaperDisk, power_cuts},
    training::{run_info, train, written},
};
use playbot_train::{checkpoint::CheckpointChoice, run_dir::RunDir};

use super::{
    runs::{experiment, fresh},
    tree::tree,
};

/// Replaces an existing run by one with this seed.
fn replace(run: &Path, seed: u64) {
    let experiment = experiment(seed);
    drop(RunDir::create(run, &experiment, &run_info(&experiment), true).expect("replaceable"));
}

#[test]
fn a_run_that_is_replaced_is_the_old_one_or_the_new_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    train(&run, fresh(1), None);
    let (old, before, old_files) = (written(&run), PaperDisk::of(folder.path()), tree(folder.path()));
    let recording = DiskRecording::of(folder.path());
    replace(&run, 2);
    let new_files = tree(folder.path());
    let operations = recording.operations();
    assert!(operations.len() > 15, "{operations:?}");
    let (mut kept, mut replaced) = (0, 0);
    for cut in power_cuts(&operations) {
        let left = tempfile::tempdir().expect("a folder");
        before.clone().after(&operations, &cut).write(folder.path(), left.path());
        let run = left.path().join("run");
        let opened = RunDir::open_to_write(&run).unwrap_or_else(|error| panic!("{cut:?}: {error}"));
        match opened.experiment.seed {
            1 => {
                assert!(written(&run) == old, "{cut:?}: the old run has changed");
                assert_eq!(tree(left.path()), old_files, "{cut:?}: something is left over");
                kept += 1;
            }
            _ => {
                assert!(opened.run.checkpoint(CheckpointChoice::Last).is_err(), "{cut:?}: a checkpoint of the old run");
                assert_eq!(tree(left.path()), new_files, "{cut:?}: something is left over");
                replaced += 1;
            }
        }
    }
    assert!(kept > 10 && replaced > 10, "{kept}, {replaced}");
}
