//! Gem Hop: run to the flag, hop over pits and spikes, and take the gems on the way.
//!
//! Every level is drawn from its number. Arrow keys or A and D run, Space hops (a longer press hops higher). R plays
//! again, or the next level after a flag. One unit is one tile.

use bevy::{camera::ScalingMode, prelude::*};
use bevy_rapier2d::prelude::*;
use chacha20::ChaCha8Rng;
use leafwing_input_manager::prelude::*;
use rand::{RngExt, SeedableRng};

/// Columns of a level, the last of which lie behind the flag.
const COLUMNS: usize = 76;
const FLAG_COLUMN: usize = COLUMNS - 12;
/// Half of the hero's width and height.
const HERO: Vec2 = Vec2::new(0.35, 0.45);
const RUN_SPEED: f32 = 6.0;
const HOP_SPEED: f32 = 14.0;
const ACCELERATION: f32 = 60.0;
const GRAVITY: f32 = 42.0;
/// Seconds after an edge in which a hop is still possible.
const COYOTE_TIME: f32 = 0.08;
/// Seconds to reach the flag.
const TIME_LIMIT: f32 = 25.0;

#[derive(States, Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum Screen {
    #[default]
    Loading,
    Playing,
    Won,
    Lost,
}

#[derive(Actionlike, Clone, Copy, PartialEq, Eq, Hash, Debug, Reflect)]
enum Move {
    Left,
    Right,
    Hop,
    Again,
}

/// The present level, or the next one to load.
#[derive(Resource, Default)]
pub struct Level(pub u64);

/// One column of the level: the height of its ground, 0 for a pit, and the object on it.
#[derive(Clone, Copy, Default)]
pub struct Column {
    pub ground: u8,
    pub spikes: bool,
    pub gem: bool,
}

#[derive(Resource, Default)]
pub struct Map {
    pub columns: Vec<Column>,
    built: usize,
}

/// Gems taken, and seconds left.
#[derive(Resource, Default)]
pub struct Run {
    pub gems: u32,
    time: f32,
}

#[derive(Component, Default)]
pub struct Hero {
    pub velocity: Vec2,
    pub coyote: f32,
}

/// An object that the hero can touch.
#[derive(Component, Clone, Copy)]
enum Thing {
    Gem(usize),
    Spikes,
    Flag,
}

/// Goes away with the level.
#[derive(Component)]
struct InLevel;

#[derive(Component)]
struct Hud;

pub fn game(app: &mut App) {
    app.add_plugins((RapierPhysicsPlugin::<NoUserData>::default(), InputManagerPlugin::<Move>::default()))
        .insert_resource(Time::<Fixed>::from_hz(60.0))
        .init_resource::<Level>()
        .init_resource::<Map>()
        .init_resource::<Run>()
        .init_state::<Screen>()
        .add_systems(Startup, setup)
        .add_systems(OnEnter(Screen::Loading), clear_level)
        .add_systems(Update, load_level.run_if(in_state(Screen::Loading)))
        .add_systems(FixedUpdate, run_and_hop.run_if(in_state(Screen::Playing)))
        .add_systems(Update, (touch, watch_limits, follow, show_run).chain().run_if(in_state(Screen::Playing)))
        .add_systems(OnEnter(Screen::Won), |commands: Commands| banner(commands, Screen::Won, "The flag! R goes on"))
        .add_systems(OnEnter(Screen::Lost), |commands: Commands| banner(commands, Screen::Lost, "Ouch! R tries again"))
        .add_systems(Update, again.run_if(not(in_state(Screen::Loading))));
}

fn setup(mut commands: Commands) {
    let view = OrthographicProjection {
        scaling_mode: ScalingMode::FixedVertical { viewport_height: 14.0 },
        ..OrthographicProjection::default_2d()
    };
    commands.spawn((Camera2d, Projection::Orthographic(view)));
    commands.spawn((Hud, Text::default(), Node { position_type: PositionType::Absolute, ..default() }));
}

/// Draws a level from its number: now and then a pit, a step or spikes, and always some room before the next one.
fn draw_level(level: u64) -> Vec<Column> {
    let mut rng = ChaCha8Rng::seed_from_u64(level);
    let mut ground = 2;
    let mut columns = vec![Column { ground, ..default() }; 4];
    while columns.len() < FLAG_COLUMN - 5 {
        match rng.random_range(0..4) {
            0 => columns.extend(vec![Column::default(); rng.random_range(1..=2)]),
            1 => columns.push(Column { ground, spikes: true, gem: false }),
            2 => ground = (ground + rng.random_range(1..=2)).min(6),
            _ => ground = ground.saturating_sub(rng.random_range(1..=3)).max(1),
        }
        for _ in 0..rng.random_range(5..=7) {
            columns.push(Column { ground, spikes: false, gem: rng.random_bool(0.25) });
        }
    }
    columns.resize(COLUMNS, Column { ground, ..default() });
    columns
}

fn clear_level(mut commands: Commands, old: Query<Entity, With<InLevel>>, mut map: ResMut<Map>, mut run: ResMut<Run>) {
    old.iter().for_each(|entity| commands.entity(entity).despawn());
    *map = Map::default();
    *run = Run { gems: 0, time: TIME_LIMIT };
}

/// Builds a few columns a frame, so that loading a level never stalls the picture.
fn load_level(mut commands: Commands, level: Res<Level>, mut map: ResMut<Map>, mut next: ResMut<NextState<Screen>>) {
    if map.columns.is_empty() {
        map.columns = draw_level(level.0);
    }
    for _ in 0..12 {
        let Some(column) = map.columns.get(map.built) else {
            spawn_ground(&mut commands, &map.columns);
            spawn_hero(&mut commands, f32::from(map.columns[1].ground));
            return next.set(Screen::Playing);
        };
        spawn_column(&mut commands, map.built, *column);
        map.built += 1;
    }
}

fn spawn_column(commands: &mut Commands, index: usize, column: Column) {
    let (x, top) = (index as f32 + 0.5, f32::from(column.ground));
    if column.ground > 0 {
        let sprite = Sprite::from_color(Color::srgb(0.35, 0.55, 0.3), Vec2::new(1.0, top));
        commands.spawn((InLevel, sprite, Transform::from_xyz(x, top / 2.0, 0.0)));
    }
    let mut place = |thing: Thing, color: Color, half: Vec2, y: f32| {
        let sprite = Sprite::from_color(color, half * 2.0);
        let shape = (Collider::cuboid(half.x, half.y), Sensor, ActiveCollisionTypes::KINEMATIC_STATIC);
        commands.spawn((InLevel, thing, sprite, Transform::from_xyz(x, top + y, 1.0), shape));
    };
    if column.spikes {
        place(Thing::Spikes, Color::srgb(0.8, 0.2, 0.2), Vec2::new(0.3, 0.2), 0.2);
    }
    if column.gem {
        place(Thing::Gem(index), Color::srgb(0.3, 0.9, 0.9), Vec2::splat(0.2), 1.5);
    }
    if index == FLAG_COLUMN {
        place(Thing::Flag, Color::srgb(1.0, 0.8, 0.2), Vec2::new(0.1, 2.0), 2.0);
    }
}

/// Spawns one body without seams between columns of one height, over which the hero would trip.
fn spawn_ground(commands: &mut Commands, columns: &[Column]) {
    let mut right = 0.0;
    let runs = columns.chunk_by(|a, b| a.ground == b.ground).map(|run| {
        let half = Vec2::new(run.len() as f32, f32::from(run[0].ground)) / 2.0;
        right += run.len() as f32;
        (Vec2::new(right - half.x, half.y), 0.0, Collider::cuboid(half.x, half.y))
    });
    let ground = Collider::compound(runs.filter(|(center, ..)| center.y > 0.0).collect());
    commands.spawn((InLevel, Transform::default(), ground));
}

fn spawn_hero(commands: &mut Commands, ground: f32) {
    commands.spawn((
        InLevel,
        Hero::default(),
        Sprite::from_color(Color::srgb(0.9, 0.5, 0.2), HERO * 2.0),
        Transform::from_xyz(1.5, ground + HERO.y + 0.05, 2.0),
        (RigidBody::KinematicPositionBased, Collider::cuboid(HERO.x, HERO.y)),
        KinematicCharacterController { snap_to_ground: None, ..default() },
        (ActiveEvents::COLLISION_EVENTS, ActiveCollisionTypes::KINEMATIC_STATIC),
        InputMap::new([(Move::Left, KeyCode::ArrowLeft), (Move::Right, KeyCode::ArrowRight)])
            .with(Move::Left, KeyCode::KeyA)
            .with(Move::Right, KeyCode::KeyD)
            .with(Move::Hop, KeyCode::Space)
            .with(Move::Again, KeyCode::KeyR),
    ));
}

type Body<'a> = (
    &'a mut Hero,
    &'a mut KinematicCharacterController,
    Option<&'a KinematicCharacterControllerOutput>,
    &'a ActionState<Move>,
);

fn run_and_hop(time: Res<Time>, hero: Single<Body>) {
    let (mut hero, mut body, output, input) = hero.into_inner();
    let step = time.delta_secs();
    let grounded = output.is_some_and(|output| output.grounded);
    if let Some(output) = output {
        // Walls and ceilings stop the hero.
        let (wanted, got) = (output.desired_translation, output.effective_translation);
        if got.x.abs() < 0.5 * wanted.x.abs() {
            hero.velocity.x = 0.0;
        }
        if grounded || (wanted.y > 0.0 && got.y < 0.5 * wanted.y) {
            hero.velocity.y = hero.velocity.y.min(0.0).max(-GRAVITY * step);
        }
    }
    hero.coyote = if grounded { COYOTE_TIME } else { hero.coyote - step };

    let direction = f32::from(input.pressed(&Move::Right)) - f32::from(input.pressed(&Move::Left));
    let change = direction * RUN_SPEED - hero.velocity.x;
    hero.velocity.x += change.clamp(-ACCELERATION * step, ACCELERATION * step);
    hero.velocity.y -= GRAVITY * step;
    if input.pressed(&Move::Hop) && hero.coyote > 0.0 {
        hero.velocity.y = HOP_SPEED;
        hero.coyote = 0.0;
    } else if input.released(&Move::Hop) {
        hero.velocity.y = hero.velocity.y.min(HOP_SPEED / 2.0);
    }
    body.translation = Some(hero.velocity * step);
}

fn touch(
    mut commands: Commands,
    mut touched: MessageReader<CollisionEvent>,
    things: Query<(Entity, &Thing)>,
    mut map: ResMut<Map>,
    mut run: ResMut<Run>,
    mut next: ResMut<NextState<Screen>>,
) {
    for event in touched.read() {
        let CollisionEvent::Started(a, b, _) = *event else { continue };
        for (entity, thing) in things.iter_many([a, b]) {
            match *thing {
                Thing::Gem(index) => {
                    map.columns[index].gem = false;
                    run.gems += 1;
                    commands.entity(entity).despawn();
                }
                Thing::Spikes => next.set(Screen::Lost),
                Thing::Flag => next.set(Screen::Won),
            }
        }
    }
}

/// Ends the run of a hero that falls into a pit or is too slow.
fn watch_limits(time: Res<Time>, at: Single<&Transform, With<Hero>>, mut run: ResMut<Run>, mut commands: Commands) {
    run.time -= time.delta_secs();
    if at.translation.y < -1.0 || run.time < 0.0 {
        commands.set_state(Screen::Lost);
    }
}

fn follow(hero: Single<&Transform, With<Hero>>, mut camera: Single<&mut Transform, (With<Camera2d>, Without<Hero>)>) {
    camera.translation = Vec3::new(hero.translation.x.max(10.0), 5.0, 0.0);
}

fn show_run(run: Res<Run>, mut hud: Single<&mut Text, With<Hud>>) {
    let text = format!("Gems: {}   Time: {:.0}", run.gems, run.time);
    if hud.0 != text {
        hud.0 = text;
    }
}

fn banner(mut commands: Commands, screen: Screen, text: &str) {
    commands.spawn((DespawnOnExit(screen), Text::new(text), Node { margin: UiRect::all(auto()), ..default() }));
}

/// Loads the next level after the flag, and the same one after an accident or on a key.
fn again(input: Single<&ActionState<Move>>, on: Res<State<Screen>>, mut level: ResMut<Level>, mut commands: Commands) {
    if input.just_pressed(&Move::Again) {
        level.0 += u64::from(*on.get() == Screen::Won);
        commands.set_state(Screen::Loading);
    }
}
