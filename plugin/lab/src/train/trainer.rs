//! The training loop, one update at a time: the caller owns the progress bar and decides when to stop.

use std::{collections::VecDeque, path::Path, time::Instant};

use bevy::prelude::World;
use playbot_learner::{ActionSpace, DeviceKind, LearnError, Policy, Rollout, SkillModel, SkillSource};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{
    arena_state::RestoreError,
    checkpoint::CheckpointSummary,
    collect::Collector,
    config::{Algorithm, Experiment, ExperimentError},
    learner::{Learner, LearnerMetrics},
    metrics_log::{CLIPPED_SHARE, EPISODES, EPISODIC_LENGTH, EPISODIC_RETURN, SUCCESS_RATE},
};
use crate::arrangement::Arrangement;
use crate::game::Game;
use crate::parallel::on_threads;
use crate::sensors::GameSensors;
use bevy_playbot::{
    episode::EpisodeEnded,
    fault::Fault,
    panics::PanicReports,
    policy::in_words,
    skill_prior::SkillPrior,
    vision::{ObservationConfig, UnknownObservation, VisionError},
};

/// Episodes over which the current return, length and success rate are averaged.
pub(crate) const RECENT: usize = 100;

/// Rows on which the first policy is compared with the decoder.
const INITIAL_KL_ROWS: usize = 1024;

/// Training cannot go on.
#[derive(Debug, Error)]
pub enum TrainError {
    /// The experiment makes no sense.
    #[error(transparent)]
    Experiment(#[from] ExperimentError),
    /// The game cannot be seen this way.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// The algorithm needs a skill model.
    #[error("{0} needs a skill model: learn one first with `playbot learn-skills`")]
    NoSkills(Algorithm),
    /// The algorithm does not learn from play.
    #[error("{0} is not trained: measure its skill model with `playbot eval --skills`")]
    NotTrained(Algorithm),
    /// The skill model was learned for another game.
    #[error(
        "the skill model was learned for {} and {model_actions:?}, but `{game}` has {} and {game_actions:?}: learn one \
         from demonstrations of this game", in_words(.model_obs), in_words(.game_obs)
    )]
    ForeignSkills {
        /// The game.
        game: String,
        /// Observation of the model.
        model_obs: playbot_learner::ObsKind,
        /// Actions of the model.
        model_actions: playbot_learner::ActionSpace,
        /// Observation of the game.
        game_obs: playbot_learner::ObsKind,
        /// Actions of the game.
        game_actions: playbot_learner::ActionSpace,
    },
    /// The skill model was learned from other pictures, or from vectors.
    #[error(
        "the skill model was learned from {model}, but `observation` and `image` of the experiment say {experiment}: \
         learn skills with this experiment, `playbot learn-skills`, or change it to what the model has seen"
    )]
    SkillObservation {
        /// What the model has seen.
        model: ObservationConfig,
        /// What agents see in the experiment.
        experiment: ObservationConfig,
    },
    /// The file of the skill model says of its pictures what this version does not know.
    #[error(transparent)]
    UnknownObservation(#[from] UnknownObservation),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The learner cannot go on, for instance because a loss is not a number.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A checkpoint could not be brought back.
    #[error(transparent)]
    Restore(#[from] RestoreError),
}

/// A finished episode as the moving averages keep it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct RecentEpisode {
    total_reward: f64,
    ticks: u32,
    success: bool,
    /// Ticks whose action was clipped; missing in checkpoints from before it was counted.
    #[serde(default)]
    clipped: u32,
}

/// What one update brought. Everything in it is the same in every run with the same seed, except `timing`.
#[derive(Clone, Debug)]
pub struct UpdateReport {
    /// Updates done, this one included.
    pub update: u64,
    /// Environment steps done, over all arenas together.
    pub step: u64,
    /// Episodes that have ended. Before the 100th the means below are of fewer, and of short ones more than of long.
    pub episodes: u64,
    /// Mean return of the last 100 episodes; `None` before the first has ended.
    pub episodic_return: Option<f64>,
    /// Mean length of the last 100 episodes, ticks.
    pub episodic_length: Option<f64>,
    /// Success rate of the last 100 episodes.
    pub success_rate: Option<f64>,
    /// Share of the ticks of the last 100 episodes whose action was clipped to the game's range; only for continuous
    /// actions.
    pub clipped_share: Option<f64>,
    /// KL divergence from decoder to policy before the first update; only in the first report of SCORE.
    pub initial_kl: Option<f32>,
    /// What the learner reports.
    pub learner: LearnerMetrics,
    /// Where the time went.
    pub timing: Timing,
}

impl UpdateReport {
    /// Everything measured, by TensorBoard tag; the same numbers in every run with the same seed.
    pub fn scalars(&self) -> Vec<(&'static str, f64)> {
        let episodes = [
            (EPISODES, Some(self.episodes as f64)),
            (EPISODIC_RETURN, self.episodic_return),
            (EPISODIC_LENGTH, self.episodic_length),
            (SUCCESS_RATE, self.success_rate),
            (CLIPPED_SHARE, self.clipped_share),
            ("score/initial_kl", self.initial_kl.map(f64::from)),
        ];
        let known = episodes.into_iter().filter_map(|(tag, value)| Some((tag, value?)));
        known.chain(self.learner.scalars()).collect()
    }
}

/// Wall-clock seconds of one update.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// Simulating, observing and deciding.
    pub collect_s: f64,
    /// Learning.
    pub learn_s: f64,
}

/// One algorithm being trained on one experiment.
pub struct Trainer {
    experiment: Experiment,
    threads: usize,
    pub(crate) learner: Learner,
    pub(crate) collectors: Vec<Collector>,
    pub(crate) progress: Progress,
}

/// How far the training is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Progress {
    pub(crate) updates: u64,
    pub(crate) steps: u64,
    pub(crate) episodes: u64,
    pub(crate) recent: VecDeque<RecentEpisode>,
}

impl Trainer {
    /// A trainer at its first step.
    ///
    /// # Errors
    ///
    /// [`TrainError`] if experiment, game and skill model do not go together.
    pub fn new(
        game: &dyn Game,
        experiment: &Experiment,
        skills: Option<&SkillModel>,
        device: DeviceKind,
        threads: usize,
    ) -> Result<Self, TrainError> {
        check(game, experiment)?;
        let learner = Learner::new(game, experiment, skills, device)?;
        Self::with_learner(game, experiment, learner, threads)
    }

    /// A trainer around a learner that exists already, for an experiment that was checked.
    pub(crate) fn with_learner(
        game: &dyn Game,
        experiment: &Experiment,
        learner: Learner,
        threads: usize,
    ) -> Result<Self, TrainError> {
        let prior = learner.skills().as_ref().map(SkillPrior::from);
        let arrangement = Arrangement::new(game, experiment.arenas, experiment.worlds);
        let share = arrangement.arenas;
        let (levels, sight, seed) = (&experiment.train, experiment.sight(), experiment.seed);
        let collectors: Result<_, _> = arrangement
            .first_agents()
            .map(|first| Collector::new(game, levels, &sight, seed, first, share, prior.clone()))
            .collect();
        let (experiment, collectors) = (experiment.clone(), collectors?);
        Ok(Self { experiment, threads, learner, collectors, progress: Progress::default() })
    }

    /// Plays one rollout in every arena and learns from it.
    ///
    /// # Errors
    ///
    /// [`TrainError`]; what was learned before stays as it was.
    pub fn update(&mut self) -> Result<UpdateReport, TrainError> {
        let start = Instant::now();
        let (policy, latent) = (self.learner.policy(), self.learner.rollout_latent());
        let steps = self.experiment.rollout_steps();
        let collected = on_threads(&mut self.collectors, self.threads, |world| world.collect(&policy, latent, steps));
        let (mut rollouts, mut finished) = (Vec::new(), Vec::new());
        for part in collected {
            let (rollout, ended) = part?;
            rollouts.push(rollout);
            finished.extend(ended);
        }
        let rollout = Rollout::join(rollouts)?;
        let collect_s = start.elapsed().as_secs_f64();
        let initial_kl = self.initial_kl(&rollout)?;
        let learner = self.learner.learn(&rollout)?;
        self.progress.note(&finished);
        self.progress.updates += 1;
        self.progress.steps += self.experiment.steps_per_update();
        let timing = Timing { collect_s, learn_s: start.elapsed().as_secs_f64() - collect_s };
        let mut report = self.progress.report(learner, initial_kl, timing);
        report.clipped_share =
            report.clipped_share.filter(|_| matches!(policy.action_space(), ActionSpace::Continuous(_)));
        Ok(report)
    }

    /// Before the first update of SCORE, the policy must be the decoder, to the bit.
    fn initial_kl(&self, rollout: &Rollout) -> Result<Option<f32>, LearnError> {
        let copied = self.experiment.algorithm.needs_skills() && self.experiment.score.init_from_decoder;
        if self.progress.updates > 0 || !copied {
            return Ok(None);
        }
        let rows = INITIAL_KL_ROWS.min(rollout.steps * rollout.envs);
        let (z, obs) = (&rollout.z[..rows * rollout.latent], rollout.obs.rows(0..rows, rollout.obs_kind.numbers()));
        self.learner.initial_kl(z, obs, rows)
    }

    /// Whether all steps of the experiment are done.
    pub fn is_done(&self) -> bool {
        self.progress.steps >= self.experiment.steps
    }

    /// Environment steps done.
    pub fn steps(&self) -> u64 {
        self.progress.steps
    }

    /// Updates done.
    pub fn updates(&self) -> u64 {
        self.progress.updates
    }

    /// The experiment.
    pub fn experiment(&self) -> &Experiment {
        &self.experiment
    }

    /// The policy as it is now.
    pub fn policy(&self) -> Policy {
        self.learner.policy()
    }

    /// The Worlds that play, to look into or to measure.
    pub fn worlds_mut(&mut self) -> impl Iterator<Item = &mut World> {
        self.collectors.iter_mut().map(Collector::world_mut)
    }

    /// Writes what is kept of a panic of the game into this folder, instead of the one for temporary files.
    pub fn report_panics_to(&mut self, folder: &Path) {
        for world in self.worlds_mut() {
            if let Some(mut reports) = world.get_resource_mut::<PanicReports>() {
                reports.move_to(folder);
            }
        }
    }

    /// Where the policy's skills come from, if it has any.
    pub fn skill_source(&self) -> Option<SkillSource> {
        self.learner.skills()
    }

    /// The prior that draws its skills.
    pub fn skill_prior(&self) -> Option<SkillPrior> {
        self.skill_source().as_ref().map(SkillPrior::from)
    }
}

/// Whether the experiment can be run on this game.
pub(crate) fn check(game: &dyn Game, experiment: &Experiment) -> Result<(), TrainError> {
    if let Some(problem) = game.problem() {
        return Err(Fault(problem).into());
    }
    experiment.check()?;
    experiment.check_levels(game)?;
    experiment.sight().check(game)?;
    Ok(experiment.check_memory(game)?)
}

impl Progress {
    fn note(&mut self, finished: &[EpisodeEnded]) {
        self.episodes += finished.len() as u64;
        self.recent.extend(finished.iter().map(|episode| RecentEpisode {
            total_reward: episode.total_reward,
            ticks: episode.ticks,
            success: episode.success,
            clipped: episode.clipped,
        }));
        let surplus = self.recent.len().saturating_sub(RECENT);
        self.recent.drain(..surplus);
    }

    /// Mean over the last episodes; `None` before the first has ended.
    fn mean(&self, value: fn(&RecentEpisode) -> f64) -> Option<f64> {
        let n = self.recent.len();
        (n > 0).then(|| self.recent.iter().map(value).sum::<f64>() / n as f64)
    }

    fn episodic_return(&self) -> Option<f64> {
        self.mean(|episode| episode.total_reward)
    }

    fn success_rate(&self) -> Option<f64> {
        self.mean(|episode| f64::from(u8::from(episode.success)))
    }

    /// Share of the clipped ticks among those of the last episodes.
    fn clipped_share(&self) -> Option<f64> {
        let ticks = self.mean(|episode| f64::from(episode.ticks)).filter(|ticks| *ticks > 0.0)?;
        Some(self.mean(|episode| f64::from(episode.clipped))? / ticks)
    }

    /// How good the policy is, where enough episodes have ended to say so.
    pub(crate) fn summary(&self) -> CheckpointSummary {
        let settled = |mean: Option<f64>| mean.filter(|_| self.recent.len() == RECENT);
        CheckpointSummary {
            step: self.steps,
            episodic_return: settled(self.episodic_return()),
            success_rate: settled(self.success_rate()),
        }
    }

    fn report(&self, learner: LearnerMetrics, initial_kl: Option<f32>, timing: Timing) -> UpdateReport {
        UpdateReport {
            update: self.updates,
            step: self.steps,
            episodes: self.episodes,
            episodic_return: self.episodic_return(),
            episodic_length: self.mean(|episode| f64::from(episode.ticks)),
            success_rate: self.success_rate(),
            clipped_share: self.clipped_share(),
            initial_kl,
            learner,
            timing,
        }
    }
}
