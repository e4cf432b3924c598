//! AntMaze as a game: what is seen, paid and ended, and that it is the same every time.

use std::{path::Path, sync::Arc};

use bevy::prelude::*;
use bevy_playbot::{
    demo::{
        file::{DemoHeader, DemoReader, DemoWriter},
        recorder::demo_actions,
    },
    policy::ActionDraw,
    test_app::PlaybotTestExt,
    vision::{ObservationConfig, ObservationKind},
};
use playbot_games::{
    ant::{Ant, walk::Walker},
    antmaze::{
        AntMaze, AntMazeLevel, DemonstratorBot,
        components::{InMaze, MazeAnt},
        generate,
        geometry::distance,
    },
};
use playbot_lab::prelude::*;
use playbot_lab::{
    demo::verify::verify_file,
    eval::{EvalPlan, Player, evaluate, summarize},
    parallel::on_threads,
    worlds::{build_observing_world, build_world},
};
use playbot_learner::{DeviceKind, PolicyFile};

fn level(mode: &str, seed: u64) -> AntMazeLevel {
    generate(&mode.parse().expect("a mode"), seed).expect("a level")
}

/// One agent in one level, and nobody at the controls.
fn world_with(mode: &str, seed: u64) -> (World, Entity) {
    let (mut world, agents) = build_world(&AntMaze, mode, 0, 0, 1);
    let still = Action(ActionValue::Continuous(vec![0.0; 8]));
    world.entity_mut(agents[0]).insert((Control::Human, still, LevelQueue::Always(seed)));
    (world, agents[0])
}

fn act(world: &mut World, agent: Entity, torques: [f32; 8]) {
    world.entity_mut(agent).insert(Action(ActionValue::Continuous(torques.to_vec())));
}

fn place(world: &World, agent: Entity) -> [f32; 2] {
    let state = world.get::<MazeAnt>(agent).expect("plays").0.state();
    [state.qpos[0], state.qpos[1]]
}

/// Puts the ant somewhere else, as it was at the start of its level.
fn put(world: &mut World, agent: Entity, place: [f32; 3]) {
    let mut state = world.get::<InMaze>(agent).expect("plays").0.reset;
    state.qpos[..3].copy_from_slice(&place);
    world.get_mut::<MazeAnt>(agent).expect("plays").0.set_state(&state);
}

fn ended(world: &World, agent: Entity) -> u64 {
    world.get::<EpisodeCount>(agent).expect("an agent").finished
}

#[test]
fn the_first_observation_is_the_reset_in_the_order_of_the_original() {
    let (mut world, agent) = world_with("large", 7);
    world.tick().expect("sound");
    let seen = &world.get::<Observation>(agent).expect("an agent").vector;
    let reset = level("large", 7).reset;
    let names = AntMaze.observation().names;
    assert_eq!((seen.len(), names.len()), (29, 29));
    for (index, name) in [
        (0, "x"),
        (2, "z"),
        (3, "quaternion w"),
        (7, "hip 1 angle"),
        (14, "ankle 4 angle"),
        (15, "velocity x"),
        (18, "spin x"),
        (28, "ankle 4 velocity"),
    ] {
        assert_eq!(names[index], name);
    }
    for (value, (expected, name)) in seen.iter().zip(reset.qpos.iter().chain(&reset.qvel).zip(&names)) {
        assert!((value - expected).abs() < 1e-4, "{name} is {value} and not {expected}");
    }
}

#[test]
fn rewards_follow_the_distance_after_the_tick() {
    for (mode, pay) in [
        ("medium", (|away: f32| -away) as fn(f32) -> f32),
        ("medium+dense=exp", |away| (-away).exp()),
        ("medium+sparse", |away| f32::from(u8::from(away <= 0.5))),
    ] {
        let (mut world, agent) = world_with(mode, 3);
        world.tick().expect("sound");
        for at in [[3.0, 0.0, 0.6], [20.0, 18.0, 0.6], [19.4, 20.0, 0.6]] {
            put(&mut world, agent, at);
            world.tick().expect("sound");
            let away = distance(place(&world, agent), [20.0, 20.0]);
            let reward = world.get::<Reward>(agent).expect("an agent").get();
            assert!((reward - pay(away)).abs() < 1e-6, "{mode}: {reward} at {away} m");
        }
    }
}

#[test]
fn an_ant_within_half_a_metre_of_the_goal_has_won() {
    for (mode, reward) in [("medium", -0.5..0.0), ("medium+sparse", 0.9..1.1)] {
        let (mut world, agent) = world_with(mode, 3);
        world.tick().expect("sound");
        put(&mut world, agent, [20.0, 19.2, 0.6]);
        world.tick().expect("sound");
        assert_eq!(ended(&world, agent), 0, "0.8 m are too far");
        put(&mut world, agent, [20.0, 19.8, 0.6]);
        world.tick().expect("sound");
        let count = *world.get::<EpisodeCount>(agent).expect("an agent");
        assert_eq!((count.finished, count.successes), (1, 1));
        assert!(reward.contains(&world.get::<Reward>(agent).expect("an agent").get()));
        world.tick().expect("sound");
        assert!(place(&world, agent).iter().all(|x| x.abs() < 1.0), "the next episode begins at the start");
    }
}

/// Where every tick pays the more the nearer the goal is, going there must not end it.
#[test]
fn an_ant_that_is_paid_for_nearness_stays_at_the_goal() {
    let (mut world, agent) = world_with("medium+dense=exp+limit=20", 3);
    world.tick().expect("sound");
    for _ in 0..10 {
        put(&mut world, agent, [20.0, 19.8, 0.6]);
        world.tick().expect("sound");
        assert_eq!(ended(&world, agent), 0);
    }
    while ended(&world, agent) == 0 {
        world.tick().expect("sound");
    }
    let (episode, count) = (world.get::<Episode>(agent), world.get::<EpisodeCount>(agent));
    assert_eq!(episode.expect("an agent").tick, 20);
    assert_eq!(count.expect("an agent").successes, 1, "the goal was reached before time was up");
}

#[test]
fn only_the_clock_ends_what_the_goal_does_not() {
    let (mut world, agent) = world_with("medium+limit=30", 1);
    world.tick().expect("sound");
    // On its back, in the air.
    let mut state = level("medium", 1).reset;
    state.qpos[3..7].copy_from_slice(&[0.0, 1.0, 0.0, 0.0]);
    world.get_mut::<MazeAnt>(agent).expect("plays").0.set_state(&state);
    world.ticks(28).expect("sound");
    assert_eq!(ended(&world, agent), 0);
    world.tick().expect("sound");
    let count = *world.get::<EpisodeCount>(agent).expect("an agent");
    assert_eq!((count.finished, count.successes), (1, 0));
}

#[test]
fn an_ant_that_arrives_with_the_last_tick_has_arrived() {
    let (mut world, agent) = world_with("medium+limit=2", 1);
    world.tick().expect("sound");
    put(&mut world, agent, [20.0, 20.0, 0.6]);
    world.tick().expect("sound");
    assert_eq!(world.get::<EpisodeCount>(agent).expect("an agent").successes, 1);
}

#[test]
fn actions_outside_the_range_are_clipped_and_counted() {
    #[derive(Resource, Default)]
    struct Clipped(Vec<u32>);
    let play = |torque: f32| {
        let (mut world, agent) = world_with("medium+limit=20", 5);
        world.init_resource::<Clipped>();
        world.add_observer(|event: On<EpisodeEnded>, mut clipped: ResMut<Clipped>| clipped.0.push(event.clipped));
        world.ticks(10).expect("sound");
        act(&mut world, agent, [torque, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -torque]);
        world.ticks(10).expect("sound");
        (world.get::<StateHash>(agent).expect("an agent").0, world.resource::<Clipped>().0.clone())
    };
    let (within, beyond) = (play(1.0), play(7.5));
    assert_eq!(within.0, beyond.0, "clipped to the range");
    assert_eq!((within.1, beyond.1), (vec![0], vec![10]));
}

#[test]
fn nan_in_an_action_names_agent_level_and_tick() {
    let (mut world, agent) = world_with("medium", 8);
    world.ticks(3).expect("sound");
    act(&mut world, agent, [0.0, f32::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let fault = world.tick().expect_err("no number").to_string();
    for part in ["agent 0", "level 8", "tick 3", "NaN at index 1"] {
        assert!(fault.contains(part), "{part} is missing in: {fault}");
    }
}

#[test]
fn an_ant_that_has_left_the_world_is_reported_and_let_alone() {
    for place in [[-9.0, 0.0, 0.6], [0.0, 60.0, 0.6], [0.0, 0.0, 50.0]] {
        let (mut world, agent) = world_with("medium", 8);
        world.ticks(3).expect("sound");
        put(&mut world, agent, place);
        let fault = world.tick().expect_err("outside").to_string();
        for part in ["agent 0", "level 8", "tick 3", "outside the maze"] {
            assert!(fault.contains(part), "{part} is missing in: {fault}");
        }
        world.ticks(3).expect("stopped");
    }
}

/// State hashes of each agent's whole episodes, agent by agent.
fn traces(worlds: &mut [(World, Vec<Entity>)], threads: usize, ticks: u32) -> Vec<Vec<u64>> {
    let played = on_threads(worlds, threads, |(world, agents)| {
        let mut traces = vec![Vec::new(); agents.len()];
        for _ in 0..ticks {
            world.tick().expect("sound");
            for (trace, &agent) in traces.iter_mut().zip(&*agents) {
                trace.push(world.get::<StateHash>(agent).expect("an agent").0);
            }
        }
        traces
    });
    played.into_iter().flatten().collect()
}

fn stage(first: u32, count: u32) -> (World, Vec<Entity>) {
    let (mut world, agents) = build_world(&AntMaze, "random+limit=600", 11, first, count);
    for &agent in &agents {
        let levels = LevelQueue::Uniform { first: 0, last: 63 };
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, levels));
    }
    (world, agents)
}

#[test]
fn threads_and_neighbours_change_no_bit_in_100_000_physics_steps() {
    // 8 arenas, 2500 control steps, 5 physics steps each.
    let apart = |threads| traces(&mut [stage(0, 4), stage(4, 4)], threads, 2500);
    let (one, two) = (apart(1), apart(2));
    assert!(one == two, "two threads are one thread");
    let together = traces(&mut [stage(0, 8)], 1, 300);
    for (apart, together) in one.iter().zip(&together) {
        assert!(apart[..300] == together[..], "an arena does not depend on who shares its World");
    }
    assert!(one[0] != one[1], "agents play levels of their own");
}

#[test]
fn a_level_is_the_same_whatever_was_played_before_it() {
    let play = |before: &[u64]| {
        let (mut world, agent) = world_with("medium+limit=40", 0);
        for &seed in before.iter().chain(&[6]) {
            world.entity_mut(agent).insert(LevelQueue::Always(seed));
            world.get_mut::<Episode>(agent).expect("an agent").abandon();
            act(&mut world, agent, [0.9, -0.4, 0.7, 1.0, -1.0, 0.2, -0.8, 0.5]);
            world.ticks(25).expect("sound");
        }
        world.get::<StateHash>(agent).expect("an agent").0
    };
    assert_eq!(play(&[]), play(&[1, 2, 3]));
}

fn record(path: &Path, mode: &str, levels: Vec<u64>) {
    let (mut world, agents) = build_world(&AntMaze, mode, 5, 0, 1);
    let header = DemoHeader::new("antmaze", AntMaze.version(), mode, 10.0, demo_actions(&AntMaze.actions()));
    world.insert_resource(Recorder::new(DemoWriter::create(path, header).expect("a fresh file")));
    let bot = (Control::Bot, BlindBot::Uniform, Recording::default(), LevelQueue::list(levels));
    world.entity_mut(agents[0]).insert(bot);
    while world.get::<Control>(agents[0]).is_some_and(|control| control.is_active()) {
        world.tick().expect("sound");
    }
}

#[test]
fn a_recording_replays_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ant.demo");
    let mode = "medium+goals=demo+goal-noise=d4rl+random-start+limit=60";
    record(&path, mode, vec![4, 9, 4]);
    let report = verify_file(&AntMaze, &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, report.divergences.len()), (3, 0));
    let episodes = DemoReader::open(&path).expect("readable").read_all().expect("whole");
    let hashes: Vec<_> = episodes.iter().map(|episode| episode.state_hashes.clone()).collect();
    assert_eq!(hashes[0].len(), 60);
    assert_ne!(hashes[0], hashes[2], "other actions, other states");
}

#[test]
fn systems_are_in_no_ambiguous_order() {
    let mut app = bevy_playbot::test_app::test_app();
    AntMaze.build(&mut app, "umaze+limit=10");
    AntMaze.build_picture(&mut app);
    app.init_resource::<ButtonInput<KeyCode>>();
    let agent = AntMaze.spawn_agent(app.world_mut(), 0);
    AntMaze.arm_demonstrator(app.world_mut(), agent, 0.2);
    app.world_mut().entity_mut(agent).insert(Control::Bot);
    app.play_episodes(2, 40).expect("sound");
}

#[test]
fn demonstrations_follow_the_noise_that_is_asked_for() {
    let actions = |noise: f64| {
        let (mut world, agents) = build_world(&AntMaze, "umaze", 5, 0, 1);
        world.entity_mut(agents[0]).insert((Control::Bot, DemonstratorBot::new(noise), LevelQueue::Always(1)));
        let mut actions: Vec<f32> = Vec::new();
        for _ in 0..100 {
            world.tick().expect("sound");
            actions.extend(world.get::<Action>(agents[0]).and_then(Action::continuous).expect("continuous"));
        }
        actions
    };
    let (calm, noisy) = (actions(0.0), actions(0.2));
    assert_eq!(calm, actions(0.0));
    assert_ne!(calm, noisy);
    assert!(calm.iter().chain(&noisy).all(|torque| (-1.0..=1.0).contains(torque)));
}

#[test]
fn pictures_show_floor_walls_ant_and_goal() {
    let sight = ObservationConfig { kind: ObservationKind::Raster, ..ObservationConfig::default() };
    let (mut world, agents) = build_observing_world(&AntMaze, "umaze", &sight, 0, 0, 1).expect("can be drawn");
    let still = Action(ActionValue::Continuous(vec![0.0; 8]));
    world.entity_mut(agents[0]).insert((Control::Human, still, LevelQueue::Always(0)));
    world.tick().expect("sound");
    let colours = |world: &World| {
        let image = Arc::new(world.get::<Observation>(agents[0]).expect("an agent").image.clone());
        let plane = image.len() / 3;
        move |x: usize, y: usize| [0, 1, 2].map(|channel| image[channel * plane + 64 * y + x])
    };
    // 4 pixels to the metre, the ant in the middle, y up.
    let at = colours(&world);
    assert!(at(32, 32)[0] > at(32, 32)[2] + 60, "the ant is red");
    assert!(at(32 + 16, 32)[1] > 180, "the next cell is floor");
    assert!(at(32, 32 + 16)[2] < 110 && at(32 - 16, 32)[2] < 110, "walls on two sides");
    // One cell to the right of the goal.
    put(&mut world, agents[0], [4.0, 8.0, 0.6]);
    world.tick().expect("sound");
    let [red, green, blue] = colours(&world)(16, 32);
    assert!(green > red + 40 && green > blue + 40, "the goal is green");
}

/// An app with keys in which a person has an ant.
fn keyboard_with(game: &dyn Game, mode: &str) -> (App, Entity) {
    let mut app = headless_app();
    game.build(&mut app, mode);
    app.init_resource::<ButtonInput<KeyCode>>();
    let agent = game.spawn_agent(app.world_mut(), 0);
    let keys = game.key_bindings().expect("has keys");
    let still = Action(keys.action(|_| false));
    app.world_mut().entity_mut(agent).insert((Control::Human, still, keys, LevelQueue::Always(2)));
    (app, agent)
}

#[test]
fn keys_tell_the_walker_where_to_go() {
    for (key, axis, sign) in [(KeyCode::ArrowUp, 1, 1.0), (KeyCode::KeyD, 0, 1.0)] {
        let (mut app, agent) = keyboard_with(&AntMaze, "large");
        app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(key);
        app.ticks(30).expect("sound");
        let at = place(app.world(), agent);
        assert!(sign * at[axis] > 1.5, "{key:?} led to {at:?}");
    }
    let (mut app, agent) = keyboard_with(&Ant, "goal");
    app.world_mut().resource_mut::<ButtonInput<KeyCode>>().press(KeyCode::ArrowLeft);
    app.ticks(30).expect("sound");
    let at = app.world().get::<Walker>(agent).expect("an ant").body.torso().0;
    assert!(at.x < -1.5, "left led to {at}");
}

#[test]
fn the_demonstrator_walks_to_the_goal() {
    for (levels, least) in [("umaze:0..31", 0.9), ("medium:0..31", 0.8), ("random+goals=random:0..31", 0.8)] {
        let plan = EvalPlan {
            split: levels.parse().expect("a split"),
            sight: ObservationConfig::default(),
            episodes_per_level: 1,
            seed: 1,
            arenas: 32,
            worlds: 2,
            threads: 2,
        };
        let episodes = evaluate(&AntMaze, &Player::Demonstrator, &plan, |_| {}).expect("sound");
        let summary = summarize("waypoints", &plan.split, &episodes);
        assert!(summary.success >= least, "{levels}: {summary:?}");
    }
}

#[test]
fn the_open_floor_is_drawn_around_its_ant() {
    let sight = ObservationConfig { kind: ObservationKind::Raster, ..ObservationConfig::default() };
    let (mut world, agents) = build_observing_world(&Ant, "goal", &sight, 0, 0, 2).expect("can be drawn");
    let still = Action(ActionValue::Continuous(vec![0.0; 8]));
    for &agent in &agents {
        world.entity_mut(agent).insert((Control::Human, still.clone(), LevelQueue::Always(0)));
    }
    world.tick().expect("sound");
    for &agent in &agents {
        let image = &world.get::<Observation>(agent).expect("an agent").image;
        let at = |x: usize, y: usize| [0, 1, 2].map(|channel| image[channel * 64 * 64 + 64 * y + x]);
        assert!(at(32, 32)[0] > at(32, 32)[2] + 60, "the ant is red");
        assert!([(2, 2), (60, 30), (30, 60)].iter().all(|&(x, y)| at(x, y)[1] > 180), "floor");
    }
}

#[test]
fn the_shipped_walker_reaches_goals_in_all_directions() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/models/ant-walker.safetensors");
    let policy = PolicyFile::load(&file, DeviceKind::default()).expect("shipped").policy;
    let plan = EvalPlan {
        split: "goal:0..127".parse().expect("a split"),
        sight: ObservationConfig::default(),
        episodes_per_level: 1,
        seed: 1,
        arenas: 64,
        worlds: 2,
        threads: 2,
    };
    let player = Player::Policy { policy, prior: None, draw: ActionDraw::Greedy };
    let trials = evaluate(&Ant, &player, &plan, |_| {}).expect("sound");
    let fallen = trials.iter().filter(|trial| trial.end == EpisodeEnd::Terminated { success: false }).count();
    // Goals are 8 m away, and reached within half a metre of them.
    let speeds: Vec<f64> =
        trials.iter().filter(|trial| trial.success).map(|trial| 7.5 / (0.1 * f64::from(trial.ticks))).collect();
    let speed = speeds.iter().sum::<f64>() / speeds.len() as f64;
    assert_eq!(trials.len(), 128);
    assert!(speeds.len() >= 116, "nine in ten: {} of 128", speeds.len());
    assert!(speed >= 0.8 && fallen <= 6, "{speed} m/s, {fallen} fell");
}
