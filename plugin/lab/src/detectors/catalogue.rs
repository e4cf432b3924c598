//! The list of all detectors.

use super::{
    blank_picture::BlankPicture, clock_end::ClockEnd, dead_action::DeadAction, determinism::Determinism,
    entity_leak::EntityLeak, error_log::ErrorLog, explosion::PhysicsExplosion, far_goal::FarGoal,
    fell_through::FellThrough, frozen::FrozenWorld, goal_ignored::GoalIgnored, level_detector::LevelDetector,
    out_of_bounds::OutOfBounds, reward_farm::RewardFarm, reward_loop::RewardLoop, runaway::Runaway,
    short_time::ShortTime, shortcut::Shortcut, soft_lock::SoftLock, stuck::Stuck, through_wall::ThroughWall,
    tick_time::TickTime, too_long::TooLong, uneven_time::UnevenTime, unreachable_region::UnreachableRegion,
};
use crate::{
    detector::{Detector, Setting},
    game::Game,
};

/// The findings of every test, for any selection of detectors: names and descriptions.
pub const ALWAYS: [(&str, &str); 4] = [
    ("panic", "the game panics"),
    ("fault", "the game breaks its contract: a reward that is not a number, a missing observation or the like"),
    ("endless", "an episode does not end"),
    ("unreachable-goal", "the goal of the level is proved to be out of reach"),
];

/// A detector of one of the three kinds.
pub(super) enum Known {
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

    pub fn is_usual(&self) -> bool {
        match self {
            Self::Ticks(detector) => detector.is_usual(),
            Self::Level(detector) => detector.is_usual(),
            Self::Clock(_) => false,
        }
    }

    pub fn settings(&mut self) -> Vec<Setting<'_>> {
        match self {
            Self::Ticks(detector) => detector.settings(),
            Self::Level(detector) => detector.settings(),
            Self::Clock(times) => times.settings(),
        }
    }
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
        Box::<RewardFarm>::default(),
    ];
    let known = ticks.into_iter().map(Known::Ticks).chain(levels.into_iter().map(Known::Level));
    known.chain([Known::Clock(TickTime::default())])
}

/// Returns all detectors for a game, its own included. A detector of the game replaces a general one with its name.
pub(super) fn all(game: &dyn Game) -> Vec<Known> {
    let own = game.tools().tests.detectors();
    let is_own = |name: &str| own.iter().any(|detector| detector.name() == name);
    let mut known: Vec<Known> = general().filter(|known| !is_own(known.name())).collect();
    known.extend(own.into_iter().map(Known::Ticks));
    known
}

/// Returns whether the detector with this name compares several testers.
pub(crate) fn compares_testers(name: &str) -> bool {
    general().any(|known| matches!(known, Known::Level(known) if known.name() == name && known.compares_testers()))
}

/// Returns the names of the detectors that only this game has.
pub(crate) fn own_detectors(game: &dyn Game) -> Vec<String> {
    let is_general = |name: &str| general().any(|known| known.name() == name);
    let names = game.tools().tests.detectors().into_iter().map(|detector| detector.name());
    names.filter(|name| !is_general(name)).map(str::to_owned).collect()
}

/// The description of a detector.
#[derive(Clone, Debug, PartialEq)]
pub struct DetectorInfo {
    /// Its name.
    pub name: &'static str,
    /// The defect that it finds, in one line.
    pub about: &'static str,
    /// Whether it is a default detector.
    pub is_usual: bool,
    /// Its settings: name, value and meaning.
    pub settings: Vec<(&'static str, f64, &'static str)>,
}

/// Returns the descriptions of a game's detectors, without [`ALWAYS`].
pub fn list(game: &dyn Game) -> Vec<DetectorInfo> {
    let info = |mut known: Known| DetectorInfo {
        name: known.name(),
        about: known.describe(),
        is_usual: known.is_usual(),
        settings: known.settings().into_iter().map(|setting| (setting.key, *setting.value, setting.what)).collect(),
    };
    all(game).into_iter().map(info).collect()
}
