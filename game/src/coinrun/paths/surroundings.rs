//! Surroundings of the paths, and their values.

use super::{
    course::{Course, HALF_VIEW},
    dangers::Dangers,
    ground::Ground,
    held::{STEPS, VALUES},
    near_crates::NearCrates,
    walker::Walker,
};
use crate::coinrun::{
    rules::{Body, PlayerState},
    tile::TileGrid,
};

/// Bodies farther away than this (tiles, along x) cannot be met on a path: half a view, and an enemy's walk.
const FAR: f32 = 10.0;

/// A direction, and the indices in [`HELD`](super::HELD) of its actions with and without a jump.
const PAIRS: [(i8, usize, usize); 3] = [(1, 0, 1), (0, 2, 3), (-1, 5, 4)];

/// The bodies near a player. Made once and used again, since it holds memory.
#[derive(Debug, Default)]
pub struct Surroundings {
    crates: NearCrates,
    dangers: Dangers,
}

impl Surroundings {
    /// Follows the path of every held action, in the order of [`HELD`](super::HELD), and writes for each `[dies, coin,
    /// lands, steps, dx, dy]`: three flags, the share of [`STEPS`] that was made, and the displacement in half views.
    ///
    /// A path ends with death, with the coin, where a flight ends on firm ground, and at the edge of the view.
    pub fn follow(
        &mut self,
        player: &Body,
        memory: &PlayerState,
        tiles: &TileGrid,
        crates: &[Body],
        saws: &[Body],
        enemies: &[Body],
        out: &mut [f32],
    ) {
        let is_near = |body: &&Body| (body.x - player.x).abs() < FAR;
        self.crates.replace(player, crates.iter().filter(is_near));
        self.dangers.replace(player, STEPS, saws.iter().filter(is_near), enemies.iter().filter(is_near));
        let ground = Ground::new(tiles, &self.crates, player);
        let start = Course::new(Walker::new(player, memory, &ground));
        for (ax, with_jump, without) in PAIRS {
            let (mut course, mut fork) = (start.clone(), None);
            course.go_on::<false>(&ground, ax, |course| fork = Some(course.clone()));
            let values = self.values(&course, player, tiles);
            out[VALUES * without..][..VALUES].copy_from_slice(&values);
            let values = fork.map_or(values, |mut jump| {
                jump.go_on::<true>(&ground, ax, |_| ());
                self.values(&jump, player, tiles)
            });
            out[VALUES * with_jump..][..VALUES].copy_from_slice(&values);
        }
    }

    fn values(&self, course: &Course, player: &Body, tiles: &TileGrid) -> [f32; VALUES] {
        let (xs, ys) = course.places();
        let [start_x, start_y] = course.start();
        if xs.is_empty() {
            // Only a player whose position is NaN makes no step.
            return [0.0, 0.0, 0.0, 0.0, f32::NAN, f32::NAN];
        }
        let end = self.dangers.end(course, player, tiles);
        let steps = end.map_or(xs.len(), |end| end.steps);
        let flag = |is: bool| f32::from(u8::from(is));
        [
            flag(end.is_some_and(|end| !end.is_coin)),
            flag(end.is_some_and(|end| end.is_coin)),
            flag(course.lands() && steps == xs.len()),
            steps as f32 / STEPS as f32,
            (xs[steps - 1] - start_x) / HALF_VIEW,
            (ys[steps - 1] - start_y) / HALF_VIEW,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{paths::HELD, rules::directions};

    #[test]
    fn pairs_hold_one_direction_with_and_without_a_jump() {
        for (ax, with_jump, without) in PAIRS {
            assert_eq!([with_jump, without].map(|at| directions(HELD[at])), [(ax, 1), (ax, 0)]);
        }
    }
}
