//! Eyes that see nothing.

use bevy::prelude::*;

use crate::{agent::Agent, episode::EpisodeEnded, fault::Faults};

/// Whether all pictures of an agent's running episode were of one colour.
#[derive(Component, Clone, Copy, Debug, Default)]
pub(crate) struct BlankWatch {
    /// There was a picture, and each was of one colour.
    blank: bool,
    /// Something was to be seen in this episode.
    seen: bool,
    /// The agent was reported before.
    reported: bool,
}

impl BlankWatch {
    /// Looks at a picture of the episode. Once there was something to be seen, this costs nothing.
    pub(super) fn note(&mut self, pixels: &[[u8; 4]], starts: bool) {
        if starts {
            (self.blank, self.seen) = (false, false);
        }
        if self.seen {
            return;
        }
        self.seen = pixels.iter().any(|pixel| pixel != &pixels[0]);
        self.blank = !self.seen;
    }
}

/// Reports an agent whose pictures were of one colour for a whole episode: the first time, and then no more.
pub(super) fn report_blank(
    event: On<EpisodeEnded>,
    mut eyes: Query<(&Agent, &mut BlankWatch)>,
    mut faults: ResMut<Faults>,
) {
    let Ok((agent, mut watch)) = eyes.get_mut(event.entity) else { return };
    if watch.blank && !watch.reported {
        watch.reported = true;
        faults.report(format!(
            "agent {}, level {}: each picture of an episode of {} ticks was of a single colour; point the sensor at \
             something that is drawn",
            agent.index, event.level, event.ticks
        ));
    }
    watch.blank = false;
}
