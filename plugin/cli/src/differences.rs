//! Differences between the options and the work to resume.

use std::collections::BTreeSet;

use playbot_lab::{runs::settings, train::Experiment};

use super::experiment::{ExperimentArgs, sets_key};

/// Most differences to print.
const NAMED: usize = 4;

/// The options of a verb, as they were written.
pub struct Options<'a> {
    /// The options of the experiment.
    pub from: &'a ExperimentArgs,
    /// The options with names of their own: the key that each sets, and the option with its value, if it was given.
    pub own: &'a [(&'a str, Option<String>)],
}

impl Options<'_> {
    /// Returns the settings in which the options differ from the work of `whose`, with both values; keys in `free` may
    /// differ.
    pub fn differences(&self, wanted: &Experiment, kept: &Experiment, whose: &str, free: &[&str]) -> Vec<String> {
        let (kept, wanted) = (settings(kept), settings(wanted));
        let keys: BTreeSet<&String> = kept.keys().chain(wanted.keys()).collect();
        let value = |value: Option<&String>| value.cloned().unwrap_or_else(|| "nothing".to_owned());
        keys.into_iter()
            .filter(|key| !free.contains(&key.as_str()) && kept.get(*key) != wanted.get(*key))
            .map(|key| {
                let (given, kept) = (value(wanted.get(key)), value(kept.get(key)));
                format!("{} asks for {key}={given}, and {whose} has {kept}", self.option_of(key))
            })
            .collect()
    }

    /// Returns the option that sets a key: those with names of their own count last.
    fn option_of(&self, key: &str) -> String {
        let own = self.own.iter().find(|(of, _)| *of == key).and_then(|(_, option)| option.as_ref());
        if let Some(option) = own {
            return format!("`{option}`");
        }
        if let Some(game) = self.from.game.as_ref().filter(|_| key == "game") {
            return format!("`{game}`");
        }
        match (self.from.set.iter().rev().find(|set| reaches(set, key)), &self.from.experiment) {
            (Some(set), _) => format!("`--set {set}`"),
            (None, Some(path)) => format!("`--experiment {}`", path.display()),
            (None, None) => "the experiment without options".to_owned(),
        }
    }
}

/// Returns true if a `key=value` sets this key, alone or with its whole section.
pub fn reaches(set: &str, key: &str) -> bool {
    let sections = key.match_indices('.').map(|(at, _)| &key[..at]);
    sections.chain([key]).any(|name| sets_key(set, name))
}

/// Formats the first differences, and the number of the others.
pub fn in_words(mut differences: Vec<String>) -> String {
    let more = differences.len().saturating_sub(NAMED);
    differences.truncate(NAMED);
    if more > 0 {
        differences.push(format!("and {more} more"));
    }
    differences.join("; ")
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use playbot_lab::train::config_file::parse_experiment;

    use super::*;

    #[test]
    fn each_difference_has_the_option_it_is_from_and_both_values() {
        let text = r#"(game: "g", train: "a:0..3", test: "a:4..7", demos: "d", steps: 10)"#;
        let kept = parse_experiment(text, Path::new("x.ron")).expect("valid");
        let sets = ["seed=7", "skills=(epochs: 3)", "steps=20", "arenas=32"].map(str::to_owned);
        let wanted = kept.with_set(&sets).expect("valid");
        let from = ExperimentArgs { set: sets[1..3].to_vec(), ..Default::default() };
        let own = [("seed", Some("--seed 7".to_owned())), ("algorithm", None)];
        let found = Options { from: &from, own: &own }.differences(&wanted, &kept, "the run", &["steps"]);
        let [arenas, seed, epochs] = &found[..] else { panic!("{found:?}") };
        assert!(arenas.starts_with("the experiment without options asks for arenas=32, and the run has "), "{arenas}");
        assert_eq!(seed, "`--seed 7` asks for seed=7, and the run has 1");
        assert!(
            epochs.starts_with("`--set skills=(epochs: 3)` asks for skills.epochs=3, and the run has "),
            "{epochs}"
        );
        let words = in_words([&found[..], &found[..]].concat());
        assert!(words.matches("; ").count() == 4 && words.ends_with("; and 2 more"), "{words}");
    }
}
