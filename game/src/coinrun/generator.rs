//! Generator of levels from mode and seed, draw for draw as Procgen's CoinRun does.
//!
//! Every random decision takes one output of an mt19937 generator seeded with the level seed. So the order of the draws
//! is part of the result. A draw that is skipped or added changes the rest of the level.

use crate::coinrun::{
    level::{Level, LevelParts, Mode, Spawn},
    tile::{SIZE, Tile, TileGrid},
};
use rand_mt::Mt;

/// Returns the level of this mode and seed. Equal arguments give equal levels.
pub fn generate(mode: Mode, seed: u32) -> Level {
    let mut draw = Draw::new(seed);
    let background_offset = draw.unit();
    let mut background = draw.below(BACKGROUNDS as i32) as u8;
    // The original draws a random start position and then overwrites it.
    draw.unit();
    draw.unit();
    let (mut agent_theme, mut ground_theme) = (0, 0);
    match mode {
        Mode::Easy => background = 0,
        Mode::Hard => {
            agent_theme = draw.below(AGENT_THEMES as i32) as u8;
            ground_theme = draw.below(GROUND_THEMES as i32) as u8;
        }
    }
    let Built { tiles, coin, spawns } = Builder::new(mode, &mut draw).build();
    Level::new(LevelParts {
        mode,
        seed,
        tiles,
        coin,
        spawns,
        background,
        background_offset,
        agent_theme,
        ground_theme,
        tie_breaks: draw.tie_breaks(),
    })
}

// The tiles and inhabitants of a level, section after section.

/// The highest climb between two sections, in tiles.
const MAX_CLIMB: i32 = 5;

/// The widest pit, in tiles.
const MAX_PIT: i32 = 7;

/// No section starts within this many columns of the right border.
const SECTION_ROOM: i32 = 15;

/// From this height on, sections only go down.
const CEILING: i32 = 20;

/// The danger in the pits of a level. Each level has one kind.
#[derive(Clone, Copy)]
enum Danger {
    Lava,
    Saws,
    Enemies,
}

/// The result of a level's sections.
struct Built {
    tiles: TileGrid,
    /// The cell of the coin.
    coin: [i32; 2],
    /// Inhabitants of the level.
    spawns: Vec<Spawn>,
}

/// A level under construction. The cursor (`x`, `y`) is the column where the next section starts
/// and the height of the ground there.
struct Builder<'a> {
    mode: Mode,
    draw: &'a mut Draw,
    tiles: TileGrid,
    spawns: Vec<Spawn>,
    difficulty: i32,
    danger: Danger,
    x: i32,
    y: i32,
}

impl<'a> Builder<'a> {
    fn new(mode: Mode, draw: &'a mut Draw) -> Self {
        Self { mode, draw, tiles: empty_room(), spawns: Vec::new(), difficulty: 0, danger: Danger::Lava, x: 5, y: 1 }
    }

    /// Draws and builds all sections.
    fn build(mut self) -> Built {
        self.difficulty = self.draw.below(3) + 1;
        let sections = self.draw.below(self.difficulty) + self.difficulty;
        self.danger = match self.draw.below(3) {
            0 => Danger::Lava,
            1 => Danger::Saws,
            _ => Danger::Enemies,
        };
        for _ in 0..sections {
            if self.x + SECTION_ROOM >= SIZE {
                break;
            }
            self.section();
        }
        self.finish();
        Built { tiles: self.tiles, coin: [self.x, self.y], spawns: self.spawns }
    }

    /// Builds one section: a change of height, then a pit or a ground block, then barriers at both ends.
    fn section(&mut self) {
        let hardest = self.difficulty / 3;
        let mut climb = (self.draw.below(4) + 1 + hardest).min(MAX_CLIMB);
        if self.y >= CEILING || (self.y >= 5 && self.draw.below(2) == 1) {
            climb = -climb;
        }
        let width = self.draw.below(2 * self.difficulty) + 3 + hardest;
        self.y = (self.y + climb).max(1);
        // The last condition draws, so it must stay behind the other two.
        let is_pit = width > 7 && self.y > 3 && self.draw.below(20) >= self.difficulty;
        if is_pit {
            self.pit(width);
        } else {
            self.ground(self.x, width);
            self.obstacles(width);
        }
        if !self.tiles.get(self.x - 1, self.y).is_wall() {
            self.tiles.set(self.x - 1, self.y, Tile::Barrier);
        }
        self.x += width;
        self.tiles.set(self.x, self.y, Tile::Barrier);
    }

    /// Puts the coin on its column, and solid rock behind it.
    fn finish(&mut self) {
        // Replaces the barrier at the end of the last section.
        self.tiles.set(self.x, self.y, Tile::Coin);
        self.ground(self.x, 1);
        let behind = self.x + 1;
        self.tiles.fill(behind, 0, SIZE - behind, SIZE, Tile::Wall);
    }

    /// Builds two banks with a dangerous gap between them, and a platform over a wide gap.
    fn pit(&mut self, width: i32) {
        let left = self.draw.below(3) + 1;
        let mut right = self.draw.below(3) + 1;
        let mut gap = width - left - right;
        if gap > MAX_PIT {
            gap = MAX_PIT;
            right = width - left - gap;
        }
        self.ground(self.x, left);
        self.ground(self.x + width - right, right);
        let start = self.x + left;
        self.fill_pit(start, gap);
        if let Some((offset, length)) = self.platform(gap) {
            self.tiles.fill(start + offset, self.y - 1, length, 1, Tile::WallTop);
        }
    }

    fn fill_pit(&mut self, start: i32, gap: i32) {
        // Drawn for every kind of danger.
        let depth = self.draw.below(self.y - 3) + 1;
        match self.danger {
            Danger::Lava => {
                self.tiles.fill(start, 1, gap, depth - 1, Tile::Lava);
                self.tiles.fill(start, depth, gap, 1, Tile::LavaTop);
            }
            Danger::Saws => {
                for column in start..start + gap {
                    self.spawns.push(Spawn::Saw([column, 1]));
                }
            }
            Danger::Enemies => {
                for column in start..start + gap {
                    self.enemy(column, 1);
                }
            }
        }
    }

    /// Returns the offset from the left bank and length of the platform over a gap, in tiles.
    fn platform(&mut self, gap: i32) -> Option<(i32, i32)> {
        match gap {
            ..=4 => None,
            5 => Some((1 + self.draw.below(2), 1 + self.draw.below(2))),
            6 => Some((2 + self.draw.below(2), 1 + self.draw.below(2))),
            _ => {
                let left = 2 + self.draw.below(2);
                let right = 2 + self.draw.below(2);
                Some((left, gap - left - right))
            }
        }
    }

    /// Adds the saw, the enemy and the crates of a ground section.
    fn obstacles(&mut self, width: i32) {
        let mut taken = [None; 2];
        if self.draw.below(10) < 2 * self.difficulty && width > 3 {
            let column = self.inner_column(width);
            self.spawns.push(Spawn::Saw([column, self.y]));
            taken[0] = Some(column);
        }
        if self.draw.below(10) < self.difficulty && width > 3 && self.mode == Mode::Hard {
            let column = self.inner_column(width);
            self.enemy(column, self.y);
            taken[1] = Some(column);
        }
        for _ in 0..2 {
            let column = self.inner_column(width);
            if self.draw.below(2) == 1 && !taken.contains(&Some(column)) {
                self.crate_pile(column);
            }
        }
    }

    /// Returns a column of the section that is neither its first nor its last.
    fn inner_column(&mut self, width: i32) -> i32 {
        self.x + self.draw.below(width - 2) + 1
    }

    fn enemy(&mut self, x: i32, y: i32) {
        let dir = if self.draw.below(2) == 1 { 1 } else { -1 };
        let sprite = self.draw.below(ENEMY_SPRITES as i32) as u8;
        let cell = [x, y];
        self.spawns.push(Spawn::Enemy { cell, dir, sprite });
    }

    fn crate_pile(&mut self, column: i32) {
        for level in 0..self.draw.below(3) + 1 {
            let sprite = self.draw.below(CRATE_SPRITES as i32) as u8;
            let cell = [column, self.y + level];
            self.spawns.push(Spawn::Crate { cell, sprite });
        }
    }

    /// Fills solid ground under the cursor height, `width` columns from column `x` on.
    fn ground(&mut self, x: i32, width: i32) {
        self.tiles.fill(x, 0, width, self.y - 1, Tile::Wall);
        self.tiles.fill(x, self.y - 1, width, 1, Tile::WallTop);
    }
}

/// Returns the floor and the border. The sides and the top are drawn after the floor, so they own its corners.
fn empty_room() -> TileGrid {
    let mut tiles = TileGrid::default();
    tiles.fill(0, 0, SIZE, 1, Tile::WallTop);
    tiles.fill(0, 0, 1, SIZE, Tile::Wall);
    tiles.fill(SIZE - 1, 0, 1, SIZE, Tile::Wall);
    tiles.fill(0, SIZE - 1, SIZE, 1, Tile::Wall);
    tiles
}

// The random numbers of the generator, in the order in which they are drawn.

/// The random decisions of the generator.
struct Draw(Mt);

impl Draw {
    /// Returns the decisions of the level with this seed.
    fn new(seed: u32) -> Self {
        Self(Mt::new(seed))
    }

    /// Returns a uniform number in `0..high` (with the small modulo bias of the original). One output.
    fn below(&mut self, high: i32) -> i32 {
        (self.0.next_u32() % high as u32) as i32
    }

    /// Returns a uniform number in `[0, 1]`, rounded to f32. One output.
    fn unit(&mut self) -> f32 {
        (f64::from(self.0.next_u32()) / (f64::from(u32::MAX) + 1.0)) as f32
    }

    /// Returns the draws of the first 1024 steps, one output each. Bit `k` is set when step `k` (from 0) resolves a tie
    /// between the axes in favour of x.
    fn tie_breaks(&mut self) -> [u64; 16] {
        let mut bits = [0; 16];
        for step in 0..1024 {
            let even = self.0.next_u32().is_multiple_of(2);
            bits[step / 64] |= u64::from(even) << (step % 64);
        }
        bits
    }
}

/// Number of background pictures that the original draws from.
pub const BACKGROUNDS: u32 = 62;

/// Number of player colours.
pub const AGENT_THEMES: u32 = 5;

/// Number of ground themes.
pub const GROUND_THEMES: u32 = 6;

/// Number of enemy sprites.
pub const ENEMY_SPRITES: u32 = 9;

/// Number of crate sprites.
pub const CRATE_SPRITES: u32 = 4;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::{
        level::Spawn,
        tile::{SIZE, Tile},
    };

    #[test]
    fn corners_and_pits_keep_their_floor() {
        let level = generate(Mode::Hard, 1);
        assert_eq!(level.tiles.get(0, 0), Tile::Wall);
        assert_eq!(level.tiles.get(SIZE - 1, 0), Tile::Wall);
        assert_eq!(level.tiles.get(1, SIZE - 1), Tile::Wall);
        assert_eq!(level.tiles.get(1, 0), Tile::WallTop);
        // Ground of height 3 owns the bottom row, the pit from x = 24 on does not.
        assert_eq!(level.tiles.get(5, 0), Tile::Wall);
        assert_eq!(level.tiles.get(24, 0), Tile::WallTop);
    }

    #[test]
    fn the_coin_replaces_the_last_barrier() {
        for seed in 0..100 {
            let level = generate(Mode::Hard, seed);
            let [x, y] = level.coin;
            assert_eq!(level.tiles.get(x, y), Tile::Coin);
            assert_eq!(level.tiles.get(x, y - 1), Tile::WallTop);
            assert_eq!(level.tiles.get(x + 1, y), Tile::Wall);
        }
    }

    #[test]
    fn easy_and_hard_share_no_layout_draws() {
        let easy = generate(Mode::Easy, 0);
        let hard = generate(Mode::Hard, 0);
        assert_eq!(easy.coin, [21, 9]);
        assert_eq!(hard.coin, [16, 5]);
        assert_eq!((easy.background, easy.agent_theme), (0, 0));
    }

    #[test]
    fn easy_levels_have_no_enemies_outside_pits() {
        for seed in 0..200 {
            let level = generate(Mode::Easy, seed);
            for spawn in &level.spawns {
                if let Spawn::Enemy { cell, .. } = spawn {
                    assert_eq!(cell[1], 1);
                }
            }
        }
    }
}
