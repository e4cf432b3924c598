//! Tests of sprites' positions, which are Bevy's.

use bevy::{prelude::*, sprite::Anchor};
use bevy_playbot::vision::Frame;

use super::viewer::{BLUE, GREEN, RED, WHITE, add, fault, four, looking, text};

#[test]
fn a_sprite_lies_in_the_middle() {
    let (mut world, sensor) = looking([4, 4]);
    let sprite = four(&mut world);
    world.spawn(sprite);
    assert_eq!(text(&mut world, sensor), "..../.RG./.BW./....");
    assert_eq!(world.get::<Frame>(sensor).expect("a sensor").tick, Some(1));
}

#[test]
fn flips_turn_a_sprite_around() {
    for (flips, expected) in [([true, false], "GR/WB"), ([false, true], "BW/RG"), ([true, true], "WB/GR")] {
        let (mut world, sensor) = looking([2, 2]);
        let [flip_x, flip_y] = flips;
        let sprite = Sprite { flip_x, flip_y, ..four(&mut world) };
        world.spawn(sprite);
        assert_eq!(text(&mut world, sensor), expected);
    }
}

#[test]
fn scale_and_rotation_turn_and_stretch() {
    let turned = |angle| Transform::from_rotation(Quat::from_rotation_z(angle));
    for (place, expected) in [
        (Transform::from_scale(Vec3::new(2.0, 1.0, 1.0)), "..../RRGG/BBWW/...."),
        (Transform::from_scale(Vec3::new(-1.0, 1.0, 1.0)), "..../.GR./.WB./...."),
        (Transform::from_scale(Vec3::new(1.0, -2.0, 1.0)), ".BW./.BW./.RG./.RG."),
        (turned(std::f32::consts::FRAC_PI_2), "..../.GW./.RB./...."),
        (turned(std::f32::consts::PI), "..../.WB./.GR./...."),
        (Transform::from_xyz(1.0, 1.0, 0.0), "..RG/..BW/..../...."),
        (Transform::from_xyz(-2.0, 0.4, 0.0), "..../G.../W.../...."),
    ] {
        let (mut world, sensor) = looking([4, 4]);
        let sprite = four(&mut world);
        world.spawn((sprite, place));
        assert_eq!(text(&mut world, sensor), expected, "{place:?}");
    }
}

#[test]
fn rotation_by_an_eighth_makes_a_diamond() {
    let (mut world, sensor) = looking([6, 6]);
    let colour = Sprite::from_color(Color::WHITE, Vec2::splat(4.0));
    world.spawn((colour, Transform::from_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_4))));
    // Half a diagonal is 2.83: centres at a distance |x| + |y| below it are inside.
    assert_eq!(text(&mut world, sensor), "....../..WW../.WWWW./.WWWW./..WW../......");
}

#[test]
fn anchors_sizes_and_rectangles() {
    let (mut world, sensor) = looking([4, 4]);
    let sprite = four(&mut world);
    let entity = world.spawn((sprite.clone(), Anchor::BOTTOM_LEFT)).id();
    assert_eq!(text(&mut world, sensor), "..RG/..BW/..../....");
    world.entity_mut(entity).insert(Anchor(Vec2::new(0.5, 0.0)));
    assert_eq!(text(&mut world, sensor), "..../RG../BW../....");
    world
        .entity_mut(entity)
        .insert((Sprite { custom_size: Some(Vec2::new(4.0, 2.0)), ..sprite.clone() }, Anchor::CENTER));
    assert_eq!(text(&mut world, sensor), "..../RRGG/BBWW/....");
    let rect = Some(Rect::new(1.0, 0.0, 2.0, 2.0));
    world.entity_mut(entity).insert((Sprite { rect, ..sprite.clone() }, Anchor::BOTTOM_LEFT));
    assert_eq!(text(&mut world, sensor), "..G./..W./..../....");
    world.entity_mut(entity).insert(Sprite { rect, custom_size: Some(Vec2::splat(2.0)), ..sprite });
    assert_eq!(text(&mut world, sensor), "..GG/..WW/..../....");
}

#[test]
fn an_atlas_gives_sections_and_a_rectangle_counts_within() {
    let (mut world, sensor) = looking([2, 2]);
    let image = add(&mut world, 4, &[RED, RED, GREEN, BLUE, RED, RED, WHITE, GREEN]);
    let layout = TextureAtlasLayout::from_grid(UVec2::splat(2), 2, 1, None, None);
    let layout = world.resource_mut::<Assets<TextureAtlasLayout>>().add(layout);
    let mut sprite = Sprite::from_atlas_image(image, TextureAtlas { layout, index: 1 });
    let entity = world.spawn(sprite.clone()).id();
    assert_eq!(text(&mut world, sensor), "GB/WG");
    sprite.rect = Some(Rect::new(0.0, 1.0, 2.0, 2.0));
    sprite.custom_size = Some(Vec2::splat(2.0));
    world.entity_mut(entity).insert(sprite.clone());
    assert_eq!(text(&mut world, sensor), "WG/WG");
    sprite.texture_atlas.as_mut().expect("set").index = 9;
    world.entity_mut(entity).insert((sprite, Name::new("walker")));
    let fault = fault(&mut world);
    assert!(fault.contains("no section 9") && fault.contains("walker"), "{fault}");
}

#[test]
fn the_nearest_is_on_top_and_equals_keep_their_order() {
    let (mut world, sensor) = looking([1, 1]);
    let plain = |colour| Sprite::from_color(colour, Vec2::ONE);
    let red = world.spawn((plain(Color::srgb(1.0, 0.0, 0.0)), Transform::from_xyz(0.0, 0.0, 1.0))).id();
    let blue = world.spawn((plain(Color::srgb(0.0, 0.0, 1.0)), Transform::from_xyz(0.0, 0.0, -1.0))).id();
    assert_eq!(text(&mut world, sensor), "R");
    world.get_mut::<Transform>(blue).expect("there").translation.z = 1.0;
    assert_eq!(text(&mut world, sensor), "B", "the later one of two that are equally near");
    world.get_mut::<Transform>(blue).expect("there").translation.z = -0.0;
    world.get_mut::<Transform>(red).expect("there").translation.z = 0.0;
    assert_eq!(text(&mut world, sensor), "B", "zero has no sign");
    world.entity_mut(blue).insert(Visibility::Hidden);
    assert_eq!(text(&mut world, sensor), "R");
}

#[test]
fn what_is_hidden_hides_its_children_unless_they_will_be_seen() {
    let (mut world, sensor) = looking([2, 1]);
    let parent = world.spawn((Transform::from_xyz(0.5, 0.0, 0.0), Visibility::Hidden)).id();
    let white = || Sprite::from_color(Color::WHITE, Vec2::ONE);
    let child = world.spawn((white(), ChildOf(parent))).id();
    assert_eq!(text(&mut world, sensor), "..");
    world.entity_mut(child).insert(Visibility::Visible);
    assert_eq!(text(&mut world, sensor), ".W", "children stand where their parents do");
    world.entity_mut(child).insert((Transform::from_xyz(-1.0, 0.0, 0.0), Visibility::Inherited));
    world.entity_mut(parent).insert(Visibility::Inherited);
    assert_eq!(text(&mut world, sensor), "W.");
}

#[test]
fn an_image_that_changes_is_seen_to_change() {
    let (mut world, sensor) = looking([2, 2]);
    let sprite = four(&mut world);
    let handle = sprite.image.clone();
    world.spawn(sprite);
    assert_eq!(text(&mut world, sensor), "RG/BW");
    let mut images = world.resource_mut::<Assets<Image>>();
    images.get_mut(&handle).expect("there").data.as_mut().expect("loaded")[..4].copy_from_slice(&WHITE);
    assert_eq!(text(&mut world, sensor), "WG/BW");
}
