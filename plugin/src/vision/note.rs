//! What files say of the pictures that their networks read.

use playbot_learner::ObsKind;
use serde_json::{Value, json};
use thiserror::Error;

use super::Sight;

/// What a file says of the pictures that its networks read is missing or not understood.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "the file does not say in a way that this version knows how the pictures are made that it reads ({why}): make it \
     again with this version"
)]
pub struct UnknownSight {
    /// What is wrong.
    pub why: String,
}

impl Sight {
    /// What a file keeps of it; nothing for vectors, whose names are kept.
    pub fn note(&self) -> Option<Value> {
        self.is_image().then(|| json!(self))
    }

    /// What was noted in a file whose networks read `observation`.
    ///
    /// # Errors
    ///
    /// [`UnknownSight`] if the note is missing, unreadable, or of pictures of another shape.
    pub fn from_note(note: Option<&Value>, observation: &ObsKind) -> Result<Self, UnknownSight> {
        let unknown = |why: String| Err(UnknownSight { why });
        let sight = match note {
            None => Self::default(),
            Some(note) => serde_json::from_value(note.clone()).or_else(|error| unknown(error.to_string()))?,
        };
        match observation {
            ObsKind::Vector(_) if !sight.is_image() => Ok(sight),
            ObsKind::Image(_) if sight.is_image() && sight.image.obs_kind() == *observation => Ok(sight),
            _ => unknown(format!("it reads {observation}, the note says {sight}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::{ImageOptions, ObservationKind};

    #[test]
    fn notes_are_read_as_written_and_only_beside_what_they_describe() {
        let image = ImageOptions { stack: 4, grayscale: true, ..ImageOptions::default() };
        let sight = Sight { kind: ObservationKind::Camera, image };
        let note = sight.note();
        assert_eq!(Sight::from_note(note.as_ref(), &image.obs_kind()), Ok(sight));
        assert_eq!(Sight::from_note(Sight::default().note().as_ref(), &ObsKind::Vector(3)), Ok(Sight::default()));
        for (note, observation, words) in [
            (None, image.obs_kind(), "vectors"),
            (note.clone(), ObsKind::Vector(3), "vectors of 3"),
            (note, ImageOptions::default().obs_kind(), "64×64 grey pictures of the camera, 4 in a stack"),
            (Some(json!({ "kind": "Sonar" })), image.obs_kind(), "Sonar"),
        ] {
            let error = Sight::from_note(note.as_ref(), &observation).expect_err("does not fit").to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
