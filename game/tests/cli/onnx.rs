//! Tests of `playbot policy export --format onnx` and `playbot policy import`.

use std::{fs, path::Path};

use crate::program::{done, ended};

/// Trains `run` for a moment, with a memory if asked.
fn trained(folder: &Path, memory: &str) {
    let text = format!(
        r#"(game: "coinrun", train: "easy:0..3", test: "easy:4..5", steps: 128, arenas: 8, worlds: 2,
        algorithm: "ppo", ppo: (num_steps: 16, minibatches: 2, hidden: [8, 8], norm_obs: true, memory: {memory}))"#
    );
    fs::write(folder.join("small.ron"), text).expect("writable");
    done(folder, &["train", "--experiment", "small.ron", "--run", "run"]);
}

#[test]
fn a_run_goes_out_as_onnx_and_comes_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    trained(folder, "Gru(hidden: 4)");
    let export = ["policy", "export", "--run", "run", "--format", "onnx", "--out"];
    let (_, words) = done(folder, &[&export[..], &["bot.onnx"]].concat());
    assert!(words.contains("policy written to bot.onnx, as ONNX") && words.contains("`memory_after`"), "{words}");
    done(folder, &["policy", "export", "--run", "run", "--out", "bot.policy", "--examples", "7"]);
    done(folder, &["policy", "export", "--policy", "bot.policy", "--format", "onnx", "--out", "again.onnx"]);
    let bytes = |name: &str| fs::read(folder.join(name)).expect("there");
    assert!(bytes("bot.onnx") == bytes("again.onnx"), "the same policy is the same file");
    let left: Vec<_> = fs::read_dir(folder).expect("readable").flatten().map(|entry| entry.file_name()).collect();
    assert!(!left.iter().any(|name| name.to_string_lossy().contains(".tmp")), "{left:?}");
    assert_eq!(left.len(), 5, "no prior without skills: {left:?}");

    let (_, words) = done(folder, &["policy", "import", "bot.onnx", "--game", "coinrun", "--out", "back.policy"]);
    for part in ["actions come from the output `action`", "policy written to back.policy", "playbot eval --policy"] {
        assert!(words.contains(part), "{words}");
    }
    let (shown, _) = done(folder, &["policy", "show", "back.policy"]);
    for part in ["algorithm     ppo", "imported from bot.onnx", "memory        4 numbers", "normalised"] {
        assert!(shown.contains(part), "{shown}");
    }
    let test = ["test", "coinrun", "--levels", "easy:0..0", "--policy", "back.policy", "--out", "out"];
    let output = crate::program::playbot(folder, &test);
    assert!(output.status.code().is_some_and(|code| code < 2), "{}", String::from_utf8_lossy(&output.stderr));

    let refused = |args: &[&str], part: &str| {
        let (_, words) = ended(folder, args, 3);
        assert!(words.contains(part), "{args:?}: {words}");
    };
    refused(&[&export[..], &["bot.onnx"]].concat(), "bot.onnx exists already; overwrite it with --force");
    refused(&[&export[..], &["b.onnx", "--examples", "3"]].concat(), "--examples is for policy files");
    let import =
        |file: &'static str, game: &'static str| ["policy", "import", file, "--out", "bad.policy", "--game", game];
    refused(&import("bot.onnx", "maze2d"), "for the game `coinrun`, not for `maze2d`");
    refused(&import("small.ron", "coinrun"), "small.ron: it is no ONNX file, or it is cut off");
    refused(&import("none.onnx", "coinrun"), "cannot read none.onnx");
    refused(&import("bot.onnx", "coinrnu"), "coinrun");
    refused(&["policy", "import", "bot.onnx", "--game", "coinrun", "--out", "back.policy"], "--force");
    assert!(!folder.join("bad.policy").exists());
}

#[test]
fn a_policy_with_skills_is_written_with_its_prior() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    done(folder, &["record", "coinrun", "--levels", "easy:0..1", "--out", "a.demo"]);
    let small = ["skills.latent=3", "skills.epochs=1", "skills.hidden=[8]", "skills.encoder_hidden=8", "demos=a.demo"];
    let sets: Vec<&str> = small.iter().flat_map(|set| ["--set", *set]).collect();
    done(folder, &[&["learn-skills", "coinrun", "--out", "skills.safetensors"], &sets[..]].concat());
    let export =
        ["policy", "export", "--skills", "skills.safetensors", "--format", "onnx", "--out", "clone.onnx", "coinrun"];
    let (_, words) = done(folder, &[&export[..], &sets].concat());
    assert!(words.contains("its prior written to clone.prior.onnx: run it for a new skill every 8 ticks"), "{words}");
    assert!(folder.join("clone.onnx").exists() && folder.join("clone.prior.onnx").exists());
    let import = ["policy", "import", "clone.onnx", "--game", "coinrun", "--out", "back.policy"];
    let (_, words) = ended(folder, &import, 3);
    assert!(words.contains("the graph reads the input `skill`"), "{words}");
}
