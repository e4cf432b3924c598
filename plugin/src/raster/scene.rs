//! The items that are drawn on a stage.

use crate::{
    raster::{
        RasterError, Undrawable,
        canvas::{Canvas, Curve, ImageRegion, Inverse, Pose, Quad, Rgba, SRGB, Tint, centre, lay_out},
        texture::{Texture, TextureId, Textures, Transparency},
    },
    vision::{Stage, TileLayer, lacks_image},
};
use bevy::{ecs::system::SystemParam, prelude::*, sprite::Anchor};
use std::ops::Range;

/// An item to draw, in the coordinates of its stage.
#[derive(Clone, Copy, Debug)]
pub(super) struct Item {
    pub z: f32,
    pub texture: TextureId,
    /// The sprite, or the first cell of the tiles.
    pub quad: Quad,
    pub kind: ItemKind,
}

/// The kind of an item.
#[derive(Clone, Copy, Debug)]
pub(super) enum ItemKind {
    Sprite { region: ImageRegion, colour: Color },
    Tiles(Entity),
}

/// Entities that may be on a stage, or hold one that is.
#[derive(SystemParam)]
pub(super) struct Stages<'w, 's> {
    parents: Query<'w, 's, &'static ChildOf>,
    places: Query<'w, 's, &'static Transform>,
    visibilities: Query<'w, 's, &'static Visibility>,
    stages: Query<'w, 's, (), With<Stage>>,
    things: Query<
        'w,
        's,
        (
            Option<&'static Transform>,
            Option<&'static Visibility>,
            Option<(&'static Sprite, &'static Anchor)>,
            Option<&'static TileLayer>,
            Option<&'static Children>,
            Has<Stage>,
        ),
    >,
    roots: Query<'w, 's, Entity, (Without<ChildOf>, Or<(With<Transform>, With<Children>)>)>,
    pub layers: Query<'w, 's, &'static TileLayer>,
    pub images: Res<'w, Assets<Image>>,
    pub layouts: Res<'w, Assets<TextureAtlasLayout>>,
}

impl Stages<'_, '_> {
    /// Returns the stage of an entity, if it is beneath one, and its position there.
    pub fn locate(&self, entity: Entity) -> Option<(Option<Entity>, Vec2)> {
        let mut pose = Pose::of(self.places.get(entity).ok()?);
        let mut lowest = entity;
        while let Ok(&ChildOf(parent)) = self.parents.get(lowest) {
            if self.stages.contains(parent) {
                return Some((Some(parent), pose.at.truncate()));
            }
            if let Ok(transform) = self.places.get(parent) {
                pose = Pose::of(transform).then(&pose);
            }
            lowest = parent;
        }
        Some((None, pose.at.truncate()))
    }

    /// Returns whether entities that inherit their visibility from this one are visible.
    fn is_visible(&self, mut entity: Entity) -> bool {
        loop {
            match self.visibilities.get(entity) {
                Ok(Visibility::Hidden) => return false,
                Ok(Visibility::Visible) => return true,
                _ => {}
            }
            match self.parents.get(entity) {
                Ok(&ChildOf(parent)) => entity = parent,
                Err(_) => return true,
            }
        }
    }

    /// Lists the items on a stage, or outside of all stages, parents before their children and
    /// children in order.
    pub fn gather(
        &self,
        stage: Option<Entity>,
        textures: &mut Textures,
        items: &mut Vec<Item>,
    ) -> Result<(), RasterError> {
        items.clear();
        let mut gathering = Gathering { stages: self, textures, items };
        let Some(stage) = stage else {
            return self.roots.iter().try_for_each(|root| gathering.visit(root, None, true));
        };
        let Ok((.., Some(children), _)) = self.things.get(stage) else { return Ok(()) };
        let visible = self.is_visible(stage);
        children.iter().try_for_each(|child| gathering.visit(child, None, visible))
    }
}

struct Gathering<'a, 'w, 's> {
    stages: &'a Stages<'w, 's>,
    textures: &'a mut Textures,
    items: &'a mut Vec<Item>,
}

impl Gathering<'_, '_, '_> {
    fn visit(&mut self, entity: Entity, parent: Option<&Pose>, visible: bool) -> Result<(), RasterError> {
        let Ok((transform, visibility, sprite, layer, children, is_stage)) = self.stages.things.get(entity) else {
            return Ok(());
        };
        if is_stage {
            return Ok(());
        }
        let visible = match visibility {
            Some(Visibility::Hidden) => false,
            Some(Visibility::Visible) => true,
            _ => visible,
        };
        let pose = transform.map(|transform| Pose::child(parent, transform));
        if let (true, Some(pose)) = (visible, &pose) {
            let blame = |why| RasterError::Thing(entity, why);
            if let Some((sprite, anchor)) = sprite {
                let item = self.sprite(sprite, anchor, pose).map_err(blame)?;
                self.items.push(item);
            }
            if let Some(layer) = layer {
                let item = self.tiles(entity, layer, pose).map_err(blame)?;
                self.items.push(item);
            }
        }
        let inherited = pose.as_ref().or(parent);
        children.map_or(Ok(()), |children| children.iter().try_for_each(|child| self.visit(child, inherited, visible)))
    }

    fn sprite(&mut self, sprite: &Sprite, anchor: &Anchor, pose: &Pose) -> Result<Item, Undrawable> {
        if lacks_image(sprite) {
            return Err(Undrawable::NoImage);
        }
        let texture = self.textures.find(&sprite.image, &self.stages.images)?;
        let image = self.textures.get(texture);
        let size = UVec2::new(image.width, image.height).as_vec2();
        let (quad, region) = lay_out(sprite, anchor, pose, size, &self.stages.layouts)?;
        Ok(Item { z: pose.at.z, texture, quad, kind: ItemKind::Sprite { region, colour: sprite.color } })
    }

    fn tiles(&mut self, entity: Entity, layer: &TileLayer, pose: &Pose) -> Result<Item, Undrawable> {
        if !layer.is_complete() {
            let TileLayer { columns, rows, ref cells, .. } = *layer;
            return Err(Undrawable::Cells { cells: cells.len(), columns, rows });
        }
        let texture = self.textures.find(&layer.tileset, &self.stages.images)?;
        let strip = self.textures.get(texture);
        if !strip.height.is_multiple_of(strip.width) {
            return Err(Undrawable::Strip { width: strip.width, height: strip.height });
        }
        let quad = Quad { corner: pose.at.truncate(), across: pose.x.truncate(), up: pose.y.truncate() };
        Ok(Item { z: pose.at.z, texture, quad, kind: ItemKind::Tiles(entity) })
    }
}

// Painting of sprites.

/// A sprite positioned on a picture.
pub(super) struct SpriteOn<'a> {
    /// In pixels.
    pub quad: Quad,
    pub region: ImageRegion,
    pub texture: &'a Texture,
    pub tint: Tint,
}

impl SpriteOn<'_> {
    /// Paints the sprite over the pixels that [`Canvas::cut`] returned. `columns` is working
    /// memory.
    pub fn paint(&self, canvas: &mut Canvas, area: (Range<usize>, Range<usize>), columns: &mut Vec<u32>) {
        let painter = Painter::new(self.texture.transparency, self.tint);
        if self.quad.across.y == 0.0 && self.quad.up.x == 0.0 {
            self.paint_upright(canvas, area, columns, painter);
        } else {
            self.paint_turned(canvas, area, painter);
        }
    }

    /// Paints an upright sprite: all pixels of a column show one column of texels, and all of a row
    /// one row.
    fn paint_upright(
        &self,
        canvas: &mut Canvas,
        (xs, ys): (Range<usize>, Range<usize>),
        columns: &mut Vec<u32>,
        mut painter: Painter,
    ) {
        let Texture { width, height, ref texels, .. } = *self.texture;
        let (quad, region) = (&self.quad, &self.region);
        let across = Axis::new(quad.corner.x, quad.across.x, region.start.x, region.size.x, width);
        let down = Axis::new(quad.corner.y, quad.up.y, region.start.y, region.size.y, height);
        columns.clear();
        columns.extend(xs.clone().map(|x| across.texel_under(x)));
        for y in ys {
            let from = down.texel_under(y) as usize * width as usize;
            painter.paint_row(canvas.row(y, &xs), &texels[from..from + width as usize], columns);
        }
    }

    fn paint_turned(&self, canvas: &mut Canvas, (xs, ys): (Range<usize>, Range<usize>), mut painter: Painter) {
        let Some(inverse) = Inverse::of(&self.quad) else { return };
        let Texture { width, height, ref texels, .. } = *self.texture;
        let region = &self.region;
        let across = Axis::new(0.0, 1.0, region.start.x, region.size.x, width);
        let up = Axis::new(0.0, 1.0, region.start.y, region.size.y, height);
        let inside = 0.0..1.0;
        for y in ys {
            for (x, pixel) in xs.clone().zip(canvas.row(y, &xs)) {
                let at = inverse.at(x, y);
                if inside.contains(&at.x) && inside.contains(&at.y) {
                    let texel = up.texel_at(at.y) as usize * width as usize + across.texel_at(at.x) as usize;
                    *pixel = painter.over(texels[texel], *pixel);
                }
            }
        }
    }
}

/// A map from a coordinate of the picture to that of a texel, along one axis.
struct Axis {
    from: f32,
    start: f32,
    texels_per_pixel: f32,
    first: i32,
    last: i32,
}

impl Axis {
    /// Creates an axis: a side of length `length`, which may be negative, starts at `corner` and
    /// shows `size` texels from `start` on.
    fn new(corner: f32, length: f32, start: f32, size: f32, texels: u32) -> Self {
        let (least, most) = (start.min(start + size), start.max(start + size));
        // Rounding must not select a neighbour on the sheet.
        let last = (most.ceil() as i32 - 1).clamp(0, texels as i32 - 1);
        Self { from: corner, start, texels_per_pixel: size / length, first: (least as i32).clamp(0, last), last }
    }

    #[inline]
    fn texel_under(&self, pixel: usize) -> u32 {
        self.texel_at(centre(pixel))
    }

    #[inline]
    fn texel_at(&self, at: f32) -> u32 {
        // A negative position is before the first texel, however it is rounded.
        let texel = self.start + (at - self.from) * self.texels_per_pixel;
        (texel as i32).clamp(self.first, self.last) as u32
    }
}

/// The blending of texels over pixels.
struct Painter {
    way: Way,
    tint: Tint,
    curve: &'static Curve,
    /// The last blend: texel, pixel before, pixel after. Neighbours are often alike.
    last: [Rgba; 3],
}

#[derive(Clone, Copy)]
enum Way {
    Copy,
    Cut,
    Mix,
}

impl Painter {
    fn new(transparency: Transparency, tint: Tint) -> Self {
        let way = match transparency {
            Transparency::Opaque if tint == Tint::NONE => Way::Copy,
            Transparency::Cutout if tint == Tint::NONE => Way::Cut,
            _ => Way::Mix,
        };
        // A transparent texel leaves a pixel as it is.
        Self { way, tint, curve: &SRGB, last: [[0; 4]; 3] }
    }

    fn paint_row(&mut self, pixels: &mut [Rgba], texels: &[Rgba], columns: &[u32]) {
        let row = pixels.iter_mut().zip(columns.iter().map(|column| texels[*column as usize]));
        match self.way {
            Way::Copy => row.for_each(|(pixel, texel)| *pixel = texel),
            Way::Cut => row.for_each(|(pixel, texel)| *pixel = if texel[3] == 0 { *pixel } else { texel }),
            Way::Mix => row.for_each(|(pixel, texel)| *pixel = self.mix(texel, *pixel)),
        }
    }

    fn over(&mut self, texel: Rgba, below: Rgba) -> Rgba {
        match self.way {
            Way::Copy => texel,
            Way::Cut if texel[3] == 0 => below,
            Way::Cut => texel,
            Way::Mix => self.mix(texel, below),
        }
    }

    fn mix(&mut self, texel: Rgba, below: Rgba) -> Rgba {
        if self.last[..2] != [texel, below] {
            self.last = [texel, below, self.curve.blend(texel, self.tint, below)];
        }
        self.last[2]
    }
}

// Painting of grids of tiles.

/// Smallest alpha of a texel that is drawn.
const OPAQUE: u8 = 128;

/// A grid of tiles positioned on a picture.
pub(super) struct TilesOn<'a> {
    /// The cell (0, 0), in pixels.
    pub cell: Quad,
    pub layer: &'a TileLayer,
    pub strip: &'a Texture,
}

/// Working memory.
#[derive(Debug, Default)]
pub(super) struct TileBuffers {
    columns: Vec<Run>,
    rows: Vec<Run>,
    /// Texel, from the left of its tile, of each column of pixels; and from the top, of each row.
    across: Vec<u32>,
    down: Vec<u32>,
    /// First texel of the tile of each run of columns, in the row of cells that is being painted.
    tiles: Vec<Option<u32>>,
}

/// Neighbouring pixels that show the same row or column of cells.
#[derive(Debug)]
struct Run {
    pixels: Range<usize>,
    cell: i32,
}

impl TilesOn<'_> {
    /// Paints the tiles.
    pub fn paint(&self, canvas: &mut Canvas, buffers: &mut TileBuffers) -> Result<(), Undrawable> {
        if self.cell.across.y == 0.0 && self.cell.up.x == 0.0 {
            self.paint_upright(canvas, buffers)
        } else {
            self.paint_turned(canvas)
        }
    }

    fn paint_upright(&self, canvas: &mut Canvas, buffers: &mut TileBuffers) -> Result<(), Undrawable> {
        let TileBuffers { columns, rows, across, down, tiles } = buffers;
        let (side, cell) = (self.strip.width as usize, &self.cell);
        find_runs(cell.corner.x, cell.across.x, canvas.width, side, false, columns, across);
        find_runs(cell.corner.y, cell.up.y, canvas.height, side, true, rows, down);
        for row in rows {
            tiles.clear();
            for column in &*columns {
                tiles.push(self.first_texel(column.cell, row.cell)?);
            }
            for y in row.pixels.clone() {
                let pixels = canvas.row(y, &(0..across.len()));
                let below = down[y] as usize * side;
                for (column, tile) in columns.iter().zip(&*tiles) {
                    let Some(tile) = *tile else { continue };
                    let from = tile as usize + below;
                    let texels = &self.strip.texels[from..from + side];
                    let run = column.pixels.clone();
                    for (pixel, texel) in pixels[run.clone()].iter_mut().zip(&across[run]) {
                        *pixel = over(texels[*texel as usize], *pixel);
                    }
                }
            }
        }
        Ok(())
    }

    fn paint_turned(&self, canvas: &mut Canvas) -> Result<(), Undrawable> {
        let Some(inverse) = Inverse::of(&self.cell) else { return Ok(()) };
        let side = self.strip.width as usize;
        for y in 0..canvas.height {
            for x in 0..canvas.width {
                let at = inverse.at(x, y);
                let (column, row) = (floor(at.x), floor(at.y));
                let Some(tile) = self.first_texel(column, row)? else { continue };
                let across = texel_in(at.x - column as f32, side);
                let down = texel_in(1.0 - (at.y - row as f32), side);
                let pixel = &mut canvas.pixels[y * canvas.width + x];
                *pixel = over(self.strip.texels[tile as usize + down as usize * side + across as usize], *pixel);
            }
        }
        Ok(())
    }

    /// Returns the first texel of a cell's tile on the strip.
    fn first_texel(&self, column: i32, row: i32) -> Result<Option<u32>, Undrawable> {
        let tile = self.layer.tile(column, row);
        let side = self.strip.width;
        let tiles = self.strip.height / side;
        match u32::from(tile) {
            _ if tile == TileLayer::EMPTY => Ok(None),
            number if number < tiles => Ok(Some(number * side * side)),
            _ => Err(Undrawable::Tile { tile, tiles }),
        }
    }
}

/// Draws a texel over a pixel.
#[inline]
fn over([red, green, blue, alpha]: Rgba, below: Rgba) -> Rgba {
    if alpha >= OPAQUE { [red, green, blue, 255] } else { below }
}

/// Finds cells and texels along one axis. `flip` counts texels from the far end of a cell.
fn find_runs(
    corner: f32,
    length: f32,
    pixels: usize,
    side: usize,
    flip: bool,
    runs: &mut Vec<Run>,
    texels: &mut Vec<u32>,
) {
    runs.clear();
    texels.clear();
    let cells_per_pixel = 1.0 / length;
    if !cells_per_pixel.is_finite() {
        return;
    }
    for pixel in 0..pixels {
        let at = (centre(pixel) - corner) * cells_per_pixel;
        let cell = floor(at);
        let within = at - cell as f32;
        texels.push(texel_in(if flip { 1.0 - within } else { within }, side));
        match runs.last_mut() {
            Some(run) if run.cell == cell => run.pixels.end = pixel + 1,
            _ => runs.push(Run { pixels: pixel..pixel + 1, cell }),
        }
    }
}

/// Returns the texel at a position in a tile, 0 to 1.
fn texel_in(within: f32, side: usize) -> u32 {
    ((within * side as f32) as u32).min(side as u32 - 1)
}

/// Rounds down to an integer.
fn floor(x: f32) -> i32 {
    let cut = x as i32;
    cut - i32::from(x < cut as f32)
}
