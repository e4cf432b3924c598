//! Numbers that are not finite, or far too large.

use bevy::{ecs::world::WorldId, prelude::*};

use crate::detector::{Detector, LevelAhead, Moment, Setting, Watch, WorldMoment, WorldWatch};

/// A finding for a transform, an agent's position or an observation that is not a number, and for positions too far
/// from the origin.
pub struct Runaway {
    distance: f64,
}

impl Default for Runaway {
    fn default() -> Self {
        // Farther out, neighbouring f32 are more than a sixteenth apart.
        Self { distance: 1e6 }
    }
}

struct Numbers {
    most: f32,
}

/// A query that is reused for its World.
struct Transforms {
    most: f32,
    query: Option<(WorldId, QueryState<(Entity, &'static Transform)>)>,
}

impl Detector for Runaway {
    fn name(&self) -> &'static str {
        "runaway"
    }

    fn describe(&self) -> &'static str {
        "a transform, a position or an observation is not a number, or a position is too far from the origin"
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![Setting::new("distance", &mut self.distance, "distance from the origin that is too far")]
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn Watch>> {
        Some(Box::new(Numbers { most: self.distance as f32 }))
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatch>> {
        Some(Box::new(Transforms { most: self.distance as f32, query: None }))
    }
}

impl Watch for Numbers {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        if let Some(index) = moment.observation.iter().position(|number| !number.is_finite()) {
            return Some(format!("value {index} of the observation is {}", moment.observation[index]));
        }
        let place = moment.place?;
        (!place.is_finite() || place.abs().max_element() > self.most)
            .then(|| format!("the agent is at {}, {}", place.x, place.y))
    }
}

impl Transforms {
    fn is_wrong(&self, transform: &Transform) -> bool {
        !transform.is_finite() || transform.translation.abs().max_element() > self.most
    }
}

impl WorldWatch for Transforms {
    fn tick(&mut self, moment: &WorldMoment<'_>) -> Option<String> {
        let world = moment.world;
        let (id, mut query) = match self.query.take() {
            Some((id, query)) if id == world.id() => (id, query),
            // Without such a query, the World has no transform yet.
            _ => (world.id(), world.try_query::<(Entity, &Transform)>()?),
        };
        let wrong = query.iter(world).find(|(_, transform)| self.is_wrong(transform));
        let message = wrong.map(|(entity, transform)| {
            let name = world.get::<Name>(entity).map_or_else(|| format!("entity {entity}"), |name| format!("`{name}`"));
            let Transform { translation, rotation, scale } = transform;
            format!("the transform of {name} is at {translation}, turned by {rotation:?} and scaled by {scale}")
        });
        self.query = Some((id, query));
        message
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, found_in, room};

    #[test]
    fn transforms_that_are_no_numbers_or_too_far_are_found() {
        for (x, scale) in [(f32::NAN, 1.0), (2e6, 1.0), (0.0, f32::INFINITY)] {
            let mut world = World::new();
            world.spawn(Transform::from_xyz(1.0, 2.0, 3.0));
            world.spawn((Name::new("Ball"), Transform::from_xyz(x, 0.0, 0.0).with_scale(Vec3::splat(scale))));
            let message = found_in(&Runaway::default(), &world).expect("the ball is wrong");
            assert!(message.contains("`Ball`"), "{message}");
        }
    }

    #[test]
    fn a_sound_world_and_one_without_transforms_have_no_finding() {
        let mut world = World::new();
        assert_eq!(found_in(&Runaway::default(), &world), None);
        world.spawn(Transform::from_xyz(9e5, -9e5, 0.0));
        assert_eq!(found_in(&Runaway::default(), &world), None);
    }

    #[test]
    fn places_and_observations_are_looked_at_too() {
        let good = Step::at(0, 1.0, 1.0);
        assert_eq!(found(&Runaway::default(), &room(), std::slice::from_ref(&good)), None);
        let lost = Step::at(0, f32::INFINITY, 1.0);
        let blind = Step { seen: f32::NAN, ..good.clone() };
        for bad in [lost, blind] {
            assert_eq!(found(&Runaway::default(), &room(), &[good.clone(), bad]).map(|(tick, _)| tick), Some(1));
        }
    }
}
