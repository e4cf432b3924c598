//! The loading of a level before its first tick.

use bevy::prelude::*;

use super::{
    restart::leave_loading_out,
    runtime::{active_agent, with_foreign},
};
use bevy_playbot::episode::Episode;

/// Checks whether the level is ready. Each restart gets one frame to settle: commands, states and transforms.
pub(super) fn check(world: &mut World) {
    let Some(agent) = active_agent(world) else { return };
    if !world.get::<Episode>(agent).is_some_and(Episode::is_loading) {
        return;
    }
    let is_ready = with_foreign(world, agent, |world, foreign| {
        foreign.frames += 1;
        if foreign.frames == 1 {
            return Ok(false);
        }
        if let Some(ready) = &mut foreign.ready
            && ready.run(world)? != Some(true)
        {
            let description = &foreign.game.description;
            if foreign.frames > description.patience {
                let name = description.ready.as_ref().map_or("", |system| system.name());
                return Err(format!(
                    "it was not ready after {} frames: the system `{name}` of `.ready` has not said so; let it return true \
                     once the level can be played, or wait longer with `.ready_within`",
                    description.patience
                ));
            }
            return Ok(false);
        }
        if foreign.ready.is_some() {
            leave_loading_out(world);
        }
        // A reward by growth starts from the value before the first tick.
        for part in foreign.rewards.iter_mut().filter(|part| part.is_delta) {
            part.last = part.system.run(world)?;
        }
        Ok(true)
    });
    match is_ready {
        Some(true) => {
            if let Some(mut episode) = world.get_mut::<Episode>(agent) {
                episode.ready();
            }
        }
        Some(false) => {}
        // The fault has stopped the agent; its level was never played.
        None => {
            if let Some(mut episode) = world.get_mut::<Episode>(agent) {
                episode.abandon();
            }
        }
    }
}
