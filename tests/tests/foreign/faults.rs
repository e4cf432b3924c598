//! Tests of errors about foreign games, which use the game's own names.

use bevy::{
    diagnostic::{FrameCount, FrameCountPlugin},
    prelude::*,
    winit::EventLoopProxyWrapper,
};
use playbot::prelude::*;
use playbot_harness::{
    demo::verify_file,
    eval::{Player, evaluate},
    foreign::{ForeignGame, Restart},
    worlds::{build_world, check_start},
};
use playbot_learner::DeviceKind;
use playbot_tests::{
    foreign::catch::{Paddle, Score, catch_game, game},
    measuring::plan,
};
use playbot_train::{Trainer, experiment::file::parse_experiment};
use std::sync::atomic::{AtomicU32, Ordering};

/// Plays until the first fault, for at most this many ticks.
fn fault(game: &ForeignGame, ticks: u64) -> String {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::Always(3)));
    world.ticks(ticks).expect_err("something is wrong").to_string()
}

/// Returns the game with something more.
fn catch_game_with(more: fn(&mut App)) -> ForeignGame {
    let broken = ForeignGame::new("broken", 1, move |app: &mut App| {
        game(app);
        more(app);
    });
    broken.keys([vec![], vec![KeyCode::ArrowLeft]]).observe(["x"], || [0.0]).restart(Restart::Startup)
}

#[test]
fn a_game_without_actions_is_refused() {
    let mute = ForeignGame::new("mute", 1, game).observe(["x"], || [0.0]);
    assert!(fault(&mute, 1).contains("`mute` has no actions: say what an agent can do, for instance with `.keys`"));
    let error =
        evaluate(&mute, &Player::Blind(BlindBot::Uniform), &plan("default:0..3"), |_| {}).expect_err("no actions");
    assert!(error.to_string().contains("has no actions"), "{error}");
    let experiment =
        r#"(game: "mute", train: "default:0..3", test: "default:4..7", demos: "x", steps: 9000, algorithm: "ppo")"#;
    let experiment = parse_experiment(experiment, std::path::Path::new("x.ron")).expect("valid");
    let error = Trainer::new(&mute, &experiment, None, DeviceKind::Flex, 1).err().expect("no actions");
    assert!(error.to_string().contains("has no actions"), "{error}");
}

#[test]
fn a_game_of_which_nothing_is_seen_is_refused() {
    let dark = ForeignGame::new("dark", 1, game).keys([vec![], vec![KeyCode::ArrowLeft]]);
    let text = fault(&dark, 1);
    assert!(text.contains("nothing of the game `dark` is seen") && text.contains("`.observe`"), "{text}");
}

/// The plugins in the `main` of most games.
#[test]
fn bevys_plugins_that_a_game_adds_again_are_named_with_what_to_do() {
    let text = fault(&catch_game_with(|app| _ = app.add_plugins(DefaultPlugins)), 1);
    for part in ["`broken`", "plugin was already added", "leave `DefaultPlugins`", "`ForeignGame::new`"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
    let text = fault(&catch_game_with(|_| panic!("no saved game")), 1);
    assert!(text.contains("`broken` panicked when it was added to the app: no saved game"), "{text}");
}

/// A plugin that panics in one of its steps.
struct Fragile(&'static str);

impl Plugin for Fragile {
    fn build(&self, _: &mut App) {
        assert!(self.0 != "build", "it breaks in build");
    }

    fn finish(&self, _: &mut App) {
        assert!(self.0 != "finish", "it breaks in finish");
    }

    fn cleanup(&self, _: &mut App) {
        assert!(self.0 != "cleanup", "it breaks in cleanup");
    }
}

#[test]
fn a_panic_in_a_plugin_is_the_fault_of_each_tick_with_the_name_of_the_plugin() {
    let games: [(&str, fn(&mut App)); 3] = [
        ("build", |app| _ = app.add_plugins(Fragile("build"))),
        ("finish", |app| _ = app.add_plugins(Fragile("finish"))),
        ("cleanup", |app| _ = app.add_plugins(Fragile("cleanup"))),
    ];
    for (step, add) in games {
        let (mut world, _) = build_world(&catch_game_with(add), "default", 0, 0, 1);
        for _ in 0..2 {
            let text = world.tick().expect_err("it panicked").to_string();
            let words = format!("the game `broken` panicked when it was added to the app: it breaks in {step} (");
            assert!(text.starts_with(&words) && text.contains("faults.rs:"), "{text}");
            assert!(text.contains(&format!("in `{step}` of the plugin `")) && text.contains("::Fragile`)"), "{text}");
        }
    }
}

#[test]
fn a_game_that_panics_when_it_is_added_is_refused_before_any_level() {
    let broken = catch_game_with(|app| _ = app.add_plugins(Fragile("finish")));
    let words = check_start(&broken, "default", 0, |_| {}).expect_err("it panics").to_string();
    assert!(words.contains("it breaks in finish"), "{words}");
    let error =
        evaluate(&broken, &Player::Blind(BlindBot::Uniform), &plan("default:0..3"), |_| {}).expect_err("it panics");
    assert_eq!(error.to_string(), words);
    assert_eq!(check_start(&catch_game(), "default", 0, |_| {}), Ok(()));
}

#[test]
fn a_panic_of_the_start_is_none_of_a_level() {
    fn enter() {
        panic!("no door");
    }
    let closed = catch_game_with(|app| _ = app.add_systems(Startup, enter));
    let words = check_start(&closed, "default", 3, |_| {}).expect_err("it panics").to_string();
    assert!(words.starts_with("before any level was played: the game panicked: no door ("), "{words}");
    // In the first tick of a level.
    let bomb = catch_game().reward(|_score: Res<Score>| -> f32 { panic!("the reward is gone") });
    assert!(fault(&bomb, 1).contains("the reward is gone"));
    assert_eq!(check_start(&bomb, "default", 3, |_| {}), Ok(()));
}

#[test]
fn a_game_that_panics_when_its_world_is_built_anew_is_a_fault_of_that_tick() {
    let built = AtomicU32::new(0);
    let broken = ForeignGame::new("broken", 1, move |app: &mut App| {
        game(app);
        assert!(built.fetch_add(1, Ordering::Relaxed) == 0, "no second World");
    });
    let broken = broken.keys([vec![], vec![KeyCode::ArrowLeft]]).observe(["x"], || [0.0]).time_limit(2);
    let text = fault(&broken.restart(Restart::Rebuild), 4);
    assert!(text.starts_with("the game `broken` panicked when it was added to the app: no second World ("), "{text}");
}

#[test]
fn a_panic_in_a_startup_system_names_the_system() {
    #[inline(never)]
    fn open_door() {
        panic!("the door is locked");
    }
    let text = fault(&catch_game_with(|app| _ = app.add_systems(Startup, open_door)), 1);
    assert!(text.contains("the game panicked: the door is locked (") && text.contains("open_door`)"), "{text}");
}

#[test]
fn an_observation_that_changes_its_length_is_a_fault() {
    fn grow(mut ticks: Local<usize>) -> Vec<f32> {
        *ticks += 1;
        vec![0.0; if *ticks < 3 { 2 } else { 3 }]
    }
    let text = fault(&catch_game().observe(["a", "b"], grow), 10);
    for part in ["agent 0, level 3, tick 2", "`catch`", "names 2 values", "grow", "returned 3"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
    let text = fault(&catch_game().observe(["a", "b", "c"], || [1.0, 2.0]), 1);
    assert!(text.contains("names 3 values") && text.contains("returned 2"), "{text}");
}

#[test]
fn an_observation_of_what_does_not_exist_is_a_fault() {
    #[derive(Component)]
    struct Nowhere;
    fn see(nowhere: Single<&Transform, With<Nowhere>>) -> [f32; 1] {
        [nowhere.translation.x]
    }
    let text = fault(&catch_game().observe(["x"], see), 1);
    assert!(text.contains("see` was skipped: an entity that it asks for does not exist"), "{text}");
}

#[test]
fn a_level_that_never_becomes_ready_times_out_with_the_name_of_the_system() {
    fn never() -> bool {
        false
    }
    let text = fault(&catch_game().ready(never).ready_within(20), 1);
    for part in ["level 3", "`catch`", "not ready after 20 frames", "never", "`.ready_within`"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
}

#[test]
fn two_agents_in_a_world_for_one_are_a_fault() {
    let (mut world, agents) = build_world(&catch_game(), "default", 0, 0, 2);
    for agent in agents {
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform));
    }
    let text = world.tick().expect_err("room for one").to_string();
    assert!(text.contains("`catch` has room for 1 agent,") && text.contains("it has 2: build more Worlds"), "{text}");
}

#[test]
fn a_missing_resource_is_named_with_what_brings_it() {
    #[derive(Resource)]
    struct Lives(#[allow(dead_code)] u32);
    fn count(_lives: Res<Lives>) {}
    let broken = catch_game_with(|app| {
        app.add_systems(Update, count);
    });
    let text = fault(&broken, 2);
    assert!(!text.contains("panicked"), "{text}");
    for part in ["count` needs the resource `Lives`", "insert it, or add the plugin that adds it"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
    let text = fault(&catch_game().reward(|lives: Res<Lives>| lives.0 as f32), 2);
    assert!(text.contains("needs the resource `Lives`"), "{text}");
}

#[test]
fn what_headless_plugins_lack_is_named_with_its_plugin() {
    fn ask_the_window_system(_proxy: Res<EventLoopProxyWrapper>) {}
    let broken = catch_game_with(|app| {
        app.add_systems(Update, ask_the_window_system);
    });
    let text = fault(&broken, 2);
    for part in ["ask_the_window_system` needs the resource `EventLoopProxyWrapper`", "`WinitPlugin`", "headless"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
    // One that the game has left out itself.
    fn count(_frames: Res<FrameCount>) {}
    let broken = catch_game_with(|app| {
        app.add_systems(Update, count);
    });
    let broken = broken.headless(|plugins| plugins.build().disable::<FrameCountPlugin>());
    let text = fault(&broken, 2);
    assert!(text.contains("count` needs the resource `FrameCount`") && text.contains("`FrameCountPlugin` adds it"));
}

#[test]
fn a_state_that_the_game_does_not_have_is_named() {
    #[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    enum Nothing {
        #[default]
        Here,
    }
    let text = fault(&catch_game().restart(Restart::state(Nothing::Here)), 1);
    assert!(text.contains("Nothing") && text.contains("`init_state`"), "{text}");
}

#[test]
fn a_panic_is_an_error_with_a_recording_that_leads_to_it() {
    fn explode(paddle: Single<&Transform, With<Paddle>>) {
        assert!(paddle.translation.x > 3.1, "the paddle has left the field");
    }
    let bomb = || {
        let bomb = ForeignGame::new("bomb", 1, |app: &mut App| {
            game(app);
            app.add_systems(PostUpdate, explode);
        });
        bomb.keys([vec![], vec![KeyCode::ArrowLeft]])
            .observe(["x"], |paddle: Single<&Transform, With<Paddle>>| [paddle.translation.x])
            .reward(|_score: Res<Score>| 0.0)
    };
    let text = fault(&bomb(), 100);
    for part in ["agent 0, level 3, tick 4", "the paddle has left the field", "faults.rs:", "which replays to it"] {
        assert!(text.contains(part), "`{part}` is missing in: {text}");
    }
    let path = text.split("are in ").nth(1).and_then(|rest| rest.split(", which").next()).expect("a path");
    let of_this_program = format!("-{}.demo", std::process::id());
    assert!(path.ends_with(&of_this_program), "two programs must not write over each other's: {path}");
    let error = verify_file(&bomb(), std::path::Path::new(path), |_| {}).expect_err("panics again").to_string();
    assert!(error.contains("tick 4") && error.contains("the paddle has left the field"), "{error}");
    std::fs::remove_file(path).expect("it was there");
    // Measuring gets the error too, from any thread.
    let player = Player::Blind(BlindBot::Constant(ActionValue::Discrete(1)));
    let error = evaluate(&bomb(), &player, &plan("default:0..3"), |_| {}).expect_err("panics").to_string();
    assert!(error.contains("the paddle has left the field"), "{error}");
}

#[test]
fn a_game_may_call_its_types_what_the_plugin_calls_its_own() {
    #[derive(Resource, Reflect)]
    #[reflect(Resource)]
    struct Frame {
        width: f32,
    }
    /// Not reflected, so only its name is known.
    #[derive(Component)]
    struct Decision;
    let named = ForeignGame::new("named", 1, |app: &mut App| {
        game(app);
        app.insert_resource(Frame { width: 3.5 });
        app.add_systems(Startup, |mut commands: Commands| {
            commands.spawn((Decision, Transform::from_xyz(0.0, 7.0, 0.0)));
        });
    });
    let paths = ["Frame.width", "Decision.Transform.translation.y"];
    let named = named.keys([vec![], vec![KeyCode::ArrowLeft]]).observe_paths(paths);
    let (mut world, agents) = build_world(&named, "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(0));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::Always(3)));
    world.tick().expect("the paths are found");
    assert_eq!(world.get::<Observation>(agents[0]).expect("an agent").vector, [3.5, 7.0]);
}

#[test]
fn numbers_are_observed_by_their_paths() {
    let see = |paths: &[&str]| {
        let paths = paths.iter().copied();
        let game = ForeignGame::new("paths", 1, game).keys([vec![], vec![KeyCode::ArrowLeft]]).observe_paths(paths);
        let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
        let bot = BlindBot::Constant(ActionValue::Discrete(0));
        world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::Always(3)));
        world.tick().map(|()| world.get::<Observation>(agents[0]).expect("an agent").vector.clone())
    };
    assert_eq!(see(&["Paddle.Transform.translation.x", "Paddle.Transform.scale.y"]), Ok(vec![4.0, 1.0]));
    let refused = |path: &str| see(&[path]).expect_err("no such number").to_string();
    assert!(refused("Spoon.Transform.translation.x").contains("means no entity"));
    assert!(refused("Paddle.Transform.translation.w").contains("leads nowhere"));
    assert!(refused("Paddle.Transform.translation").contains("not a number"));
    assert!(refused("Paddle.Spoon.x").contains("derives `Reflect`"));
}
