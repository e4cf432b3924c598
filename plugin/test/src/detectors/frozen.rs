//! Detectors of broken Worlds: games that stand still, cameras that see nothing, and numbers that run away.

use crate::detectors::Efforts;
use bevy::{ecs::world::WorldId, prelude::*};
use bevy_playbot::{agent::AgentOrder, engine::BlankEpisodes};
use playbot_harness::detector::{
    Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LevelAhead, WorldTick, WorldWatcher,
};

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

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new("ticks", &mut self.ticks, "ticks in a row without any change").at_least(1.0)]
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::new(Still { ticks: self.ticks as u32, state: None, same: 0, efforts: Efforts::default() }))
    }
}

impl EpisodeWatcher for Still {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
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

/// A finding for episodes in which every picture was of one colour. Only testers with pictures have any. An agent that
/// never gets an observation is a fault of the game, which is a finding of its own.
#[derive(Default)]
pub struct BlankPicture;

/// The blank episodes so far.
#[derive(Default)]
struct Counted(u64);

impl Detector for BlankPicture {
    fn name(&self) -> &'static str {
        "blank-picture"
    }

    fn describe(&self) -> &'static str {
        "every picture that the agent sees in an episode is of a single colour"
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatcher>> {
        Some(Box::<Counted>::default())
    }
}

impl WorldWatcher for Counted {
    fn tick(&mut self, moment: &WorldTick<'_>) -> Option<String> {
        let agents = moment.world.get_resource::<AgentOrder>()?.entities();
        let count = agents.iter().filter_map(|agent| moment.world.get::<BlankEpisodes>(*agent));
        let count = count.map(|blank| blank.episodes).sum();
        let before = std::mem::replace(&mut self.0, count);
        (count > before).then(|| "each picture of the episode was of a single colour".to_owned())
    }
}

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

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new("distance", &mut self.distance, "distance from the origin that is too far")]
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::new(Numbers { most: self.distance as f32 }))
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatcher>> {
        Some(Box::new(Transforms { most: self.distance as f32, query: None }))
    }
}

impl EpisodeWatcher for Numbers {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        if let Some(index) = moment.observation.iter().position(|number| !number.is_finite()) {
            return Some(format!("value {index} of the observation is {}", moment.observation[index]));
        }
        let position = moment.position?;
        (!position.is_finite() || position.abs().max_element() > self.most)
            .then(|| format!("the agent is at {}, {}", position.x, position.y))
    }
}

impl Transforms {
    fn is_wrong(&self, transform: &Transform) -> bool {
        !transform.is_finite() || transform.translation.abs().max_element() > self.most
    }
}

impl WorldWatcher for Transforms {
    fn tick(&mut self, moment: &WorldTick<'_>) -> Option<String> {
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
    use bevy::prelude::Entity;
    use bevy_playbot::{headless::headless_app, prelude::*};

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

    #[test]
    fn an_episode_without_a_picture_of_anything_is_found_once() {
        let mut app = headless_app();
        let agent: Entity = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
        app.tick().expect("one agent");
        let mut watch = BlankPicture.watch_world().expect("it looks at Worlds");
        let mut reported = |app: &bevy::app::App| watch.tick(&WorldTick { world: app.world(), errors: &[] });
        assert_eq!(reported(&app), None, "an agent without a sensor is not blind");
        app.world_mut().entity_mut(agent).insert(BlankEpisodes::default());
        assert_eq!(reported(&app), None);
        if let Some(mut blank) = app.world_mut().get_mut::<BlankEpisodes>(agent) {
            blank.episodes = 1;
        }
        assert!(reported(&app).is_some_and(|message| message.contains("single colour")));
        assert_eq!(reported(&app), None);
    }

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
