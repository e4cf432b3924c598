//! Drawings of the levels in the table.

use crate::{
    explore::Exploration,
    verdict::{LevelOutcome, LevelVerdict, SkillTicks, TestRecord, hash_of_files},
    verdict_report::{
        clip::clip,
        files::PictureFiles,
        heat::SKILL_COLOURS,
        most_frequent,
        picture::picture,
        reach::{LevelExplorer, Reached},
        text,
    },
};
use playbot_harness::{floor_plan::FloorPlan, game::Game, split::LevelSplit};
use playbot_report::readable;
use std::{
    cell::{Cell, RefCell},
    cmp::Reverse,
    collections::BTreeMap,
    fmt::Write,
    rc::Rc,
};

/// Largest number of levels with a picture, the worst ones.
pub(crate) const MOST_PICTURES: usize = 200;

/// Largest number of levels with a clip.
const MOST_CLIPS: usize = 60;

/// Largest number of letters of all clips together.
const MOST_LETTERS: usize = 1_200_000;

/// Least and largest number of environment steps in which an explorer explores the unsolvable levels of a page. Within
/// them it takes as many as the test did.
const EXPLORED: [u64; 2] = [20_000, 400_000];

/// Drawing of a level.
pub struct Drawn {
    /// Its picture, as SVG.
    pub picture: String,
    /// The ends of its axes, in words.
    pub axes: String,
    /// The squares that were not reached, in words, of a level that no tester solved.
    pub reach: Option<String>,
    /// Address of its failure as an animated PNG.
    pub clip: Option<String>,
}

/// Drawings of the levels of a page: their plans, the squares that were reached, and the files of pictures.
pub(crate) struct Drawings<'a> {
    /// The plans.
    pub plans: Plans<'a>,
    /// Pictures in files, or in the page.
    pub files: PictureFiles,
    explorer: Option<LevelExplorer<'a>>,
    /// Steps that the explorer has left.
    left: Cell<u64>,
    /// The squares by the index of the level: cards and table show the same levels.
    reached: RefCell<BTreeMap<u64, Option<Rc<Reached>>>>,
}

impl<'a> Drawings<'a> {
    /// Makes the drawings of a page. Without an explorer, squares are those of the testers; `played` is the number of ticks
    /// that these have played.
    pub fn new(plans: Plans<'a>, files: PictureFiles, explorer: Option<LevelExplorer<'a>>, played: u64) -> Self {
        let left = Cell::new(played.clamp(EXPLORED[0], EXPLORED[1]));
        Self { plans, files, explorer, left, reached: RefCell::default() }
    }

    /// Returns the squares that were reached in a level with this plan, and those that were not. `None` for a level that
    /// was solved, or whose squares are unknown.
    pub fn reached(&self, level: &LevelVerdict, plan: &FloorPlan) -> Option<Rc<Reached>> {
        if level.outcome == LevelOutcome::Solved {
            return None;
        }
        if let Some(known) = self.reached.borrow().get(&level.index) {
            return known.clone();
        }
        let explored = self.explored(level).and_then(|explored| Reached::of(&explored, plan));
        let reached = match (explored, &level.maps) {
            (Some(explored), Some(maps)) => Some(explored.with_testers(maps)),
            (Some(explored), None) => Some(explored),
            (None, Some(maps)) => Reached::by_testers(maps, plan),
            (None, None) => None,
        };
        let reached = reached.map(Rc::new);
        self.reached.borrow_mut().insert(level.index, reached.clone());
        reached
    }

    /// Explores a level that is proved unsolvable. In others, which a longer search may solve, the testers are all.
    fn explored(&self, level: &LevelVerdict) -> Option<Exploration> {
        let explorer = self.explorer.filter(|_| level.outcome == LevelOutcome::ProvedUnsolvable)?;
        let Plans::Known { game, range } = &self.plans else { return None };
        let (number, mut left) = (self.plans.number(level.index)?, self.left.get());
        let explored = explorer.explore(*game, &range.mode, number, &mut left);
        self.left.set(left);
        explored
    }
}

/// Drawer of levels, within the size limits of the page.
pub(crate) struct Drawer<'a> {
    drawings: &'a Drawings<'a>,
    levels: usize,
    clips: usize,
    letters: usize,
    /// Number of pictures drawn.
    pub pictures: usize,
    /// Number of those with maps.
    pub maps: usize,
    /// Number of those with reached squares.
    pub reached: usize,
}

impl<'a> Drawer<'a> {
    /// Makes a drawer for a page without pictures so far.
    pub fn new(drawings: &'a Drawings<'a>) -> Self {
        Self { drawings, levels: 0, clips: 0, letters: 0, pictures: 0, maps: 0, reached: 0 }
    }

    /// Draws the next level of the table; `None` if it has no plan, or enough were drawn.
    pub fn draw(&mut self, level: &LevelVerdict) -> Option<Drawn> {
        self.draw_as(level, level)
    }

    /// Draws the next level as [`draw`](Self::draw) does, without its maps and its clip.
    pub fn draw_bare(&mut self, level: &LevelVerdict) -> Option<Drawn> {
        self.draw_as(level, &LevelVerdict { maps: None, ..level.clone() })
    }

    /// Draws what is to be shown of a level.
    fn draw_as(&mut self, level: &LevelVerdict, shown: &LevelVerdict) -> Option<Drawn> {
        self.levels += 1;
        let Drawings { plans, files, .. } = self.drawings;
        let plan = if self.levels <= MOST_PICTURES { plans.get(level)? } else { return None };
        let reached = self.drawings.reached(level, &plan);
        let (picture, axes) = picture(&plan, shown, reached.as_deref())?;
        self.pictures += 1;
        self.maps += usize::from(shown.maps.is_some());
        self.reached += usize::from(reached.is_some());
        let is_room = self.clips < MOST_CLIPS && self.letters < MOST_LETTERS;
        let clip = shown.maps.as_ref().filter(|_| is_room).and_then(|maps| clip(&plan, maps, plans.tick_hz()?));
        let letters = clip.as_ref().map_or(0, |bytes| bytes.len().div_ceil(3) * 4);
        self.letters += letters;
        // The first clip without room is the last one that is tried.
        let clip = clip.filter(|_| self.letters <= MOST_LETTERS).map(|bytes| files.source(&bytes));
        self.clips += usize::from(clip.is_some());
        let reach = reached.map(|reached| reached.words());
        Some(Drawn { picture, axes, reach, clip })
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
        game.tools().levels.floor_plan(&range.mode, self.number(index)?)
    }

    /// Returns the number of the level with this index in the range of the test.
    fn number(&self, index: u64) -> Option<u64> {
        let Self::Known { range, .. } = self else { return None };
        range.first.checked_add(index).filter(|number| *number <= range.last)
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
        verdict::{EpisodePath, LevelMaps, Places, SquareEnds},
        verdict_report::testing::{Garden, level, record},
    };

    #[test]
    fn pictures_and_clips_are_limited() {
        let tested = record("hard:0..299", None);
        let drawings = Drawings::new(Plans::of(Some(&Garden), &tested), PictureFiles::default(), None, 0);
        let mut drawer = Drawer::new(&drawings);
        let failure = Some(EpisodePath { tester: "random".to_owned(), episode: 0, path: vec![[65, 3], [66, 1]] });
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, failure, ..LevelMaps::default() };
        let mut clips = 0;
        for index in 0..300 {
            let maps = (index % 2 == 0).then(|| maps.clone());
            let drawn = drawer.draw(&LevelVerdict { maps, ..level(index, 0, 1, 0) });
            assert_eq!(drawn.is_some(), index < 200);
            let clip = drawn.and_then(|drawn| drawn.clip);
            assert!(
                clip.as_ref().is_none_or(|clip| clip.starts_with("data:image/png;base64,iVBORw0KGgo")),
                "the head of a PNG"
            );
            clips += usize::from(clip.is_some());
        }
        assert_eq!((drawer.pictures, drawer.maps, clips), (200, 100, MOST_CLIPS));
    }

    #[test]
    fn unsolved_levels_have_the_squares_of_the_testers_and_solved_ones_have_none() {
        let tested = record("hard:0..9", None);
        let drawings = Drawings::new(Plans::of(Some(&Garden), &tested), PictureFiles::default(), None, 0);
        let mut drawer = Drawer::new(&drawings);
        let maps =
            || Some(LevelMaps { side: 1.0, columns: 64, rows: 16, visits: vec![[65, 3]], ..LevelMaps::default() });
        let mut draw = |level: LevelVerdict| drawer.draw(&level).expect("a plan");
        let lost = draw(LevelVerdict { maps: maps(), ..level(0, 0, 1, 0) });
        assert!(lost.picture.contains("class=\"hatched\""), "{}", lost.picture);
        assert!(lost.reach.is_some_and(|words| words.starts_with("No tester reached ")));
        let solved = draw(LevelVerdict { maps: maps(), ..level(1, 1, 1, 9) });
        assert!(!solved.picture.contains("hatched") && solved.reach.is_none());
        let unknown = draw(level(2, 0, 1, 0));
        assert!(!unknown.picture.contains("hatched") && unknown.reach.is_none());
        let card = drawer.draw_bare(&LevelVerdict { maps: maps(), ..level(3, 0, 1, 0) }).expect("a plan");
        assert!(card.picture.contains("class=\"hatched\"") && !card.picture.contains("map visits"));
        assert_eq!((drawer.reached, drawer.maps), (2, 2));
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
