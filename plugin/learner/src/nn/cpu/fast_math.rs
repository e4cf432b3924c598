//! tanh and the logistic function over slices, in a form that compilers turn into vector instructions.
//!
//! Only sums, products, quotients and bit operations are used, in a fixed order for each element. A number has the
//! same result at any index of a slice, on any number of threads, and with any vector instructions. The coefficients
//! are minimax fits in relative error, by reweighted least squares.

use macerator::{AutoArch, Simd, WithSimd};
use rayon::prelude::*;

/// Numbers that one thread takes at a time.
const CHUNK: usize = 1 << 14;

/// Value at which [`tanh`] changes from its polynomial to the exponential form.
const TANH_SMALL: f32 = 0.625;
/// Value from which on tanh rounds to 1.
const TANH_ONE: f32 = 9.1;
/// tanh(x) = x + x³ P(x²) up to [`TANH_SMALL`]; from the constant term up.
const TANH_P: [f32; 5] = [-0.333_332_8, 0.133_314_42, -0.053_739_715, 0.020_639_088, -0.005_704_987_3];

/// exp(r) = 1 + r + r² Q(r) for |r| ≤ ln(2)/2; from the constant term up.
const EXP_Q: [f32; 5] = [0.499_999_94, 0.166_665_21, 0.041_668_39, 0.008_368_745, 0.001_381_454];
/// ln 2 in two parts: the first has so few bits that its product with a small integer is exact.
const LN_2: (f32, f32) = (0.693_359_4, -0.000_212_194_44);
/// Adding this rounds a small number to an integer, which is then in the low bits.
const ROUND: f32 = 12_582_912.0;

/// Returns tanh(x), within 2 units in the last place; NaN stays NaN.
#[inline(always)]
pub(super) fn tanh(x: f32) -> f32 {
    let a = x.abs();
    let square = x * x;
    let small = a + a * square * horner(&TANH_P, square);
    // The comparison is false for NaN, so NaN is kept.
    let bounded = if a > TANH_ONE { TANH_ONE } else { a };
    let large = 1.0 - 2.0 / (exp(2.0 * bounded) + 1.0);
    (if a < TANH_SMALL { small } else { large }).copysign(x)
}

/// Returns 1 / (1 + exp(-x)), within 4 units in the last place above -87 and below 1e-37 under it; NaN stays NaN.
#[inline(always)]
pub(super) fn sigmoid(x: f32) -> f32 {
    // The comparisons are false for NaN, so NaN is kept.
    let y = if x < -87.0 { 87.0 } else { -x };
    let y = if y < -87.0 { -87.0 } else { y };
    1.0 / (1.0 + exp(y))
}

/// Writes exp of each number up to 88; below -87 the result stays e^-87. NaN stays NaN.
#[inline(always)]
pub(super) fn exp_into(values: &[f32], to: &mut [f32]) {
    // The comparison is false for NaN, so NaN is kept.
    to.iter_mut().zip(values).for_each(|(to, &x)| *to = exp(if x < -87.0 { -87.0 } else { x }));
}

/// Returns exp of each number, as [`exp_into`] does.
pub(in crate::nn) fn exp_of(values: &[f32]) -> Vec<f32> {
    let mut exps = vec![0.0; values.len()];
    vectorized(|| exp_into(values, &mut exps));
    exps
}

/// Returns exp(x) for |x| ≤ 88.
#[inline(always)]
fn exp(x: f32) -> f32 {
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = x - k * LN_2.0 - k * LN_2.1;
    let two_to_k = f32::from_bits((shifted.to_bits().wrapping_add(127)) << 23);
    (1.0 + (r + r * r * horner(&EXP_Q, r))) * two_to_k
}

#[inline(always)]
fn horner(coefficients: &[f32; 5], x: f32) -> f32 {
    let [c0, c1, c2, c3, c4] = *coefficients;
    (((c4 * x + c3) * x + c2) * x + c1) * x + c0
}

/// Runs `loops` compiled for the widest vector instructions of this machine. Functions that it calls take part only
/// if they are inlined.
#[inline]
pub(in crate::nn) fn vectorized(loops: impl FnOnce()) {
    struct Loops<F>(F);

    impl<F: FnOnce()> WithSimd for Loops<F> {
        type Output = ();

        #[inline(always)]
        fn with_simd<S: Simd>(self) {
            (self.0)();
        }
    }

    AutoArch::new().dispatch(Loops(loops));
}

/// Replaces each number by its tanh.
pub(super) fn tanh_in_place(values: &mut [f32]) {
    values.par_chunks_mut(CHUNK).for_each(|chunk| vectorized(|| chunk.iter_mut().for_each(|x| *x = tanh(*x))));
}

/// Multiplies each number of `grad` by tanh' = 1 - y², where y is the tanh.
pub(super) fn tanh_backward(grad: &mut [f32], tanh: &[f32]) {
    grad.par_chunks_mut(CHUNK)
        .zip(tanh.par_chunks(CHUNK))
        .for_each(|(grad, y)| vectorized(|| grad.iter_mut().zip(y).for_each(|(g, &y)| *g *= 1.0 - y * y)));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns every 37th finite f32, both signs.
    fn floats() -> impl Iterator<Item = f32> {
        (0..f32::INFINITY.to_bits()).step_by(37).flat_map(|bits| [f32::from_bits(bits), -f32::from_bits(bits)])
    }

    /// Returns the distance between `got` and `want` in units in the last place of `want`.
    fn ulps(got: f32, want: f64) -> f64 {
        let near = (want as f32).abs().max(f32::MIN_POSITIVE);
        (f64::from(got) - want).abs() / f64::from(near.next_up() - near)
    }

    #[test]
    fn tanh_is_within_two_ulps_everywhere() {
        let worst = floats().map(|x| ulps(tanh(x), f64::from(x).tanh())).fold(0.0, f64::max);
        assert!(worst < 2.0, "{worst}");
        assert_eq!([tanh(f32::INFINITY), tanh(f32::NEG_INFINITY)], [1.0, -1.0]);
        assert_eq!(tanh(-0.0).to_bits(), (-0.0f32).to_bits());
        assert!(tanh(f32::NAN).is_nan() && tanh(-f32::NAN).is_nan());
    }

    #[test]
    fn sigmoid_is_within_four_ulps_down_to_minus_87() {
        let exact = |x: f32| 1.0 / (1.0 + (-f64::from(x)).exp());
        let worst = floats().filter(|x| *x > -87.0).map(|x| ulps(sigmoid(x), exact(x))).fold(0.0, f64::max);
        assert!(worst < 4.0, "{worst}");
        assert!(floats().filter(|x| *x <= -87.0).all(|x| (0.0..2e-38).contains(&sigmoid(x))));
        assert_eq!(sigmoid(f32::INFINITY), 1.0);
        assert!((0.0..2e-38).contains(&sigmoid(f32::NEG_INFINITY)));
        assert!(sigmoid(f32::NAN).is_nan() && sigmoid(-f32::NAN).is_nan());
    }

    #[test]
    fn a_number_has_the_same_bits_wherever_it_stands() {
        let x: Vec<f32> = (0..3 * CHUNK + 5).map(|i| (i % 2401) as f32 * 0.01 - 12.0).collect();
        let mut whole = x.clone();
        tanh_in_place(&mut whole);
        for (i, (&x, got)) in x.iter().zip(&whole).enumerate() {
            assert_eq!(got.to_bits(), tanh(x).to_bits(), "at {i}");
        }
        let mut part = x[1..8].to_vec();
        tanh_in_place(&mut part);
        assert_eq!(part, whole[1..8]);
    }
}
