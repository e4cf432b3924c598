//! Defects of the player's motion.

use playbot_lab::defect::DefectKind;

use super::player::after_each_tick;
use crate::defect_variant::{pick, variants};

/// Addition to the vertical speed of a player in the air, in each tick, tiles per tick: half of the gravity less, and
/// three quarters more.
const LIFT: [f32; 2] = [0.1, -0.15];
/// Factor on the speed with which a jump begins: too low for the steps of levels, and too high.
const JUMP: [f32; 2] = [0.6, 1.4];
/// Factor on the horizontal speed, in each tick.
const DRAG: [f32; 2] = [0.5, 0.8];
/// Speed of the wind, tiles per tick, against the path and along it.
const WIND: [f32; 2] = [-0.04, 0.04];
/// Vertical speed above which a player has just jumped, tiles per tick.
const RISES: f32 = 1.0;

pub(super) fn defects() -> Vec<DefectKind> {
    vec![
        DefectKind::rules(
            "wrong-gravity",
            "gravity is too weak or too strong",
            variants(LIFT.len()),
            |app, variant| {
                let lift = pick(&LIFT, variant);
                after_each_tick(app, variant, move |body, _, _| {
                    // A standing player has no vertical speed at all.
                    if body.vy != 0.0 {
                        body.vy += lift;
                    }
                });
            },
        ),
        DefectKind::rules("wrong-jump", "jumps are too low or too high", variants(JUMP.len()), |app, variant| {
            let factor = pick(&JUMP, variant);
            after_each_tick(app, variant, move |body, memory, _| {
                if memory.supported && body.vy > RISES {
                    body.vy *= factor;
                }
            });
        }),
        DefectKind::rules("slow-player", "players run too slowly", variants(DRAG.len()), |app, variant| {
            let factor = pick(&DRAG, variant);
            after_each_tick(app, variant, move |body, _, _| body.vx *= factor);
        }),
        DefectKind::rules(
            "drift",
            "something pushes players in the air sideways",
            variants(WIND.len()),
            |app, variant| {
                let wind = pick(&WIND, variant);
                after_each_tick(app, variant, move |body, memory, _| {
                    if !memory.supported {
                        body.vx += wind;
                    }
                });
            },
        ),
    ]
}
