//! Studies: the variants of an experiment, each with every seed.
//!
//! The folder, in reading order:
//!
//! - `conditions`: training and test conditions of a study's variants, as text.
//! - `table`: studies as Markdown: means over the seeds, the numbers of every seed, and the command to run again; the
//!   experiment beside them; and the cost of their runs.

mod conditions;
pub(crate) mod table;

pub use crate::study::table::{
    RESULTS, StudyOutputError, check_experiment_file, rewrite_table, write_cost, write_report,
};
use crate::{
    Algorithm,
    experiment::{Experiment, ExperimentError, Variant, error::ConfigError},
    metrics_log::{SUCCESS_RATE, range_of},
    study::table::markdown_table,
};
use playbot_harness::eval::EvalSummary;
use playbot_learner::{HasExitCode, settings::is_off};
use playbot_report::{
    chart::{Chart, Curve},
    number::{UNKNOWN, fixed, mean_and_error},
    statistics::{Estimate, PairedDifference, holm, interquartile_mean, mean_curve, probability_of_improvement},
};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeSet, path::Path};
use thiserror::Error;

/// One training (except for behaviour cloning) and one measurement of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyRun {
    /// Name of the variant.
    pub variant: String,
    /// Its experiment with its seed and without variants.
    pub experiment: Experiment,
}

impl StudyRun {
    /// Returns the name of its folder.
    pub fn id(&self) -> String {
        format!("{}-seed{}", self.variant, self.experiment.seed)
    }

    /// Returns the file name of its skill model, which it shares with every run of the same skill settings,
    /// demonstrations and seed.
    ///
    /// # Errors
    ///
    /// The path of the demonstrations is not Unicode.
    pub fn skill_file(&self) -> Result<String, ron::Error> {
        let run = &self.experiment;
        let demos = run.demos.as_deref().unwrap_or(Path::new(""));
        let mut settings = ron::to_string(&(&run.game, run.observation, demos, &run.skills))?;
        if !run.skills.norm_obs {
            // The hash stays that of versions without the key, so studies find their existing files.
            settings = settings.replace(",norm_obs:false", "");
        }
        if run.observation_config().is_image() {
            settings += &ron::to_string(&run.image)?;
        }
        if let Some(steps) = run.demo_steps {
            settings += &ron::to_string(&steps)?;
        }
        if run.demo_wins {
            settings += "wins";
        }
        if !run.demo_learned.is_empty() {
            settings += &ron::to_string(&run.demo_learned)?;
        }
        Ok(format!("skills-{:08x}-seed{}.safetensors", crc32fast::hash(settings.as_bytes()), run.seed))
    }
}

/// Returns the runs of a study, variant by variant. An experiment without variants is the only one, under the name of
/// its algorithm. The changes of a variant are applied last, over everything else.
///
/// # Errors
///
/// [`StudyError`] with the invalid variant; all variants are checked before anything is run.
pub fn study_runs(experiment: &Experiment) -> Result<Vec<StudyRun>, StudyError> {
    let seeds = if experiment.seeds.is_empty() { vec![experiment.seed] } else { experiment.seeds.clone() };
    let mut known = BTreeSet::new();
    if let Some(twice) = seeds.iter().find(|seed| !known.insert(**seed)) {
        return Err(StudyError::SameSeed(*twice));
    }
    let mut runs = Vec::new();
    for variant in study_variants(experiment)? {
        check_keys(&variant)?;
        let changed = experiment
            .without_study()
            .with_set(&variant.set)
            .map_err(|source| StudyError::Config { variant: variant.name.clone(), source: Box::new(source) })?;
        changed.check().map_err(|source| StudyError::Values { variant: variant.name.clone(), source })?;
        runs.extend(seeds.iter().map(|&seed| StudyRun {
            variant: variant.name.clone(),
            experiment: Experiment { seed, ..changed.clone() },
        }));
    }
    Ok(runs)
}

fn check_keys(variant: &Variant) -> Result<(), StudyError> {
    let of_the_study = ["seed", "seeds", "variants", "test", "eval", "study"];
    let mut keys = variant.set.iter().filter_map(|set| Some(set.split_once('=')?.0.trim()));
    match keys.find(|key| of_the_study.contains(&key.split('.').next().unwrap_or(key))) {
        Some(key) => Err(StudyError::OfTheStudy { variant: variant.name.clone(), key: key.to_owned() }),
        None => Ok(()),
    }
}

/// Returns the variants of a study; an experiment without variants is the only one, under the name of its algorithm.
///
/// # Errors
///
/// [`StudyError::BadName`] and [`StudyError::SameName`].
pub fn study_variants(experiment: &Experiment) -> Result<Vec<Variant>, StudyError> {
    if experiment.variants.is_empty() {
        return Ok(vec![Variant { name: experiment.algorithm.name().to_owned(), set: Vec::new() }]);
    }
    let mut known = BTreeSet::new();
    for Variant { name, .. } in &experiment.variants {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if !name.starts_with(|c: char| c.is_ascii_alphanumeric()) || !name.chars().all(is_plain) {
            return Err(StudyError::BadName(name.clone()));
        }
        if !known.insert(name.as_str()) {
            return Err(StudyError::SameName(name.clone()));
        }
    }
    Ok(experiment.variants.clone())
}

/// An invalid study.
#[derive(Debug, Error)]
pub enum StudyError {
    /// Two variants have the same name.
    #[error("two variants are called `{0}`: give each a name of its own")]
    SameName(String),
    /// A name that is not valid for a folder.
    #[error(
        "`{0}` cannot be the name of a variant: use letters, digits, `-`, `_` and `.`, and begin with a letter or digit"
    )]
    BadName(String),
    /// The same seed occurs twice.
    #[error("seed {0} is there twice: another run with it would be the same run")]
    SameSeed(u64),
    /// A variant changes a key of the study itself.
    #[error(
        "variant `{variant}`: `{key}` is not for a variant: all are trained with the study's `seeds` and measured in the same \
         way on the same levels"
    )]
    OfTheStudy {
        /// Its name.
        variant: String,
        /// The key.
        key: String,
    },
    /// A variant with an invalid change.
    #[error("variant `{variant}`: {source}")]
    Config {
        /// Its name.
        variant: String,
        /// The error.
        source: Box<ConfigError>,
    },
    /// A variant whose values contradict one another.
    #[error("variant `{variant}`: {source}")]
    Values {
        /// Its name.
        variant: String,
        /// The error.
        source: ExperimentError,
    },
}

impl HasExitCode for StudyError {}

// Results of a study.

/// The most lines of a chart. More cannot be told apart.
const MOST_CURVES: usize = 7;

/// Learning curves of a run over environment steps: means over the last 100 training episodes, from the step on at
/// which 100 have ended. Empty without training.
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
    /// The measurement on the held-out levels that are new to each run of the study.
    pub test: TestResult,
    /// The other held-out levels, in ascending order: some run is trained on their layouts or learns from recordings of
    /// them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<u64>,
    /// The measurement on all held-out levels, if there are others and they were wanted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with_seen: Option<TestResult>,
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
    /// Different layouts of the levels; `None` if the game does not hash them, and in results of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layouts: Option<u64>,
    /// Levels that some run of the study knows.
    #[serde(default, skip_serializing_if = "is_off")]
    pub seen: u64,
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
            layouts: summary.layouts,
            seen: summary.seen,
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
    pub fn variants(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.results.iter().map(|result| result.variant.as_str()).collect();
        names.dedup();
        names
    }

    /// Returns the results of one variant.
    pub fn of(&self, variant: &str) -> Vec<&StudyResult> {
        self.results.iter().filter(|result| result.variant == variant).collect()
    }

    /// Returns the held-out returns of a variant: its seeds, each with the mean return on each level.
    pub fn level_returns(&self, variant: &str) -> Vec<&[f64]> {
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

    /// Returns the trained variants that the charts draw, the first `MOST_CURVES` of them, and the number of the
    /// others.
    pub fn drawn(&self) -> (Vec<&str>, usize) {
        let mut trained = self.variants();
        trained.retain(|variant| self.of(variant).iter().any(|run| run.training.is_some()));
        let others = trained.len().saturating_sub(MOST_CURVES);
        trained.truncate(MOST_CURVES);
        (trained, others)
    }

    /// Returns success and return over steps: the mean of each variant that is [drawn](Self::drawn), with its interval
    /// over the seeds.
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
        let (variants, others) = self.drawn();
        let curves = variants.iter().map(|&variant| {
            let runs = self.results.iter().zip(&self.curves).filter(|(result, _)| result.variant == variant);
            let seeds: Vec<_> = runs.map(|(_, curves)| curve(curves).clone()).filter(|c| !c.is_empty()).collect();
            most_seeds = most_seeds.max(seeds.len());
            let mean = mean_curve(&seeds);
            let line = Curve::new(variant, mean.iter().map(|point| (point.step as f64, point.mean)).collect());
            let band = mean.iter().map(|point| (point.low, point.high)).collect();
            if seeds.len() > 1 { line.with_band(band) } else { line }
        });
        let curves = curves.collect();
        let mut notes = vec!["Curves begin once 100 training episodes have ended.".to_owned()];
        if others > 0 {
            notes.push(format!(
                "The first {} of {} trained variants are drawn; the other {others} are in the tables.",
                variants.len(),
                variants.len() + others
            ));
        }
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
            notes,
            ..Chart::default()
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

impl StudyReport {
    /// Returns the levels that some run knows, and of which there is a measurement besides.
    pub(crate) fn known_levels(&self) -> &[u64] {
        self.results.first().map_or(&[], |run| &run.left_out)
    }

    /// Returns the paired differences of the first variant from each other one.
    pub fn differences(&self) -> String {
        let variants = self.variants();
        let Some((first, others)) = variants.split_first() else { return String::new() };
        let paired: Vec<(&str, PairedDifference)> =
            others.iter().filter_map(|other| Some((*other, self.difference(first, other)?))).collect();
        if paired.is_empty() {
            return String::new();
        }
        let p_values: Vec<f64> = paired.iter().filter_map(|(_, found)| found.p_value()).collect();
        let mut together = holm(&p_values).into_iter();
        let rows = paired.iter().map(|(other, found)| {
            let p = found.p_value();
            let p_together = p.and_then(|_| together.next());
            let words = match (p_together, found.mean > 0.0) {
                (None, _) => "one seed is too few",
                (Some(0.05..), _) => "no difference that is clear",
                (Some(_), true) => "clearly above",
                (Some(_), false) => "clearly below",
            };
            let [levels, seeds] = [found.levels, found.seeds].map(|count| count.to_string());
            let difference = mean_and_error(found.mean, found.se, 2);
            vec![(*other).to_owned(), difference, levels, seeds, p_cell(p), p_cell(p_together), words.to_owned()]
        });
        let headings = ["other", "difference", "levels", "seeds", "p", "p of all", &format!("{first} is")];
        format!(
            "The held-out return of **{first}** less that of each other variant, on the same levels and with the same seeds. ± is \
             the standard error over levels and seeds; p is Student's t with one degree of freedom less than there are seeds. \
             The p of all allows for that many comparisons (Holm), and below 0.05 the difference is called clear.\n\n{}\n",
            markdown_table(&headings, rows)
        )
    }

    /// Returns interquartile means, and the probability that the first variant does better. A variant with a single
    /// seed has neither, since one seed does not generalise to others.
    pub fn intervals(&self) -> String {
        let variants = self.variants();
        let seeds = |variant: &str| Some(self.level_returns(variant)).filter(|returns| returns.len() > 1);
        let first = variants.first().and_then(|first| seeds(first));
        let cell = |found: Option<Estimate>| {
            found.map_or(UNKNOWN.to_owned(), |Estimate { value, low, high }| {
                format!("{} [{}, {}]", fixed(value, 2), fixed(low, 2), fixed(high, 2))
            })
        };
        let rows: Vec<Vec<String>> = variants
            .iter()
            .enumerate()
            .filter_map(|(number, variant)| {
                let returns = seeds(variant)?;
                let mean = interquartile_mean(&returns)?;
                let first = first.as_ref().filter(|_| number > 0);
                let improvement = first.and_then(|first| probability_of_improvement(first, &returns));
                Some(vec![(*variant).to_owned(), cell(Some(mean)), cell(improvement)])
            })
            .collect();
        if rows.is_empty() {
            return String::new();
        }
        let above = format!("{} above it", variants[0]);
        format!(
            "The interquartile mean over the seeds: that of the middle half of the runs, each with its mean held-out \
             return over all levels. The last column is the probability that a run of **{}** has a higher return on a \
             level than a run of the variant. Equal returns count half. Brackets hold 95 % intervals by a bootstrap \
             over seeds and levels. They are too narrow for a handful of seeds. Variants with a single seed have neither.\n\n{}\n",
            variants[0],
            markdown_table(&["variant", "interquartile mean", &above], rows.into_iter())
        )
    }
}

/// Formats a p-value; unknown if there is no value.
fn p_cell(p: Option<f64>) -> String {
    p.map_or(UNKNOWN.to_owned(), |p| if p < 0.001 { "< 0.001".to_owned() } else { fixed(p, 3) })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{over_seeds, *};
    use crate::{Algorithm, experiment::file::parse_experiment};

    fn experiment(variants: &str) -> Experiment {
        let text = format!(
            r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "demos", steps: 1000, seeds: [3, 5],
            variants: [{variants}])"#
        );
        parse_experiment(&text, Path::new("x.ron")).expect("valid")
    }

    fn error(variants: &str) -> String {
        study_runs(&experiment(variants)).expect_err("must be refused").to_string()
    }

    #[test]
    fn every_variant_runs_with_every_seed_and_shares_skills_where_it_can() {
        let variants = r#"(name: "full"), (name: "no-kl", set: ["score.kl=false"]),
            (name: "short", set: ["skills.window=5"]), (name: "ppo", set: ["algorithm=ppo"]),
            (name: "pixels", set: ["observation=Raster"]), (name: "grey", set: ["observation=Raster", "image.grayscale=true"]),
            (name: "idle", set: ["image.grayscale=true"]), (name: "few", set: ["demo_steps=9"]),
            (name: "won", set: ["demo_wins=true"])"#;
        let runs = study_runs(&experiment(variants)).expect("valid");
        let ids: Vec<String> = runs.iter().map(StudyRun::id).collect();
        let names = ["full", "no-kl", "short", "ppo", "pixels", "grey", "idle", "few", "won"];
        let expected = names.map(|name| [3, 5].map(|seed| format!("{name}-seed{seed}")));
        assert_eq!(ids, expected.concat());
        assert!(runs.iter().all(|run| run.experiment.variants.is_empty() && run.experiment.seeds.is_empty()));
        assert!(!runs[2].experiment.score.kl && runs[0].experiment.score.kl);
        assert_eq!(runs[7].experiment.algorithm, Algorithm::Ppo);
        let skills: Vec<String> = runs.iter().map(|run| run.skill_file().expect("Unicode")).collect();
        assert_eq!((&skills[0], &skills[1]), (&skills[2], &skills[3]), "the same skill settings");
        assert_ne!(skills[0], skills[1], "other seeds");
        assert_ne!(skills[0], skills[4], "other windows");
        assert!(skills[0] != skills[8] && skills[8] != skills[10], "other sensors");
        assert_eq!(skills[0], skills[12], "no variant reads pictures");
        assert_ne!(skills[0], skills[16], "other recordings");
        assert_ne!(skills[0], skills[14], "fewer demonstrations");
    }

    #[test]
    fn names_of_skill_files_stay_as_they_were() {
        let file = |text: &str| study_runs(&experiment(text)).expect("valid")[0].skill_file().expect("Unicode");
        // The name in the first release with studies; new keys must not change it.
        assert_eq!(file(""), "skills-72e1ee68-seed3.safetensors");
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/experiments/coinrun-ablation.ron");
        let runs = study_runs(&crate::experiment::file::read_experiment(&shipped).expect("valid")).expect("valid");
        assert_eq!(runs[0].skill_file().expect("Unicode"), "skills-1b4ea9c2-seed1.safetensors");
        assert_ne!(file(""), file(r#"(name: "a", set: ["skills.norm_obs=true"])"#));
        let without = study_runs(&experiment(r#"(name: "a", set: ["algorithm=ppo", "demos=None"])"#)).expect("valid");
        assert_ne!(without[0].skill_file().expect("Unicode"), file(""));
    }

    #[test]
    fn an_experiment_without_variants_is_its_own_only_one() {
        let mut experiment = experiment("");
        experiment.seeds.clear();
        let runs = study_runs(&experiment).expect("valid");
        assert_eq!(runs.iter().map(StudyRun::id).collect::<Vec<_>>(), ["score-ppo-seed1"]);
    }

    #[test]
    fn a_variant_that_does_not_fit_is_named_before_anything_runs() {
        let text = error(r#"(name: "a"), (name: "b", set: ["score.kll=false"])"#);
        assert!(text.contains("variant `b`") && text.contains("`score.kl`"), "{text}");
        let text = error(r#"(name: "b", set: ["ppo.minibatches=7"])"#);
        assert!(text.contains("variant `b`") && text.contains("must divide"), "{text}");
        let measured = ["test=hard:64..70", "eval.greedy=true", "eval=(greedy: true)", "study.threshold=0.1"];
        for set in ["seed=9", " seeds = [1]", "variants=[]"].into_iter().chain(measured) {
            let text = error(&format!(r#"(name: "b", set: ["{set}"])"#));
            assert!(text.contains("variant `b`") && text.contains("the study's `seeds`"), "{text}");
        }
        assert!(error(r#"(name: "a"), (name: "a")"#).contains("two variants"));
        assert!(error(r#"(name: "../a")"#).contains("letters, digits"));
        let mut twice = experiment("");
        twice.seeds = vec![1, 2, 1];
        assert!(study_runs(&twice).expect_err("twice").to_string().contains("seed 1"));
    }

    #[test]
    fn a_band_over_few_seeds_is_their_range() {
        assert_eq!(over_seeds(1), "one seed");
        assert!(over_seeds(3).contains("range") && !over_seeds(3).contains("bootstrap"));
        assert!(over_seeds(4).contains("95 % bootstrap interval"));
    }
}
