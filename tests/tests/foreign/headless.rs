//! Tests of a game without its window: a picture from the disk, states, text, a mesh and a material; and the number of
//! Worlds that an evaluation builds.

use std::sync::{
    Arc,
    atomic::{AtomicUsize, Ordering},
};

use bevy::{
    app::PluginGroupBuilder,
    diagnostic::{FrameCount, FrameCountPlugin},
    prelude::*,
    render::{Render, RenderApp, RenderPlugin},
    window::PrimaryWindow,
    winit::WinitPlugin,
};
use bevy_playbot::headless::HeadlessPlugins;
use playbot::prelude::*;
use playbot_harness::{
    eval::{EvalPlan, Player, evaluate},
    foreign::{ForeignGame, Restart},
    worlds::{build_world, check_start},
};
use playbot_tests::measuring::plan;

#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Stage {
    #[default]
    Loading,
    Playing,
}

#[derive(Resource)]
struct Art(Handle<Image>);

#[derive(Component)]
struct Ball;

/// The game, as its author wrote it.
fn game(app: &mut App) {
    app.init_state::<Stage>()
        .add_systems(Startup, load)
        .add_systems(Update, begin.run_if(in_state(Stage::Loading)))
        .add_systems(OnEnter(Stage::Playing), spawn)
        .add_systems(Update, roll.run_if(in_state(Stage::Playing)));
}

fn load(server: Res<AssetServer>, mut commands: Commands) {
    commands.insert_resource(Art(server.load("maze2d/ball.png")));
}

fn begin(art: Res<Art>, images: Res<Assets<Image>>, mut next: ResMut<NextState<Stage>>) {
    if images.contains(&art.0) {
        next.set(Stage::Playing);
    }
}

fn spawn(
    art: Res<Art>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut materials: ResMut<Assets<ColorMaterial>>,
    mut commands: Commands,
) {
    let here = DespawnOnExit(Stage::Playing);
    let ground = (Mesh2d(meshes.add(Rectangle::new(10.0, 1.0))), MeshMaterial2d(materials.add(Color::WHITE)));
    commands.spawn((here.clone(), ground, Transform::from_xyz(0.0, -1.0, 0.0)));
    commands.spawn((here.clone(), Text2d::new("0 m"), Transform::from_xyz(0.0, 4.0, 1.0)));
    commands.spawn((here, Ball, Sprite::from_image(art.0.clone()), Transform::default()));
}

fn roll(keys: Res<ButtonInput<KeyCode>>, mut ball: Single<&mut Transform, With<Ball>>, mut text: Single<&mut Text2d>) {
    ball.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
    text.0 = format!("{} m", ball.translation.x);
}

/// Returns the ball's displacement, and the width of its picture.
fn see(ball: Single<(&Transform, &Sprite), With<Ball>>, images: Res<Assets<Image>>) -> [f32; 2] {
    let (place, sprite) = *ball;
    [place.translation.x, images.get(&sprite.image).map_or(0.0, |image| image.width() as f32)]
}

/// Returns the adapter.
fn ball_game() -> ForeignGame {
    ForeignGame::new("ball", 1, game)
        .keys([vec![], vec![KeyCode::ArrowRight]])
        .observe(["x", "width"], see)
        .end(|ball: Single<&Transform, With<Ball>>| (ball.translation.x >= 5.0).then_some(EpisodeEnd::WON))
        .time_limit(60)
        .restart(Restart::state(Stage::Loading))
        .ready(|stage: Res<State<Stage>>| *stage == Stage::Playing)
        .headless(|plugins| {
            let file_path = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets").to_owned();
            plugins.build().set(AssetPlugin { file_path, ..default() })
        })
}

#[test]
fn it_plays_without_a_screen() {
    let (mut world, agents) = build_world(&ball_game(), "default", 1, 0, 1);
    let right = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, right, LevelQueue::list([1, 2])));
    world.ticks(3).expect("the picture has arrived, and nothing is missing");
    let seen = world.get::<Observation>(agents[0]).expect("an agent").vector.clone();
    assert_eq!(seen, [2.0, 16.0], "after two ticks, with a picture of 16 pixels");
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("sound");
    }
    let count = world.get::<EpisodeCount>(agents[0]).expect("an agent");
    assert_eq!((count.finished, count.successes), (2, 2));
    let mut texts = world.query::<&Text2d>();
    assert_eq!(texts.iter(&world).map(|text| text.0.as_str()).collect::<Vec<_>>(), ["5 m"]);
    let mut grounds = world.query::<(&Mesh2d, &MeshMaterial2d<ColorMaterial>)>();
    let (mesh, material) = grounds.single(&world).expect("one ground");
    assert!(world.resource::<Assets<Mesh>>().contains(mesh));
    assert!(world.resource::<Assets<ColorMaterial>>().contains(material));
}

#[test]
fn the_event_loop_is_left_out_and_the_renderer_draws_nothing() {
    let plugins = HeadlessPlugins::default().build();
    assert!(plugins.contains::<WinitPlugin>() && !plugins.enabled::<WinitPlugin>());
    assert!(plugins.enabled::<RenderPlugin>());
    let mut app = App::new();
    app.add_plugins(plugins);
    assert!(app.get_sub_app(RenderApp).is_none());
}

/// The points of a game that ends by a score.
#[derive(Resource, Default)]
struct Points(u32);

#[test]
fn an_end_sees_the_last_schedule_of_its_tick_before_the_state_that_the_game_has_set_there() {
    let game = |app: &mut App| {
        app.init_state::<Stage>().init_resource::<Points>();
        app.add_systems(
            PostUpdate,
            |keys: Res<ButtonInput<KeyCode>>, mut points: ResMut<Points>, mut next: ResMut<NextState<Stage>>| {
                points.0 += u32::from(keys.pressed(KeyCode::Space));
                if points.0 == 3 {
                    next.set(Stage::Playing);
                }
            },
        );
        // The screen of the end takes the score back.
        app.add_systems(OnEnter(Stage::Playing), |mut points: ResMut<Points>| points.0 = 0);
    };
    let game = ForeignGame::new("points", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .observe(["points"], |points: Res<Points>| [points.0 as f32])
        .reward_delta(|points: Res<Points>| points.0 as f32)
        .end(|points: Res<Points>, stage: Res<State<Stage>>| {
            (points.0 == 3 && *stage == Stage::Loading).then_some(EpisodeEnd::WON)
        })
        .time_limit(10)
        .restart(Restart::state(Stage::Loading))
        .level(|mut points: ResMut<Points>| points.0 = 0);
    let (mut world, agents) = build_world(&game, "default", 1, 0, 1);
    let press = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, press, LevelQueue::list([1])));
    world.ticks(3).expect("sound");
    let count = world.get::<EpisodeCount>(agents[0]).expect("an agent");
    assert_eq!((count.finished, count.successes), (1, 1));
}

#[test]
fn an_adapter_sets_the_size_of_the_window_before_the_game_starts() {
    let game = |app: &mut App| {
        app.init_resource::<Points>().add_systems(Startup, |window: Single<&Window>, mut points: ResMut<Points>| {
            points.0 = window.width() as u32;
        });
    };
    let small = move |app: &mut App| {
        app.add_systems(PreStartup, |mut window: Single<&mut Window, With<PrimaryWindow>>| {
            window.resolution.set(800.0, 600.0);
        });
        game(app);
    };
    let width = |game: ForeignGame| {
        let game =
            game.keys([vec![], vec![KeyCode::Space]]).observe(["width"], |points: Res<Points>| [points.0 as f32]);
        let (mut world, agents) = build_world(&game, "default", 1, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([1])));
        world.tick().expect("sound");
        world.get::<Observation>(agents[0]).expect("an agent").vector.clone()
    };
    assert_eq!(width(ForeignGame::new("large", 1, game)), [1280.0]);
    assert_eq!(width(ForeignGame::new("small", 1, small)), [800.0]);
}

/// A plugin that does not ask whether there is a renderer.
struct Shine;

impl Plugin for Shine {
    fn build(&self, app: &mut App) {
        app.sub_app_mut(RenderApp).add_systems(Render, draw);
    }
}

fn draw() {
    panic!("it draws");
}

#[test]
fn a_plugin_finds_the_render_app_while_it_is_built_and_its_systems_there_never_run() {
    let shiny = ForeignGame::new("shiny", 1, |app: &mut App| {
        app.add_plugins(Shine);
        game(app);
    });
    let shiny = shiny.keys([vec![], vec![KeyCode::ArrowRight]]).observe(["x"], || [0.0]).time_limit(60);
    let (mut world, agents) = build_world(&shiny, "default", 1, 0, 1);
    let right = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, right, LevelQueue::Always(1)));
    world.ticks(3).expect("there is no renderer");
}

#[test]
fn a_plugin_that_needs_the_render_app_when_it_is_finished_gets_advice() {
    struct Late;
    impl Plugin for Late {
        fn build(&self, _: &mut App) {}

        fn finish(&self, app: &mut App) {
            app.sub_app_mut(RenderApp).add_systems(Render, draw);
        }
    }
    let late = ForeignGame::new("late", 1, |app: &mut App| _ = app.add_plugins(Late));
    let late = late.keys([vec![], vec![KeyCode::ArrowRight]]).observe(["x"], || [0.0]);
    let words = check_start(&late, "default", 0, |_| {}).expect_err("there is no renderer").to_string();
    for part in ["in `finish` of the plugin `", "::Late`)", "`get_sub_app_mut(RenderApp)`"] {
        assert!(words.contains(part), "`{part}` is missing in: {words}");
    }
}

#[test]
fn default_plugins_are_changed_for_the_window_and_for_headless_worlds() {
    fn uncounted(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
        plugins.disable::<FrameCountPlugin>()
    }
    let (world, _) = build_world(&ball_game().default_plugins(uncounted), "default", 1, 0, 1);
    assert!(!world.contains_resource::<FrameCount>());
    let (world, _) = build_world(&ball_game(), "default", 1, 0, 1);
    assert!(world.contains_resource::<FrameCount>());
    let changed = ball_game().default_plugins(uncounted);
    let window = changed.tools().host.windowed_plugins(DefaultPlugins.build());
    assert!(!window.enabled::<FrameCountPlugin>());
}

/// Worlds of a game: all that were built, those that are alive, and the most that were alive at a time.
#[derive(Default)]
struct Worlds {
    built: AtomicUsize,
    alive: AtomicUsize,
    most: AtomicUsize,
}

/// Lives as long as its World.
#[derive(Resource)]
struct Life(Arc<Worlds>);

impl Drop for Life {
    fn drop(&mut self) {
        self.0.alive.fetch_sub(1, Ordering::SeqCst);
    }
}

#[test]
fn an_evaluation_builds_a_world_only_for_episodes_and_only_while_they_are_played() {
    let measure = |threads| {
        let worlds = Arc::new(Worlds::default());
        let counted = worlds.clone();
        let game = move |app: &mut App| {
            counted.built.fetch_add(1, Ordering::SeqCst);
            let alive = counted.alive.fetch_add(1, Ordering::SeqCst) + 1;
            counted.most.fetch_max(alive, Ordering::SeqCst);
            app.insert_resource(Life(counted.clone()));
        };
        let game = ForeignGame::new("counted", 1, game)
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["pressed"], |keys: Res<ButtonInput<KeyCode>>| [f32::from(u8::from(keys.pressed(KeyCode::Space)))])
            .reward(|keys: Res<ButtonInput<KeyCode>>| f32::from(u8::from(keys.pressed(KeyCode::Space))))
            .time_limit(10);
        let plan = EvalPlan { arenas: 8, worlds: 8, threads, ..plan("default:0..5") };
        let player = Player::Blind(BlindBot::Uniform);
        let results = evaluate(&game, &player, &plan, |_| {}).expect("can be played");
        let count = |number: &AtomicUsize| number.load(Ordering::SeqCst);
        (results, [&worlds.built, &worlds.alive, &worlds.most].map(count))
    };
    let (alone, counts) = measure(1);
    assert_eq!((alone.len(), counts), (6, [6, 0, 1]), "two of eight Worlds have no episode");
    let (together, [built, alive, most]) = measure(3);
    assert_eq!((built, alive), (6, 0));
    assert!((1..=3).contains(&most), "{most} Worlds at a time on three threads");
    assert_eq!(alone, together);
}
