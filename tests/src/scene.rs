//! A 2D scene whose every pixel is known, and a large one like CoinRun's.

use bevy::{asset::RenderAssetUsages, image::ImageSampler, prelude::*, render::render_resource as wgpu};
use bevy_playbot::{
    camera::{CameraSensor, CameraSensorPlugin},
    engine::into_world,
    vision::{Frame, ImageOptions, ImageSensor, Stage, TileLayer},
};
use playbot::prelude::*;

/// Returns an image of `width` columns from its pixels, top row first.
pub fn image(width: u32, pixels: &[[u8; 4]]) -> Image {
    let size = wgpu::Extent3d { width, height: pixels.len() as u32 / width, depth_or_array_layers: 1 };
    let mut image = Image::new(
        size,
        wgpu::TextureDimension::D2,
        pixels.concat(),
        wgpu::TextureFormat::Rgba8UnormSrgb,
        RenderAssetUsages::default(),
    );
    image.sampler = ImageSampler::nearest();
    image
}

/// Returns a World with the camera's plugin, ready to be ticked.
///
/// # Panics
///
/// Without a graphics adapter: such a machine cannot test the camera.
pub fn camera_world(build: impl FnOnce(&mut App)) -> World {
    let mut app = headless_app();
    let plugin = CameraSensorPlugin::headless().unwrap_or_else(|error| {
        panic!("these tests need a Vulkan driver: apt-get install mesa-vulkan-drivers ({error})")
    });
    app.add_plugins(plugin).insert_resource(ClearColor(Color::BLACK));
    build(&mut app);
    into_world(app)
}

/// Returns an agent whose decider is a person without input.
pub fn player(index: u32) -> impl Bundle {
    (Agent::new(index, ActionSpace::Discrete(2)), Control::Human, LevelQueue::Always(0))
}

/// Spawns an agent that sees `width` world units around an entity in a picture of `size` pixels.
pub fn spawn_sensor(world: &mut World, index: u32, target: Entity, width: f32, size: [u32; 2]) -> Entity {
    let options = ImageOptions { width: size[0], height: size[1], ..default() };
    world.spawn((player(index), CameraSensor::following(target, width, options))).id()
}

/// Returns the pixel of an agent's frame in column `x` from the left and row `y` from the top.
pub fn pixel(world: &World, agent: Entity, x: u32, y: u32) -> [u8; 3] {
    let width = world.get::<ImageSensor>(agent).expect("a sensor").0.width;
    let frame = world.get::<Frame>(agent).expect("a frame");
    let [red, green, blue, _] = frame.pixels[(y * width + x) as usize];
    [red, green, blue]
}

/// Draws from a generator of pseudo-random numbers.
pub fn draw(state: &mut u64, below: u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) % below
}

/// Marks moving entities of [`spawn_large_scene`].
#[derive(Component, Clone, Copy, Debug)]
pub struct Mover;

/// Spawns arenas like CoinRun's, one for each of `agents`: a grid of 64×64 tiles, a background, 25 sprites and an agent
/// in the middle that sees 13 tiles at 64×64 pixels.
pub fn spawn_large_scene(world: &mut World, agents: u32) -> Vec<Entity> {
    let mut state = 7;
    let mut noise = |width: u32, height: u32, hole: u64| {
        let texel = |_| {
            let [red, green, blue] = [(); 3].map(|()| draw(&mut state, 256) as u8);
            [red, green, blue, if draw(&mut state, 16) < hole { 0 } else { 255 }]
        };
        image(width, &(0..width * height).map(texel).collect::<Vec<_>>())
    };
    let mut images = Vec::new();
    for made in [noise(16, 16 * 8, 0), noise(256, 256, 3), noise(512, 512, 0)] {
        images.push(world.resource_mut::<Assets<Image>>().add(made));
    }
    let [tileset, atlas, background] = [0, 1, 2].map(|i| images[i].clone());
    (0..agents).map(|index| spawn_arena(world, index, &tileset, &atlas, &background)).collect()
}

fn spawn_arena(
    world: &mut World,
    index: u32,
    tileset: &Handle<Image>,
    atlas: &Handle<Image>,
    background: &Handle<Image>,
) -> Entity {
    let mut state = u64::from(index) + 1;
    let corner = Vec3::new((index % 8) as f32 * 128.0, (index / 8) as f32 * 128.0, 0.0);
    let stage = world.spawn((Stage, Transform::from_translation(corner))).id();
    let cell = |_| if draw(&mut state, 3) == 0 { draw(&mut state, 8) as u16 } else { TileLayer::EMPTY };
    let cells = (0..64 * 64).map(cell).collect();
    let layer = TileLayer { tileset: tileset.clone(), columns: 64, rows: 64, cells, outside: 1 };
    world.spawn((layer, Transform::from_xyz(0.0, 0.0, 1.0), ChildOf(stage)));
    let backdrop = Sprite { image: background.clone(), custom_size: Some(Vec2::splat(64.0)), ..default() };
    world.spawn((backdrop, Transform::from_xyz(32.0, 32.0, 0.0), ChildOf(stage)));
    for i in 0..25 {
        let at = Vec2::new(draw(&mut state, 640) as f32, draw(&mut state, 640) as f32) / 10.0;
        world.spawn((thing(atlas, i), Transform::from_translation(at.extend(2.0)), ChildOf(stage), Mover));
    }
    let options = ImageOptions::default();
    let agent = world
        .spawn((player(index), thing(atlas, 30), Transform::from_xyz(32.0, 32.0, 3.0), ChildOf(stage), Mover))
        .id();
    world.entity_mut(agent).insert(CameraSensor::following(agent, 13.0, options));
    agent
}

fn thing(atlas: &Handle<Image>, number: u32) -> Sprite {
    let corner = Vec2::new((number % 8) as f32, (number / 8) as f32) * 32.0;
    Sprite {
        image: atlas.clone(),
        rect: Some(Rect::from_corners(corner, corner + 32.0)),
        custom_size: Some(Vec2::ONE),
        flip_x: number % 2 == 1,
        ..default()
    }
}

/// Lets everything in [`spawn_large_scene`] drift.
pub fn drift(mut movers: Query<&mut Transform, With<Mover>>) {
    for mut transform in &mut movers {
        let place = transform.translation;
        transform.translation.x = if place.x > 60.0 { 4.0 } else { place.x + 0.07 };
    }
}
