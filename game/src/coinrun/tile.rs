//! The tiles of a level and the 64 x 64 grid that holds them.

use std::fmt;

/// Width and height of every level, in tiles.
pub const SIZE: i32 = 64;

const CELLS: usize = (SIZE * SIZE) as usize;

/// The material of one cell of the grid.
#[repr(u8)]
#[derive(Clone, Copy, Eq, PartialEq, Debug)]
pub enum Tile {
    /// Free space.
    Empty,
    /// Inner ground, which also fills the outside of the grid, so it blocks every moving body.
    Wall,
    /// Ground surface. Blocks the player and turns enemies.
    WallTop,
    /// Inner lava. Kills the player.
    Lava,
    /// Lava surface. Kills the player.
    LavaTop,
    /// The goal.
    Coin,
    /// Invisible to the player; turns enemies.
    Barrier,
}

impl Tile {
    const ALL: [Tile; 7] =
        [Tile::Empty, Tile::Wall, Tile::WallTop, Tile::Lava, Tile::LavaTop, Tile::Coin, Tile::Barrier];

    /// Returns true if this is ground, inner or surface.
    #[inline]
    pub const fn is_wall(self) -> bool {
        matches!(self, Tile::Wall | Tile::WallTop)
    }

    /// Returns true if this is lava, inner or surface.
    #[inline]
    pub const fn is_lava(self) -> bool {
        matches!(self, Tile::Lava | Tile::LavaTop)
    }

    /// Returns true if enemies turn around at this tile.
    #[inline]
    pub const fn turns_enemies(self) -> bool {
        self.is_wall() || matches!(self, Tile::Barrier)
    }

    /// Returns the letter of this tile in level pictures: one of `.#=~^C|`, in the order of the variants.
    pub const fn to_char(self) -> char {
        match self {
            Tile::Empty => '.',
            Tile::Wall => '#',
            Tile::WallTop => '=',
            Tile::Lava => '~',
            Tile::LavaTop => '^',
            Tile::Coin => 'C',
            Tile::Barrier => '|',
        }
    }

    /// Returns the tile with this letter, or `None` for any other letter.
    pub fn from_char(letter: char) -> Option<Tile> {
        Self::ALL.into_iter().find(|tile| tile.to_char() == letter)
    }
}

/// A grid of [`SIZE`] x [`SIZE`] tiles; x points right, y points up, (0, 0) is the bottom left.
///
/// Tile (i, j) covers `[i, i+1) x [j, j+1)`. Everything outside is [`Tile::Wall`].
#[derive(Clone, PartialEq, Eq)]
pub struct TileGrid {
    tiles: Box<[Tile; CELLS]>,
    /// For each row, bit `x` is set where the player is blocked. Kept for speed.
    walls: Box<[u64; SIZE as usize]>,
    /// For each row, bit `x` is set where enemies turn around. Kept for speed.
    turns: Box<[u64; SIZE as usize]>,
    /// For each row, bit `x` is set where lava is. Kept for speed.
    lava: Box<[u64; SIZE as usize]>,
    /// For each row, bit `x` is set where the player's touch ends the episode: lava and coin. Kept for speed.
    ends: Box<[u64; SIZE as usize]>,
}

impl fmt::Debug for TileGrid {
    /// Prints the rows, top first.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.rows().iter().rev()).finish()
    }
}

impl Default for TileGrid {
    /// Returns an empty grid.
    fn default() -> Self {
        Self {
            tiles: Box::new([Tile::Empty; CELLS]),
            walls: Box::new([0; SIZE as usize]),
            turns: Box::new([0; SIZE as usize]),
            lava: Box::new([0; SIZE as usize]),
            ends: Box::new([0; SIZE as usize]),
        }
    }
}

/// The left and right columns and the low and high rows of a rectangle's corners, in tiles.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Corners {
    /// x of the left corners.
    pub left: f32,
    /// x of the right corners.
    pub right: f32,
    /// y of the low corners.
    pub low: f32,
    /// y of the high corners.
    pub high: f32,
}

impl Corners {
    #[inline]
    fn is_inside(&self) -> bool {
        let size = SIZE as f32;
        self.left >= 0.0 && self.low >= 0.0 && self.right < size && self.high < size
    }

    /// Returns true if a corner is in a cell whose bit is set. The outside counts as set.
    #[inline]
    fn hit(&self, rows: &[u64; SIZE as usize]) -> bool {
        if !self.is_inside() {
            return true;
        }
        let columns = 1 << (self.left as u32 & 63) | 1 << (self.right as u32 & 63);
        (rows[self.low as usize & 63] | rows[self.high as usize & 63]) & columns != 0
    }

    /// Returns true if the rectangle lies inside and no cell that it reaches into has its bit set.
    #[inline]
    fn misses(&self, rows: &[u64; SIZE as usize]) -> bool {
        if !self.is_inside() {
            return false;
        }
        let (low, high) = (self.low as usize & 63, self.high as usize & 63);
        // A player spans up to four rows in a step.
        let few = rows[low] | rows[high.min(low + 1)] | rows[high.min(low + 2)] | rows[high];
        let more = if high > low + 3 { (low + 3..high).fold(0, |more, row| more | rows[row]) } else { 0 };
        (few | more) & self.columns() == 0
    }

    /// Returns the columns from left to right of a rectangle inside.
    #[inline]
    fn columns(&self) -> u64 {
        (u64::MAX << (self.left as u32 & 63)) & (u64::MAX >> (63 - (self.right as u32 & 63)))
    }
}

impl TileGrid {
    #[inline]
    fn index(x: i32, y: i32) -> Option<usize> {
        // One comparison per axis: a negative coordinate becomes a huge unsigned one.
        ((x as u32) < SIZE as u32 && (y as u32) < SIZE as u32).then_some((y * SIZE + x) as usize)
    }

    /// Returns the tile in column `x`, row `y`; [`Tile::Wall`] outside the grid.
    #[inline]
    pub fn get(&self, x: i32, y: i32) -> Tile {
        Self::index(x, y).map_or(Tile::Wall, |i| self.tiles[i])
    }

    /// Returns the tile that covers the point (`x`, `y`), in tiles; [`Tile::Wall`] outside the grid.
    #[inline]
    pub fn at(&self, x: f32, y: f32) -> Tile {
        if x < 0.0 || y < 0.0 {
            return Tile::Wall;
        }
        // Truncation is the floor for numbers that are not negative.
        self.get(x as i32, y as i32)
    }

    /// Returns true if one of the corners lies in a wall.
    #[inline]
    pub fn blocks_player(&self, corners: &Corners) -> bool {
        corners.hit(&self.walls)
    }

    /// Returns true if enemies turn around at one of the corners.
    #[inline]
    pub fn turns_enemy(&self, corners: &Corners) -> bool {
        corners.hit(&self.turns)
    }

    /// Returns true if the rectangle lies inside and nowhere in a wall.
    #[inline]
    pub fn is_clear(&self, rectangle: &Corners) -> bool {
        rectangle.misses(&self.walls)
    }

    /// Returns true if the rectangle lies inside and touches neither lava nor the coin.
    #[inline]
    pub fn has_no_ends(&self, rectangle: &Corners) -> bool {
        rectangle.misses(&self.ends)
    }

    /// Returns the ground of each row: bit `x` is set where ground is.
    pub fn wall_rows(&self) -> &[u64; SIZE as usize] {
        &self.walls
    }

    /// Returns the lava of each row: bit `x` is set where lava is.
    pub fn lava_rows(&self) -> &[u64; SIZE as usize] {
        &self.lava
    }

    /// Returns true if one of the corners lies in a tile of the same kind as the outside: inner ground.
    #[inline]
    pub fn is_outside(&self, corners: &Corners) -> bool {
        let Corners { left, right, low, high } = *corners;
        let points = [(left, low), (left, high), (right, low), (right, high)];
        points.into_iter().any(|(x, y)| self.at(x, y) == Tile::Wall)
    }

    /// Replaces one tile. A cell outside the grid is ignored.
    pub fn set(&mut self, x: i32, y: i32, tile: Tile) {
        if let Some(i) = Self::index(x, y) {
            self.tiles[i] = tile;
            let assign = |row: &mut u64, on: bool| *row = *row & !(1 << x) | u64::from(on) << x;
            assign(&mut self.walls[y as usize], tile.is_wall());
            assign(&mut self.turns[y as usize], tile.turns_enemies());
            assign(&mut self.lava[y as usize], tile.is_lava());
            assign(&mut self.ends[y as usize], tile.is_lava() || tile == Tile::Coin);
        }
    }

    /// Replaces a block of `width` x `height` tiles whose bottom left cell is (`x`, `y`).
    pub fn fill(&mut self, x: i32, y: i32, width: i32, height: i32, tile: Tile) {
        for column in x..x + width {
            for row in y..y + height {
                self.set(column, row, tile);
            }
        }
    }

    /// Returns all tiles, bottom row first, each from left to right.
    pub fn iter(&self) -> impl Iterator<Item = Tile> {
        self.tiles.iter().copied()
    }

    /// Returns the grid as 64 strings of 64 letters. The first string is the bottom row.
    pub fn rows(&self) -> Vec<String> {
        self.tiles.chunks(SIZE as usize).map(|row| row.iter().map(|tile| tile.to_char()).collect()).collect()
    }
}

/// Tiles from the player's cell to the edge of the view.
pub const REACH: i32 = 6;

/// Width and height of the view, in tiles.
pub const SIDE: usize = 13;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_read_back() {
        for tile in Tile::ALL {
            assert_eq!(Tile::from_char(tile.to_char()), Some(tile));
        }
        assert_eq!(Tile::from_char('x'), None);
    }

    #[test]
    fn outside_is_wall() {
        let grid = TileGrid::default();
        assert_eq!(grid.get(0, 0), Tile::Empty);
        for (x, y) in [(-1, 0), (0, -1), (SIZE, 0), (0, SIZE)] {
            assert_eq!(grid.get(x, y), Tile::Wall);
        }
        assert_eq!(grid.at(-0.25, 3.0), Tile::Wall);
        assert_eq!(grid.at(63.999, 0.0), Tile::Empty);
        assert_eq!(grid.at(64.0, 0.0), Tile::Wall);
    }

    #[test]
    fn corners_see_what_the_tiles_say() {
        let mut grid = TileGrid::default();
        let square = |x: f32, y: f32| Corners { left: x, right: x + 0.98, low: y, high: y + 0.98 };
        grid.set(5, 5, Tile::Barrier);
        grid.set(7, 7, Tile::WallTop);
        assert!(grid.turns_enemy(&square(4.5, 4.5)) && !grid.blocks_player(&square(4.5, 4.5)));
        assert!(grid.blocks_player(&square(7.5, 6.5)) && !grid.is_outside(&square(7.5, 6.5)));
        assert!(!grid.turns_enemy(&square(5.5, 6.25)));
        for outside in [square(-0.1, 3.0), square(63.5, 3.0), square(3.0, 63.5)] {
            assert!(grid.blocks_player(&outside) && grid.is_outside(&outside));
        }
        grid.set(7, 7, Tile::Empty);
        assert!(!grid.blocks_player(&square(7.0, 7.0)));
    }

    #[test]
    fn rows_start_at_the_bottom() {
        let mut grid = TileGrid::default();
        grid.set(2, 0, Tile::Coin);
        assert!(grid.rows()[0].starts_with("..C."));
    }
}
