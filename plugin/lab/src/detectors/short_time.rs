//! Time limits that are too short.

use bevy::math::Vec2;
use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};

use crate::{
    detector::{Detector, LevelAhead, Moment, Setting, Watch},
    explore::CellGrid,
};

/// A finding for time limits before which the agent could not have reached the goal, even straight through all walls,
/// at its fastest pace. An agent that goes nowhere shows no pace.
pub struct ShortTime {
    factor: f64,
    tiles: f64,
}

impl Default for ShortTime {
    fn default() -> Self {
        Self { factor: 2.0, tiles: 3.0 }
    }
}

/// Largest distance at which a goal may be reached, in tiles.
const AT_GOAL: f32 = 2.0;

struct Going {
    goal: Vec2,
    tile: f32,
    factor: f32,
    least: f32,
    first: Option<Vec2>,
    last: Vec2,
    /// Longest move in a tick, along each axis.
    fastest: Vec2,
    /// Largest distance from the first position, along each axis.
    farthest: Vec2,
}

impl Detector for ShortTime {
    fn name(&self) -> &'static str {
        "short-time"
    }

    fn describe(&self) -> &'static str {
        "time is up before the agent could have come to the goal at its fastest pace"
    }

    fn is_usual(&self) -> bool {
        false
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("factor", &mut self.factor, "times the fastest pace that the agent has shown").at_least(1.0),
            Setting::new("tiles", &mut self.tiles, "tiles that the agent must have gone to have shown its pace"),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let plan = level.plan.as_ref()?;
        let tile = CellGrid::new(Some(plan), None).size;
        Some(Box::new(Going {
            goal: plan.goal,
            tile,
            factor: self.factor as f32,
            least: self.tiles as f32 * tile,
            first: None,
            last: Vec2::ZERO,
            fastest: Vec2::ZERO,
            farthest: Vec2::ZERO,
        }))
    }
}

impl Watch for Going {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let place = moment.place.filter(|place| place.is_finite())?;
        if let Some(first) = self.first {
            self.fastest = self.fastest.max((place - self.last).abs());
            self.farthest = self.farthest.max((place - first).abs());
        } else {
            self.first = Some(place);
        }
        self.last = place;
        None
    }

    fn end(&mut self, _moment: &Moment<'_>, result: &EpisodeResult) -> Option<String> {
        if result.end != EpisodeEnd::Truncated || result.success {
            return None;
        }
        let first = self.first?;
        let way = (self.goal - first).abs() - AT_GOAL * self.tile;
        let most = self.fastest * self.factor * result.ticks as f32;
        let mut axes = way.to_array().into_iter().zip(most.to_array()).zip(self.farthest.to_array());
        let is_short = axes.any(|((way, most), gone)| gone >= self.least && most < way);
        is_short.then(|| {
            format!(
                "time was up after {} ticks, too few to come from {:.1}, {:.1} to the goal at {:.1}, {:.1}",
                result.ticks, first.x, first.y, self.goal.x, self.goal.y
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Rect;

    use super::*;
    use crate::{
        detector::NoProofs,
        detectors::testing::{Step, room, timed_out_proving},
    };

    /// The room with its goal 100 tiles away.
    fn long() -> LevelAhead {
        let mut level = room();
        let plan = level.plan.as_mut().expect("a plan");
        (plan.bounds, plan.goal) = (Rect::new(0.0, 0.0, 110.0, 10.0), Vec2::new(101.0, 1.5));
        level
    }

    fn run(ticks: usize, pace: f32) -> Vec<Step> {
        (0..ticks).map(|tick| Step::at(tick, 1.0 + pace * tick as f32, 1.5)).collect()
    }

    fn told(steps: &[Step]) -> Option<String> {
        timed_out_proving(&ShortTime::default(), &long(), steps, &NoProofs).map(|(_, message)| message)
    }

    #[test]
    fn a_limit_that_nobody_can_keep_is_found() {
        // 40 ticks at twice the pace of half a tile are 40 tiles of 98.
        let message = told(&run(40, 0.5)).expect("too short");
        assert!(message.contains("after 40 ticks") && message.contains("from 1.0, 1.5"), "{message}");
    }

    #[test]
    fn a_limit_that_somebody_might_keep_and_an_agent_that_goes_nowhere_are_sound() {
        assert_eq!(told(&run(100, 0.5)), None, "100 tiles are enough");
        assert_eq!(told(&run(40, 0.0)), None);
        assert_eq!(told(&run(40, 0.05)), None, "two tiles show no pace");
        let jumps: Vec<Step> = (0..40).map(|tick| Step::at(tick, 1.0, 1.5 + (tick % 8) as f32)).collect();
        assert_eq!(told(&jumps), None, "up and down is no way along x");
    }
}
