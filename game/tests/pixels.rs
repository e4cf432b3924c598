//! Tests of learning from pictures by the program, and of the experiments that come with it.

#[path = "shared/program.rs"]
mod program;

use std::path::Path;

use playbot_train::experiment::file::read_experiment;
use program::{done, ended};
use serde_json::Value;

const EXPERIMENT: &str = r#"(
    game: "coinrun", train: "hard:0..3", test: "hard:64..67", demos: "walk.demo", steps: 256, arenas: 4,
    observation: Raster, image: (width: 16, height: 16, stack: 2, paint_velocity: true),
    skills: (epochs: 1, batch: 16, hidden: [16], gru_hidden: 8, latent: 2, cnn: Impala(channels: [4], feature: 16)),
    ppo: (num_steps: 32, minibatches: 2),
    eval: (episodes_per_level: 1),
)"#;

#[test]
fn the_program_learns_from_pixels_and_knows_its_sensor_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("small.ron"), EXPERIMENT).expect("writable");
    let from = ["--experiment", "small.ron"];
    done(folder, &["record", "coinrun", "--levels", "hard:4..13", "--noise", "0.2", "--out", "walk.demo"]);
    let learn = ["learn-skills", "--out", "s.safetensors", "--max-steps", "300"];
    let (_, messages) = done(folder, &[&learn[..], &from].concat());
    assert!(
        messages.contains("16×16 colour pictures of the raster, 2 in a stack, with painted velocity"),
        "{messages}"
    );
    let train = ["train", "--skills", "s.safetensors", "--run", "run"];
    done(folder, &[&train[..], &from].concat());
    done(folder, &["policy", "export", "--run", "run", "--out", "eyes.policy"]);
    let shown = done(folder, &["policy", "show", "eyes.policy"]).0;
    assert!(shown.contains("observation   16×16 colour pictures of the raster, 2 in a stack"), "{shown}");
    let shown: Value =
        serde_json::from_str(&done(folder, &["policy", "show", "eyes.policy", "--json"]).0).expect("JSON");
    assert_eq!(
        (&shown["card"]["picture"]["sensor"], &shown["card"]["picture"]["stack"]),
        (&"raster".into(), &2.into())
    );

    // An experiment of vectors gives the levels here; the observation is the policy's own.
    std::fs::write(folder.join("vectors.ron"), EXPERIMENT.replace("Raster", "Vector")).expect("writable");
    let measure = |args: &[&str]| {
        let text = done(folder, &[&["eval", "--levels", "hard:64..67", "--json"], args].concat()).0;
        let rows = text.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
        rows.map(|row| (row["return_mean"].clone(), row["length_mean"].clone())).collect::<Vec<_>>()
    };
    let own = measure(&["--run", "run"]);
    assert_eq!(measure(&["--policy", "eyes.policy", "--experiment", "vectors.ron"]), own);
    assert_eq!(measure(&["--policy", "eyes.policy", "--observation", "raster", "--experiment", "vectors.ron"]), own);
    assert_eq!(measure(&["--skills", "s.safetensors", "--bot", "random", "--experiment", "vectors.ron"]).len(), 2);

    for (args, words) in [
        (&["eval", "--run", "run", "--observation", "vector"][..], "--observation vector gives vectors"),
        (&["eval", "--run", "run", "--observation", "sonar"], "valid: vector, raster, camera"),
        (&["eval", "--run", "run", "--set", "image.stack=4"], "--observation camera"),
        (&["train", "--skills", "s.safetensors", "--run", "r", "--experiment", "vectors.ron"], "say vectors"),
        (
            &[
                "train",
                "--skills",
                "s.safetensors",
                "--run",
                "r",
                "--experiment",
                "small.ron",
                "--set",
                "image.stack=4",
            ],
            "4 in a stack",
        ),
        (&["learn-skills", "--out", "t", "--experiment", "small.ron", "--set", "image.width=0"], "width is 0"),
    ] {
        let (_, messages) = ended(folder, args, 3);
        assert!(messages.contains(words), "{args:?}: {messages}");
    }
    assert!(!folder.join("r").exists(), "nothing is begun that cannot work");
}

#[test]
fn the_experiments_of_the_repository_are_sound() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/experiments");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).expect("there").flatten() {
        let experiment = read_experiment(&entry.path()).unwrap_or_else(|error| panic!("{error}"));
        experiment.check().unwrap_or_else(|error| panic!("{}: {error}", entry.path().display()));
        names.push((entry.file_name().to_string_lossy().into_owned(), experiment.observation_config().is_image()));
    }
    names.sort();
    assert!(names.contains(&("coinrun-pixels.ron".to_owned(), true)) && names.len() >= 4, "{names:?}");
}

#[cfg(feature = "screen")]
#[test]
fn the_two_sensors_are_compared_and_the_worst_frame_is_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let eyes = ["eyes", "coinrun", "--levels", "hard:0..3", "--frames", "4", "--size", "48"];
    let (json, _) = done(folder, &[&eyes[..], &["--out", "eyes", "--json"]].concat());
    let result: Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!(result["frames"], 16);
    assert!(result["close"].as_f64().is_some_and(|share| share >= 0.97), "{result}");
    let table = std::fs::read_to_string(folder.join("eyes/table.md")).expect("written");
    assert!(table.contains("--levels hard:0..3 --frames 4 --out eyes"), "{table}");
    assert!(folder.join("eyes/worst.png").is_file() && folder.join("eyes/results.json").is_file());
    for strict in ["--least-close=1.1", "--most-mean=-1"] {
        // No picture is that close.
        ended(folder, &[&eyes[..], &[strict]].concat(), 1);
    }
}
