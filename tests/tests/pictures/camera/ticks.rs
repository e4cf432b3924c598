//! Tests that the frame of a tick shows that tick, for thousands of ticks, and that any other frame is reported.

use bevy::prelude::*;
use bevy_playbot::{
    camera::{CameraSensor, ReadbackDelay},
    episode::Tick,
    vision::{Frame, ImageOptions, Stage, TileLayer, VisionSystems},
};
use playbot::prelude::*;
use playbot_tests::scene::{camera_world, draw, image, pixel, player, spawn_sensor};

/// The walking entity, and its position at the observation.
#[derive(Resource)]
struct Walk {
    walker: Entity,
    seen_at: Vec2,
}

/// Returns a map of 64×64 texels, each of a colour of its own, and a walker on it.
fn walking_world() -> (World, Entity) {
    let mut world = camera_world(|app| {
        app.add_systems(FixedUpdate, walk)
            .add_systems(ObserveSchedule, note.in_set(VisionSystems::Sync).run_if(resource_exists::<Walk>));
    });
    let map: Vec<[u8; 4]> = (0..64 * 64).map(|i| [(i % 64 * 4) as u8, (i / 64 * 4) as u8, 99, 255]).collect();
    let map = world.resource_mut::<Assets<Image>>().add(image(64, &map));
    world.spawn((Sprite { image: map, custom_size: Some(Vec2::splat(64.0)), ..default() }, Transform::default()));
    let walker = world.spawn(Transform::from_xyz(-31.5, -31.5, 0.0)).id();
    world.insert_resource(Walk { walker, seen_at: Vec2::ZERO });
    (world, walker)
}

fn walk(walk: Res<Walk>, tick: Res<Tick>, mut places: Query<&mut Transform>) {
    if let Ok(mut place) = places.get_mut(walk.walker) {
        let step = tick.0 * 37;
        place.translation = Vec3::new((step % 64) as f32 - 31.5, (step / 64 % 64) as f32 - 31.5, 0.0);
    }
}

fn note(mut walk: ResMut<Walk>, places: Query<&Transform>) {
    if let Ok(place) = places.get(walk.walker) {
        walk.seen_at = place.translation.truncate();
    }
}

/// Returns the colour of the map at the walker's position.
fn expected(world: &World) -> [u8; 3] {
    let place = world.resource::<Walk>().seen_at;
    [((place.x + 31.5) * 4.0) as u8, ((31.5 - place.y) * 4.0) as u8, 99]
}

#[test]
fn every_frame_is_of_its_tick() {
    let (mut world, walker) = walking_world();
    let agents: Vec<Entity> = (0..3).map(|i| spawn_sensor(&mut world, i, walker, 3.0, [3, 3])).collect();
    let mut before = [0; 3];
    for _ in 0..3000 {
        world.tick().expect("sound");
        let colour = expected(&world);
        assert_ne!(colour, before, "the walker moves");
        before = colour;
        for &agent in &agents {
            assert_eq!(pixel(&world, agent, 1, 1), colour);
            assert_eq!(world.get::<Frame>(agent).expect("a frame").tick, Some(world.resource::<Tick>().0));
        }
    }
}

#[test]
fn a_late_readback_is_reported_and_not_handed_out() {
    let (mut world, walker) = walking_world();
    let agent = spawn_sensor(&mut world, 4, walker, 3.0, [3, 3]);
    world.ticks(5).expect("sound");
    let good = world.get::<Frame>(agent).expect("a frame").clone();
    world.resource_mut::<ReadbackDelay>().0 = 2;
    for _ in 0..2 {
        let fault = world.tick().expect_err("nothing came back yet").to_string();
        assert!(fault.contains("agent 4") && fault.contains("no picture came back"), "{fault}");
    }
    for _ in 0..3 {
        let fault = world.tick().expect_err("late").to_string();
        let now = world.resource::<Tick>().0;
        assert!(fault.contains(&format!("agent 4, level 0, tick {}:", now - 1)), "{fault}");
        assert!(fault.contains(&format!("of the World's tick {}, not {now},", now - 2)), "{fault}");
        assert_eq!(*world.get::<Frame>(agent).expect("a frame"), good, "an old picture must not be handed out");
    }
    world.resource_mut::<ReadbackDelay>().0 = 0;
    world.tick().expect("in time again");
    assert_eq!(pixel(&world, agent, 1, 1), expected(&world));
}

#[test]
fn what_is_new_in_a_tick_is_seen_in_it() {
    let mut world = camera_world(|_| {});
    let target = world.spawn(Transform::default()).id();
    let agent = spawn_sensor(&mut world, 0, target, 4.0, [4, 4]);
    let mut state = 3;
    for i in 0..60 {
        // New image, new sprite or tiles, each time; the old ones go.
        let colour = [draw(&mut state, 255) as u8 + 1, draw(&mut state, 256) as u8, i, 255];
        let new = world.resource_mut::<Assets<Image>>().add(image(1, &[colour]));
        let thing = if i % 2 == 0 {
            world.spawn((Sprite { image: new, custom_size: Some(Vec2::splat(4.0)), ..default() }, Transform::default()))
        } else {
            let layer = TileLayer { tileset: new, columns: 2, rows: 1, cells: vec![0; 2], outside: 0 };
            world.spawn((layer, Transform::default()))
        };
        let thing = thing.id();
        world.tick().expect("sound");
        assert_eq!(pixel(&world, agent, 0, 3), [colour[0], colour[1], colour[2]], "{i}");
        world.despawn(thing);
        world.tick().expect("sound");
        assert_eq!(pixel(&world, agent, 0, 3), [0; 3], "{i}");
    }
}

#[test]
fn each_of_many_sees_its_own_arena() {
    let mut world = camera_world(|_| {});
    let colour = |i: u32| [40 + i as u8 * 3, 255 - i as u8 * 2, (i * i) as u8, 255];
    let agents: Vec<Entity> = (0..64)
        .map(|i| {
            let made = world.resource_mut::<Assets<Image>>().add(image(1, &[colour(i)]));
            let stage = world.spawn((Stage, Transform::from_xyz(i as f32 * 40.0, 0.0, 0.0))).id();
            let wall = Sprite { image: made, custom_size: Some(Vec2::splat(20.0)), ..default() };
            world.spawn((wall, Transform::default(), ChildOf(stage)));
            let agent = world.spawn((Transform::default(), ChildOf(stage))).id();
            let sensor = CameraSensor::following(agent, 13.0, ImageOptions::default());
            world.entity_mut(agent).insert((player(i), sensor));
            agent
        })
        .collect();
    world.ticks(2).expect("sound");
    for (i, &agent) in agents.iter().enumerate() {
        let [red, green, blue, _] = colour(i as u32);
        let frame = world.get::<Frame>(agent).expect("a frame");
        assert!(frame.pixels.iter().all(|&pixel| pixel == [red, green, blue, 255]), "agent {i}");
    }
    // Every other one leaves; one comes back elsewhere.
    for &agent in agents.iter().step_by(2) {
        world.despawn(agent);
    }
    world.tick().expect("sound");
    let stage = world.get::<ChildOf>(agents[1]).expect("in an arena").parent();
    let late = world.spawn((Transform::from_xyz(1.0, 0.0, 0.0), ChildOf(stage))).id();
    let late = spawn_sensor(&mut world, 99, late, 5.0, [10, 10]);
    world.tick().expect("sound");
    let [red, green, blue, _] = colour(1);
    assert_eq!(pixel(&world, late, 9, 9), [red, green, blue]);
    for (i, &agent) in agents.iter().enumerate().skip(1).step_by(2) {
        let [red, green, blue, _] = colour(i as u32);
        assert_eq!(pixel(&world, agent, 63, 0), [red, green, blue]);
    }
}
