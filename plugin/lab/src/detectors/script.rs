//! Episodes that are replayed up to some tick, and then changed.

use bevy::math::Vec2;
use bevy_playbot::{
    action::{Action, ActionValue},
    episode::{Episode, EpisodeCount},
    fault::Fault,
    vision::{ObservationConfig, VisionError},
};

use super::{
    determinism::hash_of_state,
    level_detector::{TestedBy, TestedLevel},
    probe::Probe,
};
use crate::{eval::Player, game::Game};

/// The first episode of a tester.
pub struct Script<'a> {
    pub game: &'a dyn Game,
    pub mode: &'a str,
    pub level: u64,
    pub player: &'a Player,
    pub observation_config: ObservationConfig,
    pub seed: u64,
    pub stop: &'a dyn Fn() -> bool,
}

/// The recorded course of an episode.
#[derive(Default)]
pub struct Course {
    /// The agent's action in each tick.
    pub actions: Vec<ActionValue>,
    /// The agent's position in each tick, if the game reports it.
    pub places: Vec<Option<Vec2>>,
    /// Whether it reached the goal.
    pub is_solved: bool,
}

/// Most ticks and frames to wait.
const MOST_RUNS: u32 = 200_000;

impl<'a> Script<'a> {
    /// Creates the script of a tester on a level.
    pub fn new(level: &TestedLevel<'a>, tester: &TestedBy<'a>) -> Self {
        let TestedBy { player, observation_config, seed, .. } = *tester;
        let TestedLevel { game, mode, level, stop, .. } = *level;
        Self { game, mode, level, player, observation_config, seed, stop }
    }

    /// Plays the tester's episode.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the test was stopped.
    pub fn course(&self) -> Result<Course, Fault> {
        let config = &self.observation_config;
        let probe = Probe::new(self.game, self.mode, self.level, self.player, config, vec![self.seed]);
        let mut probe = probe.map_err(broken)?.until(self.stop);
        let mut course = Course::default();
        for _ in 0..MOST_RUNS {
            let is_active = probe.tick()?;
            if ticks(&probe) > course.actions.len() {
                course.actions.extend(probe.world.get::<Action>(probe.agent).map(|action| action.0.clone()));
                course.places.push(self.game.tools().state.position(&probe.world, probe.agent));
            }
            if !is_active || probe.is_over() {
                break;
            }
        }
        course.is_solved = probe.world.get::<EpisodeCount>(probe.agent).is_some_and(|count| count.successes > 0);
        Ok(course)
    }

    /// Plays these actions, then another one for this many ticks. Returns the hashes of the states of the latter.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the test was stopped.
    pub fn play(&self, before: &[ActionValue], then: &ActionValue, ticks_then: usize) -> Result<Vec<u64>, Fault> {
        let probe = Probe::led(self.game, self.mode, self.level, self.seed);
        let mut probe = probe.map_err(broken)?.until(self.stop);
        let mut hashes = Vec::new();
        for _ in 0..MOST_RUNS {
            let played = ticks(&probe);
            let action = before.get(played).unwrap_or(then).clone();
            probe.world.entity_mut(probe.agent).insert(Action(action));
            let is_active = probe.tick()?;
            let now = ticks(&probe);
            if now > played && now > before.len() {
                hashes.push(hash_of_state(&probe.world, probe.agent));
            }
            if !is_active || probe.is_over() || now >= before.len() + ticks_then {
                break;
            }
        }
        Ok(hashes)
    }
}

fn broken(error: VisionError) -> Fault {
    Fault(error.to_string())
}

/// Returns the ticks of the episode.
fn ticks(probe: &Probe<'_>) -> usize {
    probe.world.get::<Episode>(probe.agent).map_or(0, |episode| episode.tick as usize)
}
