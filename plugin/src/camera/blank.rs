//! Cameras that see nothing.

use bevy::prelude::*;

use crate::{agent::Agent, episode::EpisodeEnded};

/// Counts the episodes of an agent in which every frame was of one colour: its camera saw nothing.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlankEpisodes {
    /// Finished episodes of blank frames only.
    pub episodes: u64,
    /// Frames of the running episode.
    frames: u64,
    /// Those of one colour.
    blank: u64,
}

impl BlankEpisodes {
    pub(super) fn count(&mut self, pixels: &[[u8; 4]]) {
        self.frames += 1;
        self.blank += u64::from(pixels.iter().all(|pixel| Some(pixel) == pixels.first()));
    }
}

/// Warns once for each episode in which an agent saw nothing.
pub(super) fn report_blank(event: On<EpisodeEnded>, mut sensors: Query<(&mut BlankEpisodes, Option<&Agent>)>) {
    let Ok((mut blank, agent)) = sensors.get_mut(event.entity) else { return };
    if blank.frames > 0 && blank.blank == blank.frames {
        blank.episodes += 1;
        tracing::warn!(
            "agent {}, level {}: its camera saw a single colour in all {} frames of the episode; \
             is the target in the scene, and the scene on render layer 0?",
            agent.map_or(0, |agent| agent.index),
            event.level,
            blank.frames
        );
    }
    (blank.frames, blank.blank) = (0, 0);
}
