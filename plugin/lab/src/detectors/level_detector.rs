//! Detectors that look at a level after it was tested.

use std::collections::BTreeMap;

use bevy::math::Vec2;
use bevy_playbot::{episode::EpisodeResult, vision::ObservationConfig};

use crate::{detector::Setting, eval::Player, game::Game};

/// Looks for one kind of defect in each level, after all testers have played it. It may play there itself.
///
/// What it finds must depend on the level and its episodes alone, so that results are the same on any number of threads and
/// shards.
pub trait LevelDetector: Send + Sync {
    /// Its name, in small letters and hyphens.
    fn name(&self) -> &'static str;

    /// What it finds, in one line.
    fn describe(&self) -> &'static str;

    /// Whether it looks where nobody chooses.
    fn is_usual(&self) -> bool {
        false
    }

    /// Its settings.
    fn settings(&mut self) -> Vec<Setting<'_>> {
        Vec::new()
    }

    /// Whether it compares what several testers did, so that one of them alone may not show what it finds.
    fn compares_testers(&self) -> bool {
        false
    }

    /// What is wrong with a level.
    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect>;

    /// Where a finding of it is looked for again.
    fn shown_by(&self) -> ShownBy {
        ShownBy::Nothing
    }

    /// Whether it finds something in a level in which nobody else has played: for [`ShownBy::Level`].
    fn is_in_level(&self, _game: &dyn Game, _mode: &str, _level: u64) -> bool {
        false
    }

    /// Whether an episode that ended so shows its finding: for [`ShownBy::Episode`]. `tick` is that of the finding, if it is
    /// known already.
    fn is_in_episode(&self, _result: &EpisodeResult, _tick: Option<u32>) -> bool {
        false
    }
}

/// What shows a finding again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShownBy {
    /// Nothing that could be played again: such findings have no file.
    Nothing,
    /// The level, for which no tester has to play.
    Level,
    /// The end of the episode that the finding names.
    Episode,
}

/// A level that was tested.
pub struct TestedLevel<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Mode of the level.
    pub mode: &'a str,
    /// Number of the level.
    pub level: u64,
    /// Its place in the range of the test, from 0; the same in all shards.
    pub place: u64,
    /// Ticks that the level should take, if the designer or demonstrations say so.
    pub par: Option<f64>,
    /// Who played it.
    pub testers: Vec<TestedBy<'a>>,
    /// Whether somebody asked to stop: then what is found no longer counts, and who plays for long should end.
    pub stop: &'a dyn Fn() -> bool,
}

/// What a tester did on a level.
pub struct TestedBy<'a> {
    /// Its name.
    pub name: &'a str,
    /// The player.
    pub player: &'a Player,
    /// What it sees.
    pub observation_config: ObservationConfig,
    /// Seed of its first episode.
    pub seed: u64,
    /// Its episodes, each with its number; those in which the game broke are not among them.
    pub episodes: Vec<(u32, EpisodeResult)>,
    /// Where the agent was at the end of these episodes, if the game says, by their numbers.
    pub places: BTreeMap<u32, Vec2>,
}

/// Something that is wrong with a level.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LevelDefect {
    /// Who played; `None` if no tester had to.
    pub tester: Option<String>,
    /// Episode of that tester, from 0.
    pub episode: Option<u32>,
    /// Tick of the episode, from 0.
    pub tick: Option<u32>,
    /// What is wrong.
    pub message: String,
    /// What has to be set, as `name.key=value`, so that the detector can tell from the episode alone whether it is there: for
    /// [`ShownBy::Episode`].
    pub settings: Vec<String>,
}

impl TestedLevel<'_> {
    /// Whether this is one of every so many levels of the range, the first one included.
    pub fn is_sample(&self, every: f64) -> bool {
        self.place.is_multiple_of((every as u64).max(1))
    }

    /// All episodes with the names of their testers.
    pub fn episodes(&self) -> impl Iterator<Item = (&str, u32, &EpisodeResult)> {
        self.testers
            .iter()
            .flat_map(|tester| tester.episodes.iter().map(move |(number, result)| (tester.name, *number, result)))
    }
}
