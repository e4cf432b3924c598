//! Groups of runs that differ only in their seed.

use crate::{
    Experiment,
    runs::{RunRecord, RunsError, curves::check_metric},
};
use playbot_report::{
    Curve,
    statistics::{mean_and_sd, mean_curve, steps_to_reach},
};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};

/// Largest number of differing settings that a group's label spells out.
const NAMED: usize = 3;

/// Key of a group's skill models among its settings.
const SKILLS: &str = "skills";

/// Runs of the same experiment and algorithm with several seeds.
#[derive(Clone, Debug)]
pub struct RunGroup<'a> {
    /// Label of the group: the algorithm and the settings that differ from other groups, such as `ppo lr=0.001`.
    pub label: String,
    /// The settings in which the groups differ, with this group's values.
    pub differing: BTreeMap<String, String>,
    /// The runs, in the order of their seeds.
    pub runs: Vec<&'a RunRecord>,
}

impl RunGroup<'_> {
    /// Returns the seeds, ascending.
    pub fn seeds(&self) -> Vec<u64> {
        self.runs.iter().map(|run| run.info.seed).collect()
    }

    /// Returns the facts that make the runs less comparable: repeated seeds, unfinished runs, other revisions of
    /// playbot, other devices, other skill models.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        let first = &self.runs[0];
        if self.seeds().windows(2).any(|pair| pair[0] == pair[1]) {
            warnings.push(format!("{}: the same seed more than once", self.label));
        }
        if self.runs.iter().any(|run| run.curves.last_step() != first.curves.last_step()) {
            let steps: Vec<String> = self.runs.iter().map(|run| run.curves.last_step().to_string()).collect();
            warnings.push(format!("{}: runs of different length ({} steps)", self.label, steps.join(", ")));
        } else if !first.is_finished() {
            warnings.push(format!("{}: not finished", self.label));
        }
        if self.runs.iter().any(|run| run.info.revision != first.info.revision) {
            warnings.push(format!("{}: made by different revisions of playbot", self.label));
        }
        if self.runs.iter().any(|run| run.info.device != first.info.device) {
            warnings.push(format!("{}: made on different devices", self.label));
        }
        if let Some(skills) = self.differing.get(SKILLS) {
            warnings.push(format!(
                "{}: other runs with the same settings and a seed in common had another skill model than {skills}; they \
                 are kept apart",
                self.label
            ));
        }
        warnings
    }
}

/// A group under construction: the settings of its runs, and the runs.
type Members<'a> = (BTreeMap<String, String>, Vec<&'a RunRecord>);

/// Groups runs that differ only in their seed; groups are in the order of their first run.
///
/// Runs with different seeds may have different skill models, as in a study. Runs of the same seed with different
/// skill models are not repetitions. They form separate groups, distinguished by their `skills`.
pub fn group_runs(runs: &[RunRecord]) -> Vec<RunGroup<'_>> {
    let mut groups: Vec<Members> = Vec::new();
    for run in runs {
        let mut key = settings(&run.experiment);
        key.remove("seed");
        key.insert("algorithm".to_owned(), run.info.algorithm.name().to_owned());
        match group_of(&groups, &key, run) {
            Some(index) => groups[index].1.push(run),
            None => groups.push((key, vec![run])),
        }
    }
    name_skills(&mut groups);
    let differs = |key: &String| groups.iter().any(|(other, _)| other.get(key) != groups[0].0.get(key));
    let keys: Vec<String> = groups.iter().flat_map(|(key, _)| key.keys()).filter(|key| differs(key)).cloned().collect();
    let mut finished = Vec::new();
    for (index, (key, mut members)) in groups.into_iter().enumerate() {
        members.sort_by_key(|run| run.info.seed);
        let mut differing: BTreeMap<String, String> = key.into_iter().filter(|(key, _)| keys.contains(key)).collect();
        differing.remove("algorithm");
        let label = label(members[0].info.algorithm.name(), &differing, index + 1);
        finished.push(RunGroup { label, differing, runs: members });
    }
    finished
}

/// Returns the group of a run: the one with its skill model, else the first one whose runs of this seed have no
/// other.
fn group_of(groups: &[Members], key: &BTreeMap<String, String>, run: &RunRecord) -> Option<usize> {
    let fits = |members: &[&RunRecord]| {
        members.iter().all(|other| other.info.seed != run.info.seed || other.info.skills == run.info.skills)
    };
    let shares = |members: &[&RunRecord]| members.iter().any(|other| other.info.skills == run.info.skills);
    let mut fitting = (0..groups.len()).filter(|&index| groups[index].0 == *key && fits(&groups[index].1));
    fitting.clone().find(|&index| shares(&groups[index].1)).or_else(|| fitting.next())
}

/// Adds the skill models to the settings of groups that differ in nothing else.
fn name_skills(groups: &mut [Members]) {
    let keys: Vec<_> = groups.iter().map(|(key, _)| key.clone()).collect();
    for (key, members) in groups {
        if keys.iter().filter(|other| *other == key).count() > 1 {
            let mut skills: Vec<&str> = Vec::new();
            for run in members {
                let name = run.info.skills.as_deref().unwrap_or("unknown");
                if !skills.contains(&name) {
                    skills.push(name);
                }
            }
            key.insert(SKILLS.to_owned(), skills.join(","));
        }
    }
}

fn label(algorithm: &str, differing: &BTreeMap<String, String>, number: usize) -> String {
    if differing.len() > NAMED {
        return format!("{algorithm} #{number}");
    }
    let settings = differing.iter().map(|(key, value)| format!(" {key}={value}"));
    std::iter::once(algorithm.to_owned()).chain(settings).collect()
}

// Statistics of one metric over the seeds of a group.

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

// Experiments as flat lists of settings, for comparison.

/// Returns all settings of an experiment by their path, such as `ppo.lr`, with their values as text.
pub fn settings(experiment: &Experiment) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    flatten(&json!(experiment), String::new(), &mut found);
    found
}

/// Returns the settings of an experiment that another one lacks or has with another value.
pub fn changed_settings(experiment: &Experiment, base: &Experiment) -> BTreeMap<String, String> {
    let (mut changed, base) = (settings(experiment), settings(base));
    changed.retain(|key, value| base.get(key) != Some(value));
    changed
}

/// Formats the first settings in which an experiment differs from another one, with both values.
pub fn settings_that_differ(wanted: &Experiment, other: &Experiment) -> String {
    const NAMED: usize = 4;
    let (wanted, other) = (settings(wanted), settings(other));
    let keys: BTreeSet<&String> = wanted.keys().chain(other.keys()).collect();
    let value = |value: Option<&String>| value.cloned().unwrap_or_else(|| "nothing".to_owned());
    let differing = keys.into_iter().filter(|key| wanted.get(*key) != other.get(*key));
    let mut words: Vec<String> =
        differing.map(|key| format!("{key}={} instead of {}", value(wanted.get(key)), value(other.get(key)))).collect();
    let more = words.len().saturating_sub(NAMED);
    words.truncate(NAMED);
    if more > 0 {
        words.push(format!("and {more} more"));
    }
    words.join("; ")
}

/// Returns an experiment with the default of every key that has one; game, levels, recordings and steps stay.
pub fn with_defaults(experiment: &Experiment) -> Experiment {
    let required = ["game", "train", "test", "demos", "steps"];
    let all = json!(experiment);
    let least: Value = required.into_iter().map(|key| (key.to_owned(), all[key].clone())).collect();
    serde_json::from_value(least).unwrap_or_else(|_| experiment.clone())
}

fn flatten(value: &Value, path: String, found: &mut BTreeMap<String, String>) {
    let join = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Object(entries) => entries.iter().for_each(|(key, value)| flatten(value, join(key), found)),
        Value::String(text) => {
            found.insert(path, text.clone());
        }
        other => {
            found.insert(path, other.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, path::Path};

    use playbot_learner::DeviceKind;

    use super::*;
    use crate::{Algorithm, experiment::file::parse_experiment, run_dir::RunInfo, runs::curves::RunCurves};

    fn run(algorithm: Algorithm, seed: u64, changes: &str) -> RunRecord {
        let experiment = experiment(&format!("seed: {seed}, {changes}"));
        let (version, revision) = ("1".into(), "r".into());
        let info = RunInfo {
            algorithm,
            seed,
            version,
            revision,
            game_version: 1,
            skills: None,
            seen: None,
            begun_from: None,
            observed: Vec::new(),
            device: DeviceKind::Flex,
        };
        let path = format!("{algorithm}-{seed}").into();
        RunRecord {
            path,
            experiment,
            info,
            curves: RunCurves::default(),
            checkpoints: Vec::new(),
            is_training: false,
            updated: None,
        }
    }

    fn grouped(runs: &[RunRecord]) -> Vec<(String, Vec<u64>)> {
        group_runs(runs).iter().map(|group| (group.label.clone(), group.seeds())).collect()
    }

    #[test]
    fn seeds_of_one_experiment_are_a_group() {
        let runs = [
            run(Algorithm::Ppo, 2, ""),
            run(Algorithm::ScorePpo, 1, ""),
            run(Algorithm::Ppo, 1, ""),
            run(Algorithm::ScorePpo, 2, ""),
        ];
        assert_eq!(grouped(&runs), [("ppo".to_owned(), vec![1, 2]), ("score-ppo".to_owned(), vec![1, 2])]);
        assert!(grouped(&[]).is_empty());
    }

    #[test]
    fn groups_are_named_by_what_sets_them_apart() {
        let runs = [run(Algorithm::Ppo, 1, "ppo: (gamma: 0.5)"), run(Algorithm::Ppo, 1, "ppo: (gamma: 0.25)")];
        assert_eq!(
            grouped(&runs).iter().map(|(label, _)| label).collect::<Vec<_>>(),
            ["ppo ppo.gamma=0.5", "ppo ppo.gamma=0.25"]
        );
        let many = run(Algorithm::Ppo, 1, "arenas: 8, worlds: 1, ppo: (gamma: 0.75), score: (horizon: 3)");
        let runs = [runs[0].clone(), many];
        let groups = group_runs(&runs);
        assert_eq!((groups[0].label.as_str(), groups[1].label.as_str()), ("ppo #1", "ppo #2"));
        assert_eq!((groups[0].differing["arenas"].as_str(), groups[1].differing["arenas"].as_str()), ("64", "8"));
        assert_eq!(groups[1].differing.len(), 4);
    }

    #[test]
    fn another_skill_model_is_no_other_seed() {
        let with = |seed, skills: &str| {
            let mut run = run(Algorithm::ScorePpo, seed, "");
            run.info.skills = Some(skills.to_owned());
            run
        };
        let study = [with(1, "a"), with(2, "b")];
        assert_eq!(grouped(&study), [("score-ppo".to_owned(), vec![1, 2])], "each seed has a model of its own");
        let runs = [with(1, "a"), with(1, "b"), with(2, "b"), with(2, "a"), with(3, "c")];
        let expected =
            [("score-ppo skills=a,c".to_owned(), vec![1, 2, 3]), ("score-ppo skills=b".to_owned(), vec![1, 2])];
        assert_eq!(grouped(&runs), expected);
        for group in group_runs(&runs) {
            assert!(group.warnings().iter().any(|warning| warning.contains("another skill model")));
        }
        let mut other = [with(1, "a"), with(2, "a")];
        other[1].info.device = DeviceKind::Ndarray;
        let warnings = group_runs(&other)[0].warnings().join("\n");
        assert!(warnings.contains("devices") && !warnings.contains("skill"), "{warnings}");
    }

    #[test]
    fn doubtful_groups_are_pointed_out() {
        let mut runs = [run(Algorithm::Ppo, 1, ""), run(Algorithm::Ppo, 1, "")];
        runs[1].info.revision = "other".into();
        let warnings = group_runs(&runs)[0].warnings().join("\n");
        assert!(warnings.contains("same seed") && warnings.contains("not finished"), "{warnings}");
        assert!(warnings.contains("revisions"), "{warnings}");
    }

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

    fn experiment(changes: &str) -> Experiment {
        let text = format!(
            r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "d", steps: 100, {changes})"#
        );
        parse_experiment(&text, Path::new("x.ron")).expect("valid")
    }

    #[test]
    fn settings_are_named_by_their_path() {
        let experiment = experiment("seed: 7, ppo: (gamma: 0.5)");
        let all = settings(&experiment);
        assert_eq!((all["game"].as_str(), all["train"].as_str(), all["seed"].as_str()), ("coinrun", "hard:0..63", "7"));
        let changed = changed_settings(&experiment, &with_defaults(&experiment));
        let expected = [("ppo.gamma", "0.5"), ("seed", "7")];
        assert_eq!(changed.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect::<Vec<_>>(), expected);
        assert!(changed_settings(&experiment, &experiment).is_empty());
    }
}
