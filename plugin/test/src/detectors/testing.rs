//! Moments for tests.

use crate::detectors::{LevelDefect, LevelDetector, TestedBy, TestedLevel};
use bevy::prelude::*;
use bevy_playbot::{
    action::ActionValue,
    episode::{EpisodeEnd, EpisodeResult},
    vision::ObservationConfig,
};
use playbot_harness::{
    detector::{Detector, DetectorTick, LevelAhead, NoProofs, Proofs, WorldTick},
    eval::Player,
    floor_plan::FloorPlan,
    foreign::ForeignGame,
};

/// The data of a tick.
#[derive(Clone, Debug)]
pub struct Step {
    pub position: Option<Vec2>,
    pub height: Option<f32>,
    pub action: u32,
    pub seen: f32,
    pub reward: f32,
    pub is_success: bool,
}

impl Step {
    /// An agent at this position; the number of the tick is its action.
    pub fn at(tick: usize, x: f32, y: f32) -> Self {
        let action = tick as u32 % 3;
        Self { position: Some(Vec2::new(x, y)), height: None, action, seen: 0.5, reward: 0.0, is_success: false }
    }
}

/// A level of ten tiles by ten, with walls around it, its start at the lower left and its goal at the upper right.
pub(crate) fn room() -> LevelAhead {
    let square = |row: usize, column: usize| {
        let corner = Vec2::new(column as f32, row as f32);
        Rect::from_corners(corner, corner + 1.0)
    };
    let is_wall = |row: usize, column: usize| row.is_multiple_of(9) || column.is_multiple_of(9);
    let plan = FloorPlan::of_tiles([10, 10], is_wall, square, [Vec2::splat(1.5), Vec2::splat(8.5)]);
    LevelAhead { level: 0, plan: Some(plan) }
}

/// The message of a detector about an episode on a level, with the tick.
pub(crate) fn found(detector: &dyn Detector, level: &LevelAhead, steps: &[Step]) -> Option<(u32, String)> {
    found_proving(detector, level, steps, &NoProofs)
}

/// The same in a game with proofs.
pub(crate) fn found_proving(
    detector: &dyn Detector,
    level: &LevelAhead,
    steps: &[Step],
    proofs: &dyn Proofs,
) -> Option<(u32, String)> {
    play(detector, level, steps, proofs, false)
}

/// The same for an episode that ends with the time limit after its last tick.
pub(crate) fn timed_out_proving(
    detector: &dyn Detector,
    level: &LevelAhead,
    steps: &[Step],
    proofs: &dyn Proofs,
) -> Option<(u32, String)> {
    play(detector, level, steps, proofs, true)
}

fn play(
    detector: &dyn Detector,
    level: &LevelAhead,
    steps: &[Step],
    proofs: &dyn Proofs,
    is_timed_out: bool,
) -> Option<(u32, String)> {
    let mut world = World::new();
    let agent = world.spawn_empty().id();
    let mut watch = detector.watch(level)?;
    (0..).zip(steps).find_map(|(tick, step)| {
        let action = ActionValue::Discrete(step.action);
        let observation = [step.seen];
        let moment = DetectorTick {
            world: &world,
            agent,
            level: level.level,
            tick,
            action: &action,
            observation: &observation,
            state_hash: 0,
            reward: step.reward,
            position: step.position,
            height: step.height,
            is_success: step.is_success,
            proofs,
        };
        let is_end = is_timed_out && tick as usize + 1 == steps.len();
        let result = EpisodeResult {
            level: level.level,
            end: EpisodeEnd::Truncated,
            success: step.is_success,
            ticks: tick + 1,
            clipped: 0,
            total_reward: 0.0,
        };
        let now = watch.tick(&moment);
        let message = now.or_else(|| if is_end { watch.end(&moment, &result) } else { None });
        message.map(|message| (tick, message))
    })
}

/// The message of a detector about a World.
pub(crate) fn found_in(detector: &dyn Detector, world: &World) -> Option<String> {
    detector.watch_world()?.tick(&WorldTick { world, errors: &[] })
}

/// The end of a won episode.
pub(crate) const WON: EpisodeEnd = EpisodeEnd::Terminated { success: true };

/// The end of a lost episode.
pub(crate) const LOST: EpisodeEnd = EpisodeEnd::Terminated { success: false };

/// The end of an episode by the time limit.
pub(crate) const TIMED_OUT: EpisodeEnd = EpisodeEnd::Truncated;

/// The messages of a detector about a level without plan after these episodes of one tester. For each episode: its end,
/// its ticks and its position.
pub(crate) fn inspected(
    detector: &dyn LevelDetector,
    episodes: &[(EpisodeEnd, u32, [f32; 2])],
    par: Option<f64>,
) -> Vec<LevelDefect> {
    let game = ForeignGame::new("garden", 1, |_: &mut App| {});
    let result = |&(end, ticks, _): &(EpisodeEnd, u32, [f32; 2])| EpisodeResult {
        level: 0,
        end,
        success: end.is_success(),
        ticks,
        clipped: 0,
        total_reward: 0.0,
    };
    let tester = TestedBy {
        name: "random",
        player: &Player::Demonstrator,
        observation_config: ObservationConfig::default(),
        seed: 0,
        episodes: (0..).zip(episodes.iter().map(result)).collect(),
        positions: (0..).zip(episodes.iter().map(|(_, _, position)| Vec2::from_array(*position))).collect(),
    };
    let (mode, testers) = ("plain", vec![tester]);
    detector.inspect(&TestedLevel { game: &game, mode, level: 0, index: 0, par, testers, stop: &|| false })
}
