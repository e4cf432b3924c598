//! Corridors whose agents are not the same in each tick.

use bevy::prelude::*;
use playbot::prelude::*;

use crate::{as_corridor, corridor_plugin};

/// A corridor that despawns one agent.
pub struct Deadly {
    /// Number of the agent.
    pub agent: u32,
    /// The tick of the World in which it is gone.
    pub tick: u32,
}

impl Game for Deadly {
    as_corridor!(but build);

    fn build(&self, app: &mut App, _mode: &str) {
        let (agent, tick) = (self.agent, self.tick);
        corridor_plugin(app);
        app.add_systems(
            FixedUpdate,
            move |mut ticks: Local<u32>, agents: Query<(Entity, &Agent)>, mut commands: Commands| {
                *ticks += 1;
                for (entity, _) in agents.iter().filter(|(_, it)| *ticks == tick && it.index == agent) {
                    commands.entity(entity).despawn();
                }
            },
        );
    }
}

/// A corridor that spawns agent 9 in its fifth tick.
pub struct Crowded;

impl Game for Crowded {
    as_corridor!(but build);

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
        app.add_systems(FixedUpdate, |mut ticks: Local<u32>, mut commands: Commands| {
            *ticks += 1;
            if *ticks == 5 {
                commands.spawn(Agent::new(9, ActionSpace::Discrete(2)));
            }
        });
    }
}
