//! Walks of agents and causes of ends, described.

use std::{cmp::Reverse, fmt::Write};

use super::{
    heat::SKILL_COLOURS,
    words::{most_frequent, text},
};
use crate::{
    report::readable,
    verdict::{LevelVerdict, SkillTicks},
};

/// Largest number of positions that are named for a cause.
const MOST_PLACES: usize = 3;
/// Largest number of testers that are named.
const MOST_TESTERS: usize = 8;

/// Describes the walks in a level; empty without walks.
pub fn walks(level: &LevelVerdict) -> String {
    let mut out = String::new();
    if !level.causes.is_empty() {
        let told: Vec<String> =
            most_frequent(&level.causes).map(|(cause, count)| cause_line(level, cause, count)).collect();
        let _ = writeln!(out, "<p>Ended by {}.</p>", told.join("; "));
    }
    if let Some(places) = level.places {
        let each = level.testers.iter().filter_map(|tester| Some((&tester.tester, tester.places?)));
        let each: Vec<String> =
            each.take(MOST_TESTERS).map(|(name, places)| format!("{} {}", text(name), places.describe())).collect();
        let _ = writeln!(out, "<p>Visited {} of the open squares ({}).</p>", places.describe(), each.join(", "));
    }
    let Some(maps) = &level.maps else { return out };
    // The sum of an empty list would be -0.
    let sum = |counts: &[[u64; 2]]| counts.iter().fold(0.0, |sum, [_, ticks]| sum + *ticks as f64);
    let all = sum(&maps.visits).max(1.0);
    let _ = writeln!(out, "<p>Time lost: {:.1} % of the ticks.</p>", 100.0 * sum(&maps.lost) / all);
    if !maps.skills.is_empty() {
        let named = maps.skills.iter().take(SKILL_COLOURS).enumerate().map(|(rank, skill)| named(rank, skill, all));
        let mut named: Vec<String> = named.collect();
        named.extend((maps.skills.len() > SKILL_COLOURS).then(|| format!("{}others", swatch(SKILL_COLOURS))));
        let _ = writeln!(out, "<p>Skills: {}.</p>", named.join(", "));
    }
    out
}

/// Describes a cause, its number of ends, and its most frequent position.
fn cause_line(level: &LevelVerdict, cause: &str, count: u64) -> String {
    let here = level.ends.iter().filter_map(|end| Some((*end.causes.get(cause)?, end.x, end.y)));
    let mut places: Vec<(u64, f32, f32)> = here.collect();
    places.sort_by_key(|(count, ..)| Reverse(*count));
    let shown: Vec<String> = places
        .iter()
        .take(MOST_PLACES)
        .map(|(_, x, y)| format!("{}, {}", readable(f64::from(*x)), readable(f64::from(*y))))
        .collect();
    let more = if places.len() > MOST_PLACES { " and elsewhere" } else { "" };
    let at = if shown.is_empty() { String::new() } else { format!(" (at {}{more})", shown.join(" and ")) };
    format!("{} {count}{at}", text(cause))
}

fn named(rank: usize, skill: &SkillTicks, all: f64) -> String {
    format!("{}{} {:.1} %", swatch(rank), text(&skill.skill), 100.0 * skill.ticks as f64 / all)
}

fn swatch(rank: usize) -> String {
    format!(
        "<svg class=\"swatch level\" viewBox=\"0 0 20 20\"><path class=\"skill{rank}\" d=\"M0 0h20v20h-20z\"/></svg>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::{EndPlace, LevelMaps, Places},
        verdict_report::testing::level,
    };

    #[test]
    fn causes_places_lost_time_and_skills_are_told() {
        let ended = |x: f32, cause: &str, count| EndPlace {
            x,
            y: 3.0,
            lost: count,
            causes: [(cause.to_owned(), count)].into(),
            ..EndPlace::default()
        };
        let skill = |skill: &str| SkillTicks { skill: skill.to_owned(), ticks: 25 };
        let maps = LevelMaps {
            visits: vec![[0, 100], [1, 100]],
            lost: vec![[1, 30]],
            skills: ["z1+", "z2-", "z3+", "z3-", "z4+"].map(skill).to_vec(),
            ..LevelMaps::default()
        };
        let mut level = LevelVerdict {
            ends: vec![ended(11.0, "saw", 1), ended(13.0, "<saw>", 1), ended(21.0, "saw", 4)],
            causes: [("<saw>".to_owned(), 1), ("saw".to_owned(), 5), ("time".to_owned(), 2)].into(),
            places: Some(Places { visited: 3, open: 4 }),
            maps: Some(maps),
            ..level(0, 0, 8, 0)
        };
        level.testers[0].places = Some(Places { visited: 1, open: 4 });
        let told = walks(&level);
        for words in [
            "<p>Ended by saw 5 (at 21.00, 3.000 and 11.00, 3.000); time 2; &lt;saw&gt; 1 (at 13.00, 3.000).</p>",
            "<p>Visited 75.0 % of the open squares (random 25.0 %).</p>",
            "<p>Time lost: 15.0 % of the ticks.</p>",
            "z1+ 12.5 %, ",
            "others.</p>",
        ] {
            assert!(told.contains(words), "{words} in {told}");
        }
        assert_eq!(crate::verdict_report::words::causes(&level), "saw 5, time 2, &lt;saw&gt; 1");
        assert_eq!(walks(&crate::verdict_report::testing::level(0, 1, 1, 3)), "", "older results say nothing");
        level.maps = Some(LevelMaps { visits: vec![[0, 100]], ..LevelMaps::default() });
        assert!(walks(&level).contains("<p>Time lost: 0.0 % of the ticks.</p>"), "{}", walks(&level));
    }
}
