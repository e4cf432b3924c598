//! Painting grids of tiles.

use std::ops::Range;

use super::{
    canvas::{Canvas, Inverse, centre},
    colour::Rgba,
    error::Undrawable,
    quad::Quad,
    texture::Texture,
};
use crate::vision::TileLayer;

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
