//! Exact pixels of a raster sensor.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings},
    prelude::*,
    sprite::Anchor,
};
use bevy_playbot::{
    headless::into_world,
    raster::{RasterPlugin, RasterSensor},
    vision::{Frame, ImageOptions, Stage, TileLayer},
};
use playbot_lab::prelude::*;
use playbot_tests::scene::{image, pixel};

const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const WHITE: [u8; 4] = [255; 4];
const GREY: [u8; 4] = [200, 200, 200, 255];
const NONE: [u8; 4] = [0; 4];

/// Systems that observe must not be in an ambiguous order.
fn raster_world() -> World {
    let mut app = headless_app();
    app.edit_schedule(ObserveSchedule, |schedule| {
        schedule.set_build_settings(ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() });
    });
    app.add_plugins(RasterPlugin);
    into_world(app)
}

fn spawn_eye(world: &mut World, target: Entity, width: f32, size: [u32; 2]) -> Entity {
    let options = ImageOptions { width: size[0], height: size[1], ..default() };
    let sensor = RasterSensor::following(target, width, options);
    world.spawn((Agent::new(0, ActionSpace::Discrete(2)), Control::Human, sensor)).id()
}

/// A World with an eye over the origin that sees a unit in each pixel.
fn looking(size: [u32; 2]) -> (World, Entity) {
    let mut world = raster_world();
    let target = world.spawn(Transform::default()).id();
    let eye = spawn_eye(&mut world, target, size[0] as f32, size);
    (world, eye)
}

fn add(world: &mut World, width: u32, texels: &[[u8; 4]]) -> Handle<Image> {
    world.resource_mut::<Assets<Image>>().add(image(width, texels))
}

/// A sprite with red and green above, blue and white below, one unit for each.
fn four(world: &mut World) -> Sprite {
    Sprite::from_image(add(world, 2, &[RED, GREEN, BLUE, WHITE]))
}

/// The picture as text: a letter for each pixel, `.` for black and `?` for what is none of the colours.
fn text(world: &mut World, eye: Entity) -> String {
    world.tick().expect("sound");
    let options = world.get::<bevy_playbot::vision::ImageSensor>(eye).expect("a sensor").0;
    let letter = |pixel: [u8; 3]| match pixel {
        [255, 0, 0] => 'R',
        [0, 255, 0] => 'G',
        [0, 0, 255] => 'B',
        [255, 255, 255] => 'W',
        [0, 0, 0] => '.',
        _ => '?',
    };
    let row = |y| (0..options.width).map(|x| letter(pixel(world, eye, x, y))).collect::<String>();
    (0..options.height).map(row).collect::<Vec<_>>().join("/")
}

fn frame(world: &mut World, eye: Entity) -> Vec<[u8; 4]> {
    world.tick().expect("sound");
    world.get::<Frame>(eye).expect("an eye").pixels.clone()
}

fn fault(world: &mut World) -> String {
    world.tick().expect_err("it cannot be drawn").to_string()
}

#[test]
fn a_sprite_lies_in_the_middle() {
    let (mut world, eye) = looking([4, 4]);
    let sprite = four(&mut world);
    world.spawn(sprite);
    assert_eq!(text(&mut world, eye), "..../.RG./.BW./....");
    assert_eq!(world.get::<Frame>(eye).expect("an eye").tick, Some(1));
}

#[test]
fn flips_turn_a_sprite_around() {
    for (flips, expected) in [([true, false], "GR/WB"), ([false, true], "BW/RG"), ([true, true], "WB/GR")] {
        let (mut world, eye) = looking([2, 2]);
        let [flip_x, flip_y] = flips;
        let sprite = Sprite { flip_x, flip_y, ..four(&mut world) };
        world.spawn(sprite);
        assert_eq!(text(&mut world, eye), expected);
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
        let (mut world, eye) = looking([4, 4]);
        let sprite = four(&mut world);
        world.spawn((sprite, place));
        assert_eq!(text(&mut world, eye), expected, "{place:?}");
    }
}

#[test]
fn rotation_by_an_eighth_makes_a_diamond() {
    let (mut world, eye) = looking([6, 6]);
    let colour = Sprite::from_color(Color::WHITE, Vec2::splat(4.0));
    world.spawn((colour, Transform::from_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_4))));
    // Half a diagonal is 2.83: centres at a distance |x| + |y| below it are inside.
    assert_eq!(text(&mut world, eye), "....../..WW../.WWWW./.WWWW./..WW../......");
}

#[test]
fn anchors_sizes_and_rectangles() {
    let (mut world, eye) = looking([4, 4]);
    let sprite = four(&mut world);
    let entity = world.spawn((sprite.clone(), Anchor::BOTTOM_LEFT)).id();
    assert_eq!(text(&mut world, eye), "..RG/..BW/..../....");
    world.entity_mut(entity).insert(Anchor(Vec2::new(0.5, 0.0)));
    assert_eq!(text(&mut world, eye), "..../RG../BW../....");
    world
        .entity_mut(entity)
        .insert((Sprite { custom_size: Some(Vec2::new(4.0, 2.0)), ..sprite.clone() }, Anchor::CENTER));
    assert_eq!(text(&mut world, eye), "..../RRGG/BBWW/....");
    let rect = Some(Rect::new(1.0, 0.0, 2.0, 2.0));
    world.entity_mut(entity).insert((Sprite { rect, ..sprite.clone() }, Anchor::BOTTOM_LEFT));
    assert_eq!(text(&mut world, eye), "..G./..W./..../....");
    world.entity_mut(entity).insert(Sprite { rect, custom_size: Some(Vec2::splat(2.0)), ..sprite });
    assert_eq!(text(&mut world, eye), "..GG/..WW/..../....");
}

#[test]
fn an_atlas_gives_sections_and_a_rectangle_counts_within() {
    let (mut world, eye) = looking([2, 2]);
    let image = add(&mut world, 4, &[RED, RED, GREEN, BLUE, RED, RED, WHITE, GREEN]);
    let layout = TextureAtlasLayout::from_grid(UVec2::splat(2), 2, 1, None, None);
    let layout = world.resource_mut::<Assets<TextureAtlasLayout>>().add(layout);
    let mut sprite = Sprite::from_atlas_image(image, TextureAtlas { layout, index: 1 });
    let entity = world.spawn(sprite.clone()).id();
    assert_eq!(text(&mut world, eye), "GB/WG");
    sprite.rect = Some(Rect::new(0.0, 1.0, 2.0, 2.0));
    sprite.custom_size = Some(Vec2::splat(2.0));
    world.entity_mut(entity).insert(sprite.clone());
    assert_eq!(text(&mut world, eye), "WG/WG");
    sprite.texture_atlas.as_mut().expect("set").index = 9;
    world.entity_mut(entity).insert((sprite, Name::new("walker")));
    let fault = fault(&mut world);
    assert!(fault.contains("no section 9") && fault.contains("walker"), "{fault}");
}

#[test]
fn the_nearest_is_on_top_and_equals_keep_their_order() {
    let (mut world, eye) = looking([1, 1]);
    let plain = |colour| Sprite::from_color(colour, Vec2::ONE);
    let red = world.spawn((plain(Color::srgb(1.0, 0.0, 0.0)), Transform::from_xyz(0.0, 0.0, 1.0))).id();
    let blue = world.spawn((plain(Color::srgb(0.0, 0.0, 1.0)), Transform::from_xyz(0.0, 0.0, -1.0))).id();
    assert_eq!(text(&mut world, eye), "R");
    world.get_mut::<Transform>(blue).expect("there").translation.z = 1.0;
    assert_eq!(text(&mut world, eye), "B", "the later one of two that are equally near");
    world.get_mut::<Transform>(blue).expect("there").translation.z = -0.0;
    world.get_mut::<Transform>(red).expect("there").translation.z = 0.0;
    assert_eq!(text(&mut world, eye), "B", "zero has no sign");
    world.entity_mut(blue).insert(Visibility::Hidden);
    assert_eq!(text(&mut world, eye), "R");
}

#[test]
fn what_is_hidden_hides_its_children_unless_they_will_be_seen() {
    let (mut world, eye) = looking([2, 1]);
    let parent = world.spawn((Transform::from_xyz(0.5, 0.0, 0.0), Visibility::Hidden)).id();
    let white = || Sprite::from_color(Color::WHITE, Vec2::ONE);
    let child = world.spawn((white(), ChildOf(parent))).id();
    assert_eq!(text(&mut world, eye), "..");
    world.entity_mut(child).insert(Visibility::Visible);
    assert_eq!(text(&mut world, eye), ".W", "children stand where their parents do");
    world.entity_mut(child).insert((Transform::from_xyz(-1.0, 0.0, 0.0), Visibility::Inherited));
    world.entity_mut(parent).insert(Visibility::Inherited);
    assert_eq!(text(&mut world, eye), "W.");
}

#[test]
fn tint_and_half_transparency_are_mixed_in_linear_light() {
    let (mut world, eye) = looking([1, 1]);
    let grey = add(&mut world, 1, &[GREY]);
    let entity = world.spawn(Sprite { color: Color::srgb(0.5, 1.0, 0.0), ..Sprite::from_image(grey) }).id();
    // 200 is 0.57758 of the light, 0.5 is 0.21404: together 0.12362, which is 99.
    assert_eq!(frame(&mut world, eye), [[99, 200, 0, 255]]);
    let half = Sprite::from_color(Color::srgba(1.0, 1.0, 1.0, 0.5), Vec2::ONE);
    let over = world.spawn((half, Transform::from_xyz(0.0, 0.0, 1.0))).id();
    // Half of that and half of white: 0.56239, 0.78879 and 0.5.
    assert_eq!(frame(&mut world, eye), [[198, 230, 188, 255]]);
    world.despawn(entity);
    let glass = add(&mut world, 1, &[[255, 0, 0, 51]]);
    world.entity_mut(over).insert(Sprite::from_image(glass));
    world.insert_resource(ClearColor(Color::srgb(0.0, 0.0, 1.0)));
    // A fifth of red over blue: 0.2 is 124, 0.8 is 231.
    assert_eq!(frame(&mut world, eye), [[124, 0, 231, 255]]);
}

#[test]
fn holes_show_what_lies_behind() {
    let (mut world, eye) = looking([2, 1]);
    let holes = add(&mut world, 2, &[NONE, RED]);
    world.spawn((Sprite::from_image(holes), Transform::from_xyz(0.0, 0.0, 1.0)));
    world.spawn(Sprite::from_color(Color::srgb(0.0, 0.0, 1.0), Vec2::new(2.0, 1.0)));
    assert_eq!(text(&mut world, eye), "BR");
}

#[test]
fn tiles_fill_cells_and_the_outside() {
    let (mut world, eye) = looking([6, 4]);
    // Tile 0 is red over green, tile 1 has a hole, and a faint texel that does not count, and tile 2 is white.
    let strip = [RED, RED, GREEN, GREEN, BLUE, NONE, [0, 0, 255, 127], [0, 0, 255, 128], WHITE, WHITE, WHITE, WHITE];
    let tileset = add(&mut world, 2, &strip);
    let cells = vec![0, TileLayer::EMPTY, 1, 0];
    let layer = TileLayer { tileset, columns: 2, rows: 2, cells, outside: 2 };
    let entity = world.spawn((layer, Transform::from_xyz(-2.0, -2.0, 0.0).with_scale(Vec3::splat(2.0)))).id();
    assert_eq!(text(&mut world, eye), "WB.RRW/W.BGGW/WRR..W/WGG..W");
    world.get_mut::<TileLayer>(entity).expect("there").outside = TileLayer::EMPTY;
    world.get_mut::<Transform>(entity).expect("there").scale = Vec3::splat(1.0);
    // One texel in four is seen: the one under the centre, which belongs to the right and to the bottom.
    assert_eq!(text(&mut world, eye), "....../....../.BG.../.G....");
    let mut place = world.get_mut::<Transform>(entity).expect("there");
    *place = Transform::from_xyz(2.0, 2.0, 0.0).with_scale(Vec3::splat(-2.0));
    assert_eq!(text(&mut world, eye), "...GG./...RR./.GGB../.RR.B.", "upside down");
    *world.get_mut::<Transform>(entity).expect("there") = Transform::from_xyz(2.0, -2.0, 0.0)
        .with_scale(Vec3::splat(2.0))
        .with_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_2));
    assert_eq!(text(&mut world, eye), ".RG.../.RG.../..BRG./.B.RG.", "turned left");
}

#[test]
fn pictures_of_odd_sizes() {
    for size in [[1, 1], [3, 5], [7, 2], [84, 84], [5, 1]] {
        let (mut world, eye) = looking(size);
        let white = add(&mut world, 1, &[WHITE]);
        let width = (size[0] as f32 - 1.9).max(0.1);
        world.spawn(Sprite { custom_size: Some(Vec2::new(width, 99.0)), ..Sprite::from_image(white) });
        let pixels = frame(&mut world, eye);
        assert_eq!(pixels.len(), (size[0] * size[1]) as usize);
        let row: Vec<bool> = pixels[..size[0] as usize].iter().map(|pixel| *pixel == WHITE).collect();
        let expected: Vec<bool> = (0..size[0]).map(|x| size[0] == 1 || (x > 0 && x + 1 < size[0])).collect();
        assert_eq!(row, expected, "{size:?}");
    }
}

#[test]
fn an_image_that_changes_is_seen_to_change() {
    let (mut world, eye) = looking([2, 2]);
    let sprite = four(&mut world);
    let handle = sprite.image.clone();
    world.spawn(sprite);
    assert_eq!(text(&mut world, eye), "RG/BW");
    let mut images = world.resource_mut::<Assets<Image>>();
    images.get_mut(&handle).expect("there").data.as_mut().expect("loaded")[..4].copy_from_slice(&WHITE);
    assert_eq!(text(&mut world, eye), "WG/BW");
}

/// A stage with a sprite, an agent and, on a stage of its own inside, something that nobody else sees.
fn spawn_stage(world: &mut World, index: u32, place: Transform, sprite: &Sprite) -> Entity {
    let stage = world.spawn((Stage, place)).id();
    let holder = world.spawn((Transform::from_xyz(10.0, 20.0, 0.0), ChildOf(stage))).id();
    world.spawn((sprite.clone(), Transform::from_xyz(0.3, 0.4, 0.0), ChildOf(holder)));
    let inner = world.spawn((Stage, ChildOf(stage), Transform::from_xyz(10.0, 20.0, 5.0))).id();
    world.spawn((Sprite::from_color(Color::WHITE, Vec2::splat(9.0)), ChildOf(inner)));
    let agent = (Agent::new(index, ActionSpace::Discrete(2)), Control::Human, Transform::from_xyz(0.1, -0.1, 0.0));
    let agent = world.spawn((agent, ChildOf(holder))).id();
    let options = ImageOptions { width: 16, height: 16, ..default() };
    world.entity_mut(agent).insert(RasterSensor::following(agent, 3.3, options));
    agent
}

#[test]
fn a_picture_does_not_depend_on_where_its_stage_stands() {
    let mut world = raster_world();
    let sprite = four(&mut world);
    world.spawn(Sprite::from_color(Color::WHITE, Vec2::splat(1e6)));
    let places = [
        Transform::default(),
        Transform::from_xyz(1e7, -3.3, 2.0),
        Transform::from_rotation(Quat::from_rotation_z(1.0)).with_scale(Vec3::splat(7.0)),
    ];
    let agents: Vec<_> =
        (0..).zip(places).map(|(index, place)| spawn_stage(&mut world, index, place, &sprite)).collect();
    let first = frame(&mut world, agents[0]);
    for colour in [RED, GREEN, BLUE, WHITE, [0, 0, 0, 255]] {
        assert!(first.contains(&colour), "{colour:?} is covered by what is on another stage, or on none");
    }
    for agent in &agents[1..] {
        assert_eq!(world.get::<Frame>(*agent).expect("an eye").pixels, first);
    }
    // Whoever stands on no stage sees what stands on none.
    let target = world.spawn(Transform::default()).id();
    let outside = spawn_eye(&mut world, target, 10.0, [4, 4]);
    assert_eq!(frame(&mut world, outside), [WHITE; 16]);
}

#[test]
fn idle_agents_are_not_looked_after() {
    let (mut world, eye) = looking([1, 1]);
    world.entity_mut(eye).insert(Control::Idle);
    world.spawn(Sprite::default());
    world.tick().expect("nobody looks at what cannot be drawn");
    assert_eq!(*world.get::<Frame>(eye).expect("an eye"), Frame::default());
}

/// An image without a single texel.
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
        let (mut world, eye) = looking([4, 4]);
        world.tick().expect("sound so far");
        let mut options = ImageOptions { width: 4, height: 4, ..default() };
        let mut sensor = *world.get::<RasterSensor>(eye).expect("an eye");
        spoil(&mut sensor, &mut options);
        world.entity_mut(eye).insert((sensor, bevy_playbot::vision::ImageSensor(options)));
        let fault = fault(&mut world);
        for part in [what, "agent 0, level 0, tick 1"] {
            assert!(fault.contains(part), "`{part}` is missing in: {fault}");
        }
    }
}
