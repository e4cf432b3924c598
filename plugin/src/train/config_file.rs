//! Reading an experiment from a RON file, with errors one can act on.

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::config::{Experiment, ExperimentError};
use crate::game::nearest;

/// An experiment file cannot be used.
#[derive(Debug, Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The text is not an experiment.
    #[error("{}:{line}:{column}: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong, and the nearest valid key where a key is unknown.
        message: String,
    },
    /// The values do not go together.
    #[error("{}: {source}", path.display())]
    Values {
        /// The file.
        path: PathBuf,
        /// Why.
        source: ExperimentError,
    },
}

/// Reads and checks an experiment.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column.
pub fn read_experiment(path: &Path) -> Result<Experiment, ConfigError> {
    let text = std::fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.into(), source })?;
    let experiment = parse_experiment(&text, path)?;
    experiment.check().map_err(|source| ConfigError::Values { path: path.into(), source })?;
    Ok(experiment)
}

/// Parses the text of an experiment; `path` is for messages.
///
/// # Errors
///
/// [`ConfigError::Syntax`].
pub fn parse_experiment(text: &str, path: &Path) -> Result<Experiment, ConfigError> {
    ron::from_str(text).map_err(|error| ConfigError::Syntax {
        path: path.into(),
        line: error.span.start.line,
        column: error.span.start.col,
        message: explain(&error.code),
    })
}

fn explain(error: &ron::Error) -> String {
    match error {
        ron::Error::NoSuchStructField { expected, found, .. } => match nearest(found, expected) {
            Some(near) => format!("unknown key `{found}`; did you mean `{near}`?"),
            None => format!("unknown key `{found}`; valid keys: {}", expected.join(", ")),
        },
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = r#"(
    game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "demos/coinrun",
    steps: 1000,
    ppo: (gamma: 0.99),
)"#;

    fn error(text: &str) -> String {
        parse_experiment(text, Path::new("x.ron")).expect_err("must be refused").to_string()
    }

    #[test]
    fn defaults_fill_in() {
        let experiment = parse_experiment(GOOD, Path::new("x.ron")).expect("valid");
        assert_eq!(experiment.ppo.gamma, 0.99);
        assert_eq!(experiment.eval.episodes_per_level, 4);
        assert_eq!(experiment.check(), Ok(()));
    }

    #[test]
    fn an_unknown_key_is_named_with_its_line_and_its_neighbour() {
        let text = error(&GOOD.replace("gamma", "gama"));
        assert!(text.starts_with("x.ron:4:"), "{text}");
        assert!(text.contains("`gama`") && text.contains("`gamma`"), "{text}");
        let text = error(&GOOD.replace("steps:", "step:"));
        assert!(text.contains("x.ron:3:") && text.contains("`steps`"), "{text}");
    }

    #[test]
    fn held_out_levels_are_never_trained_on() {
        let mut experiment = parse_experiment(GOOD, Path::new("x.ron")).expect("valid");
        experiment.test.first = 63;
        assert!(experiment.check().expect_err("overlap").to_string().contains("hard:63..127"));
    }
}
