//! Experiments with wrong values, lines in the wrong place and bytes that nobody wrote.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use playbot_games::registry::GAMES;
use playbot_lab::{
    games::Games,
    train::config_file::{locate, parse_experiment_with, read_experiment},
};

use crate::dice::Dice;

/// Longest that reading and checking may take.
const PATIENCE: Duration = Duration::from_secs(5);

/// Experiments of every game and of all ways to learn.
const EXPERIMENTS: [&str; 5] = ["coinrun", "coinrun-pixels", "coinrun-sac", "maze2d-medium", "antmaze-medium"];

/// An experiment with every key written out, a line each.
fn whole(name: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("assets/experiments/{name}.ron"));
    let text = read_experiment(&path).map(|experiment| experiment.to_ron()).expect("sound").expect("RON");
    text.lines().map(str::to_owned).collect()
}

/// What reading and checking says before any work is done.
fn complaint(text: &str) -> Option<String> {
    let path = Path::new("x.ron");
    let begun = Instant::now();
    let games = Games::new(&GAMES).expect("each has a name of its own");
    let said = match parse_experiment_with::<&str>(text, path, &[]) {
        Err(error) => Some(error.to_string()),
        Ok(experiment) => games.get(&experiment.game).ok().and_then(|game| {
            let checked = experiment.check_agent(game).and_then(|()| experiment.check_memory(game));
            checked.err().map(|error| locate::<&str>(text, path, &[], error).to_string())
        }),
    };
    assert!(begun.elapsed() < PATIENCE, "it took {:?}:\n{text}", begun.elapsed());
    said
}

/// Whether an error says the line, and does so without pages of text.
fn is_placed(error: &str) -> bool {
    let line = error.strip_prefix("x.ron:").and_then(|rest| rest.split(':').next());
    line.is_some_and(|line| line.parse::<usize>().is_ok()) && error.len() < 2000
}

/// The share of errors that say where, in percent.
fn placed(errors: &[String]) -> usize {
    100 * errors.iter().filter(|error| is_placed(error)).count() / errors.len().max(1)
}

#[test]
fn every_number_at_its_extremes_is_read_or_refused_with_its_line() {
    let mut errors = Vec::new();
    for name in EXPERIMENTS {
        let lines = whole(name);
        for at in 0..lines.len() {
            let Some((key, value)) = lines[at].split_once(": ") else { continue };
            if value.trim_end_matches(',').parse::<f64>().is_err() {
                continue;
            }
            for extreme in ["0", "-1", "NaN", "1e308", "18446744073709551615", "4294967295"] {
                let mut changed = lines.clone();
                changed[at] = format!("{key}: {extreme},");
                errors.extend(complaint(&changed.join("\n")));
            }
        }
    }
    assert!(errors.len() > 500, "only {} of the numbers were refused", errors.len());
    assert!(placed(&errors) >= 95, "{} % of {}", placed(&errors), errors.len());
}

/// A text that was changed in one way.
fn mutant(lines: &[String], dice: &mut Dice) -> String {
    const VALUES: [&str; 16] = [
        "None",
        "true",
        "\"\"",
        "[]",
        "()",
        "[18446744073709551615]",
        "-0.0",
        "1e-300",
        "Some(3)",
        "\"hard:5..1\"",
        "Off",
        "\"\u{1b}[2J\"",
        "'x'",
        "0x10",
        "[[1]]",
        "(a: 1)",
    ];
    let mut lines = lines.to_vec();
    let (at, other) = (dice.roll(lines.len()), dice.roll(lines.len()));
    match dice.roll(7) {
        0 => drop(lines.remove(at)),
        1 => lines.insert(at, lines[other].clone()),
        2 => lines.swap(at, other),
        3 | 4 => {
            let key = lines[at].split_once(": ").map_or("seed", |(key, _)| key).to_owned();
            lines[at] = format!("{key}: {},", dice.pick(&VALUES));
        }
        5 => lines[at].insert_str(0, &"x".repeat(1 + dice.roll(3))),
        _ => {
            let text = lines.join("\n");
            let end = text.floor_char_boundary(dice.roll(text.len()));
            return text[..end].to_owned();
        }
    }
    lines.join("\n")
}

#[test]
fn thousands_of_mutants_are_read_or_refused_with_a_line() {
    let experiments = EXPERIMENTS.map(whole);
    let mut dice = Dice(1);
    let errors: Vec<String> = (0..5000)
        .filter_map(|_| {
            let of = dice.roll(experiments.len());
            complaint(&mutant(&experiments[of], &mut dice))
        })
        .collect();
    assert!(errors.len() > 2500, "only {} of the mutants were refused", errors.len());
    assert!(placed(&errors) >= 95, "{} % of {}", placed(&errors), errors.len());
}
