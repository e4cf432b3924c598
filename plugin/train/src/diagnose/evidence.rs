//! Evidence of a diagnosis: all that the checks read.

use crate::{
    diagnose::{
        advice::AdviceContext,
        networks::{DecoderProbe, NetworkProbe},
        play::{ForcedAction, Played, Seat, mean},
        recordings::RecordedSet,
    },
    experiment::{Experiment, LearnerKind},
    metrics_log::SUCCESS_RATE,
    runs::RunCurves,
};
use bevy_playbot::action::ActionSpace;

/// What is known about a run, a set of recordings or a game. Checks read it and change nothing.
#[derive(Clone, Debug)]
pub struct Evidence {
    /// The experiment.
    pub experiment: Experiment,
    /// Version of the game's rules.
    pub game_version: u32,
    /// Names of the observed values; empty for pictures.
    pub names: Vec<String>,
    /// Names of the actions.
    pub action_names: Vec<String>,
    /// The actions.
    pub action_space: ActionSpace,
    /// The metrics of the run.
    pub curves: Option<RunCurves>,
    /// Episodes of several players.
    pub played: Vec<Played>,
    /// The recordings.
    pub recordings: Option<RecordedSet>,
    /// Modes of the recordings that are of another task than the training.
    pub other_modes: Vec<String>,
    /// Recorded episodes of held-out levels.
    pub held_out_recorded: usize,
    /// Actions that were forced in copies of a World.
    pub forced: Vec<ForcedAction>,
    /// What the policy depends on.
    pub networks: Option<NetworkProbe>,
    /// Share of the policy's ticks in which its normaliser clips each value; `None` without one.
    pub clipped: Option<Vec<f64>>,
    /// How well the skill model knows its recordings.
    pub decoder: Option<DecoderProbe>,
    /// What the doctor found.
    pub doctor: Option<String>,
    /// Breaches of contract of the game, in words.
    pub faults: Vec<String>,
    /// What was not looked at, and why.
    pub notes: Vec<String>,
    /// What commands name.
    pub context: AdviceContext,
}

impl Evidence {
    /// Creates the evidence of an experiment, with nothing but its settings.
    pub fn new(experiment: &Experiment, game_version: u32) -> Self {
        Self {
            experiment: experiment.clone(),
            game_version,
            names: Vec::new(),
            action_names: Vec::new(),
            action_space: ActionSpace::Discrete(0),
            curves: None,
            played: Vec::new(),
            recordings: None,
            other_modes: Vec::new(),
            held_out_recorded: 0,
            forced: Vec::new(),
            networks: None,
            clipped: None,
            decoder: None,
            doctor: None,
            faults: Vec::new(),
            notes: Vec::new(),
            context: AdviceContext::new(experiment),
        }
    }

    /// Returns what a player did.
    pub fn played(&self, seat: Seat) -> Option<&Played> {
        self.played.iter().find(|played| played.seat == seat && !played.episodes.is_empty())
    }

    /// Returns the success rate of the training, or else that of the policy's episodes.
    pub fn success(&self) -> Option<f64> {
        let trained = self.curves.as_ref().and_then(|curves| curves.last(SUCCESS_RATE));
        trained.or_else(|| self.played(Seat::Policy).and_then(Played::success))
    }

    /// Returns whether the training is known to reach the goal in most episodes.
    pub fn mostly_succeeds(&self) -> bool {
        self.success().is_some_and(|success| success >= 0.5)
    }

    /// Returns whether the learner or the skill model normalises observations.
    pub fn is_normalised(&self) -> bool {
        let Experiment { algorithm, ppo, sac, skills, .. } = &self.experiment;
        let own = match algorithm.learner() {
            LearnerKind::Ppo => ppo.norm_obs,
            LearnerKind::Sac => sac.norm_obs,
        };
        own || algorithm.needs_skills() && skills.norm_obs
    }

    /// Returns the name of an action.
    pub fn action_name(&self, number: u32) -> String {
        self.action_names.get(number as usize).cloned().unwrap_or_else(|| format!("action {number}"))
    }

    /// Returns the name of an observed value.
    pub fn value_name(&self, number: usize) -> String {
        self.names.get(number).map_or_else(|| format!("pixel {number}"), |name| format!("`{name}`"))
    }
}

/// Returns the discount γ and whether rewards are normalised.
pub(super) fn discount_and_norm(experiment: &Experiment) -> (f64, bool) {
    match experiment.algorithm.learner() {
        LearnerKind::Ppo => (experiment.ppo.gamma, experiment.ppo.norm_reward),
        LearnerKind::Sac => (experiment.sac.gamma, experiment.sac.norm_reward),
    }
}

/// Most names in a list.
const NAMED: usize = 5;

/// Lists names, the first few of many.
pub(super) fn list(names: &[String]) -> String {
    let more = names.len().saturating_sub(NAMED);
    let shown = names.iter().take(NAMED).cloned().collect::<Vec<_>>().join(", ");
    if more > 0 { format!("{shown} and {more} more") } else { shown }
}

/// Returns the mean of the last `count` values of a curve that are numbers; `None` if there are fewer.
pub(super) fn recent(curve: &[(u64, f64)], count: usize) -> Option<f64> {
    let values: Vec<f64> =
        curve.iter().rev().map(|(_, value)| *value).filter(|value| !value.is_nan()).take(count).collect();
    if values.len() < count { None } else { mean(values.into_iter()) }
}
