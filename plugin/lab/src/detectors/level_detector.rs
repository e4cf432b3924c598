//! The contract of detectors that examine a level after it was tested.

use std::collections::BTreeMap;

use bevy::math::Vec2;
use bevy_playbot::{episode::EpisodeResult, vision::ObservationConfig};

use crate::{detector::Setting, eval::Player, game::Game};

/// A search for one kind of defect in each level, after all testers have played it. The detector may play there itself.
///
/// Findings must depend on the level and its episodes alone, so that results are the same on any number of threads and
/// shards.
pub trait LevelDetector: Send + Sync {
    /// Returns its name, in small letters and hyphens.
    fn name(&self) -> &'static str;

    /// Returns the defect that it finds, in one line.
    fn describe(&self) -> &'static str;

    /// Returns whether it is a default detector.
    fn is_usual(&self) -> bool {
        false
    }

    /// Returns its settings.
    fn settings(&mut self) -> Vec<Setting<'_>> {
        Vec::new()
    }

    /// Returns whether it compares several testers, so that one of them alone may not show the finding.
    fn compares_testers(&self) -> bool {
        false
    }

    /// Returns the defects of a level.
    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect>;

    /// Returns the input that reproduces its findings.
    fn shown_by(&self) -> ShownBy {
        ShownBy::Nothing
    }

    /// Returns whether it finds something in a level that no tester has played: for [`ShownBy::Level`].
    fn is_in_level(&self, _game: &dyn Game, _mode: &str, _level: u64) -> bool {
        false
    }

    /// Returns whether an episode with this end shows its finding: for [`ShownBy::Episode`]. `tick` is that of the
    /// finding, if it is known already.
    fn is_in_episode(&self, _result: &EpisodeResult, _tick: Option<u32>) -> bool {
        false
    }
}

/// The input that reproduces a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownBy {
    /// None: such findings have no file.
    Nothing,
    /// The level, without any tester.
    Level,
    /// The end of the episode that the finding names.
    Episode,
}

/// A tested level.
pub struct TestedLevel<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Mode of the level.
    pub mode: &'a str,
    /// Number of the level.
    pub level: u64,
    /// Its index in the range of the test, from 0; the same in all shards.
    pub place: u64,
    /// Ticks that the level should take, by the designer or by demonstrations.
    pub par: Option<f64>,
    /// The testers.
    pub testers: Vec<TestedBy<'a>>,
    /// Returns true to stop. Findings no longer count then, and long searches should end.
    pub stop: &'a dyn Fn() -> bool,
}

/// The episodes of a tester on a level.
pub struct TestedBy<'a> {
    /// Its name.
    pub name: &'a str,
    /// The player.
    pub player: &'a Player,
    /// Its observation.
    pub observation_config: ObservationConfig,
    /// Seed of its first episode.
    pub seed: u64,
    /// Its episodes, each with its number, without those in which the game panicked.
    pub episodes: Vec<(u32, EpisodeResult)>,
    /// Position of the agent at the end of these episodes, by their numbers, if the game reports it.
    pub places: BTreeMap<u32, Vec2>,
}

/// A defect of a level.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LevelDefect {
    /// The tester; `None` if the defect needs no tester.
    pub tester: Option<String>,
    /// Episode of that tester, from 0.
    pub episode: Option<u32>,
    /// Tick of the episode, from 0.
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
    /// Settings, as `name.key=value`, with which the detector finds it again from the episode alone: for
    /// [`ShownBy::Episode`].
    pub settings: Vec<String>,
}

impl TestedLevel<'_> {
    /// Returns whether this is one of every `every` levels of the range, the first one included.
    pub fn is_sample(&self, every: f64) -> bool {
        self.place.is_multiple_of((every as u64).max(1))
    }

    /// Returns all episodes with the names of their testers.
    pub fn episodes(&self) -> impl Iterator<Item = (&str, u32, &EpisodeResult)> {
        self.testers
            .iter()
            .flat_map(|tester| tester.episodes.iter().map(move |(number, result)| (tester.name, *number, result)))
    }
}
