//! Levels: a row of chunks, each a drawing in a text file, and the map that they make.
//!
//! In a drawing `#` is earth, `^` thorns, `o` a fruit, `a` a ripe apple that falls, `S` the start and `G` the gate.

use std::io::{Error, ErrorKind};

use bevy::{
    asset::{AssetLoader, LoadContext, io::Reader},
    prelude::*,
};
use chacha20::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use crate::{ACCELERATION, GRAVITY, RUN_SPEED};

/// Rows of each chunk.
const HEIGHT: usize = 8;

/// Chunks between the first and the last one.
const MIDDLE: usize = 4;

/// Drawings that a level may consist of.
const CHUNKS: [&str; 12] =
    ["meadow", "pit", "thorns", "ledge", "wall", "stairs", "brambles", "roof", "dip", "windfall", "well", "terrace"];

/// Distance ahead of the hero in which an obstacle asks for a jump.
const AHEAD: f32 = 0.9;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Tile {
    Air,
    Earth,
    Thorns,
    Fruit,
    Apple,
    Start,
    Gate,
}

impl Tile {
    fn read(sign: char) -> Option<Self> {
        Some(match sign {
            '.' => Self::Air,
            '#' => Self::Earth,
            '^' => Self::Thorns,
            'o' => Self::Fruit,
            'a' => Self::Apple,
            'S' => Self::Start,
            'G' => Self::Gate,
            _ => return None,
        })
    }
}

/// A part of a level, column by column from the left, each from the bottom.
#[derive(Asset, TypePath, Debug)]
pub struct Chunk(Vec<[Tile; HEIGHT]>);

impl Chunk {
    fn read(drawing: &str) -> Result<Self, String> {
        let rows: Vec<&str> = drawing.lines().collect();
        if rows.len() != HEIGHT {
            return Err(format!("{} rows instead of {HEIGHT}", rows.len()));
        }
        let mut columns = vec![[Tile::Air; HEIGHT]; rows[0].len()];
        for (number, row) in rows.iter().enumerate() {
            if row.len() != columns.len() {
                return Err(format!("row {} is not as long as the first", number + 1));
            }
            for (column, sign) in columns.iter_mut().zip(row.chars()) {
                let tile = Tile::read(sign).ok_or_else(|| format!("row {} has a `{sign}`", number + 1))?;
                column[HEIGHT - 1 - number] = tile;
            }
        }
        Ok(Self(columns))
    }
}

#[derive(Default, TypePath)]
pub struct ChunkLoader;

impl AssetLoader for ChunkLoader {
    type Asset = Chunk;
    type Settings = ();
    type Error = Error;

    async fn load(&self, reader: &mut dyn Reader, (): &(), _: &mut LoadContext<'_>) -> Result<Chunk, Error> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        let drawing = String::from_utf8(bytes).map_err(|error| Error::new(ErrorKind::InvalidData, error))?;
        Chunk::read(&drawing).map_err(|error| Error::new(ErrorKind::InvalidData, error))
    }

    fn extensions(&self) -> &[&str] {
        &["chunk"]
    }
}

/// Returns the files of a level, from left to right.
pub fn chunks_of(level: u64) -> Vec<String> {
    let mut rng = ChaCha8Rng::seed_from_u64(level);
    let middle = (0..MIDDLE).map(|_| CHUNKS[rng.random_range(0..CHUNKS.len())]);
    let names = ["start"].into_iter().chain(middle).chain(["gate"]);
    names.map(|name| format!("chunks/{name}.chunk")).collect()
}

/// The present level, as its chunks make it.
#[derive(Resource, Default)]
pub struct Map {
    columns: Vec<[Tile; HEIGHT]>,
}

impl Map {
    /// Joins chunks from left to right.
    pub fn of<'a>(chunks: impl IntoIterator<Item = &'a Chunk>) -> Self {
        Self { columns: chunks.into_iter().flat_map(|chunk| chunk.0.iter().copied()).collect() }
    }

    /// Returns all tiles that are not air, with the middle of each.
    pub fn tiles(&self) -> impl Iterator<Item = (Tile, Vec2)> + '_ {
        self.columns.iter().enumerate().flat_map(|(x, column)| {
            let middle = move |y: usize| Vec2::new(x as f32, y as f32) + 0.5;
            column.iter().enumerate().map(move |(y, tile)| (*tile, middle(y))).filter(|(tile, _)| *tile != Tile::Air)
        })
    }

    /// Returns the middle and the width of each stretch of earth in a row. Stretches have no seams, over which the
    /// hero would trip.
    pub fn earth(&self) -> Vec<(Vec2, f32)> {
        let mut stretches = Vec::new();
        for y in 0..HEIGHT {
            let mut left = 0;
            for stretch in self.columns.chunk_by(|a, b| (a[y] == Tile::Earth) == (b[y] == Tile::Earth)) {
                let width = stretch.len() as f32;
                if stretch[0][y] == Tile::Earth {
                    stretches.push((Vec2::new(left as f32 + width / 2.0, y as f32 + 0.5), width));
                }
                left += stretch.len();
            }
        }
        stretches
    }

    fn tile(&self, x: f32, y: f32) -> Tile {
        let column = self.columns.get(x.max(0.0) as usize);
        column.and_then(|column| column.get(y.max(0.0) as usize)).copied().unwrap_or(Tile::Air)
    }

    /// Returns the height of the ground at `x`, and whether the hero can stand on it; 0 for a pit.
    pub fn ground(&self, x: f32) -> (f32, bool) {
        let Some(column) = self.columns.get(x.max(0.0) as usize) else { return (0.0, false) };
        let height = column.iter().take_while(|tile| **tile == Tile::Earth).count();
        (height as f32, height > 0 && column.get(height) != Some(&Tile::Thorns))
    }

    /// Returns whether the hero had better run to the right than back, and whether to jump.
    pub fn hint(&self, feet: Vec2, velocity: Vec2, is_grounded: bool) -> (bool, bool) {
        let is_deadly = |x: f32| !self.ground(x).1;
        if is_grounded {
            let ahead = feet.x + AHEAD;
            return (true, is_deadly(ahead) || self.tile(ahead, feet.y + 0.2) == Tile::Earth);
        }
        // Where the hero lands by running on.
        let fall = (feet.y - self.ground(feet.x + AHEAD).0).max(0.0);
        let time = (velocity.y + (velocity.y * velocity.y + 2.0 * GRAVITY * fall).sqrt()) / GRAVITY;
        let faster = ((RUN_SPEED - velocity.x) / ACCELERATION).clamp(0.0, time);
        let landing = feet.x + velocity.x * faster + ACCELERATION * faster * faster / 2.0 + RUN_SPEED * (time - faster);
        let is_bad = [landing - 0.4, landing + 0.4].into_iter().any(is_deadly);
        (!is_bad || is_deadly(feet.x + 0.4), false)
    }
}
