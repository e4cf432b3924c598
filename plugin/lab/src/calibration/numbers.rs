//! What a level cost somebody.

use serde::Serialize;

use crate::{report::statistics::median, verdict::Score};

/// How a tester, or people, did on a level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Numbers {
    /// Episodes.
    pub tries: u64,
    /// Share of the tries that reached the aim.
    pub completion: f64,
    /// Median ticks of those that did, if there are any.
    pub ticks: Option<f64>,
    /// Deaths in a try: the share of tries that the game ended without the aim.
    pub deaths: f64,
}

/// A level that people have played and testers have tested.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibratedLevel {
    /// Its name, as results have it.
    pub level: String,
    /// How many people have played it.
    pub persons: u64,
    /// How these did, each of whom counts once, however often each tried.
    pub people: Numbers,
    /// How each tester did, in the order of the results.
    pub testers: Vec<Numbers>,
}

impl Numbers {
    /// Those of a tester.
    pub(super) fn of_score(score: &Score) -> Self {
        let share = |count: u64| if score.episodes == 0 { 0.0 } else { count as f64 / score.episodes as f64 };
        Self {
            tries: score.episodes,
            completion: share(score.solved),
            ticks: score.ticks.map(|ticks| ticks.median),
            deaths: share(score.lost),
        }
    }

    /// Those of several people: means, and the median of their times.
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
