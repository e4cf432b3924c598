//! The table of levels, with the text above it.

use std::fmt::Write;

use super::{
    drawn::Drawer,
    level_row::level_row,
    map_legend::{map_legend, map_scope},
    plans::Plans,
    selection::Selection,
};
use crate::{escape::escape, report::whole, verdict::TestRecord};

/// Shown by the script, which does the filtering.
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
<th scope=\"col\">95 % interval</th><th scope=\"col\">median ticks</th>\
<th scope=\"col\">visited</th><th scope=\"col\">found by</th></tr></thead>
";

/// Writes the section of the page.
pub fn level_table(record: &TestRecord, selection: &Selection, plans: &Plans, program: &str) -> String {
    let mut rows = String::new();
    let mut drawer = Drawer::new(plans);
    for level in &selection.levels {
        let drawn = drawer.draw(level);
        rows += &level_row(record, level, program, drawn.as_ref());
    }
    let pictures = drawer.pictures;
    let mut out = String::from("<section>\n<h2 id=\"levels-heading\">Levels</h2>\n<p>The worst levels come first: ");
    out += "most findings first, then the least solved, then the slowest.";
    if selection.left_out > 0 {
        let left_out = whole(selection.left_out as f64);
        let _ = write!(out, " {left_out} other levels are not worse than the last one here; all are in results.json.");
    }
    if let Some(problem) = plans.problem() {
        let _ = write!(out, " There are no pictures: {}.", escape(problem));
    } else if pictures == 0 {
        out += " There are no pictures of these levels.";
    } else if selection.levels.len() > pictures {
        let _ = write!(out, " {pictures} of them have a picture.");
    }
    out += map_scope(record.maps);
    out += "</p>\n";
    if pictures > 0 {
        out += &map_legend(drawer.maps > 0);
    }
    out + FILTER + HEAD + &rows + "</table></div>\n</section>\n"
}
