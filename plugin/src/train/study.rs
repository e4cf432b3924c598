//! A study: the variants of an experiment, each with every seed.

use std::collections::BTreeSet;

use thiserror::Error;

use super::{
    config::{Experiment, ExperimentError, Variant},
    config_error::ConfigError,
};

/// One training (or none, for behaviour cloning) and one measurement of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct StudyRun {
    /// Name of the variant.
    pub variant: String,
    /// What to run, with its seed; without variants.
    pub experiment: Experiment,
}

/// A study makes no sense.
#[derive(Debug, Error)]
pub enum StudyError {
    /// Two variants have the same name.
    #[error("two variants are called `{0}`: give each a name of its own")]
    SameName(String),
    /// A name cannot be that of a folder.
    #[error(
        "`{0}` cannot be the name of a variant: use letters, digits, `-`, `_` and `.`, and begin with a letter or digit"
    )]
    BadName(String),
    /// The same seed is there twice.
    #[error("seed {0} is there twice: another run with it would be the same run")]
    SameSeed(u64),
    /// A variant does not fit.
    #[error("variant `{variant}`: {source}")]
    Config {
        /// Its name.
        variant: String,
        /// What does not fit.
        source: ConfigError,
    },
    /// The values of a variant do not go together.
    #[error("variant `{variant}`: {source}")]
    Values {
        /// Its name.
        variant: String,
        /// Why.
        source: ExperimentError,
    },
}

impl StudyRun {
    /// Name of its folder.
    pub fn id(&self) -> String {
        format!("{}-seed{}", self.variant, self.experiment.seed)
    }

    /// Name of the file of its skill model, which it shares with every run of the same skill settings, demonstrations
    /// and seed.
    ///
    /// # Errors
    ///
    /// The path of the demonstrations is not Unicode.
    pub fn skill_file(&self) -> Result<String, ron::Error> {
        let run = &self.experiment;
        let settings = ron::to_string(&(&run.game, run.observation, &run.demos, &run.skills))?;
        Ok(format!("skills-{:08x}-seed{}.safetensors", crc32fast::hash(settings.as_bytes()), run.seed))
    }
}

/// The runs of a study, variant by variant: an experiment without variants is compared with nothing, under the name of
/// its algorithm. What a variant changes is applied last, over everything else.
///
/// # Errors
///
/// [`StudyError`] with the variant that does not fit; every one is checked before anything is run.
pub fn study_runs(experiment: &Experiment) -> Result<Vec<StudyRun>, StudyError> {
    let seeds = if experiment.seeds.is_empty() { vec![experiment.seed] } else { experiment.seeds.clone() };
    let mut known = BTreeSet::new();
    if let Some(twice) = seeds.iter().find(|seed| !known.insert(**seed)) {
        return Err(StudyError::SameSeed(*twice));
    }
    let mut runs = Vec::new();
    for variant in variants(experiment)? {
        let mut changed = experiment
            .with_set(&variant.set)
            .map_err(|source| StudyError::Config { variant: variant.name.clone(), source })?;
        changed.variants.clear();
        changed.seeds.clear();
        changed.check().map_err(|source| StudyError::Values { variant: variant.name.clone(), source })?;
        runs.extend(seeds.iter().map(|&seed| StudyRun {
            variant: variant.name.clone(),
            experiment: Experiment { seed, ..changed.clone() },
        }));
    }
    Ok(runs)
}

fn variants(experiment: &Experiment) -> Result<Vec<Variant>, StudyError> {
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
