//! Whether one method is better than another: differences on the same levels with the same seeds.

use serde::Serialize;

use super::statistics::mean_and_sd;

/// By how much one method's return is above another's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairedDifference {
    /// The mean over levels and seeds.
    pub mean: f64,
    /// Its standard error; 0 with a single level, of which nothing follows for others.
    pub se: f64,
    /// Levels that both played.
    pub levels: usize,
    /// Seeds that both were trained with.
    pub seeds: usize,
}

impl PairedDifference {
    /// Of `one` less `other`: for each seed the mean return on each level, with seeds and levels in the same order. `None` if
    /// these are not the same, or there are none.
    ///
    /// Other levels and other seeds would have given other differences. With d the difference of seed s on level l, and the
    /// model d = mean + seed + level + rest, all drawn independently, the variance of the mean is
    /// (Q of seeds + Q of levels - Q of the rest) / (S L), with Q the mean squares of a two-way table without repeats (Cochran
    /// and Cox 1957, chapter 4). It is taken to be at least what seeds or levels alone make of it.
    pub fn of(one: &[&[f64]], other: &[&[f64]]) -> Option<Self> {
        let (seeds, levels) = (one.len(), one.first()?.len());
        let same = one.iter().zip(other).all(|(a, b)| a.len() == levels && b.len() == levels);
        if other.len() != seeds || levels == 0 || !same {
            return None;
        }
        let by_seed: Vec<Vec<f64>> =
            one.iter().zip(other).map(|(a, b)| a.iter().zip(*b).map(|(a, b)| a - b).collect()).collect();
        let of_seeds: Vec<f64> = by_seed.iter().map(|row| mean_and_sd(row).0).collect();
        let of_levels: Vec<f64> =
            (0..levels).map(|level| by_seed.iter().map(|row| row[level]).sum::<f64>() / seeds as f64).collect();
        let ((all, sd_of_seeds), (_, sd_of_levels)) = (mean_and_sd(&of_seeds), mean_and_sd(&of_levels));
        let rest = by_seed
            .iter()
            .zip(&of_seeds)
            .flat_map(|(row, seed)| row.iter().zip(&of_levels).map(move |(d, level)| (d - seed - level + all).powi(2)));
        let (q_seeds, q_levels) = (levels as f64 * sd_of_seeds.powi(2), seeds as f64 * sd_of_levels.powi(2));
        // With a single seed or level there is no rest.
        let q_rest = rest.sum::<f64>() / ((seeds - 1) * (levels - 1)).max(1) as f64;
        let squares = (q_seeds + q_levels - q_rest).max(q_seeds).max(q_levels);
        Some(Self { mean: all, se: (squares / (seeds * levels) as f64).sqrt(), levels, seeds })
    }

    /// Whether it is further from 0 than two standard errors.
    pub fn is_clear(&self) -> bool {
        self.mean.abs() > 2.0 * self.se
    }
}

#[cfg(test)]
mod tests {
    use playbot_learner::rng::{Streams, normal};

    use super::*;

    #[test]
    fn one_seed_has_the_error_of_its_levels() {
        let difference = PairedDifference::of(&[&[3.0, 5.0, 10.0]], &[&[1.0, 4.0, 4.0]]).expect("paired");
        // Differences 2, 1 and 6: squares 14 over n - 1 = 2 and n = 3.
        assert_eq!((difference.mean, difference.levels, difference.seeds), (3.0, 3, 1));
        assert!((difference.se - (14.0f64 / 6.0).sqrt()).abs() < 1e-12, "{difference:?}");
    }

    #[test]
    fn what_both_share_does_not_count() {
        let hard = [0.0, 9.0, 1.0, 10.0];
        let easier = hard.map(|x| x + 0.5);
        let difference = PairedDifference::of(&[&easier, &easier], &[&hard, &hard]).expect("paired");
        assert_eq!((difference.mean, difference.se), (0.5, 0.0));
        assert!(difference.is_clear());
    }

    #[test]
    fn the_error_is_the_deviation_of_the_mean() {
        // Seeds deviate by 1, levels by 2, the rest by 3: the variance of the mean is 1/4 + 4/40 + 9/160.
        let (seeds, levels) = (4, 40);
        let mut rng = Streams::new(3).stream("paired", 0);
        let mut draw = |size: f64| size * f64::from(normal(&mut rng));
        let (mut squares, mut told) = (0.0, 0.0);
        let tries = 2000;
        for _ in 0..tries {
            let of_level: Vec<f64> = (0..levels).map(|_| draw(2.0)).collect();
            let rows: Vec<Vec<f64>> = (0..seeds)
                .map(|_| {
                    let seed = draw(1.0);
                    of_level.iter().map(|level| seed + level + draw(3.0)).collect()
                })
                .collect();
            let zeros = vec![0.0; levels];
            let one: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
            let difference = PairedDifference::of(&one, &vec![zeros.as_slice(); seeds]).expect("paired");
            squares += difference.mean.powi(2);
            told += difference.se.powi(2);
        }
        let variance = 0.25 + 0.1 + 0.05625;
        let (found, told) = (squares / f64::from(tries), told / f64::from(tries));
        assert!((found / variance - 1.0).abs() < 0.1, "{found}");
        assert!((told / variance - 1.0).abs() < 0.1, "{told}");
    }

    #[test]
    fn what_does_not_pair_is_nothing() {
        assert_eq!(PairedDifference::of(&[], &[]), None);
        assert_eq!(PairedDifference::of(&[&[1.0]], &[&[1.0, 2.0]]), None);
        assert_eq!(PairedDifference::of(&[&[1.0]], &[&[1.0], &[2.0]]), None);
        assert_eq!(PairedDifference::of(&[&[]], &[&[]]), None);
    }
}
