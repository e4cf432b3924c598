//! Tests of a foreign game's own camera.

use bevy::{camera::ScalingMode, prelude::*};
use bevy_playbot::vision::{Frame, ImageOptions, ObservationConfig, ObservationKind};
use playbot::prelude::*;
use playbot_harness::{foreign::ForeignGame, worlds::build_observing_world};
use playbot_tests::{
    foreign::catch::{Paddle, game},
    scene::pixel,
};

/// The game of catching, with a white paddle of two units and a camera that sees 16 by 16 units around its position.
fn drawn(app: &mut App) {
    game(app);
    app.add_systems(PostStartup, dress);
}

fn dress(paddle: Single<Entity, With<Paddle>>, mut commands: Commands) {
    commands.entity(*paddle).insert(Sprite::from_color(Color::WHITE, Vec2::splat(2.0)));
    let scaling_mode = ScalingMode::Fixed { width: 16.0, height: 16.0 };
    let projection = OrthographicProjection { scaling_mode, ..OrthographicProjection::default_2d() };
    let camera = (Camera2d, Projection::Orthographic(projection), Msaa::Off);
    commands.spawn((camera, Transform::from_xyz(4.0, 0.0, 0.0)));
}

#[test]
fn its_agent_sees_what_its_camera_sees() {
    let game = ForeignGame::new("drawn", 1, drawn).keys([vec![], vec![KeyCode::ArrowRight]]).camera();
    assert_eq!(game.problem(), None, "there is nothing but the camera");
    let image = ImageOptions { width: 16, height: 16, ..default() };
    let config = ObservationConfig { kind: ObservationKind::Camera, image };
    let (mut world, agents) = build_observing_world(&game, "default", &config, 0, 0, 1)
        .expect("these tests need a Vulkan driver: apt-get install mesa-vulkan-drivers");
    let right = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, right, LevelQueue::list([1, 2])));
    for episode in ["the first", "and one after a restart"] {
        world.tick().expect("sound");
        let first = world.get::<Frame>(agents[0]).expect("a picture").clone();
        let background = pixel(&world, agents[0], 0, 0);
        for (x, y) in [(7, 7), (8, 8)] {
            assert_eq!(pixel(&world, agents[0], x, y), [255; 3], "{episode}: the paddle is in the middle");
        }
        assert_ne!(background, [255; 3], "{episode}");
        // 12 units a second, up to the wall four units away.
        world.ticks(29).expect("sound");
        assert_ne!(world.get::<Frame>(agents[0]).expect("a picture").pixels, first.pixels, "{episode}");
        assert_eq!(pixel(&world, agents[0], 12, 8), [255; 3], "{episode}: it has gone to the right");
        assert_eq!(pixel(&world, agents[0], 8, 8), background, "{episode}");
        world.get_mut::<Episode>(agents[0]).expect("an agent").abandon();
    }
}
