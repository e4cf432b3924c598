//! Tests that recordings, skill models, checkpoints and policy files of an older program load and give the same
//! results, up to roundings: networks make their sums in another order since. `fixtures/older/README.md` describes
//! their origin.

#[path = "shared/program.rs"]
mod program;

use std::{fs, path::Path};

use program::{done, json_lines, unsealed};
use serde_json::Value;

const OLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/fixtures/older");
const FILES: [&str; 6] = ["bot.policy", "few.demo", "policy.json", "run.json", "skills.safetensors", "small.ron"];

/// Returns a folder with copies, which may be written to.
fn older() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for file in FILES {
        fs::copy(Path::new(OLDER).join(file), folder.path().join(file)).expect("part of the repository");
    }
    copy_folder(&Path::new(OLDER).join("run"), &folder.path().join("run"));
    folder
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir(to).expect("writable");
    for entry in fs::read_dir(from).expect("part of the repository") {
        let (path, to) = entry.map(|entry| (entry.path(), to.join(entry.file_name()))).expect("readable");
        if path.is_dir() {
            copy_folder(&path, &to);
        } else {
            fs::copy(path, to).expect("writable");
        }
    }
}

fn read(folder: &Path, file: &str) -> String {
    fs::read_to_string(folder.join(file)).expect("a text")
}

/// Checks that `eval --json` prints the same now as then, but for the standard error, which was over episodes then and
/// is over levels now.
fn measures_as_then(args: &[&str], then: &str) {
    let folder = older();
    let (said, _) = done(folder.path(), &[&["eval", "--json"], args].concat());
    let (now, then) = (json_lines(&said), json_lines(&read(folder.path(), then)));
    assert_eq!(now.len(), then.len());
    for (now, then) in now.iter().zip(&then) {
        let then = then.as_object().expect("a line is an object");
        for (key, value) in then.iter().filter(|(key, _)| *key != "return_se") {
            assert!(is_near(&now[key], value), "{key}: {} is not {value}", now[key]);
        }
    }
}

/// Returns true if two values are the same up to roundings.
fn is_near(now: &Value, then: &Value) -> bool {
    match (now.as_f64(), then.as_f64()) {
        (Some(now), Some(then)) => (now - then).abs() <= 1e-5 + 1e-3 * then.abs(),
        _ => now == then,
    }
}

/// Checks that a run has trained as the older one did.
fn trained_as_then(folder: &Path, run: &str, then: &str) {
    let (now, then) = (json_lines(&unsealed(&read(folder, &format!("{run}/metrics.jsonl")))), json_lines(then));
    assert_eq!(now.len(), then.len());
    for (now, then) in now.iter().zip(&then) {
        let (now, then) = (now.as_object().expect("an object"), then.as_object().expect("an object"));
        assert!(now.keys().eq(then.keys()), "{now:?} and {then:?}");
        let differs = now.iter().find(|(key, value)| !is_near(value, &then[*key]));
        assert_eq!(differs, None, "then {then:?}");
    }
}

#[test]
fn a_recording_replays() {
    let folder = older();
    let (said, _) = done(folder.path(), &["demo", "verify", "few.demo"]);
    assert!(said.contains("all as recorded"), "{said}");
}

#[test]
fn a_run_plays_as_it_did() {
    measures_as_then(&["--run", "run"], "run.json");
}

#[test]
fn a_policy_file_plays_as_it_did() {
    let args = ["--policy", "bot.policy", "--levels", "umaze:8..9", "--episodes-per-level", "4"];
    measures_as_then(&args, "policy.json");
}

#[test]
fn a_training_goes_on_from_its_checkpoint_as_it_went_on_then() {
    let folder = older();
    let then = read(folder.path(), "run/metrics.jsonl");
    fs::remove_dir_all(folder.path().join("run/checkpoints/step-000000000256")).expect("the last of three");
    done(folder.path(), &["train", "--resume", "--run", "run"]);
    trained_as_then(folder.path(), "run", &then);
    assert!(folder.path().join("run/checkpoints/step-000000000256").is_dir(), "it has got as far again");
}

#[test]
fn a_training_starts_from_a_skill_model() {
    let folder = older();
    let args = ["train", "--experiment", "small.ron", "--skills", "skills.safetensors", "--run", "again"];
    // The former default weight of the penalty.
    done(folder.path(), &[&args[..], &["--set", "score.alpha=OwnSample"]].concat());
    trained_as_then(folder.path(), "again", &read(folder.path(), "run/metrics.jsonl"));
}
