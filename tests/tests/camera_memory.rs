//! Tests that memory stays flat while levels and agents come and go. Alone in its program, whose memory is measured.
#![cfg(feature = "screen")]

use bevy::prelude::*;
use bevy_playbot::vision::{Stage, TileLayer};
use playbot::prelude::*;
use playbot_tests::{
    memory::resident_kib,
    scene::{camera_world, drift, image, pixel, spawn_large_scene, spawn_sensor},
};

#[test]
fn memory_does_not_grow() {
    let mut world = camera_world(|app| {
        app.add_systems(FixedUpdate, drift);
    });
    spawn_large_scene(&mut world, 4);
    let tiles = world.resource_mut::<Assets<Image>>().add(image(1, &[[9, 9, 9, 255]]));
    let rebuild = |world: &mut World, ticks: u64| {
        for i in 0..ticks {
            // A level ends and another begins, with one agent more or less.
            let stage = world.spawn((Stage, Transform::from_xyz(-500.0, 0.0, 0.0))).id();
            let layer = TileLayer { tileset: tiles.clone(), columns: 64, rows: 64, cells: vec![0; 4096], outside: 0 };
            world.spawn((layer, Transform::default(), ChildOf(stage)));
            let body = world.spawn((Transform::default(), ChildOf(stage))).id();
            let agent = spawn_sensor(world, 9, body, 13.0, [64, 64]);
            world.ticks(4).expect("sound");
            assert_eq!(pixel(world, agent, 0, 0), [9; 3], "{i}");
            world.despawn(stage);
            world.despawn(agent);
            world.tick().expect("sound");
        }
    };
    rebuild(&mut world, 150);
    let before = resident_kib();
    rebuild(&mut world, 500);
    let grown = resident_kib().saturating_sub(before);
    assert!(grown < 6 * 1024, "{grown} KiB more after 2,500 ticks");
}
