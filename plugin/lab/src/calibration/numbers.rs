//! The numbers of a level: tries, completion, time and deaths.

use serde::Serialize;

use crate::{report::statistics::median, verdict::Score};

/// The results of a tester, or of people, on a level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Numbers {
    /// Episodes.
    pub tries: u64,
    /// Share of the tries that reached the goal.
    pub completion: f64,
    /// Median ticks of the tries that reached it, if there are any.
    pub ticks: Option<f64>,
    /// Deaths in a try: the share of tries that the game ended before the goal.
    pub deaths: f64,
}

/// A level that both people and testers have played.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibratedLevel {
    /// Its name in the results.
    pub level: String,
    /// Number of people who played it.
    pub persons: u64,
    /// Results of people. Each person counts once, for any number of tries.
    pub people: Numbers,
    /// Results of each tester, in the order of the results.
    pub testers: Vec<Numbers>,
}

impl Numbers {
    /// Returns the numbers of a tester.
    pub(super) fn of_score(score: &Score) -> Self {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_person_counts_once() {
        let person = |tries, completion, ticks, deaths| Numbers { tries, completion, ticks, deaths };
        let all = [person(9, 1.0, Some(30.0), 0.0), person(1, 0.0, None, 1.0), person(2, 0.5, Some(50.0), 0.5)];
        assert_eq!(Numbers::of_people(&all), person(12, 0.5, Some(40.0), 0.5));
        assert_eq!(Numbers::of_people(&all[1..2]), all[1]);
    }
}
