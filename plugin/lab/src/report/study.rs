//! Results of a study: those of its runs, and their statistics over the seeds.

use serde::{Deserialize, Serialize};

use super::{
    chart::{Chart, Curve},
    paired::PairedDifference,
    statistics::mean_curve,
};
use crate::{
    eval::EvalSummary,
    train::{
        Algorithm, Experiment,
        metrics_log::{SUCCESS_RATE, range_of},
    },
};

/// Learning curves of a run over environment steps: means over the last 100 training episodes. Empty without
/// training.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LearningCurves {
    /// Steps and success rates.
    pub success: Vec<(u64, f64)>,
    /// Steps and returns.
    pub returns: Vec<(u64, f64)>,
}

/// Result of one run of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StudyResult {
    /// Name of the variant.
    pub variant: String,
    /// Method that made its policy.
    pub algorithm: Algorithm,
    /// The seed.
    pub seed: u64,
    /// Result of training; `None` without training, as in behaviour cloning.
    pub training: Option<TrainingResult>,
    /// The measurement on the held-out levels.
    pub test: TestResult,
}

/// Result of training. Rates and means are over the last 100 training episodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingResult {
    /// Environment steps.
    pub steps: u64,
    /// First step at which the success rate reached the threshold; `None` if it never did.
    pub steps_to_threshold: Option<u64>,
    /// Success rate at the end; `None` if no episode ended.
    pub success: Option<f64>,
    /// Mean return at the end; `None` if no episode ended.
    pub episodic_return: Option<f64>,
}

/// A measurement on held-out levels, each played equally often. Standard errors are over levels, as in [`EvalSummary`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TestResult {
    /// Episodes.
    pub episodes: u64,
    /// Share of episodes that reached the level's goal.
    pub success: f64,
    /// Its standard error.
    pub success_se: f64,
    /// Mean return.
    pub return_mean: f64,
    /// Its standard error.
    pub return_se: f64,
    /// Mean length, ticks.
    pub length_mean: f64,
    /// Mean return on each level, in ascending order of levels; empty in results of older versions.
    #[serde(default)]
    pub level_returns: Vec<f64>,
}

impl From<&EvalSummary> for TestResult {
    fn from(summary: &EvalSummary) -> Self {
        Self {
            episodes: summary.episodes,
            success: summary.success,
            success_se: summary.success_se,
            return_mean: summary.return_mean,
            return_se: summary.return_se,
            length_mean: summary.length_mean,
            level_returns: summary.level_returns.clone(),
        }
    }
}

/// A finished study. Machine and time are left out: the same study gives the same bytes.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StudyReport {
    /// The command that made it.
    pub command: String,
    /// The experiment with its variants.
    pub experiment: Experiment,
    /// The runs, variant by variant.
    pub results: Vec<StudyResult>,
    /// The learning curves of each run, in the same order.
    #[serde(skip)]
    pub curves: Vec<LearningCurves>,
}

impl StudyReport {
    /// Returns the names of the variants, in order.
    pub(super) fn variants(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.results.iter().map(|result| result.variant.as_str()).collect();
        names.dedup();
        names
    }

    /// Returns the results of one variant.
    pub(super) fn of(&self, variant: &str) -> Vec<&StudyResult> {
        self.results.iter().filter(|result| result.variant == variant).collect()
    }

    /// Returns the held-out returns of a variant: its seeds, each with the mean return on each level.
    pub(super) fn level_returns(&self, variant: &str) -> Vec<&[f64]> {
        self.of(variant).into_iter().map(|run| run.test.level_returns.as_slice()).collect()
    }

    /// Returns the held-out return of a variant less that of another; `None` unless both have the same seeds and
    /// levels.
    pub fn difference(&self, variant: &str, other: &str) -> Option<PairedDifference> {
        let seeds = |variant| self.of(variant).iter().map(|run| run.seed).collect::<Vec<_>>();
        if seeds(variant) != seeds(other) {
            return None;
        }
        PairedDifference::of(&self.level_returns(variant), &self.level_returns(other))
    }

    /// Returns success and return over steps: the mean of each trained variant, with its interval over the seeds.
    pub fn charts(&self) -> [Chart; 2] {
        [
            self.chart("success", "success rate", range_of(SUCCESS_RATE), |curves| &curves.success),
            self.chart("return", "mean return", None, |curves| &curves.returns),
        ]
    }

    fn chart(
        &self,
        what: &str,
        mean_of: &str,
        y_range: Option<(f64, f64)>,
        curve: impl Fn(&LearningCurves) -> &Vec<(u64, f64)>,
    ) -> Chart {
        let mut most_seeds = 0;
        let curves = self.variants().into_iter().filter_map(|variant| {
            let runs = self.results.iter().zip(&self.curves).filter(|(result, _)| result.variant == variant);
            let seeds: Vec<_> = runs.map(|(_, curves)| curve(curves).clone()).filter(|c| !c.is_empty()).collect();
            if seeds.is_empty() {
                return None;
            }
            most_seeds = most_seeds.max(seeds.len());
            let mean = mean_curve(&seeds);
            let line = Curve::new(variant, mean.iter().map(|point| (point.step as f64, point.mean)).collect());
            let band = mean.iter().map(|point| (point.low, point.high)).collect();
            Some(if seeds.len() > 1 { line.with_band(band) } else { line })
        });
        let curves = curves.collect();
        let levels = match self.trained_on() {
            Some(levels) => format!(" on {levels}"),
            None => ", each variant on its own levels".to_owned(),
        };
        Chart {
            title: format!("{}: {what} in training{levels}", self.experiment.game),
            x_label: "environment steps".to_owned(),
            y_label: format!("{mean_of} of the last 100 training episodes, {}", over_seeds(most_seeds)),
            curves,
            y_range,
            marks: Vec::new(),
        }
    }

    /// Returns command, experiment and the numbers of every run.
    ///
    /// # Errors
    ///
    /// The path of the demonstrations is not Unicode.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        serde_json::to_string_pretty(self).map(|text| text + "\n")
    }
}

/// Describes the lines and bands of a chart over this many seeds.
fn over_seeds(seeds: usize) -> &'static str {
    match seeds {
        0 => "mean over the seeds",
        1 => "one seed",
        // A bootstrap draws the least of three seeds three times in 1 of 27 cases: the interval of 95 % is the range.
        2 | 3 => "mean and range of the seeds",
        _ => "mean and 95 % bootstrap interval over the seeds",
    }
}

#[cfg(test)]
mod tests {
    use super::over_seeds;

    #[test]
    fn a_band_over_few_seeds_is_their_range() {
        assert_eq!(over_seeds(1), "one seed");
        assert!(over_seeds(3).contains("range") && !over_seeds(3).contains("bootstrap"));
        assert!(over_seeds(4).contains("95 % bootstrap interval"));
    }
}
