//! A trap: a pit without a path out.

use playbot_lab::defect::DefectKind;
use playbot_learner::rng::{ChaCha8Rng, below};

use super::edit::{fill, of_levels, surface};
use crate::coinrun::{
    level::LevelParts,
    spawn::Spawn,
    tile::{SIZE, Tile},
};

/// A step up, and the height of a tower: one jump leads up a step, none up a tower. A jump lifts by 6.4 tiles.
const STEP: i32 = 4;
const TOWER: i32 = 8;
/// Columns of a step, of a tower, and between the towers.
const WIDE: i32 = 2;
const GAP: i32 = 3;
/// All columns.
const WIDTH: i32 = 4 * WIDE + GAP;

pub(super) fn defects() -> Vec<DefectKind> {
    vec![of_levels("one-way-trap", "a player that falls between two towers never gets out", one_way_trap)]
}

/// Builds two towers with steps on their outer sides only. Players can climb and jump over them. Between them nothing
/// kills, and no jump leads out.
fn one_way_trap(parts: &mut LevelParts, rng: &mut ChaCha8Rng) -> Option<()> {
    let places: Vec<i32> = (6..parts.coin[0] - WIDTH - 1).filter(|&x| is_place(parts, x)).collect();
    let left = *places.get(below(rng, places.len().max(1) as u64) as usize)?;
    let ground = surface(parts, left - 1);
    let heights = [(WIDE, STEP), (WIDE, TOWER), (GAP, 0), (WIDE, TOWER), (WIDE, STEP)];
    let mut x = left;
    for (width, height) in heights {
        block(parts, x, width, ground + height);
        x += width;
    }
    Some(())
}

/// Returns true if there is ground on both sides, the far one not too high, and no hazard at its edges.
fn is_place(parts: &LevelParts, left: i32) -> bool {
    let right = left + WIDTH;
    let (near, far) = (surface(parts, left - 1), surface(parts, right));
    let is_calm = |x: i32| {
        let on_ground = !parts.tiles.get(x, surface(parts, x)).is_lava();
        on_ground && !parts.spawns.iter().any(|spawn| !matches!(spawn, Spawn::Crate { .. }) && spawn.cell()[0] == x)
    };
    // Row 1 is the bottom of pits.
    near > 1
        && far > 1
        && surface(parts, left - 2) == near
        && far - near <= TOWER
        && [left - 2, left - 1, right].into_iter().all(is_calm)
        && near + TOWER < SIZE - 12
}

/// Builds ground up to a height, and nothing above.
fn block(parts: &mut LevelParts, x: i32, width: i32, height: i32) {
    fill(parts, [x, 0], [width, height - 1], Tile::Wall);
    fill(parts, [x, height - 1], [width, 1], Tile::WallTop);
    fill(parts, [x, height], [width, SIZE - 1 - height], Tile::Empty);
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use playbot_learner::rng::Streams;

    use super::*;
    use crate::coinrun::{
        Mode, Plan, PlannerConfig, Sim, generate,
        level::Level,
        plan,
        rules::{Body, PlayerState},
    };

    #[test]
    fn who_is_in_the_trap_stays_there_and_who_is_not_gets_past() {
        let mut past = 0;
        for seed in 0..30 {
            let mut parts = generate(Mode::Hard, seed).parts().clone();
            let mut rng = Streams::new(u64::from(seed)).stream("trap", 0);
            if one_way_trap(&mut parts, &mut rng).is_none() {
                continue;
            }
            let level = Arc::new(Level::new(parts));
            past += u32::from(matches!(plan(&Sim::new(level.clone()), &PlannerConfig::default()), Plan::Found(_)));
            // The gap is the only place of three columns of one height between two that are eight higher.
            let height = |x: i32| surface(&level, x);
            let gap = (6..SIZE - 4).find(|&x| {
                (x..x + GAP).all(|column| height(column) == height(x))
                    && (height(x - 3), height(x - 1)) == (height(x) + STEP, height(x) + TOWER)
                    && height(x + GAP) == height(x) + TOWER
            });
            let gap = gap.expect("there is one");
            let low = height(gap) as f32;
            let start = Body::player();
            let player = Body { x: gap as f32 + 1.5, y: low + start.ry, ..start };
            let mut sim = Sim::resume(level.clone(), player, PlayerState::default(), Vec::new(), 0);
            for step in 0..600_u32 {
                // To one side and to the other, hopping all the time.
                sim.step(if step / 60 % 2 == 0 { 8 } else { 2 });
                assert!(sim.end().is_none() && (sim.x() - gap as f32 - 1.5).abs() < 1.1, "{seed}: {}", sim.x());
            }
        }
        assert!(past >= 3, "{past} levels can still be solved");
    }
}
