//! A player's observation: the 13 × 13 tiles around it, its motion, and its possible paths.
//!
//! | values | name | meaning |
//! |---|---|---|
//! | 169 | `wall_r_c` | share of the cell that is ground (everything outside the level is) |
//! | 169 | `crate_r_c` | share of the cell that crates fill |
//! | 169 | `danger_r_c` | share of the cell that lava, saws and enemies fill |
//! | 3 | `coin_seen`, `coin_dx`, `coin_dy` | whether the coin is in view, and how far away in half views |
//! | 9 | `enemy_i_dx`, `_dy`, `_vx` | the 3 nearest enemies in view, nearest first; 0 where there are fewer |
//! | 8 | `vx`, `vy`, `cell_x`, `cell_y`, `supported`, `rising`, `on_crate`, `faces_left` | the player |
//! | 36 | `hold_a_dies`, `_coin`, `_lands`, `_steps`, `_dx`, `_dy` | six curved rays: see [`paths`] |
//!
//! The cells are centred on the player and so lie across the tiles of the level. They are a picture with one pixel per
//! tile, with soft edges. Rows (r) go up from 0 at the bottom to 12, columns (c) from 0 at the left to 12. The player
//! is in the middle of cell (6, 6). Velocities are divided by their largest value. `cell_x` and `cell_y` are the
//! player's position in its tile, from -0.5 to 0.5, and `a` is the number of the held action.

use crate::coinrun::{
    paths,
    rules::{Body, ENEMY_SPEED, JUMP_SPEED, PlayerState, WALK_SPEED, is_supported},
    tile::{SIZE, TileGrid},
};

pub use crate::coinrun::tile::{REACH, SIDE};

/// Cells in view.
pub const CELLS: usize = SIDE * SIDE;

/// Enemies that are listed by themselves.
pub const LISTED_ENEMIES: usize = 3;

/// Values about the player's motion.
const MOTION: usize = 8;

/// Number of values.
pub const LENGTH: usize = 3 * CELLS + 3 + 3 * LISTED_ENEMIES + MOTION + paths::HELD.len() * paths::VALUES;

/// An arena in one tick.
pub struct Scene<'a> {
    /// Ground, lava, coin.
    pub tiles: &'a TileGrid,
    /// The player.
    pub player: &'a Body,
    /// The player's memory.
    pub memory: PlayerState,
    /// Cell of the coin.
    pub coin: [i32; 2],
    /// Crates.
    pub crates: &'a [Body],
    /// Saws.
    pub saws: &'a [Body],
    /// Enemies.
    pub enemies: &'a [Body],
}

/// Returns the names of the values, in order.
pub fn names() -> Vec<String> {
    let mut names = Vec::with_capacity(LENGTH);
    for plane in ["wall", "crate", "danger"] {
        names.extend((0..CELLS).map(|cell| format!("{plane}_{}_{}", cell / SIDE, cell % SIDE)));
    }
    names.extend(["coin_seen", "coin_dx", "coin_dy"].map(String::from));
    for enemy in 0..LISTED_ENEMIES {
        names.extend(["dx", "dy", "vx"].map(|part| format!("enemy_{enemy}_{part}")));
    }
    let motion = ["vx", "vy", "cell_x", "cell_y", "supported", "rising", "on_crate", "faces_left"];
    names.extend(motion.map(String::from));
    for action in paths::HELD {
        names.extend(paths::NAMES.map(|part| format!("hold_{action}_{part}")));
    }
    names
}

impl Scene<'_> {
    /// Writes the observation, `[LENGTH]`, over the contents of `out`. The surroundings are scratch space.
    pub fn fill(&self, surroundings: &mut paths::Surroundings, out: &mut Vec<f32>) {
        out.clear();
        out.resize(LENGTH, 0.0);
        let (walls, rest) = out.split_at_mut(CELLS);
        let (crates, rest) = rest.split_at_mut(CELLS);
        let (danger, rest) = rest.split_at_mut(CELLS);
        let (coin, rest) = rest.split_at_mut(3);
        let (listed, rest) = rest.split_at_mut(3 * LISTED_ENEMIES);
        let (motion, rays) = rest.split_at_mut(MOTION);
        self.fill_cells(walls, crates, danger);
        self.fill_coin(coin);
        self.list_enemies(listed);
        self.fill_motion(motion);
        surroundings.follow(self.player, &self.memory, self.tiles, self.crates, self.saws, self.enemies, rays);
    }

    fn fill_cells(&self, walls: &mut [f32], crates: &mut [f32], danger: &mut [f32]) {
        let cells = Cells::around(self.player.x, self.player.y);
        cells.fill(self.tiles.wall_rows(), u64::MAX, walls);
        cells.fill(self.tiles.lava_rows(), 0, danger);
        for body in self.crates {
            cells.cover(body.x - body.rx, body.y - body.ry, crates);
        }
        for body in self.saws.iter().chain(self.enemies) {
            cells.cover(body.x - body.rx, body.y - body.ry, danger);
        }
    }

    /// Returns the offset from the player in half views, if it is in view.
    fn in_view(&self, x: f32, y: f32) -> Option<(f32, f32)> {
        let reach = REACH as f32 + 0.5;
        let (dx, dy) = ((x - self.player.x) / reach, (y - self.player.y) / reach);
        (dx.abs() <= 1.0 && dy.abs() <= 1.0).then_some((dx, dy))
    }

    fn fill_coin(&self, out: &mut [f32]) {
        if let Some((dx, dy)) = self.in_view(self.coin[0] as f32 + 0.5, self.coin[1] as f32 + 0.5) {
            out.copy_from_slice(&[1.0, dx, dy]);
        }
    }

    fn list_enemies(&self, out: &mut [f32]) {
        let mut nearest = [(f32::INFINITY, [0.0; 3]); LISTED_ENEMIES];
        for enemy in self.enemies {
            let Some((dx, dy)) = self.in_view(enemy.x, enemy.y) else { continue };
            let mut seen = (dx * dx + dy * dy, [dx, dy, enemy.vx / ENEMY_SPEED]);
            let mut is_in_front = false;
            for place in &mut nearest {
                // Of two equally near enemies, the first stays in front. All behind move on by one index.
                is_in_front |= seen.0 < place.0;
                if is_in_front {
                    std::mem::swap(place, &mut seen);
                }
            }
        }
        for (slot, (_, values)) in out.chunks_exact_mut(3).zip(nearest) {
            slot.copy_from_slice(&values);
        }
    }

    fn fill_motion(&self, out: &mut [f32]) {
        let flag = |is: bool| f32::from(u8::from(is));
        let player = self.player;
        out.copy_from_slice(&[
            player.vx / WALK_SPEED,
            player.vy / JUMP_SPEED,
            player.x - player.x.floor() - 0.5,
            player.y - player.y.floor() - 0.5,
            flag(is_supported(player, &self.memory, self.tiles)),
            flag(player.vy > 0.0),
            flag(self.memory.on_crate),
            flag(self.memory.faces_left),
        ]);
    }
}

// The coverage of the cells of a view by squares.

/// One tile more than cells, since the edge of the view cuts through tiles; and room for whole registers.
const WIDE: usize = 16;

/// The cells of a view, which lie across the tiles of the level.
#[derive(Clone, Copy, Debug)]
struct Cells {
    /// Left and bottom edge of the view, in tiles.
    left: f32,
    bottom: f32,
}

impl Cells {
    /// Returns the cells around the centre of a player.
    pub fn around(x: f32, y: f32) -> Self {
        let reach = REACH as f32 + 0.5;
        Self { left: x - reach, bottom: y - reach }
    }

    /// Fills an empty plane, `[SIDE × SIDE]`, from the tiles whose bits are set in `rows`. `outside` gives the bits
    /// beyond the rows: all set or all clear.
    ///
    /// It adds for each cell the sums of [`cover`](Self::cover) for each tile, in the same order.
    pub fn fill(&self, rows: &[u64; SIZE as usize], outside: u64, plane: &mut [f32]) {
        let (left, bottom) = (self.left.floor(), self.bottom.floor());
        let (across, up) = (shares(left, self.left), shares(bottom, self.bottom));
        let tiles = |row: usize| {
            let at = bottom as i32 + row as i32;
            let bits = usize::try_from(at).ok().and_then(|at| rows.get(at).copied()).unwrap_or(outside);
            window(bits, outside, left as i32)
        };
        let mut low = tiles(0);
        for (row, cells) in plane.chunks_exact_mut(SIDE).enumerate() {
            let high = tiles(row + 1);
            if low | high != 0 {
                let sums = [(low, up.own[row]), (high, up.next[row])];
                fill_row(sums, &across, cells);
            }
            low = high;
        }
    }

    /// Adds the square of one tile whose bottom left corner is (x, y) to the up to four cells it lies in, by area.
    pub fn cover(&self, x: f32, y: f32, plane: &mut [f32]) {
        let reach = -1.0..SIDE as f32;
        if !reach.contains(&(x - self.left)) || !reach.contains(&(y - self.bottom)) {
            return;
        }
        let (column, row) = ((x - self.left).floor(), (y - self.bottom).floor());
        let (right_share, upper_share) = (x - self.left - column, y - self.bottom - row);
        let side = SIDE as i32;
        for (row, height) in [(row as i32, 1.0 - upper_share), (row as i32 + 1, upper_share)] {
            for (column, width) in [(column as i32, 1.0 - right_share), (column as i32 + 1, right_share)] {
                if (0..side).contains(&row) && (0..side).contains(&column) {
                    let cell = &mut plane[(row * side + column) as usize];
                    *cell = (*cell + width * height).min(1.0);
                }
            }
        }
    }
}

/// Coverage of each cell of a row or a column by the tile of its own number, and by the next tile.
struct Shares {
    own: [f32; WIDE],
    next: [f32; WIDE],
}

/// Shares of the cells that begin at `edge`. Tile 0 begins at `first`, at most one to the left of it.
fn shares(first: f32, edge: f32) -> Shares {
    let (mut own, mut before) = ([0.0; WIDE], [0.0; WIDE + 1]);
    for tile in 0..=SIDE {
        let at = first + tile as f32 - edge;
        // The tile begins in the cell before its own one, or just where that one begins: then it covers all of it.
        let share = at - (tile as f32 - 1.0);
        (own[tile], before[tile]) = (share, 1.0 - share);
    }
    Shares { own, next: std::array::from_fn(|cell| before[cell + 1]) }
}

/// Returns the bits of the tiles from column `left` on, the first lowest.
fn window(bits: u64, outside: u64, left: i32) -> u32 {
    let beyond = u128::from(outside);
    let wide = (beyond << 64 | u128::from(bits)).rotate_right(left.clamp(-SIZE, SIZE).rem_euclid(128) as u32);
    wide as u32 & ((1 << (SIDE + 1)) - 1)
}

/// Sums the coverage of a row of cells by the tiles of two rows. The order is from left to right and from the low row
/// to the high one.
fn fill_row(rows: [(u32, f32); 2], across: &Shares, cells: &mut [f32]) {
    let mut sums = [0.0_f32; WIDE];
    for (bits, height) in rows {
        let is_set: [f32; WIDE] = std::array::from_fn(|tile| if bits & 1 << tile != 0 { height } else { 0.0 });
        let is_next_set: [f32; WIDE] = std::array::from_fn(|tile| if bits & 2 << tile != 0 { height } else { 0.0 });
        for cell in 0..WIDE {
            sums[cell] = most_one(sums[cell] + across.own[cell] * is_set[cell]);
            sums[cell] = most_one(sums[cell] + across.next[cell] * is_next_set[cell]);
        }
    }
    cells.copy_from_slice(&sums[..SIDE]);
}

fn most_one(value: f32) -> f32 {
    if value < 1.0 { value } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{Level, Mode, generator::generate};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Returns a level with a player and no other body.
    fn empty<'a>(level: &'a Level, player: &'a Body) -> Scene<'a> {
        let (tiles, coin, memory) = (&level.tiles, level.coin, PlayerState::default());
        Scene { tiles, player, memory, coin, crates: &[], saws: &[], enemies: &[] }
    }

    fn filled(scene: &Scene<'_>) -> Vec<f32> {
        let mut out = Vec::new();
        scene.fill(&mut paths::Surroundings::default(), &mut out);
        out
    }

    fn seen(level: &Level, player: &Body) -> Vec<f32> {
        filled(&Scene {
            crates: &[Body::block([3, 1])],
            saws: &[Body::block([4, 1])],
            enemies: &[Body { x: 5.75, ..Body::enemy([5, 1], -1) }],
            ..empty(level, player)
        })
    }

    fn value(values: &[f32], name: &str) -> f32 {
        values[names().iter().position(|known| known == name).expect("a known name")]
    }

    #[test]
    fn names_and_values_have_the_documented_length() {
        assert_eq!(names().len(), LENGTH);
        assert_eq!(LENGTH, 563);
        assert_eq!(seen(&generate(Mode::Hard, 0), &Body::player()).len(), LENGTH);
    }

    #[test]
    fn the_start_looks_as_it_should() {
        let level = generate(Mode::Hard, 0);
        // In the middle of tile (1, 1), so that cells and tiles lie on each other: the player is in cell (6, 6).
        let player = Body { x: 1.5, y: 1.5, ..Body::player() };
        let values = seen(&level, &player);
        assert_eq!(value(&values, "wall_5_6"), 1.0, "the floor");
        assert_eq!(value(&values, "wall_6_6"), 0.0, "the player's cell");
        assert_eq!(value(&values, "wall_6_5"), 1.0, "the left wall");
        assert_eq!(value(&values, "wall_6_4"), 1.0, "outside");
        assert_eq!(value(&values, "crate_6_8"), 1.0);
        assert_eq!(value(&values, "danger_6_9"), 1.0, "the saw");
        // The enemy covers x from 5.25 to 6.25: three quarters of one cell, one quarter of the next.
        assert_eq!((value(&values, "danger_6_10"), value(&values, "danger_6_11")), (0.75, 0.25));
        assert_eq!(value(&values, "enemy_0_vx"), -1.0);
        assert_eq!(value(&values, "coin_seen"), 0.0);
    }

    #[test]
    fn edges_are_soft_where_cells_lie_across_tiles() {
        let level = generate(Mode::Hard, 0);
        let values = seen(&level, &Body { x: 1.75, y: 1.5, ..Body::player() });
        // Cell (6, 5) now covers x from 0.25 to 1.25, of which 0.25 to 1 is the left wall.
        assert_eq!(value(&values, "wall_6_5"), 0.75);
    }

    #[test]
    fn paths_tell_death_from_a_safe_jump() {
        let level = Level::from_text("#...........C#\n#A.....S.....#\n##############\n").expect("a picture");
        let player = Body { x: 5.0, vx: 0.5, ..Body::player() };
        let out = filled(&Scene { saws: &[Body::block([7, 1])], ..empty(&level, &player) });
        assert_eq!(value(&out, "hold_7_dies"), 1.0, "walking on meets the saw");
        assert_eq!(value(&out, "hold_8_dies"), 0.0, "a jump clears it");
        assert_eq!(value(&out, "hold_1_dies"), 0.0, "turning back is safe");
    }

    #[test]
    fn the_nearest_enemies_are_listed_in_order() {
        let level = generate(Mode::Hard, 0);
        let player = Body { x: 20.5, y: 1.5, ..Body::player() };
        let enemies = [24, 18, 27, 22, 21].map(|x| Body::enemy([x, 1], if x == 18 { -1 } else { 1 }));
        let out = filled(&Scene { enemies: &enemies, ..empty(&level, &player) });
        let listed = [0, 1, 2].map(|enemy| (value(&out, &format!("enemy_{enemy}_dx")) * 6.5).round());
        assert_eq!(listed, [1.0, -2.0, 2.0], "of two as near as each other, the first made comes first");
        assert_eq!(value(&out, "enemy_1_vx"), -1.0);
    }

    #[test]
    fn the_coin_comes_into_view() {
        let level = generate(Mode::Hard, 0);
        let player = Body { x: level.coin[0] as f32 - 2.5, y: level.coin[1] as f32 + 0.5, ..Body::player() };
        let values = seen(&level, &player);
        assert_eq!(value(&values, "coin_seen"), 1.0);
        assert!((value(&values, "coin_dx") - 3.0 / 6.5).abs() < 1e-6);
    }

    /// Fills tile by tile: the reference of [`Cells::fill`], which must equal it to the bit.
    fn fill_tile_by_tile(cells: &Cells, rows: &[u64; SIZE as usize], outside: u64) -> Vec<f32> {
        let mut plane = vec![0.0; SIDE * SIDE];
        for row in 0..=SIDE as i32 {
            for column in 0..=SIDE as i32 {
                let (x, y) = (cells.left.floor() as i32 + column, cells.bottom.floor() as i32 + row);
                let is_inside = (0..SIZE).contains(&x) && (0..SIZE).contains(&y);
                let bits = if is_inside { rows[y as usize] >> x } else { outside };
                if bits & 1 == 1 {
                    cells.cover(x as f32, y as f32, &mut plane);
                }
            }
        }
        plane
    }

    #[test]
    fn a_filled_plane_is_the_sum_of_its_tiles() {
        let mut draw = ChaCha8Rng::seed_from_u64(3);
        for case in 0..20_000 {
            let density = draw.random_range(0..3);
            let rows: [u64; SIZE as usize] = std::array::from_fn(|_| match density {
                0 => draw.random(),
                1 => draw.random::<u64>() & draw.random::<u64>() & draw.random::<u64>(),
                _ => draw.random::<u64>() | draw.random::<u64>() | draw.random::<u64>(),
            });
            let mut place = || {
                let value: f32 = draw.random_range(-2.0..66.0);
                let edge = value.floor() + 0.5;
                [value, edge, edge.next_up(), edge.next_down(), value, value, value.floor(), 6.5 + value * 1e-9]
                    [case % 8]
            };
            let cells = Cells::around(place(), place());
            for outside in [0, u64::MAX] {
                let mut plane = vec![0.0; SIDE * SIDE];
                cells.fill(&rows, outside, &mut plane);
                let plain = fill_tile_by_tile(&cells, &rows, outside);
                let bits = |plane: &[f32]| plane.iter().map(|share| share.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&plane), bits(&plain), "{cells:?}");
            }
        }
    }

    #[test]
    fn tiles_out_of_view_cover_nothing() {
        let cells = Cells::around(10.5, 10.5);
        for (x, y, is_seen) in [(3.0, 10.0, false), (3.5, 10.0, true), (16.5, 10.0, true), (17.0, 10.0, false)] {
            for (x, y) in [(x, y), (y, x)] {
                let mut plane = vec![0.0; SIDE * SIDE];
                cells.cover(x, y, &mut plane);
                assert_eq!(plane.iter().any(|&share| share > 0.0), is_seen, "{x} {y}");
            }
        }
    }
}
