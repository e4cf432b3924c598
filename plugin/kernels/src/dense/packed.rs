//! Weights in the orders in which products read them.

use crate::{
    kept_memory::{KeptMemory, OF_A_MOVE, share_each},
    tile::{LANES, Lanes},
};

/// A matrix to multiply with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Matrix<'a> {
    pub(crate) numbers: &'a [f32],
    /// Numbers of each row that the product reads.
    pub(crate) rows: usize,
    /// Numbers of each row that it writes.
    pub(crate) columns: usize,
    /// True if the numbers are those of the transpose, `[columns, rows]`.
    pub(crate) is_turned: bool,
}

impl Matrix<'_> {
    /// Writes a block of 16 columns.
    fn write(&self, block: usize, lanes: &mut [Lanes]) {
        let first = block * LANES;
        let count = LANES.min(self.columns - first);
        if self.is_turned {
            let of_block = &self.numbers[first * self.rows..];
            for (row, lanes) in lanes.iter_mut().enumerate() {
                lanes[count..].fill(0.0);
                for (lane, number) in lanes.iter_mut().enumerate().take(count) {
                    *number = of_block[lane * self.rows + row];
                }
            }
            return;
        }
        for (lanes, row) in lanes.iter_mut().zip(self.numbers.chunks_exact(self.columns)) {
            *lanes = block_of(row, block);
        }
    }
}

/// Weights for [`correlate`](crate::tile::correlate): for each block of 16 columns of a product its rows, 16
/// numbers each, zeros beyond the last column.
pub(crate) struct Packed {
    pub(super) rows: usize,
    pub(super) columns: usize,
    numbers: KeptMemory,
}

impl Packed {
    /// Returns the blocks.
    pub(super) fn lanes(&self) -> &[Lanes] {
        self.numbers.as_chunks().0
    }

    /// Packs one matrix.
    pub(crate) fn new(matrix: Matrix<'_>) -> Self {
        let mut packed = Self::unwritten(&matrix);
        Self::write(std::slice::from_mut(&mut packed), &[matrix]);
        packed
    }

    /// Packs each matrix.
    pub(super) fn all(matrices: &[Matrix<'_>]) -> Vec<Self> {
        let mut all: Vec<Self> = matrices.iter().map(Self::unwritten).collect();
        Self::write(&mut all, matrices);
        all
    }

    fn unwritten(&Matrix { rows, columns, .. }: &Matrix<'_>) -> Self {
        Self { rows, columns, numbers: KeptMemory::take(rows * columns.next_multiple_of(LANES)) }
    }

    fn write(all: &mut [Self], matrices: &[Matrix<'_>]) {
        let numbers: usize = matrices.iter().map(|matrix| matrix.numbers.len()).sum();
        let blocks = all.iter_mut().zip(matrices).flat_map(|(packed, matrix)| {
            let blocks = packed.numbers.as_chunks_mut::<LANES>().0.chunks_mut(matrix.rows);
            blocks.enumerate().map(move |(block, lanes)| (matrix, block, lanes))
        });
        let mut blocks: Vec<_> = blocks.collect();
        share_each(&mut blocks, numbers * OF_A_MOVE, |_, (matrix, block, lanes)| matrix.write(*block, lanes));
    }
}

/// Returns the numbers of a block of 16; zeros beyond the last one.
#[inline(always)]
pub(super) fn block_of(numbers: &[f32], block: usize) -> Lanes {
    let rest = numbers.get(block * LANES..).unwrap_or(&[]);
    match rest.first_chunk() {
        Some(lanes) => *lanes,
        None => {
            let mut lanes = [0.0; LANES];
            lanes[..rest.len()].copy_from_slice(rest);
            lanes
        }
    }
}
