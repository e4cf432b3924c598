//! Agents that fall for ever.

use crate::detector::{Detector, LevelAhead, Moment, Setting, Watch};

/// A finding for agents that fall with nothing left below them.
pub struct FellThrough {
    ticks: f64,
    depth: f64,
}

impl Default for FellThrough {
    fn default() -> Self {
        Self { ticks: 60.0, depth: 10_000.0 }
    }
}

struct Falling {
    ticks: u32,
    /// The lowest point of the level; unknown before the first tick in a level without a plan.
    lowest: Option<f32>,
    depth: f32,
    last: f32,
    fallen: u32,
}

impl Detector for FellThrough {
    fn name(&self) -> &'static str {
        "fell-through"
    }

    fn describe(&self) -> &'static str {
        "the agent falls and nothing is below it any more"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("ticks", &mut self.ticks, "ticks in a row in which it falls").at_least(1.0),
            Setting::new("depth", &mut self.depth, "how far below its start, in the game's units, without a plan"),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let plan = level.plan.as_ref().filter(|plan| !plan.walls.is_empty());
        let lowest = plan.map(|plan| plan.bounds.min.y);
        let (ticks, depth) = (self.ticks as u32, self.depth as f32);
        Some(Box::new(Falling { ticks, lowest, depth, last: f32::NEG_INFINITY, fallen: 0 }))
    }
}

impl Watch for Falling {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let height = moment.height()?;
        let lowest = *self.lowest.get_or_insert(height - self.depth);
        self.fallen = if height < self.last { self.fallen + 1 } else { 0 };
        self.last = height;
        (self.fallen >= self.ticks && height < lowest)
            .then(|| format!("the agent has fallen for {} ticks, down to {height:.1}, below the level", self.fallen))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    fn fall(speed: f32, until: f32) -> Vec<Step> {
        (0..200).map(|tick| Step::at(tick, 5.0, (5.0 - speed * tick as f32).max(until))).collect()
    }

    #[test]
    fn who_falls_below_the_level_is_found() {
        let (tick, message) = found(&FellThrough::default(), &room(), &fall(0.5, -1e9)).expect("it falls");
        assert_eq!(tick, 60, "the first tick is the start, and then it falls 60 times");
        assert!(message.contains("below the level"), "{message}");
        let deep =
            found(&FellThrough::default(), &LevelAhead::default(), &fall(100.0, -1e9)).expect("a level without plan");
        assert_eq!(deep.0, 101, "10,000 below its start is where it is after 100 ticks");
    }

    #[test]
    fn a_long_way_down_and_rest_below_the_plan_are_sound() {
        assert_eq!(found(&FellThrough::default(), &room(), &fall(0.02, -1e9)), None, "it is still inside");
        assert_eq!(found(&FellThrough::default(), &room(), &fall(0.5, -3.0)), None, "it has landed");
        assert_eq!(found(&FellThrough::default(), &LevelAhead::default(), &fall(0.5, -1e9)), None);
    }
}
