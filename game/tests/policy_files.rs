//! Tests of policy files: exported by the program, read back by a game, and refused where they do not fit.

#[path = "shared/program.rs"]
mod program;

use std::path::Path;

use bevy_playbot::policy_file::check_policy;
use bevy_playbot::{
    policy_file::{PolicyFile, PolicyMisfit, install_policy},
    vision::ObservationConfig,
};
use playbot::prelude::*;
use playbot_games::coinrun::CoinRun;
use playbot_harness::worlds::build_world;
use playbot_learner::{ActionSpace, DeviceKind, FileError, Learner, PolicySpec, PpoConfig, PpoLearner};
use playbot_train::policy_export::{Provenance, export_policy, policy_file};
use serde_json::Value;

fn learner(obs_dim: usize) -> PpoLearner {
    let spec = PolicySpec { obs: obs_dim.into(), latent: 0, action_space: ActionSpace::Discrete(15) };
    let config = PpoConfig { hidden: vec![32, 32], norm_obs: true, ..PpoConfig::default() };
    PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("valid")
}

fn provenance() -> Provenance {
    Provenance { algorithm: "ppo".to_owned(), training: "nothing".to_owned(), seen: None, code: "test".to_owned() }
}

/// Writes a policy file of an untrained policy into `folder`, and returns its path.
fn exported(folder: &Path) -> std::path::PathBuf {
    let game = CoinRun::default();
    let about = provenance();
    let file = policy_file(&game, &ObservationConfig::default(), learner(563).policy(), None, about);
    let path = folder.join("bot.policy");
    export_policy(&game, &file, &"hard:0..3".parse().expect("a split"), 1, &path).expect("writable");
    path
}

/// Changes the header of a safetensors file, whose length stands in its first eight bytes. The file is then one of an
/// older version, which has no checksum.
fn edit_header(path: &Path, edit: impl FnOnce(&mut Value)) -> Vec<u8> {
    let bytes = std::fs::read(path).expect("readable");
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let mut header: Value = serde_json::from_slice(&bytes[8..8 + length]).expect("JSON");
    let text = header["__metadata__"]["playbot"].as_str().expect("a description");
    let (_, rest) = text.split_once("\",").expect("a checksum first");
    header["__metadata__"]["playbot"] = format!("{{{rest}").into();
    edit(&mut header);
    let header = header.to_string();
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &bytes[8 + length..]].concat()
}

fn read(bytes: &[u8]) -> Result<PolicyFile, FileError> {
    PolicyFile::from_bytes(Path::new("bot.policy"), bytes, DeviceKind::Flex)
}

#[test]
fn a_policy_file_plays_in_a_game() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = exported(folder.path());
    for device in DeviceKind::CPU {
        let file = PolicyFile::load(&path, device).expect("sound");
        let game = CoinRun::default();
        assert_eq!(check_policy(&game.metadata(), &file), Ok(()));
        let (mut world, agents) = build_world(&game, "hard", 1, 0, 1);
        install_policy(&mut world, &file, ActionDraw::Sample);
        world.entity_mut(agents[0]).insert((Control::Policy, LevelQueue::Always(0)));
        world.ticks(20).expect("it decides");
    }
}

#[test]
fn a_policy_file_of_a_newer_version_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let newer = edit_header(&exported(folder.path()), |header| {
        let text = header["__metadata__"]["playbot"].as_str().expect("a description").to_owned();
        let mut description: Value = serde_json::from_str(&text).expect("JSON");
        description["version"] = 2.into();
        description["something new"] = true.into();
        header["__metadata__"]["playbot"] = description.to_string().into();
    });
    let error = read(&newer).expect_err("too new");
    assert!(matches!(error, FileError::Newer { found: 2, readable: 1, .. }), "{error}");
    assert!(error.to_string().contains("update playbot"), "{error}");
}

#[test]
fn a_policy_that_computes_something_else_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = exported(folder.path());
    let mut bytes = edit_header(&path, |_| {});
    // The first tensor by name is the actor's bias or weight: one flipped sign bit in every number changes it.
    let length = u64::from_le_bytes(bytes[..8].try_into().expect("eight bytes")) as usize;
    let header: Value = serde_json::from_slice(&bytes[8..8 + length]).expect("JSON");
    let span = &header["actor.l0.weight"]["data_offsets"];
    let (from, to) = (span[0].as_u64().expect("offset") as usize, span[1].as_u64().expect("offset") as usize);
    for at in (8 + length + from + 3..8 + length + to).step_by(4) {
        bytes[at] ^= 0x80;
    }
    let error = read(&bytes).expect_err("another policy");
    assert!(matches!(error, FileError::Example { .. }), "{error}");
    assert!(error.to_string().contains("example"), "{error}");
}

#[test]
fn torn_and_foreign_files_are_explained() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = exported(folder.path());
    let bytes = std::fs::read(&path).expect("readable");
    for length in [0, 7, 40, bytes.len() / 2] {
        let error = read(&bytes[..length]).expect_err("torn").to_string();
        assert!(error.ends_with("the file is cut off: export the policy again"), "{length}: {error}");
    }
    let error = read(&[b'x'; 100]).expect_err("something else").to_string();
    assert!(
        error.contains("not safetensors, the form") && error.contains("name one that playbot has written"),
        "{error}"
    );
    let renamed = edit_header(&path, |header| {
        let tensor = header["critic.l1.bias"].take();
        header.as_object_mut().expect("a map").remove("critic.l1.bias");
        header["critic.l1.tias"] = tensor;
    });
    let error = read(&renamed).expect_err("a tensor is missing").to_string();
    assert!(error.contains("`critic.l1.bias` is missing"), "{error}");
    let file = folder.path().join("checkpoint");
    learner(563).save(&file).expect("writable");
    let error = PolicyFile::load(&file, DeviceKind::Flex).expect_err("a checkpoint").to_string();
    assert!(error.contains("one of the kind `policy` is needed"), "{error}");
}

#[test]
fn a_policy_of_another_game_names_the_difference() {
    let game = CoinRun::default();
    let mut file = policy_file(&game, &ObservationConfig::default(), learner(563).policy(), None, provenance());
    file.metadata.observations[7] = "heat".to_owned();
    let error = check_policy(&game.metadata(), &file).expect_err("another observation");
    assert!(matches!(&error, PolicyMisfit::Observation { at: 7, expected, .. } if expected == "heat"), "{error}");
    file.metadata.observations.pop();
    assert!(matches!(check_policy(&game.metadata(), &file), Err(PolicyMisfit::Metadata { reads: 563, named: 562 })));
    let mut file = policy_file(&game, &ObservationConfig::default(), learner(563).policy(), None, provenance());
    file.metadata.actions.swap(1, 7);
    let error = check_policy(&game.metadata(), &file).expect_err("other actions");
    assert!(matches!(&error, PolicyMisfit::ActionName { at: 1, expected, .. } if expected == "right"), "{error}");
    file.metadata.game_version = 9;
    assert!(matches!(check_policy(&game.metadata(), &file), Err(PolicyMisfit::Version { made_for: 9, now: 1, .. })));
    file.metadata.game = "chess".to_owned();
    assert!(matches!(check_policy(&game.metadata(), &file), Err(PolicyMisfit::Game { .. })));
}

#[test]
fn the_program_exports_shows_and_measures() {
    let folder = tempfile::tempdir().expect("a folder");
    let done = |args: &[&str]| program::done(folder.path(), args);
    let refused = |args: &[&str]| program::ended(folder.path(), args, 3).1;
    let experiment = r#"(game: "coinrun", train: "hard:0..3", test: "hard:64..67", demos: "none", steps: 512, arenas: 4,
        ppo: (num_steps: 32, minibatches: 2, hidden: [16]))"#;
    std::fs::write(folder.path().join("small.ron"), experiment).expect("writable");
    done(&["train", "--algorithm", "ppo", "--experiment", "small.ron", "--run", "run"]);
    done(&["policy", "export", "--run", "run", "--out", "bot.policy"]);
    refused(&["policy", "export", "--run", "run", "--out", "bot.policy"]);
    let ignored = refused(&["policy", "export", "--run", "run", "--set", "seed=2", "--out", "other.policy"]);
    assert!(ignored.contains("cannot be used with"), "{ignored}");
    let other = refused(&["policy", "export", "maze2d", "--run", "run", "--out", "other.policy"]);
    let said = "run: a run of the game `coinrun`, not of `maze2d`: name a run of `maze2d`, or name the game `coinrun`";
    assert!(other.contains(said), "{other}");
    let other = refused(&["eval", "maze2d", "--run", "run"]);
    assert!(other.contains(said), "{other}");
    let there = refused(&["train", "coinrun", "--run", "run"]);
    assert!(there.contains("run exists already"), "{there}");
    let (shown, _) = done(&["policy", "show", "bot.policy", "--json"]);
    let described: Value = serde_json::from_str(&shown).expect("JSON");
    assert_eq!(described["card"]["actions"][8], "right+jump");
    assert_eq!(described["card"]["training"], "512 of 512 steps on hard:0..3, seed 1");
    let measure = |args: &[&str]| {
        let (row, _) = done(&[&["eval", "--levels", "hard:64..67", "--json", "--seed", "1"], args].concat());
        let row: Value = serde_json::from_str(&row).expect("JSON");
        (row["return_mean"].clone(), row["length_mean"].clone())
    };
    let maze = r#"(game: "maze2d", train: "medium:0..3", test: "medium:4..5", demos: "maze.demo", steps: 128, arenas: 4,
        skills: (window: 10, epochs: 1, batch: 16, hidden: [16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
        ppo: (num_steps: 32, minibatches: 2, hidden: [16]), eval: (episodes_per_level: 1))"#;
    std::fs::write(folder.path().join("maze.ron"), maze).expect("writable");
    done(&["record", "maze2d", "--levels", "medium+fixed-start+end-at-goal:9..10", "--out", "maze.demo"]);
    done(&["learn-skills", "--experiment", "maze.ron", "--out", "sk.safetensors"]);
    done(&["train", "--algorithm", "ppo", "--experiment", "maze.ron", "--run", "maze"]);
    let (_, reported) = done(&["policy", "export", "--run", "maze", "--out", "maze.policy"]);
    // The command in the advice, as it would be copied.
    let advice = reported.split('`').nth(1).expect("a command");
    assert_eq!(advice, "playbot eval --policy maze.policy --levels medium:4..5");
    let words: Vec<&str> = advice.split(' ').skip(1).chain(["--episodes-per-level", "1", "--json"]).collect();
    let (measured, _) = done(&words);
    assert!(measured.contains("medium:4..5"), "{measured}");
    for args in [
        &["policy", "export", "--skills", "sk.safetensors", "--out", "clone.policy"][..],
        &["eval", "--skills", "sk.safetensors"],
    ] {
        let errors = refused(args);
        for words in ["those of maze2d, not of `coinrun`", "--experiment", "`maze2d`, behind the verb"] {
            assert!(errors.contains(words), "{errors}");
        }
    }
    let clone = ["--skills", "sk.safetensors", "--experiment", "maze.ron", "--out", "clone.policy"];
    done(&[&["policy", "export"], &clone[..]].concat());
    let message = refused(&["eval", "--policy", "clone.policy", "--episodes-per-level", "1", "--set", "game=coinrun"]);
    assert!(message.contains("for the game `maze2d`"), "{message}");

    assert_eq!(
        measure(&["--policy", "bot.policy", "--experiment", "small.ron"]),
        measure(&["--run", "run"]),
        "the file plays otherwise than the run it was made of"
    );
}

#[test]
fn a_policy_of_a_game_that_the_program_does_not_have_can_be_looked_at_and_not_played() {
    let folder = tempfile::tempdir().expect("a folder");
    let lander = concat!(env!("CARGO_MANIFEST_DIR"), "/../plugin/examples/lander.policy");
    std::fs::copy(lander, folder.path().join("lander.policy")).expect("part of the repository");
    let (shown, _) = program::done(folder.path(), &["policy", "show", "lander.policy"]);
    for words in [
        "lander, version 1 of its rules; this program does not have that game (it has coinrun",
        "observation   3 values: height, speed, fuel\n",
        "actions       2 discrete actions\n",
        "skills        4 numbers, held for 5 ticks\n",
    ] {
        assert!(shown.contains(words), "{shown}");
    }
    let (shown, _) = program::done(folder.path(), &["policy", "show", "lander.policy", "--json"]);
    let shown: Value = serde_json::from_str(&shown).expect("JSON");
    assert_eq!((&shown["card"]["game"], &shown["in_this_program"]), (&"lander".into(), &false.into()));
    let (_, errors) = program::ended(folder.path(), &["view", "coinrun", "--policy", "lander.policy"], 3);
    let words =
        "lander.policy: the policy was made for the game `lander`, not for `coinrun`: name a policy of `coinrun`";
    assert!(errors.contains(words), "{errors}");
}
