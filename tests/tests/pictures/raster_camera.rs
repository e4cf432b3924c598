//! Tests of the raster against Bevy's renderer.

use bevy::{
    prelude::*,
    sprite::{Anchor, SpriteScalingMode},
};
use bevy_playbot::{
    camera::{CameraSensor, TileBorder},
    engine::PictureDifference,
    raster::{RasterPlugin, RasterSensor},
    vision::{Frame, ImageOptions, TileLayer},
};
use playbot::prelude::*;
use playbot_games::{
    ant::{Ant, walk::Walker},
    coinrun::{CoinRun, picture::VIEW},
};
use playbot_tests::scene::{camera_world, draw, image, spawn_sensor};

/// Returns a World with a camera and a raster with the same view, each an agent.
fn both_sensors(width: f32, size: [u32; 2]) -> (World, [Entity; 2]) {
    let mut world = camera_world(|app| {
        app.add_plugins(RasterPlugin);
    });
    let target = world.spawn(Transform::from_xyz(0.3, -0.2, 0.0)).id();
    let camera = spawn_sensor(&mut world, 0, target, width, size);
    let options = ImageOptions { width: size[0], height: size[1], ..default() };
    let sensor = RasterSensor::following(target, width, options);
    let raster = world.spawn((Agent::new(1, ActionSpace::Discrete(2)), Control::Human, sensor)).id();
    (world, [camera, raster])
}

/// Returns the difference between the frames of two agents.
fn difference(world: &World, one: Entity, other: Entity) -> PictureDifference {
    let [one, other] = [one, other].map(|agent| &world.get::<Frame>(agent).expect("a sensor").pixels);
    PictureDifference::between(one, other).expect("they have one size")
}

/// The mean difference of many pictures.
#[derive(Debug, Default)]
struct Total {
    mean: f64,
    close: f64,
    pictures: f64,
}

impl Total {
    fn add(&mut self, difference: PictureDifference) {
        self.mean += difference.mean;
        self.close += difference.close;
        self.pictures += 1.0;
    }

    fn check(&self) {
        let (mean, close) = (self.mean / self.pictures, self.close / self.pictures);
        assert!(mean <= 0.5 && close >= 0.995, "mean difference {mean}/255, {close} of the pixels are close");
    }
}

/// A generator of numbers in a range.
struct Dice(u64);

impl Dice {
    fn number(&mut self, from: f32, to: f32) -> f32 {
        from + (to - from) * draw(&mut self.0, 10_000) as f32 / 10_000.0
    }

    fn point(&mut self, reach: f32) -> Vec2 {
        Vec2::new(self.number(-reach, reach), self.number(-reach, reach))
    }

    fn often(&mut self, of: u64) -> bool {
        draw(&mut self.0, of) == 0
    }
}

/// Returns a sprite with random values of all fields.
fn sprite(dice: &mut Dice, images: &[Handle<Image>], layout: &Handle<TextureAtlasLayout>) -> impl Bundle {
    let mut sprite = Sprite::from_image(images[draw(&mut dice.0, images.len() as u64) as usize].clone());
    (sprite.flip_x, sprite.flip_y) = (dice.often(2), dice.often(2));
    if dice.often(2) {
        sprite.color = Color::srgba(
            dice.number(0.0, 1.0),
            dice.number(0.0, 1.0),
            dice.number(0.0, 1.2),
            if dice.often(2) { 1.0 } else { dice.number(0.0, 1.0) },
        );
    }
    if dice.often(3) {
        sprite.texture_atlas = Some(TextureAtlas { layout: layout.clone(), index: draw(&mut dice.0, 4) as usize });
    }
    if dice.often(3) {
        sprite.rect = Some(Rect::new(1.0, 0.0, 3.0 + draw(&mut dice.0, 2) as f32, 3.0));
    }
    if dice.often(2) {
        sprite.custom_size = Some(dice.point(3.0).abs() + 0.5);
        use SpriteScalingMode::*;
        let modes = [FillStart, FillCenter, FillEnd, FitStart, FitCenter, FitEnd];
        if dice.often(2) {
            sprite.image_mode = SpriteImageMode::Scale(modes[draw(&mut dice.0, 6) as usize]);
        }
    }
    let mut place = Transform::from_translation(dice.point(6.0).extend(dice.number(-5.0, 5.0)));
    place.scale = Vec3::new(dice.number(-1.5, 1.5), dice.number(-1.5, 1.5), 1.0);
    if dice.often(3) {
        let axis = Quat::from_xyzw(0.0, 0.0, dice.number(-1.0, 1.0), dice.number(-1.0, 1.0));
        place.rotation = axis.normalize();
    }
    let visibility = if dice.often(8) { Visibility::Hidden } else { Visibility::Inherited };
    (sprite, Anchor(dice.point(0.7)), place, visibility)
}

fn noise(dice: &mut Dice, alpha: impl Fn(&mut Dice) -> u8) -> Image {
    let texels: Vec<[u8; 4]> = (0..64)
        .map(|_| {
            let [red, green, blue] = [(); 3].map(|()| draw(&mut dice.0, 256) as u8);
            [red, green, blue, alpha(dice)]
        })
        .collect();
    image(8, &texels)
}

#[test]
fn sprites_of_all_kinds_look_the_same() {
    let (mut world, [camera, raster]) = both_sensors(13.0, [64, 48]);
    let dice = &mut Dice(1);
    let pictures = [noise(dice, |_| 255), noise(dice, |dice| 255 * draw(&mut dice.0, 2) as u8), {
        noise(dice, |dice| draw(&mut dice.0, 256) as u8)
    }];
    let images = pictures.map(|picture| world.resource_mut::<Assets<Image>>().add(picture));
    let layout = TextureAtlasLayout::from_grid(UVec2::splat(4), 2, 2, None, None);
    let layout = world.resource_mut::<Assets<TextureAtlasLayout>>().add(layout);
    let mut total = Total::default();
    for round in 0..60 {
        let mut spawned = Vec::new();
        for _ in 0..12 {
            let made = sprite(dice, &images, &layout);
            let mut entity = world.spawn(made);
            match spawned.last() {
                Some(&parent) if dice.often(4) => entity.insert(ChildOf(parent)),
                _ => &mut entity,
            };
            spawned.push(entity.id());
        }
        world.tick().expect("sound");
        let difference = difference(&world, camera, raster);
        assert!(difference.close > 0.98, "round {round}: {difference:?}");
        total.add(difference);
        for entity in spawned.into_iter().rev() {
            world.despawn(entity);
        }
    }
    total.check();
}

#[test]
fn tiles_look_the_same() {
    let (mut world, [camera, raster]) = both_sensors(13.0, [64, 64]);
    // The raster draws the outside as far as its view reaches.
    world.insert_resource(TileBorder(40.0));
    let dice = &mut Dice(2);
    let tiles = noise(dice, |dice| draw(&mut dice.0, 256) as u8);
    let mut strip = image(4, &[[0; 4]; 16]);
    strip.data = tiles.data.clone();
    strip.texture_descriptor.size.height = 16;
    let tileset = world.resource_mut::<Assets<Image>>().add(strip);
    let mut total = Total::default();
    for round in 0..40 {
        let number = |dice: &mut Dice| [0, 1, 2, 3, TileLayer::EMPTY][draw(&mut dice.0, 5) as usize];
        let (columns, rows) = (7, 5);
        let cells = (0..columns * rows).map(|_| number(dice)).collect();
        let layer = TileLayer { tileset: tileset.clone(), columns, rows, cells, outside: number(dice) };
        let mut place = Transform::from_translation(dice.point(6.0).extend(-1.0));
        place.scale = Vec3::new(dice.number(0.5, 2.0), dice.number(0.5, 2.0), 1.0);
        if dice.often(3) {
            place.rotation = Quat::from_xyzw(0.0, 0.0, dice.number(-1.0, 1.0), 1.0).normalize();
        }
        let layer = world.spawn((layer, place)).id();
        world.tick().expect("sound");
        let difference = difference(&world, camera, raster);
        assert!(difference.close > 0.98, "round {round}: {difference:?}");
        total.add(difference);
        world.despawn(layer);
    }
    total.check();
}

#[test]
fn a_grid_without_cells_is_its_outside() {
    let (mut world, [camera, raster]) = both_sensors(13.0, [64, 48]);
    let dice = &mut Dice(3);
    let texels: Vec<[u8; 4]> = (0..32).map(|_| [(); 4].map(|()| draw(&mut dice.0, 256) as u8 | 128)).collect();
    let tileset = world.resource_mut::<Assets<Image>>().add(image(4, &texels));
    let layer = world.spawn(Transform::default()).id();
    for (columns, rows, outside) in [(0, 0, 1), (3, 0, 0), (0, 2, 1), (0, 0, TileLayer::EMPTY)] {
        for scale in [0.7, 4.0] {
            let mut place = Transform::from_translation((dice.point(0.5) * scale).extend(-1.0));
            place.scale = Vec3::new(scale, scale, 1.0);
            let grid = TileLayer { tileset: tileset.clone(), columns, rows, cells: Vec::new(), outside };
            world.entity_mut(layer).insert((grid, place));
            world.tick().expect("nothing is wrong with it");
            let difference = difference(&world, camera, raster);
            assert!(difference.close > 0.98, "{columns} x {rows}, outside {outside}, scale {scale}: {difference:?}");
            let black = world.get::<Frame>(raster).expect("a sensor").pixels.iter().filter(|p| **p == [0, 0, 0, 255]);
            let expected = if outside == TileLayer::EMPTY { 64 * 48 } else { 0 };
            assert_eq!(black.count(), expected, "all of the picture, or nothing");
        }
    }
    // And cells may come and go.
    let cells = vec![0, 1, TileLayer::EMPTY, 0];
    world.entity_mut(layer).insert(TileLayer { tileset, columns: 2, rows: 2, cells, outside: 1 });
    world.tick().expect("sound");
    assert!(difference(&world, camera, raster).close > 0.98);
}

/// Plays an ant on the open floor before both sensors, for a number of ticks, and returns its distance.
fn ant_walks(world: &mut World, player: Entity, watcher: Entity, ticks: u32) -> f32 {
    let mut farthest = 0.0f32;
    let mut total = Total::default();
    for _ in 0..ticks {
        world.tick().expect("sound");
        let walker = world.get::<Walker>(player).expect("an ant");
        farthest = farthest.max(walker.body.torso().0.truncate().length());
        let seen = difference(world, player, watcher);
        assert!(seen.close > 0.97, "{seen:?}");
        total.add(seen);
    }
    total.check();
    farthest
}

#[test]
fn the_open_floor_of_the_ant_looks_the_same_and_has_no_edge() {
    let game = Ant;
    let mut world = camera_world(|app| {
        game.build(app, "goal");
        app.add_plugins(RasterPlugin);
        game.tools().pictures.build_picture(app);
    });
    let [player, other] = [0, 1].map(|index| game.spawn_agent(&mut world, index));
    let width = game.tools().pictures.picture().expect("it is drawn").width;
    let options = ImageOptions::default();
    for agent in [player, other] {
        let still = Action(ActionValue::Continuous(vec![0.0; 8]));
        let sensor = CameraSensor::following(agent, width, options);
        world.entity_mut(agent).insert((sensor, Control::Human, still, LevelQueue::Always(0)));
    }
    let sensor = RasterSensor::following(player, width, options);
    let watcher = world.spawn((Agent::new(2, ActionSpace::Discrete(2)), Control::Human, sensor)).id();
    assert!(ant_walks(&mut world, player, watcher, 5) < 2.0);
    // Far from its start.
    let mut walker = world.get_mut::<Walker>(player).expect("an ant");
    let mut state = walker.body.state();
    state.qpos[0] += 37.3;
    state.qpos[1] -= 61.9;
    walker.body.set_state(&state);
    assert!(ant_walks(&mut world, player, watcher, 5) > 70.0);
}

#[test]
fn coinrun_looks_the_same() {
    let game = CoinRun::default();
    let mut world = camera_world(|app| {
        game.build(app, "hard");
        app.add_plugins(RasterPlugin);
        game.tools().pictures.build_picture(app);
    });
    let player = game.spawn_agent(&mut world, 0);
    let options = ImageOptions::default();
    world.entity_mut(player).insert((CameraSensor::following(player, VIEW, options), Control::Bot, BlindBot::Uniform));
    let sensor = RasterSensor::following(player, VIEW, options);
    let watcher = world.spawn((Agent::new(1, ActionSpace::Discrete(2)), Control::Human, sensor)).id();
    let (mut total, mut worst) = (Total::default(), 0.0f64);
    for level in 0..50 {
        world.entity_mut(player).insert(LevelQueue::Always(level));
        world.get_mut::<Episode>(player).expect("an agent").abandon();
        for _ in 0..10 {
            world.tick().expect("sound");
            let difference = difference(&world, player, watcher);
            worst = worst.max(difference.mean);
            total.add(difference);
        }
    }
    total.check();
    assert!(worst <= 4.0, "{worst}");
}
