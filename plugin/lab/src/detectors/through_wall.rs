//! Agents inside walls.

use super::solid_tiles::SolidTiles;
use crate::detector::{Detector, LevelAhead, Moment, Setting, Watch};

/// A finding for agents deep inside a wall of their level's plan, on all sides.
///
/// Bodies are round or have corners, sink in a little, and may hang over a ledge that is thinner than they are. A game
/// without such bodies declares [its own depth](Self::deeper_than).
pub struct ThroughWall {
    depth: f64,
}

impl Default for ThroughWall {
    fn default() -> Self {
        // More than half a tile: a body that hangs over a ledge of one tile is not inside it.
        Self { depth: 0.75 }
    }
}

impl ThroughWall {
    /// Creates the detector for [a game's own detectors](crate::game::TestTools::detectors): agents are never this deep
    /// inside a wall, in tiles.
    pub fn deeper_than(depth: f64) -> Self {
        Self { depth }
    }
}

struct Inside {
    solid: SolidTiles,
    depth: f32,
}

impl Detector for ThroughWall {
    fn name(&self) -> &'static str {
        "through-wall"
    }

    fn describe(&self) -> &'static str {
        "the agent is deep inside a wall"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![Setting::new("depth", &mut self.depth, "wall on all sides of the agent that is too much, in tiles")]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let solid = SolidTiles::of(level.plan.as_ref()?)?;
        Some(Box::new(Inside { solid, depth: self.depth as f32 }))
    }
}

impl Watch for Inside {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let place = moment.place?;
        let is_deep = self.solid.surround(place, self.depth);
        is_deep.then(|| format!("the agent is at {:.1}, {:.1}, deep inside a wall", place.x, place.y))
    }
}

#[cfg(test)]
mod tests {
    use bevy::math::Rect;

    use super::*;
    use crate::detectors::testing::{Step, found, room};

    /// Upwards at x = 5, into the wall above, which is three tiles thick.
    fn climb() -> (LevelAhead, Vec<Step>) {
        let mut level = room();
        let plan = level.plan.as_mut().expect("a plan");
        plan.walls.extend([10.0, 11.0].map(|low| Rect::new(0.0, low, 10.0, low + 1.0)));
        plan.bounds.max.y = 12.0;
        (level, (0..24).map(|tick| Step::at(tick, 5.0, 0.5 * tick as f32)).collect())
    }

    #[test]
    fn who_is_deep_inside_a_wall_is_found() {
        let (level, steps) = climb();
        let (tick, message) = found(&ThroughWall::default(), &level, &steps).expect("it is inside");
        // The wall begins at 9; at 9.5 there is half a tile below the agent, and at 10.0 a whole one.
        assert_eq!(tick, 20);
        assert!(message.contains("5.0, 10.0"), "{message}");
        assert_eq!(found(&ThroughWall::deeper_than(0.3), &level, &steps).map(|(tick, _)| tick), Some(1), "the floor");
    }

    #[test]
    fn who_hangs_over_a_ledge_or_stays_in_the_open_is_sound() {
        let across: Vec<Step> = (0..24).map(|tick| Step::at(tick, 5.0, 0.5 * tick as f32)).collect();
        assert_eq!(found(&ThroughWall::default(), &room(), &across), None, "the walls are one tile thick");
        let open: Vec<Step> = (0..24).map(|tick| Step::at(tick, 5.0, 1.0 + 0.3 * tick as f32)).collect();
        assert_eq!(found(&ThroughWall::deeper_than(0.3), &room(), &open), None);
        assert_eq!(found(&ThroughWall::default(), &LevelAhead::default(), &across), None, "no plan");
    }
}
