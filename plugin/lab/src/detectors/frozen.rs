//! Games that stand still.

use super::efforts::Efforts;
use crate::detector::{Detector, LevelAhead, Moment, Setting, Watch};

/// A finding for games in which nothing changes for any action: not the state and not the observations.
pub struct FrozenWorld {
    ticks: f64,
}

impl Default for FrozenWorld {
    fn default() -> Self {
        Self { ticks: 300.0 }
    }
}

struct Still {
    ticks: u32,
    state: Option<u64>,
    same: u32,
    efforts: Efforts,
}

impl Detector for FrozenWorld {
    fn name(&self) -> &'static str {
        "frozen-world"
    }

    fn describe(&self) -> &'static str {
        "nothing changes any more, whatever the agent does"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![Setting::new("ticks", &mut self.ticks, "ticks in a row without any change").at_least(1.0)]
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn Watch>> {
        Some(Box::new(Still { ticks: self.ticks as u32, state: None, same: 0, efforts: Efforts::default() }))
    }
}

impl Watch for Still {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let state = moment.fingerprint();
        self.efforts.note(moment.action);
        if self.state == Some(state) {
            self.same += 1;
        } else {
            (self.state, self.same) = (Some(state), 0);
            self.efforts.restart();
        }
        (self.same >= self.ticks && self.efforts.are_many(self.same))
            .then(|| format!("nothing has changed for {} ticks, whatever the agent did", self.same))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    #[test]
    fn a_world_that_stands_still_is_found() {
        let steps: Vec<Step> = (0..400).map(|tick| Step::at(tick, 5.0, 5.0)).collect();
        assert_eq!(found(&FrozenWorld::default(), &room(), &steps).map(|(tick, _)| tick), Some(300));
        assert_eq!(found(&FrozenWorld { ticks: 50.0 }, &room(), &steps).map(|(tick, _)| tick), Some(50));
    }

    #[test]
    fn a_held_key_and_a_world_that_moves_by_itself_are_sound() {
        let held: Vec<Step> = (0..400).map(|_| Step::at(0, 5.0, 5.0)).collect();
        assert_eq!(found(&FrozenWorld::default(), &room(), &held), None);
        let clock = |tick: usize| Step { seen: (tick / 200) as f32, ..Step::at(tick, 5.0, 5.0) };
        let steps: Vec<Step> = (0..600).map(clock).collect();
        assert_eq!(found(&FrozenWorld::default(), &room(), &steps), None);
    }
}
