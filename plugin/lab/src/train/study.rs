//! Studies: the variants of an experiment, each with every seed.

use std::{collections::BTreeSet, path::Path};

use playbot_learner::HasExitCode;
use thiserror::Error;

use super::{
    config::{Experiment, ExperimentError, Variant},
    config_error::ConfigError,
};

/// One training (except for behaviour cloning) and one measurement of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyRun {
    /// Name of the variant.
    pub variant: String,
    /// Its experiment with its seed and without variants.
    pub experiment: Experiment,
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::train::{Algorithm, config_file::parse_experiment};

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
            (name: "eyes", set: ["observation=Raster"]), (name: "grey", set: ["observation=Raster", "image.grayscale=true"]),
            (name: "idle", set: ["image.grayscale=true"]), (name: "few", set: ["demo_steps=9"]),
            (name: "won", set: ["demo_wins=true"])"#;
        let runs = study_runs(&experiment(variants)).expect("valid");
        let ids: Vec<String> = runs.iter().map(StudyRun::id).collect();
        let names = ["full", "no-kl", "short", "ppo", "eyes", "grey", "idle", "few", "won"];
        let expected = names.map(|name| [3, 5].map(|seed| format!("{name}-seed{seed}")));
        assert_eq!(ids, expected.concat());
        assert!(runs.iter().all(|run| run.experiment.variants.is_empty() && run.experiment.seeds.is_empty()));
        assert!(!runs[2].experiment.score.kl && runs[0].experiment.score.kl);
        assert_eq!(runs[7].experiment.algorithm, Algorithm::Ppo);
        let skills: Vec<String> = runs.iter().map(|run| run.skill_file().expect("Unicode")).collect();
        assert_eq!((&skills[0], &skills[1]), (&skills[2], &skills[3]), "the same skill settings");
        assert_ne!(skills[0], skills[1], "other seeds");
        assert_ne!(skills[0], skills[4], "other windows");
        assert!(skills[0] != skills[8] && skills[8] != skills[10], "other eyes");
        assert_eq!(skills[0], skills[12], "nobody looks at pictures");
        assert_ne!(skills[0], skills[16], "other recordings");
        assert_ne!(skills[0], skills[14], "fewer demonstrations");
    }

    #[test]
    fn names_of_skill_files_stay_as_they_were() {
        let file = |text: &str| study_runs(&experiment(text)).expect("valid")[0].skill_file().expect("Unicode");
        // The name in the first release with studies; new keys must not change it.
        assert_eq!(file(""), "skills-72e1ee68-seed3.safetensors");
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/experiments/coinrun-ablation.ron");
        let runs = study_runs(&crate::train::config_file::read_experiment(&shipped).expect("valid")).expect("valid");
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
}
