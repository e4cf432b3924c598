//! Results of a test as one HTML file: every level in a table with sorting and filtering, and pictures of the worst
//! levels.
//!
//! [`write_html`] makes `report.html` of the results in a folder. The file loads no network resources and no fonts,
//! and without its few lines of script it is a plain table. It follows the reader's light or dark setting.
//!
//! The page is a function of the results, of the results compared with, and of the game, which draws the pictures.
//! The results of a whole range and those joined from shards give the same bytes. With [`HtmlReport::split`] the pictures
//! are files beside the page.
//!
//! The files of the folder, in reading order:
//!
//! - `selection`: the levels of the page, the worst ones first.
//! - `cards`: findings as the game shows them, with the path up to each on the plan, around the tick
//!   since which something is wrong.
//! - `pairs`: changed levels, before and now.
//! - `events`: events of all levels of one size, as layers.
//! - `levels`: the gallery of all levels as small pictures, and the table of levels.
//! - `drawn`: the drawings of the levels in the table, and descriptions of walks.
//! - `picture`, `reach`, `heat`, `clip`: the plan with the ends of episodes, what was reached, maps over it, and the path
//!   of a failure.
//! - `files`: pictures in the page, or in files beside it.

mod cards;
mod clip;
mod drawn;
mod events;
mod files;
mod heat;
mod levels;
mod pairs;
mod picture;
mod reach;
mod selection;
#[cfg(test)]
pub(crate) mod testing;
#[cfg(test)]
mod tests;

use crate::{
    verdict::{
        AGAINST, Comparison, EpisodeScore, LevelVerdict, Overview, RESULTS, RecordedTotal, TestError, TestRecord,
        TesterRecord, Trials, comparable_command, wilson,
    },
    verdict_report::{
        cards::cards,
        drawn::{Drawings, MOST_PICTURES, Plans},
        events::Events,
        files::PictureFiles,
        levels::{gallery, level_table},
        pairs::pairs,
        selection::Selection,
    },
};
use playbot_harness::game::Game;
use playbot_report::{PAGE_STYLE, counted, escape::escape, whole};
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
    fmt::{Display, Write},
    path::Path,
};

pub use crate::verdict_report::{
    cards::{FindingScene, GameLogLine, SceneFilm, SceneTick, Scenes, tick_since},
    files::folder_of,
    reach::LevelExplorer,
};
pub(crate) use crate::verdict_report::{
    heat::{Grid, floor, shape, start_and_goal},
    reach::{HATCH, Reached},
};

/// Name of the file in the folder of a test.
pub const REPORT: &str = "report.html";

/// Additional style of this report, and of all pictures of levels.
pub const STYLE: &str = include_str!("verdict_report/levels.css");

/// Script that sorts and filters the table of levels.
const SCRIPT: &str = include_str!("verdict_report/levels.js");

/// Script that draws the gallery.
const GALLERY_SCRIPT: &str = include_str!("verdict_report/gallery.js");

/// Most letters of a foreign text, such as the message of a broken game.
const MOST_LETTERS: usize = 400;

/// Largest number of causes that are named.
const MOST_CAUSES: usize = 8;

/// Largest number of changes of a kind that are listed.
const MOST_CHANGES: usize = 100;

/// Makes the report of the results in a folder, and writes it to a file. Pictures beside the page are written before it, and
/// those of an earlier page that this one does not have are removed after it.
///
/// # Errors
///
/// The folder has no results, they are damaged, or a file cannot be written.
pub fn write_html(results: &Path, file: &Path, report: &HtmlReport) -> Result<(), TestError> {
    let files = if report.split { PictureFiles::beside(file) } else { PictureFiles::default() };
    let (html, files) = html_with(results, report, files)?;
    files.write(file)?;
    let written = playbot_learner::write_atomically(file, html.as_bytes());
    written.map_err(|source| TestError::Io { action: "write", path: file.to_owned(), source })?;
    files.remove_others(file)
}

/// Makes the report of the results in a folder, with its pictures.
///
/// # Errors
///
/// The folder has no results, or they are damaged.
pub fn html(results: &Path, report: &HtmlReport) -> Result<String, TestError> {
    html_with(results, report, PictureFiles::default()).map(|(html, _)| html)
}

/// Makes the page, and returns it with the pictures that it does not contain.
fn html_with(results: &Path, report: &HtmlReport, files: PictureFiles) -> Result<(String, PictureFiles), TestError> {
    let overview = Overview::read(results)?;
    let mut events = Events::new(&overview.record);
    let mut selection = Selection::read(results, &mut |level| events.add(level))?;
    let plans = Plans::of(report.game, &overview.record);
    let ticks = overview.time.map_or(0.0, |time| time.as_secs_f64() * plans.tick_hz().unwrap_or(0.0));
    let drawings = Drawings::new(plans, files, report.explorer, ticks as u64);
    let drawn: BTreeSet<u64> = selection.levels.iter().take(MOST_PICTURES).map(|level| level.index).collect();
    selection.order_by_reach(&|level| {
        // Others have no picture, for which their squares would be found out.
        let plan = if drawn.contains(&level.index) { drawings.plans.get(level)? } else { return None };
        Some(drawings.reached(level, &plan)?.share())
    });
    let pairs = match (report.comparison, report.before) {
        (Some(comparison), Some(before)) => pairs(before, results, comparison, &drawings)?,
        _ => String::new(),
    };
    let page = Page {
        overview: &overview,
        comparison: report.comparison,
        pairs: &pairs,
        events: &events,
        selection: &selection,
        drawings: &drawings,
        program: report.program,
        folder: results,
        scenes: report.scenes,
    };
    Ok((page.to_html(), drawings.files))
}

/// Returns why a report of this test has no pictures of its levels; `None` if the game can still draw them.
pub fn without_pictures(game: Option<&dyn Game>, record: &TestRecord) -> Option<String> {
    Plans::of(game, record).problem().map(str::to_owned)
}

/// Content of a report besides the results.
#[derive(Clone, Copy, Default)]
pub struct HtmlReport<'a> {
    /// The tested game, which draws its levels; without it, the page has no pictures.
    pub game: Option<&'a dyn Game>,
    /// Changes since earlier results.
    pub comparison: Option<&'a Comparison>,
    /// Folder of these earlier results; without it, the page has no pictures of changed levels.
    pub before: Option<&'a Path>,
    /// Name of the program in the commands that the report shows.
    pub program: &'a str,
    /// Draws findings as the game shows them; without it, they have the plans of their levels.
    pub scenes: Option<Scenes<'a>>,
    /// Explores the levels that are proved unsolvable; without it, pictures show where testers came.
    pub explorer: Option<LevelExplorer<'a>>,
    /// Whether [`write_html`] writes pictures into [a folder](folder_of) beside the page.
    pub split: bool,
}

/// Content of the page.
struct Page<'a> {
    /// Numbers of all levels.
    overview: &'a Overview,
    /// Changes, if there are earlier results.
    comparison: Option<&'a Comparison>,
    /// The section about changed levels.
    pairs: &'a str,
    /// Events of all levels.
    events: &'a Events,
    /// The levels of the table.
    selection: &'a Selection,
    /// Their drawings.
    drawings: &'a Drawings<'a>,
    /// Name of the program in commands.
    program: &'a str,
    /// Folder of the results.
    folder: &'a Path,
    /// Draws findings as the game shows them.
    scenes: Option<Scenes<'a>>,
}

impl Page<'_> {
    /// Returns the HTML file.
    fn to_html(&self) -> String {
        let record = &self.overview.record;
        let title = text(&format!("{} {}", record.game, record.range));
        let shard = record.shard.map_or_else(String::new, |shard| format!(", shard {shard}"));
        let subtitle = format!(
            "Version {} of the game{shard}, {} of each tester on each level, seed {}",
            record.game_version,
            counted(u64::from(record.episodes), "episode"),
            record.seed
        );
        let plans = &self.drawings.plans;
        let body = gallery(&in_short(self.overview), self.selection, plans)
            + &cards(self.selection, self.drawings, self.program, self.folder, self.scenes)
            + &numbers(self.overview)
            + &self.comparison.map_or_else(String::new, |changes| compared(changes, record, self.program))
            + self.pairs
            + &recorded(&self.overview.recorded)
            + &self.events.section(plans)
            + &level_table(record, self.selection, self.drawings, self.program);
        let patterns = match body.contains("url(#hatch)") || body.contains("class=\"unreached\"") {
            true => format!("<svg class=\"patterns\" aria-hidden=\"true\">{HATCH}</svg>\n"),
            false => String::new(),
        };
        // Where a page is a file, no word but its scheme names its folder.
        let pictures = if self.drawings.files.is_split() { "data: 'self' file:" } else { "data:" };
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; \
             script-src 'unsafe-inline'; img-src {pictures}\">\n\
             <title>{title}</title>\n<style>\n{PAGE_STYLE}{STYLE}</style>\n</head>\n<body>\n\
             {patterns}<main>\n<header>\n\
             <h1>{title}</h1>\n<p class=\"subtitle\">{subtitle}</p>\n</header>\n{body}</main>\n\
             <script>\n{SCRIPT}{GALLERY_SCRIPT}</script>\n</body>\n</html>\n"
        )
    }
}

/// Returns the outcomes of the levels in a line.
fn in_short(overview: &Overview) -> String {
    let [solved, failed, unsolvable] =
        [overview.solved, overview.bot_failed, overview.proved_unsolvable].map(|count| whole(count as f64));
    format!(
        "{}: {solved} solved, {failed} unsolved, {unsolvable} unsolvable; {}",
        counted(overview.levels, "level"),
        counted(overview.findings, "finding")
    )
}

/// Writes the outcomes of the levels, and the totals of each tester.
pub(crate) fn numbers(overview: &Overview) -> String {
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
    out += "</dl>\n";
    if let Some(levels) = overview.first_tick() {
        let _ = writeln!(out, "<p>{}.</p>", text(&levels));
    }
    if let Some(detectors) = overview.could_not_look() {
        let _ = writeln!(out, "<p>Detectors that could not look: {}.</p>", escape(&detectors));
    }
    out += "</section>\n<section>\n<h2>Testers</h2>\n<div class=\"table\" role=\"region\" \
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
    out += "</tbody></table></div>\n";
    for known in overview.record.testers.iter().filter_map(TesterRecord::describe_known) {
        let _ = writeln!(out, "<p>{}.</p>", text(&known));
    }
    out + "<p class=\"key\">Intervals are 95 % Wilson intervals.</p>\n</section>\n"
}

/// Writes the section of the page.
pub(crate) fn compared(comparison: &Comparison, record: &TestRecord, program: &str) -> String {
    let Comparison { levels, only_now, only_before, left_out, .. } = comparison;
    let [both, now, before] = [levels, only_now, only_before].map(|count| whole(*count as f64));
    let mut out = String::from("<section>\n<h2>Since the earlier results</h2>\n");
    let _ = writeln!(out, "<p>{both} levels in both, {now} only now, {before} only before.</p>");
    for why in left_out {
        let _ = writeln!(out, "<p>Left out: {}.</p>", text(why));
    }
    for why in &comparison.places_left_out {
        let _ = writeln!(out, "<p>Places not compared: {}.</p>", text(why));
    }
    if let Some(command) = comparable_command(program, record, comparison) {
        let what = "Places are compared after the same test as before:";
        let _ = writeln!(out, "<p>{what}</p>\n<pre><code>{}</code></pre>", escape(&command));
    }
    let lists = [
        list("Unsolvable", &comparison.unsolvable, AGAINST),
        list("Harder", &comparison.harder, AGAINST),
        list("New findings", &comparison.new_findings, AGAINST),
        list("Easier", &comparison.easier, AGAINST),
        list("Gone findings", &comparison.gone_findings, AGAINST),
        list("No longer reached", &comparison.unreached, AGAINST),
    ];
    if lists.iter().all(String::is_empty) {
        let _ = writeln!(out, "<p>{}</p>", comparison.no_change_sentence());
    }
    let others = list("Not comparable", &comparison.other_testers, AGAINST);
    out + &lists.concat() + &others + "</section>\n"
}

/// Writes the section about a recording; empty without one.
pub(crate) fn recorded(total: &RecordedTotal) -> String {
    let Some(words) = total.summary() else { return String::new() };
    let lists = [
        list("No longer end as recorded", &total.regressions, RESULTS),
        list("End as recorded", &total.others, RESULTS),
    ];
    format!("<section>\n<h2>Since the recording</h2>\n<p>{}.</p>\n{}</section>\n", text(&words), lists.concat())
}

/// Writes a list of changes, the first ones of many; all are in the file.
fn list(title: &str, changes: &[impl Display], file: &str) -> String {
    if changes.is_empty() {
        return String::new();
    }
    let mut out = format!("<h3>{title} ({})</h3>\n<ul>\n", changes.len());
    for change in changes.iter().take(MOST_CHANGES) {
        let _ = writeln!(out, "<li>{}</li>", text(&change.to_string()));
    }
    let more = changes.len().saturating_sub(MOST_CHANGES);
    if more > 0 {
        let _ = writeln!(out, "<li>and {more} more in {file}</li>");
    }
    out + "</ul>\n"
}

// Texts and numbers of the page.

/// Escapes text for the page; a long one is cut.
pub(crate) fn text(words: &str) -> String {
    match words.char_indices().nth(MOST_LETTERS) {
        Some((end, _)) => format!("{} …", escape(&words[..end])),
        None => escape(words),
    }
}

/// Formats a 95 % interval of a share, in percent.
pub(crate) fn interval([low, high]: [f64; 2]) -> String {
    format!("{:.1} to {:.1} %", 100.0 * low, 100.0 * high)
}

/// Formats the 95 % Wilson interval of a share, in percent.
pub(crate) fn interval_of(share: Trials) -> String {
    interval(wilson(share.successes, share.trials))
}

/// Describes the failure of a level in one line of escaped text, with what a recording does in it.
pub(crate) fn what(level: &LevelVerdict) -> String {
    let news = level.recorded_news().map_or_else(String::new, |news| format!("; {}", text(&news)));
    let Some(finding) = level.findings.first() else {
        let causes = causes(level);
        let causes = if causes.is_empty() { String::new() } else { format!(" ({causes})") };
        let stop = level.stop.as_ref().map_or_else(String::new, |stop| format!("; {}", text(&stop.to_string())));
        return format!("{}{causes}{stop}{news}", ends(&level.score));
    };
    let more = level.findings.len() - 1;
    let more = if more > 0 { format!(" (and {more} more)") } else { String::new() };
    format!("{}: {}{more}{news}", escape(&finding.detector), text(&finding.message))
}

/// Describes the ends of the episodes that were not solved.
pub(crate) fn ends(score: &EpisodeScore) -> String {
    let counts = [("lost", score.lost), ("timed out", score.timed_out), ("broken", score.broken)];
    let reported = counts.iter().filter(|(_, count)| *count > 0).map(|(what, count)| format!("{what} {count}"));
    let reported: Vec<String> = reported.collect();
    if reported.is_empty() { "solved each time".to_owned() } else { reported.join(", ") }
}

/// Describes how often each cause ended an episode, as a short escaped text.
pub(crate) fn causes(level: &LevelVerdict) -> String {
    let reported: Vec<String> =
        most_frequent(&level.causes).map(|(cause, count)| format!("{} {count}", text(cause))).collect();
    reported.join(", ")
}

/// Returns causes with their numbers of ends, the most frequent ones first.
pub(crate) fn most_frequent(causes: &BTreeMap<String, u64>) -> impl Iterator<Item = (&str, u64)> {
    let mut sorted: Vec<(&str, u64)> = causes.iter().map(|(cause, count)| (cause.as_str(), *count)).collect();
    // Equally frequent ones stay in the order of their names.
    sorted.sort_by_key(|(_, count)| Reverse(*count));
    sorted.into_iter().take(MOST_CAUSES)
}
