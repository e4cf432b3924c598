//! The table of levels, with what is said above it.

use std::fmt::Write;

use super::{level_row::level_row, picture::picture, plans::Plans, selection::Selection};
use crate::{escape::escape, report::whole, verdict::TestRecord};

/// Levels that have a picture, the worst ones.
const MOST_PICTURES: usize = 200;
/// What the marks of the pictures are.
const LEGEND: &str = "\
<ul class=\"legend\">
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><circle class=\"start\" cx=\"10\" cy=\"10\" r=\"7\"/></svg>start</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"goal\" d=\"M10 1l9 9l-9 9l-9-9z\"/></svg>goal</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"lost\" opacity=\".7\" d=\"M0 0h20v20h-20z\"/>\
<path class=\"mark\" d=\"M5 5l10 10m0-10l-10 10\"/></svg>lost here</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"late\" opacity=\".7\" d=\"M0 0h20v20h-20z\"/>\
<path class=\"mark\" d=\"M5 10h10\"/></svg>time was up here</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"hazard\" d=\"M0 0h20v20h-20z\"/></svg>what kills</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"platform\" d=\"M0 0h20v20h-20z\"/></svg>crates and the \
like</li>
</ul>
";
/// Shown by the script: without it nothing could be filtered.
const FILTER: &str = "\
<form id=\"filter\" class=\"filter\" hidden>
<label>Find <input type=\"search\" name=\"words\" placeholder=\"level, detector, tester\"></label>
<label>Show <select name=\"kind\"><option value=\"\">all levels</option><option value=\"findings\">with findings</option>\
<option>proved-unsolvable</option><option>bot-failed</option><option>solved</option></select></label>
<output id=\"count\" aria-live=\"polite\"></output>
</form>
";
const HEAD: &str = "\
<div class=\"levels\" role=\"region\" aria-labelledby=\"levels-heading\" tabindex=\"0\"><table id=\"levels\">
<thead><tr><th scope=\"col\">level</th><th scope=\"col\">outcome</th><th scope=\"col\">solved</th>\
<th scope=\"col\">95 % interval</th><th scope=\"col\">median ticks</th><th scope=\"col\">found by</th></tr></thead>
";

/// The section of the page.
pub fn level_table(record: &TestRecord, selection: &Selection, plans: &Plans, program: &str) -> String {
    let mut rows = String::new();
    let mut pictures = 0;
    for (place, level) in selection.levels.iter().enumerate() {
        let plan = if place < MOST_PICTURES { plans.get(level) } else { None };
        let picture = plan.and_then(|plan| picture(&plan, level));
        pictures += usize::from(picture.is_some());
        rows += &level_row(record, level, program, picture.as_deref());
    }
    let mut out = String::from("<section>\n<h2 id=\"levels-heading\">Levels</h2>\n<p>The worst ones come first: ");
    out += "those of which most was found, then those that were solved least often, then the slowest.";
    if selection.left_out > 0 {
        let left_out = whole(selection.left_out as f64);
        let _ = write!(out, " {left_out} others are no worse than the last one here; all are in results.json.");
    }
    if let Some(problem) = plans.problem() {
        let _ = write!(out, " There are no pictures: {}.", escape(problem));
    } else if pictures == 0 {
        out += " There are no pictures of these levels.";
    } else if selection.levels.len() > pictures {
        let _ = write!(out, " {pictures} of them have a picture.");
    }
    out += "</p>\n";
    if pictures > 0 {
        out += LEGEND;
    }
    out + FILTER + HEAD + &rows + "</table></div>\n</section>\n"
}
