//! Goals without an effect.

use bevy::math::Vec2;

use crate::{
    detector::{Detector, LevelAhead, Moment, Setting, Watch},
    explore::CellGrid,
};

/// A finding for agents that are at the goal of their level's plan without success.
///
/// Some goals need more than a position, such as a key. So it is a default detector only for games that declare
/// [the distance of their goals](Self::within).
pub struct GoalIgnored {
    distance: f64,
    ticks: f64,
    is_usual: bool,
}

impl Default for GoalIgnored {
    fn default() -> Self {
        Self { distance: 0.1, ticks: 10.0, is_usual: false }
    }
}

impl GoalIgnored {
    /// Creates the detector for [a game's own detectors](crate::game::TestTools::detectors): an agent within this
    /// distance of the goal after a tick, in tiles, has reached it in this tick.
    pub fn within(distance: f64) -> Self {
        Self { distance, ticks: 1.0, is_usual: true }
    }
}

struct Near {
    goal: Vec2,
    distance: f32,
    ticks: u32,
    stayed: u32,
}

impl Detector for GoalIgnored {
    fn name(&self) -> &'static str {
        "goal-ignored"
    }

    fn describe(&self) -> &'static str {
        "the agent is at the goal and that is no success"
    }

    fn is_usual(&self) -> bool {
        self.is_usual
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("distance", &mut self.distance, "how far the goal reaches, in tiles"),
            Setting::new("ticks", &mut self.ticks, "ticks in a row at the goal").at_least(1.0),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let plan = level.plan.as_ref()?;
        let distance = self.distance as f32 * CellGrid::new(Some(plan), None).size;
        Some(Box::new(Near { goal: plan.goal, distance, ticks: self.ticks as u32, stayed: 0 }))
    }
}

impl Watch for Near {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let away = moment.place?.distance(self.goal);
        self.stayed = if away <= self.distance && !moment.is_success { self.stayed + 1 } else { 0 };
        (self.stayed >= self.ticks)
            .then(|| format!("the agent is {away:.2} from the goal for {} ticks, and has not reached it", self.stayed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    /// Towards the goal at 8.5, 8.5, where the agent stays.
    fn arrive(is_success: bool) -> Vec<Step> {
        let step = |tick: usize| {
            let along = (0.5 * tick as f32).min(8.5);
            Step { is_success: is_success && along == 8.5, ..Step::at(tick, along, along) }
        };
        (0..60).map(step).collect()
    }

    #[test]
    fn a_goal_that_does_nothing_is_found() {
        let (tick, message) = found(&GoalIgnored::default(), &room(), &arrive(false)).expect("it is there");
        // It arrives in tick 17, which is the first of ten.
        assert_eq!(tick, 26);
        assert!(message.contains("0.00 from the goal"), "{message}");
        assert_eq!(found(&GoalIgnored::within(0.3), &room(), &arrive(false)).map(|(tick, _)| tick), Some(17));
    }

    #[test]
    fn a_goal_that_works_and_one_that_is_passed_by_are_sound() {
        assert_eq!(found(&GoalIgnored::within(0.3), &room(), &arrive(true)), None);
        let by: Vec<Step> = (0..60).map(|tick| Step::at(tick, 0.5 * (tick % 18) as f32, 8.5)).collect();
        assert_eq!(found(&GoalIgnored::default(), &room(), &by), None, "one tick in 18");
        assert_eq!(found(&GoalIgnored::default(), &LevelAhead::default(), &arrive(false)), None, "no plan");
        assert!(!GoalIgnored::default().is_usual() && GoalIgnored::within(0.3).is_usual());
    }
}
