//! Section of the changes since earlier results.

use std::fmt::{Display, Write};

use super::words::text;
use crate::{report::whole, verdict::Comparison};

/// Largest number of changes of a kind that are listed; all are in `against.json`.
const MOST_CHANGES: usize = 100;

/// Writes the section of the page.
pub fn compared(comparison: &Comparison) -> String {
    let Comparison { levels, only_now, only_before, left_out, .. } = comparison;
    let [both, now, before] = [levels, only_now, only_before].map(|count| whole(*count as f64));
    let mut out = String::from("<section>\n<h2>Since the earlier results</h2>\n");
    let _ = writeln!(out, "<p>{both} levels in both, {now} only now, {before} only before.</p>");
    for why in left_out {
        let _ = writeln!(out, "<p>Left out: {}.</p>", text(why));
    }
    let lists = [
        list("Unsolvable", &comparison.unsolvable),
        list("Harder", &comparison.harder),
        list("New findings", &comparison.new_findings),
        list("Easier", &comparison.easier),
        list("Gone findings", &comparison.gone_findings),
    ];
    if lists.iter().all(String::is_empty) {
        out += "<p>Nothing has changed by more than chance.</p>\n";
    }
    out + &lists.concat() + "</section>\n"
}

fn list(title: &str, changes: &[impl Display]) -> String {
    if changes.is_empty() {
        return String::new();
    }
    let mut out = format!("<h3>{title} ({})</h3>\n<ul>\n", changes.len());
    for change in changes.iter().take(MOST_CHANGES) {
        let _ = writeln!(out, "<li>{}</li>", text(&change.to_string()));
    }
    let more = changes.len().saturating_sub(MOST_CHANGES);
    if more > 0 {
        let _ = writeln!(out, "<li>and {more} more in against.json</li>");
    }
    out + "</ul>\n"
}
