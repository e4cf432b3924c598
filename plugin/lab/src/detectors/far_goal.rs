//! Goals that are reached from afar.

use bevy::math::Vec2;

use crate::{
    detector::{Detector, LevelAhead, Moment, Setting, Watch},
    explore::CellGrid,
};

/// A finding for agents that succeed far from the goal of their level's plan.
///
/// In some games success does not depend on the position. So it is a default detector only for games that declare
/// [the distance of their goals](Self::beyond).
pub struct FarGoal {
    distance: f64,
    is_usual: bool,
}

impl Default for FarGoal {
    fn default() -> Self {
        Self { distance: 3.0, is_usual: false }
    }
}

impl FarGoal {
    /// Creates the detector for [a game's own detectors](crate::game::TestTools::detectors): no agent farther from the
    /// goal than this, in tiles, can reach it.
    pub fn beyond(distance: f64) -> Self {
        Self { distance, is_usual: true }
    }
}

struct Away {
    goal: Vec2,
    distance: f32,
    was_success: bool,
}

impl Detector for FarGoal {
    fn name(&self) -> &'static str {
        "far-goal"
    }

    fn describe(&self) -> &'static str {
        "the agent succeeds far from the goal"
    }

    fn is_usual(&self) -> bool {
        self.is_usual
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![Setting::new("distance", &mut self.distance, "how far the goal may reach, in tiles")]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let plan = level.plan.as_ref()?;
        let distance = self.distance as f32 * CellGrid::new(Some(plan), None).size;
        Some(Box::new(Away { goal: plan.goal, distance, was_success: false }))
    }
}

impl Watch for Away {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let is_first = moment.is_success && !self.was_success;
        self.was_success |= moment.is_success;
        let away = moment.place.filter(|_| is_first)?.distance(self.goal);
        (away > self.distance).then(|| format!("the agent succeeds {away:.1} from the goal"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    /// From the goal at 8.5, 8.5 to the left, with success in one tick.
    fn leave(success: usize) -> Vec<Step> {
        (0..16)
            .map(|tick| Step { is_success: tick >= success, ..Step::at(tick, 8.5 - 0.5 * tick as f32, 8.5) })
            .collect()
    }

    #[test]
    fn success_far_from_the_goal_is_found_when_it_comes() {
        let (tick, message) = found(&FarGoal::default(), &room(), &leave(8)).expect("4 tiles away");
        assert_eq!(tick, 8);
        assert!(message.contains("4.0 from the goal"), "{message}");
        assert!(found(&FarGoal::beyond(1.0), &room(), &leave(3)).is_some());
    }

    #[test]
    fn success_at_the_goal_is_sound_wherever_the_agent_goes_then() {
        assert_eq!(found(&FarGoal::default(), &room(), &leave(2)), None);
        assert_eq!(found(&FarGoal::default(), &room(), &leave(99)), None, "no success");
        assert_eq!(found(&FarGoal::default(), &LevelAhead::default(), &leave(8)), None, "no plan");
        assert!(!FarGoal::default().is_usual() && FarGoal::beyond(1.0).is_usual());
    }
}
