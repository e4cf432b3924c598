//! Drawings of the levels in the table.

use crate::{
    verdict::{LevelVerdict, SkillTicks, TestRecord, hash_of_files},
    verdict_report::{
        clip::{base64, clip},
        heat::SKILL_COLOURS,
        most_frequent,
        picture::picture,
        text,
    },
};
use playbot_harness::{floor_plan::FloorPlan, game::Game, split::LevelSplit};
use playbot_report::readable;
use std::{cmp::Reverse, fmt::Write};

/// Largest number of levels with a picture, the worst ones.
const MOST_PICTURES: usize = 200;

/// Largest number of levels with a clip.
const MOST_CLIPS: usize = 60;

/// Largest number of letters of all clips together.
const MOST_LETTERS: usize = 1_200_000;

/// Drawing of a level.
pub struct Drawn {
    /// Its picture, as SVG.
    pub picture: String,
    /// The ends of its axes, in words.
    pub axes: String,
    /// Its failure as an animated PNG, in base64.
    pub clip: Option<String>,
}

/// Drawer of levels, within the size limits of the page.
pub struct Drawer<'a> {
    plans: &'a Plans<'a>,
    levels: usize,
    clips: usize,
    letters: usize,
    /// Number of pictures drawn.
    pub pictures: usize,
    /// Number of those with maps.
    pub maps: usize,
}

impl<'a> Drawer<'a> {
    /// Makes a drawer for a page without pictures so far.
    pub fn new(plans: &'a Plans<'a>) -> Self {
        Self { plans, levels: 0, clips: 0, letters: 0, pictures: 0, maps: 0 }
    }

    /// Draws the next level of the table; `None` if it has no plan, or enough were drawn.
    pub fn draw(&mut self, level: &LevelVerdict) -> Option<Drawn> {
        self.levels += 1;
        let plan = if self.levels <= MOST_PICTURES { self.plans.get(level)? } else { return None };
        let (picture, axes) = picture(&plan, level)?;
        self.pictures += 1;
        self.maps += usize::from(level.maps.is_some());
        let is_room = self.clips < MOST_CLIPS && self.letters < MOST_LETTERS;
        let clip = level.maps.as_ref().filter(|_| is_room).and_then(|maps| clip(&plan, maps, self.plans.tick_hz()?));
        let text = clip.map(|bytes| base64(&bytes));
        self.letters += text.as_ref().map_or(0, String::len);
        // The first clip without room is the last one that is tried.
        let clip = text.filter(|_| self.letters <= MOST_LETTERS);
        self.clips += usize::from(clip.is_some());
        Some(Drawn { picture, axes, clip })
    }
}

/// Floor plans of a test, if its levels can still be drawn as they were.
pub enum Plans<'a> {
    /// The game can draw them.
    Known {
        /// The game that was tested.
        game: &'a dyn Game,
        /// Its levels.
        range: &'a LevelSplit,
    },
    /// No floor plans, with the reason.
    Missing(String),
}

impl<'a> Plans<'a> {
    /// Returns the plans of a test of this game; `None` for a game that the program does not have.
    pub fn of(game: Option<&'a dyn Game>, record: &'a TestRecord) -> Self {
        let Some(game) = game else {
            return Self::Missing(format!("this program does not have the game `{}`", record.game));
        };
        let range = &record.range;
        match difference(game, record) {
            Some(why) => Self::Missing(why),
            None => Self::Known { game, range },
        }
    }

    /// Returns the plan of a level of the test.
    pub fn get(&self, level: &LevelVerdict) -> Option<FloorPlan> {
        self.at(level.index)
    }

    /// Returns the plan of the level with this index in the range of the test.
    pub fn at(&self, index: u64) -> Option<FloorPlan> {
        let Self::Known { game, range } = self else { return None };
        let number = range.first.checked_add(index).filter(|number| *number <= range.last)?;
        game.tools().levels.floor_plan(&range.mode, number)
    }

    /// Returns the game's ticks per second; `None` without plans.
    pub fn tick_hz(&self) -> Option<f64> {
        match self {
            Self::Known { game, .. } => Some(game.tick_hz()),
            Self::Missing(_) => None,
        }
    }

    /// Returns the reason for missing plans.
    pub fn problem(&self) -> Option<&str> {
        match self {
            Self::Known { .. } => None,
            Self::Missing(why) => Some(why),
        }
    }
}

/// Describes the difference between the game's levels and the tested ones.
fn difference(game: &dyn Game, record: &TestRecord) -> Option<String> {
    if game.name() != record.game {
        return Some(format!("the levels are those of `{}`, not of `{}`", record.game, game.name()));
    }
    let (tested, now) = (record.game_version, game.version());
    if tested != now {
        return Some(format!("version {tested} of `{}` was tested, and this is version {now}", record.game));
    }
    if let Err(error) = record.range.check(game) {
        return Some(error.to_string());
    }
    let is_same = record.files == hash_of_files(game, &record.range);
    (!is_same).then(|| "the level files are not those that were tested".to_owned())
}

// Descriptions of walks and of causes of ends.

/// Largest number of positions that are named for a cause.
const MOST_PLACES: usize = 3;

/// Largest number of testers that are named.
const MOST_TESTERS: usize = 8;

/// Describes the walks in a level; empty without walks.
pub(crate) fn walks(level: &LevelVerdict) -> String {
    let mut out = String::new();
    if !level.causes.is_empty() {
        let reported: Vec<String> =
            most_frequent(&level.causes).map(|(cause, count)| cause_line(level, cause, count)).collect();
        let _ = writeln!(out, "<p>Ended by {}.</p>", reported.join("; "));
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
        verdict::{FailurePath, LevelMaps, Places, SquareEnds},
        verdict_report::testing::{Garden, level, record},
    };

    #[test]
    fn pictures_and_clips_are_limited() {
        let tested = record("hard:0..299", None);
        let plans = Plans::of(Some(&Garden), &tested);
        let mut drawer = Drawer::new(&plans);
        let failure = Some(FailurePath { tester: "random".to_owned(), episode: 0, path: vec![[65, 3], [66, 1]] });
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, failure, ..LevelMaps::default() };
        let mut clips = 0;
        for index in 0..300 {
            let maps = (index % 2 == 0).then(|| maps.clone());
            let drawn = drawer.draw(&LevelVerdict { maps, ..level(index, 0, 1, 0) });
            assert_eq!(drawn.is_some(), index < 200);
            let clip = drawn.and_then(|drawn| drawn.clip);
            assert!(clip.as_ref().is_none_or(|clip| clip.starts_with("iVBORw0KGgo")), "the head of a PNG");
            clips += usize::from(clip.is_some());
        }
        assert_eq!((drawer.pictures, drawer.maps, clips), (200, 100, MOST_CLIPS));
    }

    #[test]
    fn only_levels_that_are_as_they_were_are_drawn() {
        let tested = record("hard:5..9", None);
        let plans = Plans::of(Some(&Garden), &tested);
        assert!(plans.problem().is_none() && plans.get(&level(4, 0, 1, 0)).is_some());
        assert!(plans.get(&level(5, 0, 1, 0)).is_none(), "the range has five levels");
        assert!(plans.get(&level(u64::MAX, 0, 1, 0)).is_none());
        for (record, words) in [
            (
                TestRecord { game_version: 7, ..tested.clone() },
                "version 7 of `garden` was tested, and this is version 1",
            ),
            (TestRecord { game: "maze".to_owned(), ..tested.clone() }, "those of `maze`, not of `garden`"),
            (TestRecord { files: Some("0f".to_owned()), ..tested.clone() }, "level files are not those"),
            (record("soft:0..1", None), "soft"),
        ] {
            let plans = Plans::of(Some(&Garden), &record);
            let problem = plans.problem().expect(words);
            assert!(problem.contains(words), "{problem}");
            assert!(plans.get(&level(0, 0, 1, 0)).is_none(), "{words}");
        }
        let without = Plans::of(None, &tested);
        assert_eq!(without.problem(), Some("this program does not have the game `garden`"));
    }

    #[test]
    fn causes_places_lost_time_and_skills_are_reported() {
        let ended = |x: f32, cause: &str, count| SquareEnds {
            x,
            y: 3.0,
            lost: count,
            causes: [(cause.to_owned(), count)].into(),
            ..SquareEnds::default()
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
        let reported = walks(&level);
        for words in [
            "<p>Ended by saw 5 (at 21.00, 3.000 and 11.00, 3.000); time 2; &lt;saw&gt; 1 (at 13.00, 3.000).</p>",
            "<p>Visited 75.0 % of the open squares (random 25.0 %).</p>",
            "<p>Time lost: 15.0 % of the ticks.</p>",
            "z1+ 12.5 %, ",
            "others.</p>",
        ] {
            assert!(reported.contains(words), "{words} in {reported}");
        }
        assert_eq!(crate::verdict_report::causes(&level), "saw 5, time 2, &lt;saw&gt; 1");
        assert_eq!(walks(&crate::verdict_report::testing::level(0, 1, 1, 3)), "", "older results say nothing");
        level.maps = Some(LevelMaps { visits: vec![[0, 100]], ..LevelMaps::default() });
        assert!(walks(&level).contains("<p>Time lost: 0.0 % of the ticks.</p>"), "{}", walks(&level));
    }
}
