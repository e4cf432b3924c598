//! Statistics of one metric over the seeds of a group.

use serde::Serialize;

use super::{curves::check_metric, error::RunsError, group::RunGroup, record::RunRecord};
use crate::report::{
    Curve,
    statistics::{mean_and_sd, mean_curve, steps_to_reach},
};

/// Results of a group of runs in one metric. Unknown values are NaN.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GroupStatistics {
    /// The group.
    pub label: String,
    /// The seeds, ascending.
    pub seeds: Vec<u64>,
    /// The last value of each run.
    pub last: Vec<f64>,
    /// Mean of the last values.
    pub last_mean: f64,
    /// Sample standard deviation of the last values; 0 for a single run.
    pub last_sd: f64,
    /// Lowest value of any run at any step; for means over episodes, from the 100th episode on if as many ended.
    pub lowest: f64,
    /// Highest value, likewise.
    pub highest: f64,
    /// First step of each run at which it reached the threshold; empty without a threshold.
    pub steps_to_threshold: Vec<Option<u64>>,
    /// Runs that did not reach the threshold because too few of their episodes ended: means over fewer than 100 do
    /// not count.
    pub too_few_episodes: usize,
    /// Mean over the runs of their environment steps per second.
    pub steps_per_s: f64,
}

impl GroupStatistics {
    /// Measures a group.
    pub fn new(group: &RunGroup, metric: &str, threshold: Option<f64>) -> Self {
        let last: Vec<f64> = group.runs.iter().map(|run| run.curves.last(metric).unwrap_or(f64::NAN)).collect();
        let (last_mean, last_sd) = mean_and_sd(&last);
        let speeds: Vec<f64> = group.runs.iter().filter_map(|run| run.curves.steps_per_s()).collect();
        let values = || group.runs.iter().flat_map(|run| run.curves.settled_or_all(metric)).map(|(_, value)| *value);
        let is_early = |run: &RunRecord| run.curves.settled(metric).is_empty() && !run.curves.curve(metric).is_empty();
        let reached =
            |threshold| group.runs.iter().map(move |run| steps_to_reach(run.curves.settled(metric), threshold));
        Self {
            label: group.label.clone(),
            seeds: group.seeds(),
            last_mean,
            last_sd,
            last,
            lowest: values().fold(f64::NAN, f64::min),
            highest: values().fold(f64::NAN, f64::max),
            too_few_episodes: threshold.map_or(0, |_| group.runs.iter().filter(|run| is_early(run)).count()),
            steps_to_threshold: threshold.into_iter().flat_map(reached).collect(),
            steps_per_s: mean_and_sd(&speeds).0,
        }
    }
}

/// Returns the mean curve of each group with a band. The band is mean ± sample standard deviation for three seeds or
/// more, and the range for two; one seed has no band.
///
/// # Errors
///
/// [`RunsError::NoMetrics`] if a run has no metrics, [`RunsError::Metric`] if no run has this one.
pub fn mean_and_spread(groups: &[RunGroup], metric: &str) -> Result<Vec<Curve>, RunsError> {
    let runs = || groups.iter().flat_map(|group| group.runs.iter().copied());
    if let Some(run) = runs().find(|run| run.curves.last_step() == 0) {
        return Err(RunsError::NoMetrics(run.path.clone()));
    }
    let tags = check_metric(metric, runs().map(|run| &run.curves));
    if let (Err(source), Some(run)) = (tags, runs().next()) {
        return Err(RunsError::Metric { path: run.path.clone(), source });
    }
    Ok(groups.iter().map(|group| group_curve(group, metric)).collect())
}

fn group_curve(group: &RunGroup, metric: &str) -> Curve {
    let curves: Vec<Vec<(u64, f64)>> = group.runs.iter().map(|run| run.curves.curve(metric).to_vec()).collect();
    let mean = mean_curve(&curves);
    let points = mean.iter().map(|point| (point.step as f64, point.mean)).collect();
    let label = match curves.len() {
        1 => format!("{}, seed {}", group.label, group.runs[0].info.seed),
        n => format!("{}, {n} seeds", group.label),
    };
    let curve = Curve::new(label, points);
    if curves.len() == 1 { curve } else { curve.with_band(mean.iter().map(|point| (point.low, point.high)).collect()) }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::{
        super::{
            curves::RunCurves,
            group::{group_runs, tests::run},
        },
        *,
    };
    use crate::train::Algorithm;

    fn with_curve(seed: u64, values: &[f64]) -> RunRecord {
        let folder = tempfile::tempdir().expect("a folder");
        let line = |(index, value)| format!("{{\"step\":{},\"charts/a\":{value}}}\n", 10 * (index + 1));
        let text: String = values.iter().enumerate().map(line).collect();
        fs::write(folder.path().join("metrics.jsonl"), text).expect("writable");
        let curves = RunCurves::read(folder.path()).expect("readable");
        RunRecord { curves, ..run(Algorithm::Ppo, seed, "") }
    }

    #[test]
    fn the_mean_of_a_few_episodes_is_neither_lowest_nor_highest() {
        let folder = tempfile::tempdir().expect("a folder");
        let updates = [(16, 3, 1.0), (32, 120, 0.25), (48, 240, 0.5)];
        let line = |(step, episodes, share)| {
            format!("{{\"step\":{step},\"charts/episodes\":{episodes},\"charts/success_rate\":{share}}}\n")
        };
        fs::write(folder.path().join("metrics.jsonl"), updates.map(line).concat()).expect("writable");
        let of = |folder: &std::path::Path| {
            let curves = RunCurves::read(folder).expect("readable");
            let runs = [RunRecord { curves, ..run(Algorithm::Ppo, 1, "") }];
            let statistics = GroupStatistics::new(&group_runs(&runs)[0], "charts/success_rate", None);
            (statistics.lowest, statistics.highest)
        };
        assert_eq!(of(folder.path()), (0.25, 0.5));
        fs::write(folder.path().join("metrics.jsonl"), line(updates[0])).expect("writable");
        assert_eq!(of(folder.path()), (1.0, 1.0), "better than nothing");
    }

    #[test]
    fn numbers_of_three_seeds() {
        let runs = [with_curve(3, &[0.0, 9.0]), with_curve(1, &[1.0, 2.0]), with_curve(2, &[5.0, 4.0])];
        let groups = group_runs(&runs);
        let statistics = GroupStatistics::new(&groups[0], "charts/a", Some(5.0));
        assert_eq!((statistics.seeds, statistics.last), (vec![1, 2, 3], vec![2.0, 4.0, 9.0]));
        assert_eq!((statistics.last_mean, statistics.last_sd), (5.0, 13f64.sqrt()));
        assert_eq!((statistics.lowest, statistics.highest), (0.0, 9.0));
        assert_eq!(statistics.steps_to_threshold, [None, Some(10), Some(20)]);
        assert!(statistics.steps_per_s.is_nan(), "there is no timing");

        let curves = mean_and_spread(&groups, "charts/a").expect("known");
        assert_eq!((curves[0].label.as_str(), &curves[0].points), ("ppo, 3 seeds", &vec![(10.0, 2.0), (20.0, 5.0)]));
        let band = curves[0].band.as_ref().expect("three seeds");
        assert_eq!(band[1], (2.0, 9.0), "with three seeds the interval of the mean goes from one to the other");
    }

    #[test]
    fn one_seed_has_no_band_and_two_have_their_range() {
        let runs = [with_curve(1, &[1.0]), with_curve(2, &[3.0])];
        let band = |runs| mean_and_spread(&group_runs(runs), "charts/a").expect("known")[0].band.clone();
        assert_eq!((band(&runs[..1]), band(&runs)), (None, Some(vec![(1.0, 3.0)])));
    }

    #[test]
    fn missing_metrics_are_errors() {
        let runs = [with_curve(1, &[1.0])];
        let error = mean_and_spread(&group_runs(&runs), "charts/b").expect_err("unknown").to_string();
        assert!(error.contains("`charts/b`") && error.contains("`charts/a`"), "{error}");
        let runs = [runs[0].clone(), run(Algorithm::Ppo, 2, "")];
        assert!(matches!(mean_and_spread(&group_runs(&runs), "charts/a"), Err(RunsError::NoMetrics(_))));
    }
}
