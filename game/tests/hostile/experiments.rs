//! Tests of experiments with wrong values, lines in the wrong position and random bytes.

use std::{
    ops::Range,
    path::Path,
    time::{Duration, Instant},
};

use playbot_games::GAMES;
use playbot_harness::games::Games;
use playbot_train::experiment::file::{locate, parse_experiment_with, read_experiment};

use crate::dice::Dice;

/// Longest allowed time of reading and checking.
const PATIENCE: Duration = Duration::from_secs(5);

/// Experiments of every game and of all algorithms.
const EXPERIMENTS: [&str; 5] = ["coinrun", "coinrun-pixels", "coinrun-sac", "maze2d-medium", "antmaze-medium"];

/// Returns an experiment with every key written out, a line each.
fn whole(name: &str) -> Vec<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../assets/experiments/{name}.ron"));
    let text = read_experiment(&path).map(|experiment| experiment.to_ron()).expect("sound").expect("RON");
    text.lines().map(str::to_owned).collect()
}

/// Returns the error of reading and checking, before any work is done.
fn complaint(text: &str) -> Option<String> {
    let path = Path::new("x.ron");
    let begun = Instant::now();
    let games = Games::new(&GAMES).expect("each has a name of its own");
    let said = match parse_experiment_with::<&str>(text, path, &[]) {
        Err(error) => Some(error.to_string()),
        Ok(experiment) => games.get(&experiment.game).ok().and_then(|game| {
            let checked = experiment.check_game(game).and_then(|()| experiment.check_memory(game));
            checked.err().map(|error| locate::<&str>(text, path, &[], error).to_string())
        }),
    };
    assert!(begun.elapsed() < PATIENCE, "it took {:?}:\n{text}", begun.elapsed());
    said
}

/// Returns true if an error names the line, and does so without pages of text.
fn is_placed(error: &str) -> bool {
    let line = error.strip_prefix("x.ron:").and_then(|rest| rest.split(':').next());
    line.is_some_and(|line| line.parse::<usize>().is_ok()) && error.len() < 2000
}

/// Returns the share of errors with a position, in percent.
fn placed(errors: &[String]) -> usize {
    100 * errors.iter().filter(|error| is_placed(error)).count() / errors.len().max(1)
}

/// Extreme numbers.
const EXTREMES: [&str; 6] = ["0", "-1", "NaN", "1e308", "18446744073709551615", "4294967295"];

/// Settings that are written only if they have an effect, with a number.
const UNWRITTEN: [&str; 5] = [
    "weight_decay: 0.1,",
    "held_out: 0.1,",
    "patience: Some(1),",
    "state_weight: 1.0,",
    "augment: [Translate(1), Cutout(2)],",
];

/// Returns the ranges of numbers in a text, also those in lists and brackets, but for those in quotes.
fn numbers(text: &str) -> Vec<Range<usize>> {
    let is_part = |byte: u8| byte.is_ascii_alphanumeric() || b"_.+-".contains(&byte);
    let (bytes, mut found, mut at) = (text.as_bytes(), Vec::new(), 0);
    while at < bytes.len() {
        let end = match bytes[at] {
            b'"' => at + 2 + bytes[at + 1..].iter().take_while(|byte| **byte != b'"').count(),
            byte if is_part(byte) => at + bytes[at..].iter().take_while(|byte| is_part(**byte)).count(),
            _ => at + 1,
        };
        if text.get(at..end).is_some_and(|word| word.parse::<f64>().is_ok()) {
            found.push(at..end);
        }
        at = end;
    }
    found
}

/// Joins lines of a text, and returns the range of the lines to change.
fn joined(lines: &[String], chosen: Range<usize>) -> (String, Range<usize>) {
    let length = |lines: &[String]| lines.iter().map(|line| line.len() + 1).sum::<usize>();
    let start = length(&lines[..chosen.start]);
    (lines.join("\n"), start..start + length(&lines[chosen]))
}

/// Returns the experiment with its numbers, and with one wherever there may be one: where there is none, or the list is
/// empty, or the key is left out. Each text comes with the range of those of its numbers that are in no text before it.
fn with_numbers(lines: &[String]) -> Vec<(String, Range<usize>)> {
    let mut texts = vec![joined(lines, 0..lines.len())];
    for (at, line) in lines.iter().enumerate() {
        let key = |empty: &str| line.strip_suffix(empty);
        let changed = key(" None,").map(|key| format!("{key} Some(1),"));
        if let Some(changed) = changed.or_else(|| key(" [],").map(|key| format!("{key} [1],"))) {
            let mut lines = lines.to_vec();
            lines[at] = changed;
            texts.push(joined(&lines, at..at + 1));
        }
    }
    let inside = 1 + lines.iter().position(|line| line.ends_with("skills: (")).expect("there are skills");
    for line in UNWRITTEN {
        let mut lines = lines.to_vec();
        lines.insert(inside, line.to_owned());
        texts.push(joined(&lines, inside..inside + 1));
    }
    texts
}

#[test]
fn every_number_at_its_extremes_is_read_or_refused_with_its_line() {
    let (mut errors, mut tried) = (Vec::new(), 0);
    for (text, changed) in EXPERIMENTS.iter().flat_map(|name| with_numbers(&whole(name))) {
        for place in numbers(&text).into_iter().filter(|place| changed.contains(&place.start)) {
            for extreme in EXTREMES {
                errors.extend(complaint(&format!("{}{extreme}{}", &text[..place.start], &text[place.end..])));
                tried += 1;
            }
        }
    }
    assert!(tried > 2000 && errors.len() > 1000, "only {} of {tried} numbers were refused", errors.len());
    assert!(placed(&errors) >= 95, "{} % of {}", placed(&errors), errors.len());
}

#[test]
fn numbers_are_found_in_lists_and_brackets() {
    let text = "(a: 1, b: \"2..3\", c: Some(-4.5e-6), d: [7, 8], e: Impala(feature: 9), f1: true)";
    let found: Vec<&str> = numbers(text).into_iter().map(|place| &text[place]).collect();
    assert_eq!(found, ["1", "-4.5e-6", "7", "8", "9"]);
}

/// Returns a text that was changed in one way.
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
