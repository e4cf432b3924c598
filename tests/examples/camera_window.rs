//! A game with a window, whose agent has a camera sensor of its own: the two must not disturb each other.
//!
//! `camera_window [seconds]`; the window shows a walker, and every second the program prints the agent's view.

#![allow(clippy::print_stdout)]

use bevy::{prelude::*, winit::WinitSettings};
use bevy_playbot::{
    camera::{CameraSensor, CameraSensorPlugin},
    episode::Tick,
    plugin::PlaybotPlugin,
    vision::{Frame, ImageOptions, TileLayer},
};
use playbot_tests::scene::{image, player};

#[derive(Component)]
struct Walker;

fn main() {
    let seconds = std::env::args().nth(1).and_then(|word| word.parse().ok()).unwrap_or(5.0);
    App::new()
        .add_plugins(DefaultPlugins.set(ImagePlugin::default_nearest()))
        .add_plugins((PlaybotPlugin::default(), CameraSensorPlugin::default()))
        .insert_resource(WinitSettings::continuous())
        .insert_resource(ClearColor(Color::srgb_u8(30, 60, 90)))
        .add_systems(Startup, build)
        .add_systems(FixedUpdate, walk)
        .add_systems(
            Update,
            (check, move |time: Res<Time>, mut exit: MessageWriter<AppExit>| {
                if time.elapsed_secs() > seconds {
                    exit.write(AppExit::Success);
                }
            }),
        )
        .run();
}

fn build(mut commands: Commands, mut images: ResMut<Assets<Image>>) {
    commands.spawn((Camera2d, Msaa::Off, Transform::from_scale(Vec3::splat(1.0 / 32.0))));
    let tiles = images.add(image(2, &[[200, 160, 20, 255], [90, 70, 10, 255], [90, 70, 10, 255], [200, 160, 20, 255]]));
    let layer = TileLayer { tileset: tiles, columns: 20, rows: 3, cells: vec![0; 60], outside: TileLayer::EMPTY };
    commands.spawn((layer, Transform::from_xyz(-10.0, -6.0, 1.0)));
    let body = images.add(image(1, &[[230, 40, 40, 255]]));
    let body = Sprite { image: body, custom_size: Some(Vec2::ONE), ..default() };
    let walker = commands.spawn((Walker, body, Transform::from_xyz(-9.0, -2.5, 2.0))).id();
    let sensor = CameraSensor::following(walker, 13.0, ImageOptions::default());
    commands.entity(walker).insert((player(0), sensor));
}

fn walk(mut walkers: Query<&mut Transform, With<Walker>>) {
    for mut place in &mut walkers {
        place.translation.x = if place.translation.x > 9.0 { -9.0 } else { place.translation.x + 0.05 };
    }
}

/// Checks that the agent is in the middle of its own picture, on every tick.
fn check(frames: Query<&Frame>, tick: Res<Tick>, mut faults: ResMut<bevy_playbot::fault::Faults>) {
    let Ok(frame) = frames.single() else { return };
    let seen = frame.pixels.get(32 * 64 + 32);
    let sound = frame.tick == Some(tick.0) && seen == Some(&[230, 40, 40, 255]);
    if tick.0 > 0 && (tick.0.is_multiple_of(60) || !sound) {
        println!("tick {}: frame of {:?}, middle {seen:?}, fault {:?}", tick.0, frame.tick, faults.take().err());
    }
}
