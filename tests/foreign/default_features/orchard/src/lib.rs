//! Orchard: run through the orchard to the gate, and pick fruit on the way. Thorns and pits end the run.
//!
//! Arrow keys or A and D run, Space jumps. A level is a row of drawings in `assets/chunks`, which load when the level is
//! chosen. One unit is one tile.

mod level;

use avian2d::prelude::*;
use bevy::{camera::ScalingMode, prelude::*};

use level::{Chunk, ChunkLoader, Tile, chunks_of};

pub use level::Map;

/// The folder of the drawings, wherever the program is started.
pub const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets");

/// Radius of the hero's capsule, and the length between its ends.
const HERO: [f32; 2] = [0.3, 0.3];
/// The distance from the middle of the hero to its feet.
pub const FEET: f32 = HERO[0] + HERO[1] / 2.0;
/// Speed on the ground, tiles per second.
pub const RUN_SPEED: f32 = 6.5;
/// Upward speed of a jump, tiles per second.
pub const JUMP_SPEED: f32 = 13.0;
const ACCELERATION: f32 = 40.0;
const GRAVITY: f32 = 36.0;
/// Seconds after an edge in which a jump is still possible.
const COYOTE_TIME: f32 = 0.08;

/// The part of the game that is shown.
#[derive(States, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Screen {
    /// The menu with Play and Quit.
    #[default]
    Menu,
    /// The level's drawings are on their way.
    Loading,
    /// The hero runs.
    Playing,
    /// The hero is through the gate.
    Won,
    /// The hero has touched thorns, or is in a pit.
    Lost,
}

/// The number of the level that Play starts, and the drawings that it is made of.
#[derive(Resource, Default)]
pub struct Level {
    /// The number, from which the drawings follow.
    pub number: u64,
    chunks: Vec<Handle<Chunk>>,
}

/// The success of the present run.
#[derive(Resource, Default)]
pub struct Run {
    /// Fruit picked.
    pub fruit: u32,
    /// The farthest place, tiles from the left.
    pub distance: f32,
}

/// The player's figure.
#[derive(Component, Default)]
pub struct Hero {
    /// Seconds in which a jump is possible.
    pub coyote: f32,
}

/// The hero, with its place and its speed.
pub type Body = (&'static Transform, &'static LinearVelocity, &'static Hero);

/// An object that the hero can touch.
#[derive(Component, Clone, Copy, PartialEq, Eq)]
pub enum Thing {
    /// Counts once it is picked.
    Fruit,
    /// Ends the run.
    Thorns,
    /// Wins.
    Gate,
}

#[derive(PhysicsLayer, Clone, Copy, Default)]
enum Layer {
    #[default]
    Solid,
    Thing,
}

/// Goes away with the level.
#[derive(Component)]
struct InLevel;

#[derive(Component)]
struct Hud;

/// The effect of a button.
#[derive(Component, Clone, Copy)]
enum MenuButton {
    Play,
    Quit,
    Menu,
}

/// The game, without Bevy's own plugins.
pub fn game(app: &mut App) {
    app.add_plugins(PhysicsPlugins::default())
        .insert_resource(Gravity(Vec2::NEG_Y * GRAVITY))
        .init_asset::<Chunk>()
        .init_asset_loader::<ChunkLoader>()
        .init_resource::<Level>()
        .init_resource::<Map>()
        .init_resource::<Run>()
        .init_state::<Screen>()
        .add_systems(Startup, setup)
        .add_systems(OnEnter(Screen::Menu), (clear, open_menu).chain())
        .add_systems(OnEnter(Screen::Loading), load)
        .add_systems(OnEnter(Screen::Won), win)
        .add_systems(OnEnter(Screen::Lost), |commands: Commands| panel(commands, Screen::Lost, "Ouch!", &BACK))
        .add_systems(Update, (press, build.run_if(in_state(Screen::Loading))))
        .add_systems(FixedUpdate, run_and_jump.run_if(in_state(Screen::Playing)))
        .add_systems(Update, (watch, follow, show_run).chain().run_if(in_state(Screen::Playing)));
}

fn setup(mut commands: Commands) {
    let view = OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 10.0 },
        ..OrthographicProjection::default_2d()
    };
    commands.spawn((Camera2d, Projection::Orthographic(view)));
    commands.spawn((Hud, Text::default(), Node { position_type: PositionType::Absolute, ..default() }));
}

const BACK: [(MenuButton, &str); 1] = [(MenuButton::Menu, "Menu")];

fn open_menu(commands: Commands) {
    panel(commands, Screen::Menu, "Orchard", &[(MenuButton::Play, "Play"), (MenuButton::Quit, "Quit")]);
}

/// Shows a title and buttons until the screen is left.
fn panel(mut commands: Commands, screen: Screen, title: &str, buttons: &[(MenuButton, &str)]) {
    let column = Node {
        width: percent(100),
        height: percent(100),
        flex_direction: FlexDirection::Column,
        align_items: AlignItems::Center,
        justify_content: JustifyContent::Center,
        row_gap: px(20),
        ..default()
    };
    commands.spawn((DespawnOnExit(screen), column)).with_children(|column| {
        column.spawn((Text::new(title), TextFont::from_font_size(48.0)));
        for (button, label) in buttons {
            let node = Node {
                width: px(240),
                height: px(60),
                align_items: AlignItems::Center,
                justify_content: JustifyContent::Center,
                ..default()
            };
            let color = BackgroundColor(Color::srgb(0.25, 0.45, 0.25));
            column.spawn((*button, Button, node, color, children![Text::new(*label)]));
        }
    });
}

fn press(
    buttons: Query<(&Interaction, &MenuButton), Changed<Interaction>>,
    mut next: ResMut<NextState<Screen>>,
    mut exit: MessageWriter<AppExit>,
) {
    for (_, button) in buttons.iter().filter(|(interaction, _)| **interaction == Interaction::Pressed) {
        match button {
            MenuButton::Play => next.set(Screen::Loading),
            MenuButton::Menu => next.set(Screen::Menu),
            MenuButton::Quit => _ = exit.write(AppExit::Success),
        }
    }
}

fn win(commands: Commands, mut level: ResMut<Level>) {
    level.number += 1;
    panel(commands, Screen::Won, "Through the gate!", &BACK);
}

/// Takes the level down, with its drawings: each level loads as long as the first.
fn clear(
    mut commands: Commands,
    old: Query<Entity, With<InLevel>>,
    mut level: ResMut<Level>,
    mut map: ResMut<Map>,
    mut run: ResMut<Run>,
) {
    old.iter().for_each(|entity| commands.entity(entity).despawn());
    level.chunks.clear();
    *map = Map::default();
    *run = Run::default();
}

fn load(mut level: ResMut<Level>, server: Res<AssetServer>) {
    level.chunks = chunks_of(level.number).into_iter().map(|path| server.load(path)).collect();
}

/// Builds the level as soon as all of its chunks are there.
fn build(
    mut commands: Commands,
    level: Res<Level>,
    chunks: Res<Assets<Chunk>>,
    mut map: ResMut<Map>,
    mut next: ResMut<NextState<Screen>>,
) {
    let loaded: Vec<&Chunk> = level.chunks.iter().filter_map(|chunk| chunks.get(chunk)).collect();
    if loaded.len() < level.chunks.len() {
        return;
    }
    *map = Map::of(loaded);
    let earth = map.earth();
    let parts = earth.iter().map(|&(middle, width)| (middle, 0.0, Collider::rectangle(width, 1.0)));
    commands.spawn((InLevel, RigidBody::Static, Collider::compound(parts.collect()), Transform::default()));
    for (middle, width) in earth {
        let sprite = Sprite::from_color(Color::srgb(0.4, 0.3, 0.2), Vec2::new(width, 1.0));
        commands.spawn((InLevel, sprite, Transform::from_translation(middle.extend(0.0))));
    }
    for (tile, middle) in map.tiles() {
        match tile {
            Tile::Air | Tile::Earth => {}
            Tile::Thorns => {
                place(
                    &mut commands,
                    Thing::Thorns,
                    middle - Vec2::Y * 0.3,
                    Vec2::new(0.6, 0.4),
                    Color::srgb(0.7, 0.2, 0.3),
                );
            }
            Tile::Fruit => {
                place(&mut commands, Thing::Fruit, middle, Vec2::splat(0.5), Color::srgb(0.9, 0.7, 0.2));
            }
            Tile::Gate => {
                place(&mut commands, Thing::Gate, middle + Vec2::Y, Vec2::new(0.4, 3.0), Color::srgb(0.6, 0.5, 0.9));
            }
            Tile::Apple => spawn_apple(&mut commands, middle),
            Tile::Start => spawn_hero(&mut commands, middle + Vec2::Y * (FEET - 0.49)),
        }
    }
    next.set(Screen::Playing);
}

fn place(commands: &mut Commands, thing: Thing, middle: Vec2, size: Vec2, color: Color) {
    commands.spawn((
        InLevel,
        thing,
        Sprite::from_color(color, size),
        Transform::from_translation(middle.extend(1.0)),
        (RigidBody::Static, Collider::rectangle(size.x, size.y), Sensor),
        CollisionLayers::new(Layer::Thing, LayerMask::ALL),
    ));
}

fn spawn_apple(commands: &mut Commands, middle: Vec2) {
    commands.spawn((
        InLevel,
        Sprite::from_color(Color::srgb(0.9, 0.2, 0.2), Vec2::splat(0.4)),
        Transform::from_translation(middle.extend(1.0)),
        (RigidBody::Dynamic, Collider::circle(0.2), ColliderDensity(0.1), AngularDamping(1.0)),
    ));
}

fn spawn_hero(commands: &mut Commands, middle: Vec2) {
    let below = ShapeCaster::new(Collider::circle(0.9 * HERO[0]), Vec2::NEG_Y * HERO[1] / 2.0, 0.0, Dir2::NEG_Y);
    commands
        .spawn((
            InLevel,
            Hero::default(),
            Sprite::from_color(Color::srgb(0.2, 0.5, 0.9), Vec2::new(2.0 * HERO[0], 2.0 * FEET)),
            Transform::from_translation(middle.extend(2.0)),
            (RigidBody::Dynamic, Collider::capsule(HERO[0], HERO[1]), LockedAxes::ROTATION_LOCKED),
            Friction::ZERO.with_combine_rule(CoefficientCombine::Min),
            below.with_max_distance(0.1).with_query_filter(SpatialQueryFilter::from_mask(Layer::Solid)),
            CollisionEventsEnabled,
        ))
        .observe(touch);
}

fn run_and_jump(
    time: Res<Time>,
    keys: Res<ButtonInput<KeyCode>>,
    hero: Single<(&mut Hero, &mut LinearVelocity, &ShapeHits)>,
) {
    let (mut hero, mut velocity, below) = hero.into_inner();
    let step = time.delta_secs();
    let is_rising = velocity.y > 0.1;
    hero.coyote = if below.is_empty() || is_rising { hero.coyote - step } else { COYOTE_TIME };

    let right = keys.any_pressed([KeyCode::ArrowRight, KeyCode::KeyD]);
    let left = keys.any_pressed([KeyCode::ArrowLeft, KeyCode::KeyA]);
    let change = (f32::from(right) - f32::from(left)) * RUN_SPEED - velocity.x;
    velocity.x += change.clamp(-ACCELERATION * step, ACCELERATION * step);
    if keys.pressed(KeyCode::Space) && hero.coyote > 0.0 {
        velocity.y = JUMP_SPEED;
        hero.coyote = 0.0;
    }
}

fn touch(
    touched: On<CollisionStart>,
    mut commands: Commands,
    things: Query<&Thing>,
    screen: Res<State<Screen>>,
    mut run: ResMut<Run>,
    mut next: ResMut<NextState<Screen>>,
) {
    let Ok(thing) = things.get(touched.collider2) else { return };
    if **screen != Screen::Playing {
        return;
    }
    match thing {
        Thing::Fruit => {
            run.fruit += 1;
            commands.entity(touched.collider2).despawn();
        }
        Thing::Thorns => next.set(Screen::Lost),
        Thing::Gate => next.set(Screen::Won),
    }
}

/// Notes the distance, and ends the run of a hero that falls into a pit.
fn watch(at: Single<&Transform, With<Hero>>, mut run: ResMut<Run>, mut next: ResMut<NextState<Screen>>) {
    run.distance = run.distance.max(at.translation.x);
    if at.translation.y < -1.0 {
        next.set(Screen::Lost);
    }
}

fn follow(hero: Single<&Transform, With<Hero>>, mut camera: Single<&mut Transform, (With<Camera2d>, Without<Hero>)>) {
    camera.translation = Vec3::new(hero.translation.x.max(8.0), 4.0, 0.0);
}

fn show_run(run: Res<Run>, mut hud: Single<&mut Text, With<Hud>>) {
    let text = format!("Fruit: {}", run.fruit);
    if hud.0 != text {
        hud.0 = text;
    }
}
