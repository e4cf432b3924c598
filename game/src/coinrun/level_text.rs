//! Levels as JSON, which is the form of level files, and levels on the command line.

use crate::coinrun::{
    components,
    components::{PlaysIn, level_of},
    demonstrator_bot,
    generator::{AGENT_THEMES, BACKGROUNDS, CRATE_SPRITES, ENEMY_SPRITES, GROUND_THEMES},
    level::{GoldenLevel, Level, LevelParts, Mode, Spawn},
    rules::{Body, START_CELL},
    tile::{SIZE, Tile, TileGrid},
};
use bevy::{
    math::{Rect, Vec2},
    prelude::*,
};
use bevy_playbot::{
    raster::RasterSensor,
    vision::{ImageOptions, ObservationConfig, ObservationKind},
};
use playbot_harness::{
    floor_plan::{FloorPlan, joined_tiles},
    inspect::{InspectError, LevelPicture, LevelRequest, LevelView},
    level_files::{
        JsonStep::{Index, Key},
        LevelDesign, LevelDesigns, LevelTextError, read_json_object,
    },
    prelude::*,
    worlds::build_observing_world,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A level in a file. Cells are `[x, y]` from the bottom left; only the rows are required.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a level: an object with `rows`")]
pub(super) struct LevelText {
    rows: Vec<String>,
    #[serde(default)]
    coin: Option<[i32; 2]>,
    #[serde(default)]
    saws: Vec<[i32; 2]>,
    #[serde(default)]
    crates: Vec<[i32; 2]>,
    #[serde(default)]
    enemies: Vec<[i32; 3]>,
    #[serde(default)]
    crate_sprites: Option<Vec<u8>>,
    #[serde(default)]
    enemy_sprites: Option<Vec<u8>>,
    /// A letter for each body, in creation order; see [`components::to_text`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    order: Option<String>,
    #[serde(default)]
    background: u8,
    #[serde(default)]
    background_offset: f32,
    #[serde(default)]
    agent_theme: u8,
    #[serde(default)]
    ground_theme: u8,
    #[serde(default)]
    tie_breaks: Option<String>,
    /// Origin of a generated level. Play does not need it.
    #[serde(default = "hard")]
    mode: Mode,
    #[serde(default)]
    seed: u32,
}

fn hard() -> Mode {
    Mode::Hard
}

impl Level {
    /// Converts the level to a file's form, with all fields that play and pictures need.
    pub(super) fn to_level_text(&self) -> LevelText {
        let GoldenLevel {
            mode,
            seed,
            coin,
            background,
            agent_theme,
            ground_theme,
            saws,
            crates,
            enemies,
            crate_sprites,
            enemy_sprites,
            rows,
        } = self.to_golden_json();
        LevelText {
            rows,
            coin: Some(coin),
            saws,
            crates,
            enemies,
            crate_sprites: Some(crate_sprites),
            enemy_sprites: Some(enemy_sprites),
            order: components::to_text(&self.spawns),
            background,
            background_offset: self.background_offset,
            agent_theme,
            ground_theme,
            tie_breaks: Some(demonstrator_bot::to_text(&self.tie_breaks)),
            mode,
            seed,
        }
    }
}

/// Parses a level file.
///
/// # Errors
///
/// The mistake, with its line.
pub(super) fn parse(text: &str) -> Result<LevelDesign, LevelTextError> {
    let level = read_json_object::<LevelText>(text)?.into_level(text)?;
    // The origin of a level is no part of its content.
    let content = LevelText { mode: Mode::Hard, seed: 0, ..level.to_level_text() };
    let layout = level.layout_hash();
    Ok(LevelDesign::new(level, &serde_json::json!(content).to_string()).with_layout(layout))
}

impl LevelText {
    fn into_level(self, text: &str) -> Result<Level, LevelTextError> {
        self.check_numbers(text)?;
        self.check_cells(text)?;
        let LevelTiles { tiles, coin } = LevelTiles::read(&self.rows, self.coin, text)?;
        let tie_breaks = match &self.tie_breaks {
            Some(digits) => demonstrator_bot::from_text(digits).ok_or_else(|| {
                let what =
                    "`tie_breaks` are 256 digits, 0 to 9 and a to f, one for every four steps; leave them out for none";
                LevelTextError::at(text, &[Key("tie_breaks")], what)
            })?,
            None => Default::default(),
        };
        let crate_sprites = sprites(self.crate_sprites, "crate", self.crates.len(), CRATE_SPRITES, text)?;
        let enemy_sprites = sprites(self.enemy_sprites, "enemy", self.enemies.len(), ENEMY_SPRITES, text)?;
        let saws = self.saws.into_iter().map(Spawn::Saw);
        let crates = self.crates.into_iter().zip(crate_sprites).map(|(cell, sprite)| Spawn::Crate { cell, sprite });
        let enemies = self.enemies.into_iter().zip(enemy_sprites).map(|([x, y, dir], sprite)| Spawn::Enemy {
            cell: [x, y],
            dir: if dir < 0 { -1 } else { 1 },
            sprite,
        });
        let listed: Vec<Spawn> = saws.chain(crates).chain(enemies).collect();
        let spawns = match &self.order {
            Some(order) => components::arrange(order, &listed).ok_or_else(|| {
                let what = "`order` has one letter for each body, s for a saw, c for a crate and e for an enemy; leave it out \
                            for all saws, then all crates, then all enemies";
                LevelTextError::at(text, &[Key("order")], what)
            })?,
            None => listed,
        };
        Ok(Level::new(LevelParts {
            mode: self.mode,
            seed: self.seed,
            tiles,
            coin,
            spawns,
            background: self.background,
            background_offset: self.background_offset,
            agent_theme: self.agent_theme,
            ground_theme: self.ground_theme,
            tie_breaks,
        }))
    }

    fn check_numbers(&self, text: &str) -> Result<(), LevelTextError> {
        for (key, value, count) in [
            ("background", self.background, BACKGROUNDS),
            ("agent_theme", self.agent_theme, AGENT_THEMES),
            ("ground_theme", self.ground_theme, GROUND_THEMES),
        ] {
            if u32::from(value) >= count {
                let what = format!("`{key}` is {value}: choose one from 0 to {}", count - 1);
                return Err(LevelTextError::at(text, &[Key(key)], what));
            }
        }
        if !(0.0..=1.0).contains(&self.background_offset) {
            let what = format!("`background_offset` is {}: it lies between 0 and 1", self.background_offset);
            return Err(LevelTextError::at(text, &[Key("background_offset")], what));
        }
        Ok(())
    }

    /// Checks that all inhabitants are inside the level, and that enemies have a direction.
    fn check_cells(&self, text: &str) -> Result<(), LevelTextError> {
        let enemies: Vec<[i32; 2]> = self.enemies.iter().map(|&[x, y, _]| [x, y]).collect();
        for (key, what, cells) in
            [("saws", "saw", &self.saws), ("crates", "crate", &self.crates), ("enemies", "enemy", &enemies)]
        {
            let outside = |cell: &[i32; 2]| cell.iter().any(|along| !(0..SIZE).contains(along));
            if let Some(index) = cells.iter().position(outside) {
                let [x, y] = cells[index];
                let what = format!("the {what} at [{x}, {y}] is outside the level: x and y go from 0 to {}", SIZE - 1);
                return Err(LevelTextError::at(text, &[Key(key), Index(index)], what));
            }
        }
        match self.enemies.iter().position(|[.., dir]| ![-1, 1].contains(dir)) {
            Some(index) => {
                let [x, y, dir] = self.enemies[index];
                let what = format!(
                    "the enemy at [{x}, {y}] walks in direction {dir}: write [x, y, 1] for right or [x, y, -1] for left"
                );
                Err(LevelTextError::at(text, &[Key("enemies"), Index(index)], what))
            }
            None => Ok(()),
        }
    }
}

/// Returns the pictures of the bodies of one kind: the first one for all if none are named.
fn sprites(
    named: Option<Vec<u8>>,
    kind: &str,
    bodies: usize,
    pictures: u32,
    text: &str,
) -> Result<Vec<u8>, LevelTextError> {
    let Some(named) = named else { return Ok(vec![0; bodies]) };
    let key = format!("{kind}_sprites");
    if named.len() != bodies {
        let what =
            format!("`{key}` has {} entries for {bodies} bodies: give each its own, or leave it out", named.len());
        return Err(LevelTextError::at(text, &[Key(&key)], what));
    }
    match named.iter().position(|&sprite| u32::from(sprite) >= pictures) {
        Some(index) => {
            let what = format!("`{key}` has picture {}: choose one from 0 to {}", named[index], pictures - 1);
            Err(LevelTextError::at(text, &[Key(&key), Index(index)], what))
        }
        None => Ok(named),
    }
}

// The tiles of a level file, and the coin among them.

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

// The level on the command line: as text, as JSON, and as a picture of the whole of it.

const LEGEND: &str =
    "A start  C coin  # = ground  ~ ^ lava  S saw  < > enemy and its direction  x crate  | enemies turn here";

/// Shows a level.
pub(crate) fn show(game: &dyn Game, request: &LevelRequest) -> Result<LevelView, InspectError> {
    if request.map.is_some() {
        return Err(InspectError::Usage("CoinRun has no maps: name a --mode and a --level".to_owned()));
    }
    let level = match request.file {
        Some(path) => {
            let designs = LevelDesigns::of_file(&path.to_string_lossy(), &|text| game.parse_level(text));
            designs.map_err(|error| InspectError::Usage(error.to_string()))?.get(0)
        }
        None => {
            let mode = request.mode.unwrap_or("hard");
            game.check_mode(mode)?;
            level_of(game, mode, request.level.unwrap_or(0))
        }
    };
    let level = level.map_err(InspectError::Usage)?;
    Ok(LevelView {
        text: format!("{}\n{LEGEND}", level.to_text()),
        json: serde_json::json!(level.to_level_text()).to_string(),
        lacks_plan: false,
        picture: request.picture.then(|| draw(game, level)).transpose()?,
    })
}

/// Pixels of a tile in the picture of a level.
const TILE: u32 = 16;

/// Draws the used part of a level, as an agent with a view of all of it would see it.
fn draw(game: &dyn Game, level: Arc<Level>) -> Result<LevelPicture, InspectError> {
    let [columns, rows] = level.used_size().map(i32::unsigned_abs);
    let image = ImageOptions { width: columns * TILE, height: rows * TILE, ..ImageOptions::default() };
    let config = ObservationConfig { kind: ObservationKind::Raster, image };
    let (mut world, agents) = build_observing_world(game, "hard", &config, 0, 0, 1)?;
    world.insert_resource(LevelDesigns::one("the level", LevelDesign::new(Arc::unwrap_or_clone(level), "")));
    let (agent, (width, height)) = (agents[0], (columns as f32, rows as f32));
    let arena = world.get::<PlaysIn>(agent).expect("every player has an arena").0;
    let centre = world.spawn((ChildOf(arena), Transform::from_xyz(width / 2.0, height / 2.0, 0.0))).id();
    world.entity_mut(agent).insert((RasterSensor { target: centre, width }, Control::Human, LevelQueue::Always(0)));
    world.tick()?;
    let seen = world.get::<Observation>(agent).expect("required by Agent");
    Ok(LevelPicture::Pixels { image, pixels: seen.image.clone() })
}

impl Level {
    /// Returns the used part of the level, from the side, in tiles: ground, lava and saws, crates. Enemies walk about,
    /// so they are left out.
    pub fn floor_plan(&self) -> FloorPlan {
        let [columns, rows] = self.used_size().map(|tiles| tiles.unsigned_abs() as usize);
        let square = |row: usize, column: usize| {
            let corner = Vec2::new(column as f32, row as f32);
            Rect::from_corners(corner, corner + 1.0)
        };
        let is_wall = |row: usize, column: usize| self.tiles.get(column as i32, row as i32).is_wall();
        let (player, [x, y]) = (Body::player(), self.coin);
        let ends = [Vec2::new(player.x, player.y), Vec2::new(x as f32 + 0.5, y as f32 + 0.5)];
        let is_lava = |row: usize, column: usize| self.tiles.get(column as i32, row as i32).is_lava();
        let at = |[x, y]: [i32; 2]| square(y as usize, x as usize);
        let mut hazards = joined_tiles([rows, columns], is_lava, square);
        let mut platforms = Vec::new();
        for spawn in self.spawns.iter().copied() {
            match spawn {
                Spawn::Saw(cell) => hazards.push(at(cell)),
                Spawn::Crate { cell, .. } => platforms.push(at(cell)),
                Spawn::Enemy { .. } => {}
            }
        }
        FloorPlan { hazards, platforms, ..FloorPlan::of_tiles([rows, columns], is_wall, square, ends) }
    }
}
