//! Tests of trainings with a replay buffer: SAC's is in its checkpoints.

use std::path::Path;

use playbot_learner::{DeviceKind, disk::DiskRecording};
use playbot_tests::{
    Corridor,
    power_cut::{PaperDisk, PowerCut, distinct_power_cuts},
    small,
    training::{run_info, written},
};
use playbot_train::{
    Algorithm, Experiment, Trainer,
    run_dir::{OpenedRun, RunDir, RunError},
};

use super::{runs::train_on, tree::tree};

/// Returns a training in which most updates learn from earlier episodes.
fn experiment() -> Experiment {
    Experiment { steps: 64, ..small::experiment(Algorithm::Sac) }
}

fn fresh() -> Trainer {
    Trainer::new(&Corridor, &experiment(), None, DeviceKind::Flex, 1).expect("fits")
}

/// Begins in a folder that holds no checkpoint.
fn begin(folder: &Path, force: bool, cut: &PowerCut) {
    let run = RunDir::create(folder, &experiment(), &run_info(&experiment()), force);
    drop(run.unwrap_or_else(|error| panic!("{cut:?}: {error}")));
    train_on(folder, fresh());
}

/// Resumes the training after a power cut, to the end. Returns whether there was a checkpoint.
fn go_on(folder: &Path, cut: &PowerCut) -> bool {
    match RunDir::open_to_write(folder) {
        Ok(OpenedRun { run, experiment, .. }) => match run.resume(&Corridor, &experiment, DeviceKind::Flex, 1) {
            Ok(trainer) => {
                drop(run);
                train_on(folder, trainer);
                return true;
            }
            Err(RunError::NoCheckpoint { .. }) => {
                drop(run);
                begin(folder, true, cut);
            }
            Err(error) => panic!("{cut:?}: {error}"),
        },
        Err(RunError::NoRun { .. }) => begin(folder, false, cut),
        Err(error) => panic!("{cut:?}: {error}"),
    }
    false
}

#[test]
fn a_training_with_a_replay_buffer_goes_on_to_the_same_bytes_wherever_the_power_failed() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("run");
    let recording = DiskRecording::of(folder.path());
    train_on(&run, fresh());
    let (operations, undisturbed, files) = (recording.operations(), written(&run), tree(folder.path()));
    let (mut begun, mut gone_on) = (0, 0);
    for cut in distinct_power_cuts(&PaperDisk::default(), &operations) {
        let left = tempfile::tempdir().expect("a folder");
        PaperDisk::default().after(&operations, &cut).write(folder.path(), left.path());
        let run = left.path().join("run");
        *(if go_on(&run, &cut) { &mut gone_on } else { &mut begun }) += 1;
        assert!(written(&run) == undisturbed, "{cut:?} after {:?}", operations[..cut.operations].last());
        assert_eq!(tree(left.path()), files, "{cut:?}: something is left over");
    }
    assert!(begun > 20 && gone_on > 20, "{begun}, {gone_on}");
}
