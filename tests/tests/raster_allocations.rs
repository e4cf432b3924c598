//! Test that a picture takes no more memory than the one before.

#![allow(unsafe_code, reason = "an allocator that counts can be written in no other way")]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    sync::atomic::{AtomicU64, Ordering},
};

use bevy::prelude::*;
use bevy_playbot::{
    engine::into_world,
    raster::{RasterPlugin, RasterSensor},
    vision::{ImageOptions, PaintedVelocity, Stage, TileLayer},
};
use playbot::prelude::*;
use playbot_tests::scene::image;

struct Counting;

static ALLOCATIONS: AtomicU64 = AtomicU64::new(0);

// SAFETY: everything is left to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        unsafe { System.dealloc(at, layout) }
    }

    unsafe fn realloc(&self, at: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        unsafe { System.realloc(at, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Spawns an arena with tiles and sprites of all kinds, and its agent.
fn spawn_arena(world: &mut World, index: u32, paint: &Handle<Image>) {
    let stage = world.spawn(Stage).id();
    let layer = TileLayer { tileset: paint.clone(), columns: 8, rows: 8, cells: vec![0; 64], outside: 1 };
    world.spawn((layer, ChildOf(stage)));
    for i in 0..25 {
        let number = i as f32;
        let place = Transform::from_xyz(number / 3.0, 8.0 - number / 3.0, number).with_rotation(if i % 3 == 0 {
            Quat::from_rotation_z(number)
        } else {
            Quat::IDENTITY
        });
        let color = if i % 2 == 0 { Color::WHITE } else { Color::srgba(1.0, 0.5, 0.2, 0.5) };
        world.spawn((Sprite { color, ..Sprite::from_image(paint.clone()) }, place, ChildOf(stage)));
    }
    let agent = (Agent::new(index, ActionSpace::Discrete(2)), Control::Human, PaintedVelocity::default());
    let agent = world.spawn((agent, Transform::from_xyz(4.0, 4.0, 0.0), ChildOf(stage))).id();
    let options = ImageOptions { stack: 4, paint_velocity: true, ..default() };
    world.entity_mut(agent).insert(RasterSensor::following(agent, 6.0, options));
}

#[test]
fn a_picture_takes_no_new_memory() {
    let mut app = headless_app();
    app.add_plugins(RasterPlugin);
    let mut world = into_world(app);
    let texels = [[255, 0, 0, 255], [0, 255, 0, 200], [0, 0, 255, 0], [255; 4]].repeat(2);
    let paint = world.resource_mut::<Assets<Image>>().add(image(2, &texels));
    (0..4).for_each(|index| spawn_arena(&mut world, index, &paint));
    world.ticks(3).expect("sound");
    let mut movers = world.query_filtered::<&mut Transform, With<Sprite>>();
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    for _ in 0..200 {
        // Fewer and fewer things are in sight.
        movers.iter_mut(&mut world).for_each(|mut place| place.translation.x += 0.05);
        world.run_schedule(ObserveSchedule);
    }
    let after = ALLOCATIONS.load(Ordering::Relaxed);
    assert_eq!(after - before, 0, "allocations in 800 pictures");
    let extra = std::hint::black_box(vec![0; 100]);
    assert!(extra.len() == 100 && ALLOCATIONS.load(Ordering::Relaxed) > after, "it counts");
}
