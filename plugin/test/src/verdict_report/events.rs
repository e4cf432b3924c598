//! Maps of events over all levels of one size: ends, lost time, squares that were not reached, and skills, by tester.
//!
//! A map is a picture with layers that the reader switches on and off, without script.

use crate::{
    explore::{CellGrid, open_cells},
    verdict::{LevelMaps, LevelVerdict, SkillTicks, TestRecord},
    verdict_report::{
        drawn::Plans,
        heat::{Grid, SKILL_COLOURS, count_layer, floor as draw_floor, shape, skill_layer, start_and_goal},
        text,
    },
};
use bevy::math::{Rect, Vec2};
use playbot_harness::floor_plan::FloorPlan;
use playbot_report::{counted, whole};
use std::{
    cmp::Reverse,
    collections::{BTreeMap, BTreeSet},
    fmt::Write,
};

/// Most maps of a page, those of the most levels.
const MOST_MAPS: usize = 6;

/// Most sizes that are counted, the first ones of the range.
const MOST_SIZES: usize = 64;

/// Testers with layers of their own. All others share one.
const MOST_TESTERS: usize = 6;

/// Levels of a size whose plans are drawn and whose unreached squares are counted, the first ones.
const MOST_PLANS: usize = 200;

/// Most squares along a side. Results have fewer.
const MOST_SIDE: u64 = 128;

/// Squares with a cross or a bar, those with the most ends.
const MOST_MARKS: usize = 40;

/// Levels that are named.
const MOST_NAMES: usize = 3;

/// Classes of the layers of each tester. A style sheet switches them by these names.
const TESTERS: [&str; MOST_TESTERS + 1] = ["t0", "t1", "t2", "t3", "t4", "t5", "t6"];

/// Counts of squares.
type Counts = BTreeMap<u64, u64>;

/// Events of all levels, by the size of their plans.
pub(crate) struct Events {
    testers: Vec<String>,
    sizes: BTreeMap<[u64; 2], SizeEvents>,
    /// Levels of further sizes.
    left_out: u64,
}

/// Events of the levels of one size.
#[derive(Default)]
struct SizeEvents {
    levels: u64,
    names: Vec<String>,
    testers: Vec<TesterSums>,
    /// Ticks of each skill in each square where it was active longest.
    skills: BTreeMap<String, Counts>,
    /// The first levels.
    visited: Vec<VisitedLevel>,
}

/// Counts of a tester over all levels.
#[derive(Clone, Default)]
struct TesterSums {
    lost: Counts,
    timed_out: Counts,
    lost_time: Counts,
}

/// Squares that any tester visited in a level.
struct VisitedLevel {
    index: u64,
    grid: CellGrid,
    squares: BTreeSet<u64>,
}

impl Events {
    /// Makes the events of a test, without levels so far.
    pub fn new(record: &TestRecord) -> Self {
        let mut testers: Vec<String> =
            record.testers.iter().take(MOST_TESTERS).map(|tester| tester.name.clone()).collect();
        if record.testers.len() > MOST_TESTERS {
            testers.push(counted((record.testers.len() - MOST_TESTERS) as u64, "other tester"));
        }
        Self { testers, sizes: BTreeMap::new(), left_out: 0 }
    }

    /// Adds a level. Older results have no events.
    pub fn add(&mut self, level: &LevelVerdict) {
        let Some(maps) = &level.maps else { return };
        let size = [maps.columns, maps.rows];
        let is_sound =
            size.iter().all(|side| (1..=MOST_SIDE).contains(side)) && maps.side.is_finite() && maps.side > 0.0;
        if !is_sound || level.testers.iter().all(|tester| tester.events.is_none()) {
            return;
        }
        if self.sizes.len() >= MOST_SIZES && !self.sizes.contains_key(&size) {
            self.left_out += 1;
            return;
        }
        let sums = self.sizes.entry(size).or_default();
        sums.levels += 1;
        if sums.names.len() < MOST_NAMES {
            sums.names.push(level.title());
        }
        sums.testers.resize_with(self.testers.len(), TesterSums::default);
        let squares = maps.columns * maps.rows;
        let count = |counts: &mut Counts, square: u64, more: u64| {
            if square < squares && more > 0 {
                let sum = counts.entry(square).or_default();
                *sum = sum.saturating_add(more);
            }
        };
        let mut visited = BTreeSet::new();
        for (number, events) in
            level.testers.iter().enumerate().filter_map(|(number, it)| Some((number, it.events.as_ref()?)))
        {
            let Some(tester) = sums.testers.get_mut(number.min(MOST_TESTERS)) else { continue };
            for [square, lost, timed_out] in &events.ends {
                count(&mut tester.lost, *square, *lost);
                count(&mut tester.timed_out, *square, *timed_out);
            }
            events.lost.iter().for_each(|[square, ticks]| count(&mut tester.lost_time, *square, *ticks));
            for [first, run] in &events.visited {
                visited.extend(*first..first.saturating_add(*run).min(squares));
            }
        }
        let ticks: Counts = maps.visits.iter().map(|[square, ticks]| (*square, *ticks)).collect();
        for [square, skill] in &maps.skill_at {
            let Some(skill) = usize::try_from(*skill).ok().and_then(|skill| maps.skills.get(skill)) else { continue };
            let active = ticks.get(square).copied().unwrap_or(1);
            count(sums.skills.entry(skill.skill.clone()).or_default(), *square, active);
        }
        if sums.visited.len() < MOST_PLANS {
            let grid = CellGrid { origin: Vec2::new(maps.x, maps.y), size: maps.side };
            sums.visited.push(VisitedLevel { index: level.index, grid, squares: visited });
        }
    }

    /// Writes the section of the page; empty without events.
    pub fn section(&self, plans: &Plans) -> String {
        let mut sizes: Vec<(&[u64; 2], &SizeEvents)> = self.sizes.iter().collect();
        // Of equally many levels the smaller ones come first.
        sizes.sort_by_key(|(_, sums)| Reverse(sums.levels));
        let shown: Vec<String> = sizes
            .iter()
            .filter_map(|(size, sums)| Some((*size, *sums, sums.maps(**size, plans)?)))
            .take(MOST_MAPS)
            .enumerate()
            .map(|(number, (size, sums, drawn))| self.map(number, *size, sums, &drawn))
            .collect();
        if shown.is_empty() {
            return String::new();
        }
        let mut out = String::from(
            "<section>\n<h2>Events</h2>\n<p>Ends of episodes without the goal, lost time, and squares that were not reached, \
             of all levels of one size together. The stronger a square, the more; all testers have one scale.",
        );
        let others =
            sizes.iter().skip(shown.len()).map(|(_, sums)| sums.levels).sum::<u64>().saturating_add(self.left_out);
        if others > 0 {
            let _ = write!(out, " {} of other sizes have no map here.", counted(others, "level"));
        }
        out + "</p>\n" + &shown.concat() + "</section>\n"
    }

    /// Writes the map of a size. The first one is open.
    fn map(&self, number: usize, [columns, rows]: [u64; 2], sums: &SizeEvents, drawn: &DrawnEvents) -> String {
        let open = if number == 0 { " open" } else { "" };
        let more = sums.levels.saturating_sub(sums.names.len() as u64);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        let names: Vec<String> = sums.names.iter().map(|name| text(name)).collect();
        let mut out = format!(
            "<details class=\"events\"{open}><summary>{} of {columns} × {rows} squares: {}{more}</summary>\n",
            counted(sums.levels, "level"),
            names.join(", ")
        );
        out += "<fieldset><legend>Layers</legend>\n";
        let total = |of: fn(&TesterSums) -> &Counts| {
            sums.testers.iter().map(|tester| sum(of(tester))).fold(0, u64::saturating_add)
        };
        let [lost, timed_out, lost_time] = [total(|it| &it.lost), total(|it| &it.timed_out), total(|it| &it.lost_time)]
            .map(|count| whole(count as f64));
        let missed = match sums.visited.len() as u64 {
            looked if looked < sums.levels => format!("not reached by any tester, in the first {looked} levels"),
            _ => "not reached by any tester".to_owned(),
        };
        let mut layer = |value: &str, colour: &str, is_on: bool, words: &str| {
            let checked = if is_on { " checked" } else { "" };
            let _ = writeln!(
                out,
                "<label><input type=\"checkbox\" value=\"{value}\"{checked}> <svg class=\"swatch level\" viewBox=\"0 0 20 20\">\
                 <path class=\"{colour}\" d=\"M0 0h20v20h-20z\"/></svg>{words}</label>"
            );
        };
        layer("missed", "unreached", true, &format!("{missed} ({})", drawn.missed));
        layer("time", "waste", true, &format!("lost time ({lost_time} ticks)"));
        layer("lost", "lost", true, &format!("× lost here ({lost})"));
        layer("late", "late", true, &format!("– time was up here ({timed_out})"));
        if !sums.skills.is_empty() {
            layer("skills", "skill0", false, "skills");
        }
        out += "</fieldset>\n";
        if self.testers.len() > 1 {
            out += "<fieldset><legend>Testers</legend>\n";
            for (class, name) in TESTERS.iter().zip(&self.testers) {
                let _ =
                    writeln!(out, "<label><input type=\"checkbox\" value=\"{class}\" checked> {}</label>", text(name));
            }
            out += "</fieldset>\n";
        }
        let _ = writeln!(out, "<figure class=\"all\">{}</figure>", drawn.svg);
        if !drawn.skills.is_empty() {
            let _ = writeln!(out, "<p>Skills: {}.</p>", drawn.skills);
        }
        out + &self.table(sums) + "</details>\n"
    }

    /// Writes the counts of each tester as a table.
    fn table(&self, sums: &SizeEvents) -> String {
        let mut out = String::from(
            "<div class=\"table\" role=\"group\" aria-label=\"Events of each tester\" tabindex=\"0\"><table class=\"testers\">\
             <thead><tr><th scope=\"col\">tester</th><th scope=\"col\">lost</th><th scope=\"col\">time was up</th>\
             <th scope=\"col\">lost time (ticks)</th></tr></thead><tbody>\n",
        );
        for (name, tester) in self.testers.iter().zip(&sums.testers) {
            let [lost, timed_out, time] =
                [&tester.lost, &tester.timed_out, &tester.lost_time].map(|counts| whole(sum(counts) as f64));
            let _ = writeln!(
                out,
                "<tr><th scope=\"row\">{}</th><td>{lost}</td><td>{timed_out}</td><td>{time}</td></tr>",
                text(name)
            );
        }
        out + "</tbody></table></div>\n"
    }
}

fn sum(counts: &Counts) -> u64 {
    counts.values().fold(0, |sum, count| sum.saturating_add(*count))
}

// Drawing of a map.

/// A map as it is drawn.
struct DrawnEvents {
    svg: String,
    /// Squares that were not reached, in words.
    missed: String,
    /// Names of skills with their colours.
    skills: String,
}

impl SizeEvents {
    /// Draws the map; `None` if the plan of none of its levels is known.
    fn maps(&self, [columns, rows]: [u64; 2], plans: &Plans) -> Option<DrawnEvents> {
        let known: Vec<(&VisitedLevel, FloorPlan)> =
            self.visited.iter().filter_map(|level| Some((level, plans.at(level.index)?))).collect();
        if known.is_empty() {
            return None;
        }
        let maps = LevelMaps { side: 1.0, columns, rows, ..LevelMaps::default() };
        let grid = Grid::new(Rect::new(0.0, 0.0, columns as f32, rows as f32))?;
        let [width, height] = grid.size();
        let label = format!("events in {}", counted(self.levels, "level"));
        let mut svg =
            format!("<svg class=\"level\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{label}\">");
        let missed = missed(&known, &maps);
        let pairs = |counts: &Counts| counts.iter().map(|(square, count)| [*square, *count]).collect::<Vec<[u64; 2]>>();
        // The strongest colour is that of all levels whose plans are known.
        let most = [[0, known.len() as u64]];
        let missed_pairs = pairs(&missed);
        svg += &count_layer(["layer-missed", "unreached"], &grid, &maps, &missed_pairs, &[&missed_pairs, &most]);
        let start_and_goal = floor(&known, &maps, &grid, &mut svg);
        let of =
            |of: fn(&TesterSums) -> &Counts| self.testers.iter().map(|tester| pairs(of(tester))).collect::<Vec<_>>();
        for (layer, colour, counts) in [
            ("layer-time", "waste", of(|it| &it.lost_time)),
            ("layer-late", "late", of(|it| &it.timed_out)),
            ("layer-lost", "lost", of(|it| &it.lost)),
        ] {
            let all: Vec<&[[u64; 2]]> = counts.iter().map(Vec::as_slice).collect();
            for (tester, own) in TESTERS.iter().zip(&counts).filter(|(_, own)| !own.is_empty()) {
                let _ = write!(svg, "<g class=\"{tester}\"><g class=\"{layer}\">");
                svg += &count_layer(["counts", colour], &grid, &maps, own, &all);
                if colour != "waste" {
                    marks(own, &maps, &grid, colour == "lost", &mut svg);
                }
                svg += "</g></g>";
            }
        }
        let (skills, names) = self.skills(&maps, &grid);
        svg += &skills;
        svg += &start_and_goal;
        svg += "</svg>";
        let squares = counted(missed.len() as u64, "square");
        Some(DrawnEvents { svg, missed: squares, skills: names })
    }

    /// Draws the skill that was active longest in each square, and names the colours.
    fn skills(&self, maps: &LevelMaps, grid: &Grid) -> (String, String) {
        if self.skills.is_empty() {
            return (String::new(), String::new());
        }
        let mut ranked: Vec<(&String, &Counts)> = self.skills.iter().collect();
        ranked.sort_by_key(|(_, counts)| Reverse(sum(counts)));
        let mut longest: BTreeMap<u64, (u64, u64)> = BTreeMap::new();
        for (rank, (_, counts)) in (0_u64..).zip(&ranked) {
            for (square, ticks) in *counts {
                let known = longest.entry(*square).or_insert((*ticks, rank));
                if *ticks > known.0 {
                    *known = (*ticks, rank);
                }
            }
        }
        let skills = ranked.iter().map(|(name, counts)| SkillTicks { skill: (*name).clone(), ticks: sum(counts) });
        let maps = LevelMaps {
            skills: skills.collect(),
            visits: longest.iter().map(|(square, (ticks, _))| [*square, *ticks]).collect(),
            skill_at: longest.iter().map(|(square, (_, rank))| [*square, *rank]).collect(),
            ..maps.clone()
        };
        let named = ranked.iter().take(SKILL_COLOURS).enumerate().map(|(rank, (name, _))| {
            format!(
                "<svg class=\"swatch level\" viewBox=\"0 0 20 20\"><path class=\"skill{rank}\" d=\"M0 0h20v20h-20z\"/></svg>{}",
                text(name)
            )
        });
        (skill_layer("skills layer-skills", grid, &maps), named.collect::<Vec<_>>().join(", "))
    }
}

/// Returns in how many levels each open square was not visited by any tester.
fn missed(known: &[(&VisitedLevel, FloorPlan)], maps: &LevelMaps) -> Counts {
    let mut missed = Counts::new();
    for (level, plan) in known {
        let open = open_cells(plan, &level.grid).unwrap_or_default();
        let squares = open.iter().filter_map(|cell| {
            let &[column, row] = cell.0.as_slice() else { return None };
            let (column, row) = (u64::try_from(column).ok()?, u64::try_from(row).ok()?);
            (column < maps.columns && row < maps.rows).then_some(row * maps.columns + column)
        });
        for square in squares.filter(|square| !level.squares.contains(square)) {
            *missed.entry(square).or_default() += 1;
        }
    }
    missed
}

/// Draws the floor: the plan itself if all levels have the same, or else walls that are stronger where more levels have
/// them. Returns start and goal, which lie above all else, if they are common.
fn floor(known: &[(&VisitedLevel, FloorPlan)], maps: &LevelMaps, grid: &Grid, svg: &mut String) -> String {
    let in_squares = |level: &VisitedLevel, area: &Rect| {
        let place = |at: Vec2| (at - level.grid.origin) / level.grid.size;
        let area = Rect::from_corners(place(area.min), place(area.max));
        (area.min.is_finite() && area.max.is_finite()).then_some(area)
    };
    let Some((first, plan)) = known.first() else { return String::new() };
    if known.iter().any(|(_, other)| other != plan) {
        let mut walls = Counts::new();
        for (level, plan) in known {
            let mut own = BTreeSet::new();
            for area in plan.walls.iter().filter_map(|area| in_squares(level, area)) {
                // The squares with their middle in the wall.
                let first = (area.min - 0.5).ceil().max(Vec2::ZERO);
                let last = (area.max - 0.5).floor().min(Vec2::new(maps.columns as f32, maps.rows as f32) - 1.0);
                if last.cmplt(Vec2::ZERO).any() {
                    continue;
                }
                for row in first.y as u64..=last.y as u64 {
                    own.extend((first.x as u64..=last.x as u64).map(|column| row * maps.columns + column));
                }
            }
            own.into_iter().for_each(|square| *walls.entry(square).or_default() += 1);
        }
        let walls: Vec<[u64; 2]> = walls.into_iter().map(|(square, count)| [square, count]).collect();
        *svg += &count_layer(["walls", "wall"], grid, maps, &walls, &[&[[0, known.len() as u64]], &walls]);
        return String::new();
    }
    let place = |at: Vec2| (at - first.grid.origin) / first.grid.size;
    let areas = |areas: &[Rect]| areas.iter().filter_map(|area| in_squares(first, area)).collect();
    let plan = FloorPlan {
        walls: areas(&plan.walls),
        platforms: areas(&plan.platforms),
        hazards: areas(&plan.hazards),
        start: place(plan.start),
        goal: place(plan.goal),
        ..FloorPlan::default()
    };
    draw_floor(&plan, grid, svg);
    let mut marks = String::new();
    start_and_goal(&plan, grid, &mut marks);
    marks
}

/// Draws a cross on squares with losses, a bar on those with time-outs: readers may not see colours.
fn marks(counts: &[[u64; 2]], maps: &LevelMaps, grid: &Grid, is_cross: bool, svg: &mut String) {
    let mut most: Vec<[u64; 2]> = counts.to_vec();
    most.sort_by_key(|[_, count]| Reverse(*count));
    let mut lines = String::new();
    for [square, _] in most.iter().take(MOST_MARKS) {
        let middle = Vec2::new((square % maps.columns) as f32, (square / maps.columns) as f32) + 0.5;
        let Some([x, y]) = grid.place(middle) else { continue };
        let _ = match is_cross {
            true => write!(lines, "M{} {}l10 10m0-10l-10 10", x - 5, y - 5),
            false => write!(lines, "M{} {y}h10", x - 5),
        };
    }
    shape("mark", None, &lines, svg);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::{TesterEvents, TesterRecord},
        verdict_report::{
            STYLE,
            testing::{Garden, level, record},
        },
    };

    /// Makes a level of the garden that each of these testers has played.
    fn played(index: u64, testers: &[TesterEvents]) -> LevelVerdict {
        let mut played = level(index, 0, 2, 0);
        let base = played.testers[0].clone();
        played.testers = testers
            .iter()
            .map(|events| crate::verdict::TesterVerdict { events: Some(events.clone()), ..base.clone() })
            .collect();
        played.maps = Some(LevelMaps { side: 1.0, columns: 64, rows: 16, ..LevelMaps::default() });
        played
    }

    fn events(ends: &[[u64; 3]], lost: &[[u64; 2]], visited: &[[u64; 2]]) -> TesterEvents {
        TesterEvents { ends: ends.to_vec(), lost: lost.to_vec(), visited: visited.to_vec() }
    }

    fn section(names: &[&str], levels: &[LevelVerdict]) -> String {
        let testers = names.iter().map(|name| TesterRecord::bot(*name)).collect();
        let tested = TestRecord { testers, ..record("hard:0..999", None) };
        let mut all = Events::new(&tested);
        levels.iter().for_each(|level| all.add(level));
        all.section(&Plans::of(Some(&Garden), &tested))
    }

    #[test]
    fn events_of_all_levels_are_added_up_by_tester() {
        let one = events(&[[70, 2, 0], [71, 0, 1]], &[[66, 40]], &[[64, 64]]);
        let other = events(&[[70, 4, 0]], &[], &[[128, 64]]);
        let html = section(&["search", "<i>"], &[played(0, &[one.clone(), other.clone()]), played(1, &[one, other])]);
        for part in [
            "<details class=\"events\" open><summary>2 levels of 64 × 16 squares: hard:0, hard:1</summary>",
            // Losses of both testers have one scale: 4 of 8 are the second of four strengths.
            "<g class=\"t0\"><g class=\"layer-lost\"><g class=\"counts\"><path class=\"lost\" opacity=\".45\" d=\"M60 140h10v10h-10z\"/></g>",
            "<g class=\"t1\"><g class=\"layer-lost\"><g class=\"counts\"><path class=\"lost\" opacity=\".85\" d=\"M60 140h10v10h-10z\"/></g>",
            "<path class=\"late\" opacity=\".85\" d=\"M70 140h10v10h-10z\"/></g><path class=\"mark\" d=\"M70 145h10\"/>",
            "<path class=\"waste\" opacity=\".85\" d=\"M20 140h10v10h-10z\"/>",
            "value=\"lost\" checked> <svg",
            "× lost here (12)",
            "lost time (80 ticks)",
            "<input type=\"checkbox\" value=\"t1\" checked> &lt;i&gt;</label>",
            "<tr><th scope=\"row\">search</th><td>4</td><td>2</td><td>80</td></tr>",
            "<circle class=\"start\"",
        ] {
            assert!(html.contains(part), "{part} in {html}");
        }
        assert!(!html.contains("layer-skills") && !html.contains("<i>"), "{html}");
        // Rows 1 and 2 of the garden were visited: of the 13 rows above 200 squares have a bush.
        let missed = html.split("layer-missed").nth(1).and_then(|rest| rest.split("</g>").next()).expect("a layer");
        assert!(missed.contains("opacity=\".85\"") && !missed.contains("opacity=\".25\""), "{missed}");
        assert!(html.contains("not reached by any tester (632 squares)"), "{html}");
    }

    #[test]
    fn every_layer_has_its_switch_in_the_style_sheet() {
        for layer in ["missed", "time", "lost", "late", "skills"] {
            let rule = format!(".events:has(input[value=\"{layer}\"]:not(:checked)) .layer-{layer}");
            assert!(STYLE.contains(&rule), "{rule}");
        }
        for tester in TESTERS {
            let rule = format!(".events:has(input[value=\"{tester}\"]:not(:checked)) .{tester}");
            assert!(STYLE.contains(&rule), "{rule}");
        }
    }

    #[test]
    fn skills_are_a_layer_that_is_off_at_first() {
        let mut skilled = played(0, &[events(&[], &[], &[[0, 9]])]);
        if let Some(maps) = &mut skilled.maps {
            maps.skills = ["z1+", "<b>"].map(|name| SkillTicks { skill: name.to_owned(), ticks: 9 }).to_vec();
            (maps.visits, maps.skill_at) = (vec![[65, 7], [66, 90]], vec![[65, 0], [66, 1], [67, 9]]);
        }
        let html = section(&["search"], &[skilled]);
        assert!(html.contains("<input type=\"checkbox\" value=\"skills\"> <svg"), "{html}");
        assert!(
            html.contains("<g class=\"skills layer-skills\"><path class=\"skill0\" d=\"M20 140h10v10h-10z\">"),
            "{html}"
        );
        assert!(html.contains("<p>Skills: <svg") && html.contains("</svg>&lt;b&gt;, <svg") && !html.contains("<b>"));
        assert!(!html.contains("<legend>Testers"), "one tester needs no switch: {html}");
    }

    #[test]
    fn many_testers_sizes_and_levels_stay_few() {
        let tester = || events(&[[70, 1, 0]], &[[66, 1]], &[[0, 1024]]);
        let names = ["a", "b", "c", "d", "e", "f", "g", "h"];
        let all: Vec<TesterEvents> = names.iter().map(|_| tester()).collect();
        let html = section(&names, &[played(0, &all)]);
        assert!(html.contains("value=\"t6\" checked> 2 other testers</label>"), "{html}");
        assert!(html.contains("<tr><th scope=\"row\">2 other testers</th><td>2</td>"), "{html}");
        let of_size = |index: u64| {
            let mut level = played(index, &[tester()]);
            level.maps.iter_mut().for_each(|maps| maps.columns = 64 - index % 64);
            level
        };
        let html = section(&["a"], &(0..70).map(of_size).collect::<Vec<_>>());
        assert_eq!(html.matches("<details class=\"events\"").count(), MOST_MAPS);
        assert!(html.contains("58 levels of other sizes have no map here."), "12 are shown: {html}");
        assert_eq!(html.matches(" open>").count(), 1);
        let many: Vec<LevelVerdict> = (0..500).map(|index| played(index, &[tester()])).collect();
        let html = section(&["a"], &many);
        assert!(html.contains("in the first 200 levels") && html.contains("hard:2 and 497 more"), "{html}");
    }

    #[test]
    fn a_full_map_is_short() {
        let often = |square: u64| 1 + square * square * 7919 % 997;
        let full = TesterEvents {
            ends: (0..1024).map(|square| [square, often(square), often(square + 1)]).collect(),
            lost: (0..1024).map(|square| [square, often(square + 2)]).collect(),
            visited: (0..512).map(|square| [2 * square, 1]).collect(),
        };
        let html = section(&["a", "b", "c", "d", "e", "f", "g"], &[played(0, &vec![full; 7])]);
        assert!(html.len() < 80_000 && html.contains("class=\"t6\""), "{} bytes", html.len());
    }

    #[test]
    fn levels_without_events_or_with_odd_maps_are_left_out() {
        let sound = || played(0, &[events(&[], &[], &[])]);
        assert!(section(&["a"], &[sound()]).contains("1 level of 64 × 16 squares"));
        let with = |change: fn(&mut LevelMaps)| {
            let mut level = sound();
            level.maps.iter_mut().for_each(change);
            level
        };
        let mut older = sound();
        older.testers[0].events = None;
        for level in [
            older,
            level(0, 0, 2, 0),
            with(|maps| maps.columns = 0),
            with(|maps| maps.rows = u64::MAX),
            with(|maps| maps.side = f32::NAN),
        ] {
            assert_eq!(section(&["a"], &[level]), "");
        }
        let odd = events(&[[u64::MAX, 1, 1]], &[[1024, 9]], &[[u64::MAX, u64::MAX], [3, u64::MAX]]);
        let html = section(&["a"], &[played(0, &[odd])]);
        assert!(html.contains("× lost here (0)") && html.contains("lost time (0 ticks)"), "{html}");
        let other = TestRecord { game_version: 7, ..record("hard:0..9", None) };
        let mut all = Events::new(&other);
        all.add(&sound());
        assert_eq!(all.section(&Plans::of(Some(&Garden), &other)), "", "its plans are unknown");
    }
}
