//! Words and numbers as the page has them.

use crate::{
    escape::escape,
    verdict::{LevelVerdict, Score, Trials, wilson},
};

/// Most letters of a text that somebody else wrote, such as what a game said when it broke.
const MOST_LETTERS: usize = 400;

/// Text for the page; of a long one the beginning.
pub fn text(words: &str) -> String {
    match words.char_indices().nth(MOST_LETTERS) {
        Some((end, _)) => format!("{} …", escape(&words[..end])),
        None => escape(words),
    }
}

/// A 95 % interval of a share, in percent.
pub fn interval([low, high]: [f64; 2]) -> String {
    format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high)
}

/// The 95 % Wilson interval of a share, in percent.
pub fn interval_of(share: Trials) -> String {
    interval(wilson(share.successes, share.trials))
}

/// What went wrong on a level, in one line that needs no escaping any more.
pub fn what(level: &LevelVerdict) -> String {
    let Some(finding) = level.findings.first() else { return ends(&level.score) };
    let more = level.findings.len() - 1;
    let more = if more > 0 { format!(" (and {more} more)") } else { String::new() };
    format!("{}: {}{more}", escape(&finding.detector), text(&finding.message))
}

/// How the episodes ended that were not solved.
pub fn ends(score: &Score) -> String {
    let counts = [("lost", score.lost), ("timed out", score.timed_out), ("broken", score.broken)];
    let told = counts.iter().filter(|(_, count)| *count > 0).map(|(what, count)| format!("{what} {count}"));
    let told: Vec<String> = told.collect();
    if told.is_empty() { "solved each time".to_owned() } else { told.join(", ") }
}
