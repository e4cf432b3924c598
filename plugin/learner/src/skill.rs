//! The skill model: an autoencoder of action sequences.
//!
//! An encoder q(z | τ) turns a window τ of states and actions into a latent skill z. A decoder π(a | s, z) turns z
//! back into actions. A prior p(z | s₀) says which skills a demonstrator would choose in a state. Training minimises
//! J = NLL + β KL(q ‖ p) (the SCORE paper's Eq. 2 with its sign corrected; OPAL, Ajay et al. 2021).
//!
//! Observations are vectors or images ([`crate::ObsKind`]). For images each of the three networks has its own trunk
//! of convolutions ([`SkillConfig::cnn`]), before the layers that would read a vector.
//!
//! There is one pipeline everywhere. The networks see observations raw (pixels divided by 255) or through one frozen
//! normaliser ([`SkillConfig::norm_obs`]). The decoder sees tanh(z) (or z, by [`SkillConfig::tanh_latent`]). This
//! holds in training, in use, and in the policies that are tied to it.
//!
//! The folder, in reading order:
//!
//! - `config`: settings of the skill model.
//! - `dataset`: demonstrations for it, and windows cut from them.
//! - `nets`: the three networks; `prior`: the prior in use.
//! - `loss`: the loss J.
//! - `trainer`: the training, its held-out demonstrations and its checkpoints.

mod config;
mod dataset;
mod loss;
mod nets;
mod prior;
mod trainer;

use crate::{
    ActionSpace, DeviceKind, FileError, InputMap, LearnError, ObsKind, PictureMetadata, PolicySpec, SeenLevels,
    Streams,
    begin_from::{Fit, transplant},
    file::{FileKind, TensorFile},
    nn::frozen,
    norm::{ObsStats, put_obs_stats, take_obs_stats},
    policy::{Actor, ActorShape, EntityEncoder, Policy, StdKind},
};
use playbot_kernels::elementwise::Activation;
use serde::{Deserialize, Serialize};
use std::{path::Path, sync::Arc};

pub(crate) use crate::skill::nets::Actors;
pub use crate::skill::{
    config::{ActionInput, Reduction, SkillConfig},
    dataset::{Dataset, DatasetEpisode, Window, WindowRule},
    loss::{SkillLoss, skill_loss},
    nets::{Encoder, SkillForward, SkillNets, StateHeads, StateNet},
    prior::{Prior, SkillDraw},
    trainer::{HeldOutMetrics, SkillMetrics, SkillProgress, SkillTrainer},
};

const FILE: FileKind = FileKind { name: "skill model", version: 1 };

/// Encoder, decoder and prior after training, with the settings they were trained with.
///
/// The file is safetensors with names such as `decoder.l0.weight` (`[inputs, outputs]`) or
/// `decoder.cnn.s0.conv.weight` (`[outputs, inputs, rows, columns]`). It also holds the frozen normaliser
/// (`obs_norm.mean`, `obs_norm.inv_std`) by [`SkillConfig::norm_obs`], and the settings as JSON in its header.
#[derive(Clone, Debug)]
pub struct SkillModel {
    pub(crate) description: SkillDescription,
    pub(crate) nets: SkillNets,
    pub(crate) stats: Option<Arc<ObsStats>>,
    pub(crate) device: DeviceKind,
    picture: Option<PictureMetadata>,
    demos: Option<SeenLevels>,
    /// False for a model out of a learner, which keeps decoder and prior only.
    has_encoder: bool,
}

impl SkillModel {
    pub(crate) fn new(
        description: SkillDescription,
        nets: &SkillNets,
        stats: Option<Arc<ObsStats>>,
        device: DeviceKind,
    ) -> Self {
        let nets = SkillNets { state_heads: None, ..frozen(nets) };
        Self { description, nets, stats, device, picture: None, demos: None, has_encoder: true }
    }

    /// Creates a model of decoder and prior alone, for their observation, or for a longer one by `inputs`. Both give the
    /// same outputs, whatever the new values are. Without an encoder it can be used and not saved.
    ///
    /// # Errors
    /// [`LearnError::Config`] if `inputs` are those of another observation.
    pub(crate) fn of_actors(
        actors: &Actors,
        description: &SkillDescription,
        stats: Option<&ObsStats>,
        inputs: Option<&InputMap>,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let observation = match (description.observation, inputs) {
            (ObsKind::Vector(_), Some(map)) => ObsKind::Vector(map.width()),
            (observation, _) => observation,
        };
        let map = InputMap::between(inputs, description.observation, observation)?;
        let mut description = SkillDescription { observation, ..description.clone() };
        let sets = map.sets(description.config.entities.blocks());
        description.config.entities = description.config.entities.with_blocks(sets.clone());
        let SkillDescription { config, action_space, .. } = &description;
        let mut nets = SkillNets::new(config, observation, *action_space, &Streams::new(0), &device.plain())?;
        let shape = |actor: &Actor| actor.entities.as_ref().map(EntityEncoder::shape);
        let (behind, _) = map.behind(shape(&nets.decoder).as_ref(), shape(&actors.decoder).as_ref())?;
        let fit = |latent| Fit { inputs: &behind, latent, memory: 0, is_refused: None };
        transplant(&mut nets.decoder, &actors.decoder, "decoder", fit(config.latent))?;
        transplant(&mut nets.prior, &actors.prior, "prior", fit(0))?;
        let stats = stats.map(|stats| match observation {
            ObsKind::Vector(_) => Arc::new(map.frozen_stats(stats, &sets)),
            ObsKind::Image(_) => Arc::new(stats.clone()),
        });
        Ok(Self { has_encoder: false, ..Self::new(description, &nets, stats, device) })
    }

    /// Adds metadata of the images that the model observes; `None` for vectors.
    pub fn with_picture(self, picture: Option<PictureMetadata>) -> Self {
        Self { picture, ..self }
    }

    /// Returns the metadata of the images that it observes, if known.
    pub fn picture(&self) -> Option<&PictureMetadata> {
        self.picture.as_ref()
    }

    /// Adds metadata of its demonstrations.
    pub fn with_demos(self, demos: Option<SeenLevels>) -> Self {
        Self { demos, ..self }
    }

    /// Returns the metadata of its demonstrations, if [noted](Dataset::with_seen): files of older versions
    /// have none.
    pub fn demos(&self) -> Option<&SeenLevels> {
        self.demos.as_ref()
    }

    /// Returns the settings it was trained with.
    pub fn config(&self) -> &SkillConfig {
        &self.description.config
    }

    /// Returns the kind of its observations.
    pub fn observation(&self) -> ObsKind {
        self.description.observation
    }

    /// Numbers in an observation.
    pub fn obs_dim(&self) -> usize {
        self.observation().numbers()
    }

    /// Returns the action space of the decoder.
    pub fn action_space(&self) -> ActionSpace {
        self.description.action_space
    }

    /// Returns the width of z.
    pub fn latent(&self) -> usize {
        self.description.config.latent
    }

    /// Returns the normalisation of its networks' observations, by [`SkillConfig::norm_obs`]; `None` for raw ones.
    pub fn obs_stats(&self) -> Option<&ObsStats> {
        self.stats.as_deref()
    }

    /// Returns the networks, for inference. They read observations normalised by [`Self::obs_stats`].
    pub fn nets(&self) -> &SkillNets {
        &self.nets
    }

    /// Returns the decoder π(a | s, z), which reads observations normalised by [`Self::obs_stats`].
    pub fn decoder(&self) -> &Actor {
        &self.nets.decoder
    }

    /// Returns the prior p(z | s) of raw observations, with skills in the decoder's form.
    pub fn prior(&self) -> Prior {
        let (config, stats, device) = (self.config(), self.stats.clone(), self.device.plain());
        Prior::learned(&self.nets.prior, stats, self.observation(), config.latent, config.tanh_latent, device)
    }

    /// Returns the decoder as a policy of raw observations without a critic. Under the prior this is behaviour
    /// cloning.
    pub fn policy(&self) -> Policy {
        let spec = self.description.decoder_spec();
        Policy::new(self.decoder(), None, self.stats.clone(), spec, self.device.plain())
    }

    /// Writes the file, in one step: under a temporary name first.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written, [`FileError::Learner`] if the metadata of its images does not fit
    /// their shape.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let (skill, picture, demos) = (self.description.clone(), self.picture.clone(), self.demos.clone());
        if !self.has_encoder {
            let text = "these skills come from a run, which keeps no encoder: save its policy instead".to_owned();
            return Err(FileError::Learner { path: path.to_owned(), source: LearnError::Config(text) });
        }
        if let Some(picture) = &picture {
            let learner = |source| FileError::Learner { path: path.to_owned(), source };
            picture.check(self.observation()).map_err(learner)?;
        }
        let mut file = TensorFile::new(path, FILE, &Header { skill, picture, demos })?;
        file.put_network("", &self.nets)?;
        if let Some(stats) = &self.stats {
            put_obs_stats(&mut file, "obs_norm", stats);
        }
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file, or names the tensor that is missing, superfluous or
    /// misshapen.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path).map_err(|error| error.or_again(": learn the skills again"))?;
        let header: Header = file.header(FILE)?;
        device.check().map_err(|e| file.learner(e))?;
        let description = header.skill;
        let nets = SkillNets::stored(&description, &mut file, "", &device.plain())?;
        if let Some(picture) = &header.picture {
            picture.check(description.observation).map_err(|e| file.learner(e))?;
        }
        let stats = description.take_stats(&mut file, "obs_norm")?;
        file.finish()?;
        let (picture, demos) = (header.picture, header.demos);
        Ok(Self { description, nets, stats, device, picture, demos, has_encoder: true })
    }
}

/// The JSON in the file's header.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    skill: SkillDescription,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    picture: Option<PictureMetadata>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    demos: Option<SeenLevels>,
}

/// The settings of a skill model, and its observation and action space.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct SkillDescription {
    pub(crate) config: SkillConfig,
    // Files of vectors were written before there were images.
    #[serde(alias = "obs_dim")]
    pub(crate) observation: ObsKind,
    pub(crate) action_space: ActionSpace,
}

impl SkillDescription {
    /// Returns the inputs and outputs of the decoder.
    pub(crate) fn decoder_spec(&self) -> PolicySpec {
        PolicySpec { obs: self.observation, latent: self.config.latent, action_space: self.action_space }
    }

    /// Returns the inputs and outputs of the prior: its action is the skill.
    pub(crate) fn prior_spec(&self) -> PolicySpec {
        PolicySpec { obs: self.observation, latent: 0, action_space: ActionSpace::Continuous(self.config.latent) }
    }

    /// Returns the decoder's layers.
    pub(crate) fn decoder_shape(&self) -> ActorShape {
        self.actor(&self.decoder_spec(), self.config.decoder_std)
    }

    /// Returns the prior's layers.
    pub(crate) fn prior_shape(&self) -> ActorShape {
        self.actor(&self.prior_spec(), self.config.prior_std)
    }

    fn actor(&self, spec: &PolicySpec, std: StdKind) -> ActorShape {
        let shape = ActorShape::new(spec, &self.config.cnn, &self.config.hidden, Activation::Relu, std.into());
        shape.with_entities(&self.config.entities)
    }

    /// Takes the frozen normaliser called `name` out of a file, if the networks use one.
    pub(crate) fn take_stats(&self, file: &mut TensorFile, name: &str) -> Result<Option<Arc<ObsStats>>, FileError> {
        if !self.config.norm_obs {
            return Ok(None);
        }
        Ok(Some(Arc::new(take_obs_stats(file, name, self.observation.numbers())?)))
    }
}

/// The name of the frozen normaliser of decoder and prior in files of policies and learners.
pub(crate) const SKILL_STATS: &str = "skill.obs_norm";

/// The source of a policy's skills, and the decoder it is tied to.
#[derive(Clone, Debug)]
pub struct SkillSource {
    /// p(z | s).
    pub prior: Prior,
    /// The skill model's decoder, without a critic; behaviour cloning if it plays instead of the policy.
    pub decoder: Policy,
    /// Ticks for which one skill is used (the paper's T).
    pub skill_interval: usize,
    /// Draw skills at random, or use the prior's mean.
    pub draw: SkillDraw,
}
