//! Sums of products for a few pixels and 16 channels at once, so that the sums stay in registers. Most of the time
//! goes here.
//!
//! Each sum is made by fused multiply-adds in a fixed order. It does not depend on the rest of the tile, on the width
//! of vectors, on threads, or on whether the machine has such instructions.

#![allow(clippy::needless_range_loop, reason = "indices by number keep sums in registers, and look alike")]

use std::mem::MaybeUninit;

use crate::instructions::macerator::{self, Scalar, Simd, VFma, Vector};

/// Number of channels at a time.
pub(crate) const LANES: usize = 16;

/// Number of rows at a time: with two vectors of 8 lanes each, the sums take 12 of 16 registers.
pub(crate) const ROWS: usize = 6;

/// Number of the last rows at a time: as many as their eight sums need to keep the machine busy.
const FEW_ROWS: usize = 4;

/// Number of rows at a time where a vector has all lanes and there are 32 registers; more leave too few for their
/// addresses.
pub(crate) const WIDE_ROWS: usize = 8;

/// A number for each of [`LANES`] channels.
pub(crate) type Lanes = [f32; LANES];

/// The extent of a window: `count` pieces of `len` numbers, at a distance of `step`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    pub(crate) count: usize,
    pub(crate) step: usize,
    pub(crate) len: usize,
}

/// Computes the sums of a window's numbers times `weights`, for the windows of `x` that begin at `starts`.
///
/// `weights` has `count * len` rows for each block of 16 channels, and the sums of each block start from `first`.
/// `store` gets the number of the window, the block and the sums. For each block it gets all windows in order, or,
/// where allowed, those of two blocks in turn, which is faster.
#[macerator::with_simd]
pub(crate) fn correlate<S: Simd, F: Fn(usize) -> Lanes, G: FnMut(usize, usize, &Lanes)>(
    x: &[f32],
    starts: &[usize],
    window: Window,
    weights: &[Lanes],
    first: F,
    in_turn: bool,
    store: G,
) {
    {
        let rows = window.count * window.len;
        let mut strips = Strips { x, starts, window, first, store };
        let mut block = 0;
        if is_wide::<S>() && in_turn {
            for weights in weights.chunks_exact(2 * rows) {
                strips.sum::<Vector<S, f32>, WIDE_ROWS, WIDE_ROWS, 2>(weights, block);
                block += 2;
            }
        }
        for weights in weights[block * rows..].chunks_exact(rows) {
            match parts::<S>() {
                Some(1) => strips.sum::<Vector<S, f32>, WIDE_ROWS, WIDE_ROWS, 1>(weights, block),
                Some(2) => strips.sum::<Vector<S, f32>, ROWS, FEW_ROWS, 2>(weights, block),
                Some(4) => strips.sum::<Vector<S, f32>, ROWS, FEW_ROWS, 4>(weights, block),
                _ => strips.sum::<Lanes, ROWS, FEW_ROWS, 1>(weights, block),
            }
            block += 1;
        }
    }
}

/// Returns whether the next tile is one of `P` rows, and not of `Q`, which are fewer, or as many.
#[inline(always)]
fn is_for_many<const P: usize, const Q: usize>(left: usize) -> bool {
    P == Q || left > 2 * Q || (Q + 1..=P).contains(&left)
}

/// Returns whether a vector has room for all lanes; then there are 32 of them.
#[inline(always)]
pub(crate) fn is_wide<S: Simd>() -> bool {
    parts::<S>() == Some(1)
}

/// Returns the number of vectors for all lanes, of a machine that multiplies and adds at once.
#[inline(always)]
pub(crate) fn parts<S: Simd>() -> Option<usize> {
    f32::is_accelerated::<S>().then(|| LANES / f32::lanes::<S>())
}

/// Returns the channels that begin at a position.
#[inline(always)]
pub(crate) fn lanes_at(x: &[f32], at: usize) -> &Lanes {
    let Some(lanes) = x[at..].first_chunk::<LANES>() else { unreachable!("images have slack behind their last pixel") };
    lanes
}

/// Numbers of neighbouring channels that loops compute with at once: those of a vector, or all lanes of a block.
///
/// With arrays alone, compilers often keep sums in memory.
pub(crate) trait Part: Copy {
    /// Number of them.
    fn len() -> usize;

    /// Returns as many of one number.
    fn of(x: f32) -> Self;

    /// Returns the first ones of a slice.
    fn read(from: &[f32]) -> Self;

    /// Overwrites the first ones of a slice.
    fn write(self, to: &mut [f32]);

    /// Returns x y + self, rounded once.
    fn plus(self, x: Self, y: Self) -> Self;
}

impl<S: Simd> Part for Vector<S, f32> {
    #[inline(always)]
    fn len() -> usize {
        f32::lanes::<S>()
    }

    #[inline(always)]
    fn of(x: f32) -> Self {
        x.splat()
    }

    #[inline(always)]
    #[expect(unsafe_code, reason = "the slice is as long as a vector")]
    fn read(from: &[f32]) -> Self {
        unsafe { macerator::vload_unaligned(from[..Self::len()].as_ptr()) }
    }

    #[inline(always)]
    #[expect(unsafe_code, reason = "the slice is as long as a vector")]
    fn write(self, to: &mut [f32]) {
        unsafe { macerator::vstore_unaligned(to[..Self::len()].as_mut_ptr(), self) }
    }

    #[inline(always)]
    fn plus(self, x: Self, y: Self) -> Self {
        x.fma(y, self)
    }
}

impl Part for Lanes {
    #[inline(always)]
    fn len() -> usize {
        LANES
    }

    #[inline(always)]
    fn of(x: f32) -> Self {
        [x; LANES]
    }

    #[inline(always)]
    fn read(from: &[f32]) -> Self {
        *lanes_at(from, 0)
    }

    #[inline(always)]
    fn write(self, to: &mut [f32]) {
        to[..LANES].copy_from_slice(&self);
    }

    #[inline(always)]
    fn plus(self, x: Self, y: Self) -> Self {
        let (mut sums, mut is_rare) = ([0.0; LANES], false);
        for l in 0..LANES {
            // The product is exact.
            let sum = f64::from(x[l]) * f64::from(y[l]) + f64::from(self[l]);
            is_rare |= may_round_twice(sum);
            sums[l] = sum as f32;
        }
        if is_rare { rare_sums(self, x, y) } else { sums }
    }
}

/// Returns the number of blocks that `N` parts fill: one or two.
#[inline(always)]
pub(crate) fn blocks<T: Part, const N: usize>() -> usize {
    N * T::len() / LANES
}

/// Returns the block, and the first of its lanes, of a part of blocks that follow one another.
#[inline(always)]
pub(crate) fn place<T: Part>(part: usize) -> (usize, usize) {
    (part * T::len() / LANES, part * T::len() % LANES)
}

/// Returns the numbers of a row, `N` parts, from blocks of `rows` rows each.
#[inline(always)]
pub(crate) fn row_of<T: Part, const N: usize>(blocks: &[Lanes], rows: usize, row: usize) -> [T; N] {
    let mut parts = [T::of(0.0); N];
    for n in 0..N {
        let (block, lane) = place::<T>(n);
        parts[n] = T::read(&blocks[block * rows + row][lane..]);
    }
    parts
}

/// Overwrites what [`row_of`] returns.
#[inline(always)]
pub(crate) fn write_row<T: Part, const N: usize>(parts: [T; N], blocks: &mut [Lanes], rows: usize, row: usize) {
    for n in 0..N {
        let (block, lane) = place::<T>(n);
        parts[n].write(&mut blocks[block * rows + row][lane..]);
    }
}

/// Windows, and what becomes of their sums.
struct Strips<'a, F, G> {
    x: &'a [f32],
    starts: &'a [usize],
    window: Window,
    first: F,
    store: G,
}

impl<F: Fn(usize) -> Lanes, G: FnMut(usize, usize, &Lanes)> Strips<'_, F, G> {
    /// Computes the sums of all windows for the blocks that `N` parts fill: `P` windows at a time, and `Q` where that leaves
    /// fewer places of the last tile empty.
    #[inline(always)]
    fn sum<T: Part, const P: usize, const Q: usize, const N: usize>(&mut self, weights: &[Lanes], block: usize) {
        let mut found = [[0.0; LANES]; 2];
        for to in 0..blocks::<T, N>() {
            found[to] = (self.first)(block + to);
        }
        let first = row_of::<T, N>(&found, 1, 0);
        let mut done = 0;
        while done < self.starts.len() {
            let left = self.starts.len() - done;
            done += if is_for_many::<P, Q>(left) {
                self.tile::<T, P, N>(done, weights, block, first)
            } else {
                self.tile::<T, Q, N>(done, weights, block, first)
            };
        }
    }

    /// Does it for up to `P` windows, from this one on, and returns their number.
    #[inline(always)]
    fn tile<T: Part, const P: usize, const N: usize>(
        &mut self,
        from: usize,
        weights: &[Lanes],
        block: usize,
        first: [T; N],
    ) -> usize {
        let starts = &self.starts[from..];
        let count = starts.len().min(P);
        let mut at = [0; P];
        for p in 0..P {
            // The last one stands in for those behind it.
            at[p] = starts[p.min(count - 1)];
        }
        let sums = tile_sums::<T, P, N>(self.x, at, self.window, weights, first);
        let mut found = [[0.0; LANES]; 2];
        // A loop: compilers do not inline what is called from many places.
        for (p, sums) in sums[..count].iter().enumerate() {
            write_row(*sums, &mut found, 1, 0);
            for of in 0..blocks::<T, N>() {
                (self.store)(from + p, block + of, &found[of]);
            }
        }
        count
    }
}

#[inline(always)]
fn tile_sums<T: Part, const P: usize, const N: usize>(
    x: &[f32],
    at: [usize; P],
    window: Window,
    weights: &[Lanes],
    first: [T; N],
) -> [[T; N]; P] {
    let mut sums = [first; P];
    let (one, other) = weights.split_at(weights.len() / blocks::<T, N>() * (blocks::<T, N>() - 1));
    let one = if blocks::<T, N>() == 1 { other } else { one };
    let pieces = one.chunks_exact(window.len).zip(other.chunks_exact(window.len));
    for (piece, (one, other)) in pieces.enumerate() {
        let mut seen = [&x[..0]; P];
        for p in 0..P {
            seen[p] = &x[at[p] + piece * window.step..][..one.len()];
        }
        for (k, (one, other)) in one.iter().zip(other).enumerate() {
            let mut weights = first;
            for n in 0..N {
                let (block, lane) = place::<T>(n);
                weights[n] = T::read(&[one, other][block][lane..]);
            }
            for p in 0..P {
                let x = T::of(seen[p][k]);
                for n in 0..N {
                    sums[p][n] = sums[p][n].plus(x, weights[n]);
                }
            }
        }
    }
    sums
}

/// Returns whether a number next to this rounded one may be another `f32` than the number itself: whether it is a middle
/// between two, or so small that there are fewer of them.
#[inline(always)]
fn may_round_twice(sum: f64) -> bool {
    const MIDDLE: u32 = 1 << (f64::MANTISSA_DIGITS - f32::MANTISSA_DIGITS - 1);
    let below = sum.to_bits() as u32 & (2 * MIDDLE - 1);
    below == MIDDLE || sum != 0.0 && sum.abs() < f64::from(f32::MIN_POSITIVE)
}

/// Does [`Part::plus`] where a sum may have been rounded twice.
#[cold]
#[inline(never)]
fn rare_sums(mut sums: Lanes, x: Lanes, y: Lanes) -> Lanes {
    for l in 0..LANES {
        sums[l] = fused_of_doubles(x[l], y[l], sums[l]);
    }
    sums
}

/// Returns x y + z, rounded once, by sums of doubles, which every machine has.
///
/// The product is exact as a double. The sum is rounded to odd: where it is not exact, its last bit is 1. So it lies on the
/// right side of every middle between two `f32`s, and the second rounding does what a single one would (Boldo and Melquiond
/// 2008, "Emulation of a FMA and correctly rounded sums: proved algorithms using rounding to odd").
#[inline(always)]
fn fused_of_doubles(x: f32, y: f32, z: f32) -> f32 {
    let (product, z) = (f64::from(x) * f64::from(y), f64::from(z));
    let sum = product + z;
    // What the rounding of the sum has cut off (Knuth), exactly; NaN if the sum is not finite.
    let of_z = sum - product;
    let rest = (product - (sum - of_z)) + (z - of_z);
    let bits = sum.to_bits();
    // A step of an even number towards the exact sum, away from 0 or nearer to it.
    let step = if (rest > 0.0) == (sum > 0.0) { 1 } else { u64::MAX };
    let is_between = rest.abs() > 0.0 && bits & 1 == 0;
    f64::from_bits(if is_between { bits.wrapping_add(step) } else { bits }) as f32
}

// Sums over the windows of an image: the gradients of a convolution's weights and biases.

/// Pixels after which [`outer`] goes on to other weights, while these pixels are in the first-level cache.
pub(crate) const BLOCK: usize = 128;

/// Numbers of a row of a 3×3 window with three colours: few enough to be taken at once.
const COLOURS: usize = 9;

/// Adds to `sums` the products of each window's numbers with the `channels` numbers of `y` that go with the window,
/// summed over the windows. That is the gradient of [`correlate`]'s weights, in their order.
#[macerator::with_simd]
pub(crate) fn outer<S: Simd>(
    x: &[f32],
    starts: &[usize],
    window: Window,
    y: &[f32],
    places: &[usize],
    sums: &mut [Lanes],
) {
    {
        let rows = window.count * window.len;
        for (starts, places) in starts.chunks(BLOCK).zip(places.chunks(BLOCK)) {
            let pairs = Pairs { x, starts, places, window };
            let mut block = 0;
            if is_wide::<S>() {
                for sums in sums.chunks_exact_mut(2 * rows) {
                    pairs.add_all::<Vector<S, f32>, WIDE_ROWS, WIDE_ROWS, 2>(&y[block * LANES..], sums);
                    block += 2;
                }
            }
            for sums in sums[block * rows..].chunks_exact_mut(rows) {
                let y = &y[block * LANES..];
                match parts::<S>() {
                    Some(1) if window.len == COLOURS => pairs.add_all::<Vector<S, f32>, COLOURS, COLOURS, 1>(y, sums),
                    Some(1) => pairs.add_all::<Vector<S, f32>, WIDE_ROWS, WIDE_ROWS, 1>(y, sums),
                    Some(2) => pairs.add_all::<Vector<S, f32>, ROWS, FEW_ROWS, 2>(y, sums),
                    Some(4) => pairs.add_all::<Vector<S, f32>, ROWS, FEW_ROWS, 4>(y, sums),
                    _ => pairs.add_all::<Lanes, ROWS, FEW_ROWS, 1>(y, sums),
                }
                block += 1;
            }
        }
    }
}

/// Windows, and the pixels that go with them.
struct Pairs<'a> {
    x: &'a [f32],
    starts: &'a [usize],
    places: &'a [usize],
    window: Window,
}

impl Pairs<'_> {
    /// Adds the products of all numbers of each window to their sums, for the blocks that `N` parts fill: `P` numbers at a
    /// time, and `Q` where that leaves fewer places of the last tile empty.
    #[inline(always)]
    #[expect(unsafe_code, reason = "as many numbers are read as were written")]
    fn add_all<T: Part, const P: usize, const Q: usize, const N: usize>(&self, y: &[f32], sums: &mut [Lanes]) {
        // All of it is read for each tile, and rows that are far apart may share few lines of the cache.
        let mut of_y = [const { MaybeUninit::<[T; N]>::uninit() }; BLOCK];
        let of_y = &mut of_y[..self.places.len()];
        for (to, &place) in of_y.iter_mut().zip(self.places) {
            let y = &y[place..][..N * T::len()];
            let mut parts = [T::of(0.0); N];
            for n in 0..N {
                parts[n] = T::read(&y[n * T::len()..]);
            }
            to.write(parts);
        }
        let of_y = unsafe { of_y.assume_init_ref() };
        for piece in 0..self.window.count {
            let mut done = 0;
            while done < self.window.len {
                let left = self.window.len - done;
                done += if is_for_many::<P, Q>(left) {
                    self.add::<T, P, N>(piece, done, of_y, sums)
                } else {
                    self.add::<T, Q, N>(piece, done, of_y, sums)
                };
            }
        }
    }

    /// Adds those of up to `P` numbers of a piece, from the one with this number on, and returns how many they are.
    #[inline(always)]
    fn add<T: Part, const P: usize, const N: usize>(
        &self,
        piece: usize,
        first: usize,
        of_y: &[[T; N]],
        sums: &mut [Lanes],
    ) -> usize {
        let Window { count, step, len } = self.window;
        let (rows, row, used) = (count * len, piece * len + first, P.min(len - first));
        let mut tile = [[T::of(0.0); N]; P];
        for p in 0..P {
            if p < used {
                tile[p] = row_of(sums, rows, row + p);
            }
        }
        let seen = &self.x[piece * step + first..];
        for (&start, y) in self.starts.iter().zip(of_y) {
            let Some(x) = seen[start..].first_chunk::<P>() else { unreachable!("windows have slack behind them") };
            for p in 0..P {
                let x = T::of(x[p]);
                for n in 0..N {
                    tile[p][n] = tile[p][n].plus(x, y[n]);
                }
            }
        }
        for p in 0..P {
            if p < used {
                write_row(tile[p], sums, rows, row + p);
            }
        }
        used
    }
}

/// Adds the `channels` numbers at each of `places` to `sums`.
#[macerator::with_simd]
#[allow(clippy::extra_unused_type_parameters, reason = "S says which instructions the loop is compiled for")]
pub(crate) fn column_sums<S: Simd>(y: &[f32], places: &[usize], sums: &mut [Lanes]) {
    {
        for (block, sums) in sums.iter_mut().enumerate() {
            let y = &y[block * LANES..];
            let mut total = *sums;
            for &place in places {
                total.iter_mut().zip(lanes_at(y, place)).for_each(|(sum, y)| *sum += y);
            }
            *sums = total;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::rng::{Streams, below, unit};

    #[test]
    fn doubles_round_a_multiply_add_once() {
        let mut rng = Streams::new(1).stream("fused", 0);
        let mut twice = 0;
        let is_same = |one: f32, other: f32| one.to_bits() == other.to_bits() || one.is_nan() && other.is_nan();
        for _ in 0..2_000_000 / LANES {
            let (mut x, mut y, mut z) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
            for l in 0..LANES {
                let any;
                [x[l], y[l], any] = [(); 3].map(|()| f32::from_bits(below(&mut rng, 1 << 32) as u32));
                z[l] = match l % 3 {
                    // About as large as the product, so that bits meet.
                    0 => -x[l] * y[l] * (1.0 + f32::EPSILON * (8.0 * unit(&mut rng) - 4.0) as f32),
                    1 => x[l] * y[l] * 2f32.powi(below(&mut rng, 30) as i32 - 15) * (1.0 + unit(&mut rng) as f32),
                    _ => any,
                };
            }
            let got = z.plus(x, y);
            for l in 0..LANES {
                let (x, y, z) = (x[l], y[l], z[l]);
                let (want, got, alone) = (x.mul_add(y, z), got[l], fused_of_doubles(x, y, z));
                assert!(
                    is_same(got, want) && is_same(alone, want),
                    "{x:e} {y:e} {z:e}: {got:e} and {alone:e}, {want:e}"
                );
                twice += u32::from((x * y + z).to_bits() != want.to_bits());
            }
        }
        assert!(twice > 100_000, "only {twice} cases tell one rounding from two");
    }

    #[test]
    fn a_sum_just_beside_a_middle_is_rounded_to_its_side() {
        // 1 + 2^-24 lies in the middle between two numbers, and the product moves it by less than a double tells.
        let (middle, tiny) = (1.0 + f32::EPSILON, 2f32.powi(-60));
        for sign in [1.0, -1.0] {
            let (x, y, z) = (f32::EPSILON / 2.0, 1.0 + sign * f32::EPSILON, middle);
            assert_eq!([z; LANES].plus([x; LANES], [y; LANES]), [x.mul_add(y, z); LANES]);
            assert_eq!(fused_of_doubles(sign * tiny, tiny, 1.0), (sign * tiny).mul_add(tiny, 1.0));
            // A quarter, half and three quarters of the smallest number, and a little beside.
            for quarters in 1..4 {
                let (x, y) = (quarters as f32 * 2f32.powi(-76), 2f32.powi(-75));
                for z in [0.0, f32::from_bits(1), f32::from_bits(1 << 20)] {
                    let y = y * (1.0 + sign * f32::EPSILON);
                    assert_eq!([z; LANES].plus([x; LANES], [y; LANES]), [x.mul_add(y, z); LANES], "{quarters} {z:e}");
                }
            }
        }
        assert_eq!(fused_of_doubles(1.0, -0.0, 0.0).to_bits(), 0.0f32.to_bits());
        assert_eq!(fused_of_doubles(f32::MAX, 2.0, f32::NEG_INFINITY), f32::NEG_INFINITY);
        assert_eq!(fused_of_doubles(f32::MAX, 2.0, 0.0), f32::INFINITY);
        assert!(fused_of_doubles(f32::INFINITY, 0.0, 1.0).is_nan());
    }
}
