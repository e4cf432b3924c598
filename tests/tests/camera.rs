//! Exact pixels of a camera sensor.

use bevy::prelude::*;
use bevy_playbot::prelude::*;
use playbot_tests::scene::{camera_world, image, pixel, spawn_eye};

#[test]
fn a_sprite_comes_back_as_its_bytes() {
    let mut world = camera_world(|_| {});
    let picture: Vec<[u8; 4]> = (0..16).map(|i| [i * 16, 255 - i * 3, 7 * i, 255]).collect();
    let handle = world.resource_mut::<Assets<Image>>().add(image(4, &picture));
    world.spawn((Sprite { image: handle, custom_size: Some(Vec2::splat(4.0)), ..default() }, Transform::default()));
    let target = world.spawn(Transform::default()).id();
    let agent = spawn_eye(&mut world, 0, target, 6.0, [6, 6]);
    world.tick().expect("sound");
    for y in 0..6 {
        for x in 0..6 {
            let inside = (1..5).contains(&x) && (1..5).contains(&y);
            let expected = if inside { picture[((y - 1) * 4 + x - 1) as usize] } else { [0; 4] };
            assert_eq!(pixel(&world, agent, x, y), [expected[0], expected[1], expected[2]], "({x}, {y})");
        }
    }
}
