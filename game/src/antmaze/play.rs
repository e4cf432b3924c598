//! One tick of every arena.

use bevy::{math::ops, prelude::*};
use bevy_playbot::fault::Faults;
use playbot_lab::prelude::*;

use super::{
    components::{InMaze, MazeAnt},
    geometry::{cell_at, distance},
    level::AntMazeLevel,
    mode::Pay,
    view,
};
use crate::ant::{AntState, walk::torques};

/// Distance at which an ant has reached the goal, metres.
pub const GOAL_RADIUS: f32 = 0.5;
/// Possible heights of the middle of a torso, metres: between the floor and the reach of a jump.
const HEIGHTS: std::ops::Range<f32> = 0.0..20.0;

/// Computes physics, reward and end for every ant whose agent plays.
pub(super) fn play(
    mut ants: Query<(&Agent, &mut Control, &Action, &InMaze, &mut MazeAnt, &mut Episode, &mut Reward, &mut StateHash)>,
    mut faults: ResMut<Faults>,
) {
    for (agent, mut control, action, level, mut ant, mut episode, mut reward, mut hash) in &mut ants {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        ant.0.step(&torques(action, &mut episode));
        let state = ant.0.state();
        if let Some(why) = astray(&state, &level.0) {
            faults.report(format!("{}: {why}", episode.moment(agent)));
            *control = Control::Idle;
            continue;
        }
        let away = distance([state.qpos[0], state.qpos[1]], level.0.goal_at);
        *hash = state.hash();
        reward.add(pay(level.0.pay, away));
        if away <= GOAL_RADIUS {
            match level.0.pay {
                // An episode that pays for every tick would never be ended.
                Pay::Exponential => episode.reach(),
                Pay::Distance | Pay::Sparse => episode.terminate(true),
            }
        }
        if episode.tick + 1 >= level.0.limit {
            episode.truncate();
        }
    }
}

/// Returns the reward of a tick that ends at this distance from the goal, in metres.
pub(super) fn pay(pay: Pay, away: f32) -> f32 {
    match pay {
        Pay::Distance => -away,
        Pay::Exponential => ops::exp(-away),
        Pay::Sparse => f32::from(u8::from(away <= GOAL_RADIUS)),
    }
}

/// Explains why an ant's position is impossible, if it is.
fn astray(state: &AntState, level: &AntMazeLevel) -> Option<String> {
    if !state.is_finite() {
        let mut named = view::names().into_iter().zip(view::values(state));
        let (name, value) = named.find(|(_, value)| !value.is_finite())?;
        return Some(format!("the ant's `{name}` is {value}: its physics has failed"));
    }
    let [x, y, z, ..] = state.qpos;
    let inside = cell_at(&level.maze, [x, y]).is_some() && HEIGHTS.contains(&z);
    (!inside).then(|| format!("the ant is at ({x}, {y}, {z}), outside the maze: its physics has failed"))
}

/// Fills the vector of every playing agent that reads one.
pub(super) fn observe(mut ants: Query<(&Episode, &MazeAnt, &mut Observation), With<VectorSensor>>) {
    for (episode, ant, mut observation) in &mut ants {
        if episode.is_running() {
            observation.set(view::values(&ant.0.state()));
        }
    }
}
