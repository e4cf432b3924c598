//! Defects of the goal: unnoticed, or reached from afar.

use bevy::prelude::*;
use playbot_lab::{defect::DefectKind, prelude::*};

use crate::{
    maze::defects::take_back,
    maze2d::{
        ball::{length, sub},
        components::{MazeArena, MazeBall, PlaysIn},
        plugin::Maze2dSystems,
    },
};

/// Distance from the goal's middle within which it is noticed, m: never, and hardly. It should be 0.5.
const NEAR: [f64; 3] = [-1.0, 0.02, 0.1];
/// Distance at which the goal counts as reached, m, also through walls.
const FAR: [f64; 3] = [1.2, 2.0, 3.5];

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("goal-does-not-end", "a player at the goal has not reached it", 3, |app, variant| {
            let near = NEAR[variant as usize % NEAR.len()];
            look_at_goal(app, move |episode, away, _| {
                if away > near {
                    take_back(episode);
                }
            });
        }),
        DefectKind::rules(
            "goal-far-away",
            "the goal counts as reached from far away, also through walls",
            3,
            |app, variant| {
                let far = FAR[variant as usize % FAR.len()];
                look_at_goal(app, move |episode, away, ends| {
                    if away <= far {
                        episode.reach();
                        if ends {
                            episode.terminate(true);
                        }
                    }
                });
            },
        ),
    ]
}

/// Calls `look` on each episode after the rules, with the distance from the ball to the goal, m, and whether the goal
/// ends it.
fn look_at_goal(app: &mut App, look: impl Fn(&mut Episode, f64, bool) + Send + Sync + 'static) {
    app.add_systems(
        FixedUpdate,
        (move |mut players: Query<(&Control, &PlaysIn, &MazeBall, &mut Episode)>, arenas: Query<&MazeArena>| {
            for (control, plays_in, ball, mut episode) in &mut players {
                let Ok(arena) = arenas.get(plays_in.0) else { continue };
                if control.is_active() && episode.is_running() {
                    let away = length(sub(ball.0.position, arena.level.goal()));
                    look(&mut episode, away, arena.rules.end_at_goal);
                }
            }
        })
        .after(Maze2dSystems),
    );
}
