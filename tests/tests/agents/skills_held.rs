//! Tests that skills are drawn at the first tick of an episode and then every T ticks, by each agent for itself.

use bevy::prelude::*;
use bevy_playbot::{streams::AgentStreams, vision::ObservationConfig};
use playbot::prelude::*;
use playbot_harness::worlds::build_world;
use playbot_learner::{PpoConfig, Prior, SkillDraw, rng::normal};
use playbot_tests::{Corridor, training::untrained};
use playbot_train::collect::Collector;

/// Seed of the Worlds.
const SEED: u64 = 7;

/// Returns normally distributed skills of two numbers.
fn prior(skill_interval: u32) -> SkillPrior {
    SkillPrior { prior: Prior::standard_normal(2, false), skill_interval, draw: SkillDraw::Sample }
}

/// Returns the draws of an agent's stream.
fn draws(agent: u32, count: usize) -> Vec<Vec<f32>> {
    let mut stream = AgentStreams::new(SEED, agent).skill;
    (0..count).map(|_| vec![normal(&mut stream), normal(&mut stream)]).collect()
}

#[test]
fn a_skill_is_held_for_its_ticks_and_ends_with_its_episode() {
    let (mut world, agents) = build_world(&Corridor, "plain", SEED, 0, 3);
    world.insert_resource(prior(8));
    // Without a policy each agent keeps its action from here. Agent 0 stays until time is up after 20 ticks. Agent 1
    // walks from cell 3 to the exit at cell 6 in 3 ticks. Agent 2 has no skills.
    for (agent, action) in [(0, 2), (1, 1), (2, 2)] {
        let (control, bot) = if agent == 2 { (Control::Bot, 2) } else { (Control::Policy, action) };
        let bot = BlindBot::Constant(ActionValue::Discrete(bot));
        let action = Action(ActionValue::Discrete(action));
        world.entity_mut(agents[agent]).insert((control, bot, action, LevelQueue::Always(1)));
    }
    // Worked out by hand: the draw of agent 0 in each of 44 ticks, and its ticks left afterwards. The third skill of an
    // episode is cut off with 4 ticks to go.
    let stays = |episode: usize| {
        let first = (0..8).map(move |tick| (3 * episode, 7 - tick));
        let second = (0..8).map(move |tick| (3 * episode + 1, 7 - tick));
        let third = (0..4).map(move |tick| (3 * episode + 2, 7 - tick));
        first.chain(second).chain(third)
    };
    let walker: Vec<(usize, u32)> = (0..2).flat_map(stays).chain([(6, 7), (6, 6), (6, 5), (6, 4)]).collect();
    let runner: Vec<(usize, u32)> = (0..44).map(|tick| (tick / 3, 7 - tick as u32 % 3)).collect();
    let drawn = [draws(0, 7), draws(1, 15)];
    for tick in 0..44 {
        world.tick().expect("sound");
        for (agent, expected) in [&walker, &runner].into_iter().enumerate() {
            let skill = world.get::<ActiveSkill>(agents[agent]).expect("an agent");
            let (draw, left) = expected[tick];
            assert_eq!((&skill.z, skill.ticks_left), (&drawn[agent][draw], left), "agent {agent}, tick {tick}");
        }
        let idle = world.get::<ActiveSkill>(agents[2]).expect("an agent");
        assert_eq!((idle.z.len(), idle.ticks_left), (0, 0), "a bot draws no skills");
    }
    let finished = |agent: usize| world.get::<EpisodeCount>(agents[agent]).expect("an agent").finished;
    assert_eq!((finished(0), finished(1)), (2, 14));
}

#[test]
fn rollouts_hold_the_skill_of_each_tick_however_they_are_cut() {
    const AGENTS: usize = 3;
    let split: LevelSplit = "plain:0..7".parse().expect("a split");
    let observation_config = ObservationConfig::default();
    let collect = |lengths: &[usize]| {
        let mut collector =
            Collector::new(&Corridor, &split, &observation_config, SEED, 0, AGENTS as u32, Some(prior(5)))
                .expect("can be seen");
        let config = PpoConfig { hidden: vec![8], ..PpoConfig::default() };
        let policy = untrained(&Corridor, &observation_config, config);
        let (mut z, mut left, mut ends) = (Vec::new(), Vec::new(), Vec::new());
        for &steps in lengths {
            let (rollout, _) = collector.collect(&policy, 2, steps).expect("sound");
            let both = rollout.terminated.iter().zip(&rollout.truncated);
            ends.extend(both.map(|(terminated, truncated)| *terminated || *truncated));
            z.extend_from_slice(&rollout.z);
            left.extend_from_slice(&rollout.left);
        }
        (z, left, ends)
    };
    let (z, shares, ends) = collect(&[60]);
    assert_eq!(
        collect(&[17, 3, 40]),
        (z.clone(), shares.clone(), ends.clone()),
        "the states at the ends of rollouts draw nothing twice"
    );
    assert!(ends.iter().filter(|end| **end).count() > AGENTS, "episodes follow each other");
    for agent in 0..AGENTS {
        let drawn = draws(agent as u32, 60);
        let (mut draw, mut left) = (0, 0);
        for tick in 0..60 {
            let row = tick * AGENTS + agent;
            if left == 0 {
                (draw, left) = (draw + 1, 5);
            }
            assert_eq!(z[row * 2..row * 2 + 2], drawn[draw - 1][..], "agent {agent}, tick {tick}");
            assert_eq!(shares[row], left as f32 / 5.0, "agent {agent}, tick {tick}: it counts this tick, too");
            left = if ends[row] { 0 } else { left - 1 };
        }
    }
}
