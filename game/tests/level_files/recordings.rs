//! Tests of recordings of level files, which name their level.

use std::{fs, path::Path};

use serde_json::Value;

use crate::program::{code, done, errors, playbot, said};

fn draw(folder: &Path, name: &str, seed: &str) {
    let (json, _) = done(folder, &["level", "coinrun", "--mode", "easy", "--level", seed, "--json"]);
    fs::create_dir_all(folder.join("levels")).expect("writable");
    fs::write(folder.join("levels").join(name), json).expect("writable");
}

fn verify(folder: &Path) -> (i32, String) {
    let output = playbot(folder, &["demo", "verify", "a.demo"]);
    (code(&output), said(&output) + &errors(&output))
}

#[test]
fn a_recording_refuses_another_level_of_the_same_name_and_follows_its_own_to_another() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    draw(folder, "b.json", "1");
    draw(folder, "c.json", "2");
    done(folder, &["record", "coinrun", "--levels", "files:levels/*.json", "--out", "a.demo"]);
    let (shown, _) = done(folder, &["demo", "show", "a.demo"]);
    assert!(shown.contains("levels/b.json") && shown.contains("files:levels/*.json"), "{shown}");
    assert_eq!(verify(folder).0, 0);

    // Another file in front, another layout, and another name change nothing.
    draw(folder, "a.json", "3");
    let text = fs::read_to_string(folder.join("levels/b.json")).expect("readable");
    let value: Value = serde_json::from_str(&text).expect("JSON");
    fs::write(folder.join("levels/b.json"), serde_json::to_string_pretty(&value).expect("text")).expect("writable");
    fs::rename(folder.join("levels/c.json"), folder.join("levels/d.json")).expect("renamed");
    let (verified, words) = verify(folder);
    assert_eq!(verified, 0, "{words}");

    // Another level of the same name is refused.
    draw(folder, "b.json", "9");
    let (verified, words) = verify(folder);
    assert_eq!(verified, 1, "{words}");
    assert!(
        words.contains("the level file levels/b.json has the hash ") && words.contains(" in the recording: "),
        "{words}"
    );
    let output = playbot(folder, &["view", "coinrun", "--demo", "a.demo", "--episode"]);
    assert_eq!(code(&output), 1);
    assert!(errors(&output).contains("levels/b.json has the hash"), "{}", errors(&output));

    // So is a missing level.
    fs::remove_file(folder.join("levels/b.json")).expect("removed");
    let (verified, words) = verify(folder);
    assert_ne!(verified, 0, "{words}");
    assert!(words.contains("levels/b.json") && words.contains("is missing"), "{words}");
}

#[test]
fn learning_refuses_recordings_of_held_out_files() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    draw(folder, "a.json", "1");
    fs::create_dir(folder.join("held")).expect("writable");
    fs::copy(folder.join("levels/a.json"), folder.join("held/copy.json")).expect("writable");
    done(folder, &["record", "coinrun", "--levels", "files:levels/*.json", "--out", "a.demo"]);
    let args = ["learn-skills", "--set", "demos=a.demo", "--set", "test=files:held/*.json", "--out", "s.safetensors"];
    let output = playbot(folder, &args);
    assert_eq!(code(&output), 3, "{}", errors(&output));
    assert!(errors(&output).contains("held-out levels files:held/*.json:0..0"), "{}", errors(&output));

    // Skills that were learned on it elsewhere are not measured there either.
    let small = ["epochs=1", "window=5", "hidden=[8]", "encoder_hidden=8", "gru_hidden=8", "latent=2"];
    let small = small.map(|setting| format!("skills.{setting}"));
    let sets = small.iter().flat_map(|setting| ["--set", setting]);
    let learn: Vec<_> =
        ["learn-skills", "--demos", "a.demo", "--out", "s.safetensors"].into_iter().chain(sets).collect();
    done(folder, &learn);
    let output = playbot(folder, &["eval", "--skills", "s.safetensors", "--set", "test=files:held/*.json"]);
    assert_eq!(code(&output), 3, "{}", errors(&output));
    assert!(
        errors(&output).contains("s.safetensors has learned from files:held/*.json:0, and the held-out"),
        "{}",
        errors(&output)
    );

    // A numbered level of the same layout is no new one for them.
    let (row, words) = done(folder, &["eval", "--skills", "s.safetensors", "--set", "test=easy:1..2", "--json"]);
    assert!(words.contains("1 level of easy:1..2 is left out"), "{words}");
    let row: Value = serde_json::from_str(&row).expect("one line of JSON");
    assert_eq!(
        (row["levels"].as_u64(), row["left_out"].as_u64(), row["layouts"].as_u64()),
        (Some(1), Some(1), Some(1))
    );
}
