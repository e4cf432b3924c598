//! Tests of skill models while they are learned.

use std::{
    fs,
    ops::ControlFlow,
    path::{Path, PathBuf},
};

use playbot_learner::{
    DeviceKind, SkillModel, SkillTrainer,
    disk::{self, DiskRecording},
};
use playbot_tests::{
    power_cut::{PaperDisk, power_cuts},
    small,
};

use super::tree::tree;

/// Passes over the recordings.
const EPOCHS: u64 = 5;

/// Returns the path of an unfinished training.
fn checkpoint_of(model: &Path) -> PathBuf {
    model.with_extension("checkpoint")
}

/// Learns a model, or resumes it, as `playbot learn-skills` does: with a checkpoint after each epoch, which is removed
/// once the model is there.
pub fn learn(model: &Path) {
    let checkpoint = checkpoint_of(model);
    let mut trainer = match (checkpoint.exists(), model.exists()) {
        (true, _) => SkillTrainer::load(&checkpoint, small::dataset(), DeviceKind::Flex).expect("a whole checkpoint"),
        (false, true) => return drop(SkillModel::load(model, DeviceKind::Flex).expect("a whole model")),
        (false, false) => small::fresh_skills(),
    };
    while trainer.epochs_done() < EPOCHS {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
        trainer.save(&checkpoint).expect("writable");
    }
    trainer.into_model().save(model).expect("writable");
    disk::remove_file(&checkpoint).expect("it was just written");
}

#[test]
fn skills_are_the_same_wherever_the_power_failed_while_they_were_learned() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = DiskRecording::of(folder.path());
    learn(&folder.path().join("skills"));
    let (operations, files) = (recording.operations(), tree(folder.path()));
    let undisturbed = fs::read(folder.path().join("skills")).expect("written");
    let (mut fresh, mut gone_on, mut done) = (0, 0, 0);
    for cut in power_cuts(&operations) {
        let left = tempfile::tempdir().expect("a folder");
        PaperDisk::default().after(&operations, &cut).write(folder.path(), left.path());
        let model = left.path().join("skills");
        let count = match (checkpoint_of(&model).exists(), model.exists()) {
            (true, _) => &mut gone_on,
            (false, true) => &mut done,
            (false, false) => &mut fresh,
        };
        *count += 1;
        learn(&model);
        assert!(fs::read(&model).expect("written") == undisturbed, "{cut:?}: other skills");
        assert_eq!(tree(left.path()), files, "{cut:?}: something is left over");
    }
    assert!(fresh > 3 && gone_on > 40 && done > 0, "{fresh}, {gone_on}, {done}");
}
