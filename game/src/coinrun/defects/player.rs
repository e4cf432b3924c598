//! Changes to players between two ticks of the rules.

use bevy::prelude::*;
use playbot_lab::prelude::*;

use super::way::begins;
use crate::coinrun::{
    components::{Arena, PlayerBody, PlayerMemory, PlaysIn},
    level::Level,
    rules::{Body, PlayerState},
};

/// Changes each playing player that is far enough along its level, after each tick.
pub(super) fn after_each_tick(
    app: &mut App,
    variant: u32,
    change: impl Fn(&mut Body, &PlayerState, &Level) + Send + Sync + 'static,
) {
    app.add_systems(
        FixedPostUpdate,
        (move |mut players: Query<(&Control, &Episode, &PlaysIn, &PlayerMemory, &mut PlayerBody)>,
               arenas: Query<&Arena>| {
            for (control, episode, plays_in, memory, mut body) in &mut players {
                let Ok(arena) = arenas.get(plays_in.0) else { continue };
                let plays = control.is_active() && episode.is_running();
                if plays && body.0.x >= begins(&arena.level, variant) {
                    change(&mut body.0, &memory.0, &arena.level);
                }
            }
        })
        .before(PlaybotSystems::Judge),
    );
}
