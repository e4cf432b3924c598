//! Agents outside their level.

use bevy::math::Rect;

use crate::{
    detector::{Detector, LevelAhead, Moment, Setting, Watch},
    explore::CellGrid,
};

/// A finding for agents outside the plan of their level. Levels without walls have no outside, and are skipped.
pub struct OutOfBounds {
    margin: f64,
}

impl Default for OutOfBounds {
    fn default() -> Self {
        // More than any jump over the edge of a platformer's plan.
        Self { margin: 8.0 }
    }
}

struct Inside(Rect);

impl Detector for OutOfBounds {
    fn name(&self) -> &'static str {
        "out-of-bounds"
    }

    fn describe(&self) -> &'static str {
        "the agent is outside its level"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![Setting::new("margin", &mut self.margin, "tiles around the level that still belong to it")]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let plan = level.plan.as_ref().filter(|plan| !plan.walls.is_empty())?;
        let margin = self.margin as f32 * CellGrid::new(Some(plan), None).size;
        Some(Box::new(Inside(plan.bounds.inflate(margin))))
    }
}

impl Watch for Inside {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let place = moment.place.filter(|place| place.is_finite() && !self.0.contains(*place))?;
        Some(format!("the agent is at {:.1}, {:.1}, outside the level", place.x, place.y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    fn walk(to: f32) -> Vec<Step> {
        (0..=40).map(|tick| Step::at(tick, 5.0 + (to - 5.0) * tick as f32 / 40.0, 5.0)).collect()
    }

    #[test]
    fn who_leaves_the_level_is_found_in_the_first_tick_outside() {
        let (tick, message) = found(&OutOfBounds { margin: 1.0 }, &room(), &walk(13.0)).expect("it is outside");
        // The step is 0.2: after 30 of them the agent is at 11, the edge with its margin, and one later outside.
        assert!((30..=32).contains(&tick), "{tick}");
        assert!(message.contains("outside the level"), "{message}");
    }

    #[test]
    fn inside_near_the_edge_and_in_a_level_without_walls_nothing_is_found() {
        assert_eq!(found(&OutOfBounds::default(), &room(), &walk(17.5)), None);
        let mut open = room();
        open.plan.as_mut().expect("a plan").walls.clear();
        assert_eq!(found(&OutOfBounds::default(), &open, &walk(90.0)), None);
        assert_eq!(found(&OutOfBounds::default(), &LevelAhead::default(), &walk(90.0)), None);
    }
}
