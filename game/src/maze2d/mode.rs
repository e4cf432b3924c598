//! Modes of Maze2D: a map with options, such as `medium+fixed-start+limit=1000`.

use crate::{
    maze::{Map, Maze, MazeError, MazeModeError, OptionError},
    maze2d::walls::D4RL_OFFSET,
};
use std::{fmt, str::FromStr};

/// The contact model of walls and ball.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ContactModel {
    /// MuJoCo's soft contact in closed form: the game of the literature.
    #[default]
    Soft,
    /// rapier2d's solver: hard and inelastic. Free flight is the same.
    Rapier,
}

/// Map and rules. Written as the map's name and the differences from its defaults, joined by `+`.
#[derive(Clone, Debug, PartialEq)]
pub struct Maze2dMode {
    /// The map.
    pub map: Map,
    /// Reward 1 within the goal radius and else 0, instead of exp(-distance).
    pub sparse: bool,
    /// Episodes start in the map's start cell, as in the paper, instead of in any free cell, as in D4RL.
    pub fixed_start: bool,
    /// Each level has a goal of its own in a random free cell, instead of the map's.
    pub random_goal: bool,
    /// Steps after which an episode is truncated.
    pub limit: u32,
    /// Reaching the goal terminates the episode. D4RL's never terminate. Better with `sparse`: the dense reward is
    /// never negative, so staying away from the goal until time is up earns more than reaching it.
    pub end_at_goal: bool,
    /// The walls stand 0.2 aside, as D4RL's do.
    pub offset: bool,
    /// The contact model.
    pub contact: ContactModel,
    /// The demonstrator walks to one random cell after the other, as in D4RL's data. The game itself stays the same.
    pub retarget: bool,
}

/// Options of every map, each with a value it takes.
const OPTIONS: [&str; 11] = [
    "sparse",
    "fixed-start",
    "goal=random",
    "goal=fixed",
    "limit=1000",
    "end-at-goal",
    "no-end-at-goal",
    "no-offset",
    "contact=soft",
    "contact=rapier",
    "retarget",
];

impl Maze2dMode {
    /// The modes without options.
    pub const NAMES: [&'static str; 5] = Map::NAMES;

    /// Returns D4RL's rules on a map: random start, dense reward, its time limit (version 1).
    pub fn new(map: Map) -> Self {
        let limit = default_limit(&map);
        Self {
            map,
            sparse: false,
            fixed_start: false,
            random_goal: false,
            limit,
            end_at_goal: false,
            offset: true,
            contact: ContactModel::Soft,
            retarget: false,
        }
    }

    /// Returns the offset of the walls, along both axes.
    pub fn wall_offset(&self) -> f64 {
        if self.offset { D4RL_OFFSET } else { 0.0 }
    }

    /// Returns the maze of a level.
    ///
    /// # Errors
    ///
    /// No maze can be generated for this seed.
    pub fn maze(&self, seed: u64) -> Result<Maze, MazeError> {
        self.map.maze2d(seed)
    }

    /// Takes one option.
    pub(super) fn set(&mut self, option: &str) -> Result<(), MazeModeError> {
        let (key, value) = option.split_once('=').unwrap_or((option, ""));
        match (key, value) {
            ("sparse", "") => self.sparse = true,
            ("fixed-start", "") => self.fixed_start = true,
            ("goal", "random") => self.random_goal = true,
            ("goal", "fixed") => self.random_goal = false,
            ("end-at-goal", "") => self.end_at_goal = true,
            ("no-end-at-goal", "") => self.end_at_goal = false,
            ("no-offset", "") => self.offset = false,
            ("contact", "soft") => self.contact = ContactModel::Soft,
            ("contact", "rapier") => self.contact = ContactModel::Rapier,
            ("retarget", "") => self.retarget = true,
            ("limit", _) => {
                let steps = value.parse().ok().filter(|&steps| steps > 0);
                let wanted = "write a number of steps, at least 1 and at most 4294967295, as in limit=1000";
                self.limit = steps.ok_or_else(|| OptionError::new(key, value, wanted))?;
            }
            _ if self.map.set_option(key, value)? => {}
            _ => return Err(self.map.unknown_option(option, &OPTIONS).into()),
        }
        Ok(())
    }

    /// Checks that no two options contradict each other.
    pub(super) fn check_together(&self) -> Result<(), MazeModeError> {
        if self.retarget && self.end_at_goal {
            let why = "`retarget` needs episodes that go on at the goal: leave out end-at-goal";
            return Err(MazeModeError::Together(why));
        }
        Ok(())
    }

    /// Returns the differences from the map's defaults besides its own options, in their written order.
    pub(super) fn options(&self) -> Vec<String> {
        let default = Self::new(self.map.clone());
        let mut options = Vec::new();
        let mut add = |differs: bool, option: &str| {
            if differs {
                options.push(option.to_owned());
            }
        };
        add(self.sparse, "sparse");
        add(self.fixed_start, "fixed-start");
        add(self.random_goal, "goal=random");
        add(self.limit != default.limit, &format!("limit={}", self.limit));
        add(self.end_at_goal, "end-at-goal");
        add(!self.offset, "no-offset");
        add(self.contact == ContactModel::Rapier, "contact=rapier");
        add(self.retarget, "retarget");
        options
    }
}

/// Returns D4RL's limits, version 1; for other maps, time for the longest paths at the demonstrator's pace.
fn default_limit(map: &Map) -> u32 {
    match map {
        Map::Umaze => 300,
        Map::Medium => 600,
        Map::Large => 800,
        Map::Xl => 2000,
        Map::Random(spec) => u32::try_from(spec.rows.saturating_mul(spec.columns)).map_or(u32::MAX, steps_for),
    }
}

/// Returns the time limit of a generated maze with so many cells.
fn steps_for(cells: u32) -> u32 {
    cells.saturating_mul(15).max(300)
}

/// Returns the subject of an option, which may occur only once.
pub(super) fn subject(option: &str) -> &str {
    let key = option.split_once('=').map_or(option, |(key, _)| key);
    key.strip_prefix("no-").unwrap_or(key)
}

impl FromStr for Maze2dMode {
    type Err = MazeModeError;

    fn from_str(text: &str) -> Result<Self, MazeModeError> {
        let mut parts = text.split('+');
        let mut map = Map::named(parts.next().unwrap_or_default())?;
        let options: Vec<&str> = parts.collect();
        MazeModeError::check_once(&options, subject)?;
        // The size of a generated maze decides the default limit.
        for (key, value) in options.iter().filter_map(|option| option.split_once('=')) {
            map.set_option(key, value)?;
        }
        map.check()?;
        let mut mode = Self::new(map);
        options.iter().try_for_each(|option| mode.set(option))?;
        mode.check_together()?;
        Ok(mode)
    }
}

impl fmt::Display for Maze2dMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.map)?;
        self.options().iter().try_for_each(|option| write!(f, "+{option}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(text: &str) -> Maze2dMode {
        text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
    }

    #[test]
    fn text_form_reads_back_and_leaves_defaults_out() {
        for text in [
            "umaze",
            "medium+sparse",
            "medium+fixed-start+limit=1000",
            "large+goal=random+end-at-goal+no-offset+contact=rapier",
            "medium+retarget",
            "random+size=9x9+loops=0.2",
            "random+size=9x9+end-at-goal",
        ] {
            assert_eq!(mode(text).to_string(), text);
        }
        assert_eq!(mode("medium+limit=600+contact=soft+goal=fixed+no-end-at-goal").to_string(), "medium");
        assert_eq!(mode("random+limit=400+size=7x9").to_string(), "random+size=7x9+limit=400");
    }

    #[test]
    fn maps_bring_the_limits_of_d4rl() {
        for (map, limit) in [("umaze", 300), ("medium", 600), ("large", 800)] {
            let mode = mode(map);
            assert_eq!((mode.limit, mode.end_at_goal, mode.fixed_start, mode.offset), (limit, false, false, true));
        }
        assert!(!mode("random").end_at_goal);
    }

    #[test]
    fn mistakes_are_named() {
        for (text, part) in [
            ("medum", "unknown map `medum` (did you mean `medium`?)"),
            ("", "unknown map ``"),
            ("medium+sprse", "unknown option `sprse` (did you mean `sparse`?)"),
            ("medium+size=9x9", "unknown option `size=9x9`"),
            ("medium+limit=0", "`limit=0`: write a number of steps"),
            ("medium+limit", "`limit=`: write a number of steps"),
            ("medium+contact=bullet", "contact=rapier"),
            ("medium+limit=1+limit=2", "`limit=2` repeats"),
            ("medium+end-at-goal+no-end-at-goal", "contradicts"),
            ("random+loops=2", "loops = 2"),
            ("random+retarget+end-at-goal", "leave out end-at-goal"),
        ] {
            let error = text.parse::<Maze2dMode>().expect_err(text).to_string();
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
