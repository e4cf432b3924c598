//! The page of a history: each level with a square for each build, those that are always sound in a fold.

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
        ("other-testers", "not comparable", "bot-failed"),
        ("never-sound", "never sound", "bot-failed"),
        ("mended", "mended", "solved"),
        ("sound", "always sound", "solved"),
    ] {
        let count = courses.iter().filter(|course| course.course.name() == name).count();
        let _ = writeln!(numbers, "<div><dt>{words}</dt><dd class=\"{class}\">{count}</dd></div>");
    }
    numbers += "</dl>\n";
    for change in history.changes_of_testers() {
        let _ = writeln!(numbers, "<p>The testers changed in {}.</p>", text(&change));
    }
    let (sound, unsound): (Vec<&LevelCourse>, Vec<&LevelCourse>) =
        courses.iter().partition(|course| course.course == Course::Sound);
    let mut tables = if unsound.is_empty() {
        "<p>Every level was sound in every build.</p>\n".to_owned()
    } else {
        format!("<p>{KEY}</p>\n{}", table(history, &unsound))
    };
    if !sound.is_empty() {
        let key = if unsound.is_empty() { format!("<p>{KEY}</p>\n") } else { String::new() };
        let count = counted(sound.len() as u64, "level");
        let table = table(history, &sound);
        let _ = writeln!(tables, "<details><summary>{count} always sound</summary>\n{key}{table}</details>");
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\n\
         <title>{title}</title>\n<style>\n{PAGE_STYLE}{STYLE}{OWN_STYLE}</style>\n</head>\n<body>\n<main>\n<header>\n\
         <h1>{title}</h1>\n<p class=\"subtitle\">{subtitle}</p>\n</header>\n{numbers}{tables}</main>\n</body>\n</html>\n"
    )
}

/// Explains a table.
const KEY: &str = "A square for each build, from the oldest to the newest. Lines: median ticks of the solved episodes, and visited \
                   squares. Solved by: testers, in the last build with the level.";

/// Writes the first of these levels as a table.
fn table(history: &History, courses: &[&LevelCourse]) -> String {
    let rows: String = courses.iter().take(MOST_ROWS).map(|course| row(history, course)).collect();
    let more = courses.len().saturating_sub(MOST_ROWS);
    let more = if more > 0 { format!("<p>And {}.</p>\n", counted(more as u64, "other level")) } else { String::new() };
    format!(
        "<div class=\"levels\" role=\"region\" aria-label=\"Levels\" tabindex=\"0\"><table>\n<thead><tr><th \
         scope=\"col\">level</th><th scope=\"col\">course</th><th scope=\"col\">builds</th><th scope=\"col\">ticks</th>\
         <th scope=\"col\">visited</th><th scope=\"col\">solved by</th><th scope=\"col\">findings</th></tr></thead>\n\
         <tbody>\n{rows}</tbody></table></div>\n{more}"
    )
}

fn row(history: &History, course: &LevelCourse) -> String {
    let LevelCourse { level, course: what, findings, ticks, visited, outcomes, solved_by } = course;
    let found: Vec<String> = findings
        .iter()
        .map(|finding| {
            let until = if finding.is_there { "until now".to_owned() } else { format!("to {}", text(&finding.last)) };
            format!("{} from {} {until}", text(&finding.finding), text(&finding.first))
        })
        .collect();
    let solved_by = if solved_by.is_empty() { "–".to_owned() } else { text(&solved_by.join(", ")) };
    format!(
        "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{solved_by}</td><td>{}</td></tr>\n",
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
    fn the_page_has_a_row_for_each_level_and_those_that_are_always_sound_are_in_a_fold() {
        let (history, broken, flaky) = thirty_builds();
        let html = page(&history);
        let (html, fold) = html.split_once("<details><summary>30 levels always sound</summary>").expect("a fold");
        assert_eq!(fold.matches("<th scope=\"row\">").count(), 30);
        assert_eq!(fold.matches("<rect ").count(), 30 * history.builds.len(), "a square for each level and build");
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
        let row = |level: &str| {
            let (_, row) = html.split_once(&format!("<th scope=\"row\">{level}</th>")).expect("its row");
            row.split_once("</tr>").expect("its end").0.to_owned()
        };
        assert!(row("hard:12").contains("<td>search</td>"), "{}", row("hard:12"));
        assert!(row("hard:39").contains("<td>–</td>") && !row("hard:39").contains("search"), "{}", row("hard:39"));
        for words in ["http:", "https:", "src=\"", "href=", "<script"] {
            assert!(!html.contains(words), "{words}");
        }
        assert!(page(&History::default()).contains("Every level was sound"));
        let mut other = history;
        other.builds.truncate(2);
        other.builds[1].testers = vec!["<jump>".to_owned()];
        let html = page(&other);
        let words =
            "<p>The testers changed in b00-again: no longer tested by search, newly tested by &lt;jump&gt;.</p>";
        assert!(html.contains(words), "{html}");
    }
}
