//! AntMaze for ants that see: the same game with the goal's direction and the distance of the walls added to what an agent
//! is told.
//!
//! In the original an agent knows its own state only. That will do on one map, which can be learned by heart; in a maze
//! that nobody has seen it leaves nothing but wandering about.

use std::sync::{Arc, LazyLock};

use bevy::{math::Vec3, prelude::*};
use bevy_playbot::{floor_plan::FloorPlan, mode::ModeError, prelude::*, vision::Picture};
use bevy_rapier3d::rapier::prelude::{QueryFilter, Ray};

use super::{
    components::{InMaze, MazeAnt},
    game::AntMaze,
    play, view,
};
use crate::ant::{AntBody, walls::Walls};

/// How far an ant sees, in metres: two cells.
pub const SIGHT: f32 = 8.0;
/// Eyes look between the floor and the top of the walls, in metres.
const EYES: std::ops::RangeInclusive<f32> = 0.1..=1.9;

/// East, then on by eighths of a turn to the left.
const WAYS: [(&str, Vec2); 8] = {
    const DIAGONAL: f32 = std::f32::consts::FRAC_1_SQRT_2;
    [
        ("east", Vec2::X),
        ("north-east", Vec2::new(DIAGONAL, DIAGONAL)),
        ("north", Vec2::Y),
        ("north-west", Vec2::new(-DIAGONAL, DIAGONAL)),
        ("west", Vec2::NEG_X),
        ("south-west", Vec2::new(-DIAGONAL, -DIAGONAL)),
        ("south", Vec2::NEG_Y),
        ("south-east", Vec2::new(DIAGONAL, -DIAGONAL)),
    ]
};

static SPACE: LazyLock<Arc<ObservationSpace>> = LazyLock::new(|| {
    let goal = ["goal x", "goal y"].map(str::to_owned);
    let walls = WAYS.map(|(way, _)| format!("wall {way}"));
    Arc::new(ObservationSpace { names: view::names().into_iter().chain(goal).chain(walls).collect() })
});

/// AntMaze with eyes, under its name `antmaze-sighted`.
#[derive(Clone, Copy, Debug, Default)]
pub struct SightedAntMaze;

impl Game for SightedAntMaze {
    fn name(&self) -> &'static str {
        "antmaze-sighted"
    }

    fn version(&self) -> u32 {
        AntMaze.version()
    }

    fn modes(&self) -> &'static [&'static str] {
        AntMaze.modes()
    }

    fn check_mode(&self, mode: &str) -> Result<(), ModeError> {
        AntMaze.check_mode(mode)
    }

    fn family(&self, mode: &str) -> String {
        AntMaze.family(mode)
    }

    fn fingerprint(&self, mode: &str, level: u64) -> Option<u64> {
        AntMaze.fingerprint(mode, level)
    }

    fn tick_hz(&self) -> f64 {
        AntMaze.tick_hz()
    }

    fn actions(&self) -> ActionSpace {
        AntMaze.actions()
    }

    fn action_names(&self) -> Vec<String> {
        AntMaze.action_names()
    }

    fn input_map(&self) -> Option<InputMap> {
        AntMaze.input_map()
    }

    fn observation(&self) -> ObservationSpace {
        (**SPACE).clone()
    }

    fn picture(&self) -> Option<Picture> {
        AntMaze.picture()
    }

    fn build_picture(&self, app: &mut App) {
        AntMaze.build_picture(app);
    }

    fn build(&self, app: &mut App, mode: &str) {
        AntMaze.build(app, mode);
        app.add_systems(ObserveSchedule, see.after(play::observe));
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let agent = AntMaze.spawn_agent(world, index);
        world.entity_mut(agent).insert(VectorSensor::from_space(SPACE.clone()));
        agent
    }

    fn floor_plan(&self, mode: &str, level: u64) -> Option<FloorPlan> {
        AntMaze.floor_plan(mode, level)
    }

    fn whereabouts(&self, world: &World, agent: Entity) -> Option<Vec2> {
        AntMaze.whereabouts(world, agent)
    }

    fn demonstrator(&self) -> Option<&'static str> {
        AntMaze.demonstrator()
    }

    fn arm_demonstrator(&self, world: &mut World, agent: Entity, noise: f64) {
        AntMaze.arm_demonstrator(world, agent, noise);
    }
}

/// Adds what eyes see to the vector of every agent that plays and reads one.
fn see(mut ants: Query<(&Episode, &MazeAnt, &InMaze, &mut Observation), With<VectorSensor>>) {
    for (episode, ant, level, mut observation) in &mut ants {
        if episode.is_running() {
            observation.vector.extend(sights(&ant.0, level.0.goal_at));
        }
    }
}

/// The way to the goal along x and y in metres, then the distance of the nearest wall in eight directions, in metres and at
/// most [`SIGHT`].
fn sights(ant: &AntBody, goal: [f32; 2]) -> impl Iterator<Item = f32> {
    let at = ant.torso().0;
    let eye = Vec3::new(at.x, at.y, at.z.clamp(*EYES.start(), *EYES.end()));
    let to_goal = Vec2::from(goal) - at.truncate();
    let walls = WAYS.map(|(_, way)| distance(ant.walls(), eye, way));
    to_goal.to_array().into_iter().chain(walls)
}

fn distance(walls: &Walls, eye: Vec3, way: Vec2) -> f32 {
    let ray = Ray::new(eye, way.extend(0.0));
    walls.physics().cast_ray(&ray, SIGHT, true, QueryFilter::default()).map_or(SIGHT, |(_, distance)| distance)
}

#[cfg(test)]
mod tests {
    use bevy_playbot::game::build_world;

    use super::*;

    #[test]
    fn an_ant_at_the_start_of_medium_sees_its_room_and_the_way_to_the_goal() {
        let (mut world, agents) = build_world(&SightedAntMaze, "medium", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform));
        world.tick().expect("sound");
        let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector;
        assert_eq!(seen.len(), SightedAntMaze.observation().len());
        let place = Vec2::new(seen[0], seen[1]);
        let near = |value: f32, wanted: f32| assert!((value - wanted).abs() < 1e-3, "{value} instead of {wanted}");
        near(seen[29], 20.0 - place.x);
        near(seen[30], 20.0 - place.y);
        // The room is two cells wide and high, from 2 m before the start: its walls are at -2 and 6.
        near(seen[31], 6.0 - place.x);
        near(seen[33], 6.0 - place.y);
        near(seen[35], 2.0 + place.x);
        near(seen[37], 2.0 + place.y);
        let slant = std::f32::consts::SQRT_2 * (2.0 + place.min_element());
        near(seen[36], slant);
    }

    #[test]
    fn names_are_told_apart() {
        let mut names = SightedAntMaze.observation().names;
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!((count, names.len()), (39, 39));
    }
}
