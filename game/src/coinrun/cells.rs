//! Coverage of the cells of a view by squares.

use crate::coinrun::tile::{REACH, SIDE, SIZE};

/// One tile more than cells, since the edge of the view cuts through tiles; and room for whole registers.
const WIDE: usize = 16;

/// The cells of a view, which lie across the tiles of the level.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    /// Left and bottom edge of the view, in tiles.
    left: f32,
    bottom: f32,
}

impl Cells {
    /// Returns the cells around the centre of a player.
    pub fn around(x: f32, y: f32) -> Self {
        let reach = REACH as f32 + 0.5;
        Self { left: x - reach, bottom: y - reach }
    }

    /// Fills an empty plane, `[SIDE × SIDE]`, from the tiles whose bits are set in `rows`. `outside` gives the bits
    /// beyond the rows: all set or all clear.
    ///
    /// It adds for each cell the sums of [`cover`](Self::cover) for each tile, in the same order.
    pub fn fill(&self, rows: &[u64; SIZE as usize], outside: u64, plane: &mut [f32]) {
        let (left, bottom) = (self.left.floor(), self.bottom.floor());
        let (across, up) = (shares(left, self.left), shares(bottom, self.bottom));
        let tiles = |row: usize| {
            let at = bottom as i32 + row as i32;
            let bits = usize::try_from(at).ok().and_then(|at| rows.get(at).copied()).unwrap_or(outside);
            window(bits, outside, left as i32)
        };
        let mut low = tiles(0);
        for (row, cells) in plane.chunks_exact_mut(SIDE).enumerate() {
            let high = tiles(row + 1);
            if low | high != 0 {
                let sums = [(low, up.own[row]), (high, up.next[row])];
                fill_row(sums, &across, cells);
            }
            low = high;
        }
    }

    /// Adds the square of one tile whose bottom left corner is (x, y) to the up to four cells it lies in, by area.
    pub fn cover(&self, x: f32, y: f32, plane: &mut [f32]) {
        let reach = -1.0..SIDE as f32;
        if !reach.contains(&(x - self.left)) || !reach.contains(&(y - self.bottom)) {
            return;
        }
        let (column, row) = ((x - self.left).floor(), (y - self.bottom).floor());
        let (right_share, upper_share) = (x - self.left - column, y - self.bottom - row);
        let side = SIDE as i32;
        for (row, height) in [(row as i32, 1.0 - upper_share), (row as i32 + 1, upper_share)] {
            for (column, width) in [(column as i32, 1.0 - right_share), (column as i32 + 1, right_share)] {
                if (0..side).contains(&row) && (0..side).contains(&column) {
                    let cell = &mut plane[(row * side + column) as usize];
                    *cell = (*cell + width * height).min(1.0);
                }
            }
        }
    }
}

/// Coverage of each cell of a row or a column by the tile of its own number, and by the next tile.
struct Shares {
    own: [f32; WIDE],
    next: [f32; WIDE],
}

/// Shares of the cells that begin at `edge`. Tile 0 begins at `first`, at most one to the left of it.
fn shares(first: f32, edge: f32) -> Shares {
    let (mut own, mut before) = ([0.0; WIDE], [0.0; WIDE + 1]);
    for tile in 0..=SIDE {
        let at = first + tile as f32 - edge;
        // The tile begins in the cell before its own one, or just where that one begins: then it covers all of it.
        let share = at - (tile as f32 - 1.0);
        (own[tile], before[tile]) = (share, 1.0 - share);
    }
    Shares { own, next: std::array::from_fn(|cell| before[cell + 1]) }
}

/// Returns the bits of the tiles from column `left` on, the first lowest.
fn window(bits: u64, outside: u64, left: i32) -> u32 {
    let beyond = u128::from(outside);
    let wide = (beyond << 64 | u128::from(bits)).rotate_right(left.clamp(-SIZE, SIZE).rem_euclid(128) as u32);
    wide as u32 & ((1 << (SIDE + 1)) - 1)
}

/// Sums the coverage of a row of cells by the tiles of two rows. The order is from left to right and from the low row
/// to the high one.
fn fill_row(rows: [(u32, f32); 2], across: &Shares, cells: &mut [f32]) {
    let mut sums = [0.0_f32; WIDE];
    for (bits, height) in rows {
        let is_set: [f32; WIDE] = std::array::from_fn(|tile| if bits & 1 << tile != 0 { height } else { 0.0 });
        let is_next_set: [f32; WIDE] = std::array::from_fn(|tile| if bits & 2 << tile != 0 { height } else { 0.0 });
        for cell in 0..WIDE {
            sums[cell] = most_one(sums[cell] + across.own[cell] * is_set[cell]);
            sums[cell] = most_one(sums[cell] + across.next[cell] * is_next_set[cell]);
        }
    }
    cells.copy_from_slice(&sums[..SIDE]);
}

fn most_one(value: f32) -> f32 {
    if value < 1.0 { value } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Fills tile by tile: the reference of [`Cells::fill`], which must equal it to the bit.
    fn fill_tile_by_tile(cells: &Cells, rows: &[u64; SIZE as usize], outside: u64) -> Vec<f32> {
        let mut plane = vec![0.0; SIDE * SIDE];
        for row in 0..=SIDE as i32 {
            for column in 0..=SIDE as i32 {
                let (x, y) = (cells.left.floor() as i32 + column, cells.bottom.floor() as i32 + row);
                let is_inside = (0..SIZE).contains(&x) && (0..SIZE).contains(&y);
                let bits = if is_inside { rows[y as usize] >> x } else { outside };
                if bits & 1 == 1 {
                    cells.cover(x as f32, y as f32, &mut plane);
                }
            }
        }
        plane
    }

    #[test]
    fn a_filled_plane_is_the_sum_of_its_tiles() {
        let mut draw = ChaCha8Rng::seed_from_u64(3);
        for case in 0..20_000 {
            let density = draw.random_range(0..3);
            let rows: [u64; SIZE as usize] = std::array::from_fn(|_| match density {
                0 => draw.random(),
                1 => draw.random::<u64>() & draw.random::<u64>() & draw.random::<u64>(),
                _ => draw.random::<u64>() | draw.random::<u64>() | draw.random::<u64>(),
            });
            let mut place = || {
                let value: f32 = draw.random_range(-2.0..66.0);
                let edge = value.floor() + 0.5;
                [value, edge, edge.next_up(), edge.next_down(), value, value, value.floor(), 6.5 + value * 1e-9]
                    [case % 8]
            };
            let cells = Cells::around(place(), place());
            for outside in [0, u64::MAX] {
                let mut plane = vec![0.0; SIDE * SIDE];
                cells.fill(&rows, outside, &mut plane);
                let plain = fill_tile_by_tile(&cells, &rows, outside);
                let bits = |plane: &[f32]| plane.iter().map(|share| share.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&plane), bits(&plain), "{cells:?}");
            }
        }
    }

    #[test]
    fn tiles_out_of_view_cover_nothing() {
        let cells = Cells::around(10.5, 10.5);
        for (x, y, is_seen) in [(3.0, 10.0, false), (3.5, 10.0, true), (16.5, 10.0, true), (17.0, 10.0, false)] {
            for (x, y) in [(x, y), (y, x)] {
                let mut plane = vec![0.0; SIDE * SIDE];
                cells.cover(x, y, &mut plane);
                assert_eq!(plane.iter().any(|&share| share > 0.0), is_seen, "{x} {y}");
            }
        }
    }
}
