//! A learner's complete state in one file.

use super::{SacConfig, SacLearner};
use crate::file::TensorFile;
use crate::layout::{check_actor, check_mlp, joined_width};
use crate::nn::tracked;
use crate::norm::{put_normalizers, take_normalizers};
use crate::score::{FrozenSkill, ScoreConfig};
use crate::skill::SkillDescription;
use crate::{ActionSpace, DeviceKind, FileError, PolicySpec};
use serde::{Deserialize, Serialize};
use std::path::Path;

const KIND: &str = "sac checkpoint";
const VERSION: u32 = 1;

/// The JSON in the file's header.
///
/// The learner's generators are streams of `seed` numbered by `gradient_steps`, so these two are their whole state.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    kind: String,
    version: u32,
    config: SacConfig,
    spec: PolicySpec,
    score: Option<ScoreConfig>,
    skill: Option<SkillDescription>,
    seed: u64,
    updates: u64,
    gradient_steps: u64,
    carry: f64,
    transitions: u64,
    critic_steps: u64,
    actor_steps: u64,
    alpha_steps: u64,
}

impl SacLearner {
    /// Writes everything that is needed to go on bit for bit: weights (`actor.l0.weight`, `q1.l0.weight`,
    /// `target.q1.l0.weight`, `log_alpha`), moments (`adam.m.actor.l0.weight`), normalisers, the replay buffer
    /// (`buffer.obs`), counters, and the frozen decoder and prior. Under a temporary name first, so that a checkpoint
    /// is whole or not there.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let header = Header {
            kind: KIND.to_owned(),
            version: VERSION,
            config: self.config.clone(),
            spec: self.spec,
            score: self.skill.as_ref().map(|skill| skill.config.clone()),
            skill: self.skill.as_ref().map(|skill| skill.description.clone()),
            seed: self.streams.seed(),
            updates: self.updates,
            gradient_steps: self.gradient_steps,
            carry: self.carry,
            transitions: self.buffer.seen,
            critic_steps: self.optimizers.critics.steps,
            actor_steps: self.optimizers.actor.steps,
            alpha_steps: self.optimizers.alpha.steps,
        };
        let mut file = TensorFile::new(path, &header)?;
        file.put_network("actor", &self.nets.actor)?;
        file.put_network("", &self.nets.critics)?;
        file.put_network("target", &self.nets.targets)?;
        file.put_network("", &self.nets.log_alpha)?;
        for adam in [&self.optimizers.critics, &self.optimizers.actor, &self.optimizers.alpha] {
            file.put_adam(adam);
        }
        if let Some(skill) = &self.skill {
            skill.put(&mut file)?;
        }
        put_normalizers(&mut file, self.observations.as_ref(), self.rewards.as_ref());
        self.buffer.put(&mut file);
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote. The learner goes on exactly as the saved one would have.
    ///
    /// # Errors
    /// [`FileError`] says what is wrong with the file, or names the tensor that is missing, superfluous or misshapen.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let header: Header = file.description(KIND, VERSION)?;
        let skill = FrozenSkill::described(header.score, header.skill, header.spec, &file, device)?;
        let obs_dim = header.spec.obs.vector("SAC").map_err(|e| file.learner(e))?;
        let shape = header.spec.net_shape(obs_dim, &header.config.hidden, header.config.activation);
        let space = header.spec.action_space;
        let width = joined_width(&file, "q1", &shape)?;
        let (inputs, outputs) = match space {
            ActionSpace::Discrete(choices) => (width, choices),
            ActionSpace::Continuous(dim) => (width.saturating_add(dim), 1),
        };
        for critic in ["q1", "q2"] {
            check_mlp(&file, critic, (inputs, &shape.hidden, outputs))?;
        }
        if !skill.as_ref().is_some_and(FrozenSkill::is_copied) {
            check_actor(&file, "actor", &shape, space, true)?;
        }
        let mut learner =
            Self::build(header.config, header.spec, skill, header.seed, device).map_err(|e| file.learner(e))?;
        let (nets, adams, plain) = (&mut learner.nets, &mut learner.optimizers, device.plain());
        file.take_network("actor", &mut nets.actor, &plain)?;
        file.take_network("", &mut nets.critics, &plain)?;
        file.take_network("target", &mut nets.targets, &plain)?;
        file.take_network("", &mut nets.log_alpha, &plain)?;
        nets.actor = tracked(&nets.actor);
        nets.critics = tracked(&nets.critics);
        nets.log_alpha = tracked(&nets.log_alpha);
        file.take_adam(&mut adams.critics, "", &mut nets.critics, header.critic_steps)?;
        file.take_adam(&mut adams.actor, "actor", &mut nets.actor, header.actor_steps)?;
        file.take_adam(&mut adams.alpha, "", &mut nets.log_alpha, header.alpha_steps)?;
        if let Some(skill) = &mut learner.skill {
            skill.take(&mut file, device)?;
        }
        take_normalizers(&mut file, learner.observations.as_mut(), learner.rewards.as_mut())?;
        learner.buffer.take(&mut file, header.transitions)?;
        learner.spec.action_space.check(&learner.buffer.actions).map_err(|e| file.learner(e))?;
        learner.updates = header.updates;
        learner.gradient_steps = header.gradient_steps;
        learner.carry = header.carry;
        file.finish()?;
        Ok(learner)
    }
}
