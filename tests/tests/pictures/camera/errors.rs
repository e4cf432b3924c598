//! Tests of errors about views that cannot be drawn.

use bevy::{
    camera::{ImageRenderTarget, RenderTarget},
    prelude::*,
    render::render_resource::TextureFormat,
};
use bevy_playbot::{
    camera::CameraSensor,
    engine::BlankEpisodes,
    vision::{ImageOptions, TileLayer},
};
use playbot::prelude::*;
use playbot_tests::scene::{camera_world, image, pixel, player, spawn_sensor};

#[track_caller]
fn fault(world: &mut World) -> String {
    world.tick().expect_err("something is wrong").to_string()
}

#[test]
fn sizes_that_cannot_be_are_refused() {
    let mut world = camera_world(|_| {});
    let target = world.spawn(Transform::default()).id();
    for (size, word) in [([0, 64], "width is 0"), ([64, 0], "height is 0"), ([64, 100_000], "height is 100000")] {
        let agent = spawn_sensor(&mut world, 3, target, 4.0, size);
        let fault = fault(&mut world);
        assert!(fault.starts_with("agent 3, level 0, tick ") && fault.contains(word), "{fault}");
        world.despawn(agent);
    }
    for width in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let agent = spawn_sensor(&mut world, 3, target, width, [8, 8]);
        let fault = fault(&mut world);
        assert!(fault.contains("world units wide"), "{fault}");
        world.despawn(agent);
    }
    spawn_sensor(&mut world, 3, target, 4.0, [64, 64]);
    world.tick().expect("sound");
}

#[test]
fn more_than_the_adapter_can_hold_is_refused() {
    let mut world = camera_world(|_| {});
    let target = world.spawn(Transform::default()).id();
    // A picture may have 1,024 pixels a side; adapters hold 8,192 or 16,384, or 32,768.
    for i in 0..1100 {
        spawn_sensor(&mut world, i, target, 4.0, [1024, 1024]);
    }
    let fault = fault(&mut world);
    assert!(fault.contains("pictures together are over the graphics adapter's limit"), "{fault}");
}

#[test]
fn a_target_that_is_gone_is_named() {
    let mut world = camera_world(|_| {});
    let (gone, there) = (world.spawn(Transform::default()).id(), world.spawn(Transform::default()).id());
    spawn_sensor(&mut world, 6, gone, 4.0, [8, 8]);
    let other = spawn_sensor(&mut world, 7, there, 4.0, [8, 8]);
    world.tick().expect("sound");
    world.despawn(gone);
    let fault = fault(&mut world);
    assert!(fault.contains("agent 6") && fault.contains(&format!("the target {gone}")), "{fault}");
    let frame = world.get::<bevy_playbot::vision::Frame>(other).expect("a frame");
    assert_eq!(frame.tick, Some(world.resource::<bevy_playbot::episode::Tick>().0), "others go on seeing");
}

/// The renderer of Bevy would stop for good at an image without pixels.
#[test]
fn a_camera_on_a_target_without_pixels_is_named_and_seeing_goes_on_once_it_is_gone() {
    let mut world = camera_world(|_| {});
    let red = world.resource_mut::<Assets<Image>>().add(image(1, &[[255, 0, 0, 255]]));
    let here =
        world.spawn((Sprite { image: red, custom_size: Some(Vec2::ONE), ..default() }, Transform::default())).id();
    let sensor = spawn_sensor(&mut world, 0, here, 4.0, [8, 8]);
    world.tick().expect("sound");
    let screen = |world: &mut World, [width, height]: [u32; 2]| {
        let screen = Image::new_target_texture(width, height, TextureFormat::Rgba8UnormSrgb, None);
        world.resource_mut::<Assets<Image>>().add(screen)
    };
    for size in [[0, 0], [0, 50], [100, 0]] {
        for is_image in [true, false] {
            let handle = is_image.then(|| screen(&mut world, size));
            let target = match &handle {
                Some(handle) => RenderTarget::Image(ImageRenderTarget { handle: handle.clone(), scale_factor: 1.0 }),
                None => RenderTarget::None { size: size.into() },
            };
            let camera = world.spawn((Camera2d, target, Msaa::Off)).id();
            let options = ImageOptions { width: 8, height: 8, ..default() };
            let through = world.spawn((player(1), CameraSensor::of(camera, options))).id();
            for _ in 0..2 {
                let reported = fault(&mut world);
                let words = format!("the camera {camera} draws on a target of {}x{} pixels", size[0], size[1]);
                assert!(reported.contains(&words) && reported.starts_with("agent "), "{reported}");
            }
            world.despawn(camera);
            world.despawn(through);
            if let Some(handle) = handle {
                world.resource_mut::<Assets<Image>>().remove(&handle);
            }
            world.tick().expect("sound again");
            assert_eq!([pixel(&world, sensor, 4, 4), pixel(&world, sensor, 0, 0)], [[255, 0, 0], [0, 0, 0]]);
        }
    }
    // An image without a camera makes the renderer stop as well.
    let handle = screen(&mut world, [0, 0]);
    let target = RenderTarget::Image(ImageRenderTarget { handle, scale_factor: 1.0 });
    let camera = world.spawn((Camera2d, target, Msaa::Off)).id();
    let reported = fault(&mut world);
    assert!(reported.starts_with("agent 0, ") && reported.contains(&format!("the camera {camera}")), "{reported}");
}

#[test]
fn things_without_an_image_are_named() {
    let mut world = camera_world(|_| {});
    let target = world.spawn(Transform::default()).id();
    spawn_sensor(&mut world, 0, target, 4.0, [8, 8]);
    world.tick().expect("sound");
    let lost = world.resource::<AssetServer>().load("no/such/file.png");
    let sprite = world.spawn((Name::new("ghost"), Sprite::from_image(lost), Transform::default())).id();
    let reported = fault(&mut world);
    assert!(
        reported.contains("`ghost`") && reported.contains(&sprite.to_string()) && reported.contains("no/such/file.png"),
        "{reported}"
    );
    assert!(fault(&mut world).contains("`ghost`"), "as long as it is so");
    world.despawn(sprite);
    world.tick().expect("sound again");
    let soon_gone = world.resource_mut::<Assets<Image>>().add(image(1, &[[1, 2, 3, 255]]));
    let layer = TileLayer { tileset: soon_gone.clone(), columns: 1, rows: 1, cells: vec![0], outside: 0 };
    let layer = world.spawn((layer, Transform::default())).id();
    world.tick().expect("sound");
    world.resource_mut::<Assets<Image>>().remove(&soon_gone);
    let reported = fault(&mut world);
    assert!(reported.contains(&format!("tile layer {layer} has no image")), "{reported}");
    world.entity_mut(layer).insert(TileLayer { tileset: default(), columns: 2, rows: 2, cells: vec![0], outside: 0 });
    let reported = fault(&mut world);
    assert!(reported.contains("has 1 cells; with 2 columns and 2 rows"), "{reported}");
    // As many as there should be.
    world.entity_mut(layer).insert(TileLayer { tileset: default(), columns: 0, rows: 2, cells: vec![], outside: 0 });
    world.tick().expect("a grid without cells");
}

/// Bevy would draw it as a white dot.
#[test]
fn a_sprite_without_an_image_is_named_and_a_rectangle_of_one_colour_is_drawn() {
    let mut world = camera_world(|_| {});
    let target = world.spawn(Transform::default()).id();
    let sensor = spawn_sensor(&mut world, 0, target, 4.0, [8, 8]);
    let blank = (Name::new("ghost"), Sprite::default(), Transform::default(), Visibility::Hidden);
    let blank = world.spawn(blank).id();
    world.tick().expect("what is hidden needs no image");
    for _ in 0..2 {
        world.entity_mut(blank).insert(Visibility::Visible);
        let reported = fault(&mut world);
        for part in ["sprite", &blank.to_string(), "`ghost`", "has no image", "custom_size"] {
            assert!(reported.contains(part), "`{part}` is missing in: {reported}");
        }
    }
    world.entity_mut(blank).insert(Sprite::from_color(Color::srgb_u8(200, 40, 90), Vec2::splat(2.0)));
    world.tick().expect("a rectangle");
    assert_eq!([pixel(&world, sensor, 4, 4), pixel(&world, sensor, 0, 0)], [[200, 40, 90], [0, 0, 0]]);
    world.entity_mut(blank).insert(Sprite::from_color(Color::WHITE, Vec2::splat(2.0)));
    world.tick().expect("white as well");
    assert_eq!(pixel(&world, sensor, 4, 4), [255; 3]);
}

fn five_ticks(mut agents: Query<&mut Episode>) {
    for mut episode in &mut agents {
        if episode.tick >= 4 {
            episode.truncate();
        }
    }
}

#[test]
fn a_camera_that_sees_nothing_is_counted() {
    let mut world = camera_world(|app| {
        app.add_systems(FixedUpdate, five_ticks);
    });
    let red = world.resource_mut::<Assets<Image>>().add(image(1, &[[255, 0, 0, 255]]));
    world.spawn((Sprite { image: red, custom_size: Some(Vec2::ONE), ..default() }, Transform::default()));
    let here = world.spawn(Transform::default()).id();
    let far = world.spawn(Transform::from_xyz(1000.0, 0.0, 0.0)).id();
    let play = (Control::Bot, BlindBot::Uniform);
    let [seeing, blind] = [(0, here), (1, far)].map(|(i, target)| {
        let agent = spawn_sensor(&mut world, i, target, 4.0, [8, 8]);
        world.entity_mut(agent).insert(play.clone());
        agent
    });
    let mut reported = Vec::new();
    for _ in 0..15 {
        reported.extend(world.tick().err().map(|fault| fault.to_string()));
    }
    assert!(
        reported.iter().all(|reported| reported.starts_with("agent 1,") && reported.contains("a single colour")),
        "{reported:?}"
    );
    assert_eq!(reported.len(), 3, "once for each episode: {reported:?}");
    let count = |world: &World, agent| world.get::<BlankEpisodes>(agent).expect("it has a sensor").episodes;
    assert_eq!((count(&world, seeing), count(&world, blind)), (0, 3));
    // It comes into view in the middle of an episode: that one is not blank.
    world.ticks(2).expect("sound");
    world.entity_mut(far).insert(Transform::default());
    world.ticks(8).expect("sound");
    assert_eq!(count(&world, blind), 3);
}
