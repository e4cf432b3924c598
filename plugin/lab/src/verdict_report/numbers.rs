//! Numbers of the whole test.

use std::fmt::Write;

use super::words::{interval_of, text};
use crate::{
    report::whole,
    verdict::{Overview, Trials},
};

/// Writes the outcomes of the levels, and the totals of each tester.
pub fn numbers(overview: &Overview) -> String {
    let levels = overview.levels;
    let mut out = String::from("<section>\n<h2>Outcome</h2>\n<dl class=\"numbers\">\n");
    let mut number = |class: &str, what: &str, count: u64, note: &str| {
        let count = whole(count as f64);
        let _ = writeln!(out, "<div><dt>{what}</dt><dd class=\"{class}\">{count}</dd><dd>{note}</dd></div>");
    };
    number("levels-all", "levels", levels, "");
    for (class, what, count) in [
        ("solved", "solved", overview.solved),
        ("bot-failed", "unsolved, nothing proved", overview.bot_failed),
        ("proved-unsolvable", "proved unsolvable", overview.proved_unsolvable),
    ] {
        number(class, what, count, &interval_of(Trials { successes: count, trials: levels }));
    }
    number("found", if overview.findings == 1 { "finding" } else { "findings" }, overview.findings, "");
    if overview.places.percent().is_some() {
        let [visited, open] = [overview.places.visited, overview.places.open].map(|count| whole(count as f64));
        let (share, note) = (overview.places.describe(), format!("{visited} of {open}"));
        let _ =
            writeln!(out, "<div><dt>open squares visited</dt><dd class=\"places\">{share}</dd><dd>{note}</dd></div>");
    }
    out += "</dl>\n</section>\n<section>\n<h2>Testers</h2>\n<div class=\"table\" role=\"region\" \
            aria-label=\"Testers\" tabindex=\"0\"><table>\n<thead><tr><th scope=\"col\">tester</th>\
            <th scope=\"col\">levels solved</th><th scope=\"col\">95 % interval</th><th scope=\"col\">episodes solved</th>\
            <th scope=\"col\">95 % interval</th><th scope=\"col\">open squares visited</th></tr></thead>\n<tbody>\n";
    for (record, total) in overview.record.testers.iter().zip(&overview.testers) {
        let cells = |of: Trials| {
            let [successes, trials] = [of.successes, of.trials].map(|count| whole(count as f64));
            format!("<td>{successes} of {trials}</td><td>{}</td>", interval_of(of))
        };
        let name = text(&record.describe());
        let (levels, episodes, places) = (cells(total.levels), cells(total.episodes), total.places.describe());
        let _ = writeln!(out, "<tr><th scope=\"row\">{name}</th>{levels}{episodes}<td>{places}</td></tr>");
    }
    out + "</tbody></table></div>\n<p class=\"key\">Intervals are 95 % Wilson intervals.</p>\n</section>\n"
}
