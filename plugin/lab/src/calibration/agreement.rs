//! The agreement of testers and people on which levels are hard.

use serde::Serialize;

use super::{
    numbers::{CalibratedLevel, Numbers},
    rank::{RankCorrelation, spearman},
    tau::kendall,
};

/// Levels that an interval needs to be narrow enough to be useful.
pub const FEW_LEVELS: usize = 10;

/// A number that is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Measure {
    /// Share of tries that reached the goal.
    Completion,
    /// Median ticks of the tries that reached it.
    Time,
    /// Deaths in a try.
    Deaths,
}

impl Measure {
    /// All measures.
    pub const ALL: [Self; 3] = [Self::Completion, Self::Time, Self::Deaths];

    /// Returns the name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Completion => "completion",
            Self::Time => "time",
            Self::Deaths => "deaths",
        }
    }

    /// Returns the number; `None` if there is none, such as the time on a level that was never completed.
    pub fn of(self, numbers: &Numbers) -> Option<f64> {
        match self {
            Self::Completion => Some(numbers.completion),
            Self::Time => numbers.ticks,
            Self::Deaths => Some(numbers.deaths),
        }
    }

    /// Returns the numbers of people and of a tester on each level that has both.
    pub(super) fn pairs(self, levels: &[CalibratedLevel], tester: usize) -> Vec<(f64, f64)> {
        let pair = |level: &CalibratedLevel| self.of(&level.people).zip(self.of(level.testers.get(tester)?));
        levels.iter().filter_map(pair).collect()
    }
}

/// The rank correlations of a tester and people.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Agreement {
    /// The tester.
    pub tester: String,
    /// The measure.
    pub measure: Measure,
    /// Levels that have a number of both.
    pub levels: usize,
    /// Spearman's rank correlation, if both vary.
    pub spearman: Option<RankCorrelation>,
    /// Kendall's tau-b, if both vary.
    pub kendall: Option<RankCorrelation>,
    /// A caveat about these numbers.
    pub note: Option<String>,
}

impl Agreement {
    /// Computes the agreement of a tester and people on these levels.
    pub(super) fn of(measure: Measure, name: &str, tester: usize, levels: &[CalibratedLevel]) -> Self {
        let pairs = measure.pairs(levels, tester);
        let (people, bots): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        let spearman = spearman(&people, &bots);
        let note = note(measure, &people, &bots, spearman);
        let (tester, levels) = (name.to_owned(), people.len());
        Self { tester, measure, levels, spearman, kendall: kendall(&people, &bots), note }
    }
}

fn note(measure: Measure, people: &[f64], bots: &[f64], found: Option<RankCorrelation>) -> Option<String> {
    let is_one = |values: &[f64]| values.windows(2).all(|pair| pair[0] == pair[1]);
    let count = people.len();
    Some(match found {
        None if count == 0 => format!("no level has a {} of both", measure.name()),
        None if count == 1 => "one level has no order".to_owned(),
        None if is_one(people) && is_one(bots) => "both have the same number on all levels".to_owned(),
        None if is_one(people) => "people have the same number on all levels: nothing to agree with".to_owned(),
        None => "the tester has the same number on all levels".to_owned(),
        Some(RankCorrelation { interval: None, .. }) if count < 4 => "too few levels for an interval".to_owned(),
        Some(RankCorrelation { interval: None, .. }) => {
            format!("the same or the reversed order on all {count} levels: the formula has no interval for that")
        }
        Some(_) if count < FEW_LEVELS => format!("only {count} levels: the interval says little"),
        Some(_) => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Levels on which people and a tester complete these shares.
    fn agreement(people: &[f64], bot: &[f64]) -> Agreement {
        let numbers = |completion| Numbers { tries: 4, completion, ticks: None, deaths: 0.0 };
        let level = |(people, bot): (&f64, &f64)| CalibratedLevel {
            level: "a".to_owned(),
            persons: 2,
            people: numbers(*people),
            testers: vec![numbers(0.5), numbers(*bot)],
        };
        let levels: Vec<CalibratedLevel> = people.iter().zip(bot).map(level).collect();
        Agreement::of(Measure::Completion, "ppo", 1, &levels)
    }

    #[test]
    fn what_says_little_is_called_so() {
        let note = |people: &[f64], bot: &[f64]| agreement(people, bot).note.unwrap_or_default();
        assert_eq!(note(&[], &[]), "no level has a completion of both");
        assert!(note(&[0.5], &[0.5]).contains("one level"));
        assert!(note(&[0.5, 0.5], &[0.1, 0.2]).starts_with("people have the same number"));
        assert!(note(&[0.1, 0.2], &[0.5, 0.5]).starts_with("the tester has the same number"));
        assert!(note(&[0.5, 0.5], &[1.0, 1.0]).starts_with("both have the same number"));
        assert_eq!(note(&[0.1, 0.2, 0.3], &[0.1, 0.3, 0.2]), "too few levels for an interval");
        assert!(note(&[0.1, 0.2, 0.3, 0.4], &[0.1, 0.2, 0.3, 0.4]).starts_with("the same or the reversed order"));
        assert_eq!(note(&[0.1, 0.2, 0.3, 0.4], &[0.1, 0.3, 0.2, 0.4]), "only 4 levels: the interval says little");
        let ten: Vec<f64> = (0..10).map(f64::from).collect();
        let mut other = ten.clone();
        other.swap(2, 3);
        let found = agreement(&ten, &other);
        assert_eq!((found.note, found.levels), (None, 10));
        assert!(found.spearman.is_some_and(|found| found.interval.is_some()));
    }
}
