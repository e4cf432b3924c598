//! Tests of stored findings.

use crate::findings::{testing::stored, *};
use bevy_playbot::demo::file::DemoFault;
use playbot_learner::HasExitCode as _;
use std::{fs, path::PathBuf};

/// A folder, and the finding in a file in it.
fn written(finding: &StoredFinding) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.finding");
    finding.write(&path).expect("writable");
    (folder, path)
}

#[test]
fn a_finding_reads_back_and_has_always_the_same_bytes() {
    let (folder, path) = written(&stored());
    let read = StoredFinding::read(&path).expect("sound");
    let note = read.header.note.clone();
    assert_eq!(read, StoredFinding { header: DemoHeader { note: note.clone(), ..stored().header }, ..stored() });
    assert!(note.contains("detector:\"panic\"") && note.contains("tick:Some(2)"), "{note}");
    let again = folder.path().join("b.finding");
    read.write(&again).expect("writable");
    assert_eq!(fs::read(&path).expect("read"), fs::read(&again).expect("read"));
    assert_eq!(fs::read_dir(folder.path()).expect("read").count(), 2, "nothing else is left");
}

#[test]
fn a_finding_without_ticks_reads_back() {
    let header = stored().header;
    let finding = StoredFinding {
        head: FindingHead { tick: None, state_hash: None, ..stored().head },
        episode: DemoEpisode::new(7, header.actions),
        header,
    };
    let (_folder, path) = written(&finding);
    let read = StoredFinding::read(&path).expect("sound");
    assert_eq!((read.episode, read.head), (finding.episode, finding.head));
}

#[test]
fn a_finding_is_also_a_recording() {
    let (_folder, path) = written(&stored());
    let episodes = DemoReader::open(&path).and_then(DemoReader::read_all).expect("a recording");
    assert_eq!(episodes, [stored().episode]);
}

#[test]
fn a_file_that_is_cut_anywhere_is_refused() {
    let (_folder, path) = written(&stored());
    let bytes = fs::read(&path).expect("read");
    for cut in 0..bytes.len() {
        let _ = fs::remove_file(&path);
        fs::write(&path, &bytes[..cut]).expect("writable");
        let error = StoredFinding::read(&path).expect_err("cut");
        let words = error.to_string();
        assert!(words.contains("a.finding: ") && words.contains("test the level again"), "{words}");
        assert!(!words.contains("repair"), "one piece of advice: {words}");
    }
}

#[test]
fn files_of_others_are_reported_as_what_they_are() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.finding");
    let missing = StoredFinding::read(&path).expect_err("not there");
    assert!(missing.is_usage(), "{missing}");
    let words = missing.to_string();
    assert!(words.contains("there is no such file: name a .finding") && !words.contains("damage"), "{words}");
    fs::write(&path, "{\"game\": \"garden\"}").expect("writable");
    let foreign = StoredFinding::read(&path).expect_err("JSON");
    assert!(matches!(&foreign, FindingError::File(error) if matches!(error.fault, DemoFault::NotADemo { .. })));
    let with_note = |note: &str, episodes: usize| {
        let header = DemoHeader { note: note.to_owned(), ..stored().header };
        let mut writer = DemoWriter::replace(&path, header).expect("writable");
        (0..episodes).for_each(|_| writer.push(&stored().episode).expect("writable"));
        drop(writer);
        StoredFinding::read(&path).expect_err(note).to_string()
    };
    let words = with_note("played on Sunday", 1);
    assert!(words.contains("a recording, but not a finding") && words.contains("`playbot demo show "), "{words}");
    assert!(words.contains("`playbot view garden --demo ") && !words.contains("FormOnly"), "{words}");
    assert!(with_note("(finding: 1, level: \"a\")", 1).contains("a recording, but not a finding"));
    assert!(with_note("(finding: 9, colour: \"red\")", 1).contains("form 9, but this program reads forms up to 1"));
    let sound = ron::ser::to_string(&stored().head).expect("text");
    assert!(with_note(&sound, 0).contains("0 episodes, but a finding has one"));
    assert!(with_note(&sound, 2).contains("2 episodes, but a finding has one"));
}

#[test]
fn what_a_newer_program_adds_to_a_head_is_left_aside() {
    let note = ron::ser::to_string(&stored().head).expect("text");
    let more = format!("{},mood:Some(\"bad\"))", note.strip_suffix(')').expect("a struct"));
    assert_eq!(
        head_of(Path::new("a"), &DemoHeader { note: more, ..stored().header }).expect("known fields"),
        stored().head
    );
}
