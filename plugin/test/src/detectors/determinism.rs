//! Games that do not repeat their episodes.

use crate::detectors::{LevelDefect, LevelDetector, TestedBy, TestedLevel, entity_leak::Probe};
use bevy::{math::Vec2, prelude::*};
use bevy_playbot::{
    action::{Action, ActionValue},
    episode::{Episode, EpisodeCount},
    fault::Fault,
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{detector::DetectorSetting, eval::Player, game::Game};

/// A finding for testers whose episode differs between two Worlds, or within one World that plays it again and again.
/// It is opt-in, because it plays a tester's first episode on some of the levels several more times.
pub struct Determinism {
    every: f64,
    ticks: f64,
    episodes: f64,
}

impl Default for Determinism {
    fn default() -> Self {
        Self { every: 10.0, ticks: 1000.0, episodes: 4.0 }
    }
}

impl Determinism {
    /// Plays the episode `episodes` times in a row in one World.
    fn play(&self, level: &TestedLevel<'_>, tester: &TestedBy<'_>, episodes: usize) -> Result<Vec<Played>, Fault> {
        let (player, config) = (tester.player, &tester.observation_config);
        let probe = Probe::new(level.game, level.mode, level.level, player, config, vec![tester.seed; episodes]);
        let mut probe = probe.map_err(|error| Fault(error.to_string()))?.until(level.stop);
        let most = self.ticks as usize;
        let (mut played, mut now) = (Vec::new(), Played::default());
        for _ in 0..episodes * most {
            let is_active = probe.tick()?;
            let finished = probe.world.get::<EpisodeCount>(probe.agent).map_or(0, |count| count.finished as usize);
            let is_last = finished == episodes;
            if finished > played.len() {
                // The state after the last tick of an episode is that of the next one, if there is one.
                if is_last && now.hashes.len() < most {
                    now.hashes.push(hash(&probe.world, probe.agent));
                }
                now.is_over = true;
                played.push(std::mem::take(&mut now));
            } else if now.hashes.len() < most && !is_loading(&probe) {
                now.hashes.push(hash(&probe.world, probe.agent));
            }
            if !is_active || is_last {
                break;
            }
        }
        played.push(now);
        Ok(played)
    }

    /// Returns a difference between repetitions of a tester's first episode, with its tick.
    fn difference(&self, level: &TestedLevel<'_>, tester: &TestedBy<'_>) -> Option<(u32, String)> {
        // Other detectors report a panic.
        let (one, other) = (self.play(level, tester, 1).ok()?, self.play(level, tester, 1).ok()?);
        if let Some(tick) = one.first()?.difference(other.first()?) {
            let message = "the episode differed when it was played again; `playbot doctor` names what differs";
            return Some((tick, message.to_owned()));
        }
        // One more, since the end of the last one is not comparable.
        let row = self.play(level, tester, self.episodes as usize + 1).ok()?;
        let (first, later) = (row.first()?, row.iter().enumerate().take(self.episodes as usize).skip(1));
        let (number, tick) = later.filter_map(|(number, played)| Some((number, first.difference(played)?))).next()?;
        let message = format!(
            "episode {} of a World differed from the first, though it began from the same seed: something is left \
             from one episode to the next",
            number + 1
        );
        Some((tick, message))
    }
}

/// The states of an episode.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Played {
    /// A hash for each tick.
    hashes: Vec<u64>,
    /// Whether it ended; otherwise it was cut off.
    is_over: bool,
}

impl Played {
    /// Returns the first tick that differs, or the first tick after the end of the shorter episode, unless that was cut
    /// off.
    fn difference(&self, other: &Self) -> Option<u32> {
        let (one, another) = (&self.hashes, &other.hashes);
        let shared = one.iter().zip(another).position(|(one, another)| one != another);
        let shorter = if one.len() < another.len() { self } else { other };
        let lacks = (one.len() != another.len() && shorter.is_over).then_some(shorter.hashes.len());
        shared.or(lacks).map(|tick| tick as u32)
    }
}

fn is_loading(probe: &Probe<'_>) -> bool {
    probe.world.get::<Episode>(probe.agent).is_some_and(Episode::is_loading)
}

/// Returns a hash of the known state and the action.
fn hash(world: &World, agent: Entity) -> u64 {
    let action = world.get::<Action>(agent);
    let done = action.and_then(Action::continuous).unwrap_or(&[]);
    let choice = action.and_then(Action::discrete).unwrap_or(0);
    let done = done.iter().map(|number| u64::from(number.to_bits()));
    StateHash::of([hash_of_state(world, agent), u64::from(choice)].into_iter().chain(done)).0
}

/// Returns a hash of the known state.
pub(super) fn hash_of_state(world: &World, agent: Entity) -> u64 {
    let state = world.get::<StateHash>(agent).map_or(0, |hash| hash.0);
    let reward = world.get::<Reward>(agent).map_or(0.0, Reward::get);
    let seen = world.get::<Observation>(agent).map_or(&[][..], |observation| observation.vector.as_slice());
    let numbers = seen.iter().chain([&reward]).map(|number| u64::from(number.to_bits()));
    StateHash::of([state].into_iter().chain(numbers)).0
}

impl LevelDetector for Determinism {
    fn name(&self) -> &'static str {
        "determinism"
    }

    fn describe(&self) -> &'static str {
        "the same tester with the same seed does not have the same episode again"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("every", &mut self.every, "look at every n-th level of the range").at_least(1.0),
            DetectorSetting::new("ticks", &mut self.ticks, "ticks of an episode that are compared").at_least(1.0),
            DetectorSetting::new("episodes", &mut self.episodes, "episodes of a World that are compared").at_least(1.0),
        ]
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        if !level.is_sample(self.every) {
            return Vec::new();
        }
        let of_tester = |tester: &TestedBy<'_>| {
            let (tick, message) = self.difference(level, tester)?;
            let (tester, episode) = (Some(tester.name.to_owned()), Some(0));
            Some(LevelDefect { tester, episode, tick: Some(tick), message, settings: Vec::new() })
        };
        level.testers.iter().filter_map(of_tester).collect()
    }
}

// Episodes that are replayed up to some tick, and then changed.

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
    pub positions: Vec<Option<Vec2>>,
    /// Whether it reached the goal.
    pub is_solved: bool,
}

/// The known state after a tick.
pub struct SeenState {
    /// Its hash: see [`hash_of_state`].
    pub hash: u64,
    /// What the agent observes.
    pub observation: Vec<f32>,
    /// The agent's position, if the game reports it.
    pub position: Option<Vec2>,
    /// The action that led to it: another one than was asked for, if that was illegal.
    pub action: ActionValue,
}

/// An action that was held, tick by tick.
pub struct HeldOn {
    /// The hashes of the known states: see [`hash_of_state`].
    pub hashes: Vec<u64>,
    /// The actions that were played: other ones than were asked for, where those were illegal.
    pub actions: Vec<ActionValue>,
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
                course.positions.push(self.game.tools().state.position(&probe.world, probe.agent));
            }
            if !is_active || probe.is_over() {
                break;
            }
        }
        course.is_solved = probe.world.get::<EpisodeCount>(probe.agent).is_some_and(|count| count.successes > 0);
        Ok(course)
    }

    /// Plays these actions. Returns the state after each of them; fewer if the episode ends before.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the test was stopped.
    pub fn states(&self, actions: &[ActionValue]) -> Result<Vec<SeenState>, Fault> {
        let probe = Probe::led(self.game, self.mode, self.level, self.seed);
        let mut probe = probe.map_err(broken)?.until(self.stop);
        let mut states = Vec::new();
        for _ in 0..MOST_RUNS {
            let Some(action) = actions.get(states.len()) else { break };
            probe.world.entity_mut(probe.agent).insert(Action(action.clone()));
            let is_active = probe.tick()?;
            if !is_active || probe.is_over() {
                break;
            }
            if ticks(&probe) > states.len() {
                let seen = probe.world.get::<Observation>(probe.agent);
                states.push(SeenState {
                    hash: hash_of_state(&probe.world, probe.agent),
                    observation: seen.map_or_else(Vec::new, |seen| seen.vector.clone()),
                    position: self.game.tools().state.position(&probe.world, probe.agent),
                    action: played_action(&probe),
                });
            }
        }
        Ok(states)
    }

    /// Plays these actions, then another one for this many ticks. Returns the states and actions of the latter.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the test was stopped.
    pub fn play(&self, before: &[ActionValue], then: &ActionValue, ticks_then: usize) -> Result<HeldOn, Fault> {
        let probe = Probe::led(self.game, self.mode, self.level, self.seed);
        let mut probe = probe.map_err(broken)?.until(self.stop);
        let mut held = HeldOn { hashes: Vec::new(), actions: Vec::new() };
        for _ in 0..MOST_RUNS {
            let played = ticks(&probe);
            let action = before.get(played).unwrap_or(then).clone();
            probe.world.entity_mut(probe.agent).insert(Action(action));
            let is_active = probe.tick()?;
            let now = ticks(&probe);
            if now > played && now > before.len() {
                held.hashes.push(hash_of_state(&probe.world, probe.agent));
                held.actions.push(played_action(&probe));
            }
            if !is_active || probe.is_over() || now >= before.len() + ticks_then {
                break;
            }
        }
        Ok(held)
    }
}

fn broken(error: VisionError) -> Fault {
    Fault(error.to_string())
}

/// Returns the action of the last tick.
fn played_action(probe: &Probe<'_>) -> ActionValue {
    probe.world.get::<Action>(probe.agent).cloned().unwrap_or_default().0
}

/// Returns the ticks of the episode.
fn ticks(probe: &Probe<'_>) -> usize {
    probe.world.get::<Episode>(probe.agent).map_or(0, |episode| episode.tick as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_tick_that_differs_is_named() {
        let difference = |one: &[u64], other: &[u64], is_over: bool| {
            let played = |hashes: &[u64]| Played { hashes: hashes.to_vec(), is_over };
            assert_eq!(played(one).difference(&played(other)), played(other).difference(&played(one)));
            played(one).difference(&played(other))
        };
        assert_eq!(difference(&[1, 2, 3], &[1, 2, 3], true), None);
        assert_eq!(difference(&[1, 2, 3], &[1, 4, 3], false), Some(1));
        assert_eq!(difference(&[1, 2, 3], &[1, 2], true), Some(2));
        assert_eq!(difference(&[1, 2, 3], &[1, 2], false), None, "the rest was not looked at");
    }
}
