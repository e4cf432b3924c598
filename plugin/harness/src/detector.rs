//! The contract of a detector, which looks for one kind of defect while testers play.
//!
//! ```
//! use playbot_harness::detector::{Detector, EachTick, DetectorTick};
//!
//! /// A game's own detector: no agent may owe money.
//! fn debt() -> Box<dyn Detector> {
//!     Box::new(EachTick::new("debt", "an agent owes money", |moment: &DetectorTick<'_>| {
//!         let purse = moment.observation.first().copied().unwrap_or_default();
//!         (purse < 0.0).then(|| format!("the purse holds {purse}"))
//!     }))
//! }
//! assert_eq!(debt().name(), "debt");
//! ```
//!
//! [`TestTools::detectors`](crate::game::TestTools::detectors) names a game's own; `playbot_test::detectors` has
//! those that every game gets.

use crate::floor_plan::FloorPlan;
use bevy::prelude::*;
use bevy_playbot::{
    action::{Action, ActionValue},
    episode::{Episode, EpisodeResult},
    observation::Observation,
    reward::Reward,
    state_hash::StateHash,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A search for one kind of defect in every episode of a test.
///
/// Findings must depend on the episode alone, not on the clock and not on earlier episodes. Then results are the same
/// on any number of threads and shards.
pub trait Detector: Send + Sync {
    /// Returns its name, in small letters and hyphens, as findings and the command line have it.
    fn name(&self) -> &'static str;

    /// Returns the defect that it finds, in one line.
    fn describe(&self) -> &'static str;

    /// Returns whether it is a default detector: cheap, and without false alarms in an unmutated game.
    fn is_default(&self) -> bool {
        true
    }

    /// Returns its settings, which may be changed before the test starts.
    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        Vec::new()
    }

    /// Returns the shortest episode in which it can find something: a test names the detectors for which all episodes
    /// whose time was up were too short. By default a tick is enough.
    fn least_episode(&self) -> LeastEpisode {
        LeastEpisode::default()
    }

    /// Returns a setting, as `key=value`, with which it can find something in episodes of so many ticks, if there is one.
    fn setting_for(&self, _ticks: u32) -> Option<String> {
        None
    }

    /// Starts to watch an episode; `None` if there is nothing to watch.
    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        None
    }

    /// Starts to watch a World; `None` if it watches agents only.
    fn watch_world(&self) -> Option<Box<dyn WorldWatcher>> {
        None
    }
}

/// The shortest episode in which a detector can find something.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LeastEpisode {
    /// Its ticks.
    pub ticks: u32,
    /// True if the game must report the position of the agent as well.
    pub needs_position: bool,
    /// True if the game must [prove](crate::game::StateTools::proves_states) something about states as well.
    pub needs_proofs: bool,
}

impl LeastEpisode {
    /// Creates an episode of so many ticks, of any game.
    pub fn of_ticks(ticks: u32) -> Self {
        Self { ticks, needs_position: false, needs_proofs: false }
    }
}

/// A setting of a detector.
pub struct DetectorSetting<'a> {
    /// Its name, in small letters.
    pub key: &'static str,
    /// Its value.
    pub value: &'a mut f64,
    /// The least valid value.
    pub least: f64,
    /// Its meaning, with its unit.
    pub what: &'static str,
}

impl<'a> DetectorSetting<'a> {
    /// Creates a setting that is at least 0.
    pub fn new(key: &'static str, value: &'a mut f64, what: &'static str) -> Self {
        Self { key, value, least: 0.0, what }
    }

    /// Replaces the least value.
    pub fn at_least(self, least: f64) -> Self {
        Self { least, ..self }
    }
}

/// The level of an episode that starts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelAhead {
    /// Number of the level.
    pub level: u64,
    /// The level from above, if the game has such plans.
    pub plan: Option<FloorPlan>,
}

/// A detector's view of one agent during one episode.
pub trait EpisodeWatcher {
    /// Examines the tick that was just played, the last one included. Returns a message if something is wrong: the
    /// finding of this tick, and the only one of the episode.
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String>;

    /// Examines the end of the episode, after its last tick.
    fn end(&mut self, _moment: &DetectorTick<'_>, _result: &EpisodeResult) -> Option<String> {
        None
    }
}

/// A detector's view of a World after each of its ticks.
///
/// If it finds something while several agents play there, their episodes are replayed, each alone in a World of its
/// own. That shows whose finding it is.
pub trait WorldWatcher {
    /// Returns whether it reads the errors of the log.
    fn hears_errors(&self) -> bool {
        false
    }

    /// Returns a message if something is wrong.
    fn tick(&mut self, moment: &WorldTick<'_>) -> Option<String>;
}

/// A tick of an episode that was just played, with the World after it.
#[derive(Clone, Copy)]
pub struct DetectorTick<'a> {
    /// The World: to be read only. Other agents may play in it.
    pub world: &'a World,
    /// The agent.
    pub agent: Entity,
    /// Level of the episode.
    pub level: u64,
    /// The tick, counted from 0.
    pub tick: u32,
    /// The agent's action.
    pub action: &'a ActionValue,
    /// The observation before the action; may be empty.
    pub observation: &'a [f32],
    /// The game's hash of the state; 0 if it has none.
    pub state_hash: u64,
    /// The reward.
    pub reward: f32,
    /// Position of the agent on its level's plan, if the game reports it.
    pub position: Option<Vec2>,
    /// Height of the agent, if the game reports it besides the position: the plan is seen from above then.
    pub height: Option<f32>,
    /// True if the level's goal was reached, now or before.
    pub is_success: bool,
    /// The game's proofs.
    pub proofs: &'a dyn Proofs,
}

impl<'a> DetectorTick<'a> {
    /// Creates tick 0 of level 0, without an observation, a reward and a position: for tests of detectors.
    ///
    /// ```
    /// use bevy::prelude::*;
    /// use playbot_harness::{detector::DetectorTick, prelude::*};
    ///
    /// let (world, action) = (World::new(), ActionValue::Discrete(1));
    /// let paid = DetectorTick { reward: 1.0, ..DetectorTick::of(&world, &action) };
    /// assert_eq!((paid.reward, paid.tick, paid.level), (1.0, 0, 0));
    /// ```
    pub fn of(world: &'a World, action: &'a ActionValue) -> Self {
        Self {
            world,
            agent: Entity::PLACEHOLDER,
            level: 0,
            tick: 0,
            action,
            observation: &[],
            state_hash: 0,
            reward: 0.0,
            position: None,
            height: None,
            is_success: false,
            proofs: &NoProofs,
        }
    }

    /// Creates a tick of an agent from its components: all but the position, the height and proofs, for which the game is
    /// asked. `None` for an entity that is no agent.
    pub fn of_agent(world: &'a World, agent: Entity, tick: u32) -> Option<Self> {
        let (episode, action) = (world.get::<Episode>(agent)?, world.get::<Action>(agent)?);
        Some(Self {
            agent,
            level: episode.level,
            tick,
            observation: world.get::<Observation>(agent).map_or(&[][..], |seen| seen.vector.as_slice()),
            state_hash: world.get::<StateHash>(agent).map_or(0, |hash| hash.0),
            reward: world.get::<Reward>(agent).map_or(0.0, Reward::get),
            is_success: episode.is_success(),
            ..Self::of(world, &action.0)
        })
    }

    /// Returns a hash of the known state: the game's own hash, the observation, the position and the height.
    pub fn fingerprint(&self) -> u64 {
        let position = self.position.map_or([0.0; 2], |position| position.to_array());
        let numbers = self.observation.iter().copied().chain(position).chain(self.height);
        let numbers = numbers.map(|number| u64::from(number.to_bits()));
        StateHash::of([self.state_hash].into_iter().chain(numbers)).0
    }

    /// Returns the agent's height: that of a plan seen from above, or else its position on the plan, or its transform.
    pub fn height(&self) -> Option<f32> {
        let transform = || self.world.get::<Transform>(self.agent).map(|transform| transform.translation.y);
        self.height.or_else(|| self.position.map(|position| position.y)).or_else(transform)
    }
}

/// A tick of a World.
#[derive(Clone, Copy)]
pub struct WorldTick<'a> {
    /// The World: to be read only.
    pub world: &'a World,
    /// Errors that were logged in this tick, except by the engine. Only for detectors that
    /// [read the log](WorldWatcher::hears_errors).
    pub errors: &'a [String],
}

/// A detector that asks one question after each tick of each episode: the short form of a game's own detector.
pub struct EachTick<F> {
    name: &'static str,
    describe: &'static str,
    question: Arc<F>,
}

struct Asking<F>(Arc<F>);

impl<F> EachTick<F>
where
    F: Fn(&DetectorTick<'_>) -> Option<String> + Send + Sync + 'static,
{
    /// Creates a detector with this name and one line about it. The question returns a message if something is wrong.
    pub fn new(name: &'static str, describe: &'static str, question: F) -> Self {
        Self { name, describe, question: Arc::new(question) }
    }
}

impl<F> Detector for EachTick<F>
where
    F: Fn(&DetectorTick<'_>) -> Option<String> + Send + Sync + 'static,
{
    fn name(&self) -> &'static str {
        self.name
    }

    fn describe(&self) -> &'static str {
        self.describe
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::new(Asking(Arc::clone(&self.question))))
    }
}

impl<F: Fn(&DetectorTick<'_>) -> Option<String>> EpisodeWatcher for Asking<F> {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        (self.0)(moment)
    }
}

// Proofs about levels and about states of episodes.

/// The game's proofs, on request. One may take a millisecond, so a detector must not ask in each tick.
pub trait Proofs {
    /// Returns the proof about the level, from its start: [`LevelTools::prove`](crate::game::LevelTools::prove).
    fn of_level(&self) -> LevelProof {
        LevelProof::Unknown
    }

    /// Returns the proof about the World's current state:
    /// [`StateTools::prove_from`](crate::game::StateTools::prove_from).
    fn of_state(&self) -> LevelProof {
        LevelProof::Unknown
    }
}

/// A game without proofs.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoProofs;

impl Proofs for NoProofs {}

/// Proof about the goal of a level: whether it can be reached.
///
/// A search that gave up proves nothing and gives [`Unknown`](Self::Unknown).
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LevelProof {
    /// A path to the goal exists. It may take longer than an episode.
    Solvable,
    /// The goal cannot be reached by any sequence of actions.
    Unsolvable {
        /// Description of the exhausted search.
        why: String,
    },
    /// Nothing is proved.
    #[default]
    Unknown,
}

impl LevelProof {
    /// Returns the reason why the goal cannot be reached, if that is proved.
    pub fn why_unsolvable(&self) -> Option<&str> {
        match self {
            Self::Unsolvable { why } => Some(why),
            Self::Solvable | Self::Unknown => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_say_it_in_small_letters() {
        let text = |proof: &LevelProof| serde_json::to_string(proof).expect("serialises");
        assert_eq!(text(&LevelProof::Unknown), r#""unknown""#);
        let walled = LevelProof::Unsolvable { why: "walled in".to_owned() };
        assert_eq!(text(&walled), r#"{"unsolvable":{"why":"walled in"}}"#);
        assert_eq!(serde_json::from_str::<LevelProof>(&text(&walled)).expect("reads back"), walled);
        assert_eq!((walled.why_unsolvable(), LevelProof::Solvable.why_unsolvable()), (Some("walled in"), None));
    }
}
