//! Defects of the ball's motion.

use bevy::prelude::*;
use playbot_lab::{defect::DefectKind, prelude::*};

use crate::{
    defect_variant::{pick, place, variants},
    maze2d::{
        ball::{Ball, FORCE, MASS, STEP, Vec2d, clip_action, length, sub},
        components::{MazeArena, MazeBall, PlaysIn},
        plugin::Maze2dSystems,
    },
};

/// Share of the push that is lost.
const LOST: [f64; 2] = [0.5, 0.8];
/// Added acceleration along the columns, m/s in each tick. A full push makes 0.24.
const WIND: [f64; 2] = [0.03, 0.1];
/// Factor on the speed in each tick.
const GROWTH: [f64; 2] = [1.03, 1.1];
/// Distance from the start at which a defect begins to act, m, by place.
const BEGINS: [f64; 3] = [0.0, 1.5, 3.0];

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules("weak-push", "pushes are too weak", variants(LOST.len()), |app, variant| {
            let lost = pick(&LOST, variant);
            after_each_tick(app, variant, move |ball, push| {
                for (speed, push) in ball.velocity.iter_mut().zip(push) {
                    *speed -= lost * push * FORCE * STEP / MASS;
                }
            });
        }),
        DefectKind::rules("drift", "the ball drifts to one side", variants(WIND.len()), |app, variant| {
            let wind = pick(&WIND, variant);
            after_each_tick(app, variant, move |ball, _| ball.velocity[1] += wind);
        }),
        DefectKind::rules("runaway", "the ball gets faster by itself", variants(GROWTH.len()), |app, variant| {
            let growth = pick(&GROWTH, variant);
            after_each_tick(app, variant, move |ball, _| ball.velocity = ball.velocity.map(|speed| speed * growth));
        }),
    ]
}

/// Changes the ball of each playing agent that is far enough from its start, after each tick.
fn after_each_tick(app: &mut App, variant: u32, change: impl Fn(&mut Ball, Vec2d) + Send + Sync + 'static) {
    let begins = BEGINS[place(variant)];
    app.add_systems(
        FixedUpdate,
        (move |mut players: Query<(&Control, &Episode, &Action, &PlaysIn, &mut MazeBall)>,
               arenas: Query<&MazeArena>| {
            for (control, episode, action, plays_in, mut ball) in &mut players {
                let (Ok(arena), Some(&[x, y])) = (arenas.get(plays_in.0), action.continuous()) else { continue };
                let plays = control.is_active() && episode.is_running();
                if plays && length(sub(ball.0.position, arena.level.start.position)) >= begins {
                    change(&mut ball.0, clip_action([x, y]).0);
                }
            }
        })
        .after(Maze2dSystems),
    );
}
