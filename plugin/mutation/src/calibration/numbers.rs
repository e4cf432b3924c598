//! The numbers of a level that are compared, and the tries of people on it.

use bevy_playbot::demo::file::{DemoEnd, DemoEpisode};
use playbot_report::statistics::median;
use playbot_test::verdict::EpisodeScore;
use serde::Serialize;
use std::collections::BTreeMap;

/// The results of a tester, or of people, on a level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LevelNumbers {
    /// Episodes.
    pub tries: u64,
    /// Share of the tries that reached the goal.
    pub completion: f64,
    /// Median ticks of the tries that reached it, if there are any.
    pub ticks: Option<f64>,
    /// Deaths in a try: the share of tries that the game ended before the goal.
    pub deaths: f64,
}

impl LevelNumbers {
    /// Returns the numbers of a tester.
    pub(super) fn of_score(score: &EpisodeScore) -> Self {
        let share = |count: u64| if score.episodes == 0 { 0.0 } else { count as f64 / score.episodes as f64 };
        Self {
            tries: score.episodes,
            completion: share(score.solved),
            ticks: score.ticks.map(|ticks| ticks.median),
            deaths: share(score.lost),
        }
    }

    /// Returns the numbers of several people: means, and the median of their times.
    pub(super) fn of_people(people: &[Self]) -> Self {
        let mean = |value: fn(&Self) -> f64| people.iter().map(value).sum::<f64>() / people.len().max(1) as f64;
        Self {
            tries: people.iter().map(|person| person.tries).sum(),
            completion: mean(|person| person.completion),
            ticks: median(people.iter().filter_map(|person| person.ticks).collect()),
            deaths: mean(|person| person.deaths),
        }
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
    pub fn numbers(&self) -> LevelNumbers {
        let people: Vec<LevelNumbers> = self.0.values().map(|tries| of_person(tries)).collect();
        LevelNumbers::of_people(&people)
    }
}

fn of_person(tries: &[Try]) -> LevelNumbers {
    let share = |end: TryEnd| tries.iter().filter(|one| one.end == end).count() as f64 / tries.len().max(1) as f64;
    let completed = tries.iter().filter(|one| one.end == TryEnd::Completed);
    LevelNumbers {
        tries: tries.len() as u64,
        completion: share(TryEnd::Completed),
        ticks: median(completed.map(|one| one.ticks as f64).collect()),
        deaths: share(TryEnd::Died),
    }
}

/// A try with a known end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Try {
    end: TryEnd,
    ticks: u64,
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

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TryEnd {
    Completed,
    Died,
    TimedOut,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_person_counts_once() {
        let person = |tries, completion, ticks, deaths| LevelNumbers { tries, completion, ticks, deaths };
        let all = [person(9, 1.0, Some(30.0), 0.0), person(1, 0.0, None, 1.0), person(2, 0.5, Some(50.0), 0.5)];
        assert_eq!(LevelNumbers::of_people(&all), person(12, 0.5, Some(40.0), 0.5));
        assert_eq!(LevelNumbers::of_people(&all[1..2]), all[1]);
    }
}
