//! Tests of sensors that look through a camera of the game.

use bevy::{
    camera::{ImageRenderTarget, RenderTarget, ScalingMode},
    prelude::*,
};
use bevy_playbot::{camera::CameraSensor, vision::ImageOptions};
use playbot::prelude::*;
use playbot_tests::scene::{camera_world, image, pixel, player, spawn_sensor};

fn agent(world: &mut World, index: u32, camera: Entity, size: [u32; 2]) -> Entity {
    let options = ImageOptions { width: size[0], height: size[1], ..default() };
    world.spawn((player(index), CameraSensor::of(camera, options))).id()
}

/// Spawns red left of the middle, green right of it, 4 units wide each, between -2 and 2 in height.
fn spawn_flag(world: &mut World) {
    let flag = world.resource_mut::<Assets<Image>>().add(image(2, &[[200, 0, 0, 255], [0, 200, 0, 255]]));
    world.spawn((Sprite { image: flag, custom_size: Some(Vec2::new(8.0, 4.0)), ..default() }, Transform::default()));
}

fn fixed(width: f32, height: f32) -> Projection {
    let scaling_mode = ScalingMode::Fixed { width, height };
    Projection::Orthographic(OrthographicProjection { scaling_mode, ..OrthographicProjection::default_2d() })
}

#[test]
fn a_camera_without_a_window_is_seen_through() {
    let mut world = camera_world(|_| {});
    spawn_flag(&mut world);
    let background = Camera { clear_color: ClearColorConfig::Custom(Color::srgb_u8(1, 2, 3)), ..default() };
    let wide = world.spawn((Camera2d, background, fixed(16.0, 8.0), Msaa::Off)).id();
    let near = world.spawn((Camera2d, fixed(2.0, 2.0), Msaa::Off, Transform::from_xyz(1.0, 0.0, 0.0))).id();
    let (first, second) = (agent(&mut world, 0, wide, [50, 37]), agent(&mut world, 1, wide, [50, 37]));
    let third = agent(&mut world, 2, near, [8, 8]);
    let target = world.spawn(Transform::from_xyz(-2.0, 0.0, 0.0)).id();
    let fourth = spawn_sensor(&mut world, 3, target, 2.0, [5, 5]);
    for _ in 0..3 {
        world.tick().expect("sound");
        for agent in [first, second] {
            assert_eq!([pixel(&world, agent, 20, 18), pixel(&world, agent, 30, 18)], [[200, 0, 0], [0, 200, 0]]);
            assert_eq!([pixel(&world, agent, 2, 18), pixel(&world, agent, 30, 2)], [[1, 2, 3]; 2]);
        }
        assert_eq!([pixel(&world, third, 0, 0), pixel(&world, third, 7, 7)], [[0, 200, 0]; 2]);
        assert_eq!(pixel(&world, fourth, 2, 2), [200, 0, 0]);
    }
    world.entity_mut(near).insert(Transform::from_xyz(-1.0, 0.0, 0.0));
    world.tick().expect("sound");
    assert_eq!(pixel(&world, third, 7, 7), [200, 0, 0]);
}

#[test]
fn a_camera_keeps_its_own_target() {
    let mut world = camera_world(|_| {});
    spawn_flag(&mut world);
    let screen = Image::new_target_texture(100, 50, bevy::render::render_resource::TextureFormat::Rgba8UnormSrgb, None);
    let screen = world.resource_mut::<Assets<Image>>().add(screen);
    let target = RenderTarget::Image(ImageRenderTarget { handle: screen.clone(), scale_factor: 1.0 });
    let camera = world.spawn((Camera2d, target, Msaa::Off)).id();
    world.entity_mut(camera).insert(Projection::Orthographic(OrthographicProjection {
        scale: 0.1,
        ..OrthographicProjection::default_2d()
    }));
    // The screen of 100 by 50 pixels shows 10 by 5 units: so does the sensor, in another shape.
    let agent = agent(&mut world, 0, camera, [20, 20]);
    world.ticks(3).expect("sound");
    assert_eq!([pixel(&world, agent, 2, 10), pixel(&world, agent, 17, 10)], [[200, 0, 0], [0, 200, 0]]);
    assert_eq!([pixel(&world, agent, 1, 10), pixel(&world, agent, 10, 0)], [[0; 3]; 2]);
    assert_eq!(world.get::<RenderTarget>(camera).and_then(RenderTarget::as_image), Some(&screen));
    let computed = &world.get::<Camera>(camera).expect("a camera").computed;
    assert_eq!(computed.target_info.as_ref().map(|info| info.physical_size), Some(UVec2::new(100, 50)));
}

#[test]
fn a_3d_camera_is_seen_through() {
    let mut world = camera_world(|_| {});
    let sky = Camera { clear_color: ClearColorConfig::Custom(Color::srgb_u8(10, 120, 240)), ..default() };
    let camera =
        world.spawn((Camera3d::default(), sky, Msaa::Off, bevy::core_pipeline::tonemapping::Tonemapping::None)).id();
    let agent = agent(&mut world, 0, camera, [33, 9]);
    world.ticks(3).expect("sound");
    for (x, y) in [(0, 0), (32, 8), (16, 4)] {
        assert_eq!(pixel(&world, agent, x, y), [10, 120, 240]);
    }
}

#[test]
fn cameras_that_cannot_be_looked_through_are_named() {
    let mut world = camera_world(|_| {});
    let camera = world.spawn((Camera2d, fixed(2.0, 2.0))).id();
    let first = agent(&mut world, 0, camera, [8, 8]);
    let second = agent(&mut world, 1, camera, [9, 8]);
    let fault = world.tick().expect_err("two sizes").to_string();
    assert!(fault.contains("agent 1") && fault.contains("in another size"), "{fault}");
    world.despawn(second);
    world.tick().expect("sound");
    world.despawn(camera);
    let fault = world.tick().expect_err("the camera is gone").to_string();
    assert!(fault.contains("agent 0") && fault.contains(&format!("the camera {camera}")), "{fault}");
    world.despawn(first);
    world.tick().expect("no sensor looks");
}
