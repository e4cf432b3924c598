//! The levels of the page: the gallery, and the table with the text above it.
//!
//! The gallery has all levels as small pictures, the worst first, which the script draws as they come into view. The page
//! has these levels as JSON, and each different plan once, as [`PlanRows`]: a page of 10,000 levels stays small.

use crate::{
    verdict::{
        Finding, LevelVerdict, PinnedFindings, PlanRows, TestRecord, TesterVerdict, missing_failure, rerun_commands,
    },
    verdict_report::{
        drawn::{Drawer, Drawings, Drawn, Plans, walks},
        interval,
        picture::{map_legend, map_scope},
        selection::{FailedEpisode, Selection, SmallLevel, problems},
        text, what,
    },
};
use playbot_harness::brief::shell_word;
use playbot_report::{escape::escape, ticks, whole};
use serde::Serialize;
use std::{collections::BTreeMap, fmt::Write};

// The gallery.

/// Most bytes of all plans. Levels after that have no picture.
const MOST_BYTES: usize = 6 << 20;

/// A level as the script reads it.
#[derive(Serialize)]
struct Thumb<'a> {
    /// Its name.
    n: &'a str,
    /// The rank of its outcome: proved unsolvable, bot failed, solved.
    o: u8,
    /// Findings.
    f: usize,
    /// What is written below it.
    w: &'a str,
    /// Its plan among all; -1 without one.
    p: i64,
    /// Its pins in words, if it has some.
    #[serde(skip_serializing_if = "Option::is_none")]
    d: Option<&'a str>,
}

/// Writes the section of the page.
pub(crate) fn gallery(overview: &str, selection: &Selection, plans: &Plans) -> String {
    let levels = &selection.gallery;
    if levels.len() < 2 {
        return String::new();
    }
    let mut known: BTreeMap<String, i64> = BTreeMap::new();
    let (mut drawn, mut bytes) = (Vec::new(), 0);
    let mut thumbs = Vec::new();
    for level in levels {
        let plan = if bytes < MOST_BYTES { plans.at(level.index).map(|plan| PlanRows::of(&plan).rows) } else { None };
        let plan = plan.map_or(-1, |plan| {
            *known.entry(plan).or_insert_with_key(|plan| {
                bytes += plan.len();
                drawn.push(plan.clone());
                drawn.len() as i64 - 1
            })
        });
        let SmallLevel { title, outcome, findings, words, pin, .. } = level;
        thumbs.push(Thumb { n: title, o: *outcome, f: *findings, w: words, p: plan, d: pin.as_deref() });
    }
    let data = serde_json::json!({ "levels": thumbs, "plans": drawn });
    let mut out = format!(
        "<section id=\"gallery-section\" hidden>\n<h2 id=\"gallery-heading\">{overview}</h2>\n<p>The worst levels come first."
    );
    let left_out = selection.all.saturating_sub(levels.len() as u64);
    if left_out > 0 {
        let _ = write!(out, " {} other levels are not worse than the last one here.", whole(left_out as f64));
    }
    out += " The colour and the sign say the outcome: <b class=\"solved\">✓ solved</b>, <b class=\"bot-failed\">? unsolved, \
            nothing proved</b>, <b class=\"proved-unsolvable\">✗ proved unsolvable</b>; <b class=\"bot-failed\">!</b> marks \
            findings, whose colour a solved level has then, too. The bar of a pinned level is dashed. Grey are walls, black is the start, green \
            the goal. Arrow keys move, Enter shows a level, Escape hides it.</p>\n\
            <div id=\"gallery\" role=\"listbox\" aria-labelledby=\"gallery-heading\" tabindex=\"0\"></div>\n\
            <div id=\"chosen\" class=\"card\" role=\"region\" aria-live=\"polite\" aria-label=\"The chosen level\" hidden></div>\n</section>\n";
    // In a script, `<` could end it.
    let data = data.to_string().replace('<', "\\u003c");
    let _ = writeln!(out, "<script type=\"application/json\" id=\"gallery-data\">{data}</script>");
    out
}

// The table.

/// Shown by the script, which does the filtering.
const FILTER: &str = "\
<form id=\"filter\" class=\"filter\" hidden>
<label>Find <input type=\"search\" name=\"words\" placeholder=\"level, detector, tester\"></label>
<label>Show <select name=\"kind\"><option value=\"\">all levels</option><option value=\"findings\">with findings</option>\
<option value=\"recording\">not as recorded</option><option>proved-unsolvable</option><option>bot-failed</option>\
<option>solved</option></select></label>
<output id=\"count\" aria-live=\"polite\"></output>
</form>
";

const HEAD: &str = "\
<div class=\"levels\" role=\"region\" aria-labelledby=\"levels-heading\" tabindex=\"0\"><table id=\"levels\">
<thead><tr><th scope=\"col\">level</th><th scope=\"col\">outcome</th><th scope=\"col\">solved</th>\
<th scope=\"col\">95 % interval</th><th scope=\"col\">median ticks</th>\
<th scope=\"col\">visited</th><th scope=\"col\">found by</th></tr></thead>
";

/// Said of levels that the game does not draw.
const WITHOUT_PLANS: &str = " There are no pictures of these levels, no maps of where agents went and no squares visited: \
they need floor plans, which a game's adapter draws with <code>.plan</code> or <code>.plan_of_file</code>.";

/// Sort key of an unknown share: before all others.
const UNKNOWN: f64 = -1.0;

/// Sort key of a missing finish time: after all others.
const NEVER: f64 = 1e12;

/// Largest number of findings and testers of a level that are listed, which keeps the page fast.
const MOST_LISTED: usize = 10;

/// Writes the section of the page.
pub(crate) fn level_table(record: &TestRecord, selection: &Selection, drawings: &Drawings, program: &str) -> String {
    let plans = &drawings.plans;
    let mut rows = String::new();
    let mut drawer = Drawer::new(drawings);
    for level in &selection.levels {
        let drawn = drawer.draw(level);
        rows += &level_row(record, level, selection, program, drawn.as_ref());
    }
    let pictures = drawer.pictures;
    let mut out = String::from("<section>\n<h2 id=\"levels-heading\">Levels</h2>\n<p>The worst levels come first: ");
    out += "those proved unsolvable, then the unsolved ones, then the others; among them those with the most findings, then the \
            least solved, then the slowest, then those of which the smallest part was reached.";
    if selection.left_out > 0 {
        let left_out = whole(selection.left_out as f64);
        let _ = write!(out, " {left_out} other levels are not worse than the last one here; all are in results.json.");
    }
    if let Some(problem) = plans.problem() {
        let _ = write!(out, " There are no pictures: {}.", escape(problem));
    } else if pictures == 0 && !selection.levels.is_empty() {
        out += WITHOUT_PLANS;
    } else if selection.levels.len() > pictures {
        let _ = write!(out, " {pictures} of them have a picture here.");
    }
    if pictures > 0 || plans.problem().is_some() {
        out += map_scope(record.maps);
    }
    out += "</p>\n";
    if pictures > 0 {
        out += &map_legend(drawer.maps > 0, drawer.reached > 0);
    }
    out + FILTER + HEAD + &rows + "</table></div>\n</section>\n"
}

/// Writes the rows of a level: its numbers, and below them its details, if it has findings or a picture. `data-v` is
/// the sort key of a column, `data-k` the filter key of a level.
pub(crate) fn level_row(
    record: &TestRecord,
    level: &LevelVerdict,
    selection: &Selection,
    program: &str,
    drawn: Option<&Drawn>,
) -> String {
    let LevelVerdict { score, findings, .. } = level;
    let outcome = level.outcome.name();
    let found = if findings.is_empty() { "" } else { " findings" };
    let recorded = if level.is_regression() { " recording" } else { "" };
    let share = score.solved as f64 / score.episodes.max(1) as f64;
    let median = score.ticks.map(|ticks| ticks.median);
    let places = level.places.unwrap_or_default();
    let mut out = format!(
        "<tbody data-k=\"{outcome}{found}{recorded}\"><tr><th scope=\"row\" data-v=\"{}\">{}</th>\
         <td data-v=\"{}\" class=\"{outcome}\">{outcome}</td><td data-v=\"{share:.4}\">{} of {}</td><td data-v=\"{:.4}\">{}</td><td data-v=\"{}\">{}</td>\
         <td data-v=\"{:.1}\">{}</td><td data-v=\"{}\">{}</td></tr>\n",
        level.index,
        text(&level.title()),
        level.outcome as u8,
        score.solved,
        score.episodes,
        score.interval[0],
        interval(score.interval),
        median.unwrap_or(NEVER),
        median.map_or_else(|| "–".to_owned(), ticks),
        places.percent().unwrap_or(UNKNOWN),
        places.describe(),
        problems(level),
        detectors(level),
    );
    let pin = selection.pinned.describe_level(level).map_or_else(String::new, |pin| format!("; {}", text(&pin)));
    if !level.is_perfect() || drawn.is_some() || level.recorded_news().is_some() {
        let _ = writeln!(
            out,
            "<tr><td colspan=\"7\"><details><summary>{}{pin}</summary>\n<div class=\"card\">\n{}</div></details></td></tr>",
            what(level),
            details(record, level, selection, program, drawn)
        );
    }
    out + "</tbody>\n"
}

/// Returns the names of the detectors with findings, each once, and `recording` for one that no longer ends as it did.
fn detectors(level: &LevelVerdict) -> String {
    let mut names: Vec<&str> = level.findings.iter().map(|finding| finding.detector.as_str()).collect();
    names.extend(level.is_regression().then_some("recording"));
    names.sort_unstable();
    names.dedup();
    if names.is_empty() { "–".to_owned() } else { escape(&names.join(", ")) }
}

// Details of one level.

/// Writes the details of a level, with its picture if it has one.
pub(crate) fn details(
    record: &TestRecord,
    level: &LevelVerdict,
    selection: &Selection,
    program: &str,
    drawn: Option<&Drawn>,
) -> String {
    let mut out = String::new();
    if !level.findings.is_empty() {
        let more = level.findings.len().saturating_sub(MOST_LISTED);
        let listed: String = level.findings.iter().take(MOST_LISTED).map(|of| finding(of, &selection.pinned)).collect();
        let more = if more > 0 { format!("<li>and {more} more</li>\n") } else { String::new() };
        let _ = write!(out, "<ul class=\"findings\">\n{listed}{more}</ul>\n");
    }
    if let Some(Drawn { picture, axes, reach, clip }) = drawn {
        let clip = clip.as_ref().map_or_else(String::new, |clip| {
            format!("<button type=\"button\" class=\"clip\" data-clip=\"{clip}\" hidden>Play the failure</button>")
        });
        let _ = writeln!(out, "<figure>{picture}{clip}<figcaption class=\"key\">{axes}</figcaption></figure>");
        reach.iter().for_each(|reach| out += &format!("<p>{reach}.</p>\n"));
    }
    if let Some(news) = level.recorded_news() {
        let _ = writeln!(out, "<p>{}.</p>", text(&news));
    }
    if let Some(missing) = missing_failure(program, record, level) {
        let _ = writeln!(out, "<p>{}.</p>", text(&missing));
    }
    if let Some(kept) = selection.failures.get(&level.level) {
        out += &failure(kept, selection.pinned.describe_failure(level), program);
    }
    out += &walks(level);
    out += &testers(&level.testers);
    let commands = rerun_commands(program, record, level);
    if !commands.is_empty() {
        let _ = writeln!(out, "<pre><code>{}</code></pre>", escape(&commands.join("\n")));
    }
    out
}

/// Writes a kept failed episode with the command that replays it, from the folder of the page.
fn failure(failure: &FailedEpisode, pin: Option<String>, program: &str) -> String {
    let FailedEpisode { file, tester, end } = failure;
    let tester = tester.as_ref().map_or_else(String::new, |tester| format!(" of {}", text(tester)));
    let pin = pin.map_or_else(String::new, |pin| format!("; {}", text(&pin)));
    let command = format!("{program} replay {} --window", shell_word(file));
    format!(
        "<p>A failed episode{tester} is kept: {}{pin}.</p>\n<pre><code>{}</code></pre>\n",
        text(end),
        escape(&command)
    )
}

fn finding(finding: &Finding, pinned: &PinnedFindings) -> String {
    let tester = finding.tester.as_ref().map(|tester| escape(tester));
    let episode = finding.episode.map(|episode| format!("episode {episode}"));
    let tick = finding.tick.map(|tick| format!("tick {tick}"));
    let place: Vec<String> = [tester, episode, tick].into_iter().flatten().collect();
    let place = if place.is_empty() { String::new() } else { format!(" ({})", place.join(", ")) };
    let file = finding.file.as_ref().map_or_else(String::new, |file| format!(" <code>{}</code>", escape(file)));
    let pin = pinned.describe(finding).map_or_else(String::new, |pin| format!("; {}", text(&pin)));
    format!("<li><b>{}</b>{place}: {}{pin}{file}</li>\n", escape(&finding.detector), text(&finding.message))
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
                    [ticks.lower_quartile, ticks.median, ticks.upper_quartile].map(playbot_report::ticks);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::{MapScope, PinnedFindings},
        verdict_report::{
            drawn::Plans,
            files::PictureFiles,
            testing::{Garden, finding, level, record},
        },
    };
    use playbot_harness::foreign::ForeignGame;

    #[test]
    fn levels_of_one_plan_share_it_and_names_end_no_script() {
        let tested = record("hard:0..1", None);
        let plans = Plans::of(Some(&Garden), &tested);
        let mut nasty = level(1, 0, 9, 0);
        nasty.level = "</script><b>".to_owned();
        nasty.findings = vec![finding("panic", "no")];
        let small = [nasty, level(0, 9, 9, 40)].map(|level| SmallLevel::of(&level, &PinnedFindings::default()));
        let selection = Selection { gallery: small.to_vec(), all: 5, ..Selection::default() };
        let html = gallery("5 levels", &selection, &plans);
        let (_, data) = html.split_once("id=\"gallery-data\">").expect("data");
        let (data, _) = data.split_once("</script>").expect("its end");
        let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
        assert_eq!(data["plans"].as_array().map(Vec::len), Some(1), "{data}");
        assert_eq!((&data["levels"][0]["n"], &data["levels"][0]["w"]), (&"</script><b>".into(), &"panic".into()));
        assert_eq!((&data["levels"][1]["w"], &data["levels"][1]["p"]), (&"40 ticks".into(), &0.into()));
        assert!(html.contains(" 3 other levels are not worse"), "{html}");
        let one = Selection { gallery: small[..1].to_vec(), all: 1, ..Selection::default() };
        assert_eq!(gallery("", &one, &plans), "", "one level needs no gallery");
    }

    #[test]
    fn levels_without_plans_are_not_said_to_have_maps() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let tested = TestRecord { maps: MapScope::All, ..record("default:0..0", None) };
        let plans = Plans::Known { game: &game, range: &tested.range };
        let drawings = Drawings::new(plans, PictureFiles::default(), None, 0);
        let selection = Selection { levels: vec![level(0, 1, 2, 30)], all: 1, ..Selection::default() };
        let words = level_table(&tested, &selection, &drawings, "jump");
        assert!(words.contains(WITHOUT_PLANS) && !words.contains("are kept for all levels"), "{words}");
    }
}
