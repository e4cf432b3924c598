//! Weights in the orders in which products read them.

use super::share::share;
use crate::nn::cpu::kept_memory::KeptMemory;
use crate::nn::cpu::tile::{LANES, Lanes};

/// Weights for [`correlate`](crate::nn::cpu::tile::correlate): for each block of 16 columns of a product its rows, 16
/// numbers each, zeros beyond the last column.
pub(in crate::nn::cpu) struct Packed {
    pub(super) rows: usize,
    pub(super) columns: usize,
    numbers: KeptMemory,
}

impl Packed {
    /// The blocks.
    pub(super) fn lanes(&self) -> &[Lanes] {
        self.numbers.as_chunks().0
    }

    /// Of the matrix `[rows, columns]`.
    pub(in crate::nn::cpu) fn new(matrix: &[f32], rows: usize, columns: usize) -> Self {
        let mut numbers = KeptMemory::take(rows * columns.next_multiple_of(LANES));
        share(numbers.as_chunks_mut::<LANES>().0, rows.max(1), matrix.len(), |block, lanes| {
            let first = block * LANES;
            for (lanes, row) in lanes.iter_mut().zip(matrix.chunks_exact(columns)) {
                match row[first..].first_chunk() {
                    Some(row) => *lanes = *row,
                    None => {
                        *lanes = [0.0; LANES];
                        lanes.iter_mut().zip(&row[first..]).for_each(|(lane, number)| *lane = *number);
                    }
                }
            }
        });
        Self { rows, columns, numbers }
    }

    /// Of the transpose of the matrix `[columns, rows]`.
    pub(in crate::nn::cpu) fn transposed(matrix: &[f32], rows: usize, columns: usize) -> Self {
        let mut numbers = KeptMemory::take(rows * columns.next_multiple_of(LANES));
        share(numbers.as_chunks_mut::<LANES>().0, rows.max(1), matrix.len(), |block, lanes| {
            let of_block = &matrix[block * LANES * rows..];
            let count = LANES.min(columns - block * LANES);
            for (row, lanes) in lanes.iter_mut().enumerate() {
                lanes[count..].fill(0.0);
                for (lane, number) in lanes.iter_mut().enumerate().take(count) {
                    *number = of_block[lane * rows + row];
                }
            }
        });
        Self { rows, columns, numbers }
    }
}
