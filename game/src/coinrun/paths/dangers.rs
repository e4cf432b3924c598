//! Ends of a path: saws, enemies, lava, the coin.

use super::{course::Course, swept::Swept};
use crate::coinrun::{
    rules::{Body, OVERLAP_MARGIN, Outcome, touch},
    tile::{Corners, TileGrid},
};

/// The end of a course: death or the coin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct End {
    /// Steps that were made.
    pub steps: usize,
    /// The end is the coin.
    pub is_coin: bool,
}

/// A saw or an enemy near the player.
#[derive(Clone, Copy, Debug)]
struct Killer {
    x: f32,
    vx: f32,
    y: f32,
    reach: [f32; 2],
    /// Range of its x during the steps of a path: smallest and largest.
    span: [f32; 2],
}

impl Killer {
    /// Returns the number of steps before the first one in which it is touched.
    fn first_touch(&self, (xs, ys): (&[f32], &[f32])) -> Option<usize> {
        let mut at = self.x;
        xs.iter().zip(ys).position(|(x, y)| {
            at += self.vx;
            (at - x).abs() < self.reach[0] && (self.y - y).abs() < self.reach[1]
        })
    }
}

/// Saws and enemies near a player.
#[derive(Debug, Default)]
pub(super) struct Dangers {
    killers: Vec<Killer>,
}

impl Dangers {
    /// Replaces the dangers, for this player and paths of up to `steps` steps.
    pub fn replace<'a>(
        &mut self,
        player: &Body,
        steps: u32,
        saws: impl Iterator<Item = &'a Body>,
        enemies: impl Iterator<Item = &'a Body>,
    ) {
        self.killers.clear();
        let bodies = saws.map(|saw| (saw, 0.0)).chain(enemies.map(|enemy| (enemy, enemy.vx)));
        self.killers.extend(bodies.map(|(body, vx)| {
            let last = (0..steps).fold(body.x, |x, _| x + vx);
            Killer {
                x: body.x,
                vx,
                y: body.y,
                reach: [body.rx + player.rx, body.ry + player.ry],
                span: if vx < 0.0 { [last, body.x] } else { [body.x, last] },
            }
        }));
    }

    /// Returns the end of a course of a player of this size, if it has one.
    pub fn end(&self, course: &Course, player: &Body, tiles: &TileGrid) -> Option<End> {
        let (xs, ys) = course.places();
        let swept = course.swept();
        // The number of steps before a death.
        let mut survived = xs.len();
        for killer in &self.killers {
            if swept.comes_near(killer.span, killer.y, killer.reach)
                && let Some(steps) = killer.first_touch((&xs[..survived], &ys[..survived]))
            {
                survived = steps;
            }
        }
        let death = (survived < xs.len()).then_some(End { steps: survived + 1, is_coin: false });
        if tiles.has_no_ends(&touched(player, &swept)) {
            return death;
        }
        let until = death.map_or(xs.len(), |death| death.steps);
        let at_tiles = (0..until).find_map(|step| {
            let there = Body { x: xs[step], y: ys[step], ..*player };
            let end = touch(&there, tiles, [], [], 0)?;
            Some(End { steps: step + 1, is_coin: end == Outcome::Coin })
        });
        // Other contacts in the same step change nothing: the coin wins, and all others kill.
        at_tiles.or(death)
    }
}

/// Returns the corners of the rectangle that touches tiles, for all these centres.
fn touched(body: &Body, swept: &Swept) -> Corners {
    let (rx, ry) = (body.rx + OVERLAP_MARGIN, body.ry + OVERLAP_MARGIN);
    Corners { left: swept.x[0] - rx, right: swept.x[1] + rx, low: swept.y[0] - ry, high: swept.y[1] + ry }
}
