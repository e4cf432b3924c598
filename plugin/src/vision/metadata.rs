//! Metadata of the pictures that networks read, in their files.

use crate::{
    unknown_name::UnknownName,
    vision::{ImageOptions, ObservationConfig, ObservationKind},
};
use playbot_learner::{HasExitCode, ObsKind, PictureMetadata};
use serde::Serialize;
use thiserror::Error;

/// A file does not state how the pictures for its networks are made, or this version does not
/// understand it.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("the file does not state how its pictures are made ({why}): create it again with this version")]
pub struct UnknownObservation {
    /// The problem.
    pub why: String,
}

impl HasExitCode for UnknownObservation {}

impl ObservationConfig {
    /// Returns the metadata for a file; `None` for vectors, whose names are kept.
    pub fn picture_metadata(&self) -> Option<PictureMetadata> {
        let ImageOptions { stack, grayscale, paint_velocity, .. } = self.image;
        let metadata =
            PictureMetadata { sensor: self.kind.to_string(), stack: stack as usize, grayscale, paint_velocity };
        self.is_image().then_some(metadata)
    }

    /// Returns the observation of a file whose networks read `observation`.
    ///
    /// # Errors
    ///
    /// [`UnknownObservation`] if the metadata is missing, not understood, or of pictures of another
    /// shape.
    pub fn from_metadata(
        metadata: Option<&PictureMetadata>,
        observation: &ObsKind,
    ) -> Result<Self, UnknownObservation> {
        let unknown = |why: String| Err(UnknownObservation { why });
        let (metadata, shape) = match (metadata, observation) {
            (None, ObsKind::Vector(_)) => return Ok(Self::default()),
            (Some(metadata), ObsKind::Image(shape)) => (metadata, shape),
            (None, _) => return unknown(format!("it reads {observation}, but has no metadata of them")),
            (Some(_), _) => return unknown(format!("it reads {observation}, but has metadata of pictures")),
        };
        let kind: ObservationKind =
            metadata.sensor.parse().map_err(|error: UnknownName| UnknownObservation { why: error.to_string() })?;
        let image = ImageOptions {
            width: shape.width as u32,
            height: shape.height as u32,
            stack: metadata.stack as u32,
            grayscale: metadata.grayscale,
            paint_velocity: metadata.paint_velocity,
        };
        let observation_config = Self { kind, image };
        if !observation_config.is_image() || image.check().is_err() || image.obs_kind() != *observation {
            return unknown(format!("it reads {observation}, but its metadata describes {observation_config}"));
        }
        Ok(observation_config)
    }
}

/// A difference, out of 255, that a person does not see and a policy should not mind.
pub const CLOSE: u8 = 8;

/// The difference between two pictures of the same size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PictureDifference {
    /// Mean absolute difference over pixels and the three colours, of 255.
    pub mean: f64,
    /// Share of pixels whose three colours are all within [`CLOSE`] of each other.
    pub close: f64,
}

impl PictureDifference {
    /// Compares pixel by pixel, ignoring the fourth byte. Returns `None` if the sizes differ or are
    /// 0.
    pub fn between(a: &[[u8; 4]], b: &[[u8; 4]]) -> Option<Self> {
        if a.len() != b.len() || a.is_empty() {
            return None;
        }
        let (mut sum, mut close) = (0_u64, 0_u64);
        for (a, b) in a.iter().zip(b) {
            let apart = [0, 1, 2].map(|colour| a[colour].abs_diff(b[colour]));
            sum += apart.iter().map(|&d| u64::from(d)).sum::<u64>();
            close += u64::from(apart.iter().all(|&d| d <= CLOSE));
        }
        let pixels = a.len() as f64;
        Some(Self { mean: sum as f64 / (3.0 * pixels), close: close as f64 / pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metadata_is_read_as_written_and_only_beside_what_they_describe() {
        let image = ImageOptions { stack: 4, grayscale: true, width: 48, ..ImageOptions::default() };
        let observation_config = ObservationConfig { kind: ObservationKind::Camera, image };
        let metadata = observation_config.picture_metadata();
        assert_eq!(ObservationConfig::from_metadata(metadata.as_ref(), &image.obs_kind()), Ok(observation_config));
        assert_eq!(
            ObservationConfig::from_metadata(
                ObservationConfig::default().picture_metadata().as_ref(),
                &ObsKind::Vector(3)
            ),
            Ok(ObservationConfig::default())
        );
        let other =
            |sensor: &str| metadata.clone().map(|metadata| PictureMetadata { sensor: sensor.to_owned(), ..metadata });
        for (metadata, observation, words) in [
            (None, image.obs_kind(), "has no metadata"),
            (metadata.clone(), ObsKind::Vector(3), "vectors of 3"),
            (metadata.clone(), ImageOptions::default().obs_kind(), "64×64 grey pictures of the camera, 4 in a stack"),
            (other("sonar"), image.obs_kind(), "sonar"),
            (other("vector"), image.obs_kind(), "describes vectors"),
        ] {
            let error = ObservationConfig::from_metadata(metadata.as_ref(), &observation)
                .expect_err("does not fit")
                .to_string();
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn counts_colours_and_pixels() {
        let a = [[10, 20, 30, 255], [0, 0, 0, 255]];
        let b = [[18, 20, 30, 0], [0, 9, 3, 0]];
        let difference = PictureDifference::between(&a, &b).expect("one size");
        assert_eq!(difference, PictureDifference { mean: 20.0 / 6.0, close: 0.5 });
        assert_eq!(PictureDifference::between(&a, &b[..1]), None);
        assert_eq!(PictureDifference::between(&[], &[]), None);
    }
}
