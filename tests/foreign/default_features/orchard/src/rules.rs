//! Detector of the game's rules for falls, fruit, rewards and ends. Playing needs none of it.

use avian2d::prelude::LinearVelocity;
use bevy::prelude::*;
use foreign_orchard::{Hero, Run, Screen, Thing};
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

/// Gravity, tiles per second squared.
const GRAVITY: f32 = 36.0;

/// Steps of the game in a second.
const HZ: f32 = 64.0;

/// Ticks of a fall that are enough to tell how strong gravity is: what the hero touches changes its speed unevenly.
const FALL: u32 = 6;

/// Least speed of a fall: a hero may hang between two edges.
const FALLS: f32 = 1.0;

/// Largest difference of changes of speed in a fall, in a tick.
const UNEVEN: f32 = 0.02;

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
        "a fall of another gravity, fruit that does not count, a reward for something else, or an end that the screen does \
         not show"
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::<Watched>::default())
    }
}

/// The run and the fall after the last tick.
#[derive(Default)]
struct Watched(Option<Seen>, Fall);

/// A hero in the air.
#[derive(Default)]
struct Fall {
    speed: Option<f32>,
    /// The last change of speed, and the ticks for which it was the same.
    change: f32,
    ticks: u32,
}

impl Fall {
    /// Notes the upward speed in the air; `None` on the ground.
    fn tick(&mut self, speed: Option<f32>) -> Option<String> {
        let (Some(before), Some(now)) = (self.speed, speed) else {
            *self = Self { speed, ..Self::default() };
            return None;
        };
        let change = now - before;
        self.ticks = if (change - self.change).abs() < UNEVEN { self.ticks + 1 } else { 0 };
        (self.speed, self.change) = (speed, change);
        let is_wrong = now.abs() > FALLS && (change + GRAVITY / HZ).abs() > 5.0 * UNEVEN;
        (is_wrong && self.ticks >= FALL).then(|| format!("the hero falls by {:.1} in a second", -change * HZ))
    }
}

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
        let heroes = moment.world.try_query::<(&Hero, &LinearVelocity)>();
        let hero =
            heroes.and_then(|mut heroes| heroes.iter(moment.world).next().map(|(hero, pace)| (hero.coyote, pace.y)));
        if let Some(fall) = self.1.tick(hero.filter(|(coyote, _)| *coyote < 0.0).map(|(_, speed)| speed)) {
            return Some(fall);
        }
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
        at(run, Screen::Playing, reward, |moment| Watched(before, Fall::default()).tick(moment))
    }

    #[test]
    fn rewards_are_for_fruit_and_distance() {
        let is_wrong = |paid, reward| said(Some(Seen { paid, fruit: 2, left: 0 }), reward).is_some();
        assert!(!is_wrong(3.4, 0.1) && !is_wrong(3.5, 0.0) && said(None, 0.7).is_none());
        assert!(is_wrong(3.5, 0.1) && is_wrong(3.4, 0.0));
    }

    #[test]
    fn falls_are_of_the_games_gravity() {
        let said = |change: f32| {
            let mut fall = Fall::default();
            (0..20).find_map(|tick| fall.tick((tick > 2).then_some(9.0 + tick as f32 * change)))
        };
        assert_eq!(said(-GRAVITY / HZ), None);
        assert_eq!(said(-0.5 * GRAVITY / HZ).as_deref(), Some("the hero falls by 18.0 in a second"));
        let mut rolling = Fall::default();
        let uneven = (0..20).find_map(|tick| rolling.tick(Some(-0.05 * (tick * tick) as f32)));
        assert_eq!(uneven, None, "something is in the way");
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
