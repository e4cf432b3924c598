//! AntMaze for ants that are told where the goal and the walls are.

use bevy::{math::Vec3, prelude::*};
use bevy_playbot::vision::VisionSystems;
use bevy_rapier3d::rapier::prelude::{QueryFilter, Ray};
use playbot_lab::prelude::*;

use super::{
    components::{InMaze, MazeAnt},
    game::AntMaze,
    play,
};
use crate::{
    ant::walls::Walls,
    with_rays::{SenseRays, WithRays, push_rays},
};

/// How far a ray reaches, in metres: two cells.
pub const RAY_LENGTH: f32 = 8.0;
/// Rays go between the floor and the top of the walls, in metres.
const RAY_HEIGHTS: std::ops::RangeInclusive<f32> = 0.1..=1.9;

/// AntMaze with rays, under its name `antmaze-sighted`. East is x and north is y.
pub type AntMazeWithRays = WithRays<AntMaze>;

impl SenseRays for AntMaze {
    const NAME_WITH_RAYS: &'static str = "antmaze-sighted";

    fn build_rays(&self, app: &mut App) {
        app.add_systems(ObserveSchedule, sense_rays.after(play::observe).before(VisionSystems::Sync));
    }
}

fn sense_rays(mut ants: Query<(&Episode, &MazeAnt, &InMaze, &mut Observation), With<VectorSensor>>) {
    for (episode, ant, level, mut observation) in &mut ants {
        if episode.is_running() {
            let at = ant.0.torso().0;
            let from = Vec3::new(at.x, at.y, at.z.clamp(*RAY_HEIGHTS.start(), *RAY_HEIGHTS.end()));
            let to_goal = Vec2::from(level.0.goal_at) - at.truncate();
            push_rays(&mut observation, to_goal.to_array(), |way| distance(ant.0.walls(), from, way));
        }
    }
}

fn distance(walls: &Walls, from: Vec3, [east, north]: [f64; 2]) -> f32 {
    let ray = Ray::new(from, Vec3::new(east as f32, north as f32, 0.0));
    walls
        .physics()
        .cast_ray(&ray, RAY_LENGTH, true, QueryFilter::default())
        .map_or(RAY_LENGTH, |(_, distance)| distance)
}

#[cfg(test)]
mod tests {
    use playbot_lab::worlds::build_world;

    use super::*;

    #[test]
    fn an_ant_at_the_start_of_medium_sees_its_room_and_the_way_to_the_goal() {
        let game = AntMazeWithRays::default();
        let (mut world, agents) = build_world(&game, "medium", 0, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform));
        world.tick().expect("sound");
        let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector;
        assert_eq!(seen.len(), game.observation().len());
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
}
