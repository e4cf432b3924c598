//! Tests of errors about things that cannot be drawn.

use bevy::prelude::*;
use bevy_playbot::{
    raster::RasterSensor,
    vision::{ImageOptions, TileLayer},
};
use playbot::prelude::*;
use playbot_tests::scene::image;

use super::viewer::{GREEN, RED, add, fault, four, looking};

/// Returns an image without a single texel.
fn empty(world: &mut World, [width, height]: [u32; 2]) -> Handle<Image> {
    let mut image = image(1, &[RED]);
    (image.texture_descriptor.size.width, image.texture_descriptor.size.height) = (width, height);
    image.data = Some(Vec::new());
    world.resource_mut::<Assets<Image>>().add(image)
}

#[test]
fn what_cannot_be_drawn_is_named_with_agent_and_tick() {
    let cases: [(&str, fn(&mut World)); 11] = [
        ("no image", |world| {
            world.spawn((Sprite::default(), Name::new("ghost")));
        }),
        ("not loaded", |world| {
            let handle = add(world, 1, &[RED]);
            world.resource_mut::<Assets<Image>>().remove(&handle);
            world.spawn((Sprite::from_image(handle), Name::new("ghost")));
        }),
        ("R8Unorm", |world| {
            let mut image = image(1, &[RED]);
            image.texture_descriptor.format = bevy::render::render_resource::TextureFormat::R8Unorm;
            let handle = world.resource_mut::<Assets<Image>>().add(image);
            world.spawn((Sprite::from_image(handle), Name::new("ghost")));
        }),
        ("dropped", |world| {
            let mut image = image(1, &[RED]);
            image.data = None;
            let handle = world.resource_mut::<Assets<Image>>().add(image);
            world.spawn((Sprite::from_image(handle), Name::new("ghost")));
        }),
        ("0x4", |world| {
            let handle = empty(world, [0, 4]);
            world.spawn((Sprite::from_image(handle), Name::new("ghost")));
        }),
        ("4x0", |world| {
            let sized = Sprite { custom_size: Some(Vec2::splat(4.0)), ..Sprite::from_image(empty(world, [4, 0])) };
            world.spawn((sized, Name::new("ghost")));
        }),
        ("0x0", |world| {
            let tileset = empty(world, [0, 0]);
            let layer = TileLayer { tileset, columns: 1, rows: 1, cells: vec![0], outside: 0 };
            world.spawn((layer, Name::new("ghost")));
        }),
        ("Tiled", |world| {
            let image_mode = SpriteImageMode::Tiled { tile_x: true, tile_y: true, stretch_value: 1.0 };
            let sprite = Sprite { image_mode, ..four(world) };
            world.spawn((sprite, Name::new("ghost")));
        }),
        ("3 cells for 2 columns and 2 rows", |world| {
            let tileset = add(world, 1, &[RED]);
            let layer = TileLayer { tileset, columns: 2, rows: 2, cells: vec![0; 3], outside: 0 };
            world.spawn((layer, Name::new("ghost")));
        }),
        ("strip of square tiles", |world| {
            let tileset = add(world, 2, &[RED; 6]);
            let layer = TileLayer { tileset, columns: 1, rows: 1, cells: vec![0], outside: 0 };
            world.spawn((layer, Name::new("ghost")));
        }),
        ("tile 7, but its tileset has 2", |world| {
            let tileset = add(world, 1, &[RED, GREEN]);
            let layer = TileLayer { tileset, columns: 1, rows: 1, cells: vec![0], outside: 7 };
            world.spawn((layer, Name::new("ghost")));
        }),
    ];
    for (what, spawn) in cases {
        let (mut world, _) = looking([4, 4]);
        spawn(&mut world);
        let fault = fault(&mut world);
        for part in [what, "ghost", "agent 0, level 0, tick 0"] {
            assert!(fault.contains(part), "`{part}` is missing in: {fault}");
        }
    }
}

#[test]
fn sensors_that_cannot_look_are_named_with_agent_and_tick() {
    let cases: [(&str, fn(&mut RasterSensor, &mut ImageOptions)); 4] = [
        ("width is 0", |_, options| options.width = 0),
        ("height is 1025", |_, options| options.height = 1025),
        ("sees is NaN", |sensor, _| sensor.width = f32::NAN),
        ("gone", |sensor, _| sensor.target = Entity::PLACEHOLDER),
    ];
    for (what, spoil) in cases {
        let (mut world, sensor) = looking([4, 4]);
        world.tick().expect("sound so far");
        let mut options = ImageOptions { width: 4, height: 4, ..default() };
        let mut spoiled = *world.get::<RasterSensor>(sensor).expect("a sensor");
        spoil(&mut spoiled, &mut options);
        world.entity_mut(sensor).insert((spoiled, bevy_playbot::vision::ImageSensor(options)));
        let fault = fault(&mut world);
        for part in [what, "agent 0, level 0, tick 1"] {
            assert!(fault.contains(part), "`{part}` is missing in: {fault}");
        }
    }
}
