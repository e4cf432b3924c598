//! The list of ended episodes in a World, for the callers that tick it.

use bevy::prelude::*;
use bevy_playbot::{
    engine::Renewal,
    episode::{EpisodeEnded, EpisodeResult},
};

/// Agents with their ended episodes since the last call, in order. The list outlives Worlds that are rebuilt.
#[derive(Resource, Default, Reflect)]
#[reflect(Resource)]
pub struct EndedEpisodes(Vec<(Entity, EpisodeResult)>);

impl EndedEpisodes {
    /// Makes the World collect its ended episodes from now on.
    pub fn note_in(world: &mut World) {
        Renewal::set_up(world, |world| {
            world.init_resource::<Self>();
            world.add_observer(note);
        });
        Renewal::carry_resource::<Self>(world);
    }

    /// Returns all of them, and empties the list.
    pub fn take(world: &mut World) -> Vec<(Entity, EpisodeResult)> {
        std::mem::take(&mut world.resource_mut::<Self>().0)
    }

    /// Returns all of them.
    pub fn of(world: &World) -> &[(Entity, EpisodeResult)] {
        world.get_resource::<Self>().map_or(&[], |ended| ended.0.as_slice())
    }
}

fn note(event: On<EpisodeEnded>, mut ended: ResMut<EndedEpisodes>) {
    ended.0.push((event.entity, event.result));
}
