//! The tiles and inhabitants of a level, section after section.

use super::{
    draw::Draw,
    themes::{CRATE_SPRITES, ENEMY_SPRITES},
};
use crate::coinrun::{
    level::Mode,
    spawn::Spawn,
    tile::{SIZE, Tile, TileGrid},
};

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
pub(super) struct Built {
    pub(super) tiles: TileGrid,
    /// The cell of the coin.
    pub(super) coin: [i32; 2],
    /// Inhabitants of the level.
    pub(super) spawns: Vec<Spawn>,
}

/// A level under construction. The cursor (`x`, `y`) is the column where the next section starts
/// and the height of the ground there.
pub(super) struct Builder<'a> {
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
    pub(super) fn new(mode: Mode, draw: &'a mut Draw) -> Self {
        Self { mode, draw, tiles: empty_room(), spawns: Vec::new(), difficulty: 0, danger: Danger::Lava, x: 5, y: 1 }
    }

    /// Draws and builds all sections.
    pub(super) fn build(mut self) -> Built {
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
