//! The gallery: all levels as small pictures, the worst first, which the script draws as they come into view.
//!
//! The page has the levels as JSON, and each different plan once, as [`PlanRows`]: a page of 10,000 levels stays small.

use crate::{
    verdict::PlanRows,
    verdict_report::{
        drawn::Plans,
        selection::{Selection, SmallLevel},
    },
};
use playbot_report::whole;
use serde::Serialize;
use std::{collections::BTreeMap, fmt::Write};

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::PinnedFindings,
        verdict_report::testing::{Garden, finding, level, record},
    };

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
}
