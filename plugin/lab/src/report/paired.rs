//! Paired differences of two methods on the same levels with the same seeds.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::statistics::mean_and_sd;

/// Difference between the returns of two methods.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairedDifference {
    /// The mean over levels and seeds.
    pub mean: f64,
    /// Standard error of the mean; 0 with a single level, which does not generalise to others.
    pub se: f64,
    /// Levels that both played.
    pub levels: usize,
    /// Seeds that both were trained with.
    pub seeds: usize,
}

impl PairedDifference {
    /// Computes the difference of `one` less `other`: for each seed the mean return on each level, with seeds and
    /// levels in the same order. `None` if these differ, or are empty.
    ///
    /// Other levels and other seeds would give other differences. Let d be the difference of seed s on level l. In
    /// the model d = mean + seed + level + rest, all terms are drawn independently. The variance of the mean is (Q of
    /// seeds + Q of levels - Q of the rest) / (S L). Q are the mean squares of a two-way table without repeats
    /// (Cochran and Cox 1957, chapter 4). It is at least the variance from seeds alone or levels alone.
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
        // A single seed or level leaves no rest.
        let q_rest = rest.sum::<f64>() / ((seeds - 1) * (levels - 1)).max(1) as f64;
        let squares = (q_seeds + q_levels - q_rest).max(q_seeds).max(q_levels);
        Some(Self { mean: all, se: (squares / (seeds * levels) as f64).sqrt(), levels, seeds })
    }

    /// Returns the probability of a difference at least this far from 0 between equal methods: Student's t with one
    /// degree of freedom less than seeds. `None` with one seed, which does not generalise to others.
    ///
    /// Differences that vary more over levels than over seeds have more degrees of freedom, which makes the value
    /// conservative.
    pub fn p_value(&self) -> Option<f64> {
        let freedom = self.seeds.checked_sub(1).filter(|&freedom| freedom > 0)? as f64;
        if self.se == 0.0 {
            return Some(if self.mean == 0.0 { 1.0 } else { 0.0 });
        }
        let student = StudentsT::new(0.0, 1.0, freedom).ok()?;
        Some(2.0 * student.sf(self.mean.abs() / self.se))
    }
}

/// Adjusts the p-values of comparisons that are made together. The probability of any false alarm then is at most
/// that of a single comparison.
///
/// Method of Holm (1979): the smallest of n values is multiplied by n, the next one by n - 1, and so on. No value
/// becomes less than the one before it.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let (mut adjusted, mut least) = (vec![0.0; p_values.len()], 0.0f64);
    for (smaller, &which) in order.iter().enumerate() {
        least = least.max(p_values[which] * (p_values.len() - smaller) as f64).min(1.0);
        adjusted[which] = least;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use playbot_learner::rng::{Streams, normal};

    use super::*;

    fn is_clear(difference: &PairedDifference) -> Option<bool> {
        difference.p_value().map(|p| p < 0.05)
    }

    #[test]
    fn one_seed_has_the_error_of_its_levels() {
        let difference = PairedDifference::of(&[&[3.0, 5.0, 10.0]], &[&[1.0, 4.0, 4.0]]).expect("paired");
        // Differences 2, 1 and 6: squares 14 over n - 1 = 2 and n = 3.
        assert_eq!((difference.mean, difference.levels, difference.seeds), (3.0, 3, 1));
        assert!((difference.se - (14.0f64 / 6.0).sqrt()).abs() < 1e-12, "{difference:?}");
        assert_eq!(difference.p_value(), None, "of other seeds it says nothing");
    }

    #[test]
    fn what_both_share_does_not_count() {
        let hard = [0.0, 9.0, 1.0, 10.0];
        let easier = hard.map(|x| x + 0.5);
        let difference = PairedDifference::of(&[&easier, &easier], &[&hard, &hard]).expect("paired");
        assert_eq!((difference.mean, difference.se), (0.5, 0.0));
        assert_eq!(is_clear(&difference), Some(true));
    }

    /// Draws the differences of two equal methods many times, with these deviations of seeds, levels and the rest.
    fn of_equals(seeds: usize, levels: usize, deviations: [f64; 3], tries: usize) -> Vec<PairedDifference> {
        let mut rng = Streams::new(3).stream("paired", 0);
        let mut draw = |size: f64| size * f64::from(normal(&mut rng));
        let zeros = vec![0.0; levels];
        let mut once = || {
            let of_level: Vec<f64> = (0..levels).map(|_| draw(deviations[1])).collect();
            let rows: Vec<Vec<f64>> = (0..seeds)
                .map(|_| {
                    let seed = draw(deviations[0]);
                    of_level.iter().map(|level| seed + level + draw(deviations[2])).collect()
                })
                .collect();
            let one: Vec<&[f64]> = rows.iter().map(Vec::as_slice).collect();
            PairedDifference::of(&one, &vec![zeros.as_slice(); seeds]).expect("paired")
        };
        (0..tries).map(|_| once()).collect()
    }

    #[test]
    fn the_error_is_the_deviation_of_the_mean() {
        // Seeds deviate by 1, levels by 2, the rest by 3: the variance of the mean is 1/4 + 4/40 + 9/160.
        let found = of_equals(4, 40, [1.0, 2.0, 3.0], 2000);
        let mean = |value: fn(&PairedDifference) -> f64| found.iter().map(value).sum::<f64>() / found.len() as f64;
        let (variance, squares, told) = (0.25 + 0.1 + 0.05625, mean(|d| d.mean.powi(2)), mean(|d| d.se.powi(2)));
        assert!((squares / variance - 1.0).abs() < 0.1, "{squares}");
        assert!((told / variance - 1.0).abs() < 0.1, "{told}");
    }

    #[test]
    fn equals_are_told_apart_in_one_of_twenty_studies_at_most() {
        for (seeds, deviations) in
            [(2, [1.0, 0.5, 1.0]), (3, [1.0, 0.1, 0.5]), (5, [1.0, 0.1, 0.5]), (3, [0.1, 1.0, 2.0])]
        {
            let found = of_equals(seeds, 30, deviations, 4000);
            let wrong = found.iter().filter(|difference| is_clear(difference) == Some(true)).count() as f64 / 4000.0;
            // Three standard errors of a share of 5 % in 4,000.
            assert!(wrong < 0.05 + 0.0104, "{seeds} seeds that deviate by {deviations:?}: {wrong}");
        }
        // Two standard errors, for any number of seeds, would be wrong far more often.
        let wrong = of_equals(3, 30, [1.0, 0.1, 0.5], 4000).iter().filter(|d| d.mean.abs() > 2.0 * d.se).count();
        assert!(wrong > 600, "{wrong}");
    }

    #[test]
    fn what_is_there_is_found() {
        let found = PairedDifference { mean: 2.776, se: 1.0, levels: 9, seeds: 5 };
        assert!((found.p_value().expect("five seeds") - 0.05).abs() < 1e-4, "the table of Student's t");
        let nearer = PairedDifference { mean: -2.7, ..found };
        assert_eq!((is_clear(&nearer), is_clear(&PairedDifference { mean: -2.8, ..found })), (Some(false), Some(true)));
    }

    #[test]
    fn comparisons_that_are_made_together_need_more() {
        // The second is smallest: 3 · 0.01; then 2 · 0.04; the last one is not below that.
        assert_eq!(holm(&[0.04, 0.01, 0.06]), [0.08, 0.03, 0.08]);
        assert_eq!((holm(&[0.2]), holm(&[0.9, 0.8]), holm(&[])), (vec![0.2], vec![1.0, 1.0], vec![]));
        // For five methods equal to the first, nineteen of twenty studies report no difference from it.
        let studies = of_equals(3, 30, [1.0, 0.1, 0.5], 4000);
        let p_values: Vec<f64> = studies.iter().map(|found| found.p_value().expect("three seeds")).collect();
        let any = |clear: &dyn Fn(&[f64]) -> bool| p_values.chunks(5).filter(|five| clear(five)).count() as f64 / 800.0;
        let (each, together) = (any(&|p| p.iter().any(|&p| p < 0.05)), any(&|p| holm(p).iter().any(|&p| p < 0.05)));
        assert!(each > 0.15 && together < 0.05 + 0.023, "{each}, {together}");
    }

    #[test]
    fn what_does_not_pair_is_nothing() {
        assert_eq!(PairedDifference::of(&[], &[]), None);
        assert_eq!(PairedDifference::of(&[&[1.0]], &[&[1.0, 2.0]]), None);
        assert_eq!(PairedDifference::of(&[&[1.0]], &[&[1.0], &[2.0]]), None);
        assert_eq!(PairedDifference::of(&[&[]], &[&[]]), None);
    }
}
