//! Contacts of a player.

use bevy::prelude::*;
use playbot_lab::{detector::Moment, prelude::*};

use crate::coinrun::{
    Outcome,
    components::{Arena, ArenaBody, ArenaEntities, Enemy, PlayerBody, PlaysIn, Saw, Tiles},
    rules::{BLOCK_HALF, Body, touch},
};

/// Returns the contact of the player by the rules, without the clock; `None` too without a player of CoinRun. Saws are
/// those of the level and added ones; every hazard fills a tile, whatever its body.
pub(super) fn touched(moment: &Moment<'_>) -> Option<Outcome> {
    let world = moment.world;
    let player = world.get::<PlayerBody>(moment.agent)?.0;
    let arena = world.get::<PlaysIn>(moment.agent)?.0;
    let (level, tiles) = (&world.get::<Arena>(arena)?.level, &world.get::<Tiles>(arena)?.0);
    let (mut saws, mut enemies) = (level.saws_near(player.x).to_vec(), Vec::new());
    for entity in world.get::<ArenaEntities>(arena)?.iter() {
        let Some(body) = world.get::<ArenaBody>(entity) else { continue };
        let body = Body { rx: BLOCK_HALF, ry: BLOCK_HALF, ..body.0 };
        if world.get::<Saw>(entity).is_some() {
            saws.push(body);
        } else if world.get::<Enemy>(entity).is_some() {
            enemies.push(body);
        }
    }
    touch(&player, tiles, &saws, &enemies, 0)
}

/// Returns true if the episode goes on after this tick.
pub(super) fn goes_on(moment: &Moment<'_>) -> bool {
    let episode = moment.world.get::<Episode>(moment.agent);
    episode.is_some_and(|episode| episode.is_running() && episode.end().is_none())
}

/// Describes the position of the player, for messages.
pub(super) fn place(moment: &Moment<'_>) -> String {
    let body = moment.world.get::<PlayerBody>(moment.agent).map(|body| body.0).unwrap_or_default();
    format!("({:.1}, {:.1})", body.x, body.y)
}
