//! One tick of every arena.

use bevy::prelude::*;
use playbot_lab::prelude::*;

use super::{
    ball::clip_action,
    components::{MazeArena, MazeBall, PlaysIn},
    mode::{Contact, Maze2dMode},
    physics::MazePhysics,
    sim::{hash_state, is_at_goal, reward, step_rapier, step_soft},
};

/// Moves every ball whose agent plays, and pays for its new position.
pub(super) fn play(
    mut players: Query<(&Control, &Action, &PlaysIn, &mut Episode, &mut MazeBall, &mut Reward, &mut StateHash)>,
    mut arenas: Query<(&MazeArena, Option<&mut MazePhysics>)>,
) {
    for (control, action, plays_in, mut episode, mut ball, mut paid, mut hash) in &mut players {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        // Actions of another kind were reported before, and their agents stopped.
        let Some(&[x, y]) = action.continuous() else { continue };
        let Ok((arena, physics)) = arenas.get_mut(plays_in.0) else { continue };
        let (push, clipped) = clip_action([x, y]);
        if clipped {
            episode.note_clipped();
        }
        let (ball, level, mode) = (&mut ball.0, &arena.level, &arena.rules);
        match (physics, mode.contact) {
            (Some(mut physics), Contact::Rapier) => step_rapier(ball, push, &mut physics),
            (physics, _) => {
                step_soft(ball, push, &level.walls);
                if let Some(mut physics) = physics {
                    physics.follow(ball);
                }
            }
        }
        let steps = episode.tick + 1;
        hash.0 = hash_state(ball, steps);
        paid.add(reward(ball.position, level.goal(), mode.sparse));
        end_if_over(mode, is_at_goal(ball.position, level.goal()), steps, &mut episode);
    }
}

fn end_if_over(mode: &Maze2dMode, at_goal: bool, steps: u32, episode: &mut Episode) {
    if at_goal {
        episode.reach();
        if mode.end_at_goal {
            episode.terminate(true);
        }
    }
    if steps >= mode.limit {
        episode.truncate();
    }
}

/// Names of the observed values: position, m, and velocity, m/s, along the rows (x) and columns (y).
pub(super) const OBSERVED: [&str; 4] = ["x", "y", "vx", "vy"];

/// Fills the vector of every playing agent that reads one.
pub(super) fn observe(mut players: Query<(&Episode, &MazeBall, &mut Observation), With<VectorSensor>>) {
    for (episode, ball, mut observation) in &mut players {
        if episode.is_running() {
            let ball = &ball.0;
            observation.set(ball.position.iter().chain(&ball.velocity).map(|&value| value as f32));
        }
    }
}
