//! A trained skill model and its file.

use super::{Prior, SkillConfig, SkillNets};
use crate::file::TensorFile;
use crate::nn::frozen;
use crate::policy::{Actor, Policy};
use crate::rng::Streams;
use crate::{ActionSpace, DeviceKind, FileError, LearnError, ObsKind};
use serde::{Deserialize, Serialize};
use std::path::Path;

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
}

const KIND: &str = "skill model";
const VERSION: u32 = 1;

/// Encoder, decoder and prior after training, with the settings they were trained with.
///
/// The file is safetensors with names such as `decoder.l0.weight` (`[inputs, outputs]`) or `decoder.cnn.s0.conv.weight`
/// (`[outputs, inputs, rows, columns]`) and the settings as JSON in its header, so that one file is all there is.
#[derive(Clone, Debug)]
pub struct SkillModel {
    pub(crate) description: SkillDescription,
    pub(crate) nets: SkillNets,
    pub(crate) device: DeviceKind,
}

impl SkillModel {
    pub(crate) fn new(description: SkillDescription, nets: &SkillNets, device: DeviceKind) -> Self {
        Self { description, nets: frozen(nets), device }
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

    /// The networks, for inference.
    pub fn nets(&self) -> &SkillNets {
        &self.nets
    }

    /// The decoder π(a | s, z).
    pub fn decoder(&self) -> &Actor {
        &self.nets.decoder
    }

    /// The prior p(z | s), giving skills as the decoder takes them.
    pub fn prior(&self) -> Prior {
        let config = self.config();
        let device = self.device.plain();
        Prior::learned(&self.nets.prior, self.observation(), config.latent, config.tanh_latent, device)
    }

    /// The decoder as a policy without a critic. Under the prior this is behaviour cloning.
    pub fn policy(&self) -> Policy {
        let widths = (self.observation(), self.latent());
        Policy::new(self.decoder(), None, None, self.action_space(), widths, self.device.plain())
    }

    /// Writes the file, in one step: under a temporary name first.
    ///
    /// # Errors
    /// [`FileError::Io`] if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let skill = self.description.clone();
        let header = Header { kind: KIND.to_owned(), version: VERSION, skill };
        let mut file = TensorFile::new(path, &header)?;
        file.put_network("", &self.nets)?;
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
        let mut nets = description.nets(device).map_err(|e| file.learner(e))?;
        file.take_network("", &mut nets, &device.plain())?;
        file.finish()?;
        Ok(Self { description, nets, device })
    }
}

impl SkillDescription {
    /// Networks of these sizes, to be filled from a file.
    pub(crate) fn nets(&self, device: DeviceKind) -> Result<SkillNets, LearnError> {
        self.config.validate()?;
        let (config, space) = (&self.config, self.action_space);
        SkillNets::new(config, self.observation, space, &Streams::new(0), &device.plain())
    }
}
