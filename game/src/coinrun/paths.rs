//! Curved rays: the player's paths under held buttons.
//!
//! A person foresees the arc of a jump, which a straight ray does not show. These sensors therefore follow the player's
//! own motion through the view: tiles, crates and saws as they stand, enemies at their present speed. A path ends at
//! the edge of the view.
//!
//! Six paths of up to 20 steps are followed at every tick, so they take short cuts. Each gives the numbers of the rules
//! to the bit:
//!
//! - with and without the jump button, a path is one path until a jump would work;
//! - a step through free space only adds, and so does one beside a straight wall or on level ground until it is
//!   blocked; only other steps apply the rules to each of their parts;
//! - state that one step leaves unchanged stays unchanged in every further step;
//! - hazards do not move the player, so they are tested once the course is known, and only near it.
//!
//! The folder, in reading order:
//!
//! - `ground`: tiles and crates around a player, the buttons of paths, and a step that nothing blocks.
//! - `slide`: a step beside straight walls and over level ground, and the choice among all ways of stepping.
//! - `plain`: the paths without short cuts, for tests.

mod ground;
#[cfg(test)]
mod plain;
mod slide;

use crate::coinrun::{
    paths::ground::{NearCrates, PathGround, Swept},
    rules::{Body, CoinRunEnd, OVERLAP_MARGIN, PlayerState, is_supported, motion::touch},
    tile::{Corners, REACH, TileGrid},
};

pub use crate::coinrun::paths::ground::{HELD, NAMES, STEPS, VALUES};

/// Bodies farther away than this (tiles, along x) cannot be met on a path: half a view, and an enemy's walk.
const FAR: f32 = 10.0;

/// A direction, and the indices in [`HELD`] of its actions with and without a jump.
const PAIRS: [(i8, usize, usize); 3] = [(1, 0, 1), (0, 2, 3), (-1, 5, 4)];

/// The bodies near a player. Made once and used again, since it holds memory.
#[derive(Debug, Default)]
pub struct Surroundings {
    crates: NearCrates,
    dangers: Dangers,
}

impl Surroundings {
    /// Follows the path of every held action, in the order of [`HELD`], and writes for each `[dies, coin,
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
        let ground = PathGround::new(tiles, &self.crates, player);
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

/// A player on a path. Its size is that of the [`PathGround`].
#[derive(Clone, Copy, PartialEq, Debug)]
struct Walker {
    /// Centre, tiles from the left.
    pub x: f32,
    /// Centre, tiles from the bottom.
    pub y: f32,
    /// Horizontal velocity, tiles per step.
    pub vx: f32,
    /// Vertical velocity, tiles per step, upwards.
    pub vy: f32,
    /// A jump would work now. No other memory of the player matters to the next step.
    pub supported: bool,
}

impl Walker {
    /// Returns a player at the beginning of a path.
    pub fn new(body: &Body, memory: &PlayerState, ground: &PathGround) -> Self {
        let supported = is_supported(body, memory, ground.tiles);
        Self { x: body.x, y: body.y, vx: body.vx, vy: body.vy, supported }
    }

    /// Returns the player's body by the rules.
    #[inline]
    pub fn body(&self, ground: &PathGround) -> Body {
        Body { x: self.x, y: self.y, vx: self.vx, vy: self.vy, rx: ground.rx, ry: ground.ry }
    }
}

// The course of a path, regardless of hazards.

/// Half the width and height of the view, in tiles.
const HALF_VIEW: f32 = REACH as f32 + 0.5;

/// Positions of a player after each step, until it lands or leaves the view.
#[derive(Clone, Debug)]
struct Course {
    walker: Walker,
    start: [f32; 2],
    x: [f32; STEPS as usize],
    y: [f32; STEPS as usize],
    steps: usize,
    flew: bool,
    lands: bool,
}

impl Course {
    /// Returns a course of no steps.
    pub fn new(walker: Walker) -> Self {
        let none = [0.0; STEPS as usize];
        Self { walker, start: [walker.x, walker.y], x: none, y: none, steps: 0, flew: false, lands: false }
    }

    /// Goes on to the end with a direction held (-1, 0 or 1), and perhaps the jump button.
    ///
    /// Hands the course to `fork` before the first step in which the jump button makes a difference.
    #[inline(always)]
    pub fn go_on<const JUMPS: bool>(&mut self, ground: &PathGround, ax: i8, mut fork: impl FnMut(&Course)) {
        let (mut walker, [x, y], mut is_alike) = (self.walker, self.start, true);
        while self.steps < STEPS as usize && (walker.x - x).abs() < HALF_VIEW && (walker.y - y).abs() < HALF_VIEW {
            if is_alike && walker.supported {
                is_alike = false;
                self.walker = walker;
                fork(self);
            }
            let before = walker;
            walker = walker.step(ground, ax, JUMPS);
            (self.x[self.steps], self.y[self.steps]) = (walker.x, walker.y);
            self.steps += 1;
            if self.flew && walker.supported {
                self.lands = true;
                break;
            }
            self.flew |= !walker.supported && walker.vy.abs() > 0.5;
            // State that one step leaves unchanged stays unchanged in every further step.
            if walker == before {
                self.x[self.steps..].fill(walker.x);
                self.y[self.steps..].fill(walker.y);
                self.steps = STEPS as usize;
            }
        }
        self.walker = walker;
    }

    /// Returns the positions after each step.
    pub fn places(&self) -> (&[f32], &[f32]) {
        (&self.x[..self.steps], &self.y[..self.steps])
    }

    /// Returns the span of these positions.
    pub fn swept(&self) -> Swept {
        let (xs, ys) = self.places();
        let mut swept = Swept::between([xs[0], ys[0]], [xs[0], ys[0]]);
        for at in xs.iter().zip(ys) {
            swept.add([*at.0, *at.1]);
        }
        swept
    }

    /// Returns the start of the path.
    pub fn start(&self) -> [f32; 2] {
        self.start
    }

    /// Returns true if the last step ended a flight on firm ground.
    pub fn lands(&self) -> bool {
        self.lands
    }
}

// Ends of a path: saws, enemies, lava, the coin.

/// The end of a course: death or the coin.
#[derive(Clone, Copy, PartialEq, Debug)]
struct End {
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
struct Dangers {
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
            Some(End { steps: step + 1, is_coin: end == CoinRunEnd::Coin })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{paths::ground::HELD, rules::directions};

    #[test]
    fn pairs_hold_one_direction_with_and_without_a_jump() {
        for (ax, with_jump, without) in PAIRS {
            assert_eq!([with_jump, without].map(|at| directions(HELD[at])), [(ax, 1), (ax, 0)]);
        }
    }
}
