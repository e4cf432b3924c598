//! The pilot, walking from waypoint to waypoint, as a bot of the game.

use crate::{
    ant::pilot::{Pilot, PilotInput},
    antmaze::{
        arena::{InMaze, MazeAnt},
        geometry::{cell_at, centre_of, distance},
        level::AntMazeLevel,
    },
    maze::{Cell, Planner},
};
use bevy::prelude::*;
use bevy_playbot::{agent::AgentOrder, fault::Faults, streams::AgentStreams};
use playbot_harness::prelude::*;
use playbot_learner::rng::{ChaCha8Rng, normal, unit};
use std::sync::Arc;

/// Walks to the goal: [`Waypoints`] followed by the shipped [`Pilot`].
#[derive(Component, Debug, Reflect)]
#[reflect(Component)]
pub struct DemonstratorBot {
    noise: f64,
    #[reflect(ignore)]
    waypoints: Option<(Arc<AntMazeLevel>, Waypoints)>,
}

impl DemonstratorBot {
    /// Takes the standard deviation of normal noise on its torques. The original's demonstrations have 0.2.
    pub fn new(noise: f64) -> Self {
        Self { noise, waypoints: None }
    }

    /// Returns the path through this level.
    fn waypoints(&mut self, level: &Arc<AntMazeLevel>) -> &mut Waypoints {
        let known = self.waypoints.take().filter(|(known, _)| Arc::ptr_eq(known, level));
        let waypoints = known.unwrap_or_else(|| (level.clone(), Waypoints::new(level)));
        &mut self.waypoints.insert(waypoints).1
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
        let next = bot.waypoints(&level.0).next(&level.0, at, &mut streams.action);
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

/// Distance at which a waypoint counts as reached, metres: about the edge of its cell, as in the original. An ant that
/// goes nearer comes nearer to walls too, and falls over more often.
const REACHED: f32 = 2.0;

/// The path to a level's goal: the next cell's centre + U(0, 1) metre along each axis, and at last the goal itself.
#[derive(Clone, Debug)]
pub struct Waypoints {
    planner: Planner,
    goal_at: [f32; 2],
    /// The next cell of the ant, and the target position in it.
    next: Option<(Cell, [f32; 2])>,
}

impl Waypoints {
    /// Plans the path to the goal of a level, from everywhere.
    pub fn new(level: &AntMazeLevel) -> Self {
        Self { planner: Planner::new(&level.maze, level.goal), goal_at: level.goal_at, next: None }
    }

    /// Returns the target of an ant at this position `[x, y]`.
    ///
    /// It keeps to a waypoint until the ant is there, or has been pushed to a cell with another next cell.
    pub fn next(&mut self, level: &AntMazeLevel, at: [f32; 2], rng: &mut ChaCha8Rng) -> [f32; 2] {
        let Some(here) = cell_at(&level.maze, at).filter(|&cell| level.maze.is_free(cell)) else {
            // Its middle is over a wall, where it cannot stay.
            return self.next.map_or(self.goal_at, |(_, position)| position);
        };
        let from = match self.next {
            Some((cell, position)) if distance(at, position) <= REACHED => cell,
            Some((cell, position)) if cell == here || cell == self.planner.next_cell(here) => return position,
            _ => here,
        };
        let cell = self.planner.next_cell(from);
        let position = if cell == self.planner.goal() {
            self.goal_at
        } else {
            centre_of(&level.maze, cell).map(|x| x + unit(rng) as f32)
        };
        self.next = Some((cell, position));
        position
    }
}

#[cfg(test)]
mod tests {
    use playbot_learner::rng::Streams;

    use super::*;
    use crate::antmaze::generate;

    /// Walks straight from waypoint to waypoint, some centimetres at a time, and returns the positions.
    fn walk(mode: &str, seed: u64) -> (AntMazeLevel, Vec<[f32; 2]>) {
        let level = generate(&mode.parse().expect("a mode"), seed).expect("a level");
        let mut rng = Streams::new(seed).stream("walk", 0);
        let mut waypoints = Waypoints::new(&level);
        let mut at = [level.reset.qpos[0], level.reset.qpos[1]];
        let mut positions = vec![at];
        while distance(at, level.goal_at) > 0.5 {
            let next = waypoints.next(&level, at, &mut rng);
            let away = distance(at, next).max(0.1);
            at = [0, 1].map(|axis| at[axis] + 0.1 * (next[axis] - at[axis]) / away);
            positions.push(at);
            assert!(positions.len() < 10_000, "{mode} {seed}: walks for ever, at {at:?} on the way to {next:?}");
        }
        (level, positions)
    }

    #[test]
    fn waypoints_lead_to_the_goal_through_free_cells() {
        for mode in ["umaze", "medium", "large+goal-noise=d4rl", "xl+goals=demo+random-start", "random+corridor=2"] {
            for seed in 0..20 {
                let (level, positions) = walk(mode, seed);
                let cells = positions.iter().map(|&at| cell_at(&level.maze, at).expect("inside"));
                assert!(cells.into_iter().all(|cell| level.maze.is_free(cell)), "{mode} {seed}");
            }
        }
    }

    #[test]
    fn the_way_is_not_much_longer_than_the_shortest() {
        let (level, positions) = walk("large", 3);
        let length: f32 = positions.windows(2).map(|pair| distance(pair[0], pair[1])).sum();
        let shortest = 4.0 * (level.maze.shortest_path().len() - 1) as f32;
        assert!((0.7 * shortest..1.1 * shortest).contains(&length), "{length} m instead of {shortest}");
    }

    #[test]
    fn waypoints_lie_beyond_the_centre_of_the_next_cell_and_are_kept() {
        let level = generate(&"medium".parse().expect("a mode"), 0).expect("a level");
        let mut rng = Streams::new(1).stream("walk", 0);
        for _ in 0..200 {
            let mut waypoints = Waypoints::new(&level);
            let [x, y] = waypoints.next(&level, [0.0, 0.0], &mut rng);
            let across = if x > 2.0 { [x - 4.0, y] } else { [x, y - 4.0] };
            assert!(across.iter().all(|offset| (0.0..1.0).contains(offset)), "{x} {y}");
            assert_eq!(waypoints.next(&level, [0.3, 0.1], &mut rng), [x, y]);
        }
    }

    #[test]
    fn an_ant_that_was_pushed_away_plans_anew() {
        let level = generate(&"medium".parse().expect("a mode"), 0).expect("a level");
        let mut rng = Streams::new(1).stream("walk", 0);
        let mut waypoints = Waypoints::new(&level);
        let before = waypoints.next(&level, [0.0, 0.0], &mut rng);
        // Two cells before the goal, which is at (20, 20).
        let after = waypoints.next(&level, [20.0, 12.0], &mut rng);
        assert_ne!(before, after);
        assert!(distance(after, [20.5, 16.5]) < 1.0, "{after:?}");
        assert_eq!(waypoints.next(&level, after, &mut rng), [20.0, 20.0], "after the last cell comes the goal itself");
    }
}
