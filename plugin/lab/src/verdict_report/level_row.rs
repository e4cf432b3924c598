//! Rows of a level in the table.

use std::fmt::Write;

use super::{
    details::details,
    drawn::Drawn,
    words::{interval, text, what},
};
use crate::{
    escape::escape,
    report::ticks,
    verdict::{LevelVerdict, TestRecord},
};

/// Sort key of an unknown share: before all others.
const UNKNOWN: f64 = -1.0;
/// Sort key of a missing finish time: after all others.
const NEVER: f64 = 1e12;

/// Writes the rows of a level: its numbers, and below them its details, if it has findings or a picture. `data-v` is
/// the sort key of a column, `data-k` the filter key of a level.
pub fn level_row(record: &TestRecord, level: &LevelVerdict, program: &str, drawn: Option<&Drawn>) -> String {
    let LevelVerdict { score, findings, .. } = level;
    let outcome = level.outcome.name();
    let kinds = if findings.is_empty() { outcome.to_owned() } else { format!("{outcome} findings") };
    let share = score.solved as f64 / score.episodes.max(1) as f64;
    let median = score.ticks.map(|ticks| ticks.median);
    let places = level.places.unwrap_or_default();
    let mut out = format!(
        "<tbody data-k=\"{kinds}\"><tr><th scope=\"row\" data-v=\"{}\">{}</th><td data-v=\"{}\" class=\"{outcome}\">\
         {outcome}</td><td data-v=\"{share:.4}\">{} of {}</td><td data-v=\"{:.4}\">{}</td><td data-v=\"{}\">{}</td>\
         <td data-v=\"{:.1}\">{}</td><td data-v=\"{}\">{}</td></tr>\n",
        level.index,
        text(&level.level),
        level.outcome as u8,
        score.solved,
        score.episodes,
        score.interval[0],
        interval(score.interval),
        median.unwrap_or(NEVER),
        median.map_or_else(|| "–".to_owned(), ticks),
        places.percent().unwrap_or(UNKNOWN),
        places.describe(),
        findings.len(),
        detectors(level),
    );
    if !level.is_perfect() || drawn.is_some() {
        let _ = writeln!(
            out,
            "<tr><td colspan=\"7\"><details><summary>{}</summary>\n<div class=\"card\">\n{}</div></details></td></tr>",
            what(level),
            details(record, level, program, drawn)
        );
    }
    out + "</tbody>\n"
}

/// Returns the names of the detectors with findings, each once.
fn detectors(level: &LevelVerdict) -> String {
    let mut names: Vec<&str> = level.findings.iter().map(|finding| finding.detector.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    if names.is_empty() { "–".to_owned() } else { escape(&names.join(", ")) }
}
