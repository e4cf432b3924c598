//! Detector of the game's rules for fruit, rewards and ends. Playing needs none of it.

use bevy::prelude::*;
use foreign_orchard::{Run, Screen, Thing};
use playbot::harness::{
    detector::{Detector, DetectorTick, EpisodeWatcher, LevelAhead},
    eval::EpisodeResult,
    foreign::ForeignGame,
};
use playbot::prelude::EpisodeEnd;

use crate::defects;

/// Ticks until time is up: see the adapter.
const TIME: u32 = 1500;

/// Largest difference of rewards from rounding.
const ROUNDING: f32 = 1e-3;

/// Adds the detector and the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    defects::add_to(game).detector(|| Rules)
}

struct Rules;

impl Detector for Rules {
    fn name(&self) -> &'static str {
        "orchard-rules"
    }

    fn describe(&self) -> &'static str {
        "fruit that does not count, a reward for something else, or an end that the screen does not show"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::<Watched>::default())
    }
}

/// The run after the last tick.
#[derive(Default)]
struct Watched(Option<Seen>);

#[derive(Clone, Copy)]
struct Seen {
    /// Fruit and distance, as they are paid: see the adapter.
    paid: f32,
    fruit: u32,
    /// Fruit that is not picked yet.
    left: u32,
}

impl EpisodeWatcher for Watched {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let run = moment.world.get_resource::<Run>()?;
        let left = moment
            .world
            .try_query::<&Thing>()
            .map_or(0, |mut things| things.iter(moment.world).filter(|thing| **thing == Thing::Fruit).count() as u32);
        let now = Seen { paid: run.fruit as f32 + run.distance / 10.0, fruit: run.fruit, left };
        let before = self.0.replace(now)?;
        let (earned, reward) = (now.paid - before.paid, moment.reward);
        if (reward - earned).abs() > ROUNDING {
            return Some(format!("a reward of {reward} for fruit and distance of {earned}"));
        }
        let (picked, counted) = (before.left.saturating_sub(left), run.fruit.saturating_sub(before.fruit));
        (picked != counted).then(|| format!("{picked} fruit picked, and {counted} counted"))
    }

    fn end(&mut self, moment: &DetectorTick<'_>, result: &EpisodeResult) -> Option<String> {
        let screen = **moment.world.get_resource::<State<Screen>>()?;
        let is_shown = match result.end {
            EpisodeEnd::Terminated { success } => screen == if success { Screen::Won } else { Screen::Lost },
            EpisodeEnd::Truncated => result.ticks >= TIME,
        };
        (!is_shown).then(|| format!("the run ends after {} ticks: {:?} on {screen:?}", result.ticks, result.end))
    }
}

#[cfg(test)]
mod tests {
    use playbot::prelude::ActionValue;

    use super::*;

    /// Calls a function with the moment of a tick that leads to this run and screen.
    fn at<T>(run: Run, screen: Screen, reward: f32, ask: impl FnOnce(&DetectorTick<'_>) -> T) -> T {
        let mut world = World::new();
        world.insert_resource(State::new(screen));
        world.insert_resource(run);
        ask(&DetectorTick { reward, ..DetectorTick::of(&world, &ActionValue::Discrete(0)) })
    }

    /// Returns the message about a tick after which two fruit are counted, none is left, and the hero is at 15.
    fn said(before: Option<Seen>, reward: f32) -> Option<String> {
        let run = Run { fruit: 2, distance: 15.0 };
        at(run, Screen::Playing, reward, |moment| Watched(before).tick(moment))
    }

    #[test]
    fn rewards_are_for_fruit_and_distance() {
        let is_wrong = |paid, reward| said(Some(Seen { paid, fruit: 2, left: 0 }), reward).is_some();
        assert!(!is_wrong(3.4, 0.1) && !is_wrong(3.5, 0.0) && said(None, 0.7).is_none());
        assert!(is_wrong(3.5, 0.1) && is_wrong(3.4, 0.0));
    }

    #[test]
    fn picked_fruit_counts() {
        let before = |fruit, left| Some(Seen { paid: 2.5, fruit, left });
        assert_eq!(said(before(1, 1), 1.0), None);
        assert_eq!(said(before(2, 1), 1.0).as_deref(), Some("1 fruit picked, and 0 counted"));
        assert_eq!(said(before(1, 0), 1.0).as_deref(), Some("0 fruit picked, and 1 counted"));
    }

    #[test]
    fn runs_end_as_the_screen_shows_or_when_time_is_up() {
        let ends = |screen: Screen, end: EpisodeEnd, ticks: u32| {
            let success = end.is_success();
            let result = EpisodeResult { level: 0, end, success, ticks, clipped: 0, total_reward: 0.0 };
            at(Run::default(), screen, 0.0, |moment| Watched::default().end(moment, &result)).is_none()
        };
        assert!(ends(Screen::Won, EpisodeEnd::WON, 300) && ends(Screen::Lost, EpisodeEnd::LOST, 300));
        assert!(ends(Screen::Playing, EpisodeEnd::Truncated, TIME));
        assert!(!ends(Screen::Playing, EpisodeEnd::LOST, 300) && !ends(Screen::Playing, EpisodeEnd::WON, 300));
        assert!(!ends(Screen::Playing, EpisodeEnd::Truncated, TIME - 1));
    }
}
