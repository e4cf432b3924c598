//! The page of a history: each level that is not always sound, with a square for each build.

use crate::{
    history::{Course, History, LevelCourse},
    verdict::LevelOutcome,
    verdict_report::{STYLE, text},
};
use playbot_report::{PAGE_STYLE, counted, escape::escape, readable};
use std::fmt::Write;

/// Most levels with a row.
const MOST_ROWS: usize = 2_000;

/// Width of a square and height of a row, units of the pictures.
const SQUARE: [usize; 2] = [9, 22];

const OWN_STYLE: &str = "\
.strip { display: block; height: 22px; max-width: 460px; }
.strip .solved { fill: var(--solved); }
.strip .bot-failed { fill: var(--failed); }
.strip .proved-unsolvable { fill: var(--unsolvable); }
.strip polyline { fill: none; stroke: var(--accent); stroke-width: 1.5; }
.levels td { white-space: normal; }
";

/// Returns the page as one file that loads nothing.
pub fn page(history: &History) -> String {
    let courses = history.courses();
    let game = history.builds.first().map_or("", |build| build.game.as_str());
    let title = format!("{} over {}", escape(game), counted(history.builds.len() as u64, "build"));
    let (first, last) = (history.builds.first(), history.builds.last());
    let subtitle = first
        .zip(last)
        .map_or_else(String::new, |(first, last)| format!("{} to {}", text(&first.build), text(&last.build)));
    let mut numbers = String::from("<dl class=\"numbers\">\n");
    for (name, words, class) in [
        ("broken", "broken", "proved-unsolvable"),
        ("flaky", "flaky", "bot-failed"),
        ("never-sound", "never sound", "bot-failed"),
        ("mended", "mended", "solved"),
        ("sound", "always sound", "solved"),
    ] {
        let count = courses.iter().filter(|course| course.course.name() == name).count();
        let _ = writeln!(numbers, "<div><dt>{words}</dt><dd class=\"{class}\">{count}</dd></div>");
    }
    numbers += "</dl>\n";
    let shown: Vec<&LevelCourse> =
        courses.iter().filter(|course| course.course != Course::Sound).take(MOST_ROWS).collect();
    let mut rows = String::new();
    for course in &shown {
        rows += &row(history, course);
    }
    let table = if shown.is_empty() {
        "<p>Every level was sound in every build.</p>\n".to_owned()
    } else {
        format!(
            "<p>A square for each build, from the oldest to the newest. Lines: median ticks of the solved episodes, and visited \
             squares.</p>\n<div class=\"levels\" role=\"region\" aria-label=\"Levels\" tabindex=\"0\"><table>\n<thead><tr><th \
             scope=\"col\">level</th><th scope=\"col\">course</th><th scope=\"col\">builds</th><th scope=\"col\">ticks</th>\
             <th scope=\"col\">visited</th><th scope=\"col\">findings</th></tr></thead>\n<tbody>\n{rows}</tbody></table></div>\n"
        )
    };
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>{title}</title>\n<style>\n{PAGE_STYLE}{STYLE}{OWN_STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n\
         <h1>{title}</h1>\n<p class=\"subtitle\">{subtitle}</p>\n</header>\n{numbers}{table}</main>\n</body>\n</html>\n"
    )
}

fn row(history: &History, course: &LevelCourse) -> String {
    let LevelCourse { level, course: what, findings, ticks, visited, outcomes, .. } = course;
    let found: Vec<String> = findings
        .iter()
        .map(|finding| {
            let until = if finding.is_there { "until now".to_owned() } else { format!("to {}", text(&finding.last)) };
            format!("{} from {} {until}", text(&finding.finding), text(&finding.first))
        })
        .collect();
    format!(
        "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>\n",
        text(level),
        text(&what.to_string()),
        strip(history, outcomes),
        line(ticks, "ticks"),
        line(visited, "% visited"),
        found.join("<br>")
    )
}

/// Draws a square for each build, in the colour of its outcome, with its name on it.
fn strip(history: &History, outcomes: &[Option<LevelOutcome>]) -> String {
    let [width, height] = SQUARE;
    let mut svg = format!(
        "<svg class=\"strip\" viewBox=\"0 0 {} {height}\" role=\"img\" aria-label=\"outcomes\">",
        outcomes.len() * width
    );
    for (place, (outcome, build)) in outcomes.iter().zip(&history.builds).enumerate() {
        let Some(outcome) = outcome else { continue };
        let name = outcome.name();
        // Readers may not see colours: what is not solved is lower.
        let top = if *outcome == LevelOutcome::Solved { 2 } else { 10 };
        let _ = write!(
            svg,
            "<rect class=\"{name}\" x=\"{}\" y=\"{top}\" width=\"{}\" height=\"{}\"><title>{}: {name}</title></rect>",
            place * width,
            width - 1,
            height - top - 2,
            escape(&build.build)
        );
    }
    svg + "</svg>"
}

/// Draws numbers over the builds as a line, with the first and the last in words.
fn line(values: &[Option<f64>], unit: &str) -> String {
    let known: Vec<f64> = values.iter().flatten().copied().filter(|value| value.is_finite()).collect();
    let (Some(first), Some(last)) = (known.first(), known.last()) else { return "–".to_owned() };
    let [width, height] = SQUARE.map(|side| side as f64);
    let (least, most) =
        known.iter().fold((f64::MAX, f64::MIN), |(least, most), value| (least.min(*value), most.max(*value)));
    let span = if most > least { most - least } else { 1.0 };
    let mut points = String::new();
    for (place, value) in values.iter().enumerate().filter_map(|(place, value)| Some((place, (*value)?))) {
        let (x, y) = (place as f64 * width, 2.0 + (height - 4.0) * (1.0 - (value - least) / span));
        let _ = write!(points, "{x:.0},{y:.1} ");
    }
    let words = if first == last { readable(*last) } else { format!("{} to {}", readable(*first), readable(*last)) };
    format!(
        "<svg class=\"strip\" viewBox=\"0 0 {:.0} {height}\" role=\"img\" aria-label=\"{unit}\"><polyline points=\"{}\"/></svg>{words}",
        width * values.len() as f64,
        points.trim_end()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::tests::thirty_builds;

    #[test]
    fn the_page_has_a_row_for_each_level_that_is_not_always_sound() {
        let (history, broken, flaky) = thirty_builds();
        let html = page(&history);
        for (level, since) in &broken {
            assert!(html.contains(&format!("<th scope=\"row\">{level}</th><td>broken since {since} ")), "{level}");
        }
        for level in &flaky {
            assert!(html.contains(&format!("<th scope=\"row\">{level}</th><td>flaky: both outcomes")), "{level}");
        }
        assert_eq!(
            html.matches("<th scope=\"row\">").count(),
            10,
            "five broken, three flaky, one mended, one never sound"
        );
        for words in ["http:", "https:", "src=\"", "href=", "<script"] {
            assert!(!html.contains(words), "{words}");
        }
        assert!(page(&History::default()).contains("Every level was sound"));
    }
}
