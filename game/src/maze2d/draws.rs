//! Random numbers that are the same on every machine.

use playbot_learner::rng::unit;
use rand::Rng;

/// Returns a standard normal number, by Marsaglia's polar method.
pub(super) fn normal(rng: &mut impl Rng) -> f64 {
    loop {
        let [u, v] = [uniform(rng, 1.0), uniform(rng, 1.0)];
        let square = u * u + v * v;
        if square > 0.0 && square < 1.0 {
            return u * (-2.0 * libm::log(square) / square).sqrt();
        }
    }
}

/// Returns a number between `-half` and `half`.
pub(super) fn uniform(rng: &mut impl Rng, half: f64) -> f64 {
    half * (2.0 * unit(rng) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::rng::Streams;

    #[test]
    fn normal_draws_have_mean_zero_and_variance_one() {
        let mut rng = Streams::new(5).stream("n", 0);
        let draws: Vec<f64> = (0..20_000).map(|_| normal(&mut rng)).collect();
        let mean = |of: &dyn Fn(f64) -> f64| draws.iter().map(|&draw| of(draw)).sum::<f64>() / draws.len() as f64;
        assert!(mean(&|draw| draw).abs() < 0.03);
        assert!((mean(&|draw| draw * draw) - 1.0).abs() < 0.04);
        assert!((mean(&|draw| f64::from(u8::from(draw.abs() < 1.0))) - 0.6827).abs() < 0.015);
    }
}
