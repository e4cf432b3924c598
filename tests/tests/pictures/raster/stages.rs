//! Tests of stages: an agent on a stage sees that stage.

use bevy::prelude::*;
use bevy_playbot::{
    raster::RasterSensor,
    vision::{Frame, ImageOptions, Stage},
};
use playbot::prelude::*;

use super::viewer::{BLUE, GREEN, RED, WHITE, four, frame, looking, raster_world, spawn_sensor};

/// Spawns a stage with a sprite, an agent and, on a stage of its own inside, an entity that no other agent sees.
fn spawn_stage(world: &mut World, index: u32, place: Transform, sprite: &Sprite) -> Entity {
    let stage = world.spawn((Stage, place)).id();
    let holder = world.spawn((Transform::from_xyz(10.0, 20.0, 0.0), ChildOf(stage))).id();
    world.spawn((sprite.clone(), Transform::from_xyz(0.3, 0.4, 0.0), ChildOf(holder)));
    let inner = world.spawn((Stage, ChildOf(stage), Transform::from_xyz(10.0, 20.0, 5.0))).id();
    world.spawn((Sprite::from_color(Color::WHITE, Vec2::splat(9.0)), ChildOf(inner)));
    let agent = (Agent::new(index, ActionSpace::Discrete(2)), Control::Human, Transform::from_xyz(0.1, -0.1, 0.0));
    let agent = world.spawn((agent, ChildOf(holder))).id();
    let options = ImageOptions { width: 16, height: 16, ..default() };
    world.entity_mut(agent).insert(RasterSensor::following(agent, 3.3, options));
    agent
}

#[test]
fn a_picture_does_not_depend_on_where_its_stage_stands() {
    let mut world = raster_world();
    let sprite = four(&mut world);
    world.spawn(Sprite::from_color(Color::WHITE, Vec2::splat(1e6)));
    let places = [
        Transform::default(),
        Transform::from_xyz(1e7, -3.3, 2.0),
        Transform::from_rotation(Quat::from_rotation_z(1.0)).with_scale(Vec3::splat(7.0)),
    ];
    let agents: Vec<_> =
        (0..).zip(places).map(|(index, place)| spawn_stage(&mut world, index, place, &sprite)).collect();
    let first = frame(&mut world, agents[0]);
    for colour in [RED, GREEN, BLUE, WHITE, [0, 0, 0, 255]] {
        assert!(first.contains(&colour), "{colour:?} is covered by what is on another stage, or on none");
    }
    for agent in &agents[1..] {
        assert_eq!(world.get::<Frame>(*agent).expect("a sensor").pixels, first);
    }
    // An agent on no stage sees entities on no stage.
    let target = world.spawn(Transform::default()).id();
    let outside = spawn_sensor(&mut world, target, 10.0, [4, 4]);
    assert_eq!(frame(&mut world, outside), [WHITE; 16]);
}

#[test]
fn idle_agents_are_not_looked_after() {
    let (mut world, sensor) = looking([1, 1]);
    world.entity_mut(sensor).insert(Control::Idle);
    world.spawn(Sprite::default());
    world.tick().expect("no sensor looks at what cannot be drawn");
    assert_eq!(*world.get::<Frame>(sensor).expect("a sensor"), Frame::default());
}
