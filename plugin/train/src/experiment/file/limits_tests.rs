//! Files made to take forever.

use crate::experiment::{file::*, keys::syntax_message};
use std::{
    fs,
    path::Path,
    time::{Duration, Instant},
};

const GOOD: &str = r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "d", steps: 1000)"#;

fn write(folder: &Path, name: &str, text: &str) {
    fs::write(folder.join(name), text).expect("writable");
}

/// Returns the error of an invalid experiment file, which must come soon.
fn refused(path: &Path) -> String {
    let begun = Instant::now();
    let error = read_experiment(path).expect_err("must be refused").to_string();
    assert!(begun.elapsed() < Duration::from_secs(1), "it took {:?}: {error}", begun.elapsed());
    error
}

#[test]
fn bases_that_fan_out_are_refused_after_a_few_files() {
    let folder = tempfile::tempdir().expect("a folder");
    for depth in 0..8 {
        let next = format!("\"wide{}.ron\",", depth + 1);
        write(folder.path(), &format!("wide{depth}.ron"), &format!("(base: [{}])", next.repeat(10)));
    }
    write(folder.path(), "wide8.ron", GOOD);
    let error = refused(&folder.path().join("wide0.ron"));
    assert!(error.contains("wide0.ron is built on more than 64 files and presets: `base` may name fewer"), "{error}");
    // As many as are allowed, and one more.
    let built_on = |count: usize| GOOD.replace("game:", &format!("base: [{}], game:", "\"wide8.ron\",".repeat(count)));
    write(folder.path(), "most.ron", &built_on(64));
    assert_eq!(read_experiment(&folder.path().join("most.ron")).expect("64 files").steps, 1000);
    write(folder.path(), "more.ron", &built_on(65));
    assert!(refused(&folder.path().join("more.ron")).contains("more.ron:1:"));
    let presets = GOOD.replace("game:", &format!("base: [{}], game:", "\"coinrun-ppo\",".repeat(50_000)));
    write(folder.path(), "presets.ron", &presets);
    assert!(refused(&folder.path().join("presets.ron")).contains("more than 64 files and presets"));
}

#[test]
fn a_file_that_is_too_long_is_refused_with_its_name_and_the_limit() {
    let folder = tempfile::tempdir().expect("a folder");
    let long = |bytes: usize| GOOD.replace("game:", &format!("/*{}*/ game:", "x".repeat(bytes)));
    write(folder.path(), "long.ron", &long(1 << 20));
    write(folder.path(), "top.ron", &GOOD.replace("game:", "base: [\"long.ron\"],\n game:"));
    for name in ["long.ron", "top.ron"] {
        let error = refused(&folder.path().join(name));
        assert!(error.contains("long.ron") && error.contains("has at most 1048576"), "{error}");
    }
    write(folder.path(), "long.ron", &long((1 << 20) - GOOD.len() - 10));
    assert_eq!(read_experiment(&folder.path().join("top.ron")).expect("not too long").steps, 1000);
}

#[test]
fn a_hundred_thousand_keys_are_refused_as_soon_as_they_are_counted() {
    let folder = tempfile::tempdir().expect("a folder");
    let keys: String = (0..100_000).map(|number| format!("k{number}:1,")).collect();
    write(folder.path(), "keys.ron", &format!("({keys})"));
    let error = refused(&folder.path().join("keys.ron"));
    assert!(error.contains("keys.ron:1:1: 100000 keys in one place"), "{error}");
    // In a long file, positions of keys are counted in long texts.
    let steps = format!("steps: {}1000", "\n".repeat(900_000));
    let values = good_with_every_key().replacen("steps: 1000", &steps, 1);
    write(folder.path(), "lines.ron", &values);
    let begun = Instant::now();
    assert_eq!(read_experiment(&folder.path().join("lines.ron")).expect("sound").steps, 1000);
    // Counted anew for each key, they would take minutes.
    assert!(begun.elapsed() < Duration::from_secs(20), "it took {:?}", begun.elapsed());
}

/// Returns an experiment with all keys, all of which come after `steps`.
fn good_with_every_key() -> String {
    let text = parse_experiment(GOOD, Path::new("x.ron")).expect("sound").to_ron().expect("RON");
    let rest = text.replacen("steps: 1000,", "", 1);
    assert!(rest.len() < text.len(), "{text}");
    rest.replacen('(', "(steps: 1000,", 1)
}

#[cfg(unix)]
#[test]
fn what_is_no_regular_file_is_refused_and_not_waited_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("pipe.ron");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo is there");
    assert!(made.success());
    std::os::unix::fs::symlink("/dev/zero", folder.path().join("zero.ron")).expect("writable");
    for name in ["pipe.ron", "zero.ron"] {
        write(folder.path(), "top.ron", &GOOD.replace("game:", &format!("base: [\"{name}\"],\n game:")));
        for file in [name, "top.ron"] {
            let error = refused(&folder.path().join(file));
            assert!(error.contains(name) && error.contains("not a regular file"), "{error}");
        }
    }
}

#[test]
fn too_many_open_brackets_are_named_in_plain_words() {
    let words = syntax_message(&ron::Error::ExceededRecursionLimit);
    assert_eq!(words, "too many brackets are open at once: an experiment needs a few levels of them");
}
