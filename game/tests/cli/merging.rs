//! Tests of joining shards: no option of it loses data.

use std::fs;

use crate::program::{done, ended};

#[test]
fn nothing_is_lost_or_half_written_when_shards_cannot_be_joined() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let test = ["test", "coinrun", "--levels", "easy:0..3", "--bot", "search"];
    for (out, shard) in [("zero", "0/2"), ("one", "1/2")] {
        done(folder, &[&test[..], &["--shard", shard, "--out", out]].concat());
    }
    done(folder, &["test", "maze2d", "--levels", "umaze:0..0", "--bot", "waypoints", "--out", "maze"]);
    fs::write(folder.join("file"), "").expect("writable");
    let read = || fs::read(folder.join("zero/results.json")).expect("results");
    let before = read();
    let merge = |more: &[&str]| ended(folder, &[&["report", "merge", "zero", "one"], more].concat(), 3).1;
    for (more, words) in [
        (&["--out", "zero", "--force"][..], "--out zero is the folder of a shard: choose another"),
        (&["--out", "./zero/../one", "--force"], "is the folder of a shard"),
        (&["--out", "file"], "file is a file: name a folder"),
        (
            &["--out", "joined", "--against", "maze"],
            "maze and this test cannot be compared: games `maze2d` and `coinrun`",
        ),
        (&["--out", "joined", "--against", "none"], "none has no results.json"),
    ] {
        let reported = merge(more);
        assert!(reported.contains(words), "{more:?}: {reported}");
    }
    assert_eq!(read(), before);
    assert!(!folder.join("joined").exists(), "nothing is left of what could not be compared");
    done(folder, &["report", "merge", "zero", "one", "--out", "joined"]);
    assert!(merge(&["--out", "joined"]).contains("--force"), "results are not overwritten");
}

#[cfg(unix)]
#[test]
fn a_full_disk_says_that_the_shards_are_whole_and_what_to_do() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    done(folder, &["test", "coinrun", "--levels", "easy:0..1", "--bot", "search", "--shard", "0/1", "--out", "zero"]);
    for (call, words) in [
        ("report merge zero --out joined", "the shards are unchanged: make room"),
        ("report html zero --out page.html", "the results are unchanged: make room"),
    ] {
        let output = crate::program::on_full_disk(folder, 1, call);
        assert_eq!(crate::program::code(&output), 2, "{call}");
        assert!(crate::program::errors(&output).contains(words), "{call}: {}", crate::program::errors(&output));
    }
    assert!(!folder.join("joined/results.json").exists() && !folder.join("page.html").exists());
    done(folder, &["report", "merge", "zero", "--out", "joined"]);
}
