//! Training and test conditions of a study's variants, as text.

use crate::{
    Experiment, LearnerKind,
    study::{StudyReport, study_runs, table::rate_cell},
};
use playbot_harness::split::LevelSplit;
use playbot_learner::brief_number;
use playbot_report::number::{fixed, times};

impl StudyReport {
    /// Returns the conditions of the study as a paragraph of Markdown.
    pub fn conditions(&self) -> String {
        let experiment = &self.experiment;
        let mut seeds: Vec<u64> = self.results.iter().map(|result| result.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        let over = match &seeds[..] {
            [seed] => format!("Seed {seed} alone"),
            _ => {
                let seeds: Vec<String> = seeds.iter().map(u64::to_string).collect();
                format!("Means ± standard deviations over the seeds {}", seeds.join(", "))
            }
        };
        format!(
            "{}. Measured on {}, each level {}. {}. Training figures are those of the last 100 episodes, or of all \
             where there were fewer. The steps are those until their success rate first was {}.",
            self.trainings(),
            experiment.test,
            times(experiment.eval.episodes_per_level),
            over,
            rate_cell(experiment.study.threshold),
        )
    }

    /// Describes the training levels and lengths of the variants: once if all are alike, else by groups of variants.
    fn trainings(&self) -> String {
        let mut kinds: Vec<(String, Vec<&str>)> = Vec::new();
        for (variant, run) in self.trained() {
            let words = training(&run);
            match kinds.iter_mut().find(|(kind, _)| *kind == words) {
                Some((_, variants)) => variants.push(variant),
                None => kinds.push((words, vec![variant])),
            }
        }
        match &kinds[..] {
            [] => "Without training".to_owned(),
            [(words, _)] => format!("Trained on {words}"),
            _ => {
                let each = kinds.iter().map(|(words, variants)| format!("Trained on {words}: {}", variants.join(", ")));
                each.collect::<Vec<_>>().join(". ")
            }
        }
    }

    /// Returns the training levels of all variants; `None` if they differ.
    pub fn trained_on(&self) -> Option<LevelSplit> {
        let mut splits = self.trained().into_iter().map(|(_, run)| run.train);
        let first = splits.next()?;
        splits.all(|split| split == first).then_some(first)
    }

    /// Returns the trained variants with their experiments.
    fn trained(&self) -> Vec<(&str, Experiment)> {
        let runs = study_runs(&self.experiment).unwrap_or_default();
        let experiment = |variant: &str| {
            let run = runs.iter().find(|run| run.variant == variant);
            run.map_or_else(|| self.experiment.clone(), |run| run.experiment.clone())
        };
        let all = self.variants().into_iter().map(|variant| (variant, experiment(variant)));
        all.filter(|(_, run)| run.algorithm.is_trained()).collect()
    }
}

/// Describes levels, steps and, for learners with a free number of them, gradient steps.
fn training(run: &Experiment) -> String {
    let words = format!("{} for {} environment steps", run.train, fixed(run.whole_steps() as f64, 0));
    match run.algorithm.learner() {
        LearnerKind::Ppo => words,
        LearnerKind::Sac => {
            let per = if run.algorithm.learns_prior() { "skill" } else { "step" };
            format!("{words} with {} gradient steps per {per}", brief_number(run.sac.updates_per_step))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{
        Algorithm,
        experiment::file::parse_experiment,
        study::{StudyResult, TestResult},
    };

    fn trainings(variants: &[(&str, &str)]) -> String {
        report(variants).trainings()
    }

    fn report(variants: &[(&str, &str)]) -> StudyReport {
        let set = variants.iter().map(|(name, set)| format!("(name: \"{name}\", set: [{set}])"));
        let text = format!(
            r#"(game: "corridor", train: "plain:0..7", test: "plain:8..15", demos: "unused", steps: 32768,
            score: (init_from_decoder: false), variants: [{}])"#,
            set.collect::<Vec<_>>().join(", ")
        );
        let result = |name: &str| StudyResult {
            variant: name.to_owned(),
            algorithm: Algorithm::Ppo,
            seed: 1,
            training: None,
            test: TestResult {
                episodes: 1,
                success: 1.0,
                success_se: 0.0,
                return_mean: 1.0,
                return_se: 0.0,
                length_mean: 1.0,
                level_returns: Vec::new(),
            },
        };
        StudyReport {
            command: String::new(),
            experiment: parse_experiment(&text, Path::new("x.ron")).expect("valid"),
            results: variants.iter().map(|(name, _)| result(name)).collect(),
            curves: Vec::new(),
        }
    }

    #[test]
    fn curves_of_different_levels_name_none() {
        let title = |variants: &[(&str, &str)]| report(variants).charts()[0].title.clone();
        let elsewhere = ("elsewhere", r#""train=plain:20..29""#);
        assert_eq!(
            title(&[("full", ""), ("plain", r#""algorithm=ppo""#)]),
            "corridor: success in training on plain:0..7"
        );
        assert_eq!(title(&[elsewhere]), "corridor: success in training on plain:20..29");
        assert_eq!(title(&[("full", ""), elsewhere]), "corridor: success in training, each variant on its own levels");
    }

    #[test]
    fn what_all_share_is_said_once() {
        let same = trainings(&[("full", ""), ("plain", r#""algorithm=ppo""#), ("cloned", r#""algorithm=bc""#)]);
        assert_eq!(same, "Trained on plain:0..7 for 32,768 environment steps");
        assert_eq!(trainings(&[("cloned", r#""algorithm=bc""#)]), "Without training");
    }

    #[test]
    fn variants_that_were_trained_otherwise_are_named() {
        let different = trainings(&[
            ("full", ""),
            ("no-kl", r#""score.kl=false""#),
            ("longer", r#""steps=49152""#),
            ("elsewhere", r#""train=plain:20..29""#),
            ("sac", r#""algorithm=sac", "sac.updates_per_step=0.05""#),
        ]);
        assert_eq!(
            different,
            "Trained on plain:0..7 for 32,768 environment steps: full, no-kl. Trained on plain:0..7 for 49,152 \
             environment steps: longer. Trained on plain:20..29 for 32,768 environment steps: elsewhere. Trained on \
             plain:0..7 for 32,768 environment steps with 0.05 gradient steps per step: sac"
        );
    }
}
