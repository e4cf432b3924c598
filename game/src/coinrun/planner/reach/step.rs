//! One step of a player with exact height and speed, for all positions at once.

use crate::coinrun::{
    planner::reach::{
        Exact, Loose, State,
        ground::{Bins, ReachableGround, STEP_BINS},
        loose::out_of_wall,
        put,
    },
    rules::{Body, MAX_PUSHES, OVERLAP_MARGIN, WALK_SPEED, fall, flush, part_count, rise_to_top},
};

/// A state during a step.
#[derive(Clone, Copy, PartialEq)]
struct Part {
    y: f32,
    /// Parts in which nothing was in the way along y.
    free: u32,
    /// True if a crate has caught the player.
    is_caught: bool,
}

/// A player's action in a step, and its positions.
struct Act {
    y: f32,
    vy: f32,
    /// Crates hold a player that falls onto them.
    is_held: bool,
    places: Bins,
}

/// Adds all states after a step from these positions, with any action.
pub(super) fn step(ground: &mut ReachableGround, state: Exact, places: Bins, after: &mut Vec<(State, Bins)>) {
    let supported = supported(ground, state, places);
    // A player that presses down in the air falls as usual, and past crates, as if it missed them.
    let actions = [(0, false, places), (1, true, supported), (-1, true, supported)];
    for (ay, has_support, places) in actions {
        if places.is_empty() {
            continue;
        }
        let vy = fall(state.vy, ay, has_support);
        let act = Act { y: state.y, vy, is_held: vy < 0.0 && ay >= 0, places };
        let slowest = part_count(0.0, vy);
        // A little more than full speed, since rounding adds to it.
        let fastest = part_count(WALK_SPEED + 1e-4, vy);
        for parts in slowest..=fastest {
            play(ground, &act, parts, after);
        }
    }
}

/// Returns the positions from which a player can jump.
fn supported(ground: &mut ReachableGround, state: Exact, places: Bins) -> Bins {
    if state.vy != 0.0 {
        return Bins::NONE;
    }
    if state.is_held {
        return places;
    }
    let (rows, feet) = (ground.rows(state.y), ground.feet(state.y));
    places & ground.stops(rows, feet)
}

/// Makes a step of so many parts.
fn play(ground: &mut ReachableGround, act: &Act, parts: u32, after: &mut Vec<(State, Bins)>) {
    let held_from = (act.is_held && !ground.crates.is_empty()).then_some(act.y);
    let share = 1.0 / parts as f32;
    let first = Part { y: act.y, free: 0, is_caught: false };
    let mut now = vec![(first, sideways(ground, act.y, act.places))];
    for _ in 0..parts {
        let mut next = Vec::new();
        for (part, places) in now {
            if part.is_caught {
                put(&mut next, part, sideways(ground, part.y, places));
                continue;
            }
            for (y, stopped, places) in displace(ground, places, part.y, act.vy * share, held_from) {
                if stopped == Stopped::ByLedge {
                    out_of_wall(ground, y, places, after);
                    continue;
                }
                let is_free = stopped == Stopped::Not;
                let moved = Part { y, free: part.free + u32::from(is_free), is_caught: stopped == Stopped::ByCrate };
                if !is_free {
                    // A player that is stopped along x as well makes no more parts.
                    end(ground, act, parts, moved, places, after);
                }
                put(&mut next, moved, sideways(ground, y, places));
            }
        }
        now = next;
    }
    for (part, places) in now {
        end(ground, act, parts, part, places, after);
    }
}

/// Returns the positions after one part of a step along x, or none.
fn sideways(ground: &mut ReachableGround, y: f32, places: Bins) -> Bins {
    let rows = ground.rows(y);
    places | places.spread(1) & ground.room(rows)
}

fn end(ground: &ReachableGround, act: &Act, parts: u32, part: Part, places: Bins, after: &mut Vec<(State, Bins)>) {
    let share = part.free as f32 / parts as f32;
    // Zero is never negative.
    let vy = if part.is_caught { 0.0 } else { act.vy * share + 0.0 };
    let is_held = part.is_caught || ground.enemies_lend && act.vy < 0.0 && vy == 0.0;
    // The rest of a speed is followed loosely: there would be too many.
    let is_partly_stopped = !part.is_caught && part.free > 0 && part.free < parts;
    let state = if is_partly_stopped {
        State::Loose(Loose::at(part.y, vy))
    } else {
        State::Exact(Exact { y: part.y, vy, is_held })
    };
    put(after, state, places & act.places.spread(STEP_BINS));
}

// One part of a step along y, for all positions of a state at once.

/// The stop of a part of a step along y.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Stopped {
    /// Nothing.
    Not,
    /// A wall before the player.
    ByWall,
    /// A ledge below the player: the corners behind met it, and are in it now.
    ByLedge,
    /// The top of a crate, which holds the player.
    ByCrate,
}

/// The end of a part of a step along y: a height, its stop, and positions along x.
pub(super) type Led = (f32, Stopped, Bins);

/// Displaces players with all corners free by `dy`, by the rules. `held_from` is the height at the start of the step,
/// for a player that crates hold.
pub(super) fn displace(
    ground: &mut ReachableGround,
    places: Bins,
    y: f32,
    dy: f32,
    held_from: Option<f32>,
) -> Vec<Led> {
    let mut all = Vec::new();
    push(ground, places, y, dy, held_from, 0, &mut all);
    all
}

fn push(
    ground: &mut ReachableGround,
    places: Bins,
    y: f32,
    dy: f32,
    held_from: Option<f32>,
    pushes: u32,
    all: &mut Vec<Led>,
) {
    for (height, stopped, places) in at_walls(ground, places, y, dy) {
        if places.is_empty() {
            continue;
        }
        all.push((height, stopped, places));
        let Some(from) = held_from.filter(|_| stopped != Stopped::ByLedge) else { continue };
        for index in 0..ground.crates.len() {
            let (block, beside) = ground.crates[index];
            let body = Body { x: block.x, ..ground.body(height) };
            let on_it = places & beside;
            let is_above = from >= block.y + block.ry + body.ry;
            if on_it.is_empty() || !is_above || !body.overlaps(&block, OVERLAP_MARGIN) {
                continue;
            }
            let mut risen = vec![(height, Stopped::Not, on_it)];
            if pushes < MAX_PUSHES {
                risen.clear();
                push(ground, on_it, height, rise_to_top(&body, &block), held_from, pushes + 1, &mut risen);
            }
            all.extend(risen.into_iter().map(|(height, stopped, places)| match stopped {
                Stopped::ByLedge => (height, stopped, places),
                _ => (height, Stopped::ByCrate, places),
            }));
        }
    }
}

/// Returns the effects of walls on a displacement: none, or an end flush with them.
fn at_walls(ground: &mut ReachableGround, places: Bins, y: f32, dy: f32) -> [Led; 3] {
    let target = y + dy;
    let flushed = flush(target, ground.body(y).ry, dy > 0.0);
    let (here, there) = (ground.rows(y), ground.rows(target));
    let free = places & ground.passes(here, there);
    let mut stopped = |corner: usize| {
        // Corners that stay in their row stay free.
        if here[corner] == there[corner] { Bins::NONE } else { places & ground.stops(here, there[corner]) }
    };
    let [leading, trailing] = if dy > 0.0 { [1, 0] } else { [0, 1] };
    [
        (target, Stopped::Not, free),
        // Before a wall that the leading corners meet there is room.
        (flushed, Stopped::ByWall, stopped(leading)),
        (flushed, Stopped::ByLedge, stopped(trailing)),
    ]
}
