//! A corridor with an exit and a pit.

use bevy::prelude::*;
use playbot::prelude::*;

/// A corridor of 7 cells. The agent starts in the middle. Action 1 goes right, action 0 left, action 2 stays. The right
/// end wins 1 point, the left end loses, and after 20 ticks time is up. Even levels start one cell further right.
#[derive(Clone, Copy, Debug, Default)]
pub struct Corridor;

/// Cell of the agent, 0 to 6.
#[derive(Component, Clone, Copy, Debug, Default)]
pub struct Cell(pub i32);

/// Puts NaN into the observation of this tick of every episode.
#[derive(Resource, Clone, Copy, Debug)]
pub struct PoisonAt(pub u32);

/// Adds a number that differs from run to run to the state. A replay must notice it.
#[derive(Resource, Clone, Copy, Debug)]
pub struct Drift(pub u64);

fn restart(event: On<StartEpisode>, mut cells: Query<&mut Cell>) {
    if let Ok(mut cell) = cells.get_mut(event.entity) {
        cell.0 = 3 + i32::from(event.level.is_multiple_of(2));
    }
}

/// Shows each agent its cell and the time.
pub fn see_corridor(
    mut agents: Query<(&Cell, &Episode, &mut Observation), With<VectorSensor>>,
    poison: Option<Res<PoisonAt>>,
) {
    for (cell, episode, mut observation) in &mut agents {
        let poisoned = poison.as_ref().is_some_and(|poison| poison.0 == episode.tick);
        let x = if poisoned { f32::NAN } else { cell.0 as f32 / 3.0 - 1.0 };
        observation.set([x, episode.tick as f32 / 20.0]);
    }
}

fn walk(
    mut agents: Query<(&Action, &Control, &mut Cell, &mut Reward, &mut Episode, &mut StateHash)>,
    drift: Option<Res<Drift>>,
) {
    for (action, control, mut cell, mut reward, mut episode, mut hash) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        cell.0 += [-1, 1, 0][action.discrete().unwrap_or(2) as usize];
        hash.0 = cell.0 as u64 + drift.as_ref().map_or(0, |drift| drift.0);
        match cell.0 {
            6 => {
                reward.add(1.0);
                episode.terminate(true);
            }
            0 => episode.terminate(false),
            _ if episode.tick + 1 >= 20 => episode.truncate(),
            _ => {}
        }
    }
}

/// Adds the corridor's rules to an app.
pub fn corridor_plugin(app: &mut App) {
    app.add_observer(restart).add_systems(ObserveSchedule, see_corridor).add_systems(FixedUpdate, walk);
}

/// Spawns an agent of the corridor.
pub fn spawn_walker(world: &mut World, index: u32) -> Entity {
    world.spawn((Agent::new(index, ActionSpace::Discrete(3)), VectorSensor::new(["x", "time"]), Cell::default())).id()
}

impl Game for Corridor {
    fn name(&self) -> &'static str {
        "corridor"
    }

    fn version(&self) -> u32 {
        3
    }

    fn modes(&self) -> &'static [&'static str] {
        &["plain"]
    }

    fn tick_hz(&self) -> f64 {
        10.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(3)
    }

    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: vec!["x".into(), "time".into()] }
    }

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        spawn_walker(world, index)
    }
}
