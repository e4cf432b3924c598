//! The learners behind the algorithms, as one.

use std::path::Path;

use playbot_learner::{
    DeviceKind, FileError, LearnError, ObsSlice, Policy, PolicySpec, PpoLearner, Rollout, SacLearner, SacMetrics,
    SkillModel, SkillSource, UpdateMetrics,
};

use super::{algorithm::Algorithm, config::Experiment, trainer::TrainError};
use crate::game::Game;
use crate::sensors::GameSensors;
use bevy_playbot::vision::ObservationConfig;

/// A learner of either family.
#[derive(Debug)]
pub enum Learner {
    /// PPO and SCORE-PPO.
    Ppo(Box<PpoLearner>),
    /// SAC and SCORE-SAC.
    Sac(Box<SacLearner>),
}

/// What an update of either family reports.
#[derive(Clone, Debug, PartialEq)]
pub enum LearnerMetrics {
    /// PPO and SCORE-PPO.
    Ppo(UpdateMetrics),
    /// SAC and SCORE-SAC.
    Sac(SacMetrics),
}

impl LearnerMetrics {
    /// The numbers by their TensorBoard tags; what was not measured is left out.
    pub fn scalars(&self) -> Vec<(&'static str, f64)> {
        match self {
            Self::Ppo(metrics) => metrics.scalars(),
            Self::Sac(metrics) => metrics.scalars(),
        }
    }
}

impl Learner {
    /// A learner with fresh weights, tied to `skills` if the experiment's algorithm needs them.
    ///
    /// # Errors
    ///
    /// [`TrainError`] if settings, game and skill model do not go together.
    pub fn new(
        game: &dyn Game,
        experiment: &Experiment,
        skills: Option<&SkillModel>,
        device: DeviceKind,
    ) -> Result<Self, TrainError> {
        let algorithm = experiment.algorithm;
        if !algorithm.is_trained() {
            return Err(TrainError::NotTrained(algorithm));
        }
        let (seed, score) = (experiment.seed, experiment.score.clone());
        let spec = PolicySpec { obs: experiment.sight().obs_kind(game), latent: 0, action_space: game.actions() };
        let skills = if algorithm.needs_skills() { Some(fitting(game, experiment, skills)?) } else { None };
        let (ppo, sac) = (experiment.ppo_config(), experiment.sac.clone());
        if algorithm.is_sac() {
            warn_of_large_buffer(experiment, spec, skills.map_or(0, SkillModel::latent));
        }
        Ok(match (algorithm.is_sac(), skills) {
            (false, None) => Self::Ppo(PpoLearner::new(ppo, spec, seed, device)?.into()),
            (false, Some(model)) => Self::Ppo(PpoLearner::with_skill(ppo, score, model, seed, device)?.into()),
            (true, None) => Self::Sac(SacLearner::new(sac, spec, seed, device)?.into()),
            (true, Some(model)) => Self::Sac(SacLearner::with_skill(sac, score, model, seed, device)?.into()),
        })
    }

    /// The policy that plays now.
    pub fn policy(&self) -> Policy {
        match self {
            Self::Ppo(learner) => learner.policy(),
            Self::Sac(learner) => learner.policy(),
        }
    }

    /// Where its skills come from, if it has any.
    pub fn skills(&self) -> Option<SkillSource> {
        match self {
            Self::Ppo(learner) => learner.skills(),
            Self::Sac(learner) => learner.skills(),
        }
    }

    /// Width of the skills that a rollout must hold.
    pub fn rollout_latent(&self) -> usize {
        match self {
            Self::Ppo(learner) => learner.rollout_latent(),
            Self::Sac(learner) => learner.rollout_latent(),
        }
    }

    /// Learns from a rollout.
    ///
    /// # Errors
    ///
    /// [`LearnError`] if it does not fit, or names what ran away.
    pub fn update(&mut self, rollout: &Rollout) -> Result<LearnerMetrics, LearnError> {
        match self {
            Self::Ppo(learner) => learner.update(rollout).map(LearnerMetrics::Ppo),
            Self::Sac(learner) => learner.update(rollout).map(LearnerMetrics::Sac),
        }
    }

    /// Mean divergence between decoder and policy over `n` rows, in nats; `None` without skills.
    ///
    /// # Errors
    ///
    /// [`LearnError::InitialKl`] if the policy should still be a copy of the decoder and is not.
    pub fn initial_kl(&self, z: &[f32], obs: ObsSlice<'_>, n: usize) -> Result<Option<f32>, LearnError> {
        match self {
            Self::Ppo(learner) => learner.initial_kl(z, obs, n),
            Self::Sac(learner) => learner.initial_kl(z, obs, n),
        }
    }

    /// Writes everything that is needed to go on bit for bit.
    ///
    /// # Errors
    ///
    /// [`FileError`] if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        match self {
            Self::Ppo(learner) => learner.save(path),
            Self::Sac(learner) => learner.save(path),
        }
    }

    /// Takes over what an experiment may change while a training is stopped: its length, over which a learning rate falls.
    pub(crate) fn set_length(&mut self, experiment: &Experiment) {
        if let Self::Ppo(learner) = self {
            learner.set_total_updates(experiment.ppo_config().total_updates);
        }
    }

    /// Reads what the learner of this algorithm has saved.
    ///
    /// # Errors
    ///
    /// [`FileError`] says what is wrong with the file.
    pub fn load(algorithm: Algorithm, path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        Ok(match algorithm.is_sac() {
            false => Self::Ppo(PpoLearner::load(path, device)?.into()),
            true => Self::Sac(SacLearner::load(path, device)?.into()),
        })
    }
}

/// Says so if the replay buffer will need more memory than people expect.
fn warn_of_large_buffer(experiment: &Experiment, spec: PolicySpec, latent: usize) {
    const GIB: f64 = (1u64 << 30) as f64;
    let transitions = (experiment.sac.buffer as u64).min(experiment.steps);
    let numbers = 2 * (spec.obs.numbers() + latent) + spec.action_space.dim() + 2;
    let size = transitions as f64 * (4 * numbers) as f64 / GIB;
    if size > 1.0 {
        tracing::warn!(
            "the replay buffer will grow to {size:.1} GiB of memory, and each checkpoint with it on the disk: \
             `sac.buffer` can be smaller than {}, and `checkpoints.every` larger",
            experiment.sac.buffer
        );
    }
}

/// The skill model, if it is there and was learned for this game.
fn fitting<'a>(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&'a SkillModel>,
) -> Result<&'a SkillModel, TrainError> {
    let skills = skills.ok_or(TrainError::NoSkills(experiment.algorithm))?;
    let (model, sight) = (ObservationConfig::from_card(skills.picture(), &skills.observation())?, experiment.sight());
    if model.is_image() != sight.is_image() || (sight.is_image() && model != sight) {
        return Err(TrainError::SkillObservation { model, experiment: sight });
    }
    let (observation, action_space) = (sight.obs_kind(game), game.actions());
    if (skills.observation(), skills.action_space()) != (observation, action_space) {
        return Err(TrainError::ForeignSkills {
            game: game.name().to_owned(),
            model_obs: skills.observation(),
            model_actions: skills.action_space(),
            game_obs: observation,
            game_actions: action_space,
        });
    }
    Ok(skills)
}
