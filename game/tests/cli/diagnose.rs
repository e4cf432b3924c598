//! Tests of `playbot diagnose`, and of the warning of a training.

use crate::program::{code, errors, lines, playbot, said};

/// The settings of a training of seconds.
const SMALL: &str = r#"(
    game: "coinrun", train: "easy:0..15", test: "easy:16..31", demos: "demos", steps: 2048, arenas: 8, worlds: 2,
    skills: (window: 5, epochs: 1, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2),
    ppo: (num_steps: 64, minibatches: 2, hidden: [16, 16]),
)"#;

fn prepared() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("small.ron"), SMALL).expect("writable");
    folder
}

#[test]
fn a_training_with_a_wrong_setting_warns_and_is_diagnosed() {
    let folder = prepared();
    let run = |args: &[&str]| playbot(folder.path(), args);
    let train = ["train", "--experiment", "small.ron", "--algorithm", "ppo", "--run", "bad", "--set", "ppo.lr=1.0"];
    let trained = run(&train);
    assert!(errors(&trained).contains("warning: the learning rate is too high: `ppo.lr` is 1"), "{}", errors(&trained));
    assert!(errors(&trained).contains("diagnose --run bad --replays`"), "{}", errors(&trained));
    let warnings = errors(&trained).matches("warning: the ").count();
    assert_eq!(warnings, 1, "it warns once: {}", errors(&trained));

    let found = run(&["diagnose", "--run", "bad", "--json"]);
    assert_eq!(code(&found), 1, "{}", errors(&found));
    let finding = &lines(&found)[0]["findings"][0];
    assert_eq!(finding["sign"], "learning-rate-too-high");
    assert!(finding["evidence"].as_str().is_some_and(|words| words.contains("`ppo.lr` is 1")), "{finding}");
    assert!(finding["cause"].is_string(), "{finding}");
    assert!(finding["try"].as_str().is_some_and(|words| words.contains("--set ppo.lr=0.0003")), "{finding}");

    let page = run(&["diagnose", "--run", "bad", "--out", "why.html"]);
    assert_eq!(code(&page), 1);
    assert!(said(&page).starts_with("1. the learning rate is too high"), "{}", said(&page));
    let html = std::fs::read_to_string(folder.path().join("why.html")).expect("written");
    assert!(html.contains("the learning rate is too high"), "{html}");
}

#[test]
fn a_sound_training_is_silent_and_has_no_finding() {
    let folder = prepared();
    let run = |args: &[&str]| playbot(folder.path(), args);
    let trained = run(&["train", "--experiment", "small.ron", "--algorithm", "ppo", "--run", "good"]);
    assert_eq!(code(&trained), 0, "{}", errors(&trained));
    assert!(!errors(&trained).contains("warning: "), "{}", errors(&trained));
    let found = run(&["diagnose", "--run", "good", "--json"]);
    assert_eq!((code(&found), lines(&found)[0]["findings"].to_string().as_str()), (0, "[]"), "{}", errors(&found));
    assert!(errors(&found).contains("nothing was played: --replays"), "{}", errors(&found));
}

#[test]
fn recordings_of_random_actions_are_diagnosed() {
    let folder = prepared();
    let run = |args: &[&str]| playbot(folder.path(), args);
    let made = run(&["record", "coinrun", "--levels", "easy:0..5", "--noise", "0.1", "--out", "good.demo"]);
    assert_eq!(code(&made), 0, "{}", errors(&made));
    let sound = run(&[
        "diagnose",
        "coinrun",
        "--set",
        "train=easy:0..63",
        "--set",
        "test=easy:64..95",
        "--demo",
        "good.demo",
        "--replays",
    ]);
    assert_eq!(code(&sound), 0, "{}{}", said(&sound), errors(&sound));
    let made = ["record", "coinrun", "--levels", "easy:0..9", "--bot", "random", "--observations", "--out", "bad.demo"];
    let bot = run(&made);
    assert_eq!(code(&bot), 0, "{}", errors(&bot));
    let found = run(&["diagnose", "--demo", "bad.demo", "--json"]);
    assert_eq!(code(&found), 1, "{}", errors(&found));
    assert_eq!(lines(&found)[0]["findings"][0]["sign"], "contradictory-recordings", "{}", said(&found));
}

#[test]
fn mistakes_name_what_to_type() {
    let folder = prepared();
    for (args, words) in [
        (&["diagnose"][..], "name a --run, a --demo, a game or an --experiment"),
        (&["diagnose", "--run", "none"], "`playbot train --run none`"),
        (&["diagnose", "--demo", "none.demo"], "playbot record GAME --out none.demo"),
        (&["diagnose", "coinrnu"], "did you mean `coinrun`?"),
        (&["diagnose", "--run", "r", "--demo", "d"], "cannot be used with"),
        (&["diagnose", "--run", "r", "--out", "why.txt"], "written as .html"),
    ] {
        let output = playbot(folder.path(), args);
        assert_eq!(code(&output), 3, "{args:?}: {}", errors(&output));
        assert!(errors(&output).contains(words), "{args:?}: {}", errors(&output));
    }
}
