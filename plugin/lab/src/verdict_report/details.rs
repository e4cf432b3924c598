//! Details of one level: findings, picture, testers, and commands to see it again.

use std::fmt::Write;

use super::{
    drawn::Drawn,
    walks::walks,
    words::{interval, text},
};
use crate::{
    escape::escape,
    report,
    verdict::{Finding, LevelVerdict, TestRecord, TesterVerdict, rerun_commands},
};

/// Largest number of findings and testers of a level that are listed, which keeps the page fast.
const MOST_LISTED: usize = 10;

/// Writes the details of a level, with its picture if it has one.
pub fn details(record: &TestRecord, level: &LevelVerdict, program: &str, drawn: Option<&Drawn>) -> String {
    let mut out = String::new();
    if !level.findings.is_empty() {
        let more = level.findings.len().saturating_sub(MOST_LISTED);
        let listed: String = level.findings.iter().take(MOST_LISTED).map(finding).collect();
        let more = if more > 0 { format!("<li>and {more} more</li>\n") } else { String::new() };
        let _ = write!(out, "<ul class=\"findings\">\n{listed}{more}</ul>\n");
    }
    if let Some(Drawn { picture, clip }) = drawn {
        let clip = clip.as_ref().map_or_else(String::new, |clip| {
            format!("<button type=\"button\" class=\"clip\" data-clip=\"{clip}\" hidden>Play the failure</button>")
        });
        let _ = writeln!(out, "<figure>{picture}{clip}</figure>");
    }
    out += &walks(level);
    out += &testers(&level.testers);
    let commands = rerun_commands(program, record, level);
    if !commands.is_empty() {
        let _ = writeln!(out, "<pre><code>{}</code></pre>", escape(&commands.join("\n")));
    }
    out
}

fn finding(finding: &Finding) -> String {
    let tester = finding.tester.as_ref().map(|tester| escape(tester));
    let episode = finding.episode.map(|episode| format!("episode {episode}"));
    let tick = finding.tick.map(|tick| format!("tick {tick}"));
    let place: Vec<String> = [tester, episode, tick].into_iter().flatten().collect();
    let place = if place.is_empty() { String::new() } else { format!(" ({})", place.join(", ")) };
    let file = finding.file.as_ref().map_or_else(String::new, |file| format!(" <code>{}</code>", escape(file)));
    format!("<li><b>{}</b>{place}: {}{file}</li>\n", escape(&finding.detector), text(&finding.message))
}

fn testers(testers: &[TesterVerdict]) -> String {
    let mut out = String::from(
        "<div class=\"table\" role=\"group\" aria-label=\"Testers\" tabindex=\"0\"><table class=\"testers\">\
         <thead><tr><th scope=\"col\">tester</th><th scope=\"col\">solved</th>\
         <th scope=\"col\">95 % interval</th><th scope=\"col\">ticks (quartiles)</th><th scope=\"col\">lost</th>\
         <th scope=\"col\">timed out</th><th scope=\"col\">broken</th></tr></thead><tbody>\n",
    );
    for tester in testers.iter().take(MOST_LISTED) {
        let score = &tester.score;
        let ticks = score.ticks.map_or_else(
            || "–".to_owned(),
            |ticks| {
                let [lower, median, upper] =
                    [ticks.lower_quartile, ticks.median, ticks.upper_quartile].map(report::ticks);
                format!("{median} ({lower} to {upper})")
            },
        );
        let _ = writeln!(
            out,
            "<tr><th scope=\"row\">{}</th><td>{} of {}</td><td>{}</td><td>{ticks}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            text(&tester.tester),
            score.solved,
            score.episodes,
            interval(score.interval),
            score.lost,
            score.timed_out,
            score.broken
        );
    }
    let more = testers.len().saturating_sub(MOST_LISTED);
    if more > 0 {
        let _ = writeln!(out, "<tr><td colspan=\"7\">and {more} more in results.json</td></tr>");
    }
    out + "</tbody></table></div>\n"
}
