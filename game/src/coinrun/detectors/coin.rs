//! Detector of coins that are touched and not taken.

use playbot_lab::detector::{Detector, EachTick, Moment};

use super::contact::{goes_on, place, touched};
use crate::coinrun::Outcome;

/// Finds a player that touches the coin in an episode that goes on.
pub(super) fn goal_ignored() -> impl Detector {
    EachTick::new("goal-ignored", "the coin is touched and the episode goes on", |moment: &Moment<'_>| {
        let is_ignored = goes_on(moment) && touched(moment) == Some(Outcome::Coin);
        is_ignored.then(|| format!("touches the coin at {}, and the episode goes on", place(moment)))
    })
}

#[cfg(test)]
mod tests {
    use crate::coinrun::detectors::testing::{Bot, first_named, planted, sound};

    #[test]
    fn a_coin_that_is_not_taken_is_found_and_one_that_is_taken_is_not() {
        assert!(first_named("goal-ignored", &planted("goal-does-not-end", 0), Bot::RightJump, 0..40).is_some());
        assert_eq!(first_named("goal-ignored", &sound(), Bot::RightJump, 0..40), None);
    }
}
