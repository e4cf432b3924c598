//! Players that were stopped in the midst of a step: the rest of their speed may be nearly anything.
//!
//! Their height is known by a tenth of a tile, and of their speed the upper limit upwards. Within a step they may go to
//! every height between that and the fastest fall.

use crate::coinrun::{
    planner::reach::{
        Exact, Loose, State,
        ground::{Bins, ReachableGround, STEP_BINS, Touched},
        put,
    },
    rules::{GRAVITY, JUMP_SPEED, PLAYER_HALF_HEIGHT},
};
use std::collections::BTreeMap;

/// Heights and speeds are counted in tenths of a tile.
const TENTHS: f32 = 10.0;

/// The largest fall and rise of a player in a step, tenths of a tile.
pub(super) const FASTEST: i32 = (JUMP_SPEED * TENTHS) as i32;

/// Loss of speed in a step, tenths of a tile.
const SLOWED: i32 = (GRAVITY * TENTHS) as i32;

/// A standing player is in the middle of a tenth.
const OFFSET: f32 = PLAYER_HALF_HEIGHT - 0.55;

/// Bins that a player with a corner in a wall may move before all are free again. These are a tile, an eighth of one
/// for a part of a step, and some more.
const WALL_REACH: usize = 12;

/// Largest depth below a crate's top of a player that overlaps it, tenths of a tile.
const CRATE_DEPTH: i32 = 22;

/// Returns the tenth of a tile of a height.
fn level_of(y: f32) -> i32 {
    ((y - OFFSET) * TENTHS).floor() as i32
}

/// Returns the ends of a tenth of a tile.
fn ends(level: i32) -> [f32; 2] {
    [level, level + 1].map(|end| end as f32 / TENTHS + OFFSET)
}

impl Loose {
    /// Returns the state at this height, with at most this speed.
    pub fn at(y: f32, vy: f32) -> Self {
        Self { level: level_of(y), lift: ((vy * TENTHS).ceil() as i32).clamp(-FASTEST, FASTEST) }
    }
}

/// Follows a player with a corner in a wall: one that starts there, or has stood across a ledge and moved up or down.
/// Until all corners are free again, such a player stays in the same columns, or one beside, and at two heights between
/// two rows. It may have any speed then.
pub(super) fn out_of_wall(ground: &mut ReachableGround, y: f32, places: Bins, after: &mut Vec<(State, Bins)>) {
    let row = y.floor();
    let heights = [row + 1.0 - PLAYER_HALF_HEIGHT, row + PLAYER_HALF_HEIGHT];
    // A part of a step makes at most a quarter of a tile.
    let [lowest, highest] = [level_of(heights[0] - 0.26), level_of(heights[1] + 0.26)];
    for level in lowest..=highest {
        // A player in the wall touches the coin, too.
        let out = places.spread(WALL_REACH) & (room(ground, level) | touched(ground, level).coin);
        put(after, State::Loose(Loose { level, lift: FASTEST }), out);
    }
}

/// Returns the bins with possible room at a level.
fn room(ground: &mut ReachableGround, level: i32) -> Bins {
    ends(level).into_iter().fold(Bins::NONE, |room, y| {
        let rows = ground.rows(y);
        room | ground.room(rows)
    })
}

/// Returns the bins in which a player may stand at a level, and the exact height.
fn standing(ground: &mut ReachableGround, level: i32) -> (f32, Bins) {
    let [low, high] = ends(level);
    let y = (high - PLAYER_HALF_HEIGHT).floor() + PLAYER_HALF_HEIGHT;
    if y < low {
        return (y, Bins::NONE);
    }
    let (rows, feet) = (ground.rows(y), ground.feet(y));
    (y, ground.stops(rows, feet))
}

/// Returns the contacts of a player at a level.
pub(super) fn touched(ground: &mut ReachableGround, level: i32) -> Touched {
    let [low, high] = ends(level).map(|y| ground.touched(y));
    Touched { alive: low.alive | high.alive, coin: low.coin | high.coin }
}

/// Adds all states after a step from these positions, with any action.
pub(super) fn step(ground: &mut ReachableGround, state: Loose, places: Bins, after: &mut Vec<(State, Bins)>) {
    let lift = (state.lift - SLOWED).max(-FASTEST);
    let reached = reached(ground, state.level, lift, places);
    let lends = ground.enemies_lend;
    for (&level, &places) in &reached {
        let (y, standing) = standing(ground, level);
        let stopped = places & standing;
        put(after, State::Exact(Exact { y, vy: 0.0, is_held: lends }), stopped);
        put(after, State::Loose(Loose { level, lift: lift.max(0) }), stopped);
        // Others have risen or fallen as far as they must.
        if level <= state.level + lift {
            put(after, State::Loose(Loose { level, lift }), places);
        }
        for index in 0..ground.crates.len() {
            let (block, beside) = ground.crates[index];
            let y = block.y + block.ry + PLAYER_HALF_HEIGHT;
            let top = level_of(y);
            if state.level >= top && (top - CRATE_DEPTH..=top).contains(&level) {
                put(after, State::Exact(Exact { y, vy: 0.0, is_held: true }), places & beside);
            }
        }
    }
}

/// Returns the positions of a player at the end of a step, by level.
fn reached(ground: &mut ReachableGround, from: i32, lift: i32, places: Bins) -> BTreeMap<i32, Bins> {
    let (lowest, highest) = (from - FASTEST, from + lift.max(0));
    let mut reached = BTreeMap::from([(from, places)]);
    for _ in 0..=STEP_BINS {
        for (&level, places) in &mut reached {
            *places |= places.spread(1) & room(ground, level);
        }
        let downwards = (lowest..highest).rev().map(|level| [level + 1, level]);
        let upwards = (lowest..highest).map(|level| [level, level + 1]);
        for [here, there] in downwards.chain(upwards) {
            let Some(&places) = reached.get(&here) else { continue };
            let passes = places & passes(ground, here, there);
            if !passes.is_empty() {
                *reached.entry(there).or_default() |= passes;
            }
        }
    }
    let within = places.spread(STEP_BINS);
    reached.values_mut().for_each(|places| *places = *places & within);
    reached
}

/// Returns the bins in which corners may be free at both of two levels.
fn passes(ground: &mut ReachableGround, here: i32, there: i32) -> Bins {
    let mut passes = Bins::NONE;
    for one in ends(here) {
        for other in ends(there) {
            let (one, other) = (ground.rows(one), ground.rows(other));
            passes |= ground.passes(one, other);
        }
    }
    passes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{level::Level, rules::Body};

    #[test]
    fn who_stands_is_in_the_middle_of_a_tenth() {
        let y = Body::player().y;
        let [low, high] = ends(level_of(y));
        assert!((low - (y - 0.05)).abs() < 1e-4 && (high - (y + 0.05)).abs() < 1e-4);
        assert_eq!(Loose::at(y, -0.73).lift, -7);
    }

    #[test]
    fn who_falls_comes_to_stand_and_does_not_rise() {
        let level = Level::from_text("#......\n#......\n#A....C\n#======\n").expect("a valid picture");
        let mut ground = ReachableGround::new(&level);
        let start = Loose::at(Body::player().y + 0.4, -0.35);
        let mut after = Vec::new();
        step(&mut ground, start, Bins::at(3.5), &mut after);
        let stands = State::Exact(Exact { y: Body::player().y, vy: 0.0, is_held: false });
        assert!(after.iter().any(|(state, _)| *state == stands), "{after:?}");
        for (state, places) in after {
            assert_eq!(places & !Bins::at(3.5).spread(STEP_BINS), Bins::NONE);
            if let State::Loose(Loose { level, .. }) = state {
                assert!((level_of(Body::player().y)..start.level).contains(&level), "{state:?}");
            }
        }
    }
}
