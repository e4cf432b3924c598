//! The observation of a foreign game's agent.

use bevy::prelude::*;

use super::runtime::{Sensor, playing_agent, with_foreign};
use bevy_playbot::{
    observation::{Observation, VectorSensor},
    systems::ObserveSchedule,
    vision::VisionSystems,
};

pub(super) fn build(app: &mut App) {
    app.add_systems(ObserveSchedule, observe.before(VisionSystems::Sync));
}

/// Fills the agent's vector, unless it has no sensor for one.
pub(super) fn observe(world: &mut World) {
    let Some(agent) = playing_agent(world) else { return };
    let Some(expected) = world.get::<VectorSensor>(agent).map(|sensor| sensor.space().len()) else { return };
    let values = with_foreign(world, agent, |world, foreign| {
        let values = match &mut foreign.sensor {
            Sensor::System(system) => system.demand(world)?,
            Sensor::Paths(paths) => paths
                .iter_mut()
                .map(|path| path.read(world))
                .collect::<Result<_, _>>()
                .map_err(|error| error.to_string())?,
            Sensor::Nothing => Vec::new(),
        };
        if values.len() == expected {
            return Ok(values);
        }
        let system = foreign.game.description.sensor_name();
        Err(format!(
            "`.observe` names {expected} values, but its system `{system}` returned {} in this tick: it must return every \
             value in each tick",
            values.len()
        ))
    });
    if let (Some(values), Some(mut observation)) = (values, world.get_mut::<Observation>(agent)) {
        observation.set(values);
    }
}
