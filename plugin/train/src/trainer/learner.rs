//! The learner of an experiment's algorithm.

use crate::{
    error::TrainError,
    experiment::{Algorithm, Experiment, LearnerKind},
};
use bevy_playbot::vision::ObservationConfig;
use playbot_harness::{game::Game, sensors::GameSensors, split::HeldOut};
use playbot_learner::{
    DeviceKind, FileError, Learner, PolicySpec, PpoLearner, Rollout, SacLearner, SkillModel, SpirlLearner,
};
use std::{
    ops::{Deref, DerefMut},
    path::Path,
};

/// Learner of any algorithm.
#[derive(Debug)]
pub struct TrainedLearner(Box<dyn Learner>);

impl Deref for TrainedLearner {
    type Target = dyn Learner;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

impl DerefMut for TrainedLearner {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut *self.0
    }
}

impl TrainedLearner {
    /// Makes a learner with fresh weights, tied to `skills` if the experiment's algorithm needs them. `demos` are the
    /// rollouts for algorithms that train on recordings too.
    ///
    /// # Errors
    ///
    /// [`TrainError`] if settings, game and skill model do not fit one another.
    pub fn new(
        game: &dyn Game,
        experiment: &Experiment,
        skills: Option<&SkillModel>,
        demos: &[Rollout],
        device: DeviceKind,
    ) -> Result<Self, TrainError> {
        let algorithm = experiment.algorithm;
        let (seed, score) = (experiment.seed, experiment.score.clone());
        let spec =
            PolicySpec { obs: experiment.observation_config().obs_kind(game), latent: 0, action_space: game.actions() };
        let (ppo, sac, spirl) = (experiment.ppo_config(), experiment.sac.clone(), experiment.spirl.clone());
        let skills = skills.filter(|_| algorithm.needs_skills());
        match algorithm.learner() {
            LearnerKind::Ppo => {}
            LearnerKind::Sac => warn_of_large_buffer(experiment, spec, skills.map_or(0, SkillModel::latent)),
        }
        if algorithm.trains_on_demos() && demos.is_empty() {
            return Err(TrainError::NoDemos(algorithm));
        }
        let model = || fitting(game, experiment, skills);
        Ok(match algorithm {
            Algorithm::BehaviourCloning => return Err(TrainError::NotTrained(algorithm)),
            Algorithm::Ppo => Self::of(PpoLearner::new(ppo, spec, seed, device)?),
            Algorithm::Sac => Self::of(SacLearner::new(sac, spec, seed, device)?),
            Algorithm::Rlpd => Self::of(SacLearner::with_demos(sac, &experiment.rlpd, demos, spec, seed, device)?),
            Algorithm::ScorePpo => Self::of(PpoLearner::with_skill(ppo, score, model()?, seed, device)?),
            Algorithm::ScoreSac => Self::of(SacLearner::with_skill(sac, score, model()?, seed, device)?),
            Algorithm::SpirlPpo => Self::of(SpirlLearner::ppo(spirl, ppo, &score, model()?, seed, device)?),
            Algorithm::SpirlSac => Self::of(SpirlLearner::sac(spirl, sac, &ppo, &score, model()?, seed, device)?),
        })
    }

    fn of(learner: impl Learner + 'static) -> Self {
        Self(Box::new(learner))
    }

    /// Takes over the settings that may change while training is stopped: the length, over which a learning rate
    /// falls.
    pub(crate) fn set_length(&mut self, experiment: &Experiment) {
        self.set_total_updates(experiment.ppo_config().total_updates);
    }

    /// Loads a learner of this algorithm.
    ///
    /// # Errors
    ///
    /// [`FileError`] with the error of the file.
    pub fn load(algorithm: Algorithm, path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        if algorithm.learns_prior() {
            return Ok(Self::of(SpirlLearner::load(path, device)?));
        }
        Ok(match algorithm.learner() {
            LearnerKind::Ppo => Self::of(PpoLearner::load(path, device)?),
            LearnerKind::Sac => Self::of(SacLearner::load(path, device)?),
        })
    }
}

/// Warns of a large replay buffer.
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

/// Returns the skill model, if it exists and was learned for this game.
fn fitting<'a>(
    game: &dyn Game,
    experiment: &Experiment,
    skills: Option<&'a SkillModel>,
) -> Result<&'a SkillModel, TrainError> {
    let skills = skills.ok_or(TrainError::NoSkills(experiment.algorithm))?;
    let (model, observation_config) =
        (ObservationConfig::from_metadata(skills.picture(), &skills.observation())?, experiment.observation_config());
    if model.is_image() != observation_config.is_image()
        || (observation_config.is_image() && model != observation_config)
    {
        return Err(TrainError::SkillObservation { model, experiment: observation_config });
    }
    let (observation, action_space) = (observation_config.obs_kind(game), game.actions());
    if (skills.observation(), skills.action_space()) != (observation, action_space) {
        return Err(TrainError::ForeignSkills {
            game: game.name().to_owned(),
            model_obs: skills.observation(),
            model_actions: skills.action_space(),
            game_obs: observation,
            game_actions: action_space,
        });
    }
    match HeldOut::new(game, &experiment.test).shown_by(skills.demos()) {
        Some(seen) => Err(TrainError::SeenSkills { seen, test: experiment.test.clone() }),
        None => Ok(skills),
    }
}
