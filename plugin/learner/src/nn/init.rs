//! Starting weights.

use crate::rng::{normal, unit};
use rand::Rng;

/// Returns a `[inputs, outputs]` matrix, row-major, with orthonormal rows or columns (whichever are fewer) times
/// `gain`.
///
/// Saxe et al. 2013, "Exact solutions to the nonlinear dynamics of learning in deep linear neural networks".
/// Made by Gram and Schmidt's process (applied twice for accuracy) on normal numbers in double precision.
pub fn orthogonal<R: Rng + ?Sized>(inputs: usize, outputs: usize, gain: f64, rng: &mut R) -> Vec<f32> {
    let (count, length) = (inputs.min(outputs), inputs.max(outputs));
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(count);
    while basis.len() < count {
        let mut v: Vec<f64> = (0..length).map(|_| f64::from(normal(rng))).collect();
        for _ in 0..2 {
            for b in &basis {
                let along = dot(&v, b);
                v.iter_mut().zip(b).for_each(|(x, y)| *x -= along * y);
            }
        }
        let norm = dot(&v, &v).sqrt();
        if norm > 1e-6 {
            v.iter_mut().for_each(|x| *x /= norm);
            basis.push(v);
        }
    }
    let mut out = vec![0.0; inputs * outputs];
    for (k, b) in basis.iter().enumerate() {
        for (j, x) in b.iter().enumerate() {
            let at = if inputs <= outputs { k * outputs + j } else { j * outputs + k };
            out[at] = (x * gain) as f32;
        }
    }
    out
}

/// Returns `len` numbers uniform in [-bound, bound).
pub(crate) fn uniform<R: Rng + ?Sized>(len: usize, bound: f64, rng: &mut R) -> Vec<f32> {
    (0..len).map(|_| ((2.0 * unit(rng) - 1.0) * bound) as f32).collect()
}

/// Returns the dot product over eight lanes, so that the compiler can vectorise it.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    for (a, b) in a.zip(b) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(lane, (x, y))| *lane += x * y);
    }
    lanes.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Streams;

    #[test]
    fn columns_are_orthonormal_times_gain() {
        for (inputs, outputs) in [(7, 4), (4, 7), (5, 5)] {
            let w = orthogonal(inputs, outputs, 2.0, &mut Streams::new(1).stream("w", 0));
            let few = inputs.min(outputs);
            let vector = |k: usize| -> Vec<f64> {
                if inputs <= outputs {
                    (0..outputs).map(|j| f64::from(w[k * outputs + j])).collect()
                } else {
                    (0..inputs).map(|i| f64::from(w[i * outputs + k])).collect()
                }
            };
            for a in 0..few {
                for b in 0..few {
                    let want = if a == b { 4.0 } else { 0.0 };
                    assert!((dot(&vector(a), &vector(b)) - want).abs() < 1e-5);
                }
            }
        }
    }
}
