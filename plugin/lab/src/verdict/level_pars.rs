//! Pars of the levels of a test.

use std::{collections::BTreeSet, fmt};

use bevy_playbot::unknown_name::nearest;

use super::level_name::drawn;
use crate::{detectors::Pars, game::Game, split::LevelSplit};

/// Largest number of names that are reported.
const MOST_NAMES: usize = 5;

/// Number of these levels with a par, and the pars without a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelPars {
    /// Levels with a par.
    pub with: u64,
    /// All levels.
    pub levels: u64,
    /// Names of pars that match no level; the first few with the level that may be meant.
    pub others: Vec<String>,
}

impl LevelPars {
    /// Computes the pars of all levels of a test, in any shard.
    pub fn of(pars: &Pars, game: &dyn Game, split: &LevelSplit) -> Self {
        let designs = drawn(game, split);
        let path = |level| designs.as_ref().and_then(|designs| designs.path(level));
        let paths: Vec<&str> = if designs.is_some() { split.levels().filter_map(path).collect() } else { Vec::new() };
        let known: BTreeSet<&str> = paths.iter().copied().collect();
        // Numbered levels are too many to list.
        let by_number = |name: &str| {
            let level: u64 = name.rsplit_once(':')?.1.parse().ok()?;
            let is_one = designs.is_none() && split.contains(&split.mode, level);
            is_one.then(|| format!("{}:{level}", split.mode))
        };
        let is_one = |name: &str| known.contains(name) || by_number(name).is_some_and(|own| own == name);
        let (own, others): (Vec<&str>, Vec<&str>) = pars.levels().partition(|name: &&str| is_one(name));
        let told = |(index, name): (usize, &str)| {
            let near = || by_number(name).or_else(|| nearest(name, &paths).map(str::to_owned));
            let near = (index < MOST_NAMES).then(near).flatten();
            near.map_or_else(|| name.to_owned(), |near| format!("{name} (did you mean {near}?)"))
        };
        let others = others.into_iter().enumerate().map(told).collect();
        Self { with: own.len() as u64, levels: split.len(), others }
    }
}

impl fmt::Display for LevelPars {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { with, levels, others } = self;
        write!(f, "pars for {with} of {levels} level{}", if *levels == 1 { "" } else { "s" })?;
        if others.is_empty() {
            return Ok(());
        }
        let names = others.iter().take(MOST_NAMES).cloned().collect::<Vec<_>>().join(", ");
        let are = if others.len() == 1 { "name is" } else { "names are" };
        write!(f, "; {} {are} no level of this test: {names}", others.len())?;
        match others.len().saturating_sub(MOST_NAMES) {
            0 => Ok(()),
            more => write!(f, " and {more} more"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;

    fn found(text: &str) -> LevelPars {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("pars.json");
        std::fs::write(&path, text).expect("writable");
        let game = ForeignGame::new("garden", 1, |_: &mut bevy::prelude::App| {});
        let pars = Pars::read(&path, &game).expect("pars");
        LevelPars::of(&pars, &game, &"hard:0..4".parse().expect("a split"))
    }

    #[test]
    fn pars_of_other_levels_are_told_with_what_may_be_meant() {
        let all = found(r#"{"hard:1": 9, "hard:3": 9}"#);
        assert_eq!(all.to_string(), "pars for 2 of 5 levels");
        let some = found(r#"{"hard:1": 9, "hard:3": 9, "hard:99": 9, "hrad:3": 9, "hard:04": 9}"#);
        assert_eq!(
            some.to_string(),
            "pars for 2 of 5 levels; 3 names are no level of this test: hard:04 (did you mean hard:4?), hard:99, hrad:3 \
             (did you mean hard:3?)"
        );
    }

    #[test]
    fn of_many_names_a_few_are_told() {
        let none = found(r#"{"a": 1, "b": 1, "c": 1, "d": 1, "e": 1, "f": 1}"#);
        assert_eq!((none.with, none.others.len()), (0, 6));
        assert!(none.to_string().ends_with("no level of this test: a, b, c, d, e and 1 more"), "{none}");
    }
}
