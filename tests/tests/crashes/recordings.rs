//! Tests of recordings: made, continued, repaired.

use std::path::{Path, PathBuf};

use bevy_playbot::demo::file::{DemoEpisode, DemoFault, DemoReader, DemoWriter, repair};
use playbot::prelude::*;
use playbot_learner::disk::{DiskOperation, DiskRecording};
use playbot_tests::{
    Corridor,
    power_cut::{PaperDisk, PowerCut, power_cuts},
    recording::record_random,
};

use super::tree::tree;

/// Recorded episodes, some of them by a second program.
const EPISODES: u64 = 24;

fn episodes(path: &Path) -> Vec<DemoEpisode> {
    DemoReader::open(path).and_then(DemoReader::read_all).expect("whole")
}

/// Records to a file, with a second program that continues it.
fn record(path: &Path, given: &[DemoEpisode]) {
    let header = Corridor.demo_header("plain");
    let (first, second) = given.split_at(given.len() / 2);
    let mut writer = DemoWriter::create(path, header.clone()).expect("fresh");
    first.iter().for_each(|episode| writer.push(episode).expect("writable"));
    drop(writer);
    let mut writer = DemoWriter::append(path, &header).expect("whole");
    second.iter().for_each(|episode| writer.push(episode).expect("writable"));
}

/// Writes the files after a power cut, and returns the path of the recording.
fn left_by(before: &PaperDisk, operations: &[DiskOperation], cut: &PowerCut, from: &Path, to: &Path) -> PathBuf {
    before.clone().after(operations, cut).write(from, to);
    to.join("a.demo")
}

/// Checks that at most the damaged files of each repair lie beside a recording.
fn check_left(folder: &Path, cut: &PowerCut) {
    let known = ["a.demo", "a.demo.bak", "a.demo.bak2"];
    let unknown: Vec<PathBuf> =
        tree(folder).into_iter().filter(|path| !known.iter().any(|name| path == Path::new(name))).collect();
    assert!(unknown.is_empty(), "{cut:?}: {unknown:?} are left over");
}

#[test]
fn a_recording_keeps_every_episode_that_was_finished() {
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("source.demo");
    record_random(&Corridor, "plain", 5, &source, 0..EPISODES);
    let given = episodes(&source);
    let below = folder.path().join("made");
    std::fs::create_dir(&below).expect("writable");
    let recording = DiskRecording::of(&below);
    record(&below.join("a.demo"), &given);
    let operations = recording.operations();
    let cuts = power_cuts(&operations);
    assert!(cuts.len() > 200, "{} places", cuts.len());
    for cut in &cuts {
        let left = tempfile::tempdir().expect("a folder");
        let path = left_by(&PaperDisk::default(), &operations, cut, &below, left.path());
        let begun = &operations[..cut.operations];
        let synced = begun.iter().filter(|operation| matches!(operation, DiskOperation::Sync(_))).count();
        if synced == 0 && repair(&path, &path, None).is_err() {
            // Nothing was promised yet, and nothing is in the way of the next attempt.
            DemoWriter::replace(&path, Corridor.demo_header("plain"))
                .unwrap_or_else(|error| panic!("{cut:?}: {error}"));
            continue;
        }
        if let Err(error) = DemoReader::open(&path).and_then(DemoReader::read_all) {
            assert!(!matches!(error.fault, DemoFault::Io { .. }), "{cut:?}: {error}");
        }
        repair(&path, &path, None).unwrap_or_else(|error| panic!("{cut:?}: {error}"));
        let kept = episodes(&path);
        // The header is synchronised before the first episode.
        assert!(kept.len() + 1 >= synced, "{cut:?}: {} episodes of {}", kept.len(), synced.saturating_sub(1));
        assert!(given.starts_with(&kept), "{cut:?}: other episodes");
        let mut writer = DemoWriter::append(&path, &Corridor.demo_header("plain")).expect("whole");
        given[kept.len()..].iter().for_each(|episode| writer.push(episode).expect("writable"));
        assert_eq!(
            std::fs::read(&path).expect("there"),
            std::fs::read(below.join("a.demo")).expect("there"),
            "{cut:?}"
        );
        check_left(left.path(), cut);
    }
}

#[test]
fn a_repair_in_place_loses_nothing_sound() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.demo");
    record_random(&Corridor, "plain", 5, &path, 0..4);
    let given = episodes(&path);
    let mut bytes = std::fs::read(&path).expect("there");
    let length = bytes.len();
    bytes[length - 9] ^= 1;
    std::fs::write(&path, &bytes).expect("writable");
    let before = PaperDisk::of(folder.path());
    let recording = DiskRecording::of(folder.path());
    assert_eq!(repair(&path, &path, None).expect("sound parts").kept_episodes, 3);
    let operations = recording.operations();
    for cut in power_cuts(&operations) {
        let left = tempfile::tempdir().expect("a folder");
        let path = left_by(&before, &operations, &cut, folder.path(), left.path());
        repair(&path, &path, None).unwrap_or_else(|error| panic!("{cut:?}: {error}"));
        assert_eq!(episodes(&path), given[..3], "{cut:?}");
        check_left(left.path(), &cut);
    }
}
