//! Eyes that see nothing.

use bevy::prelude::*;

use crate::{agent::Agent, episode::EpisodeEnded, fault::Faults};

/// Counts the episodes of an agent in which each picture was of a single colour: it saw nothing.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component)]
pub struct BlankEpisodes {
    /// Finished episodes in which nothing was to be seen.
    pub episodes: u64,
    /// There was a picture in this episode, and each was of one colour.
    blank: bool,
    /// Something was to be seen in this episode.
    sees: bool,
    /// Something was to be seen in some episode.
    has_seen: bool,
}

impl BlankEpisodes {
    /// Looks at a picture of the episode. Once something was to be seen, this costs nothing.
    pub(super) fn note(&mut self, pixels: &[[u8; 4]], starts: bool) {
        if starts {
            self.sees = false;
        }
        if !self.sees {
            self.sees = pixels.iter().any(|pixel| pixel != &pixels[0]);
            self.has_seen |= self.sees;
            self.blank = !self.sees;
        }
    }
}

/// Reports an agent that saw nothing in its first episodes: its sensor looks at nothing that is drawn. For an agent that
/// has seen something before, it may be the level, which is worth a warning, the first time.
pub(super) fn report_blank(
    event: On<EpisodeEnded>,
    mut eyes: Query<(&Agent, &mut BlankEpisodes)>,
    mut faults: ResMut<Faults>,
) {
    let Ok((agent, mut eye)) = eyes.get_mut(event.entity) else { return };
    if !std::mem::take(&mut eye.blank) {
        return;
    }
    eye.episodes += 1;
    let what = format!(
        "agent {}, level {}: each picture of an episode of {} ticks was of a single colour; point its sensor at something \
         that is drawn",
        agent.index, event.level, event.ticks
    );
    if !eye.has_seen {
        faults.report(what);
    } else if eye.episodes == 1 {
        tracing::warn!("{what}");
    }
}
