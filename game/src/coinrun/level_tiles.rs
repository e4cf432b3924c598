//! The tiles of a level file, and the coin among them.

use playbot_lab::level_files::{
    JsonStep::{Index, Key},
    LevelTextError,
};

use super::{
    rules::START_CELL,
    tile::{SIZE, Tile, TileGrid},
};

/// The letter for the player's start.
const START: char = 'A';

/// Tiles, with the coin in its cell.
pub(super) struct LevelTiles {
    pub tiles: TileGrid,
    pub coin: [i32; 2],
}

impl LevelTiles {
    /// Reads rows, the bottom one first, and puts the coin into its cell.
    ///
    /// Rows may be fewer and shorter than a level is large. The part right of them becomes rock. Above them, a column
    /// that ends in `#` goes on as rock, and every other column is free up to the border.
    ///
    /// # Errors
    ///
    /// The mistake, with the line of the row.
    pub fn read(rows: &[String], coin: Option<[i32; 2]>, text: &str) -> Result<Self, LevelTextError> {
        let at_row = |row: usize, what: String| Err(LevelTextError::at(text, &[Key("rows"), Index(row)], what));
        let width = rows.first().map_or(0, |row| row.chars().count());
        if rows.is_empty() || width == 0 {
            return Err(LevelTextError::at(
                text,
                &[Key("rows")],
                "the level has no tiles: write its rows, the bottom one first",
            ));
        }
        if rows.len() > SIZE as usize || width > SIZE as usize {
            let what =
                format!("{} rows of {width} tiles are too large: a level has at most {SIZE} of each", rows.len());
            return Err(LevelTextError::at(text, &[Key("rows")], what));
        }
        let mut tiles = surroundings(rows, width as i32);
        let (mut start, mut coins) = (None, Vec::new());
        for (y, row) in rows.iter().enumerate() {
            let found = row.chars().count();
            if found != width {
                return at_row(
                    y,
                    format!("row {y} has {found} tiles and row 0 has {width}: give all rows the same length"),
                );
            }
            for (x, letter) in row.chars().enumerate() {
                let cell = [x as i32, y as i32];
                match (letter, Tile::from_char(letter)) {
                    (START, _) if start.is_some() => {
                        return at_row(y, format!("a second start `A` at {cell:?}: leave one of them"));
                    }
                    (START, _) if cell != START_CELL => {
                        return at_row(
                            y,
                            format!("the start `A` is at {cell:?}: players start at {START_CELL:?}, always"),
                        );
                    }
                    (START, _) => start = Some(cell),
                    (_, None) => {
                        return at_row(
                            y,
                            format!(
                                "unknown letter `{letter}` at {cell:?}: the tiles are .#=~^C|, and saws, crates and enemies \
                                 have lists of their own"
                            ),
                        );
                    }
                    (_, Some(tile)) => {
                        if tile == Tile::Coin {
                            coins.push(cell);
                        }
                        tiles.set(cell[0], cell[1], tile);
                    }
                }
            }
        }
        let coin = place_of_coin(&coins, coin, &tiles, text)?;
        tiles.set(coin[0], coin[1], Tile::Coin);
        let [x, y] = START_CELL;
        if tiles.get(x, y).is_wall() {
            return at_row(
                y as usize,
                format!("the start {START_CELL:?} is inside a wall: players start there, always"),
            );
        }
        Ok(Self { tiles, coin })
    }
}

/// Returns the tiles around the rows.
fn surroundings(rows: &[String], width: i32) -> TileGrid {
    let mut tiles = TileGrid::default();
    tiles.fill(width, 0, SIZE - width, SIZE, Tile::Wall);
    let height = rows.len() as i32;
    if height < SIZE {
        tiles.fill(0, height, 1, SIZE - height, Tile::Wall);
        tiles.fill(0, SIZE - 1, SIZE, 1, Tile::Wall);
        let top = rows.last().map_or("", String::as_str);
        for (x, _) in (0..).zip(top.chars()).filter(|&(_, letter)| letter == Tile::Wall.to_char()) {
            tiles.fill(x, height, 1, SIZE - height, Tile::Wall);
        }
    }
    tiles
}

/// Returns the cell of the only coin, which is drawn into the rows, or named, or both.
fn place_of_coin(
    drawn: &[[i32; 2]],
    named: Option<[i32; 2]>,
    tiles: &TileGrid,
    text: &str,
) -> Result<[i32; 2], LevelTextError> {
    let at_rows = |what: String| Err(LevelTextError::at(text, &[Key("rows")], what));
    let at_coin = |what: String| Err(LevelTextError::at(text, &[Key("coin")], what));
    match (drawn, named) {
        ([], None) => at_rows("the level has no coin: write a C into a row".to_owned()),
        ([coin], None) => Ok(*coin),
        ([_, second, ..], _) => {
            let what = format!("a second coin `C` at {second:?}: a level has one, leave one of them");
            Err(LevelTextError::at(text, &[Key("rows"), Index(second[1] as usize)], what))
        }
        (_, Some(coin)) if coin.iter().any(|along| !(0..SIZE).contains(along)) => {
            at_coin(format!("`coin` is {coin:?}, outside the level: x and y go from 0 to {}", SIZE - 1))
        }
        ([drawn], Some(coin)) if *drawn != coin => {
            at_coin(format!("`coin` is {coin:?}, but the C of the rows is at {drawn:?}: leave one of them out"))
        }
        ([_], Some(coin)) => Ok(coin),
        ([], Some(coin)) => match tiles.get(coin[0], coin[1]) {
            Tile::Empty | Tile::Barrier => Ok(coin),
            tile if tile.is_wall() => at_coin(format!("the coin {coin:?} is inside a wall: make room for it")),
            _ => at_coin(format!("the coin {coin:?} is inside lava: make room for it")),
        },
    }
}
