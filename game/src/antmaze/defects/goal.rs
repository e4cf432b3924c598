//! Goals that are not noticed, and goals that are noticed from afar.

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

/// Within this distance of the goal it is noticed, m: never, and hardly. It should be 0.5.
const NEAR: [f32; 3] = [-1.0, 0.05, 0.2];
/// From this distance on the goal counts as reached, m, also through walls.
const FAR: [f32; 3] = [2.0, 5.0, 9.0];

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("goal-does-not-end", "who is at the goal has not reached it", 3, |app, variant| {
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

/// Looks at each episode after the rules have: how far the ant is from the goal, m.
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
