//! Max-pooling of 3×3 pixels, at every second pixel.

use crate::{
    instructions::macerator::{self, Simd},
    tile::{LANES, Lanes},
    trunk::grid::{Grid, window_places},
};
use std::ops::Range;

/// Side of the window.
const SIDE: usize = 3;

/// Returns the side of the pooled image.
pub(super) fn pooled(side: usize) -> usize {
    window_places(side, SIDE, 2, 1).unwrap_or(0)
}

/// Returns the rows or columns of a window that are inside an image of `side`: numbers in the window, from the one at
/// `start`.
#[inline(always)]
fn inside(place: usize, side: usize) -> Range<usize> {
    let first = usize::from(place == 0);
    first..SIDE.min(side + 1 - 2 * place)
}

/// Pools `x`; `marks` gets, for each channel of each pixel, the index of the (first) largest of the nine.
#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
pub(super) fn forward<S: Simd>(x: &[f32], from: Grid, y: &mut [f32], to: Grid, marks: &mut [u8]) {
    {
        let channels = from.channels;
        for row in 0..to.height {
            for column in 0..to.width {
                let marks = &mut marks[(row * to.width + column) * channels..][..channels];
                let y = &mut y[to.at(row, column)..][..channels];
                let parts = y.chunks_mut(LANES).zip(marks.chunks_mut(LANES)).enumerate();
                for (block, (y, marks)) in parts {
                    let (best, which) = largest(&x[block * LANES..], from, row, column);
                    y.iter_mut().zip(&best).for_each(|(y, best)| *y = *best);
                    marks.iter_mut().zip(&which).for_each(|(mark, which)| *mark = *which as u8);
                }
            }
        }
    }
}

#[inline(always)]
fn largest(x: &[f32], from: Grid, row: usize, column: usize) -> (Lanes, [u32; LANES]) {
    let (rows, columns) = (inside(row, from.height), inside(column, from.width));
    let mut best = [f32::NEG_INFINITY; LANES];
    let mut which = [(rows.start * SIDE + columns.start) as u32; LANES];
    for dy in rows {
        for dx in columns.clone() {
            // The border is part of the row: the window's corner is one pixel up and left.
            let at =
                (2 * row + dy + from.border - 1) * from.row() + (2 * column + dx + from.border - 1) * from.channels;
            let Some(x) = x[at..].first_chunk::<LANES>() else {
                unreachable!("images have slack behind their last pixel");
            };
            let number = (dy * SIDE + dx) as u32;
            for j in 0..LANES {
                // NaN wins, so that it is not hidden.
                let wins = x[j] > best[j] || x[j].is_nan();
                best[j] = if wins { x[j] } else { best[j] };
                which[j] = if wins { number } else { which[j] };
            }
        }
    }
    (best, which)
}

/// Computes the gradient of the pooled image's input; writes all of `to` inside the border.
pub(super) fn backward(grad: &[f32], of: Grid, marks: &[u8], to: &mut [f32], grid: Grid) {
    to.fill(0.0);
    let channels = grid.channels;
    let offsets: [usize; SIDE * SIDE] = std::array::from_fn(|tap| tap / SIDE * grid.row() + tap % SIDE * channels);
    for row in 0..of.height {
        for column in 0..of.width {
            let corner = (2 * row + grid.border - 1) * grid.row() + (2 * column + grid.border - 1) * channels;
            let grad = &grad[of.at(row, column)..][..channels];
            let marks = &marks[(row * of.width + column) * channels..][..channels];
            for (c, (grad, &mark)) in grad.iter().zip(marks).enumerate() {
                to[corner + offsets[usize::from(mark) % (SIDE * SIDE)] + c] += grad;
            }
        }
    }
}
