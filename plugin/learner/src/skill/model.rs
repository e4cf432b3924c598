//! A trained skill model and its file.

use super::{Prior, SkillConfig, SkillNets};
use crate::file::TensorFile;
use crate::layout::{check_actor, check_cnn, check_mlp, check_tensor, product};
use crate::nn::{Activation, frozen};
use crate::norm::{ObsStats, put_obs_stats, take_obs_stats};
use crate::policy::{Actor, NetShape, PictureCard, Policy, StdKind};
use crate::rng::Streams;
use crate::{ActionSpace, DeviceKind, FileError, LearnError, ObsKind};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// What a skill model's weights need to be understood.
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields)]
pub(crate) struct SkillDescription {
    pub(crate) config: SkillConfig,
    // Files of vectors were written before there were images.
    #[serde(alias = "obs_dim")]
    pub(crate) observation: ObsKind,
    pub(crate) action_space: ActionSpace,
}

/// The JSON in the file's header.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    kind: String,
    version: u32,
    skill: SkillDescription,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    picture: Option<PictureCard>,
}

const KIND: &str = "skill model";
const VERSION: u32 = 1;

/// Encoder, decoder and prior after training, with the settings they were trained with.
///
/// The file is safetensors with names such as `decoder.l0.weight` (`[inputs, outputs]`) or `decoder.cnn.s0.conv.weight`
/// (`[outputs, inputs, rows, columns]`), the frozen normaliser (`obs_norm.mean`, `obs_norm.inv_std`) by
/// [`SkillConfig::norm_obs`], and the settings as JSON in its header, so that one file is all there is.
#[derive(Clone, Debug)]
pub struct SkillModel {
    pub(crate) description: SkillDescription,
    pub(crate) nets: SkillNets,
    pub(crate) stats: Option<Arc<ObsStats>>,
    pub(crate) device: DeviceKind,
    picture: Option<PictureCard>,
}

impl SkillModel {
    pub(crate) fn new(
        description: SkillDescription,
        nets: &SkillNets,
        stats: Option<Arc<ObsStats>>,
        device: DeviceKind,
    ) -> Self {
        Self { description, nets: frozen(nets), stats, device, picture: None }
    }

    /// The model with a note on how the images that it observes are made; `None` for vectors.
    pub fn with_picture(self, picture: Option<PictureCard>) -> Self {
        Self { picture, ..self }
    }

    /// How the images that it observes are made, if somebody noted it.
    pub fn picture(&self) -> Option<&PictureCard> {
        self.picture.as_ref()
    }

    /// The settings it was trained with.
    pub fn config(&self) -> &SkillConfig {
        &self.description.config
    }

    /// What it observes.
    pub fn observation(&self) -> ObsKind {
        self.description.observation
    }

    /// Numbers in an observation.
    pub fn obs_dim(&self) -> usize {
        self.observation().numbers()
    }

    /// What the decoder acts in.
    pub fn action_space(&self) -> ActionSpace {
        self.description.action_space
    }

    /// Width of z.
    pub fn latent(&self) -> usize {
        self.description.config.latent
    }

    /// How its networks see observations, by [`SkillConfig::norm_obs`]; `None` for raw ones.
    pub fn obs_stats(&self) -> Option<&ObsStats> {
        self.stats.as_deref()
    }

    /// The networks, for inference. They read observations as [`Self::obs_stats`] makes them.
    pub fn nets(&self) -> &SkillNets {
        &self.nets
    }

    /// The decoder π(a | s, z), which reads observations as [`Self::obs_stats`] makes them.
    pub fn decoder(&self) -> &Actor {
        &self.nets.decoder
    }

    /// The prior p(z | s) of raw observations, giving skills as the decoder takes them.
    pub fn prior(&self) -> Prior {
        let config = self.config();
        let device = self.device.plain();
        let (stats, latent) = (self.stats.clone(), (config.latent, config.tanh_latent));
        Prior::learned(&self.nets.prior, stats, self.observation(), latent, device)
    }

    /// The decoder as a policy of raw observations without a critic. Under the prior this is behaviour cloning.
    pub fn policy(&self) -> Policy {
        let widths = (self.observation(), self.latent());
        let stats = self.stats.clone();
        Policy::new(self.decoder(), None, stats, self.action_space(), widths, self.device.plain())
    }

    /// Writes the file, in one step: under a temporary name first.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written, [`FileError::Learner`] if the note on its images is not of their shape.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let (skill, picture) = (self.description.clone(), self.picture.clone());
        if let Some(picture) = &picture {
            let learner = |source| FileError::Learner { path: path.to_owned(), source };
            picture.check(self.observation()).map_err(learner)?;
        }
        let header = Header { kind: KIND.to_owned(), version: VERSION, skill, picture };
        let mut file = TensorFile::new(path, &header)?;
        file.put_network("", &self.nets)?;
        if let Some(stats) = &self.stats {
            put_obs_stats(&mut file, "obs_norm", stats);
        }
        file.write()
    }

    /// Reads a file that [`Self::save`] wrote.
    ///
    /// # Errors
    /// [`FileError`] says what is wrong with the file, or names the tensor that is missing, superfluous or misshapen.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let header: Header = file.description(KIND, VERSION)?;
        let description = header.skill;
        description.check(&file)?;
        if let Some(picture) = &header.picture {
            picture.check(description.observation).map_err(|e| file.learner(e))?;
        }
        let mut nets = description.nets(device).map_err(|e| file.learner(e))?;
        file.take_network("", &mut nets, &device.plain())?;
        let stats = description.take_stats(&mut file, "obs_norm")?;
        file.finish()?;
        Ok(Self { description, nets, stats, device, picture: header.picture })
    }
}

impl SkillDescription {
    /// Networks of these sizes, to be filled from a file.
    pub(crate) fn nets(&self, device: DeviceKind) -> Result<SkillNets, LearnError> {
        self.config.validate()?;
        let (config, space) = (&self.config, self.action_space);
        SkillNets::new(config, self.observation, space, &Streams::new(0), &device.plain())
    }

    /// The frozen normaliser called `name` out of a file, if the networks read through one.
    pub(crate) fn take_stats(&self, file: &mut TensorFile, name: &str) -> Result<Option<Arc<ObsStats>>, FileError> {
        if !self.config.norm_obs {
            return Ok(None);
        }
        Ok(Some(Arc::new(take_obs_stats(file, name, self.observation.numbers())?)))
    }

    /// Decoder and prior alone.
    pub(crate) fn actors(&self, device: DeviceKind) -> Result<(Actor, Actor), LearnError> {
        self.config.validate()?;
        SkillNets::actors(&self.config, self.observation, self.action_space, &Streams::new(0), &device.plain())
    }

    /// `Ok` if `file` holds networks of these sizes.
    pub(crate) fn check(&self, file: &TensorFile) -> Result<(), FileError> {
        self.check_actors(file)?;
        let config = &self.config;
        let features = match self.observation {
            ObsKind::Vector(obs_dim) => {
                let width = config.encoder_hidden;
                check_mlp(file, "encoder.state", (obs_dim, &[width; 2], width))?;
                width
            }
            ObsKind::Image(image) => {
                check_cnn(file, "encoder.cnn", &config.cnn, image)?;
                config.cnn.features()
            }
        };
        // Features and actions are as wide as tensors that are there.
        let mut width = features + config.action_input.width(self.action_space);
        let gates = product(file, "encoder.gru", &[3, config.gru_hidden])?;
        for layer in 0..config.gru_layers {
            check_tensor(file, &format!("encoder.gru.l{layer}.weight_ih"), &[2, width, gates])?;
            check_tensor(file, &format!("encoder.gru.l{layer}.weight_hh"), &[2, config.gru_hidden, gates])?;
            width = 2 * config.gru_hidden;
        }
        check_tensor(file, "encoder.mean.weight", &[width, config.latent])
    }

    /// `Ok` if `file` holds a decoder and a prior of these sizes.
    pub(crate) fn check_actors(&self, file: &TensorFile) -> Result<(), FileError> {
        let config = &self.config;
        config.validate().map_err(|e| file.learner(e))?;
        config.check_observation(self.observation).map_err(|e| file.learner(e))?;
        let prior = (0, ActionSpace::Continuous(config.latent), config.prior_std);
        for (name, (latent, space, std)) in
            [("decoder", (config.latent, self.action_space, config.decoder_std)), ("prior", prior)]
        {
            let obs_dim = match self.observation {
                ObsKind::Vector(width) => width,
                ObsKind::Image(image) => {
                    check_cnn(file, &format!("{name}.cnn"), &config.cnn, image)?;
                    config.cnn.features()
                }
            };
            let shape = NetShape { obs_dim, latent, hidden: config.hidden.clone(), activation: Activation::Relu };
            check_actor(file, name, &shape, space, std == StdKind::State)?;
        }
        Ok(())
    }
}
