//! Training and test conditions of a study's variants, as text.

use crate::{
    Experiment, LearnerKind,
    study::{
        StudyReport, study_runs,
        table::{count_of, rate_cell},
    },
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
            "{}. {}. {}. Training figures are those of the last 100 episodes, or of all \
             where there were fewer. The steps are those until their success rate first was {}.",
            self.trainings(),
            self.measured_levels(),
            over,
            rate_cell(experiment.study.threshold),
        )
    }

    /// Describes the levels of the measurement, their layouts, and those that are left out.
    fn measured_levels(&self) -> String {
        let Experiment { test, eval, .. } = &self.experiment;
        let (each, left_out) = (times(eval.episodes_per_level), self.known_levels().len() as u64);
        let test_result = self.results.first().map(|run| &run.test);
        let is_known = test_result.is_some_and(|result| result.seen > 0);
        let unseen = if is_known { ". Some run of the study knows each of them: none is new" } else { "" };
        let layouts = test_result.and_then(|result| result.layouts);
        let layouts = layouts.map(|layouts| count_of(layouts, "different layout"));
        let levels = count_of(test.len().saturating_sub(left_out), "level");
        match (left_out, layouts) {
            (0, None) => format!("Measured on {test}, each level {each}{unseen}"),
            (0, Some(layouts)) => format!("Measured on {test}, {levels} of {layouts}, each level {each}{unseen}"),
            (_, layouts) => format!(
                "Measured on {levels} of {test}{}, each level {each}. {} left out, since some run of the study is trained on \
                 their layouts or learns from recordings of them",
                layouts.map_or_else(String::new, |layouts| format!(", which have {layouts}")),
                count_of(left_out, "level") + if left_out == 1 { " is" } else { " are" }
            ),
        }
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
            left_out: Vec::new(),
            with_seen: None,
            test: TestResult {
                layouts: None,
                seen: 0,
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
    fn levels_that_are_left_out_and_layouts_are_counted() {
        let measured = |layouts, left_out: &[u64]| {
            let mut report = report(&[("full", "")]);
            report.results[0].test.layouts = layouts;
            report.results[0].left_out = left_out.to_vec();
            report.measured_levels()
        };
        assert_eq!(measured(None, &[]), "Measured on plain:8..15, each level once");
        assert_eq!(measured(Some(6), &[]), "Measured on plain:8..15, 8 levels of 6 different layouts, each level once");
        assert_eq!(
            measured(Some(4), &[9, 10, 11]),
            "Measured on 5 levels of plain:8..15, which have 4 different layouts, each level once. 3 levels are left out, \
             since some run of the study is trained on their layouts or learns from recordings of them"
        );
        let mut known = report(&[("full", "")]);
        known.results[0].test.seen = 8;
        assert_eq!(
            known.measured_levels(),
            "Measured on plain:8..15, each level once. Some run of the study knows each of them: none is new"
        );
        let of_play = measured(None, &[9]);
        assert!(
            of_play.starts_with("Measured on 7 levels of plain:8..15, each level once. 1 level is left out"),
            "{of_play}"
        );
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
