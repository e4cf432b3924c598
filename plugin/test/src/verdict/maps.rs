//! Maps of where agents went in a level, as in results.

use crate::detectors::Pars;
use bevy::math::{Rect, Vec2};
use bevy_playbot::{state_hash::StateHash, unknown_name::nearest};
use playbot_harness::{
    brief::shell_word,
    floor_plan::FloorPlan,
    game::{Game, level_designs},
    level_files::{LevelDesigns, is_level_files, level_files_mode},
    split::LevelSplit,
};
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeSet, fmt};

/// Largest number of names that are reported.
const MOST_NAMES: usize = 5;

/// Most letters of a plan along a side.
const MOST_LETTERS: usize = 128;

/// Largest number of levels of a range that all have maps: as many as the page shows.
const MOST_LEVELS: u64 = 2_000;

/// Ticks by squares of a level, of all episodes of all testers.
///
/// A square is a tile of the level, or several of them in levels of more than 64. Squares are counted row by row from
/// the lower left corner, from 0. Lists have pairs of a square and its value, in the order of the squares.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LevelMaps {
    /// Lower left corner, in the units of the floor plan.
    pub x: f32,
    /// Lower left corner.
    pub y: f32,
    /// Side of a square.
    pub side: f32,
    /// Squares in a row.
    pub columns: u64,
    /// Rows.
    pub rows: u64,
    /// Ticks that agents were there. An open square that an episode only passes between two ticks counts one.
    pub visits: Vec<[u64; 2]>,
    /// Lost ticks: those more than two seconds after the agent last entered a square that was new in its episode. It
    /// rested, or went back and forth.
    pub lost: Vec<[u64; 2]>,
    /// Skills that were active, the most frequent first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skills: Vec<SkillTicks>,
    /// The skill that was active for most ticks in a square, as an index of `skills`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub skill_at: Vec<[u64; 2]>,
    /// The path of an episode that failed, or that has a finding.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub failure: Option<EpisodePath>,
    /// The path of the episode that solved the level in the fewest ticks. Older results lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub best: Option<EpisodePath>,
    /// The floor plan as it was in the test. Older results lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<PlanRows>,
}

/// Floor plan of a level as text, such that results show a level that has changed since.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanRows {
    /// Width and height of a letter.
    pub side: f32,
    /// The rows of [`FloorPlan::rows`] from the top with `/` between them, each letter once with the number of times
    /// that it follows itself: `12.3#S/16#`.
    pub rows: String,
}

impl PlanRows {
    /// Writes a plan as text.
    pub fn of(plan: &FloorPlan) -> Self {
        let mut text = String::new();
        for row in plan.rows() {
            if !text.is_empty() {
                text.push('/');
            }
            let mut letters = row.chars().peekable();
            while let Some(letter) = letters.next() {
                let mut count = 1;
                while letters.next_if_eq(&letter).is_some() {
                    count += 1;
                }
                if count > 1 {
                    text += &format!("{count}");
                }
                text.push(letter);
            }
        }
        Self { side: plan.letter(), rows: text }
    }

    /// Returns the plan, given its lower left corner. Its parts are as coarse as the letters. `None` if the text is no
    /// plan.
    pub fn plan(&self, corner: Vec2) -> Option<FloorPlan> {
        let rows: Vec<&str> = self.rows.split('/').collect();
        if !(corner.is_finite() && self.side.is_finite() && self.side > 0.0) || rows.len() > MOST_LETTERS {
            return None;
        }
        let mut plan = FloorPlan::default();
        let mut most = 0;
        for (row, text) in rows.iter().rev().enumerate() {
            let (mut column, mut count) = (0, String::new());
            for letter in text.chars() {
                if letter.is_ascii_digit() {
                    count.push(letter);
                    continue;
                }
                let next = column + std::mem::take(&mut count).parse().unwrap_or(1).min(MOST_LETTERS);
                if next > MOST_LETTERS {
                    return None;
                }
                let at = |column: usize, row: usize| corner + Vec2::new(column as f32, row as f32) * self.side;
                let area = Rect::from_corners(at(column, row), at(next, row + 1));
                match letter {
                    '#' => plan.walls.push(area),
                    '=' => plan.platforms.push(area),
                    '^' => plan.hazards.push(area),
                    'S' => plan.start = area.center(),
                    'G' => plan.goal = area.center(),
                    _ => {}
                }
                column = next;
            }
            most = most.max(column);
        }
        let size = Vec2::new(most as f32, rows.len() as f32) * self.side;
        plan.bounds = Rect::from_corners(corner, corner + size);
        (most > 0 && size.is_finite()).then_some(plan)
    }
}

/// Events in the episodes of one tester on a level, in the squares of its [`LevelMaps`].
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TesterEvents {
    /// Ends without the goal: square, episodes that were lost there, and episodes whose time was up there. Ends outside
    /// the level are in the nearest square.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ends: Vec<[u64; 3]>,
    /// Lost ticks, as in [`LevelMaps::lost`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<[u64; 2]>,
    /// Visited squares as runs: the first square, and the number of squares with consecutive numbers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub visited: Vec<[u64; 2]>,
}

/// Ticks of a skill.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkillTicks {
    /// Its name: that of its [region](crate::verdict::TesterRecord::skill_names), or else the number of z that is furthest
    /// from 0, counted from 1, and its sign, such as `z3+`. Only the first 16 numbers count.
    pub skill: String,
    /// Ticks.
    pub ticks: u64,
}

/// The path of one episode.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EpisodePath {
    /// The tester.
    pub tester: String,
    /// Episode of that tester on the level, from 0.
    pub episode: u32,
    /// Squares in order, with the ticks spent in each; of a long path the last 200.
    #[serde(rename = "way")]
    pub path: Vec<[u64; 2]>,
}

/// The levels whose results have maps of where agents went. The size of the whole range decides, so its shards agree.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MapScope {
    /// No level, as in results that are older than maps.
    #[default]
    None,
    /// Levels that were not solved each time, or that have a finding.
    Failed,
    /// All levels.
    All,
}

impl MapScope {
    /// Returns the scope for a range of so many levels.
    pub fn of(levels: u64) -> Self {
        if levels <= MOST_LEVELS { Self::All } else { Self::Failed }
    }

    /// Returns the name in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Failed => "failed",
            Self::All => "all",
        }
    }

    /// Returns whether a level has maps.
    pub(super) fn wants(self, is_perfect: bool) -> bool {
        match self {
            Self::None => false,
            Self::Failed => !is_perfect,
            Self::All => true,
        }
    }

    /// Returns whether no level has maps; files leave the key out then, as older versions do.
    #[allow(clippy::trivially_copy_pass_by_ref, reason = "serde requires this signature")]
    pub(super) fn is_none(&self) -> bool {
        *self == Self::None
    }
}

/// Number of these levels with a par, and the pars without a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelPars {
    /// Levels with a par.
    pub with: u64,
    /// All levels.
    pub levels: u64,
    /// Names of pars that match no level; the first few with the level that may be meant.
    pub others: Vec<String>,
}

impl LevelPars {
    /// Computes the pars of all levels of a test, in any shard.
    pub fn of(pars: &Pars, game: &dyn Game, split: &LevelSplit) -> Self {
        let designs = drawn(game, split);
        let path = |level| designs.as_ref().and_then(|designs| designs.path(level));
        let paths: Vec<&str> = if designs.is_some() { split.levels().filter_map(path).collect() } else { Vec::new() };
        let known: BTreeSet<&str> = paths.iter().copied().collect();
        // Numbered levels are too many to list.
        let by_number = |name: &str| {
            let level: u64 = name.rsplit_once(':')?.1.parse().ok()?;
            let is_one = designs.is_none() && split.contains(&split.mode, level);
            is_one.then(|| format!("{}:{level}", split.mode))
        };
        let is_one = |name: &str| known.contains(name) || by_number(name).is_some_and(|own| own == name);
        let (own, others): (Vec<&str>, Vec<&str>) = pars.levels().partition(|name: &&str| is_one(name));
        let reported = |(index, name): (usize, &str)| {
            let near = || by_number(name).or_else(|| nearest(name, &paths).map(str::to_owned));
            let near = (index < MOST_NAMES).then(near).flatten();
            near.map_or_else(|| name.to_owned(), |near| format!("{name} (did you mean {near}?)"))
        };
        let others = others.into_iter().enumerate().map(reported).collect();
        Self { with: own.len() as u64, levels: split.len(), others }
    }
}

impl fmt::Display for LevelPars {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { with, levels, others } = self;
        write!(f, "pars for {with} of {}", counted(*levels, "level"))?;
        if others.is_empty() {
            return Ok(());
        }
        let names = others.iter().take(MOST_NAMES).cloned().collect::<Vec<_>>().join(", ");
        let are = if others.len() == 1 { "name is" } else { "names are" };
        write!(f, "; {} {are} no level of this test: {names}", others.len())?;
        match others.len().saturating_sub(MOST_NAMES) {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}

// Names of levels in results.

/// Returns the name of a level of these: `hard:7`, or the path of its file.
pub fn level_name(game: &dyn Game, split: &LevelSplit, level: u64) -> String {
    let designs = drawn(game, split);
    let path = designs.as_ref().and_then(|designs| designs.path(level));
    path.map_or_else(|| format!("{}:{level}", split.mode), str::to_owned)
}

/// Returns the value of `--levels` for the level with this name alone, as a word for the shell.
pub(super) fn level_argument(split: &LevelSplit, name: &str) -> String {
    let word = if is_level_files(&split.mode) { level_files_mode(name) } else { name.to_owned() };
    shell_word(&word)
}

/// Returns a hash of these levels' files and of their content; `None` for levels that are not files.
pub fn hash_of_files(game: &dyn Game, split: &LevelSplit) -> Option<String> {
    let designs = drawn(game, split)?;
    let path = |level| designs.path(level).unwrap_or_default().bytes().map(u64::from).collect::<Vec<_>>();
    let words = split.levels().flat_map(|level| path(level).into_iter().chain([designs.hash(level).unwrap_or(0)]));
    Some(format!("{:016x}", StateHash::of(words).0))
}

pub(super) fn drawn(game: &dyn Game, split: &LevelSplit) -> Option<LevelDesigns> {
    let is_drawn = is_level_files(&split.mode);
    is_drawn.then(|| level_designs(game, &split.mode).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_harness::foreign::ForeignGame;

    #[test]
    fn maps_read_back_as_they_are_written() {
        let maps = LevelMaps {
            x: -0.5,
            y: 0.1,
            side: 1.0,
            columns: 64,
            rows: 13,
            visits: vec![[3, 70], [4, 1]],
            lost: vec![[3, 9]],
            ..LevelMaps::default()
        };
        let text = serde_json::to_string(&maps).expect("serialises");
        let expected = r#"{"x":-0.5,"y":0.1,"side":1.0,"columns":64,"rows":13,"visits":[[3,70],[4,1]],"lost":[[3,9]]}"#;
        assert_eq!(text, expected);
        let failure = Some(EpisodePath { tester: "random".to_owned(), episode: 1, path: vec![[3, 70], [4, 1]] });
        let skills = vec![SkillTicks { skill: "z1+".to_owned(), ticks: 71 }];
        let best = Some(EpisodePath { tester: "search".to_owned(), episode: 0, path: vec![[3, 9]] });
        let plan = Some(PlanRows { side: 1.0, rows: "3.G".to_owned() });
        let full = LevelMaps { skills, skill_at: vec![[3, 0], [4, 0]], failure, best, plan, ..maps };
        let text = serde_json::to_string(&full).expect("serialises");
        assert_eq!(serde_json::from_str::<LevelMaps>(&text).expect("whole"), full);
    }

    #[test]
    fn a_plan_is_read_back_from_its_rows() {
        let plan = FloorPlan {
            bounds: Rect::new(-1.0, 2.0, 15.0, 4.0),
            walls: vec![Rect::new(-1.0, 2.0, 15.0, 3.0), Rect::new(11.0, 3.0, 14.0, 4.0)],
            start: Vec2::new(14.5, 3.5),
            goal: Vec2::new(-0.5, 3.5),
            ..FloorPlan::default()
        };
        let rows = PlanRows::of(&plan);
        assert_eq!((rows.rows.as_str(), rows.side), ("G11.3#S/16#", 1.0));
        assert_eq!(rows.plan(Vec2::new(-1.0, 2.0)), Some(plan.clone()));
        let wide = PlanRows { side: 2.5, rows: "^=/2.".to_owned() }.plan(Vec2::ZERO).expect("a plan");
        let kinds = (wide.hazards, wide.platforms, wide.bounds);
        let [left, right] = [Rect::new(0.0, 2.5, 2.5, 5.0), Rect::new(2.5, 2.5, 5.0, 5.0)];
        assert_eq!(kinds, (vec![left], vec![right], Rect::new(0.0, 0.0, 5.0, 5.0)));
    }

    #[test]
    fn text_that_is_no_plan_is_refused() {
        for (side, rows, corner) in [
            (0.0, "#", Vec2::ZERO),
            (f32::NAN, "#", Vec2::ZERO),
            (f32::MAX, "9#", Vec2::ZERO),
            (1.0, "", Vec2::ZERO),
            (1.0, "99999999999999999999#100#100#", Vec2::ZERO),
            (1.0, &"#/".repeat(200), Vec2::ZERO),
            (1.0, "#", Vec2::NAN),
        ] {
            assert_eq!(PlanRows { side, rows: rows.to_owned() }.plan(corner), None, "{side} {rows} {corner}");
        }
    }

    fn found(text: &str) -> LevelPars {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pars.json");
        std::fs::write(&path, text).expect("writable");
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let pars = Pars::read(&path, &game).expect("pars");
        LevelPars::of(&pars, &game, &"hard:0..4".parse().expect("a split"))
    }

    #[test]
    fn pars_of_other_levels_are_reported_with_what_may_be_meant() {
        let all = found(r#"{"hard:1": 9, "hard:3": 9}"#);
        assert_eq!(all.to_string(), "pars for 2 of 5 levels");
        let some = found(r#"{"hard:1": 9, "hard:3": 9, "hard:99": 9, "hrad:3": 9, "hard:04": 9}"#);
        assert_eq!(
            some.to_string(),
            "pars for 2 of 5 levels; 3 names are no level of this test: hard:04 (did you mean hard:4?), hard:99, hrad:3 \
             (did you mean hard:3?)"
        );
    }

    #[test]
    fn of_many_names_a_few_are_reported() {
        let none = found(r#"{"a": 1, "b": 1, "c": 1, "d": 1, "e": 1, "f": 1}"#);
        assert_eq!((none.with, none.others.len()), (0, 6));
        assert!(none.to_string().ends_with("no level of this test: a, b, c, d, e and 1 more"), "{none}");
    }

    #[test]
    fn a_name_is_a_range_of_one_level() {
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let split: LevelSplit = "hard+fog=1:5..9".parse().expect("a split");
        let name = level_name(&game, &split, 7);
        assert_eq!(name, "hard+fog=1:7");
        assert_eq!((level_argument(&split, &name), hash_of_files(&game, &split)), (name.clone(), None));
        let alone: LevelSplit = name.parse().expect("a split");
        assert_eq!((alone.len(), split.contains(&alone.mode, alone.first)), (1, true));
    }

    #[test]
    fn a_file_is_named_in_words_that_a_shell_takes() {
        let split = LevelSplit { mode: "files:levels/*.json".to_owned(), first: 0, last: 3 };
        assert_eq!(level_argument(&split, "levels/a.json"), "files:levels/a.json");
        assert_eq!(level_argument(&split, "my levels/a.json"), "'files:my levels/a.json'");
    }

    #[test]
    fn of_many_levels_only_those_that_failed_have_maps() {
        assert_eq!([1, 2_000, 2_001].map(MapScope::of), [MapScope::All, MapScope::All, MapScope::Failed]);
        for (scope, name, of_perfect, of_others) in [
            (MapScope::None, "none", false, false),
            (MapScope::Failed, "failed", false, true),
            (MapScope::All, "all", true, true),
        ] {
            assert_eq!((scope.wants(true), scope.wants(false)), (of_perfect, of_others));
            assert_eq!(serde_json::to_string(&scope).expect("serialises"), format!("\"{name}\""));
            assert_eq!(scope.name(), name);
        }
    }
}
