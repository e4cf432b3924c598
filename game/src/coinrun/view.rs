//! What a player sees, as numbers: the 13 × 13 tiles around the player and the player's own motion.
//!
//! | values | name | meaning |
//! |---|---|---|
//! | 169 | `wall_r_c` | 1 where the cell is ground (everything outside the level is) |
//! | 169 | `crate_r_c` | 1 where a crate stands |
//! | 169 | `danger_r_c` | lava and saws 1; an enemy fills the cells it overlaps by its share of their width |
//! | 3 | `coin_seen`, `coin_dx`, `coin_dy` | whether the coin is in view, and how far away in half views |
//! | 9 | `enemy_i_dx`, `_dy`, `_vx` | the 3 nearest enemies in view, nearest first; 0 where there are fewer |
//! | 8 | `vx`, `vy`, `cell_x`, `cell_y`, `supported`, `rising`, `on_crate`, `faces_left` | the player |
//!
//! Rows (r) go up from 6 below the player's cell to 6 above it, columns (c) from 6 to the left to 6 to the right.
//! Velocities are divided by their largest value, positions inside the cell lie between -0.5 and 0.5.

use super::{
    PlayerState, Tile, TileGrid,
    rules::{Body, ENEMY_SPEED, JUMP_SPEED, WALK_SPEED, is_supported},
};

/// Tiles from the player's cell to the edge of the view.
pub const REACH: i32 = 6;
/// Width and height of the view, in tiles.
pub const SIDE: usize = 13;
/// Cells in view.
pub const CELLS: usize = SIDE * SIDE;
/// Enemies that are listed by themselves.
pub const LISTED_ENEMIES: usize = 3;
/// Number of values.
pub const LENGTH: usize = 3 * CELLS + 3 + 3 * LISTED_ENEMIES + 8;

/// An arena at one moment.
pub struct Scene<'a> {
    /// Ground, lava, coin.
    pub tiles: &'a TileGrid,
    /// The player.
    pub player: &'a Body,
    /// What the player remembers.
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

/// Names of the values, in order.
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
    names
}

impl Scene<'_> {
    /// Writes the observation, `[LENGTH]`, over whatever was in `out`.
    pub fn fill(&self, out: &mut Vec<f32>) {
        out.clear();
        out.resize(LENGTH, 0.0);
        let (walls, rest) = out.split_at_mut(CELLS);
        let (crates, rest) = rest.split_at_mut(CELLS);
        let (danger, rest) = rest.split_at_mut(CELLS);
        let (coin, rest) = rest.split_at_mut(3);
        let (listed, motion) = rest.split_at_mut(3 * LISTED_ENEMIES);
        self.fill_tiles(walls, danger);
        self.fill_bodies(crates, danger);
        self.fill_coin(coin);
        self.list_enemies(listed);
        self.fill_motion(motion);
    }

    /// Bottom left cell of the view.
    fn corner(&self) -> (i32, i32) {
        (self.player.x.floor() as i32 - REACH, self.player.y.floor() as i32 - REACH)
    }

    fn fill_tiles(&self, walls: &mut [f32], danger: &mut [f32]) {
        let (left, bottom) = self.corner();
        for cell in 0..CELLS {
            match self.tiles.get(left + (cell % SIDE) as i32, bottom + (cell / SIDE) as i32) {
                Tile::Wall | Tile::WallTop => walls[cell] = 1.0,
                Tile::Lava | Tile::LavaTop => danger[cell] = 1.0,
                Tile::Empty | Tile::Coin | Tile::Barrier => {}
            }
        }
    }

    fn fill_bodies(&self, crates: &mut [f32], danger: &mut [f32]) {
        for body in self.crates {
            self.cover(body, crates);
        }
        for body in self.saws.iter().chain(self.enemies) {
            self.cover(body, danger);
        }
    }

    /// Marks the cells under a body of one tile by the share of their width that it covers.
    fn cover(&self, body: &Body, plane: &mut [f32]) {
        let (left, bottom) = self.corner();
        let row = body.y.floor() as i32 - bottom;
        let start = body.x - body.rx;
        let column = start.floor() as i32 - left;
        let right_share = start - start.floor();
        for (column, share) in [(column, 1.0 - right_share), (column + 1, right_share)] {
            let inside = (0..SIDE as i32).contains(&column) && (0..SIDE as i32).contains(&row);
            if inside && share > 0.0 {
                let cell = &mut plane[row as usize * SIDE + column as usize];
                *cell = share.max(*cell);
            }
        }
    }

    /// Offset from the player in half views, if it is in view.
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
        let mut seen: Vec<(f32, [f32; 3])> = self
            .enemies
            .iter()
            .filter_map(|enemy| {
                let (dx, dy) = self.in_view(enemy.x, enemy.y)?;
                Some((dx * dx + dy * dy, [dx, dy, enemy.vx / ENEMY_SPEED]))
            })
            .collect();
        seen.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (slot, (_, values)) in out.chunks_exact_mut(3).zip(seen) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{Level, Mode, generate};

    fn seen(level: &Level, player: &Body) -> Vec<f32> {
        let mut out = Vec::new();
        let scene = Scene {
            tiles: &level.tiles,
            player,
            memory: PlayerState::default(),
            coin: level.coin,
            crates: &[Body::block([3, 1])],
            saws: &[Body::block([4, 1])],
            enemies: &[Body { x: 5.75, ..Body::enemy([5, 1], -1) }],
        };
        scene.fill(&mut out);
        out
    }

    fn value(values: &[f32], name: &str) -> f32 {
        values[names().iter().position(|known| known == name).expect("a known name")]
    }

    #[test]
    fn names_and_values_have_the_documented_length() {
        assert_eq!(names().len(), LENGTH);
        assert_eq!(LENGTH, 527);
        assert_eq!(seen(&generate(Mode::Hard, 0), &Body::player()).len(), LENGTH);
    }

    #[test]
    fn the_start_looks_as_it_should() {
        let level = generate(Mode::Hard, 0);
        let values = seen(&level, &Body::player());
        // The player stands in cell (1, 1), which is row 6, column 6 of the view.
        assert_eq!(value(&values, "wall_5_6"), 1.0, "the floor");
        assert_eq!(value(&values, "wall_6_6"), 0.0, "the player's cell");
        assert_eq!(value(&values, "wall_6_5"), 1.0, "the left wall");
        assert_eq!(value(&values, "wall_6_4"), 1.0, "outside");
        assert_eq!(value(&values, "crate_6_8"), 1.0);
        assert_eq!(value(&values, "danger_6_9"), 1.0, "the saw");
        // The enemy covers x from 5.25 to 6.25: three quarters of one cell, one quarter of the next.
        assert_eq!((value(&values, "danger_6_10"), value(&values, "danger_6_11")), (0.75, 0.25));
        assert_eq!(value(&values, "enemy_0_vx"), -1.0);
        assert_eq!((value(&values, "supported"), value(&values, "coin_seen")), (1.0, 0.0));
    }

    #[test]
    fn the_coin_comes_into_view() {
        let level = generate(Mode::Hard, 0);
        let player = Body { x: level.coin[0] as f32 - 2.5, y: level.coin[1] as f32 + 0.5, ..Body::player() };
        let values = seen(&level, &player);
        assert_eq!(value(&values, "coin_seen"), 1.0);
        assert!((value(&values, "coin_dx") - 3.0 / 6.5).abs() < 1e-6);
    }
}
