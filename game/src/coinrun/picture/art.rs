//! The drawings, which come with the program, and the positions of figures on them.

use crate::{
    coinrun::{Tile, picture::puffs},
    pictures::decode,
};
use bevy::prelude::*;
use playbot_assets::coinrun;
use std::sync::LazyLock;

/// Side of a tile on the drawings, texels.
const SIDE: f32 = 16.0;

/// Texels of a backdrop to one tile.
const BACKDROP_TEXELS: f32 = 4.0;

/// Width of a backdrop, tiles.
const BACKDROP_WIDTH: f32 = 96.0;

/// Number of Procgen's backgrounds with landscapes; the others show space.
const LANDSCAPES: u8 = 49;

/// The same of ours.
const OUR_LANDSCAPES: usize = 12;

/// Strips of tiles, by [`LevelParts::ground_theme`](crate::coinrun::LevelParts::ground_theme).
const GROUNDS: [&[u8]; 6] = [
    coinrun::GROUND_DIRT,
    coinrun::GROUND_GRASS,
    coinrun::GROUND_PLANET,
    coinrun::GROUND_SAND,
    coinrun::GROUND_SNOW,
    coinrun::GROUND_STONE,
];

/// Landscapes, then space.
const BACKDROPS: [&[u8]; 16] = [
    coinrun::BACKDROP_MEADOW,
    coinrun::BACKDROP_DUSK,
    coinrun::BACKDROP_DESERT,
    coinrun::BACKDROP_FOREST,
    coinrun::BACKDROP_WINTER,
    coinrun::BACKDROP_CAVE,
    coinrun::BACKDROP_CITY,
    coinrun::BACKDROP_BRICKS,
    coinrun::BACKDROP_SEA,
    coinrun::BACKDROP_NIGHT,
    coinrun::BACKDROP_SWAMP,
    coinrun::BACKDROP_AUTUMN,
    coinrun::BACKDROP_STARS,
    coinrun::BACKDROP_NEBULA,
    coinrun::BACKDROP_RINGED,
    coinrun::BACKDROP_RED_PLANET,
];

/// Decoded once for all Worlds: the figures, the grounds, the backdrops.
static IMAGES: LazyLock<Vec<Image>> =
    LazyLock::new(|| [coinrun::FIGURES].into_iter().chain(GROUNDS).chain(BACKDROPS).map(decode).collect());

static PUFFS: LazyLock<Image> = LazyLock::new(puffs::drawing);

/// The pose of a player.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pose {
    /// Standing still.
    Stand,
    /// The first step, which is also a jump.
    Walk1,
    /// The second step.
    Walk2,
}

/// Handles of all drawings.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
pub struct Art {
    /// The sheet of all inhabitants of a level.
    pub figures: Handle<Image>,
    /// The trail of enemies.
    pub(super) puffs: Handle<Image>,
    grounds: Vec<Handle<Image>>,
    backdrops: Vec<Handle<Image>>,
}

impl Art {
    /// Adds the drawings to an app.
    pub(super) fn add_to(images: &mut Assets<Image>) -> Self {
        let mut handles: Vec<_> = IMAGES.iter().map(|image| images.add(image.clone())).collect();
        let backdrops = handles.split_off(1 + GROUNDS.len());
        let grounds = handles.split_off(1);
        let figures = handles.remove(0);
        Self { figures, puffs: images.add(PUFFS.clone()), grounds, backdrops }
    }

    /// Returns the strip of tiles of a ground theme.
    pub fn ground(&self, theme: u8) -> Handle<Image> {
        self.grounds[usize::from(theme) % self.grounds.len()].clone()
    }

    /// Returns the backdrop for one of Procgen's backgrounds. Ours are fewer, so several of its have the same.
    pub fn backdrop(&self, background: u8) -> Handle<Image> {
        let index = match background.checked_sub(LANDSCAPES) {
            None => usize::from(background) % OUR_LANDSCAPES,
            Some(space) => OUR_LANDSCAPES + usize::from(space) % (self.backdrops.len() - OUR_LANDSCAPES),
        };
        self.backdrops[index].clone()
    }

    /// Returns the part of a backdrop behind a level of `size` tiles, if `offset` (0 to 1) of the spare width hangs
    /// over its left border.
    pub fn backdrop_part(offset: f32, size: f32) -> Rect {
        let left = (offset * (BACKDROP_WIDTH - size) * BACKDROP_TEXELS).floor();
        Rect::new(left, 0.0, left + size * BACKDROP_TEXELS, size * BACKDROP_TEXELS)
    }

    /// Returns a player on the sheet of figures: one of five colours.
    pub fn player(colour: u8, pose: Pose) -> Rect {
        Self::cell(usize::from(colour) * 3 + pose as usize, 0, 2)
    }

    /// Returns an enemy on the sheet of figures: one of nine, in its first or second step.
    pub fn enemy(sprite: u8, step: usize) -> Rect {
        Self::cell(usize::from(sprite), 2 + step, 1)
    }

    /// Returns a crate on the sheet of figures: one of four.
    pub fn wooden_crate(sprite: u8) -> Rect {
        Self::cell(9 + usize::from(sprite), 2, 1)
    }

    /// Returns a saw on the sheet of figures, in one of its two positions.
    pub fn saw(turn: usize) -> Rect {
        Self::cell(13 + turn, 2, 1)
    }

    /// Returns a cell `height` tiles high, in row `row` and column `column` of the sheet of figures.
    fn cell(column: usize, row: usize, height: usize) -> Rect {
        let (x, y) = (column as f32 * SIDE, row as f32 * SIDE);
        Rect::new(x, y, x + SIDE, y + height as f32 * SIDE)
    }

    /// Returns the number of a tile on the strips; `None` if it cannot be seen.
    pub fn tile(tile: Tile) -> Option<u16> {
        match tile {
            Tile::Empty | Tile::Barrier => None,
            Tile::Wall => Some(0),
            Tile::WallTop => Some(1),
            Tile::Lava => Some(2),
            Tile::LavaTop => Some(3),
            Tile::Coin => Some(4),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coinrun::generator::{AGENT_THEMES, BACKGROUNDS, CRATE_SPRITES, ENEMY_SPRITES, GROUND_THEMES};

    fn area(image: &Image) -> Rect {
        Rect::from_corners(Vec2::ZERO, image.size().as_vec2())
    }

    #[test]
    fn every_figure_is_a_drawing_of_its_own() {
        let sheet = &IMAGES[0];
        let poses = [Pose::Stand, Pose::Walk1, Pose::Walk2];
        let players = (0..AGENT_THEMES as u8).flat_map(|colour| poses.map(|pose| Art::player(colour, pose)));
        let enemies = (0..ENEMY_SPRITES as u8).flat_map(|sprite| [0, 1].map(|step| Art::enemy(sprite, step)));
        let crates = (0..CRATE_SPRITES as u8).map(Art::wooden_crate);
        let rects: Vec<_> = players.chain(enemies).chain(crates).chain([0, 1].map(Art::saw)).collect();
        let texels = |rect: &Rect| -> Vec<[u8; 4]> {
            let (x, y) = (rect.min.x as u32..rect.max.x as u32, rect.min.y as u32..rect.max.y as u32);
            let bytes = |x, y| sheet.pixel_bytes(UVec3::new(x, y, 0)).expect("inside");
            y.flat_map(|y| x.clone().map(move |x| bytes(x, y).try_into().expect("RGBA"))).collect()
        };
        for (number, rect) in rects.iter().enumerate() {
            assert_eq!(area(sheet).union(*rect), area(sheet), "figure {number} lies on the sheet");
            let drawing = texels(rect);
            assert!(drawing.iter().filter(|texel| texel[3] == 255).count() > 80, "figure {number} is nearly empty");
            assert!(rects[..number].iter().all(|other| texels(other) != drawing), "figure {number} is there twice");
        }
    }

    #[test]
    fn strips_and_backdrops_have_the_size_that_levels_need() {
        let mut assets = Assets::default();
        let art = Art::add_to(&mut assets);
        for theme in 0..GROUND_THEMES as u8 {
            let strip = assets.get(&art.ground(theme)).expect("added");
            assert_eq!(strip.size(), UVec2::new(16, 16 * 5));
        }
        let mut seen = Vec::new();
        for background in 0..BACKGROUNDS as u8 {
            let handle = art.backdrop(background);
            let image = assets.get(&handle).expect("added");
            for offset in [0.0, 0.33, 1.0] {
                assert_eq!(area(image).union(Art::backdrop_part(offset, 64.0)), area(image));
            }
            seen.push(handle.id());
        }
        seen.sort();
        seen.dedup();
        assert_eq!(seen.len(), BACKDROPS.len(), "every backdrop is used");
    }
}
