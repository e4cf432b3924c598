//! Tests of planting defects from the shell.

use std::{fs, path::Path};

use crate::program::{code, done, ended, errors, json_lines, playbot};

const SMALL: [&str; 9] = ["bugs", "make", "coinrun", "--per-kind", "1", "--sound", "6", "--seed", "3"];

/// Returns the names and bytes of the files of a set.
fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    for folder in [folder.to_owned(), folder.join("levels")] {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("readable").path();
            if path.is_file() {
                let name = path.file_name().expect("a name").to_string_lossy().into_owned();
                found.push((name, fs::read(&path).expect("readable")));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn a_set_is_made_once_and_the_same_by_any_number_of_threads() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    let (out, _) = done(folder, &[&SMALL[..], &["--out", "one", "--threads", "1", "--json"]].concat());
    let made = json_lines(&out).remove(0);
    assert_eq!((made["seed"].as_u64(), made["sound"].as_u64()), (Some(3), Some(6)), "{made}");
    let mutants = made["mutants"].as_u64().expect("a number");
    assert!(mutants >= 11, "{made}");
    let text = fs::read_to_string(folder.join("one/mutants.json")).expect("written");
    let set: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!(set["mutants"].as_array().map(|all| all.len() as u64), Some(mutants));
    assert!(set["mutants"].as_array().is_some_and(|all| all.iter().any(|bug| bug["class"] == "short-time-out")));

    // Not even the superuser writes there.
    if cfg!(target_os = "linux") {
        let args = ["bugs", "score", "one", "--tester", "random", "--out", "/proc/score.json"];
        let (_, words) = ended(folder, &args, 2);
        assert!(words.contains("cannot write /proc/score.json: ") && !words.contains(".jobs"), "{words}");
    }

    done(folder, &[&SMALL[..], &["--out", "two", "--threads", "2"]].concat());
    assert_eq!(files(&folder.join("one")), files(&folder.join("two")));
    let taken = playbot(folder, &[&SMALL[..], &["--out", "one"]].concat());
    assert_eq!(code(&taken), 3);
    assert!(errors(&taken).contains("--force"), "{}", errors(&taken));
    done(
        folder,
        &["bugs", "make", "coinrun", "--per-kind", "1", "--sound", "6", "--seed", "4", "--out", "one", "--force"],
    );
    assert_ne!(files(&folder.join("one")), files(&folder.join("two")));
}

#[test]
fn mistakes_are_reported_before_anything_is_planted() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    fs::create_dir(folder.join("set")).expect("writable");
    fs::write(folder.join("set/results.json"), "").expect("writable");
    let output = playbot(folder, &["bugs", "make", "coinrun", "--out", "set"]);
    assert!(code(&output) == 3 && errors(&output).contains("set has the results of a test"), "{}", errors(&output));
    fs::remove_file(folder.join("set/results.json")).expect("writable");
    for (args, words) in [
        (&["coinrn"][..], "did you mean `coinrun`?"),
        (&["coinrun", "coinrun"], "is named twice"),
        (&["coinrun", "--levels", "hard:0..9"], "GAME=MODE:1000..1999"),
        (&["coinrun", "--levels", "coinrun=hrd:0..9"], "did you mean `hard`?"),
        (&["coinrun", "--levels", "maze2d=umaze:0..9"], "for a game that defects are planted into"),
        (&["coinrun", "--per-kind", "0"], "--per-kind"),
        (&["coinrun", "--levels", "coinrun=hard:5000..5009", "--sound", "20"], "are needed"),
    ] {
        let output = playbot(folder, &[&["bugs", "make", "--out", "set"][..], args].concat());
        assert_eq!(code(&output), 3, "{args:?}");
        assert!(errors(&output).contains(words), "{args:?}: {}", errors(&output));
        assert!(!folder.join("set/mutants.json").exists());
    }
}
