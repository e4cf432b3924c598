//! The tries of people on a level.

use std::collections::BTreeMap;

use bevy_playbot::demo::file::{DemoEnd, DemoEpisode};

use super::numbers::Numbers;
use crate::report::statistics::median;

/// A try with a known end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Try {
    end: TryEnd,
    ticks: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TryEnd {
    Completed,
    Died,
    TimedOut,
}

impl Try {
    /// Returns the try; `None` for an episode that was left before its end, since its outcome is unknown.
    pub fn of(episode: &DemoEpisode) -> Option<Self> {
        let end = match episode.end {
            DemoEnd::Terminated { success: true } => TryEnd::Completed,
            DemoEnd::Terminated { success: false } => TryEnd::Died,
            DemoEnd::Truncated => TryEnd::TimedOut,
            DemoEnd::Aborted => return None,
        };
        Some(Self { end, ticks: episode.len() as u64 })
    }
}

/// Tries on one level, by person.
#[derive(Clone, Debug, Default)]
pub(super) struct LevelTries(BTreeMap<String, Vec<Try>>);

impl LevelTries {
    /// Adds a try.
    pub fn add(&mut self, person: &str, one: Try) {
        self.0.entry(person.to_owned()).or_default().push(one);
    }

    /// Returns the names of the people.
    pub fn people(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Returns the numbers of these people.
    pub fn numbers(&self) -> Numbers {
        let people: Vec<Numbers> = self.0.values().map(|tries| of_person(tries)).collect();
        Numbers::of_people(&people)
    }
}

fn of_person(tries: &[Try]) -> Numbers {
    let share = |end: TryEnd| tries.iter().filter(|one| one.end == end).count() as f64 / tries.len().max(1) as f64;
    let completed = tries.iter().filter(|one| one.end == TryEnd::Completed);
    Numbers {
        tries: tries.len() as u64,
        completion: share(TryEnd::Completed),
        ticks: median(completed.map(|one| one.ticks as f64).collect()),
        deaths: share(TryEnd::Died),
    }
}
