//! Reading an experiment from a RON file, with errors one can act on.
//!
//! `base: ["coinrun-ppo", "mine.ron"]` at the top of a file names what it is built on: presets by name, files by their
//! path from the file's own folder. Each is laid over the ones before it, and the file's own keys over all of them, key by
//! key; a list is one value. A base may have a base of its own.

use std::path::Path;

use super::{
    config::Experiment,
    config_keys::{Keys, Origin},
    presets::Preset,
};

pub use super::config_error::ConfigError;

/// Files below one another, at most: more means that they go round in a circle.
const MAX_DEPTH: usize = 8;

/// Reads and checks an experiment.
///
/// # Errors
///
/// [`ConfigError`] with file, line and column.
pub fn read_experiment(path: &Path) -> Result<Experiment, ConfigError> {
    let experiment = parse_experiment(&read(path)?, path)?;
    experiment.check().map_err(|source| ConfigError::Values { path: path.into(), source })?;
    Ok(experiment)
}

/// Parses the text of an experiment. `path` is for messages and says where to look for files that it is built on.
///
/// # Errors
///
/// [`ConfigError::Syntax`], also for what it is built on; [`ConfigError::Read`] if that cannot be read.
pub fn parse_experiment(text: &str, path: &Path) -> Result<Experiment, ConfigError> {
    gather(text, path, 0)?.parse(&Origin::start_of(path))
}

fn read(path: &Path) -> Result<String, ConfigError> {
    std::fs::read_to_string(path).map_err(|source| ConfigError::Read { path: path.into(), source })
}

/// The keys of a file over those of what it is built on. Each file is checked alone, so that a wrong value is found even
/// if a later one hides it.
fn gather(text: &str, path: &Path, depth: usize) -> Result<Keys, ConfigError> {
    let start = Origin::start_of(path);
    let mut own = Keys::of_text(text, path)?;
    let base = own.take("base");
    own.check_names()?;
    Keys::all().clone().overlaid(&own).parse(&start)?;
    let mut keys = Keys::default();
    if let Some(base) = base {
        let names: Vec<String> = ron::from_str(&base.text).map_err(|_| {
            let message = "`base` must be a list of presets and files, such as [\"coinrun-ppo\", \"mine.ron\"]";
            base.origin.error((1, 1), message.to_owned())
        })?;
        if depth == MAX_DEPTH {
            return Err(base.origin.error((1, 1), format!("`base` goes round in a circle, or {MAX_DEPTH} files deep")));
        }
        for name in names {
            keys = keys.overlaid(&gather_base(&name, path, depth + 1, &base.origin)?);
        }
    }
    Ok(keys.overlaid(&own))
}

fn gather_base(name: &str, user: &Path, depth: usize, origin: &Origin) -> Result<Keys, ConfigError> {
    if name.ends_with(".ron") {
        let path = user.with_file_name(name);
        let text = std::fs::read_to_string(&path).map_err(|error| {
            origin.error((1, 1), format!("`base` names {}, which cannot be read: {error}", path.display()))
        })?;
        return gather(&text, &path, depth);
    }
    let preset = Preset::find(name)
        .map_err(|error| origin.error((1, 1), format!("{error}; or a file, by its path ending in .ron")))?;
    gather(preset.text, Path::new(&format!("assets/presets/{name}.ron")), depth)
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
