//! Functions of single numbers and rows, in a form that compilers turn into vector instructions. They are tanh, the
//! logistic function, exp, the rectifier, log-probabilities, and destinations for the sums of convolutions.
//!
//! Only sums, products, quotients and bit operations are used, in a fixed order for each element. A number has the
//! same result at any index of a slice, on any number of threads, and with any vector instructions. The coefficients
//! are minimax fits in relative error, by reweighted least squares.

use crate::{
    instructions::macerator::{AutoArch, Simd, WithSimd},
    kept_memory::{OF_A_MOVE, share},
    tile::{LANES, Lanes},
};
use serde::{Deserialize, Serialize};

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

/// An element-wise activation function.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Activation {
    /// max(x, 0).
    #[default]
    Relu,
    /// Hyperbolic tangent.
    Tanh,
}

/// Returns tanh(x), within 2 units in the last place; NaN stays NaN.
#[inline(always)]
pub(crate) fn tanh(x: f32) -> f32 {
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
pub(crate) fn sigmoid(x: f32) -> f32 {
    // The comparisons are false for NaN, so NaN is kept.
    let y = if x < -87.0 { 87.0 } else { -x };
    let y = if y < -87.0 { -87.0 } else { y };
    1.0 / (1.0 + exp(y))
}

/// Writes exp of each number up to 88; below -87 the result stays e^-87. NaN stays NaN.
#[inline(always)]
pub(crate) fn exp_into(values: &[f32], to: &mut [f32]) {
    // The comparison is false for NaN, so NaN is kept.
    to.iter_mut().zip(values).for_each(|(to, &x)| *to = exp(if x < -87.0 { -87.0 } else { x }));
}

/// Returns exp of each number up to 88; below -87 the result stays e^-87. NaN stays NaN.
pub fn exp_of(values: &[f32]) -> Vec<f32> {
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

/// Runs `loops` compiled for the widest [instructions](crate::instructions) of this machine. Functions that it calls take part only
/// if they are inlined.
#[inline]
pub fn vectorized(loops: impl FnOnce()) {
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
pub(crate) fn tanh_in_place(values: &mut [f32]) {
    let products = values.len() * OF_AN_EXP;
    share(values, CHUNK, products, |_, chunk| vectorized(|| chunk.iter_mut().for_each(|x| *x = tanh(*x))));
}

/// Multiplies each number of `grad` by tanh' = 1 - y², where y is the tanh.
pub(crate) fn tanh_backward(grad: &mut [f32], tanh: &[f32]) {
    let products = grad.len() * OF_A_MOVE;
    share(grad, CHUNK, products, |piece, grad| {
        let tanh = &tanh[piece * CHUNK..];
        vectorized(|| grad.iter_mut().zip(tanh).for_each(|(g, &y)| *g *= 1.0 - y * y));
    });
}

/// Returns the number if it is positive, otherwise 0; NaN stays NaN.
#[inline(always)]
pub(crate) fn relu(x: f32) -> f32 {
    if x < 0.0 { 0.0 } else { x }
}

/// Returns the gradient of [`relu`] where its result was `value`.
#[inline(always)]
pub(crate) fn relu_backward(value: f32, grad: f32) -> f32 {
    if value <= 0.0 { 0.0 } else { grad }
}

// Log-probabilities of choices, from logits.

/// Rows that a thread takes at a time.
const ROWS: usize = 64;

/// Number of products that take as long as an exponential.
const OF_AN_EXP: usize = 20;

/// Turns rows of logits into ln softmax: x - max - ln Σ exp(x - max).
pub(crate) fn log_softmax_in_place(logits: &mut [f32], choices: usize) {
    let products = logits.len() * OF_AN_EXP;
    share(logits, ROWS * choices, products, |_, rows| {
        let mut exps = vec![0.0; rows.len()];
        vectorized(|| {
            for row in rows.chunks_exact_mut(choices) {
                // A NaN is no maximum, and stays at its index.
                let max = row.iter().copied().fold(f32::NEG_INFINITY, f32::max);
                row.iter_mut().for_each(|x| *x -= max);
            }
            exp_into(rows, &mut exps);
        });
        for (row, exps) in rows.chunks_exact_mut(choices).zip(exps.chunks_exact(choices)) {
            let ln_sum = libm::logf(exps.iter().sum());
            row.iter_mut().for_each(|x| *x -= ln_sum);
        }
    });
}

/// Converts the gradient by the log-probabilities to that by the logits: g - p Σ g.
pub(crate) fn log_softmax_backward(grad: &mut [f32], log_probs: &[f32], choices: usize) {
    let products = grad.len() * OF_AN_EXP;
    share(grad, ROWS * choices, products, |piece, rows| {
        let mut probs = vec![0.0; rows.len()];
        let from = piece * ROWS * choices;
        vectorized(|| exp_into(&log_probs[from..from + rows.len()], &mut probs));
        for (row, probs) in rows.chunks_exact_mut(choices).zip(probs.chunks_exact(choices)) {
            let sum: f32 = row.iter().sum();
            row.iter_mut().zip(probs).for_each(|(g, p)| *g -= p * sum);
        }
    });
}

// Destinations for the sums of a convolution.
//
// These are no closures: only code that is certainly inlined is compiled for the vectors of the loops around it.

/// Gets the sums of a pixel's channels, up to 16 at a time.
pub(crate) trait Store {
    /// Stores sums: the position of the first channel in the image, the number of channels from it on, and the sums.
    fn store(&mut self, at: usize, count: usize, sums: &Lanes);
}

/// Writes the sums.
pub(crate) struct Write<'a>(pub(crate) &'a mut [f32]);

/// Writes the ReLU of the sums.
pub(crate) struct WriteRelu<'a>(pub(crate) &'a mut [f32]);

/// Adds the sums.
pub(crate) struct Add<'a>(pub(crate) &'a mut [f32]);

/// Adds the sums to the first slice as gradients of a ReLU whose output was the second.
pub(crate) struct AddWhere<'a>(pub(crate) &'a mut [f32], pub(crate) &'a [f32]);

impl Store for Write<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        put(self.0, at, count, sums, |to, sum| *to = sum);
    }
}

impl Store for WriteRelu<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        put(self.0, at, count, sums, |to, sum| *to = relu(sum));
    }
}

impl Store for Add<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        put(self.0, at, count, sums, |to, sum| *to += sum);
    }
}

impl Store for AddWhere<'_> {
    #[inline(always)]
    fn store(&mut self, at: usize, count: usize, sums: &Lanes) {
        let (to, mask) = (&mut self.0[at..], &self.1[at..]);
        match (to.first_chunk_mut::<LANES>(), mask.first_chunk::<LANES>()) {
            (Some(to), Some(mask)) if count >= LANES => {
                for l in 0..LANES {
                    to[l] += relu_backward(mask[l], sums[l]);
                }
            }
            _ => {
                let pairs = to[..count.min(LANES)].iter_mut().zip(mask).zip(sums);
                pairs.for_each(|((to, &mask), &x)| *to += relu_backward(mask, x));
            }
        }
    }
}

/// Changes `count` numbers from `at` on (at most 16) with those of `lanes`.
#[inline(always)]
fn put(to: &mut [f32], at: usize, count: usize, lanes: &Lanes, change: impl Fn(&mut f32, f32)) {
    let to = &mut to[at..];
    match to.first_chunk_mut::<LANES>() {
        Some(to) if count >= LANES => {
            for l in 0..LANES {
                change(&mut to[l], lanes[l]);
            }
        }
        _ => put_few(&mut to[..count.min(LANES)], lanes, change),
    }
}

/// Changes fewer numbers. In one function with the above, compilers make one copy of unknown length of both.
#[inline(never)]
fn put_few(to: &mut [f32], lanes: &Lanes, change: impl Fn(&mut f32, f32)) {
    to.iter_mut().zip(lanes).for_each(|(to, &x)| change(to, x));
}

#[cfg(test)]
mod tests {
    use playbot_learner::rng::{Streams, normal};

    use super::*;
    use crate::among_workers::among_awake_workers;

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

    #[test]
    fn rows_are_the_logarithms_of_their_probabilities() {
        let mut rng = Streams::new(5).stream("logits", 0);
        for (rows, choices, scale) in [(1, 1, 1.0), (3, 15, 1.0), (1000, 15, 20.0), (70, 3, 100.0)] {
            let logits: Vec<f32> = (0..rows * choices).map(|_| normal(&mut rng) * scale).collect();
            let mut got = logits.clone();
            log_softmax_in_place(&mut got, choices);
            for (got, logits) in got.chunks_exact(choices).zip(logits.chunks_exact(choices)) {
                let max = logits.iter().copied().fold(f32::MIN, f32::max);
                let sum: f64 = logits.iter().map(|x| f64::from(x - max).exp()).sum();
                for (got, x) in got.iter().zip(logits) {
                    let want = f64::from(*x) - f64::from(max) - sum.ln();
                    assert!((f64::from(*got) - want).abs() < 1e-6 * want.abs().max(1.0), "{got}, expected {want}");
                }
            }
        }
    }

    #[test]
    fn threads_change_nothing() {
        let logits: Vec<f32> = (0..20_000 * 15).map(|i| (i % 977) as f32 * 0.01).collect();
        let (mut one, mut all) = (logits.clone(), logits);
        one.chunks_mut(15).for_each(|row| log_softmax_in_place(row, 15));
        among_awake_workers(|| log_softmax_in_place(&mut all, 15));
        assert!(one == all);
        let (mut grads, mut rows) = (one.clone(), one.clone());
        among_awake_workers(|| log_softmax_backward(&mut grads, &all, 15));
        rows.chunks_mut(15).zip(all.chunks(15)).for_each(|(grad, l)| log_softmax_backward(grad, l, 15));
        assert!(grads == rows);
    }

    #[test]
    fn what_is_no_number_stays_none() {
        let mut logits = vec![1.0, f32::NAN, 0.0, 0.0];
        log_softmax_in_place(&mut logits, 2);
        assert!(logits[0].is_nan() && logits[1].is_nan());
        assert!((logits[2] + std::f32::consts::LN_2).abs() < 1e-6);
    }
}
