//! `--set key=value`: an experiment with single values changed.

use super::{
    config::Experiment,
    config_error::{ConfigError, unknown_key},
    config_keys::{Keys, Origin, Value, check_syntax},
};

impl Experiment {
    /// This experiment with each `key=value` put into it, in order. A key in a section has its path, such as
    /// `ppo.lr=0.0003`; values are written as in a file, and texts may lack their quotes: `train=hard:0..31`. A whole
    /// section is changed key by key: `ppo=(lr: 0.0003, epochs: 4)`.
    ///
    /// Whether the values go together is for [`check`](Self::check) to say.
    ///
    /// # Errors
    ///
    /// [`ConfigError::Set`] with the text that does not fit: no `=`, an unknown key, or a value of the wrong type.
    pub fn with_set<S: AsRef<str>>(&self, sets: &[S]) -> Result<Self, ConfigError> {
        sets.iter().try_fold(self.clone(), |experiment, set| put(&experiment, set.as_ref()))
    }
}

fn put(experiment: &Experiment, set: &str) -> Result<Experiment, ConfigError> {
    let origin = Origin::Set(set.to_owned());
    let refuse = |message: String| origin.error((1, 1), message);
    let Some((key, text)) = set.split_once('=') else {
        return Err(refuse("write key=value, such as ppo.lr=0.0003".to_owned()));
    };
    let (key, text) = (key.trim(), text.trim());
    if key == "base" {
        return Err(refuse("`base` names what a file is built on: write it into an experiment file".to_owned()));
    }
    let mut keys = Keys::of_experiment(experiment, &origin)?;
    if Keys::all().is_section(key) && text.starts_with('(') {
        let section = Keys::of_set(key, text, &origin)?;
        section.check_names()?;
        return keys.overlaid(&section).parse(&origin);
    }
    let Some(example) = Keys::all().text(key) else {
        return Err(refuse(unknown_key(key)));
    };
    let text = if example.starts_with('"') && !text.starts_with('"') {
        ron::to_string(text).map_err(|error| refuse(error.to_string()))?
    } else {
        text.to_owned()
    };
    check_syntax(&text).map_err(|error| refuse(format!("`{text}` is not a value: {}", error.code)))?;
    keys.put(key.to_owned(), Value { text, origin: origin.clone() });
    keys.parse(&origin)
}
