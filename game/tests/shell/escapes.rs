//! Tests that text from files of strangers steers no terminal, breaks no line of JSON and is no markup in a page.

use std::{fs, path::Path};

use bevy_playbot::{
    demo::file::{DemoHeader, DemoReader, DemoWriter},
    vision::ObservationConfig,
};
use playbot_games::coinrun::CoinRun;
use playbot_learner::{ActionSpace, DeviceKind, Learner, PolicySpec, PpoConfig, PpoLearner};
use playbot_train::policy_export::{Provenance, export_policy, policy_file};

use crate::program::{done, errors, json_lines, playbot, said, unsealed};

/// Clears the screen, turns the direction of writing around, colours the rest with one control character, rings, and is
/// markup.
const EVIL: &str = "x\u{1b}[2J\u{202e}\u{2066}\u{9b}31m\u{7}\u{7f}<script>alert(1)</script>";

/// Returns true if a character steers a terminal.
fn steers(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t')) || matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Numbers of the characters of a text that steer a terminal.
fn steering(text: &str) -> Vec<String> {
    text.chars().filter(|c| steers(*c)).map(|c| c.escape_unicode().to_string()).collect()
}

/// Runs a command that shows the text of a file, whether it does more or refuses it.
fn assert_harmless(folder: &Path, line: &str) {
    let output = playbot(folder, &line.split(' ').collect::<Vec<_>>());
    assert!(output.status.code().is_some_and(|code| code <= 3), "{line}: {}", errors(&output));
    let shown = said(&output) + &errors(&output);
    assert!(shown.contains("script"), "{line}: the text is not shown: {shown}");
    assert_eq!(steering(&shown), Vec::<String>::new(), "{line}: {shown:?}");
}

/// Runs a command that gives the text of a file as JSON, whole.
fn assert_json(folder: &Path, line: &str) {
    let (data, _) = done(folder, &line.split(' ').collect::<Vec<_>>());
    assert_eq!(steering(&data), Vec::<String>::new(), "{line}: {data:?}");
    let whole = json_lines(&data).iter().any(|value| value.to_string().contains("script"));
    assert!(whole, "{line}: the text is not there: {data}");
}

/// Writes a policy of random weights with such texts in its metadata.
fn write_policy(path: &Path) {
    let game = CoinRun::default();
    let spec = PolicySpec { obs: 563_usize.into(), latent: 0, action_space: ActionSpace::Discrete(15) };
    let config = PpoConfig { hidden: vec![8], ..PpoConfig::default() };
    let learner = PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("valid");
    let evil = || EVIL.to_owned();
    let about = Provenance { algorithm: evil(), training: evil(), code: evil(), ..Provenance::default() };
    let mut file = policy_file(&game, &ObservationConfig::default(), learner.policy(), None, about);
    file.metadata.actions[0] = evil();
    file.metadata.observations[0] = evil();
    export_policy(&game, &file, &"hard:0..3".parse().expect("a split"), 1, path).expect("writable");
}

/// Writes a recording with other words in its header.
fn write_recording(folder: &Path, name: &str, change: impl FnOnce(DemoHeader) -> DemoHeader) {
    let reader = DemoReader::open(folder.join("few.demo")).expect("recorded");
    let header = change(reader.header().clone());
    let mut writer = DemoWriter::create(folder.join(name), header).expect("writable");
    for episode in reader.read_all().expect("sound") {
        writer.push(&episode).expect("writable");
    }
}

/// Writes a policy, recordings, a run and results of a test whose texts are evil.
fn strangers(folder: &Path) {
    let evil = || EVIL.to_owned();
    write_policy(&folder.join("evil.policy"));
    done(folder, &["record", "coinrun", "--levels", "easy:0..1", "--out", "few.demo"]);
    write_recording(folder, "evil.demo", |header| DemoHeader { demonstrator: evil(), note: evil(), ..header });
    write_recording(folder, "foreign.demo", |header| DemoHeader { game: evil(), mode: evil(), ..header });

    let small = r#"(game: "coinrun", train: "hard:0..3", test: "hard:64..67", steps: 128, arenas: 4, algorithm: "ppo",
        ppo: (num_steps: 32, minibatches: 2, hidden: [8]))"#;
    fs::write(folder.join("small.ron"), small).expect("writable");
    done(folder, &["train", "--experiment", "small.ron", "--run", "runs/evil"]);
    done(folder, &["test", "coinrun", "--levels", "hard:0..1", "--out", "tested"]);
    let quoted = serde_json::to_string(EVIL).expect("JSON");
    let name = "\"coinrun\"";
    for (file, from, to) in [
        ("runs/evil/experiment.ron", name, format!("\"{EVIL}\"")),
        ("tested/results.json", "\"search\"", quoted.clone()),
        ("tested/test.json", "\"search\"", quoted),
    ] {
        let text = unsealed(&fs::read_to_string(folder.join(file)).expect("written"));
        assert!(text.contains(from), "{file}: {text}");
        fs::write(folder.join(file), text.replace(from, &to)).expect("writable");
    }
}

#[test]
fn text_of_strangers_steers_no_terminal_and_is_no_markup() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    strangers(folder);
    for line in [
        "policy show evil.policy",
        "policy show evil.policy --json",
        "eval --policy evil.policy --levels hard:0..0",
        "view coinrun --policy evil.policy",
        "demo show evil.demo",
        "demo ls evil.demo",
        "demo ls evil.demo --json",
        "demo show foreign.demo",
        "demo verify foreign.demo",
        "demo verify foreign.demo --json",
        "demo merge evil.demo few.demo --out all.demo",
        "demo filter evil.demo few.demo --out kept.demo",
        "view coinrun --demo foreign.demo",
        "runs ls",
        "runs ls --json",
        "runs show runs/evil",
        "runs show runs/evil --json",
        "train --run runs/evil --resume",
        "eval --run runs/evil",
    ] {
        assert_harmless(folder, line);
    }
    done(folder, &["report", "html", "tested"]);
    let page = fs::read_to_string(folder.join("tested/report.html")).expect("written");
    assert!(page.contains("&lt;script&gt;alert(1)") && !page.contains("<script>alert"), "it is text in the page");
    assert_eq!(steering(&page), Vec::<String>::new(), "of the page");
}

#[test]
fn text_of_strangers_breaks_no_line_of_json() {
    let temporary = tempfile::tempdir().expect("a folder");
    let folder = temporary.path();
    strangers(folder);
    for line in
        ["policy show evil.policy --json", "demo ls evil.demo --json", "runs ls --json", "runs show runs/evil --json"]
    {
        assert_json(folder, line);
    }
}
