//! Tests of colours, tiles and sizes.

use bevy::prelude::*;
use bevy_playbot::vision::TileLayer;

use super::viewer::{BLUE, GREEN, RED, WHITE, add, frame, looking, text};

const GREY: [u8; 4] = [200, 200, 200, 255];

const NONE: [u8; 4] = [0; 4];

#[test]
fn tint_and_half_transparency_are_mixed_in_linear_light() {
    let (mut world, sensor) = looking([1, 1]);
    let grey = add(&mut world, 1, &[GREY]);
    let entity = world.spawn(Sprite { color: Color::srgb(0.5, 1.0, 0.0), ..Sprite::from_image(grey) }).id();
    // 200 is 0.57758 of the light, 0.5 is 0.21404: together 0.12362, which is 99.
    assert_eq!(frame(&mut world, sensor), [[99, 200, 0, 255]]);
    let half = Sprite::from_color(Color::srgba(1.0, 1.0, 1.0, 0.5), Vec2::ONE);
    let over = world.spawn((half, Transform::from_xyz(0.0, 0.0, 1.0))).id();
    // Half of that and half of white: 0.56239, 0.78879 and 0.5.
    assert_eq!(frame(&mut world, sensor), [[198, 230, 188, 255]]);
    world.despawn(entity);
    let glass = add(&mut world, 1, &[[255, 0, 0, 51]]);
    world.entity_mut(over).insert(Sprite::from_image(glass));
    world.insert_resource(ClearColor(Color::srgb(0.0, 0.0, 1.0)));
    // A fifth of red over blue: 0.2 is 124, 0.8 is 231.
    assert_eq!(frame(&mut world, sensor), [[124, 0, 231, 255]]);
}

#[test]
fn holes_show_what_lies_behind() {
    let (mut world, sensor) = looking([2, 1]);
    let holes = add(&mut world, 2, &[NONE, RED]);
    world.spawn((Sprite::from_image(holes), Transform::from_xyz(0.0, 0.0, 1.0)));
    world.spawn(Sprite::from_color(Color::srgb(0.0, 0.0, 1.0), Vec2::new(2.0, 1.0)));
    assert_eq!(text(&mut world, sensor), "BR");
}

#[test]
fn tiles_fill_cells_and_the_outside() {
    let (mut world, sensor) = looking([6, 4]);
    // Tile 0 is red over green, tile 1 has a hole, and a faint texel that does not count, and tile 2 is white.
    let strip = [RED, RED, GREEN, GREEN, BLUE, NONE, [0, 0, 255, 127], [0, 0, 255, 128], WHITE, WHITE, WHITE, WHITE];
    let tileset = add(&mut world, 2, &strip);
    let cells = vec![0, TileLayer::EMPTY, 1, 0];
    let layer = TileLayer { tileset, columns: 2, rows: 2, cells, outside: 2 };
    let entity = world.spawn((layer, Transform::from_xyz(-2.0, -2.0, 0.0).with_scale(Vec3::splat(2.0)))).id();
    assert_eq!(text(&mut world, sensor), "WB.RRW/W.BGGW/WRR..W/WGG..W");
    world.get_mut::<TileLayer>(entity).expect("there").outside = TileLayer::EMPTY;
    world.get_mut::<Transform>(entity).expect("there").scale = Vec3::splat(1.0);
    // One texel in four is visible: the one under the centre, which belongs to the right and to the bottom.
    assert_eq!(text(&mut world, sensor), "....../....../.BG.../.G....");
    let mut place = world.get_mut::<Transform>(entity).expect("there");
    *place = Transform::from_xyz(2.0, 2.0, 0.0).with_scale(Vec3::splat(-2.0));
    assert_eq!(text(&mut world, sensor), "...GG./...RR./.GGB../.RR.B.", "upside down");
    *world.get_mut::<Transform>(entity).expect("there") = Transform::from_xyz(2.0, -2.0, 0.0)
        .with_scale(Vec3::splat(2.0))
        .with_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    assert_eq!(text(&mut world, sensor), ".RG.../.RG.../..BRG./.B.RG.", "turned left");
}

#[test]
fn pictures_of_odd_sizes() {
    for size in [[1, 1], [3, 5], [7, 2], [84, 84], [5, 1]] {
        let (mut world, sensor) = looking(size);
        let white = add(&mut world, 1, &[WHITE]);
        let width = (size[0] as f32 - 1.9).max(0.1);
        world.spawn(Sprite { custom_size: Some(Vec2::new(width, 99.0)), ..Sprite::from_image(white) });
        let pixels = frame(&mut world, sensor);
        assert_eq!(pixels.len(), (size[0] * size[1]) as usize);
        let row: Vec<bool> = pixels[..size[0] as usize].iter().map(|pixel| *pixel == WHITE).collect();
        let expected: Vec<bool> = (0..size[0]).map(|x| size[0] == 1 || (x > 0 && x + 1 < size[0])).collect();
        assert_eq!(row, expected, "{size:?}");
    }
}
