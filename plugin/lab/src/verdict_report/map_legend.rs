//! Legend of the pictures, and the control that switches their layers.

use crate::verdict::MapScope;

/// Legend of the marks of all pictures.
const MARKS: &str = "\
<ul class=\"legend\">
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><circle class=\"start\" cx=\"10\" cy=\"10\" r=\"7\"/></svg>start</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"goal\" d=\"M10 1l9 9l-9 9l-9-9z\"/></svg>goal</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"hazard\" d=\"M0 0h20v20h-20z\"/></svg>hazards</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"platform\" d=\"M0 0h20v20h-20z\"/></svg>crates and the \
like</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"lost\" opacity=\".7\" d=\"M0 0h20v20h-20z\"/>\
<path class=\"mark\" d=\"M5 5l10 10m0-10l-10 10\"/></svg>lost here</li>
<li><svg class=\"level\" viewBox=\"0 0 20 20\"><path class=\"late\" opacity=\".7\" d=\"M0 0h20v20h-20z\"/>\
<path class=\"mark\" d=\"M5 10h10\"/></svg>time was up here</li>
</ul>
";
/// Shown by the script; without it, pictures show the ends.
const SWITCH: &str = "\
<form id=\"maps\" class=\"filter\" hidden><fieldset><legend>Pictures show</legend>
<label><input type=\"radio\" name=\"map\" value=\"ends\" checked> ends</label>
<label><input type=\"radio\" name=\"map\" value=\"visits\"> visits</label>
<label><input type=\"radio\" name=\"map\" value=\"lost-time\"> lost time</label>
<label><input type=\"radio\" name=\"map\" value=\"skills\"> skills</label>
</fieldset></form>
";
/// Legend of the maps.
const MAPS: &str = "\
<ul class=\"legend words\">
<li><b>ends</b>: the stronger a square, the more episodes ended there</li>
<li><b>visits</b>: ticks that agents were in a square; each stronger colour means at least four times as many</li>
<li><b>lost time</b>: ticks more than two seconds after an agent last came to a square that was new in its episode, since it \
rested or went back and forth; the stronger, the more</li>
<li><b>skills</b>: the skill that was active longest in a square; the colours are named below each picture</li>
</ul>
";

/// Returns the legend of pictures, with the switch if some have maps.
pub fn map_legend(has_maps: bool) -> String {
    if has_maps { format!("{MARKS}{SWITCH}{MAPS}") } else { MARKS.to_owned() }
}

/// Returns a sentence that names the levels with maps; empty for results that are older than maps.
pub fn map_scope(scope: MapScope) -> &'static str {
    match scope {
        MapScope::None => "",
        MapScope::Failed => {
            " Maps of where agents went are kept for levels that were not solved each time or that have findings, since \
             there are many levels."
        }
        MapScope::All => " Maps of where agents went are kept for all levels.",
    }
}
