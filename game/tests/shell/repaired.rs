//! Tests of recordings whose header is damaged, repaired from the command line.

use std::fs;

use bevy_playbot::demo::file::DemoReader;

use crate::program::{code, done, ended, errors, lines, playbot};

#[test]
fn a_recording_without_a_header_is_repaired_with_that_of_another_one() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    for (file, levels) in [("whole.demo", "easy:0..3"), ("other.demo", "easy:8..8")] {
        done(folder, &["record", "coinrun", "--levels", levels, "--out", file]);
    }
    let whole = fs::read(folder.join("whole.demo")).expect("recorded");
    let frames = DemoReader::open(folder.join("whole.demo")).expect("sound").offset() as usize;
    // Both copies of the header.
    let damaged = [&vec![b'x'; frames][..], &whole[frames..]].concat();
    fs::write(folder.join("damaged.demo"), &damaged).expect("writable");

    let repair = ["demo", "repair", "damaged.demo", "--out", "mended.demo"];
    let (_, helpless) = ended(folder, &repair, 3);
    assert!(helpless.contains("not a recording"), "{helpless}");
    assert!(helpless.contains("`playbot demo repair damaged.demo --header-from OTHER`"), "{helpless}");
    let (_, missing) = ended(folder, &[&repair[..], &["--header-from", "none.demo"]].concat(), 3);
    assert!(missing.contains("none.demo"), "{missing}");
    assert!(!folder.join("mended.demo").exists(), "nothing was written");

    let output = playbot(folder, &[&repair[..], &["--header-from", "other.demo", "--json"]].concat());
    assert_eq!(code(&output), 0, "{}", errors(&output));
    let report = lines(&output).remove(0);
    assert_eq!((&report["kept_episodes"], &report["header_from"]), (&4.into(), &"other.demo".into()), "{report}");
    assert!(fs::read(folder.join("mended.demo")).expect("written") == whole, "the same recording as before");
    done(folder, &["demo", "verify", "mended.demo"]);

    // In place, with a text report, and with the damaged file kept.
    let (words, _) = done(folder, &["demo", "repair", "damaged.demo", "--header-from", "other.demo"]);
    assert!(words.contains("its header was damaged, and is taken from other.demo"), "{words}");
    assert!(fs::read(folder.join("damaged.demo")).expect("repaired") == whole);
    assert!(fs::read(folder.join("damaged.demo.bak")).expect("kept") == damaged);
}
