//! Tests of Maze2D as a Bevy game: the same as its rules, reproducible on any number of threads, open to rays, and
//! clear about bad input.

use bevy::prelude::*;
use bevy_playbot::{
    demo::file::{DemoEnd, DemoReader},
    test_app::{PlaybotTestExt, test_app},
};
use bevy_rapier2d::rapier::prelude::{QueryFilter, Ray, Vector};
use playbot::prelude::*;
use playbot_games::maze2d::{
    Maze2d, Maze2dLevel, Maze2dMode, Maze2dPlugin,
    arena::{MazeBall, PlaysIn},
    ball::clip_action,
    physics::MazePhysics,
    sim::{BallSim, hash_state, reward},
    spawn_agent,
};
use playbot_harness::{
    demo::verify_file,
    eval::{EvalPlan, Player, evaluate, summarize},
    parallel::on_threads,
    saved_episode::SavedEpisode,
    worlds::build_world,
};
use playbot_tests::{measuring::plan, recording::record_demonstrator};

const GAME: Maze2d = Maze2d { physics: false };

fn mode(text: &str) -> Maze2dMode {
    text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
}

fn push(x: f32, y: f32) -> Action {
    Action(ActionValue::Continuous(vec![x, y]))
}

/// Returns a World with one agent whose actions the test sets.
fn one_agent(mode: &str, level: u64) -> (World, Entity) {
    let (mut world, agents) = build_world(&GAME, mode, 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Human, LevelQueue::Always(level), push(0.0, 0.0)));
    (world, agents[0])
}

/// Plays ticks in which the ball is pushed in a circle of squares, and returns the state hash after each.
fn pushed(world: &mut World, agent: Entity, ticks: u32) -> Vec<u64> {
    let mut hashes = Vec::new();
    for tick in 0..ticks {
        let [x, y] = [[1.0, 0.3], [-0.2, 1.0], [-1.0, -0.4], [0.5, -1.0]][(tick / 20 % 4) as usize];
        world.entity_mut(agent).insert(push(x, y));
        world.tick().expect("sound");
        hashes.push(world.get::<StateHash>(agent).expect("an agent").0);
    }
    hashes
}

#[test]
fn a_ball_goes_on_to_the_bit_from_a_snapshot_in_another_world() {
    let (mut first, agent) = one_agent("medium", 7);
    pushed(&mut first, agent, 50);
    let saved = SavedEpisode::of(&GAME, &first, agent).expect("soft contacts are saved");
    let expected = pushed(&mut first, agent, 90);
    let (mut second, agent) = one_agent("medium", 7);
    assert!(!saved.restore(&GAME, &mut second, agent), "no level was built yet");
    pushed(&mut second, agent, 13);
    assert!(saved.restore(&GAME, &mut second, agent));
    assert_eq!(pushed(&mut second, agent, 90), expected);
    let (mut solved, agent) = one_agent("medium+contact=rapier", 7);
    pushed(&mut solved, agent, 5);
    assert!(SavedEpisode::of(&GAME, &solved, agent).is_none(), "rapier has a state of its own");
}

#[test]
fn the_game_and_the_pure_simulation_never_differ() {
    for text in ["medium", "large+contact=rapier", "random+sparse+goal=random+no-end-at-goal"] {
        let (mode, seed) = (mode(text), 7);
        let level = Maze2dLevel::new(&mode, seed).expect("a level");
        let mut sim = BallSim::new(&mode, &level);
        let (mut world, agent) = one_agent(text, seed);
        for step in 0..mode.limit.min(300) {
            let action = [(step as f32 * 0.37).rem_euclid(2.6) - 1.3, (step as f32 * 0.11).rem_euclid(2.0) - 1.0];
            world.entity_mut(agent).insert(push(action[0], action[1]));
            world.tick().expect("sound");
            let seen = world.get::<Observation>(agent).expect("an agent").vector.clone();
            let before = sim.ball;
            assert_eq!(seen, [before.position, before.velocity].concat().iter().map(|&v| v as f32).collect::<Vec<_>>());
            sim.step(clip_action(action).0);
            assert_eq!(world.get::<MazeBall>(agent).expect("a ball").0, sim.ball, "{text}, step {step}");
            assert_eq!(world.get::<StateHash>(agent).expect("an agent").0, hash_state(&sim.ball, step + 1));
            let paid = world.get::<Reward>(agent).expect("an agent").get();
            assert_eq!(paid, reward(sim.ball.position, level.goal(), mode.sparse));
        }
    }
}

#[test]
fn its_systems_have_one_order() {
    let mut app = test_app();
    app.add_plugins(Maze2dPlugin::new(mode("medium")));
    let agent = spawn_agent(app.world_mut(), 0);
    app.world_mut().entity_mut(agent).insert((Control::Bot, BlindBot::Uniform));
    app.play_episodes(1, 700).expect("600 ticks are an episode");
}

/// Returns the hashes of all agents after every tick, World by World.
fn traces(mode: &str, threads: usize) -> Vec<Vec<u64>> {
    const AGENTS: u32 = 8;
    // 4 Worlds, 8 agents, 3200 ticks: more than 100,000 steps of physics.
    let worlds = (0..4).map(|world| build_world(&GAME, mode, 3, world * AGENTS, AGENTS));
    let mut worlds: Vec<_> = worlds.collect();
    for (world, agents) in &mut worlds {
        for &agent in agents.iter() {
            let queue = LevelQueue::Uniform { first: 0, last: 63 };
            world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, queue));
        }
    }
    on_threads(&mut worlds, threads, |(world, agents)| {
        let mut trace = Vec::new();
        for _ in 0..3200 {
            world.tick().expect("sound");
            trace.extend(agents.iter().filter_map(|&agent| world.get::<StateHash>(agent)).map(|hash| hash.0));
        }
        trace
    })
}

#[test]
fn a_hundred_thousand_steps_are_the_same_on_one_and_on_two_threads() {
    for mode in ["medium", "medium+contact=rapier", "random+limit=200"] {
        let one = traces(mode, 1);
        assert!(one.iter().map(Vec::len).sum::<usize>() > 100_000);
        assert!(one == traces(mode, 2), "{mode}");
        let mut different = one.concat();
        different.sort_unstable();
        different.dedup();
        assert!(different.len() > 95_000, "{mode}: only {} different states", different.len());
    }
}

/// Returns the ends of the first `episodes` episodes of the demonstrator.
fn evaluated(text: &str, player: &Player, levels: u64) -> Vec<playbot_harness::eval::EpisodeResult> {
    let plan = EvalPlan { arenas: 8, ..plan(&format!("{text}:0..{}", levels - 1)) };
    evaluate(&GAME, player, &plan, |_| {}).expect("sound")
}

#[test]
fn only_the_clock_ends_d4rl_s_episodes_and_success_is_known_all_the_same() {
    let results = evaluated("medium", &Player::Demonstrator, 16);
    assert!(results.iter().all(|result| result.end == EpisodeEnd::Truncated && result.ticks == 600 && result.success));
    let still = Player::Blind(BlindBot::Constant(ActionValue::Continuous(vec![0.0, 0.0])));
    let results = evaluated("medium+fixed-start+limit=50", &still, 4);
    assert!(results.iter().all(|result| result.end == EpisodeEnd::Truncated && result.ticks == 50 && !result.success));
    for text in ["medium+end-at-goal", "random+end-at-goal"] {
        let results = evaluated(text, &Player::Demonstrator, 16);
        assert!(results.iter().all(|result| result.end == EpisodeEnd::Terminated { success: true }), "{text}");
        assert!(results.iter().all(|result| result.success && result.ticks < mode(text).limit));
    }
}

/// Otherwise no policy would learn to get there.
#[test]
fn the_way_to_the_goal_is_what_pays() {
    for text in ["umaze", "medium", "large", "random", "random+sparse", "random+sparse+end-at-goal"] {
        let paid = |player| evaluated(text, &player, 16).iter().map(|result| result.total_reward).sum::<f64>();
        let (goes, strays) = (paid(Player::Demonstrator), paid(Player::Blind(BlindBot::Uniform)));
        assert!(goes > strays, "{text}: {goes} for the demonstrator, {strays} for random pushes");
    }
}

#[test]
fn what_is_fixed_stays_where_goals_are_drawn() {
    let mode = mode("random+size=5x5+loops=1+fixed-start+goal=random+end-at-goal");
    for seed in 0..100 {
        let level = Maze2dLevel::new(&mode, seed).expect("a level");
        assert_eq!(level.start_cell, level.maze.start());
        assert_ne!(level.goal_cell, level.start_cell);
    }
}

#[test]
fn actions_out_of_range_are_clipped_and_counted() {
    let double = Player::Blind(BlindBot::Constant(ActionValue::Continuous(vec![2.0, -0.5])));
    let whole = Player::Blind(BlindBot::Constant(ActionValue::Continuous(vec![1.0, -0.5])));
    let (clipped, plain) = (evaluated("umaze", &double, 4), evaluated("umaze", &whole, 4));
    assert!(clipped.iter().all(|result| result.clipped == 300) && plain.iter().all(|result| result.clipped == 0));
    assert!(clipped.iter().zip(&plain).all(|(a, b)| a.total_reward == b.total_reward), "2 is played as 1");
    let split = "umaze:0..3".parse().expect("a split");
    assert_eq!(summarize("double", &split, &clipped).clipped, 1.0);
    assert_eq!(summarize("whole", &split, &plain).clipped, 0.0);
}

#[test]
fn an_action_that_is_no_number_is_a_fault_that_names_its_agent() {
    let (mut world, agent) = one_agent("medium", 3);
    world.ticks(2).expect("sound");
    world.entity_mut(agent).insert(push(0.5, f32::NAN));
    let fault = world.tick().expect_err("NaN").to_string();
    assert_eq!(fault, "agent 0, level 3, tick 2: continuous action has NaN at index 1");
    assert_eq!(world.get::<Control>(agent), Some(&Control::Idle), "the agent is stopped");
    world.ticks(3).expect("the World goes on");
}

#[test]
fn a_level_that_cannot_be_made_is_a_fault_that_says_why() {
    let (mut world, _) = one_agent("random+size=5x5+difficulty=500..600", 3);
    let fault = world.tick().expect_err("no such maze").to_string();
    assert!(fault.starts_with("agent 0, level 3: ") && fault.contains("500"), "{fault}");
}

#[test]
fn recordings_replay_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    for (index, text) in
        ["medium+retarget", "random+end-at-goal", "umaze+contact=rapier+sparse"].into_iter().enumerate()
    {
        let path = folder.path().join(format!("{index}.demo"));
        record_demonstrator(&GAME, text, 0.5, &path, 0..6);
        let report = verify_file(&GAME, &path, |_| {}).expect("readable");
        assert_eq!((report.episodes, report.divergences.len()), (6, 0), "{text}: {:?}", report.divergences);
        let reader = DemoReader::open(&path).expect("readable");
        assert_eq!(reader.header().mode, text);
        let episodes = reader.read_all().expect("whole");
        let end = if text.contains("end-at-goal") { DemoEnd::Terminated { success: true } } else { DemoEnd::Truncated };
        assert!(episodes.iter().all(|episode| episode.end == end), "{text}");
    }
}

#[test]
fn rays_meet_the_walls_and_the_ball_of_their_own_arena() {
    for (text, physics) in [("medium", true), ("medium+contact=rapier", false)] {
        let (mut world, agents) = build_world(&Maze2d { physics }, text, 0, 0, 2);
        for (&agent, level) in agents.iter().zip([1, 2]) {
            world.entity_mut(agent).insert((Control::Human, push(0.3, 0.2), LevelQueue::Always(level)));
        }
        world.ticks(30).expect("sound");
        for &agent in &agents {
            let ball = world.get::<MazeBall>(agent).expect("a ball").0;
            let arena = world.get::<PlaysIn>(agent).expect("an agent").0;
            let physics = world.get::<MazePhysics>(arena).expect("a context");
            let place = physics.world.bodies[physics.ball()].translation();
            assert!((f64::from(place.x) - ball.position[0]).abs() < 1e-5, "{text}: the body is where the ball is");
            // From the middle of the cell (1, 1) towards smaller x: the wall cell (0, 1) ends at 0.3.
            let ray = Ray::new(Vector::new(0.8, 0.8), Vector::new(-1.0, 0.0));
            let filter = QueryFilter::default().exclude_rigid_body(physics.ball());
            let (collider, distance) = physics.world.cast_ray(&ray, 9.0, true, filter).expect("a wall");
            assert_eq!(collider, physics.walls());
            assert!((distance - 0.5).abs() < 1e-5, "{text}: {distance}");
        }
    }
}
