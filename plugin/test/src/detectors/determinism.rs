//! Games that do not repeat their episodes.

use crate::detectors::{LevelDefect, LevelDetector, TestedBy, TestedLevel, entity_leak::Probe};
use bevy::{math::Vec2, prelude::*};
use bevy_playbot::{
    action::{Action, ActionValue},
    episode::{Episode, EpisodeCount, EpisodeEnd, EpisodeResult},
    fault::Fault,
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
    vision::{ObservationConfig, VisionError},
};
use playbot_harness::{
    detector::DetectorSetting,
    eval::Player,
    game::Game,
    worlds::{EndedEpisodes, hash_with_agent},
};
use std::cell::RefCell;

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
    /// Plays the episode `episodes` times in a row in one World, each time at most up to the last tick that is compared.
    fn play(&self, level: &TestedLevel<'_>, tester: &TestedBy<'_>, episodes: usize) -> Result<Vec<Played>, Fault> {
        let (player, config) = (tester.player, &tester.observation_config);
        let probe = Probe::new(level.game, level.mode, level.level, player, config, vec![tester.seed; episodes]);
        let mut probe = probe.map_err(|error| Fault(error.to_string()))?.until(level.stop);
        EndedEpisodes::note_in(&mut probe.world);
        let most = self.ticks as usize;
        let (mut played, mut now) = (Vec::new(), Played::default());
        for _ in 0..episodes * most {
            let is_active = probe.tick()?;
            let ended = EndedEpisodes::take(&mut probe.world).pop();
            if now.hashes.len() < most && !is_loading(&probe) {
                // The state after the last tick may be that of the next episode, if there is one.
                let state = || hash(&probe.world, probe.agent);
                now.hashes.push(ended.map_or_else(state, |(_, result)| hash_of_result(&result)));
            }
            let is_cut = ended.is_none() && now.hashes.len() == most;
            if is_cut && let Some(mut episode) = probe.world.get_mut::<Episode>(probe.agent) {
                episode.abandon();
            }
            if ended.is_some() || is_cut {
                now.is_over = ended.is_some();
                played.push(std::mem::take(&mut now));
            }
            if !is_active || played.len() == episodes {
                return Ok(played);
            }
        }
        played.push(now);
        Ok(played)
    }

    /// Returns a difference between repetitions of a tester's first episode, with its tick.
    fn difference(&self, level: &TestedLevel<'_>, tester: &TestedBy<'_>) -> Option<(u32, String)> {
        // Other detectors report a panic.
        let (alone, row) = (self.play(level, tester, 1).ok()?, self.play(level, tester, self.episodes as usize).ok()?);
        let first = row.first()?;
        if let Some(tick) = alone.first()?.difference(first) {
            let message = "the episode differed when it was played again; `playbot doctor` names what differs";
            return Some((tick, message.to_owned()));
        }
        let later = row.iter().enumerate().skip(1);
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

/// Returns a hash of the result of an episode.
fn hash_of_result(result: &EpisodeResult) -> u64 {
    let EpisodeResult { end, success, ticks, total_reward, .. } = *result;
    let is_truncated = end == EpisodeEnd::Truncated;
    StateHash::of([u64::from(is_truncated), u64::from(success), u64::from(ticks), total_reward.to_bits()]).0
}

/// Returns a hash of the known state.
pub(super) fn hash_of_state(world: &World, agent: Entity) -> u64 {
    let state = world.get::<StateHash>(agent).map_or(0, |hash| hash.0);
    hash_with_agent(state, world.get::<Observation>(agent), world.get::<Reward>(agent))
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

    /// Returns the player of episodes whose actions the caller gives.
    pub fn led_episodes(&self) -> LedEpisodes<'_> {
        LedEpisodes { script: self, worlds: RefCell::new(Reuse { probe: None, is_clean: true, first: None }) }
    }
}

/// The Worlds in which episodes of given actions are played from the start of a level.
///
/// Building a World can take longer than many episodes. So a World is used again while its restarts are clean: equal first
/// actions must lead to the same states as in the first episode. Otherwise each episode is played in a World of its own.
pub struct LedEpisodes<'a> {
    script: &'a Script<'a>,
    worlds: RefCell<Reuse<'a>>,
}

struct Reuse<'a> {
    /// The World of the last episode.
    probe: Option<Probe<'a>>,
    /// Whether no restart has left anything so far.
    is_clean: bool,
    /// The first episode, in a new World: the actions, and the states after them.
    first: Option<(Vec<ActionValue>, Vec<u64>)>,
}

impl Reuse<'_> {
    /// Returns whether an episode is the same as the first one, as long as its actions are.
    fn is_as_first(&self, actions: &[ActionValue], states: &[SeenState]) -> bool {
        let Some((first_actions, first_states)) = &self.first else { return true };
        let same = first_actions.iter().zip(actions).take_while(|(one, other)| one == other).count();
        let states = states.iter().map(|state| &state.hash).take(same);
        states.eq(first_states.iter().take(same))
    }
}

impl LedEpisodes<'_> {
    /// Plays these actions. Returns the state after each of them, without that after the end of the episode.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the test was stopped.
    pub fn states(&self, actions: &[ActionValue]) -> Result<Vec<SeenState>, Fault> {
        let (mut states, has_ended) = self.play_all(actions)?;
        if has_ended {
            states.pop();
        }
        Ok(states)
    }

    /// Plays these actions, then another one for this many ticks. Returns the states and actions of the latter.
    ///
    /// # Errors
    ///
    /// The game broke its contract, or the test was stopped.
    pub fn play(&self, before: &[ActionValue], then: &ActionValue, ticks_then: usize) -> Result<HeldOn, Fault> {
        let actions: Vec<ActionValue> = before.iter().chain(std::iter::repeat_n(then, ticks_then)).cloned().collect();
        let (states, _) = self.play_all(&actions)?;
        let (hashes, actions) = states.into_iter().skip(before.len()).map(|state| (state.hash, state.action)).unzip();
        Ok(HeldOn { hashes, actions })
    }

    /// Plays an episode of these actions. Returns the state after each tick, and whether the last tick has ended it.
    fn play_all(&self, actions: &[ActionValue]) -> Result<(Vec<SeenState>, bool), Fault> {
        let Script { game, mode, level, seed, stop, .. } = *self.script;
        let mut worlds = self.worlds.borrow_mut();
        if let Some(mut probe) = worlds.probe.take() {
            probe.begin_again(level, seed);
            let played = led(game, &mut probe, actions);
            if let Ok((states, has_ended)) = played
                && worlds.is_as_first(actions, &states)
            {
                worlds.probe = Some(probe);
                return Ok((states, has_ended));
            }
            worlds.is_clean = false;
        }
        let mut probe = Probe::led(game, mode, level, seed).map_err(broken)?.until(stop);
        let (states, has_ended) = led(game, &mut probe, actions)?;
        if worlds.is_clean {
            let hashes = states.iter().map(|state| state.hash).collect();
            worlds.first = Some((actions.to_vec(), hashes));
            worlds.probe = Some(probe);
        }
        Ok((states, has_ended))
    }
}

/// Leads an agent through these actions. Returns the state after each tick, and whether the last tick has ended the
/// episode.
fn led(game: &dyn Game, probe: &mut Probe<'_>, actions: &[ActionValue]) -> Result<(Vec<SeenState>, bool), Fault> {
    let mut states = Vec::new();
    for _ in 0..MOST_RUNS {
        let Some(action) = actions.get(states.len()) else { break };
        probe.world.entity_mut(probe.agent).insert(Action(action.clone()));
        let is_active = probe.tick()?;
        let is_tick = ticks(probe) > states.len();
        if is_tick {
            let seen = probe.world.get::<Observation>(probe.agent);
            states.push(SeenState {
                hash: hash_of_state(&probe.world, probe.agent),
                observation: seen.map_or_else(Vec::new, |seen| seen.vector.clone()),
                position: game.tools().state.position(&probe.world, probe.agent),
                action: played_action(probe),
            });
        }
        if !is_active || probe.is_over() {
            return Ok((states, is_tick));
        }
    }
    Ok((states, false))
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
    use playbot_harness::foreign::{ForeignGame, Restart};
    use std::sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    };

    #[derive(Component)]
    struct Runner;

    /// Left over from earlier ticks; a restart does not reset it.
    #[derive(Resource)]
    struct Push(f32);

    /// A run to the right, faster and faster if the game keeps its push. Counts how often it is built.
    fn run(keeps: bool, built: &Arc<AtomicU32>) -> ForeignGame {
        let built = Arc::clone(built);
        let game = move |app: &mut App| {
            built.fetch_add(1, Ordering::SeqCst);
            app.insert_resource(Push(0.0))
                .add_systems(Startup, |mut commands: Commands| {
                    commands.spawn((Runner, Transform::default()));
                })
                .add_systems(Update, move |mut at: Single<&mut Transform, With<Runner>>, mut push: ResMut<Push>| {
                    at.translation.x += 1.0 + push.0;
                    push.0 += if keeps { 0.5 } else { 0.0 };
                });
        };
        ForeignGame::new("runner", 1, game)
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], |at: Single<&Transform, With<Runner>>| [at.translation.x])
            .time_limit(50)
            .restart(Restart::Startup)
    }

    #[test]
    fn a_world_is_used_again_if_its_restarts_are_clean() {
        for keeps in [false, true] {
            let built = Arc::default();
            let (game, observation_config) = (run(keeps, &built), ObservationConfig::default());
            let (mode, player, stop) = ("default", &Player::Demonstrator, &|| false);
            let script = Script { game: &game, mode, level: 0, player, observation_config, seed: 3, stop };
            let led = script.led_episodes();
            let seen = |actions: &[u32]| {
                let actions: Vec<ActionValue> = actions.iter().map(|&action| ActionValue::Discrete(action)).collect();
                let states = led.states(&actions).expect("sound");
                states.iter().map(|state| state.observation[0]).collect::<Vec<_>>()
            };
            let first = seen(&[0, 0, 0]);
            assert_eq!(first.len(), 3);
            let once = built.load(Ordering::SeqCst);
            assert_eq!(seen(&[0, 0, 1]), first, "Space does nothing");
            assert_eq!(built.load(Ordering::SeqCst) > once, keeps);
            assert_eq!(seen(&[0, 0, 0, 0])[..3], first);
            assert_eq!(seen(&[0; 60]).len(), 49, "the last tick is not among them");
        }
    }

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
