//! Tests of exported policies.

use std::{fs, path::Path};

use bevy_playbot::vision::ObservationConfig;
use playbot_learner::{DeviceKind, PolicyFile, disk::DiskRecording};
use playbot_tests::{
    Corridor,
    power_cut::{PaperDisk, power_cuts},
    small,
};
use playbot_train::{
    Algorithm,
    policy_export::{Provenance, export_policy, policy_file},
};

use super::tree::tree;

/// Exports a policy of some age.
fn export(path: &Path, updates: u64) -> Vec<u8> {
    let mut trainer = small::trainer(Algorithm::ScorePpo);
    while trainer.updates() < updates {
        trainer.update().expect("learns");
    }
    let (policy, skills) = (trainer.policy(), trainer.skill_source());
    let file = policy_file(&Corridor, &ObservationConfig::default(), policy, skills, Provenance::default());
    export_policy(&Corridor, &file, &trainer.experiment().train, 1, path).expect("writable");
    fs::read(path).expect("written")
}

#[test]
fn a_policy_in_the_place_of_another_is_one_of_the_two_wherever_the_power_failed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("bot.policy");
    let old = export(&path, 0);
    let before = PaperDisk::of(folder.path());
    let recording = DiskRecording::of(folder.path());
    let new = export(&path, 1);
    assert!(old != new, "it has learned something");
    let (operations, files) = (recording.operations(), tree(folder.path()));
    let (mut kept, mut replaced) = (0, 0);
    for cut in power_cuts(&operations) {
        let left = tempfile::tempdir().expect("a folder");
        before.clone().after(&operations, &cut).write(folder.path(), left.path());
        let path = left.path().join("bot.policy");
        let found = fs::read(&path).expect("one of the two");
        assert!(found == old || found == new, "{cut:?}: neither of the two");
        PolicyFile::load(&path, DeviceKind::Flex).unwrap_or_else(|error| panic!("{cut:?}: {error}"));
        *(if found == old { &mut kept } else { &mut replaced }) += 1;
        assert!(export(&path, 1) == new, "{cut:?}: another policy");
        assert_eq!(tree(left.path()), files, "{cut:?}: something is left over");
    }
    assert!(kept > 5 && replaced > 0, "{kept}, {replaced}");
}
