//! Agents that cannot move.

use bevy::math::Vec2;

use super::efforts::Efforts;
use crate::{
    detector::{Detector, LevelAhead, Moment, Setting, Watch},
    explore::CellGrid,
};

/// A finding for agents that stay at one position for any action, away from the goal. An agent that wanders without
/// progress, or holds a key against a wall, is not stuck.
pub struct Stuck {
    ticks: f64,
    distance: f64,
}

impl Default for Stuck {
    fn default() -> Self {
        Self { ticks: 300.0, distance: 0.01 }
    }
}

/// Distance from the goal within which an agent may rest, in tiles.
const AT_GOAL: f32 = 2.0;

struct Staying {
    ticks: u32,
    distance: f32,
    goal: Option<(Vec2, f32)>,
    anchor: Option<Vec2>,
    stayed: u32,
    efforts: Efforts,
}

impl Detector for Stuck {
    fn name(&self) -> &'static str {
        "stuck"
    }

    fn describe(&self) -> &'static str {
        "the agent cannot leave its place, whatever it does"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("ticks", &mut self.ticks, "ticks in a row at the same place").at_least(1.0),
            Setting::new("distance", &mut self.distance, "how far the same place reaches, in tiles"),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let size = CellGrid::new(level.plan.as_ref(), None).size;
        let goal = level.plan.as_ref().map(|plan| (plan.goal, AT_GOAL * size));
        let (ticks, distance) = (self.ticks as u32, self.distance as f32 * size);
        Some(Box::new(Staying { ticks, distance, goal, anchor: None, stayed: 0, efforts: Efforts::default() }))
    }
}

impl Watch for Staying {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let place = moment.place.filter(|place| place.is_finite())?;
        self.efforts.note(moment.action);
        let is_at_goal = self.goal.is_some_and(|(goal, near)| place.distance(goal) <= near);
        let has_moved = self.anchor.is_none_or(|anchor| place.distance(anchor) > self.distance);
        if has_moved || is_at_goal || moment.is_success {
            (self.anchor, self.stayed) = (Some(place), 0);
            self.efforts.restart();
            return None;
        }
        self.stayed += 1;
        (self.stayed >= self.ticks && self.efforts.are_many(self.stayed)).then(|| {
            format!("the agent has not left {:.1}, {:.1} for {} ticks, whatever it did", place.x, place.y, self.stayed)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    fn steps(step: impl Fn(usize) -> Step) -> Vec<Step> {
        (0..500).map(step).collect()
    }

    #[test]
    fn who_cannot_leave_its_place_is_found() {
        // The world around it goes on.
        let walled = steps(|tick| Step { seen: tick as f32, ..Step::at(tick, 2.0, 2.0) });
        let (tick, message) = found(&Stuck::default(), &room(), &walled).expect("it is stuck");
        assert_eq!(tick, 300);
        assert!(message.contains("2.0, 2.0"), "{message}");
    }

    #[test]
    fn who_wanders_holds_a_key_or_rests_at_the_goal_is_not_stuck() {
        let wanders = steps(|tick| Step::at(tick, 2.0 + (tick / 250) as f32, 2.0));
        let holds = steps(|_| Step::at(0, 2.0, 2.0));
        let rests = steps(|tick| Step::at(tick, 8.0, 8.0));
        let done = steps(|tick| Step { is_success: true, ..Step::at(tick, 2.0, 2.0) });
        let nowhere = steps(|tick| Step { place: None, ..Step::at(tick, 2.0, 2.0) });
        for sound in [wanders, holds, rests, done, nowhere] {
            assert_eq!(found(&Stuck::default(), &room(), &sound), None);
        }
    }
}
