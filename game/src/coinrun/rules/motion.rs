//! Movement of player and enemies in small steps, one axis at a time; contacts, the end of an episode, and its
//! fingerprint.

use crate::coinrun::{
    rules::{Body, CORNER, OVERLAP_MARGIN, PlayerState, PlayerStep, TIMEOUT},
    tile::{Corners, SIZE, Tile, TileGrid},
};
use bevy_playbot::state_hash::StateHash;
use serde::{Deserialize, Serialize};

/// Moves `body` by its velocity in at least four equal parts. `displace` moves it by (dx, dy), only one of which is not
/// 0, and returns whether something was in the way.
///
/// Each velocity component then keeps the share of the parts in which it was not blocked. So a fall that ends in the
/// last of five parts leaves 4/5 of the speed for the next step. Only a completely blocked step leaves 0.
#[inline]
pub(super) fn advance(body: &mut Body, x_first: bool, mut displace: impl FnMut(&mut Body, f32, f32) -> bool) {
    let parts = part_count(body.vx, body.vy);
    let share = 1.0 / parts as f32;
    let (mut free_x, mut free_y) = (0_u32, 0_u32);
    for _ in 0..parts {
        let (blocked_x, blocked_y);
        // The velocity is read for every part: a crate or a turn changes it on the way.
        if x_first {
            blocked_x = displace(body, body.vx * share, 0.0);
            blocked_y = displace(body, 0.0, body.vy * share);
        } else {
            blocked_y = displace(body, 0.0, body.vy * share);
            blocked_x = displace(body, body.vx * share, 0.0);
        }
        free_x += u32::from(!blocked_x);
        free_y += u32::from(!blocked_y);
        if blocked_x && blocked_y {
            break;
        }
    }
    body.vx *= free_x as f32 / parts as f32;
    body.vy *= free_y as f32 / parts as f32;
}

/// Returns the number of equal parts of a step: four per tile of speed, at least four.
#[inline]
pub(in crate::coinrun) fn part_count(vx: f32, vy: f32) -> u32 {
    let speed = (vx * vx + vy * vy).sqrt();
    ((4.0 * speed) as u32).max(4)
}

/// Returns the corners of `body` that are tested against tiles, if its centre were at (x, y).
#[inline]
pub(in crate::coinrun) fn corners(body: &Body, x: f32, y: f32) -> Corners {
    let (rx, ry) = (body.rx * CORNER, body.ry * CORNER);
    Corners { left: x - rx, right: x + rx, low: y - ry, high: y + ry }
}

/// Returns the centre of a body of half size `half` that was stopped on its way to `centre`: flush with the tile edge
/// in front of it.
#[inline]
pub(in crate::coinrun) fn flush(centre: f32, half: f32, moves_up: bool) -> f32 {
    if moves_up { (centre + half).floor() - half } else { (centre - half).ceil() + half }
}

/// Returns the centre of a body of half size `half` after it bounced off the tile edge that it would have crossed on
/// its way to `centre`.
#[inline]
pub(super) fn mirrored(centre: f32, half: f32, moves_up: bool) -> f32 {
    let excess =
        if moves_up { (centre + half).floor() - (centre + half) } else { (centre - half).ceil() - (centre - half) };
    centre + 2.0 * excess
}

/// Moves one enemy. `crates` may be any subset that contains those within a tile of the enemy.
///
/// Enemies bounce off walls and barriers. Inner ground ([`Tile::Wall`]) also counts
/// as "outside", which blocks. A turn there therefore loses a quarter of the speed: one of four parts was blocked.
///
/// The original has an oddity that is kept here. It asks whether a crate holds an enemy with the state of the player.
/// While a falling player is high enough above a crate that an enemy overlaps, the player is marked as standing on a
/// crate ([`PlayerState::lent_support`]), and the enemy counts as blocked vertically. If the enemy turns at inner
/// ground in that tick, both axes are blocked and its step ends early.
#[inline]
pub fn patrol(
    enemy: &mut Body,
    player_state: &mut PlayerState,
    player: &PlayerStep,
    tiles: &TileGrid,
    crates: &[Body],
) {
    let can_hold = player.vy < 0.0 && player.ay >= 0 && !crates.is_empty();
    let free = if can_hold { None } else { free_step(enemy, tiles) };
    match free {
        Some(x) => enemy.x = x,
        None => patrol_in_parts(enemy, player_state, player, tiles, crates, can_hold),
    }
}

/// Returns where an enemy is after a step in which nothing turns it; `None` if something may. The sum is that of
/// [`advance`], part by part.
#[inline]
fn free_step(enemy: &Body, tiles: &TileGrid) -> Option<f32> {
    if enemy.vy != 0.0 || part_count(enemy.vx, 0.0) != 4 {
        return None;
    }
    let part = enemy.vx * 0.25;
    let x = enemy.x + part + part + part + part;
    // A step is shorter than a tile but for those of great speed, so that on its way each corner is in the cell where
    // it begins or in that where it ends.
    let is_free = |x| !tiles.turns_enemy(&corners(enemy, x, enemy.y));
    ((x - enemy.x).abs() < 1.0 && is_free(enemy.x) && is_free(x)).then_some(x)
}

#[inline(never)]
fn patrol_in_parts(
    enemy: &mut Body,
    player_state: &mut PlayerState,
    player: &PlayerStep,
    tiles: &TileGrid,
    crates: &[Body],
    can_hold: bool,
) {
    let x_first = enemy.vx.abs() > enemy.vy.abs();
    advance(enemy, x_first, |enemy, dx, dy| {
        let blocked = bounce(enemy, tiles, dx, dy);
        if dx != 0.0 || !can_hold {
            return blocked;
        }
        let held =
            crates.iter().any(|block| enemy.overlaps(block, OVERLAP_MARGIN) && player.is_held_by(block, player.vy));
        player_state.lent_support |= held;
        blocked || held
    });
}

/// Moves an enemy along one axis, turning it at walls and barriers. Returns whether it was blocked.
#[inline]
fn bounce(enemy: &mut Body, tiles: &TileGrid, dx: f32, dy: f32) -> bool {
    let (x, y) = (enemy.x + dx, enemy.y + dy);
    let corners = corners(enemy, x, y);
    (enemy.x, enemy.y) = (x, y);
    if !tiles.turns_enemy(&corners) {
        return false;
    }
    if dx != 0.0 {
        enemy.x = mirrored(x, enemy.rx, dx > 0.0);
        enemy.vx = -enemy.vx;
    }
    tiles.is_outside(&corners)
}

/// The end of an episode.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CoinRunEnd {
    /// The player reached the coin. Also when something deadly was touched in the same step.
    Coin,
    /// The player touched a saw.
    Saw,
    /// The player touched an enemy.
    Enemy,
    /// The player touched lava.
    Lava,
    /// The player left the level.
    LeftMap,
    /// The time was up.
    Timeout,
}

impl CoinRunEnd {
    /// Returns true if the coin was reached, which pays the reward.
    pub const fn is_success(self) -> bool {
        matches!(self, CoinRunEnd::Coin)
    }

    /// Returns the cause of a failure in words; `None` if the coin was reached.
    pub const fn cause(self) -> Option<&'static str> {
        match self {
            CoinRunEnd::Coin => None,
            CoinRunEnd::Saw => Some("saw"),
            CoinRunEnd::Enemy => Some("enemy"),
            CoinRunEnd::Lava => Some("lava"),
            CoinRunEnd::LeftMap => Some("left the map"),
            CoinRunEnd::Timeout => Some("time"),
        }
    }
}

/// Returns the end of the episode after step number `step` (from 1), if it ends. `saws` may be any subset that contains
/// those within a tile of the player.
#[inline]
pub fn touch<'a>(
    player: &Body,
    tiles: &TileGrid,
    saws: impl IntoIterator<Item = &'a Body>,
    enemies: impl IntoIterator<Item = &'a Body>,
    step: u32,
) -> Option<CoinRunEnd> {
    let (coin, lava) = touched_tiles(player, tiles);
    let hits = |body: &'a Body| body.overlaps(player, 0.0);
    if coin {
        Some(CoinRunEnd::Coin)
    } else if saws.into_iter().any(hits) {
        Some(CoinRunEnd::Saw)
    } else if enemies.into_iter().any(hits) {
        Some(CoinRunEnd::Enemy)
    } else if lava {
        Some(CoinRunEnd::Lava)
    } else if has_left(player) {
        Some(CoinRunEnd::LeftMap)
    } else {
        (step >= TIMEOUT).then_some(CoinRunEnd::Timeout)
    }
}

/// Returns whether the player's rectangle, a little shrunk, covers a coin tile and a lava tile.
#[inline]
fn touched_tiles(player: &Body, tiles: &TileGrid) -> (bool, bool) {
    let (rx, ry) = (player.rx + OVERLAP_MARGIN, player.ry + OVERLAP_MARGIN);
    let columns = (player.x - rx) as i32..=(player.x + rx) as i32;
    let (low, high) = ((player.y - ry) as i32, (player.y + ry) as i32);
    let (mut coin, mut lava) = (false, false);
    for x in columns {
        for y in low..=high {
            let tile = tiles.get(x, y);
            coin |= tile == Tile::Coin;
            lava |= tile.is_lava();
        }
    }
    (coin, lava)
}

#[inline]
fn has_left(player: &Body) -> bool {
    let size = SIZE as f32;
    player.x + player.rx < 0.0
        || player.y + player.ry < 0.0
        || player.x - player.rx > size
        || player.y - player.ry > size
}

/// Columns on each side of a body's own column that are searched. Two bodies of half width 0.5
/// touch when their centres are less than 1 apart, and a body moves less than 1 in a step.
const REACH: i32 = 2;

/// Static bodies with a list of neighbours for every column, so that a moving body is tested against these only.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct NearBodies {
    bodies: Vec<Body>,
    /// Start of each column's neighbours in `bodies`, and the end of the last.
    starts: Vec<u32>,
}

impl NearBodies {
    /// Sorts `bodies`; each column's neighbours keep the given order.
    pub fn new(bodies: &[Body]) -> Self {
        let mut sorted = Self::default();
        for column in 0..SIZE {
            sorted.starts.push(sorted.bodies.len() as u32);
            let is_near = |body: &&Body| (body.x.floor() as i32 - column).abs() <= REACH;
            sorted.bodies.extend(bodies.iter().filter(is_near));
        }
        sorted.starts.push(sorted.bodies.len() as u32);
        sorted
    }

    /// Returns the bodies that something centred at `x` (tiles) can touch before it has moved one tile.
    #[inline]
    pub fn near(&self, x: f32) -> &[Body] {
        // `as` saturates: a position left of the level counts as column 0.
        let column = (x as usize).min(SIZE as usize - 1);
        &self.bodies[self.starts[column] as usize..self.starts[column + 1] as usize]
    }
}

/// Returns the hash of the step number, then of the bit patterns of x, y, vx and vy of the player and of every enemy.
/// Enemies come in creation order. Negative zero counts as zero.
pub fn hash_state<'a>(player: &'a Body, enemies: impl IntoIterator<Item = &'a Body>, step: u32) -> u64 {
    let bodies = std::iter::once(player).chain(enemies);
    // Adding zero turns negative zero into zero and changes nothing else.
    let words =
        bodies.flat_map(|body| [body.x, body.y, body.vx, body.vy].map(|value| u64::from((value + 0.0).to_bits())));
    StateHash::of(std::iter::once(u64::from(step)).chain(words)).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{
        generator::generate,
        level::{Level, Mode},
        rules::begin_step,
    };

    #[test]
    fn fast_bodies_move_in_more_parts() {
        assert_eq!(part_count(0.0, 0.0), 4);
        assert_eq!(part_count(0.5, -1.1), 4);
        assert_eq!(part_count(0.0, -1.3), 5);
        assert_eq!(part_count(0.0, 1.5), 6);
    }

    #[test]
    fn a_late_stop_leaves_most_of_the_speed() {
        let mut body = Body { vy: -1.3, ..Body::player() };
        let mut parts = 0;
        advance(&mut body, true, |_, _, dy| {
            parts += u32::from(dy != 0.0);
            dy != 0.0 && parts > 3
        });
        assert_eq!(body.vy, -1.3 * (3.0 / 5.0));
    }

    #[test]
    fn edges() {
        assert_eq!(flush(3.7, 0.5, true), 3.5);
        assert_eq!(flush(3.2, 0.5, false), 3.5);
        assert_eq!(mirrored(3.75, 0.5, true), 3.25);
        assert_eq!(mirrored(3.25, 0.5, false), 3.75);
    }

    fn patrol_steps(text: &str, steps: usize) -> Vec<Body> {
        let level = Level::from_text(text).expect("a valid picture");
        let mut enemy = level.enemies()[0];
        let (mut player, mut state) = (Body::player(), PlayerState::default());
        let step = begin_step(&mut player, &mut state, &level.tiles, 4);
        let mut path = Vec::new();
        for _ in 0..steps {
            let crates = level.crates_near(enemy.x);
            patrol(&mut enemy, &mut state, &step, &level.tiles, crates);
            path.push(enemy);
        }
        path
    }

    #[test]
    fn turning_at_inner_ground_costs_a_quarter_of_the_speed() {
        let path = patrol_steps("#....C\n#.>.#.\n######\n", 12);
        assert!(path.iter().any(|enemy| enemy.vx == -0.112_500_004));
    }

    #[test]
    fn turning_at_surface_or_barrier_is_free() {
        for wall in ['=', '|'] {
            let path = patrol_steps(&format!("#....C\n#.>.{wall}.\n######\n"), 12);
            assert!(path.iter().any(|enemy| enemy.vx < 0.0));
            assert!(path.iter().all(|enemy| enemy.vx.abs() == 0.15));
        }
    }

    #[test]
    fn a_step_that_nothing_turns_is_the_same_in_one_as_in_parts() {
        let (mut free, mut turned) = (0, 0);
        for seed in 0..40 {
            let level = generate(Mode::Hard, seed);
            let (mut player, mut state) = (Body::player(), PlayerState::default());
            let step = begin_step(&mut player, &mut state, &level.tiles, 4);
            for enemy in level.enemies() {
                for speed in [0.15, 0.112_5, 0.9, 1.2, 1.3, 0.0] {
                    let (mut fast, mut slow) =
                        (Body { vx: enemy.vx.signum() * speed, ..enemy }, PlayerState::default());
                    for _ in 0..200 {
                        let mut expected = fast;
                        match free_step(&fast, &level.tiles) {
                            Some(_) => free += 1,
                            None => turned += 1,
                        }
                        patrol(&mut fast, &mut state, &step, &level.tiles, &[]);
                        patrol_in_parts(&mut expected, &mut slow, &step, &level.tiles, &[], false);
                        assert_eq!(
                            [fast.x, fast.y, fast.vx, fast.vy].map(f32::to_bits),
                            [expected.x, expected.y, expected.vx, expected.vy].map(f32::to_bits)
                        );
                    }
                }
            }
        }
        assert!(free > 1000 && turned > 100, "{free} {turned}");
    }

    #[test]
    fn an_enemy_never_leaves_its_row() {
        let path = patrol_steps("#.....C\n#.>xx#.\n#######\n", 300);
        assert!(path.iter().all(|enemy| enemy.y == 1.5));
    }

    fn ends(player: Body, tiles: &TileGrid, saws: &[Body], enemies: &[Body]) -> Option<CoinRunEnd> {
        touch(&player, tiles, saws, enemies, 1)
    }

    #[test]
    fn the_coin_wins_over_everything() {
        let mut tiles = TileGrid::default();
        tiles.set(1, 1, Tile::Coin);
        tiles.set(1, 2, Tile::LavaTop);
        let saw = [Body::block([1, 1])];
        assert_eq!(ends(Body::player(), &tiles, &saw, &saw), Some(CoinRunEnd::Coin));
        assert_eq!(touch(&Body::player(), &tiles, &saw, [], TIMEOUT), Some(CoinRunEnd::Coin));
    }

    #[test]
    fn flush_bodies_do_not_touch() {
        let tiles = TileGrid::default();
        let player = Body::player();
        let beside = [Body::block([2, 1])];
        assert_eq!(ends(player, &tiles, &beside, &[]), None);
        let closer = Body { x: player.x + 0.001, ..player };
        assert_eq!(ends(closer, &tiles, &beside, &[]), Some(CoinRunEnd::Saw));
        assert_eq!(ends(closer, &tiles, &[], &beside), Some(CoinRunEnd::Enemy));
    }

    #[test]
    fn lava_the_border_and_the_clock_end_episodes() {
        let mut tiles = TileGrid::default();
        let player = Body::player();
        assert_eq!(touch(&player, &tiles, [], [], TIMEOUT), Some(CoinRunEnd::Timeout));
        assert_eq!(touch(&player, &tiles, [], [], TIMEOUT - 1), None);
        let gone = Body { x: 65.0, ..player };
        assert_eq!(ends(gone, &tiles, &[], &[]), Some(CoinRunEnd::LeftMap));
        tiles.set(1, 1, Tile::Lava);
        assert_eq!(ends(player, &tiles, &[], &[]), Some(CoinRunEnd::Lava));
    }

    #[test]
    fn finds_neighbours_in_order() {
        let bodies = [9, 2, 11, 12].map(|x| Body::block([x, 1]));
        let near = NearBodies::new(&bodies);
        let xs = |x: f32| near.near(x).iter().map(|b| b.x).collect::<Vec<_>>();
        assert_eq!(xs(10.2), [9.5, 11.5, 12.5]);
        assert_eq!(xs(0.0), [2.5]);
        assert_eq!(xs(-3.0), [2.5]);
        assert_eq!(xs(99.0), [] as [f32; 0]);
    }

    #[test]
    fn every_part_counts() {
        let player = Body::player();
        let enemy = Body::enemy([4, 1], 1);
        let base = hash_state(&player, [&enemy], 3);
        assert_eq!(base, hash_state(&Body { vx: -0.0, ..player }, [&enemy], 3));
        assert_ne!(base, hash_state(&player, [&enemy], 4));
        assert_ne!(base, hash_state(&player, [], 3));
        let nudged = Body { x: enemy.x + 1e-6, ..enemy };
        assert_ne!(base, hash_state(&player, [&nudged], 3));
    }
}
