//! Levels as text, for people and for hand-made test levels.
//!
//! A picture has the top row first. Letters: `.` empty, `#` ground, `=` ground surface, `~` lava,
//! `^` lava surface, `C` coin, `|` enemy barrier, `S` saw, `>` and `<` enemy with its direction,
//! `x` crate, `A` start of the player. A body hides the tile in its cell.

use crate::coinrun::{
    level::{Level, LevelParts, Mode, Spawn},
    rules::START_CELL,
    tile::{SIZE, Tile, TileGrid},
};

/// Rows shown above the highest thing in a level.
const HEADROOM: i32 = 3;

/// The error of reading a level picture.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum PictureError {
    /// A letter outside the legend.
    #[error("line {line}: unknown letter `{letter}`; the letters are .#=~^C|S<>xA")]
    UnknownLetter {
        /// Line of the picture, from 1.
        line: usize,
        /// The letter.
        letter: char,
    },
    /// More rows or columns than a level has.
    #[error("a level has at most 64 rows and 64 columns")]
    TooLarge,
    /// No coin, or more than one.
    #[error("a level has exactly one coin, found {0}")]
    Coins(usize),
    /// The player always starts in the same cell.
    #[error("the start `A` must be in column 1, row 1")]
    Start,
}

impl Level {
    /// Returns a picture of the used part of the level. It has all columns up to the rock behind the coin, and the rows
    /// up to a little above the highest thing.
    pub fn to_text(&self) -> String {
        let [width, height] = self.used_size();
        let mut rows: Vec<Vec<char>> =
            (0..height).map(|y| (0..width).map(|x| self.tiles.get(x, y).to_char()).collect()).collect();
        let bodies = self.spawns.iter().map(|spawn| (spawn.cell(), spawn.letter()));
        for ([x, y], letter) in bodies.chain([(START_CELL, 'A')]) {
            if let Some(place) = rows.get_mut(y as usize).and_then(|row| row.get_mut(x as usize)) {
                *place = letter;
            }
        }
        let mut text = String::new();
        for row in rows.iter().rev() {
            text.extend(row);
            text.push('\n');
        }
        text
    }

    /// Returns the columns and rows of the part of the level that is used.
    pub fn used_size(&self) -> [i32; 2] {
        // Only rock is behind the coin, except in hand-made levels.
        let is_rock = |x: i32| (0..SIZE).all(|y| self.tiles.get(x, y) == Tile::Wall);
        let last = (self.coin[0]..SIZE).rev().find(|&x| !is_rock(x)).unwrap_or(self.coin[0]);
        let width = (last + 3).min(SIZE);
        [width, self.used_height(width)]
    }

    /// Returns the height without the part that repeats up to the border: rock and free columns, which
    /// [`Level::from_text`] restores.
    fn used_height(&self, width: i32) -> i32 {
        let columns = || 1..width - 2;
        let top = SIZE - 2;
        let goes_on = |y: i32| {
            columns().all(|x| {
                let tile = self.tiles.get(x, y);
                tile == self.tiles.get(x, top) && matches!(tile, Tile::Wall | Tile::Empty)
            })
        };
        let same_from = (0..=top).rev().take_while(|&y| goes_on(y)).last().unwrap_or(SIZE - 1);
        let above_bodies = self.spawns.iter().map(|spawn| spawn.cell()[1] + 1).max().unwrap_or(1);
        let is_ceiling = columns().all(|x| self.tiles.get(x, top) == Tile::Wall);
        let shown = if is_ceiling { 1 } else { HEADROOM };
        (same_from.max(above_bodies) + shown).min(SIZE)
    }

    /// Reads a picture. The part right of it becomes rock. Above it, a column that ends in `#` goes on as rock and
    /// every other column is free up to the border. All sprites are 0, the seed is 0 and the mode is hard.
    ///
    /// # Errors
    /// See [`PictureError`].
    pub fn from_text(text: &str) -> Result<Level, PictureError> {
        let lines: Vec<&str> = text.lines().filter(|line| !line.is_empty()).collect();
        let width = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0);
        if lines.len() > SIZE as usize || width > SIZE as usize {
            return Err(PictureError::TooLarge);
        }
        let mut reader = Reader::new(width as i32);
        reader.continue_rock(lines.first().copied().unwrap_or(""), lines.len() as i32);
        for (line, row) in lines.iter().enumerate() {
            let y = (lines.len() - 1 - line) as i32;
            for (x, letter) in (0..).zip(row.chars()) {
                reader.read(x, y, letter, line + 1)?;
            }
        }
        reader.finish()
    }
}

impl Spawn {
    /// Returns the cell of this body.
    pub fn cell(&self) -> [i32; 2] {
        match *self {
            Spawn::Saw(cell) | Spawn::Enemy { cell, .. } | Spawn::Crate { cell, .. } => cell,
        }
    }

    fn letter(&self) -> char {
        match self {
            Spawn::Saw(_) => 'S',
            Spawn::Enemy { dir: 1, .. } => '>',
            Spawn::Enemy { .. } => '<',
            Spawn::Crate { .. } => 'x',
        }
    }
}

struct Reader {
    tiles: TileGrid,
    spawns: Vec<Spawn>,
    coins: Vec<[i32; 2]>,
}

impl Reader {
    fn new(width: i32) -> Self {
        let mut tiles = TileGrid::default();
        tiles.fill(width, 0, SIZE - width, SIZE, Tile::Wall);
        tiles.fill(0, 0, 1, SIZE, Tile::Wall);
        tiles.fill(0, SIZE - 1, SIZE, 1, Tile::Wall);
        Self { tiles, spawns: Vec::new(), coins: Vec::new() }
    }

    fn continue_rock(&mut self, top_row: &str, height: i32) {
        for (x, _) in (0..).zip(top_row.chars()).filter(|&(_, letter)| letter == '#') {
            self.tiles.fill(x, height, 1, SIZE - height, Tile::Wall);
        }
    }

    fn read(&mut self, x: i32, y: i32, letter: char, line: usize) -> Result<(), PictureError> {
        let cell = [x, y];
        let sprite = 0;
        let spawn = match letter {
            'S' => Spawn::Saw(cell),
            '>' => Spawn::Enemy { cell, dir: 1, sprite },
            '<' => Spawn::Enemy { cell, dir: -1, sprite },
            'x' => Spawn::Crate { cell, sprite },
            'A' if cell == START_CELL => return Ok(()),
            'A' => return Err(PictureError::Start),
            _ => return self.read_tile(cell, letter, line),
        };
        self.tiles.set(x, y, Tile::Empty);
        self.spawns.push(spawn);
        Ok(())
    }

    fn read_tile(&mut self, cell: [i32; 2], letter: char, line: usize) -> Result<(), PictureError> {
        let unknown = PictureError::UnknownLetter { line, letter };
        let tile = Tile::from_char(letter).ok_or(unknown)?;
        if tile == Tile::Coin {
            self.coins.push(cell);
        }
        self.tiles.set(cell[0], cell[1], tile);
        Ok(())
    }

    fn finish(self) -> Result<Level, PictureError> {
        let [coin] = self.coins[..] else {
            return Err(PictureError::Coins(self.coins.len()));
        };
        Ok(Level::new(LevelParts {
            mode: Mode::Hard,
            seed: 0,
            tiles: self.tiles,
            coin,
            spawns: self.spawns,
            background: 0,
            background_offset: 0.0,
            agent_theme: 0,
            ground_theme: 0,
            tie_breaks: [0; 16],
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::generator::generate;

    #[test]
    fn pictures_read_back() {
        let level = generate(Mode::Hard, 4);
        let copy = Level::from_text(&level.to_text()).expect("own picture");
        assert_eq!(copy.to_text(), level.to_text());
        let bodies: Vec<[i32; 2]> = level.spawns.iter().map(Spawn::cell).collect();
        for (x, y) in (0..SIZE).flat_map(|x| (0..SIZE).map(move |y| (x, y))) {
            let hidden = bodies.contains(&[x, y]);
            assert!(hidden || copy.tiles.get(x, y) == level.tiles.get(x, y), "({x}, {y})");
        }
        assert_eq!(copy.coin, level.coin);
    }

    #[test]
    fn shows_bodies_and_the_start() {
        let text = generate(Mode::Hard, 5).to_text();
        for letter in ['A', 'C', 'S', '>', 'x'] {
            assert!(text.contains(letter), "{letter} is missing in\n{text}");
        }
    }

    #[test]
    fn rock_above_a_ceiling_is_left_out() {
        let free = "#........#\n#A......C#\n##########\n";
        for (top, height) in [("##########\n", 4), ("####.#####\n", 6)] {
            let level = Level::from_text(&format!("{top}{free}")).expect("a level");
            assert_eq!(level.used_size()[1], height, "{}", level.to_text());
            let copy = Level::from_text(&level.to_text()).expect("own picture");
            let differs = |x, y| copy.tiles.get(x, y) != level.tiles.get(x, y);
            assert!(!(0..SIZE).any(|x| (0..SIZE).any(|y| differs(x, y))), "{}", level.to_text());
        }
    }

    #[test]
    fn bad_pictures_are_refused() {
        let error = |text| Level::from_text(text).err();
        assert_eq!(error("#A.."), Some(PictureError::Start));
        assert_eq!(error("#..#"), Some(PictureError::Coins(0)));
        let unknown = PictureError::UnknownLetter { line: 1, letter: '?' };
        assert_eq!(error("#?C#"), Some(unknown));
    }
}
