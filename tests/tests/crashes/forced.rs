//! Tests of recordings that replace others.

use std::path::Path;

use bevy_playbot::demo::file::{DemoEpisode, DemoReader, DemoWriter, repair};
use playbot::prelude::*;
use playbot_learner::disk::{DiskOperation, DiskRecording};
use playbot_tests::{
    Corridor,
    power_cut::{PaperDisk, power_cuts},
    recording::record_random,
};

fn episodes(path: &Path) -> Vec<DemoEpisode> {
    DemoReader::open(path).and_then(DemoReader::read_all).expect("whole")
}

#[test]
fn a_recording_is_lost_to_another_one_only_once_that_has_begun() {
    let folder = tempfile::tempdir().expect("a folder");
    // A recording is replaced where it lies, not where a link to it does.
    let root = folder.path().canonicalize().expect("there");
    let (path, other) = (root.join("a.demo"), tempfile::tempdir().expect("a folder"));
    record_random(&Corridor, "plain", 5, &path, 0..6);
    record_random(&Corridor, "plain", 7, &other.path().join("b.demo"), 10..16);
    let (old, new) = (episodes(&path), episodes(&other.path().join("b.demo")));
    let before = PaperDisk::of(&root);
    let recording = DiskRecording::of(&root);
    let mut writer = DemoWriter::replace(&path, Corridor.demo_header("plain")).expect("replaceable");
    new.iter().for_each(|episode| writer.push(episode).expect("writable"));
    drop(writer);
    assert_eq!(episodes(&path), new);
    assert_eq!(std::fs::read_dir(&root).expect("readable").count(), 1, "nothing is left over");
    let operations = recording.operations();
    let (mut kept, mut begun) = (0, 0);
    for cut in power_cuts(&operations) {
        let left = tempfile::tempdir().expect("a folder");
        before.clone().after(&operations, &cut).write(&root, left.path());
        let path = left.path().join("a.demo");
        repair(&path, &path, None).unwrap_or_else(|error| panic!("{cut:?}: {error}"));
        let found = episodes(&path);
        let done = &operations[..cut.operations];
        let is_there = done.iter().any(|operation| matches!(operation, DiskOperation::Rename { .. }));
        if !is_there {
            assert_eq!(found, old, "{cut:?}: the old recording has changed");
            kept += 1;
            continue;
        }
        // The first is that of the header.
        let synced = done.iter().filter(|operation| matches!(operation, DiskOperation::Sync(_))).count();
        assert!(new.starts_with(&found) && found.len() + 1 >= synced, "{cut:?}: {} episodes", found.len());
        begun += 1;
    }
    assert!(kept > 5 && begun > 20, "{kept}, {begun}");
}
