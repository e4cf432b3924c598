//! Learning curves of a run.

use crate::{
    checkpoint,
    metrics_log::{EPISODE_MEANS, EPISODES, JsonLines, MetricsLog, RECENT, SPS, scalars},
    runs::RunsError,
};
use bevy_playbot::unknown_name::UnknownName;
use std::{collections::BTreeMap, path::Path};

/// All metrics of a run: for each tag the points `(step, value)`, steps ascending. A value that was not a number is
/// NaN.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunCurves {
    curves: BTreeMap<String, Vec<(u64, f64)>>,
    last_step: u64,
    warnings: Vec<String>,
}

impl RunCurves {
    /// Reads `metrics.jsonl` and `timing.jsonl` of the run in `folder`.
    ///
    /// Lines that a crash tore, or that are incomplete yet, are left out with a warning. Missing files are empty, and
    /// files that end before the last checkpoint give a warning.
    ///
    /// # Errors
    ///
    /// [`RunsError::Io`].
    pub fn read(folder: &Path) -> Result<Self, RunsError> {
        let log = MetricsLog::new(folder);
        let mut read = Self::default();
        // Read first, since a training process may save meanwhile.
        let saved = checkpoint::list(folder).ok().and_then(|all| Some(all.last()?.summary.step)).unwrap_or(0);
        for file in [log.metrics_file(), log.timing_file()] {
            let lines = JsonLines::read(file).map_err(|source| RunsError::Io { path: file.into(), source })?;
            let last = lines.lines.last().map_or(0, |line| line.step);
            if last < saved && lines.damaged.is_empty() && file.exists() {
                // A file cut off between two lines looks whole.
                let words = format!("{}: metrics are missing for the steps {last} to {saved}", file.display());
                read.warnings.push(words);
            }
            let damaged = |number| format!("{}: line {number} is damaged and left out", file.display());
            read.warnings.extend(lines.damaged.into_iter().map(damaged));
            for line in lines.lines {
                read.last_step = read.last_step.max(line.step);
                for (tag, value) in scalars(&line.value) {
                    read.curves.entry(tag.to_owned()).or_default().push((line.step, value));
                }
            }
        }
        read.curves.values_mut().for_each(|curve| curve.sort_by_key(|(step, _)| *step));
        Ok(read)
    }

    /// Appends the metrics of an update after the last one.
    pub fn push<'a>(&mut self, step: u64, scalars: impl Iterator<Item = (&'a str, f64)>) {
        self.last_step = self.last_step.max(step);
        for (tag, value) in scalars {
            self.curves.entry(tag.to_owned()).or_default().push((step, value));
        }
    }

    /// Returns the number of logged environment steps.
    pub fn last_step(&self) -> u64 {
        self.last_step
    }

    /// Returns the problems of the files, as text.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Iterates over all curves with their tags, in alphabetical order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[(u64, f64)])> {
        self.curves.iter().map(|(tag, curve)| (tag.as_str(), curve.as_slice()))
    }

    /// Returns the curve of one metric; without points if the run lacks it.
    pub fn curve(&self, tag: &str) -> &[(u64, f64)] {
        self.curves.get(tag).map_or(&[], Vec::as_slice)
    }

    /// Returns the settled points of a curve. A mean over the last 100 episodes settles once 100 episodes have ended;
    /// any other metric is settled from the start.
    pub fn settled(&self, tag: &str) -> &[(u64, f64)] {
        let (curve, counts) = (self.curve(tag), self.curve(EPISODES));
        if counts.is_empty() || !EPISODE_MEANS.contains(&tag) {
            return curve;
        }
        let few = counts.partition_point(|(_, episodes)| *episodes < RECENT as f64);
        let from = counts.get(few).map_or(u64::MAX, |(step, _)| *step);
        &curve[curve.partition_point(|(step, _)| *step < from)..]
    }

    /// Returns the [settled](Self::settled) points of a curve, or all points if no point is settled.
    pub fn settled_or_all(&self, tag: &str) -> &[(u64, f64)] {
        let settled = self.settled(tag);
        if settled.is_empty() { self.curve(tag) } else { settled }
    }

    /// Returns the last value of a metric that is a number.
    pub fn last(&self, tag: &str) -> Option<f64> {
        self.curve(tag).iter().rev().map(|(_, value)| *value).find(|value| !value.is_nan())
    }

    /// Returns environment steps per second of the updates' time: the harmonic mean of `charts/SPS`, since each
    /// update has the same number of steps.
    pub fn steps_per_s(&self) -> Option<f64> {
        let curve = self.curve(SPS);
        let seconds_per_step: f64 = curve.iter().map(|(_, sps)| sps.recip()).sum();
        (!curve.is_empty()).then(|| curve.len() as f64 / seconds_per_step)
    }
}

/// Checks that at least one of the runs has a metric.
///
/// # Errors
///
/// [`UnknownName`] with the nearest of all their metrics.
pub(super) fn check_metric<'a>(
    tag: &str,
    runs: impl Iterator<Item = &'a RunCurves> + Clone,
) -> Result<(), UnknownName> {
    let mut tags: Vec<&str> = runs.flat_map(RunCurves::iter).map(|(tag, _)| tag).collect();
    tags.sort_unstable();
    tags.dedup();
    if tags.contains(&tag) { Ok(()) } else { Err(UnknownName::new("metric", tag, &tags)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_of_few_episodes_do_not_count() {
        let folder = tempfile::tempdir().expect("a folder");
        let lines = [(8, 4, 1.0), (16, 99, 1.0), (24, 100, 0.5), (32, 130, 0.7)].map(|(step, episodes, value)| {
            format!("{{\"step\":{step},\"charts/episodes\":{episodes},\"charts/success_rate\":{value}}}\n")
        });
        std::fs::write(folder.path().join("metrics.jsonl"), lines.concat()).expect("writable");
        let curves = RunCurves::read(folder.path()).expect("readable");
        assert_eq!(curves.settled("charts/success_rate"), [(24, 0.5), (32, 0.7)]);
        assert_eq!(curves.settled(EPISODES).len(), 4);
        assert!(curves.settled("charts/b").is_empty());
    }

    #[test]
    fn curves_are_read_up_to_a_torn_line() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(RunCurves::read(folder.path()).expect("empty"), RunCurves::default());
        let metrics =
            "{\"step\":8,\"update\":1,\"charts/a\":1.5}\n{\"step\":16,\"charts/a\":null,\"charts/b\":2}\n{\"st";
        let timing = "{\"step\":8,\"charts/SPS\":50}\n{\"step\":16,\"charts/SPS\":200,\"learn_s\":1}\n";
        std::fs::write(folder.path().join("metrics.jsonl"), metrics).expect("writable");
        std::fs::write(folder.path().join("timing.jsonl"), timing).expect("writable");
        let curves = RunCurves::read(folder.path()).expect("readable");
        assert_eq!(curves.iter().map(|(tag, _)| tag).collect::<Vec<_>>(), ["charts/SPS", "charts/a", "charts/b"]);
        assert_eq!(curves.curve("charts/a")[0], (8, 1.5));
        assert!(curves.curve("charts/a")[1].1.is_nan() && curves.curve("charts/c").is_empty());
        assert_eq!((curves.last("charts/a"), curves.last("charts/c")), (Some(1.5), None));
        // As many steps at 50/s as at 200/s take 4 parts of the time and 1: 2 / (1/50 + 1/200).
        assert_eq!((curves.steps_per_s(), curves.last_step()), (Some(80.0), 16));
        let [warning] = curves.warnings() else { panic!("{:?}", curves.warnings()) };
        assert!(warning.ends_with("metrics.jsonl: line 3 is damaged and left out"), "{warning}");
        let error = check_metric("charts/aa", [&curves].into_iter()).expect_err("unknown").to_string();
        assert!(error.contains("charts/a"), "{error}");
    }
}
