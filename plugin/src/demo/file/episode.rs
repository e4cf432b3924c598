//! One recorded episode in memory.

use crate::{
    action::{ActionSpace, Actions},
    demo::file::{error::EpisodeFault, header::DemoHeader},
    level::{LevelFile, RandomisedValue},
};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The source of a tick's action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Decider {
    /// A person at the keyboard or gamepad.
    Human,
    /// A scripted bot.
    Bot,
    /// A learned policy.
    Policy,
    /// A recording that was played back.
    Replay,
    /// No source: the agent did nothing.
    Idle,
}

impl std::fmt::Display for Decider {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Human => "human",
            Self::Bot => "bot",
            Self::Policy => "policy",
            Self::Replay => "replay",
            Self::Idle => "idle",
        })
    }
}

/// The end of an episode. Termination and truncation are never merged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum DemoEnd {
    /// The rules of the game ended the episode.
    Terminated {
        /// True if the goal was reached.
        success: bool,
    },
    /// The time limit ended the episode.
    Truncated,
    /// The recording stopped before the episode ended: the window was closed, or the level was left.
    Aborted,
}

/// One recorded episode: the data to run it again, and the expected outcome.
///
/// All lists run over the ticks of the episode; `steps` is their common length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DemoEpisode {
    /// Seed of the level: with the game, its version and its mode it gives the layout.
    pub level_seed: u64,
    /// The file of the level, where levels are files. Its level number may have changed since.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level_file: Option<LevelFile>,
    /// Values of the game that were drawn for the level.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub randomised: Vec<RandomisedValue>,
    /// The action of each tick.
    pub actions: Actions,
    /// The reward of each tick, `[steps]`.
    pub rewards: Vec<f32>,
    /// Hash of the game's state after each tick, `[steps]`.
    pub state_hashes: Vec<u32>,
    /// The source of each tick's action, `[steps]`.
    pub deciders: Vec<Decider>,
    /// The end of the episode.
    pub end: DemoEnd,
    /// The observation before each action, `[steps, names]` with the names of the header;
    /// empty when the header has no names.
    pub observations: Vec<f32>,
}

impl DemoEpisode {
    /// Creates an episode without ticks, to be filled by a recorder.
    pub fn new(level_seed: u64, actions: ActionSpace) -> Self {
        Self {
            level_seed,
            level_file: None,
            randomised: Vec::new(),
            actions: Actions::empty(&actions),
            rewards: Vec::new(),
            state_hashes: Vec::new(),
            deciders: Vec::new(),
            end: DemoEnd::Aborted,
            observations: Vec::new(),
        }
    }

    /// Returns the number of ticks.
    pub fn len(&self) -> usize {
        self.state_hashes.len()
    }

    /// Returns whether the episode has no ticks.
    pub fn is_empty(&self) -> bool {
        self.state_hashes.is_empty()
    }

    /// Returns the sum of the rewards (undiscounted return).
    pub fn episode_return(&self) -> f64 {
        self.rewards.iter().map(|&r| f64::from(r)).sum()
    }

    /// Returns the ticks of each decider; deciders without ticks are left out.
    pub fn steps_by_decider(&self) -> BTreeMap<Decider, usize> {
        let mut steps = BTreeMap::new();
        for decider in &self.deciders {
            *steps.entry(*decider).or_default() += 1;
        }
        steps
    }

    /// Returns the number of leading ticks that no source decided: they replay, and demonstrate nothing.
    pub fn idle_start(&self) -> usize {
        self.deciders.iter().take_while(|decider| **decider == Decider::Idle).count()
    }

    /// Returns whether the episode terminated with the goal reached.
    pub fn is_success(&self) -> bool {
        self.end == DemoEnd::Terminated { success: true }
    }

    /// Checks the episode against the header of its file.
    ///
    /// # Errors
    ///
    /// The first [`EpisodeFault`]: lists of different lengths, actions of another kind or out of range,
    /// or a number that is not finite.
    pub fn check(&self, header: &DemoHeader) -> Result<(), EpisodeFault> {
        let steps = self.len();
        let length = |what, found: usize, expected: usize| {
            if found == expected { Ok(()) } else { Err(EpisodeFault::Length { what, found, expected, steps }) }
        };
        length("rewards", self.rewards.len(), steps)?;
        length("deciders", self.deciders.len(), steps)?;
        let width = header.observation_names.len();
        length("observation values", self.observations.len(), steps.saturating_mul(width))?;
        match (&self.actions, header.actions) {
            (Actions::Discrete(actions), ActionSpace::Discrete(count)) => {
                length("actions", actions.len(), steps)?;
                if let Some(step) = actions.iter().position(|&a| a as usize >= count) {
                    return Err(EpisodeFault::ActionRange { step, action: actions[step], count });
                }
            }
            (Actions::Continuous { dim, values }, ActionSpace::Continuous(count)) if *dim == count => {
                length("action values", values.len(), steps.saturating_mul(count))?;
                finite("an action value", values, count)?;
            }
            (Actions::Mixed { choices, options, dim, values }, ActionSpace::Mixed(space))
                if (*choices, *dim) == (space.choices.sizes().len(), space.numbers) =>
            {
                length("options", options.len(), steps.saturating_mul(*choices))?;
                length("action values", values.len(), steps.saturating_mul(*dim))?;
                for (at, (&option, &size)) in options.iter().zip(space.choices.sizes().iter().cycle()).enumerate() {
                    if option >= size {
                        let step = at / (*choices).max(1);
                        return Err(EpisodeFault::ActionRange { step, action: option, count: size as usize });
                    }
                }
                finite("an action value", values, *dim)?;
            }
            (found, expected) => {
                let found = match found {
                    Actions::Discrete(_) => "discrete".to_owned(),
                    Actions::Continuous { dim, .. } => ActionSpace::Continuous(*dim).to_string(),
                    Actions::Mixed { choices, dim, .. } => format!("{choices} choices and {dim} numbers"),
                };
                return Err(EpisodeFault::ActionKind { found, expected: expected.to_string() });
            }
        }
        if let Some(RandomisedValue { path, value }) = self.randomised.iter().find(|drawn| !drawn.value.is_finite()) {
            return Err(EpisodeFault::Malformed(format!(
                "its value of `{path}` is {value}, which is no finite number"
            )));
        }
        finite("the reward", &self.rewards, 1)?;
        finite("an observation value", &self.observations, width)
    }
}

/// Checks that all `values`, `width` of them per step, are finite.
fn finite(what: &'static str, values: &[f32], width: usize) -> Result<(), EpisodeFault> {
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(()),
        Some(at) => Err(EpisodeFault::NotFinite { what, step: at / width.max(1), value: values[at] }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> DemoHeader {
        DemoHeader {
            observation_names: vec!["x".into(), "y".into()],
            ..DemoHeader::new("game", 1, "easy", 60.0, ActionSpace::Discrete(4))
        }
    }

    fn episode() -> DemoEpisode {
        DemoEpisode {
            actions: Actions::Discrete(vec![0, 3]),
            rewards: vec![0.5, 10.0],
            state_hashes: vec![1, 2],
            deciders: vec![Decider::Human; 2],
            end: DemoEnd::Terminated { success: true },
            observations: vec![0.0, 1.0, 2.0, 3.0],
            ..DemoEpisode::new(7, ActionSpace::Discrete(4))
        }
    }

    #[test]
    fn a_sound_episode_passes() {
        assert_eq!(episode().check(&header()), Ok(()));
        assert_eq!((episode().len(), episode().episode_return(), episode().is_success()), (2, 10.5, true));
        assert_eq!(DemoEpisode::new(7, ActionSpace::Discrete(4)).check(&header()), Ok(()));
    }

    #[test]
    fn only_leading_ticks_without_a_decider_are_an_idle_start() {
        let of = |deciders: &[Decider]| DemoEpisode { deciders: deciders.to_vec(), ..episode() }.idle_start();
        assert_eq!(of(&[Decider::Idle, Decider::Idle, Decider::Human, Decider::Idle]), 2);
        assert_eq!(of(&[Decider::Human, Decider::Idle]), 0);
        assert_eq!(of(&[]), 0);
    }

    #[test]
    fn each_fault_is_named() {
        let text = |e: DemoEpisode| e.check(&header()).expect_err("faulty").to_string();
        let mut e = episode();
        e.rewards.pop();
        assert_eq!(text(e), "1 rewards for 2 steps (expected 2)");
        let mut e = episode();
        e.actions = Actions::Discrete(vec![0, 4]);
        assert_eq!(text(e), "action 4 at step 1 is out of range: the game has actions 0 to 3");
        let mut e = episode();
        e.actions = Actions::Continuous { dim: 1, values: vec![0.0; 2] };
        assert_eq!(text(e), "the actions are continuous actions of 1 number, but the header says 4 discrete actions");
        let mut e = episode();
        e.observations[3] = f32::NAN;
        assert_eq!(text(e), "an observation value at step 1 is NaN, not a finite number");
        let mut e = episode();
        e.rewards[0] = f32::INFINITY;
        assert_eq!(text(e), "the reward at step 0 is inf, not a finite number");
        let mut e = episode();
        e.observations.clear();
        assert_eq!(text(e), "0 observation values for 2 steps (expected 4)");
    }
}
