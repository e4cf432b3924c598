//! Tests of camera sensors: known sprites and tiles at known pixels, in every size.

use bevy::{prelude::*, sprite::Anchor};
use bevy_playbot::vision::TileLayer;
use playbot::prelude::*;
use playbot_tests::scene::{camera_world, image, pixel, spawn_sensor};

const RED: [u8; 4] = [200, 10, 30, 255];
const GREEN: [u8; 4] = [20, 180, 40, 255];
const BLUE: [u8; 4] = [15, 35, 220, 255];
const GREY: [u8; 4] = [128, 128, 128, 255];
const CLEAR: [u8; 4] = [9, 9, 9, 0];

fn rgb(colour: [u8; 4]) -> [u8; 3] {
    [colour[0], colour[1], colour[2]]
}

fn add(world: &mut World, width: u32, pixels: &[[u8; 4]]) -> Handle<Image> {
    world.resource_mut::<Assets<Image>>().add(image(width, pixels))
}

/// Returns the view of an agent in a World with `sprites` that looks at its middle: 4 by 4 units, a pixel each.
fn see(sprites: impl FnOnce(&mut World)) -> Vec<[u8; 3]> {
    let mut world = camera_world(|_| {});
    sprites(&mut world);
    let target = world.spawn(Transform::default()).id();
    let agent = spawn_sensor(&mut world, 0, target, 4.0, [4, 4]);
    world.tick().expect("sound");
    (0..16).map(|i| pixel(&world, agent, i % 4, i / 4)).collect()
}

/// Returns a quad of four colours, two units wide, in the middle.
fn quad(world: &mut World) -> Sprite {
    let image = add(world, 2, &[RED, GREEN, BLUE, GREY]);
    Sprite { image, custom_size: Some(Vec2::splat(2.0)), ..default() }
}

/// Returns the four pixels in the middle.
fn middle(seen: &[[u8; 3]]) -> [[u8; 3]; 4] {
    [seen[5], seen[6], seen[9], seen[10]]
}

#[test]
fn every_byte_of_an_image_comes_back() {
    let mut world = camera_world(|_| {});
    let picture: Vec<[u8; 4]> = (0..256).map(|i| [i as u8, 255 - i as u8, (i * 7) as u8, 255]).collect();
    let handle = add(&mut world, 16, &picture);
    world.spawn((Sprite { image: handle, custom_size: Some(Vec2::splat(16.0)), ..default() }, Transform::default()));
    let target = world.spawn(Transform::default()).id();
    let agent = spawn_sensor(&mut world, 0, target, 18.0, [18, 18]);
    world.tick().expect("sound");
    for (x, y) in (0..18).flat_map(|x| (0..18).map(move |y| (x, y))) {
        let inside = (1..17).contains(&x) && (1..17).contains(&y);
        let expected = if inside { rgb(picture[((y - 1) * 16 + x - 1) as usize]) } else { [0; 3] };
        assert_eq!(pixel(&world, agent, x, y), expected, "({x}, {y})");
    }
}

#[test]
fn a_sprite_is_turned_over_cut_out_and_moved() {
    let plain = see(|world| {
        let sprite = quad(world);
        world.spawn((sprite, Transform::default()));
    });
    assert_eq!(middle(&plain), [RED, GREEN, BLUE, GREY].map(rgb));
    assert_eq!(plain.iter().filter(|&&colour| colour == [0; 3]).count(), 12);
    let flipped = see(|world| {
        let sprite = Sprite { flip_x: true, flip_y: true, ..quad(world) };
        world.spawn((sprite, Transform::default()));
    });
    assert_eq!(middle(&flipped), [GREY, BLUE, GREEN, RED].map(rgb));
    let cut = see(|world| {
        let sprite = Sprite { rect: Some(Rect::new(1.0, 0.0, 2.0, 2.0)), ..quad(world) };
        world.spawn((sprite, Transform::default()));
    });
    assert_eq!(middle(&cut), [GREEN, GREEN, GREY, GREY].map(rgb));
    let turned = see(|world| {
        let sprite = quad(world);
        world.spawn((sprite, Transform::from_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2))));
    });
    assert_eq!(middle(&turned), [GREEN, GREY, RED, BLUE].map(rgb));
    let anchored = see(|world| {
        let sprite = quad(world);
        world.spawn((sprite, Anchor::BOTTOM_LEFT, Transform::from_xyz(-2.0, -2.0, 0.0)));
    });
    assert_eq!([anchored[8], anchored[9], anchored[12], anchored[13]], [RED, GREEN, BLUE, GREY].map(rgb));
}

#[test]
fn a_tint_multiplies_light() {
    let seen = see(|world| {
        let image = add(world, 1, &[[255, 255, 255, 255]]);
        let color = Color::srgb_u8(200, 100, 50);
        world.spawn((Sprite { image, color, custom_size: Some(Vec2::splat(4.0)), ..default() }, Transform::default()));
    });
    assert_eq!(seen, vec![[200, 100, 50]; 16]);
    let halved = see(|world| {
        let image = add(world, 1, &[[255, 128, 0, 255]]);
        let color = Color::linear_rgb(0.5, 0.5, 0.5);
        world.spawn((Sprite { image, color, custom_size: Some(Vec2::splat(4.0)), ..default() }, Transform::default()));
    });
    let half = |byte: u8| {
        let light = Color::srgb_u8(byte, 0, 0).to_linear().red * 0.5;
        (Color::linear_rgb(light, 0.0, 0.0).to_srgba().red * 255.0).round() as i32
    };
    for [red, green, blue] in halved {
        assert!((i32::from(red) - half(255)).abs() <= 1 && (i32::from(green) - half(128)).abs() <= 1 && blue == 0);
    }
}

#[test]
fn what_is_in_front_hides_what_is_behind() {
    for (front, back) in [(1.0, 0.0), (-1.0, -2.0), (5.0, 4.5)] {
        let seen = see(|world| {
            let (red, green) = (add(world, 1, &[RED]), add(world, 1, &[GREEN]));
            let size = Some(Vec2::splat(2.0));
            world.spawn((Sprite { image: red, custom_size: size, ..default() }, Transform::from_xyz(0.0, 0.0, front)));
            let wide = Some(Vec2::splat(4.0));
            world.spawn((Sprite { image: green, custom_size: wide, ..default() }, Transform::from_xyz(0.0, 0.0, back)));
        });
        assert_eq!(middle(&seen), [rgb(RED); 4]);
        assert_eq!(seen[0], rgb(GREEN));
    }
}

#[test]
fn tiles_lie_among_the_sprites() {
    let mut world = camera_world(|_| {});
    // Tile 0 is red over green, tile 1 is blue with a hole at the bottom right.
    let strip = add(&mut world, 2, &[RED, RED, GREEN, GREEN, BLUE, BLUE, BLUE, CLEAR]);
    let layer = TileLayer { tileset: strip, columns: 2, rows: 2, cells: vec![0, 1, TileLayer::EMPTY, 0], outside: 1 };
    let layer = world.spawn((layer, Transform::from_xyz(-1.0, -1.0, 1.0))).id();
    let behind = add(&mut world, 1, &[GREY]);
    let behind = Sprite { image: behind, custom_size: Some(Vec2::splat(100.0)), ..default() };
    world.spawn((behind, Transform::default()));
    let target = world.spawn(Transform::default()).id();
    let agent = spawn_sensor(&mut world, 0, target, 6.0, [12, 12]);
    world.tick().expect("sound");
    // Bottom left cell: tile 0. Its neighbour on the right: tile 1. Above: nothing, and tile 0.
    let at = |world: &World, x, y| pixel(world, agent, x, y);
    assert_eq!([at(&world, 4, 6), at(&world, 5, 7)], [rgb(RED), rgb(GREEN)]);
    assert_eq!([at(&world, 6, 6), at(&world, 7, 7)], [rgb(BLUE), rgb(GREY)]);
    assert_eq!([at(&world, 4, 4), at(&world, 5, 5)], [rgb(GREY), rgb(GREY)]);
    assert_eq!([at(&world, 7, 4), at(&world, 6, 5)], [rgb(RED), rgb(GREEN)]);
    // Outside, to the edge of the picture.
    assert_eq!([at(&world, 0, 0), at(&world, 1, 1)], [rgb(BLUE), rgb(GREY)]);
    assert_eq!([at(&world, 10, 10), at(&world, 11, 11)], [rgb(BLUE), rgb(GREY)]);
    // A change is seen in the same tick.
    world.get_mut::<TileLayer>(layer).expect("alive").cells[2] = 0;
    world.tick().expect("sound");
    assert_eq!([at(&world, 4, 4), at(&world, 5, 5)], [rgb(RED), rgb(GREEN)]);
    world.get_mut::<TileLayer>(layer).expect("alive").outside = TileLayer::EMPTY;
    world.tick().expect("sound");
    assert_eq!([at(&world, 0, 0), at(&world, 6, 6)], [rgb(GREY), rgb(BLUE)]);
}

#[test]
fn meshes_of_the_game_are_seen() {
    let mut world = camera_world(|_| {});
    let mesh = world.resource_mut::<Assets<Mesh>>().add(Rectangle::new(2.0, 2.0));
    for (x, colour, alpha) in [(-1.0, Color::srgb_u8(250, 90, 20), 1.0), (1.0, Color::srgb_u8(20, 90, 250), 0.999)] {
        // The second one is drawn by depth, the first is not.
        let colour = colour.with_alpha(alpha);
        let material = world.resource_mut::<Assets<ColorMaterial>>().add(ColorMaterial::from_color(colour));
        world.spawn((Mesh2d(mesh.clone()), MeshMaterial2d(material), Transform::from_xyz(x, 0.0, 0.0)));
    }
    let target = world.spawn(Transform::default()).id();
    let agents: Vec<Entity> = (0..3).map(|i| spawn_sensor(&mut world, i, target, 4.0, [4, 4])).collect();
    world.tick().expect("sound");
    for agent in agents {
        assert_eq!([pixel(&world, agent, 0, 0), pixel(&world, agent, 1, 1)], [[0; 3], [250, 90, 20]]);
        assert_eq!(pixel(&world, agent, 2, 2), [20, 90, 250]);
    }
}

#[test]
fn pictures_of_all_sizes_at_once() {
    let mut world = camera_world(|_| {});
    let pixels: Vec<[u8; 4]> = (0..128 * 128).map(|i| [(i % 128) as u8, (i / 128) as u8, 77, 255]).collect();
    let image = add(&mut world, 128, &pixels);
    world.spawn((Sprite { image, custom_size: Some(Vec2::splat(128.0)), ..default() }, Transform::default()));
    let sizes = [[64, 64], [84, 84], [50, 37], [1, 1], [3, 100], [101, 7], [65, 64], [128, 128], [13, 13]];
    let agents: Vec<(Entity, [u32; 2], Vec2)> = (0..27_u32)
        .map(|i| {
            let size = sizes[i as usize % sizes.len()];
            // Half a unit aside where a side is odd, so that a pixel is a texel.
            let odd = Vec2::new((size[0] % 2) as f32, (size[1] % 2) as f32) / 2.0;
            let place = Vec2::new((i % 5) as f32 - 2.0, (i % 7) as f32 - 3.0) + odd;
            let target = world.spawn(Transform::from_translation(place.extend(0.0))).id();
            (spawn_sensor(&mut world, i, target, size[0] as f32, size), size, place)
        })
        .collect();
    for _ in 0..3 {
        world.tick().expect("sound");
        for &(agent, size, place) in &agents {
            for (x, y) in
                [(0, 0), (size[0] - 1, 0), (size[0] / 2, size[1] / 2), (0, size[1] - 1), (size[0] - 1, size[1] - 1)]
            {
                let east = place.x - size[0] as f32 / 2.0 + x as f32 + 64.0;
                let south = 64.0 - place.y - size[1] as f32 / 2.0 + y as f32;
                let inside = (0.0..128.0).contains(&east) && (0.0..128.0).contains(&south);
                let expected = if inside { [east as u8, south as u8, 77] } else { [0; 3] };
                assert_eq!(pixel(&world, agent, x, y), expected, "{size:?} at ({x}, {y})");
            }
        }
    }
}
