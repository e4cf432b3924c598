//! Metadata of the pictures that become observations.

use super::ObsKind;
use crate::LearnError;
use serde::{Deserialize, Serialize};

/// Metadata of the images that a policy or a skill model observes: images of one shape can be made in different ways.
/// Their size is that of the policy's observation, and the network that reads them is part of the policy.
#[derive(Serialize, Deserialize, Clone, PartialEq, Eq, Debug)]
#[serde(deny_unknown_fields)]
pub struct PictureCard {
    /// Name of the sensor that made them.
    pub sensor: String,
    /// Number of successive pictures in an image, oldest first.
    pub stack: usize,
    /// One channel of brightness instead of red, green and blue.
    pub grayscale: bool,
    /// True if the agent's velocity is painted into them.
    pub paint_velocity: bool,
}

impl PictureCard {
    /// Channels of an image.
    pub fn channels(&self) -> usize {
        self.stack * if self.grayscale { 1 } else { 3 }
    }

    /// Checks that a policy of `observation` can have this metadata.
    pub(crate) fn check(&self, observation: ObsKind) -> Result<(), LearnError> {
        match observation {
            ObsKind::Image(image) if image.channels == self.channels() => Ok(()),
            _ => Err(LearnError::Config(format!(
                "the metadata describes {} pictures with {} channels in total, but the policy observes {observation}",
                self.stack,
                self.channels()
            ))),
        }
    }
}
