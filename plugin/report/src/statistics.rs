//! Statistics over runs that differ only in their seed.
//!
//! Intervals and comparisons for few runs follow Agarwal et al. 2021, "Deep reinforcement learning at the edge of the
//! statistical precipice". Their scores are of several seeds, each on the same levels.

use playbot_learner::rng::{ChaCha8Rng, Streams, below};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Returns the mean and sample standard deviation (with n - 1) of the values; the deviation of a single value is 0.
///
/// Both are NaN without values.
pub fn mean_and_sd(values: &[f64]) -> (f64, f64) {
    match values {
        [] => return (f64::NAN, f64::NAN),
        [value] => return (*value, 0.0),
        _ => {}
    }
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0)).sqrt())
}

/// Returns the median, which is the mean of the two middle values of an even number; `None` without values.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(f64::midpoint(values[last / 2], values[last.div_ceil(2)]))
}

/// Returns the first step at which a learning curve of `(step, value)` is at `threshold` or above; `None` if it never
/// is.
///
/// A single good value counts. So the curve should be a moving mean, as `charts/success_rate` and
/// `charts/episodic_return` are: over the last 100 episodes.
pub fn steps_to_reach(curve: &[(u64, f64)], threshold: f64) -> Option<u64> {
    curve.iter().find(|(_, value)| *value >= threshold).map(|(step, _)| *step)
}

/// Returns the value of a curve at a step, interpolated linearly between its points, whose steps ascend. `None`
/// before its first and after its last point.
pub fn value_at(curve: &[(u64, f64)], step: u64) -> Option<f64> {
    let after = curve.partition_point(|(at, _)| *at < step);
    let (right, right_value) = *curve.get(after)?;
    if right == step {
        return Some(right_value);
    }
    let (left, left_value) = *curve.get(after.checked_sub(1)?)?;
    let share = (step - left) as f64 / (right - left) as f64;
    Some(left_value + share * (right_value - left_value))
}

/// Mean and interval of several curves at a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeanPoint {
    /// The step.
    pub step: u64,
    /// Mean of the curves.
    pub mean: f64,
    /// Lower end of the 95 % interval of the mean.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// Returns the mean of several learning curves with its 95 % interval over such curves: see [`mean`].
///
/// Points are at every step of any curve, from the latest first step to the earliest last step. So each mean is over
/// all curves.
pub fn mean_curve(curves: &[Vec<(u64, f64)>]) -> Vec<MeanPoint> {
    let mut steps: Vec<u64> = curves.iter().flatten().map(|(step, _)| *step).collect();
    steps.sort_unstable();
    steps.dedup();
    let point = |step| {
        let values = curves.iter().map(|curve| value_at(curve, step)).collect::<Option<Vec<f64>>>()?;
        let Estimate { value, low, high } = mean(&values)?;
        Some(MeanPoint { step, mean: value, low, high })
    };
    steps.into_iter().filter_map(point).collect()
}

// Intervals and comparisons for few runs.

/// Draws of a bootstrap.
const DRAWS: u64 = 1000;

/// Share of the draws inside an interval.
const INSIDE: f64 = 0.95;

/// A number with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Statistic of the scores themselves.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// Returns the interquartile mean of the runs: the mean of the middle half, without the best and the worst quarter of
/// the seeds. The score of a run is its mean over the levels. The interval covers other seeds and other levels.
/// `None` without scores, or if the seeds have different levels.
///
/// Levels are not tasks of their own here, but draws of one task. If each is won or lost, a middle half over levels
/// would count three quarters of wins as all.
pub fn interquartile_mean(scores: &[&[f64]]) -> Option<Estimate> {
    let of_run = |row: &Vec<f64>| row.iter().sum::<f64>() / row.len() as f64;
    estimate(&[scores], |[scores]| middle_mean(scores.iter().map(of_run).collect()))
}

/// Returns the probability that a run of one method scores higher than a run of another on the same level; ties count
/// half. The interval covers other seeds of both, and other levels. `None` without scores, or with different levels.
pub fn probability_of_improvement(one: &[&[f64]], other: &[&[f64]]) -> Option<Estimate> {
    estimate(&[one, other], |[one, other]| {
        let wins = one.iter().flat_map(|one| other.iter().map(|other| wins(one, other)));
        wins.sum::<f64>() / (one.len() * other.len()) as f64
    })
}

/// Returns the mean of several numbers with its interval; `None` without numbers.
pub fn mean(values: &[f64]) -> Option<Estimate> {
    let rows: Vec<&[f64]> = values.iter().map(std::slice::from_ref).collect();
    estimate(&[&rows], |[rows]| rows.concat().iter().sum::<f64>() / rows.len() as f64)
}

/// Returns the share of the levels on which the first is higher; equal levels count half.
fn wins(one: &[f64], other: &[f64]) -> f64 {
    let points = one.iter().zip(other).map(|(one, other)| match one.total_cmp(other) {
        std::cmp::Ordering::Greater => 1.0,
        std::cmp::Ordering::Equal => 0.5,
        std::cmp::Ordering::Less => 0.0,
    });
    points.sum::<f64>() / one.len() as f64
}

/// Returns the mean of the middle half. Numbers at its ends count in part if a quarter is not a whole number of them.
fn middle_mean(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let quarter = values.len() as f64 / 4.0;
    let weight = |at: usize| {
        let (from, to) = (at as f64, at as f64 + 1.0);
        (to.min(3.0 * quarter) - from.max(quarter)).max(0.0)
    };
    let sum: f64 = values.iter().enumerate().map(|(at, value)| weight(at) * value).sum();
    sum / (2.0 * quarter)
}

/// Seeds, each with its scores on all levels.
type Scores = Vec<Vec<f64>>;

/// Estimates a statistic of the scores of `N` methods, with its interval by drawing seeds of each and levels of all
/// with replacement.
fn estimate<const N: usize>(methods: &[&[&[f64]]; N], statistic: impl Fn(&[Scores; N]) -> f64) -> Option<Estimate> {
    let levels = methods[0].first()?.len();
    if levels == 0 || methods.iter().any(|seeds| seeds.is_empty() || seeds.iter().any(|row| row.len() != levels)) {
        return None;
    }
    let whole = methods.map(|seeds| seeds.iter().map(|row| row.to_vec()).collect::<Scores>());
    let drawn = |draw| {
        let mut rng = Streams::new(0).stream("bootstrap", draw);
        let columns = choices(levels, &mut rng);
        statistic(&methods.map(|seeds| {
            let rows = choices(seeds.len(), &mut rng);
            rows.into_iter().map(|row| columns.iter().map(|&level| seeds[row][level]).collect()).collect::<Scores>()
        }))
    };
    let mut draws: Vec<f64> = (0..DRAWS).map(drawn).collect();
    draws.sort_by(f64::total_cmp);
    let at = |share: f64| draws[(share * (DRAWS - 1) as f64).round() as usize];
    let outside = (1.0 - INSIDE) / 2.0;
    Some(Estimate { value: statistic(&whole), low: at(outside), high: at(1.0 - outside) })
}

/// Draws `n` numbers below `n` with replacement.
fn choices(n: usize, rng: &mut ChaCha8Rng) -> Vec<usize> {
    (0..n).map(|_| below(rng, n as u64) as usize).collect()
}

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
    use super::*;
    use playbot_learner::rng::{Streams, normal};

    #[test]
    fn mean_and_sample_deviation() {
        // Deviations from 5: -3, -1, 4; squares 9 + 1 + 16 = 26; over n - 1 = 2.
        assert_eq!(mean_and_sd(&[2.0, 4.0, 9.0]), (5.0, 13f64.sqrt()));
        assert_eq!(mean_and_sd(&[7.0]), (7.0, 0.0));
        assert!(mean_and_sd(&[]).0.is_nan() && mean_and_sd(&[]).1.is_nan());
    }

    #[test]
    fn the_first_crossing_counts() {
        let curve = [(10, f64::NAN), (20, 0.5), (30, 0.8), (40, 0.7), (50, 0.9)];
        assert_eq!(steps_to_reach(&curve, 0.8), Some(30));
        assert_eq!(steps_to_reach(&curve, 0.81), Some(50));
        assert_eq!(steps_to_reach(&curve, 0.95), None);
        assert_eq!(steps_to_reach(&[], 0.0), None);
    }

    #[test]
    fn values_between_points_lie_on_the_line() {
        let curve = [(10, 1.0), (20, 3.0), (60, 1.0)];
        let at = |step| value_at(&curve, step);
        assert_eq!([at(10), at(15), at(20), at(30), at(60)], [Some(1.0), Some(2.0), Some(3.0), Some(2.5), Some(1.0)]);
        assert_eq!([at(9), at(61), value_at(&[], 5)], [None; 3]);
    }

    #[test]
    fn a_mean_is_that_of_all_curves() {
        let short = vec![(10, 1.0), (30, 3.0)];
        let long = vec![(0, 9.0), (10, 3.0), (20, 6.0), (40, 0.0)];
        let points = mean_curve(&[short.clone(), long.clone()]);
        let expected = [(10, 2.0, 1.0, 3.0), (20, 4.0, 2.0, 6.0), (30, 3.0, 3.0, 3.0)];
        assert_eq!(points, expected.map(|(step, mean, low, high)| MeanPoint { step, mean, low, high }));

        let third = vec![(10, 8.0), (30, 3.0)];
        let at_10 = mean_curve(&[short, long, third])[0];
        // Of the 27 draws of three from 1, 3 and 8, one has mean 1 and one has mean 8: more than 2.5 % each.
        assert_eq!((at_10.mean, at_10.low, at_10.high), (4.0, 1.0, 8.0));
        assert!(mean_curve(&[]).is_empty() && mean_curve(&[vec![]]).is_empty());
    }

    #[test]
    fn a_median_lies_in_the_middle() {
        assert_eq!(median(vec![9.0, 1.0, 4.0]), Some(4.0));
        assert_eq!(median(vec![9.0, 1.0, 4.0, 5.0]), Some(4.5));
        assert_eq!(median(vec![7.0]), Some(7.0));
        assert_eq!(median(Vec::new()), None);
        assert_eq!(median(vec![3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!((median(vec![7.0]), median(Vec::new())), (Some(7.0), None));
    }

    #[test]
    fn the_middle_half_is_averaged() {
        assert_eq!(middle_mean(vec![100.0, 1.0, 2.0, 3.0, -50.0, 4.0, 2.0, 2.0]), (2.0 + 2.0 + 2.0 + 3.0) / 4.0);
        // Of five numbers the middle one counts whole, its neighbours three quarters each.
        assert!((middle_mean(vec![9.0, 0.0, 4.0, 1.0, 2.0]) - (0.75 + 2.0 + 0.75 * 4.0) / 2.5).abs() < 1e-12);
        assert_eq!(middle_mean(vec![7.0]), 7.0);
    }

    #[test]
    fn improvement_by_hand() {
        let (a, b, c) = ([1.0, 5.0], [0.0, 5.0], [2.0, 4.0]);
        // a over b: a win and a tie; a over c: a loss and a win.
        let got = probability_of_improvement(&[&a], &[&b, &c]).expect("scores");
        assert_eq!(got.value, (0.75 + 0.5) / 2.0);
        assert!(got.low <= got.value && got.value <= got.high);
        let same = probability_of_improvement(&[&a, &b], &[&a, &b]).expect("scores");
        assert_eq!(same.value, 0.5);
    }

    /// Draws scores of `seeds` by `levels`, both of which vary.
    fn scores(draw: u64, seeds: usize, levels: usize) -> Scores {
        let mut rng = Streams::new(8).stream("scores", draw);
        let of_levels: Vec<f32> = (0..levels).map(|_| normal(&mut rng)).collect();
        let row = |_| {
            let of_seed = normal(&mut rng);
            of_levels.iter().map(|of_level| f64::from(of_seed + of_level + normal(&mut rng))).collect()
        };
        (0..seeds).map(row).collect()
    }

    #[test]
    fn intervals_hold_the_truth_nearly_as_often_as_they_say() {
        let inside = (0..200).filter(|&draw| {
            let scores = scores(draw, 8, 30);
            let rows: Vec<&[f64]> = scores.iter().map(Vec::as_slice).collect();
            let got = interquartile_mean(&rows).expect("scores");
            got.low <= 0.0 && 0.0 <= got.high
        });
        // With eight seeds a percentile bootstrap is off by a few per cent.
        let inside = inside.count();
        assert!((170..=199).contains(&inside), "{inside} of 200");
    }

    #[test]
    fn levels_that_are_won_or_lost_do_not_hide_how_many() {
        // Three runs that win nine, eight and seven of ten levels, for 10 points each: the middle half of 9, 8 and 7.
        let run = |won: usize| (0..10).map(|level| if level < won { 10.0 } else { 0.0 }).collect::<Vec<f64>>();
        let runs = [run(9), run(8), run(7)];
        let got = interquartile_mean(&runs.each_ref().map(Vec::as_slice)).expect("scores");
        assert!((got.value - 8.0).abs() < 1e-12, "{got:?}");
        assert!(got.low < 7.5 && got.high > 8.5, "{got:?}");
    }

    #[test]
    fn few_seeds_leave_much_open_and_the_same_scores_give_the_same_numbers() {
        let (few, many) = ([8.0, 9.0, 9.5], [8.0, 9.0, 9.5, 8.5, 9.0, 8.8, 9.1, 8.9, 9.2, 8.7]);
        let width = |values: &[f64]| mean(values).map(|found| found.high - found.low).expect("numbers");
        assert!(width(&few) > 1.5 * width(&many));
        assert_eq!(mean(&few), mean(&few));
        assert_eq!(mean(&[4.0]), Some(Estimate { value: 4.0, low: 4.0, high: 4.0 }));
    }

    #[test]
    fn scores_that_do_not_go_together_give_nothing() {
        assert_eq!(interquartile_mean(&[]), None);
        assert_eq!(interquartile_mean(&[&[]]), None);
        assert_eq!(interquartile_mean(&[&[1.0], &[1.0, 2.0]]), None);
        assert_eq!(probability_of_improvement(&[&[1.0]], &[&[1.0, 2.0]]), None);
        assert_eq!(mean(&[]), None);
    }

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
        let (variance, squares, reported) = (0.25 + 0.1 + 0.05625, mean(|d| d.mean.powi(2)), mean(|d| d.se.powi(2)));
        assert!((squares / variance - 1.0).abs() < 0.1, "{squares}");
        assert!((reported / variance - 1.0).abs() < 0.1, "{reported}");
    }

    #[test]
    fn equals_are_distinguished_in_one_of_twenty_studies_at_most() {
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
