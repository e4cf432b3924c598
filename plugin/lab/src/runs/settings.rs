//! Experiments as flat lists of settings, for comparison.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Value, json};

use crate::train::Experiment;

/// Returns all settings of an experiment by their path, such as `ppo.lr`, with their values as text.
pub fn settings(experiment: &Experiment) -> BTreeMap<String, String> {
    let mut found = BTreeMap::new();
    flatten(&json!(experiment), String::new(), &mut found);
    found
}

/// Returns the settings of an experiment that another one lacks or has with another value.
pub fn changed_settings(experiment: &Experiment, base: &Experiment) -> BTreeMap<String, String> {
    let (mut changed, base) = (settings(experiment), settings(base));
    changed.retain(|key, value| base.get(key) != Some(value));
    changed
}

/// Formats the first settings in which an experiment differs from another one, with both values.
pub fn settings_that_differ(wanted: &Experiment, other: &Experiment) -> String {
    const NAMED: usize = 4;
    let (wanted, other) = (settings(wanted), settings(other));
    let keys: BTreeSet<&String> = wanted.keys().chain(other.keys()).collect();
    let value = |value: Option<&String>| value.cloned().unwrap_or_else(|| "nothing".to_owned());
    let differing = keys.into_iter().filter(|key| wanted.get(*key) != other.get(*key));
    let mut words: Vec<String> =
        differing.map(|key| format!("{key}={} instead of {}", value(wanted.get(key)), value(other.get(key)))).collect();
    let more = words.len().saturating_sub(NAMED);
    words.truncate(NAMED);
    if more > 0 {
        words.push(format!("and {more} more"));
    }
    words.join("; ")
}

/// Returns an experiment with the default of every key that has one; game, levels, recordings and steps stay.
pub fn with_defaults(experiment: &Experiment) -> Experiment {
    let required = ["game", "train", "test", "demos", "steps"];
    let all = json!(experiment);
    let least: Value = required.into_iter().map(|key| (key.to_owned(), all[key].clone())).collect();
    serde_json::from_value(least).unwrap_or_else(|_| experiment.clone())
}

fn flatten(value: &Value, path: String, found: &mut BTreeMap<String, String>) {
    let join = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match value {
        Value::Object(entries) => entries.iter().for_each(|(key, value)| flatten(value, join(key), found)),
        Value::String(text) => {
            found.insert(path, text.clone());
        }
        other => {
            found.insert(path, other.to_string());
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::path::Path;

    use super::*;
    use crate::train::config_file::parse_experiment;

    pub fn experiment(changes: &str) -> Experiment {
        let text = format!(
            r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "d", steps: 100, {changes})"#
        );
        parse_experiment(&text, Path::new("x.ron")).expect("valid")
    }

    #[test]
    fn settings_are_named_by_their_path() {
        let experiment = experiment("seed: 7, ppo: (gamma: 0.5)");
        let all = settings(&experiment);
        assert_eq!((all["game"].as_str(), all["train"].as_str(), all["seed"].as_str()), ("coinrun", "hard:0..63", "7"));
        let changed = changed_settings(&experiment, &with_defaults(&experiment));
        let expected = [("ppo.gamma", "0.5"), ("seed", "7")];
        assert_eq!(changed.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect::<Vec<_>>(), expected);
        assert!(changed_settings(&experiment, &experiment).is_empty());
    }
}
