//! One part of a step along y, for all positions of a state at once.

use super::{bins::Bins, ground::Ground};
use crate::coinrun::rules::{Body, MAX_PUSHES, OVERLAP_MARGIN, flush, rise_to_top};

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
pub(super) fn displace(ground: &mut Ground, places: Bins, y: f32, dy: f32, held_from: Option<f32>) -> Vec<Led> {
    let mut all = Vec::new();
    push(ground, places, y, dy, held_from, 0, &mut all);
    all
}

fn push(ground: &mut Ground, places: Bins, y: f32, dy: f32, held_from: Option<f32>, pushes: u32, all: &mut Vec<Led>) {
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
fn at_walls(ground: &mut Ground, places: Bins, y: f32, dy: f32) -> [Led; 3] {
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
