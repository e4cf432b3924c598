//! Episodes that have ended in a World, for whoever ticks it.

use bevy::prelude::*;
use bevy_playbot::{
    episode::{EpisodeEnded, EpisodeResult},
    renewal::Renewal,
};

/// Whose episodes have ended since this was asked last, in the order in which they did. It outlives Worlds that are built
/// anew.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub(crate) struct EndedEpisodes(Vec<(Entity, EpisodeResult)>);

impl EndedEpisodes {
    /// From here on the World notes its episodes.
    pub fn note_in(world: &mut World) {
        Renewal::set_up(world, |world| {
            world.init_resource::<Self>();
            world.add_observer(note);
        });
        Renewal::carry_resource::<Self>(world);
    }

    /// All of them, which are then forgotten.
    pub fn take(world: &mut World) -> Vec<(Entity, EpisodeResult)> {
        std::mem::take(&mut world.resource_mut::<Self>().0)
    }

    /// All of them.
    pub fn of(world: &World) -> &[(Entity, EpisodeResult)] {
        world.get_resource::<Self>().map_or(&[], |ended| ended.0.as_slice())
    }
}

fn note(event: On<EpisodeEnded>, mut ended: ResMut<EndedEpisodes>) {
    ended.0.push((event.entity, event.result));
}
