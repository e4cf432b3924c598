//! Intervals and comparisons for few runs (Agarwal et al. 2021, "Deep reinforcement learning at the edge of the
//! statistical precipice"). Scores are of several seeds, each on the same levels.

use playbot_learner::rng::{ChaCha8Rng, Streams, below};

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

#[cfg(test)]
mod tests {
    use super::*;
    use playbot_learner::rng::normal;

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
}
