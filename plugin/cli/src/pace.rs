//! Estimate of the time that is left, by the recent speed of the work.

use std::{
    collections::VecDeque,
    time::{Duration, Instant},
};

/// Older progress does not count, as long as there is newer.
const WINDOW: Duration = Duration::from_secs(60);

/// Times and amounts of progress. Work that advances in leaps, such as a training after each update, does not count as
/// standing still in between.
#[derive(Default)]
pub struct Pace {
    steps: VecDeque<(Instant, u64)>,
}

impl Pace {
    /// Returns the time that is left at `now` from `done` to `length`; `None` before the second progress, and at the
    /// end.
    pub fn left(&mut self, now: Instant, done: u64, length: u64) -> Option<Duration> {
        let is_back = self.steps.back().is_some_and(|&(_, last)| last > done);
        if is_back {
            self.steps.clear();
        }
        if done > 0 && self.steps.back().is_none_or(|&(_, last)| last != done) {
            self.steps.push_back((now, done));
        }
        while self.steps.len() > 2 && now.duration_since(self.steps[1].0) >= WINDOW {
            self.steps.pop_front();
        }
        let (&(begin, first), &(end, last)) = (self.steps.front()?, self.steps.back()?);
        let way = length.checked_sub(last).filter(|&way| way > 0 && last > first)?;
        let needed = end.duration_since(begin).as_secs_f64() * way as f64 / (last - first) as f64;
        Duration::try_from_secs_f64(needed).ok()?.checked_sub(now.duration_since(end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_that_leaps_does_not_stand_still_in_between() {
        let (start, mut pace) = (Instant::now(), Pace::default());
        let mut left = |seconds, done| pace.left(start + Duration::from_secs(seconds), done, 1000);
        assert_eq!(left(0, 0), None);
        // A training that was resumed at 100.
        assert_eq!((left(1, 100), left(5, 100)), (None, None));
        // 100 in 10 seconds: 80 for the rest, of which time goes by.
        assert_eq!((left(11, 200), left(14, 200)), (Some(Duration::from_secs(80)), Some(Duration::from_secs(77))));
        assert_eq!(left(200, 200), None, "it takes longer than was thought");
        // It has become slower: progress of more than a minute ago is forgotten.
        assert_eq!(left(211, 300), Some(Duration::from_secs(1400)));
        assert_eq!(left(300, 1000), None, "done");
        assert_eq!(left(301, 10), None, "begun anew");
    }
}
