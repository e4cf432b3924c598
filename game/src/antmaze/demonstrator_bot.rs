//! The pilot, walking from waypoint to waypoint, as a bot of the game.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::{agent::AgentOrder, fault::Faults, streams::AgentStreams};
use playbot_lab::prelude::*;
use playbot_learner::rng::normal;

use super::{
    components::{InMaze, MazeAnt},
    level::AntMazeLevel,
    waypoints::Waypoints,
};
use crate::ant::pilot::{Pilot, PilotInput};

/// Walks to the goal: [`Waypoints`] followed by the shipped [`Pilot`].
#[derive(Component, Debug, Reflect)]
#[reflect(Component)]
pub struct DemonstratorBot {
    noise: f64,
    #[reflect(ignore)]
    way: Option<(Arc<AntMazeLevel>, Waypoints)>,
}

impl DemonstratorBot {
    /// Takes the standard deviation of normal noise on its torques. The original's demonstrations have 0.2.
    pub fn new(noise: f64) -> Self {
        Self { noise, way: None }
    }

    /// Returns the path through this level.
    fn way(&mut self, level: &Arc<AntMazeLevel>) -> &mut Waypoints {
        let known = self.way.take().filter(|(known, _)| Arc::ptr_eq(known, level));
        let way = known.unwrap_or_else(|| (level.clone(), Waypoints::new(level)));
        &mut self.way.insert(way).1
    }
}

/// Decides for all bots of the World in one pass of the pilot's network.
pub(super) fn decide(
    order: Res<AgentOrder>,
    mut bots: Query<(&Control, &Episode, &InMaze, &MazeAnt, &mut DemonstratorBot, &mut AgentStreams, &mut Action)>,
    mut faults: ResMut<Faults>,
    (mut entities, mut input): (Local<Vec<Entity>>, Local<PilotInput>),
) {
    entities.clear();
    input.clear();
    for &entity in order.entities() {
        let Ok((control, episode, level, ant, mut bot, mut streams, _)) = bots.get_mut(entity) else { continue };
        if *control != Control::Bot || !episode.is_running() {
            continue;
        }
        let state = ant.0.state();
        let at = [state.qpos[0], state.qpos[1]];
        let next = bot.way(&level.0).next(&level.0, at, &mut streams.action);
        input.push(&state, next);
        entities.push(entity);
    }
    if entities.is_empty() {
        return;
    }
    let torques = match Pilot::shipped().and_then(|pilot| pilot.act(&input)) {
        Ok(torques) => torques,
        Err(error) => return faults.report(error.to_string()),
    };
    for (&entity, torques) in entities.iter().zip(torques) {
        let Ok((.., bot, mut streams, mut action)) = bots.get_mut(entity) else { continue };
        let noisy = |torque: f32| {
            let noise = if bot.noise > 0.0 { bot.noise as f32 * normal(&mut streams.action) } else { 0.0 };
            (torque + noise).clamp(-1.0, 1.0)
        };
        action.0 = ActionValue::Continuous(torques.into_iter().map(noisy).collect());
    }
}
