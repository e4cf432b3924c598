//! Sensors whose pictures are blank.

use bevy::prelude::*;

use crate::{agent::Agent, carry_over::ReflectCarryComponent, episode::EpisodeEnded, fault::Faults};

/// Counts the episodes of an agent in which each picture was of a single colour.
#[derive(Component, Clone, Copy, Debug, Default, PartialEq, Eq, Reflect)]
#[reflect(Component, CarryComponent)]
pub struct BlankEpisodes {
    /// Finished episodes with blank pictures only.
    pub episodes: u64,
    /// True if this episode had a picture, and each was of one colour.
    blank: bool,
    /// True if a picture of this episode was not blank.
    sees: bool,
    /// True if a picture of any episode was not blank.
    has_seen: bool,
}

impl BlankEpisodes {
    /// Notes a picture of the episode. Costs nothing after the first one that is not blank.
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

/// Reports an agent with only blank pictures in its first episodes: its sensor looks at nothing
/// that is drawn. For an agent with earlier pictures the level may be the cause, so it gets one
/// warning.
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
