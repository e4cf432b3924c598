//! Tests of CoinRun as a Bevy game: the same as its rules, open to additions, with colliders for rays.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_rapier2d::prelude::*;
use playbot::prelude::*;
use playbot_games::coinrun::{
    Body, CoinRun, CoinRunEnd, Mode, Sim,
    components::{ArenaBody, Crate, InArena, LastOutcome, PlayerBody, PlaysIn, Saw},
    generator::generate,
};
use playbot_harness::{saved_episode::SavedEpisode, worlds::build_world};

/// Random numbers without a crate: a linear congruential generator is plenty for choosing buttons.
struct Buttons(u64);

impl Buttons {
    fn next(&mut self) -> u8 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let pressed = (self.0 >> 33) as u8 % 30;
        // Mostly right and jump, so that episodes get somewhere.
        if pressed < 15 { pressed } else { 7 + pressed % 2 }
    }
}

#[test]
fn the_game_and_the_pure_simulation_never_differ() {
    for mode in [Mode::Easy, Mode::Hard] {
        let (mut world, agents) = build_world(&CoinRun::default(), mode.name(), 0, 0, 1);
        let agent = agents[0];
        for seed in 0..40_u32 {
            world.entity_mut(agent).insert((Control::Human, LevelQueue::Always(seed.into())));
            let mut sim = Sim::new(Arc::new(generate(mode, seed)));
            let mut buttons = Buttons(seed.into());
            while sim.end().is_none() {
                let button = buttons.next();
                let expected = sim.step(button);
                world.entity_mut(agent).insert(Action(ActionValue::Discrete(button.into())));
                world.tick().expect("sound");
                assert_eq!(world.get::<PlayerBody>(agent).expect("a player").0, *sim.player(), "{mode} {seed}");
                assert_eq!(world.get::<StateHash>(agent).expect("an agent").0, sim.state_hash());
                assert_eq!(world.get::<Reward>(agent).expect("an agent").get(), expected.reward);
            }
            assert_eq!(world.get::<LastOutcome>(agent).expect("a player").0, sim.end());
        }
    }
}

/// Plays ticks with these buttons, and returns the state hash, the observation and the reward after each.
fn play(world: &mut World, agent: Entity, buttons: &[u8]) -> Vec<(u64, Vec<f32>, f32)> {
    let mut states = Vec::new();
    for &button in buttons {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(button.into())));
        world.tick().expect("sound");
        let hash = world.get::<StateHash>(agent).expect("an agent").0;
        let seen = world.get::<Observation>(agent).expect("an agent").vector.clone();
        states.push((hash, seen, world.get::<Reward>(agent).expect("an agent").get()));
    }
    states
}

#[test]
fn an_episode_goes_on_to_the_bit_from_a_snapshot_in_another_world() {
    let game = CoinRun::default();
    for level in 0..20_u64 {
        let mut buttons = Buttons(level);
        let mut draw = |count: usize| -> Vec<u8> { (0..count).map(|_| buttons.next()).collect() };
        let [before, after, other] = [30, 40, 9].map(&mut draw);
        let world = || {
            let (mut world, agents) = build_world(&game, "hard", 0, 0, 2);
            world.entity_mut(agents[1]).insert((Control::Human, LevelQueue::Always(level)));
            (world, agents[1])
        };
        let (mut first, agent) = world();
        play(&mut first, agent, &before);
        let saved = SavedEpisode::of(&game, &first, agent);
        let expected = play(&mut first, agent, &after);
        // An episode may end earlier, by a saw.
        let Some(saved) = saved else { continue };
        let (mut second, agent) = world();
        assert!(!saved.restore(&game, &mut second, agent), "no level was built yet");
        play(&mut second, agent, &other);
        assert!(saved.restore(&game, &mut second, agent), "{level}");
        assert_eq!(play(&mut second, agent, &after), expected, "{level}");
    }
}

#[test]
fn a_game_may_add_a_saw_and_a_crate() {
    let (mut world, agents) = build_world(&CoinRun::default(), "easy", 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Human, Action(ActionValue::Discrete(4)), LevelQueue::Always(0)));
    world.tick().expect("sound");
    let arena = world.get::<PlaysIn>(agent).expect("a player").0;
    world.spawn((Crate::default(), ArenaBody(Body::block([1, 2])), InArena(arena)));
    world.entity_mut(agent).insert(Action(ActionValue::Discrete(5)));
    for _ in 0..40 {
        world.tick().expect("sound");
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(4)));
    }
    let player = world.get::<PlayerBody>(agent).expect("a player").0;
    assert!((player.y - (3.0 + player.ry)).abs() < 1e-4, "stands on the added crate, not at {}", player.y);
    world.spawn((Saw, ArenaBody(Body::block([1, 3])), InArena(arena)));
    world.tick().expect("sound");
    assert_eq!(world.get::<LastOutcome>(agent).expect("a player").0, Some(CoinRunEnd::Saw));
    assert_eq!(CoinRun::default().tools().state.end_cause(&world, agent), Some("saw"));
}

#[test]
fn levels_beyond_32_bits_are_a_fault_and_no_panic() {
    let (mut world, agents) = build_world(&CoinRun::default(), "hard", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Human, LevelQueue::Always(1 << 40)));
    assert!(world.tick().expect_err("no such level").to_string().contains("32 bits"));
}

#[test]
fn bodies_of_players_who_wait_for_their_first_level_have_a_context() {
    let (mut world, agents) = build_world(&CoinRun { physics: true }, "hard", 0, 0, 2);
    world.ticks(3).expect("both are idle");
    world.entity_mut(agents[1]).insert((Control::Human, LevelQueue::Always(7)));
    world.ticks(3).expect("one of two plays");
}

#[test]
fn rays_hit_the_ground_and_the_crates_of_their_own_arena() {
    let (mut world, agents) = build_world(&CoinRun { physics: true }, "hard", 0, 0, 2);
    for (&agent, level) in agents.iter().zip([0_u64, 7]) {
        world.entity_mut(agent).insert((Control::Human, Action(ActionValue::Discrete(4)), LevelQueue::Always(level)));
    }
    world.ticks(3).expect("sound");
    for (&agent, level) in agents.iter().zip([0_u32, 7]) {
        let layout = generate(Mode::Hard, level);
        let arena = world.get::<PlaysIn>(agent).expect("a player").0;
        let mut contexts = world.query::<(
            &RapierContextSimulation,
            &RapierContextColliders,
            &RapierContextJoints,
            &RapierRigidBodySet,
        )>();
        let (simulation, colliders, joints, rigidbody_set) = contexts.get(&world, arena).expect("a context per arena");
        let context = RapierContext { simulation, colliders, joints, rigidbody_set };
        let wall = (5..64).find(|&x| layout.tiles.get(x, 1).is_wall()).expect("some wall") as f32;
        let filter = QueryFilter::default().exclude_rigid_body(agent).exclude_sensors();
        let hit =
            context.with_query_pipeline(filter, |pipeline| pipeline.cast_ray(Vec2::new(2.6, 1.5), Vec2::X, 60.0, true));
        let (_, distance) = hit.expect("the ray meets a wall");
        assert!((distance - (wall - 2.6)).abs() < 1e-3, "level {level}: {distance} instead of {}", wall - 2.6);
    }
}
