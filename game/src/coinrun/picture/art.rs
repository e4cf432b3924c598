//! The drawings, which come with the program, and the positions of figures on them.
//!
//! The puffs that enemies leave behind are translucent white discs, side by side, in a drawing made in code. An enemy leaves
//! a puff in every tick. Each rises, grows and fades, and is gone after [`PUFFS`] ticks. Those of ticks in which it walked at
//! one speed are drawn as one. Many overlapping sprites would take the raster many times as long, for the same picture.

use crate::{coinrun::Tile, pictures::decode};
use bevy::{image::ImageSampler, prelude::*};
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

static DRAWN_PUFFS: LazyLock<Image> = LazyLock::new(draw_puffs);

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
        Self { figures, puffs: images.add(DRAWN_PUFFS.clone()), grounds, backdrops }
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

// The drawing of the puffs that enemies leave behind.

/// Visible puffs of an enemy, and ticks for which each is visible.
pub(crate) const PUFFS: usize = 8;

/// Half of the width and of the height of a new puff, tiles, and the factor by which it grows in each tick.
const NEW: Vec2 = Vec2::new(0.3, 0.2);

const GROWTH: f32 = 1.05;

/// Opacity of a new puff, and the factor by which it fades.
const ALPHA: f32 = 0.5;

const FADING: f32 = 0.8;

/// Tiles by which a puff rises in each tick.
const RISE: f32 = 0.01;

/// Tiles between two puffs of the drawing: enemies walk as fast as this until they turn at inner ground.
const STEP: f32 = 0.15;

/// Distance from the middle of a new puff to the upper edge of the drawing, and height of the drawing, tiles.
const TOP: f32 = 0.35;

const HEIGHT: f32 = 0.5625;

/// Texels to the tile.
const TEXELS: f32 = 16.0;

/// Texels of the cell of each row of puffs.
const CELL: (u32, u32) = (32, 10);

/// Puffs of ticks in a row: the newest is `first` ticks old, and there are `count` of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PuffRow {
    /// Age of the newest.
    pub first: usize,
    /// Number of puffs, at least 1; all are younger than [`PUFFS`] ticks.
    pub count: usize,
}

/// Returns half of the width and height of a puff of this age.
fn half_size(age: usize) -> Vec2 {
    (0..age).fold(NEW, |half, _| half * GROWTH)
}

impl PuffRow {
    fn last(self) -> usize {
        self.first + self.count - 1
    }

    /// Returns the width of the row if the enemy went `walked` tiles between its newest and its oldest puff.
    pub fn width(self, walked: f32) -> f32 {
        walked + half_size(self.first).x + half_size(self.last()).x
    }

    /// Returns size and middle of its sprite, tiles, if the enemy went from `oldest` to `newest` meanwhile. Both are
    /// positions of new puffs.
    pub fn lay_out(self, newest: Vec2, oldest: Vec2) -> (Vec2, Vec2) {
        let walked = newest.x - oldest.x;
        let width = self.width(walked.abs());
        // One of the ends of the row, and the direction from there to its middle.
        let (edge, way) = if walked < 0.0 { (-1.0, 0.5) } else { (1.0, -0.5) };
        let x = newest.x + edge * half_size(self.first).x + way * width;
        (Vec2::new(width, HEIGHT), Vec2::new(x, newest.y + TOP - HEIGHT / 2.0))
    }

    /// Returns its cell on the drawing, where it walks to the right.
    pub fn rect(self) -> Rect {
        let (x, y) = ((self.count as u32 - 1) * CELL.0, self.first as u32 * CELL.1);
        let corner = UVec2::new(x, y).as_vec2();
        let width = self.width(STEP * (self.count - 1) as f32);
        Rect::from_corners(corner, corner + Vec2::new(width, HEIGHT) * TEXELS)
    }

    /// Returns its opacity at a position right of its left end and above the middle of a new puff, tiles.
    fn alpha(self, at: Vec2) -> f32 {
        let (left, mut through) = (half_size(self.last()).x, 1.0);
        let mut alpha = (0..self.first).fold(ALPHA, |alpha, _| alpha * FADING);
        for age in self.first..=self.last() {
            let middle = Vec2::new(left + STEP * (self.last() - age) as f32, RISE * age as f32);
            if ((at - middle) / half_size(age)).length_squared() <= 1.0 {
                through *= 1.0 - alpha;
            }
            alpha *= FADING;
        }
        1.0 - through
    }
}

/// Returns all rows of puffs.
pub(crate) fn draw_puffs() -> Image {
    let (width, height) = (PUFFS as u32 * CELL.0, PUFFS as u32 * CELL.1);
    let texel = |x: u32, y: u32| {
        let row = PuffRow { first: (y / CELL.1) as usize, count: (x / CELL.0) as usize + 1 };
        let place = Vec2::new((x % CELL.0) as f32 + 0.5, (y % CELL.1) as f32 + 0.5) / TEXELS;
        let alpha = if row.last() < PUFFS { row.alpha(Vec2::new(place.x, TOP - place.y)) } else { 0.0 };
        [255, 255, 255, (alpha * 255.0 + 0.5) as u8]
    };
    // The type of an image's size has no name in a program without a renderer.
    let mut image = Image::default();
    image.texture_descriptor.size.width = width;
    image.texture_descriptor.size.height = height;
    image.data = Some((0..height).flat_map(|y| (0..width).flat_map(move |x| texel(x, y))).collect());
    image.sampler = ImageSampler::nearest();
    image
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

    fn alpha(image: &Image, at: Vec2) -> u8 {
        image.pixel_bytes(at.as_uvec2().extend(0)).expect("on the drawing")[3]
    }

    #[test]
    fn puffs_fade_and_overlap() {
        let image = draw_puffs();
        let mut faded = 127.5;
        for first in 0..PUFFS {
            let single = PuffRow { first, count: 1 }.rect();
            assert!((f32::from(alpha(&image, single.center())) - faded).abs() <= 1.0, "age {first}");
            assert_eq!(alpha(&image, single.min), 0, "round");
            faded *= 0.8;
        }
        let all = PuffRow { first: 0, count: PUFFS }.rect();
        let at = |x: f32| alpha(&image, Vec2::new(x, all.min.y + TOP * TEXELS));
        // Middle of the newest: 0.3 + 8 of its own 0.6 wide, under it those of the two ticks before.
        let expected = 255.0 * (1.0 - 0.5 * 0.6 * 0.68);
        assert!((f32::from(at(all.max.x - 0.3 * TEXELS)) - expected).abs() <= 1.0);
        assert!((1..60).contains(&at(all.min.x + 2.0)), "the oldest is hardly to be seen");
    }

    #[test]
    fn every_row_lies_in_its_place() {
        for first in 0..PUFFS {
            for count in 1..=PUFFS - first {
                let Vec2 { x, y } = PuffRow { first, count }.rect().size();
                assert!(x <= CELL.0 as f32 && y <= CELL.1 as f32, "{first}, {count}: {x} x {y}");
            }
        }
    }

    #[test]
    fn a_row_reaches_from_its_oldest_to_its_newest_puff() {
        let row = PuffRow { first: 1, count: 3 };
        let (newest, old) = (0.3 * 1.05, 0.3 * 1.05 * 1.05 * 1.05);
        let right = row.lay_out(Vec2::new(5.0, 2.0), Vec2::new(4.7, 2.0));
        assert!((right.1.x + right.0.x / 2.0 - (5.0 + newest)).abs() < 1e-5);
        assert!((right.1.x - right.0.x / 2.0 - (4.7 - old)).abs() < 1e-5);
        let left = row.lay_out(Vec2::new(4.7, 2.0), Vec2::new(5.0, 2.0));
        assert!((left.1.x - left.0.x / 2.0 - (4.7 - newest)).abs() < 1e-5);
        assert!((left.1.x + left.0.x / 2.0 - (5.0 + old)).abs() < 1e-5);
    }
}
