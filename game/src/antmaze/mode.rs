//! Modes of the game: a map and its options, as text.

use crate::maze::{Cell, Map, MazeModeError, OptionError, fixed::antmaze};
use std::{fmt, str::FromStr};

/// The ingredients of a level of AntMaze. Written as the map and its options, `large+sparse+limit=500`; the defaults of
/// options are those of [`AntMazeMode::on`].
#[derive(Clone, Debug, PartialEq)]
pub struct AntMazeMode {
    /// The maze.
    pub map: Map,
    /// The reward rule.
    pub pay: Pay,
    /// The cell of the goal.
    pub goals: Goals,
    /// Offset of the goal within its cell.
    pub goal_noise: GoalNoise,
    /// The ant starts in a random free cell, U(0, 1) metre beyond its centre along each axis, instead of the maze's
    /// start. Written `random-start`.
    pub random_start: bool,
    /// Ticks of 0.1 s after which an episode is truncated, at least 1. Written `limit=500`.
    pub limit: u32,
}

/// Reward of each tick, by the distance to the goal after the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pay {
    /// Minus the distance in metres, as in D4RL.
    #[default]
    Distance,
    /// exp(-distance), as in Gymnasium-Robotics, and as there the episode goes on at the goal. Written `dense=exp`.
    Exponential,
    /// 1 at the goal and 0 elsewhere. Written `sparse`.
    Sparse,
}

/// Choice of the goal's cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Goals {
    /// The maze's goal.
    #[default]
    Fixed,
    /// One of those of the map's demonstrations, drawn from the level's seed. Written `goals=demo`.
    Demo,
    /// Any free cell but the maze's start, drawn from the level's seed. Written `goals=random`.
    Random,
}

/// Offset of the goal within its cell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GoalNoise {
    /// In the middle of the cell.
    #[default]
    None,
    /// U(0, 1) + U(0, 0.5) metres beyond the middle along each axis, drawn from the level's seed. Written
    /// `goal-noise=d4rl`.
    ///
    /// D4RL's first versions draw it once for all episodes: that is one level seed. Its last one draws it for each.
    D4rl,
}

/// Options of every map.
const OPTIONS: [&str; 7] =
    ["sparse", "dense=exp", "goals=demo", "goals=random", "goal-noise=d4rl", "random-start", "limit=1000"];

impl AntMazeMode {
    /// Returns the default mode on a map, for comparisons. It has a dense reward, a fixed start and goal, and time for
    /// 1000 ticks, on the smallest map for 700.
    pub fn on(map: Map) -> Self {
        let (pay, goals, goal_noise) = (Pay::default(), Goals::default(), GoalNoise::default());
        Self { limit: default_limit(&map), map, pay, goals, goal_noise, random_start: false }
    }

    /// Returns the goals of the demonstrations on this map; empty on a generated one.
    pub fn demo_goals(&self) -> &'static [Cell] {
        match self.map {
            Map::Umaze => &antmaze::UMAZE_DEMO_GOALS,
            Map::Medium => &antmaze::MEDIUM_DEMO_GOALS,
            Map::Large => &antmaze::LARGE_DEMO_GOALS,
            Map::Xl => &antmaze::XL_DEMO_GOALS,
            Map::Random(_) => &[],
        }
    }

    pub(super) fn set(&mut self, option: &str) -> Result<(), MazeModeError> {
        let (key, value) = option.split_once('=').unwrap_or((option, ""));
        match option {
            "sparse" => self.pay = Pay::Sparse,
            "dense=exp" => self.pay = Pay::Exponential,
            "goals=fixed" => self.goals = Goals::Fixed,
            "goals=demo" => self.goals = Goals::Demo,
            "goals=random" => self.goals = Goals::Random,
            "goal-noise=none" => self.goal_noise = GoalNoise::None,
            "goal-noise=d4rl" => self.goal_noise = GoalNoise::D4rl,
            "random-start" => self.random_start = true,
            _ if key == "limit" => {
                let ticks = value.parse().ok().filter(|ticks| *ticks > 0);
                let wanted = "write a number of ticks, at least 1 and at most 4294967295, as in limit=1000";
                self.limit = ticks.ok_or_else(|| OptionError::new(key, value, wanted))?;
            }
            _ if self.map.set_option(key, value)? => {}
            _ => return Err(self.map.unknown_option(option, &OPTIONS).into()),
        }
        Ok(())
    }

    fn check(self) -> Result<Self, MazeModeError> {
        self.map.check()?;
        if self.goals == Goals::Demo && self.demo_goals().is_empty() {
            let why = "generated mazes have no goals of demonstrations; take goals=random";
            return Err(OptionError::new("goals", "demo", why).into());
        }
        Ok(self)
    }
}

fn default_limit(map: &Map) -> u32 {
    if *map == Map::Umaze { 700 } else { 1000 }
}

/// Returns the subject of an option, which may occur only once.
pub(super) fn subject(option: &str) -> &str {
    match option.split_once('=').map_or(option, |(key, _)| key) {
        "dense" => "sparse",
        key => key,
    }
}

impl FromStr for AntMazeMode {
    type Err = MazeModeError;

    fn from_str(text: &str) -> Result<Self, MazeModeError> {
        let mut parts = text.split('+');
        let mut mode = Self::on(Map::named(parts.next().unwrap_or_default())?);
        let options: Vec<&str> = parts.collect();
        MazeModeError::check_once(&options, subject)?;
        options.iter().try_for_each(|option| mode.set(option))?;
        mode.check()
    }
}

impl fmt::Display for AntMazeMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.map)?;
        f.write_str(match self.pay {
            Pay::Distance => "",
            Pay::Exponential => "+dense=exp",
            Pay::Sparse => "+sparse",
        })?;
        f.write_str(match self.goals {
            Goals::Fixed => "",
            Goals::Demo => "+goals=demo",
            Goals::Random => "+goals=random",
        })?;
        f.write_str(match self.goal_noise {
            GoalNoise::None => "",
            GoalNoise::D4rl => "+goal-noise=d4rl",
        })?;
        f.write_str(if self.random_start { "+random-start" } else { "" })?;
        if self.limit == default_limit(&self.map) { Ok(()) } else { write!(f, "+limit={}", self.limit) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        text.parse::<AntMazeMode>().expect_err("not a mode").to_string()
    }

    #[test]
    fn modes_are_read_as_they_are_written() {
        for text in [
            "umaze",
            "medium",
            "large+sparse",
            "xl+goals=demo+goal-noise=d4rl+random-start+limit=500",
            "random+size=9x13+loops=0.25+corridor=2+dense=exp+goals=random",
        ] {
            assert_eq!(text.parse::<AntMazeMode>().expect("a mode").to_string(), text);
        }
    }

    #[test]
    fn defaults_are_left_out() {
        let written = |text: &str| text.parse::<AntMazeMode>().expect("a mode").to_string();
        assert_eq!(written("umaze+limit=700+goals=fixed+goal-noise=none"), "umaze");
        assert_eq!(written("medium+limit=700"), "medium+limit=700");
        assert_eq!(written("large+random-start+sparse"), "large+sparse+random-start");
        let mode: AntMazeMode = "medium".parse().expect("a mode");
        assert_eq!(mode, AntMazeMode::on(Map::Medium));
        assert_eq!((mode.limit, mode.pay, mode.random_start), (1000, Pay::Distance, false));
    }

    #[test]
    fn errors_name_what_would_be_right() {
        for (text, words) in [
            ("medum", &["unknown map `medum`", "did you mean `medium`?", "umaze", "random"][..]),
            ("medium+spares", &["unknown option `spares`", "did you mean `sparse`?", "limit=1000"]),
            ("medium+size=9x9", &["unknown option `size=9x9`", "goals=demo"]),
            ("medium+limit=0", &["limit=0", "at least 1"]),
            ("medium+limit=many", &["limit=many", "at least 1"]),
            ("random+goals=demo", &["goals=demo", "goals=random"]),
            ("random+size=3x3", &["size=3x3"]),
            ("medium+sparse+dense=exp", &["`dense=exp`", "contradicts"]),
            ("medium+limit=5+limit=6", &["`limit=6`", "repeats"]),
            ("", &["unknown map ``", "medium"]),
        ] {
            let error = error(text);
            assert!(words.iter().all(|word| error.contains(word)), "{text}: {error}");
        }
    }
}
