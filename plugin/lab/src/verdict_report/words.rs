//! Texts and numbers of the page.

use std::{cmp::Reverse, collections::BTreeMap};

use crate::{
    escape::escape,
    verdict::{LevelVerdict, Score, Trials, wilson},
};

/// Most letters of a foreign text, such as the message of a broken game.
const MOST_LETTERS: usize = 400;
/// Largest number of causes that are named.
const MOST_CAUSES: usize = 8;

/// Escapes text for the page; a long one is cut.
pub fn text(words: &str) -> String {
    match words.char_indices().nth(MOST_LETTERS) {
        Some((end, _)) => format!("{} …", escape(&words[..end])),
        None => escape(words),
    }
}

/// Formats a 95 % interval of a share, in percent.
pub fn interval([low, high]: [f64; 2]) -> String {
    format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high)
}

/// Formats the 95 % Wilson interval of a share, in percent.
pub fn interval_of(share: Trials) -> String {
    interval(wilson(share.successes, share.trials))
}

/// Describes the failure of a level in one line of escaped text.
pub fn what(level: &LevelVerdict) -> String {
    let Some(finding) = level.findings.first() else {
        let causes = causes(level);
        let causes = if causes.is_empty() { String::new() } else { format!(" ({causes})") };
        return format!("{}{causes}", ends(&level.score));
    };
    let more = level.findings.len() - 1;
    let more = if more > 0 { format!(" (and {more} more)") } else { String::new() };
    format!("{}: {}{more}", escape(&finding.detector), text(&finding.message))
}

/// Describes the ends of the episodes that were not solved.
pub fn ends(score: &Score) -> String {
    let counts = [("lost", score.lost), ("timed out", score.timed_out), ("broken", score.broken)];
    let told = counts.iter().filter(|(_, count)| *count > 0).map(|(what, count)| format!("{what} {count}"));
    let told: Vec<String> = told.collect();
    if told.is_empty() { "solved each time".to_owned() } else { told.join(", ") }
}

/// Describes how often each cause ended an episode, as a short escaped text.
pub fn causes(level: &LevelVerdict) -> String {
    let told: Vec<String> =
        most_frequent(&level.causes).map(|(cause, count)| format!("{} {count}", text(cause))).collect();
    told.join(", ")
}

/// Returns causes with their numbers of ends, the most frequent ones first.
pub fn most_frequent(causes: &BTreeMap<String, u64>) -> impl Iterator<Item = (&str, u64)> {
    let mut sorted: Vec<(&str, u64)> = causes.iter().map(|(cause, count)| (cause.as_str(), *count)).collect();
    // Equally frequent ones stay in the order of their names.
    sorted.sort_by_key(|(_, count)| Reverse(*count));
    sorted.into_iter().take(MOST_CAUSES)
}
