//! Detectors that every game has: each looks for one kind of defect while testers play, or in the levels after play.
//!
//! [`Detectors`] are those of a test. Default detectors cost little and give no false alarm in an unmutated game.
//! Opt-in detectors are named with `--detect`. All have settings, and [`list`] describes them. A game adds its own with
//! [`TestTools::detectors`](playbot_harness::game::TestTools::detectors), see
//! [`detector`](playbot_harness::detector).
//!
//! The files of the folder, in reading order:
//!
//! - `selection`: the detectors of a test, with their settings.
//! - `positions`, `soft_lock`, `frozen`, `error_log`: detectors that watch play, tick by tick.
//! - `goals`, `rewards`, `clocks`: detectors of play, and of levels after play.
//! - `dead_action`, `fading_action`, `determinism`, `entity_leak`: detectors that play a tested level again.
//! - `par`: pars of levels, for the detectors of slow and fast play.

mod clocks;
mod dead_action;
mod determinism;
mod entity_leak;
mod error_log;
mod fading_action;
mod frozen;
mod goals;
mod par;
mod positions;
mod rewards;
mod selection;
mod soft_lock;
#[cfg(test)]
mod testing;

use crate::detectors::{
    clocks::{ClockEnd, ShortTime, TooLong, UnevenTime},
    dead_action::DeadAction,
    determinism::Determinism,
    entity_leak::EntityLeak,
    error_log::ErrorLog,
    fading_action::FadingAction,
    frozen::{BlankPicture, FrozenWorld, Runaway},
    goals::{Shortcut, UnreachableRegion},
    positions::{FellThrough, OutOfBounds, PhysicsExplosion, Stuck},
    rewards::{RewardFarm, RewardLoop},
    soft_lock::SoftLock,
};
use bevy::{math::Vec2, prelude::*};
use bevy_playbot::{action::ActionValue, engine::GameCall, episode::EpisodeResult, vision::ObservationConfig};
use playbot_harness::{
    detector::{Detector, DetectorSetting, LevelProof, Proofs},
    eval::Player,
    game::{Game, prove_level},
};
use std::collections::BTreeMap;

pub use crate::detectors::{
    clocks::{SlowTick, TIMING, TickTime, forget_timing},
    error_log::{ErrorLogReader, LogLine, LogReader},
    goals::{FarGoal, GoalIgnored},
    par::{ParError, Pars},
    positions::ThroughWall,
    selection::{DetectorChoice, DetectorError, Detectors},
};

/// The findings of every test, for any selection of detectors: names and descriptions.
pub const ALWAYS: [(&str, &str); 4] = [
    ("panic", "the game panics"),
    ("fault", "the game breaks its contract: a reward that is not a number, a missing observation or the like"),
    ("endless", "an episode does not end"),
    ("unreachable-goal", "the goal of the level is proved to be out of reach"),
];

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
    fn is_default(&self) -> bool {
        false
    }

    /// Returns its settings.
    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        Vec::new()
    }

    /// Returns whether it compares several testers, so that one of them alone may not show the finding.
    fn compares_testers(&self) -> bool {
        false
    }

    /// Returns whether its findings depend on the testers and their episodes. Those of the others are computed once for all
    /// testers of a level.
    fn depends_on_testers(&self) -> bool {
        true
    }

    /// Returns the ticks that an episode must have at least for it to find anything: a test names the detectors for which
    /// all episodes were too short. By default a tick is enough.
    fn least_ticks(&self) -> u32 {
        1
    }

    /// Returns the ticks of the longest episode that it examines; `None` if that is not known.
    fn most_ticks(&self, level: &TestedLevel<'_>) -> Option<u32> {
        level.episodes().map(|(_, _, result)| result.ticks).max()
    }

    /// Returns a setting, as `key=value`, with which it can find something in episodes of so many ticks, if there is one.
    fn setting_for(&self, _ticks: u32) -> Option<String> {
        None
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

/// A tested level.
pub struct TestedLevel<'a> {
    /// The game.
    pub game: &'a dyn Game,
    /// Mode of the level.
    pub mode: &'a str,
    /// Number of the level.
    pub level: u64,
    /// Its index in the range of the test, from 0; the same in all shards.
    pub index: u64,
    /// Ticks that the level should take, by the designer or by demonstrations.
    pub par: Option<f64>,
    /// The testers.
    pub testers: Vec<TestedBy<'a>>,
    /// Returns true to stop. Findings no longer count then, and long searches should end.
    pub stop: &'a dyn Fn() -> bool,
}

impl TestedLevel<'_> {
    /// Returns whether this is one of every `every` levels of the range, the first one included.
    pub fn is_sample(&self, every: f64) -> bool {
        self.index.is_multiple_of((every as u64).max(1))
    }

    /// Returns all episodes with the names of their testers.
    pub fn episodes(&self) -> impl Iterator<Item = (&str, u32, &EpisodeResult)> {
        self.testers
            .iter()
            .flat_map(|tester| tester.episodes.iter().map(move |(number, result)| (tester.name, *number, result)))
    }
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
    pub positions: BTreeMap<u32, Vec2>,
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

/// Returns the descriptions of a game's detectors, without [`ALWAYS`].
pub fn list(game: &dyn Game) -> Vec<DetectorInfo> {
    let info = |mut known: Known| DetectorInfo {
        name: known.name(),
        about: known.describe(),
        is_default: known.is_default(),
        settings: known.settings().into_iter().map(|setting| (setting.key, *setting.value, setting.what)).collect(),
    };
    all(game).into_iter().map(info).collect()
}

/// The description of a detector.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorInfo {
    /// Its name.
    pub name: &'static str,
    /// The defect that it finds, in one line.
    pub about: &'static str,
    /// Whether it is a default detector.
    pub is_default: bool,
    /// Its settings: name, value and meaning.
    pub settings: Vec<(&'static str, f64, &'static str)>,
}

/// Returns the names of the detectors that only this game has.
pub fn own_detectors(game: &dyn Game) -> Vec<String> {
    let is_general = |name: &str| general().any(|known| known.name() == name);
    let names = game.tools().tests.detectors().into_iter().map(|detector| detector.name());
    names.filter(|name| !is_general(name)).map(str::to_owned).collect()
}

/// Returns whether the detector with this name compares several testers.
pub(crate) fn compares_testers(name: &str) -> bool {
    general().any(|known| matches!(known, Known::Level(known) if known.name() == name && known.compares_testers()))
}

/// Returns whether the detector with this name examines levels after play.
pub(crate) fn looks_after_play(name: &str) -> bool {
    general().any(|known| matches!(known, Known::Level(known) if known.name() == name))
}

/// Returns all detectors for a game, its own included. A detector of the game replaces a general one with its name.
fn all(game: &dyn Game) -> Vec<Known> {
    let own = game.tools().tests.detectors();
    let is_own = |name: &str| own.iter().any(|detector| detector.name() == name);
    let mut known: Vec<Known> = general().filter(|known| !is_own(known.name())).collect();
    known.extend(own.into_iter().map(Known::Ticks));
    known
}

/// Returns the detectors of all games.
fn general() -> impl Iterator<Item = Known> {
    let ticks: Vec<Box<dyn Detector>> = vec![
        Box::<Stuck>::default(),
        Box::<SoftLock>::default(),
        Box::<ThroughWall>::default(),
        Box::<OutOfBounds>::default(),
        Box::<FellThrough>::default(),
        Box::<Runaway>::default(),
        Box::<FrozenWorld>::default(),
        Box::<ErrorLog>::default(),
        Box::<PhysicsExplosion>::default(),
        Box::<BlankPicture>::default(),
        Box::<RewardLoop>::default(),
        Box::<GoalIgnored>::default(),
        Box::<FarGoal>::default(),
        Box::<ShortTime>::default(),
    ];
    let levels: Vec<Box<dyn LevelDetector>> = vec![
        Box::<EntityLeak>::default(),
        Box::<Shortcut>::default(),
        Box::<TooLong>::default(),
        Box::<ClockEnd>::default(),
        Box::<UnevenTime>::default(),
        Box::<UnreachableRegion>::default(),
        Box::<Determinism>::default(),
        Box::<DeadAction>::default(),
        Box::<FadingAction>::default(),
        Box::<RewardFarm>::default(),
    ];
    let known = ticks.into_iter().map(Known::Ticks).chain(levels.into_iter().map(Known::Level));
    known.chain([Known::Clock(TickTime::default())])
}

/// A detector of one of the three kinds.
enum Known {
    /// Watches agents or Worlds, tick by tick.
    Ticks(Box<dyn Detector>),
    /// Examines levels after they were tested.
    Level(Box<dyn LevelDetector>),
    /// Measures time.
    Clock(TickTime),
}

impl Known {
    pub fn name(&self) -> &'static str {
        match self {
            Self::Ticks(detector) => detector.name(),
            Self::Level(detector) => detector.name(),
            Self::Clock(_) => TickTime::NAME,
        }
    }

    pub fn describe(&self) -> &'static str {
        match self {
            Self::Ticks(detector) => detector.describe(),
            Self::Level(detector) => detector.describe(),
            Self::Clock(_) => TickTime::ABOUT,
        }
    }

    pub fn is_default(&self) -> bool {
        match self {
            Self::Ticks(detector) => detector.is_default(),
            Self::Level(detector) => detector.is_default(),
            Self::Clock(_) => false,
        }
    }

    pub fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        match self {
            Self::Ticks(detector) => detector.settings(),
            Self::Level(detector) => detector.settings(),
            Self::Clock(times) => times.settings(),
        }
    }
}

/// A count of an agent's changes of action.
#[derive(Default)]
struct Efforts {
    last: Option<ActionValue>,
    changes: u32,
}

impl Efforts {
    /// Counts the action of this tick.
    pub fn note(&mut self, action: &ActionValue) {
        if self.last.as_ref() != Some(action) {
            self.changes += 1;
            self.last = Some(action.clone());
        }
    }

    /// Resets the count.
    pub fn restart(&mut self) {
        self.changes = 0;
    }

    /// Returns whether the action changed in at least a tenth of these ticks. An agent that holds one key for ever
    /// tries nothing.
    pub fn are_many(&self, ticks: u32) -> bool {
        self.changes.saturating_mul(10) >= ticks.max(20)
    }
}

/// The game's proofs about an agent's episode in a World.
pub(crate) struct GameProofs<'a> {
    pub game: &'a dyn Game,
    pub mode: &'a str,
    pub level: u64,
    pub world: &'a World,
    pub agent: Entity,
}

impl Proofs for GameProofs<'_> {
    fn of_level(&self) -> LevelProof {
        prove_level(self.game, self.mode, self.level)
    }

    fn of_state(&self) -> LevelProof {
        let _call = GameCall::begin("proving whether the goal can still be reached in", [self.level]);
        self.game.tools().state.prove_from(self.world, self.agent)
    }
}
