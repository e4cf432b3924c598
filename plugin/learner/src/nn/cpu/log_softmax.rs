//! Log-probabilities of choices, from logits.

use super::fast_math::{exp_into, vectorized};
use super::share::share;

/// Rows that a thread takes at a time.
const ROWS: usize = 64;
/// Number of products that take as long as an exponential.
const OF_AN_EXP: usize = 20;

/// Turns rows of logits into ln softmax: x - max - ln Σ exp(x - max).
pub(super) fn log_softmax_in_place(logits: &mut [f32], choices: usize) {
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
            let ln_sum = exps.iter().sum::<f32>().ln();
            row.iter_mut().for_each(|x| *x -= ln_sum);
        }
    });
}

/// Converts the gradient by the log-probabilities to that by the logits: g - p Σ g.
pub(super) fn log_softmax_backward(grad: &mut [f32], log_probs: &[f32], choices: usize) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::among_awake_workers;
    use crate::rng::{Streams, normal};

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
