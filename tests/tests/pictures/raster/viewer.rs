//! A raster sensor over the origin, and its picture as text.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings},
    prelude::*,
};
use bevy_playbot::{
    engine::into_world,
    raster::{RasterPlugin, RasterSensor},
    vision::{Frame, ImageOptions},
};
use playbot::prelude::*;
use playbot_tests::scene::{image, pixel};

pub const RED: [u8; 4] = [255, 0, 0, 255];

pub const GREEN: [u8; 4] = [0, 255, 0, 255];

pub const BLUE: [u8; 4] = [0, 0, 255, 255];

pub const WHITE: [u8; 4] = [255; 4];

/// Returns a World whose observing systems must not be in an ambiguous order.
pub fn raster_world() -> World {
    let mut app = headless_app();
    app.edit_schedule(ObserveSchedule, |schedule| {
        schedule.set_build_settings(ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() });
    });
    app.add_plugins(RasterPlugin);
    into_world(app)
}

pub fn spawn_sensor(world: &mut World, target: Entity, width: f32, size: [u32; 2]) -> Entity {
    let options = ImageOptions { width: size[0], height: size[1], ..default() };
    let sensor = RasterSensor::following(target, width, options);
    let index = world.query::<&Agent>().iter(world).len() as u32;
    world.spawn((Agent::new(index, ActionSpace::Discrete(2)), Control::Human, sensor)).id()
}

/// Returns a World with a sensor over the origin that sees a unit in each pixel.
pub fn looking(size: [u32; 2]) -> (World, Entity) {
    let mut world = raster_world();
    let target = world.spawn(Transform::default()).id();
    let sensor = spawn_sensor(&mut world, target, size[0] as f32, size);
    (world, sensor)
}

pub fn add(world: &mut World, width: u32, texels: &[[u8; 4]]) -> Handle<Image> {
    world.resource_mut::<Assets<Image>>().add(image(width, texels))
}

/// Returns a sprite with red and green above, blue and white below, one unit for each.
pub fn four(world: &mut World) -> Sprite {
    Sprite::from_image(add(world, 2, &[RED, GREEN, BLUE, WHITE]))
}

/// Returns the picture as text: a letter for each pixel, `.` for black and `?` for other colours.
pub fn text(world: &mut World, sensor: Entity) -> String {
    world.tick().expect("sound");
    let options = world.get::<bevy_playbot::vision::ImageSensor>(sensor).expect("a sensor").0;
    let letter = |pixel: [u8; 3]| match pixel {
        [255, 0, 0] => 'R',
        [0, 255, 0] => 'G',
        [0, 0, 255] => 'B',
        [255, 255, 255] => 'W',
        [0, 0, 0] => '.',
        _ => '?',
    };
    let row = |y| (0..options.width).map(|x| letter(pixel(world, sensor, x, y))).collect::<String>();
    (0..options.height).map(row).collect::<Vec<_>>().join("/")
}

pub fn frame(world: &mut World, sensor: Entity) -> Vec<[u8; 4]> {
    world.tick().expect("sound");
    world.get::<Frame>(sensor).expect("a sensor").pixels.clone()
}

pub fn fault(world: &mut World) -> String {
    world.tick().expect_err("it cannot be drawn").to_string()
}
