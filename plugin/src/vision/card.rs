//! What files say of the pictures that their networks read.

use playbot_learner::{ObsKind, PictureCard};
use thiserror::Error;

use super::{ImageOptions, ObservationConfig, ObservationKind};
use crate::unknown_name::UnknownName;

/// A file does not say how the pictures are made that its networks read, or not in a way that this version knows.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("the file does not say how the pictures that it reads are made ({why}): make it again with this version")]
pub struct UnknownObservation {
    /// What is wrong.
    pub why: String,
}

impl ObservationConfig {
    /// What a file keeps of it; nothing for vectors, whose names are kept.
    pub fn card(&self) -> Option<PictureCard> {
        let ImageOptions { stack, grayscale, paint_velocity, .. } = self.image;
        let card = PictureCard { sensor: self.kind.to_string(), stack: stack as usize, grayscale, paint_velocity };
        self.is_image().then_some(card)
    }

    /// What a file says whose networks read `observation`.
    ///
    /// # Errors
    ///
    /// [`UnknownObservation`] if the card is missing, not understood, or of pictures of another shape.
    pub fn from_card(card: Option<&PictureCard>, observation: &ObsKind) -> Result<Self, UnknownObservation> {
        let unknown = |why: String| Err(UnknownObservation { why });
        let (card, shape) = match (card, observation) {
            (None, ObsKind::Vector(_)) => return Ok(Self::default()),
            (Some(card), ObsKind::Image(shape)) => (card, shape),
            (None, _) => return unknown(format!("it reads {observation} and has no card of them")),
            (Some(_), _) => return unknown(format!("it reads {observation}, and has a card of pictures")),
        };
        let kind: ObservationKind =
            card.sensor.parse().map_err(|error: UnknownName| UnknownObservation { why: error.to_string() })?;
        let image = ImageOptions {
            width: shape.width as u32,
            height: shape.height as u32,
            stack: card.stack as u32,
            grayscale: card.grayscale,
            paint_velocity: card.paint_velocity,
        };
        let observation_config = Self { kind, image };
        if !observation_config.is_image() || image.check().is_err() || image.obs_kind() != *observation {
            return unknown(format!("it reads {observation}, its card tells of {observation_config}"));
        }
        Ok(observation_config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cards_are_read_as_written_and_only_beside_what_they_describe() {
        let image = ImageOptions { stack: 4, grayscale: true, width: 48, ..ImageOptions::default() };
        let observation_config = ObservationConfig { kind: ObservationKind::Camera, image };
        let card = observation_config.card();
        assert_eq!(ObservationConfig::from_card(card.as_ref(), &image.obs_kind()), Ok(observation_config));
        assert_eq!(
            ObservationConfig::from_card(ObservationConfig::default().card().as_ref(), &ObsKind::Vector(3)),
            Ok(ObservationConfig::default())
        );
        let other = |sensor: &str| card.clone().map(|card| PictureCard { sensor: sensor.to_owned(), ..card });
        for (card, observation, words) in [
            (None, image.obs_kind(), "has no card"),
            (card.clone(), ObsKind::Vector(3), "vectors of 3"),
            (card.clone(), ImageOptions::default().obs_kind(), "64×64 grey pictures of the camera, 4 in a stack"),
            (other("sonar"), image.obs_kind(), "sonar"),
            (other("vector"), image.obs_kind(), "tells of vectors"),
        ] {
            let error =
                ObservationConfig::from_card(card.as_ref(), &observation).expect_err("does not fit").to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
