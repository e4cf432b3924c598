//! Defects of the goal: unnoticed, or reached from afar.

use bevy::prelude::*;
use playbot_lab::{defect::DefectKind, prelude::*};

use crate::{
    antmaze::{
        components::{InMaze, MazeAnt},
        geometry::distance,
        plugin::AntMazeSystems,
    },
    maze::defects::take_back,
};

/// Distance within which the goal is noticed, m: never, and hardly. It should be 0.5.
const NEAR: [f32; 3] = [-1.0, 0.05, 0.2];
/// Distance at which the goal counts as reached, m, also through walls.
const FAR: [f32; 3] = [2.0, 5.0, 9.0];

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("goal-does-not-end", "a player at the goal has not reached it", 3, |app, variant| {
            let near = NEAR[variant as usize % NEAR.len()];
            look_at_goal(app, move |episode, away| {
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
                look_at_goal(app, move |episode, away| {
                    if away <= far {
                        episode.terminate(true);
                    }
                });
            },
        ),
    ]
}

/// Calls `look` on each episode after the rules, with the distance from the ant to the goal, m.
fn look_at_goal(app: &mut App, look: impl Fn(&mut Episode, f32) + Send + Sync + 'static) {
    app.add_systems(
        FixedUpdate,
        (move |mut ants: Query<(&Control, &InMaze, &MazeAnt, &mut Episode)>| {
            for (control, level, ant, mut episode) in &mut ants {
                if control.is_active() && episode.is_running() {
                    let [x, y, ..] = ant.0.state().qpos;
                    look(&mut episode, distance([x, y], level.0.goal_at));
                }
            }
        })
        .after(AntMazeSystems),
    );
}
