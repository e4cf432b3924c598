//! Defects of the ant's motion.

use bevy::prelude::*;
use playbot_lab::{defect::DefectKind, prelude::*};

use crate::{
    ant::AntState,
    antmaze::{
        components::{InMaze, MazeAnt},
        geometry::distance,
        plugin::AntMazeSystems,
    },
    defect_variant::{pick, place, variants},
};

/// Vertical speed that is added in each tick, m/s. Gravity makes -0.98.
const LIFT: [f32; 2] = [0.6, -1.5];
/// Horizontal speed that is added in each tick, m/s.
const WIND: [f32; 2] = [0.1, 0.4];
/// Factor on the torso's speed in each tick.
const GROWTH: [f32; 2] = [1.2, 1.6];
/// Factor on an action. Powers of two, so that it can be undone to the bit for recordings.
const WEAK: [f32; 3] = [0.5, 0.25, 0.125];
/// Distance from the start at which a defect begins to act, m, by place.
const BEGINS: [f32; 3] = [0.0, 2.0, 4.0];

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules(
            "wrong-gravity",
            "gravity is too weak or too strong",
            variants(LIFT.len()),
            |app, variant| {
                let lift = pick(&LIFT, variant);
                after_each_tick(app, variant, move |ant| ant.qvel[2] += lift);
            },
        ),
        DefectKind::rules("drift", "ants drift to one side", variants(WIND.len()), |app, variant| {
            let wind = pick(&WIND, variant);
            after_each_tick(app, variant, move |ant| ant.qvel[1] += wind);
        }),
        DefectKind::rules("runaway", "ants get faster by themselves", variants(GROWTH.len()), |app, variant| {
            let growth = pick(&GROWTH, variant);
            after_each_tick(app, variant, move |ant| ant.qvel[..3].iter_mut().for_each(|speed| *speed *= growth));
        }),
        DefectKind::rules("weak-push", "joints are too weak", WEAK.len() as u32, |app, variant| {
            let left = WEAK[variant as usize % WEAK.len()];
            let weaken = move |agents: Query<(&Control, &Episode, &mut Action)>| scale_actions(agents, left);
            let restore = move |agents: Query<(&Control, &Episode, &mut Action)>| scale_actions(agents, 1.0 / left);
            app.add_systems(FixedUpdate, (weaken.before(AntMazeSystems), restore.after(AntMazeSystems)));
        }),
    ]
}

fn scale_actions(mut agents: Query<(&Control, &Episode, &mut Action)>, factor: f32) {
    for (control, episode, mut action) in &mut agents {
        if !control.is_active() || !episode.is_running() {
            continue;
        }
        if let ActionValue::Continuous(values) = &mut action.0 {
            values.iter_mut().for_each(|value| *value *= factor);
        }
    }
}

/// Changes the state of each playing ant that is far enough from its start, after each tick.
fn after_each_tick(app: &mut App, variant: u32, change: impl Fn(&mut AntState) + Send + Sync + 'static) {
    let begins = BEGINS[place(variant)];
    app.add_systems(
        FixedUpdate,
        (move |mut ants: Query<(&Control, &Episode, &InMaze, &mut MazeAnt)>| {
            for (control, episode, level, mut ant) in &mut ants {
                let mut state = ant.0.state();
                let ([x, y, ..], [from_x, from_y, ..]) = (state.qpos, level.0.reset.qpos);
                let plays = control.is_active() && episode.is_running();
                if plays && distance([x, y], [from_x, from_y]) >= begins {
                    change(&mut state);
                    ant.0.set_state(&state);
                }
            }
        })
        .after(AntMazeSystems),
    );
}
