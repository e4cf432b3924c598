//! Agents that are flung away.

use bevy::{math::Vec3, prelude::Transform};

use crate::{
    detector::{Detector, LevelAhead, Moment, Setting, Watch},
    floor_plan::FloorPlan,
};

/// A finding for agents that move farther in one tick than physics allows. It is opt-in, because portals do that on
/// purpose.
pub struct PhysicsExplosion {
    share: f64,
    distance: f64,
}

impl Default for PhysicsExplosion {
    fn default() -> Self {
        Self { share: 0.5, distance: 1000.0 }
    }
}

struct Leaping {
    most: f32,
    last: Option<Vec3>,
}

impl Detector for PhysicsExplosion {
    fn name(&self) -> &'static str {
        "physics-explosion"
    }

    fn describe(&self) -> &'static str {
        "the agent is flung through half its level in one tick"
    }

    fn is_usual(&self) -> bool {
        false
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![
            Setting::new("share", &mut self.share, "share of the level's longer side that is too far for one tick"),
            Setting::new("distance", &mut self.distance, "the same in the game's units, for levels without a plan"),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let side = |plan: &FloorPlan| self.share as f32 * plan.bounds.size().max_element();
        let most = level.plan.as_ref().map_or(self.distance as f32, side);
        Some(Box::new(Leaping { most, last: None }))
    }
}

impl Watch for Leaping {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        let transform = || moment.world.get::<Transform>(moment.agent).map(|transform| transform.translation);
        let place = moment.place.map(|place| place.extend(0.0)).or_else(transform)?;
        let way = self.last.replace(place).map(|last| last.distance(place))?;
        (way > self.most).then(|| format!("the agent moved {way:.1} units in one tick"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    #[test]
    fn who_is_flung_away_is_found_and_who_runs_is_not() {
        let detector = PhysicsExplosion::default();
        let flung: Vec<Step> = [1.0, 2.0, 4.0, 9.5].iter().map(|x| Step::at(0, *x, 5.0)).collect();
        assert_eq!(found(&detector, &room(), &flung).map(|(tick, _)| tick), Some(3), "5.5 of 10 tiles");
        let runs: Vec<Step> = [1.0, 4.0, 8.0, 9.0].iter().map(|x| Step::at(0, *x, 5.0)).collect();
        assert_eq!(found(&detector, &room(), &runs), None);
    }
}
