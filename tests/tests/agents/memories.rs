//! Tests of policies that remember: what they remember lives with the agent, ends with the episode, and is learned from.

use bevy::prelude::*;
use bevy_playbot::{policy::AgentMemory, vision::ObservationConfig};
use playbot::prelude::*;
use playbot_learner::{
    DeviceKind, Learner, MemoryKind, Observations, Policy, PolicySpec, PpoConfig, PpoLearner, Rollout,
};
use playbot_tests::{
    Corridor,
    training::{check_resuming, train, untrained, written},
};
use playbot_train::{Algorithm, Trainer, collect::Collector, experiment::file::parse_experiment};
use std::path::Path;

const AGENTS: usize = 6;
const TICKS: usize = 90;
const WIDTH: usize = 8;

const GRU: MemoryKind = MemoryKind::Gru { hidden: WIDTH, sequence: 8, burn_in: 2 };

fn policy() -> Policy {
    let config = PpoConfig { memory: GRU, hidden: vec![8], ..PpoConfig::default() };
    untrained(&Corridor, &ObservationConfig::default(), config)
}

fn collector() -> Collector {
    let split: LevelSplit = "plain:0..7".parse().expect("a split");
    let collector = Collector::new(&Corridor, &split, &ObservationConfig::default(), 3, 0, AGENTS as u32, None);
    collector.expect("can be seen")
}

/// Returns row `at` of the observations.
fn seen(observations: &Observations, at: usize) -> Vec<f32> {
    match observations.row(at, 2) {
        playbot_learner::ObsSlice::Vector(numbers) => numbers.to_vec(),
        playbot_learner::ObsSlice::Image(_) => panic!("the corridor has no pictures here"),
    }
}

fn memory(all: &[f32], at: usize) -> &[f32] {
    &all[at * WIDTH..(at + 1) * WIDTH]
}

#[test]
fn memories_begin_with_the_episode_and_follow_the_observations() {
    let policy = policy();
    let mut collector = collector();
    let (first, _) = collector.collect(&policy, 0, TICKS).expect("sound");
    let (second, _) = collector.collect(&policy, 0, TICKS).expect("sound");
    let mut begun = vec![true; AGENTS];
    let mut after = vec![vec![0.0; WIDTH]; AGENTS];
    let mut ended = 0;
    for rollout in [&first, &second] {
        let done = rollout.done();
        for (at, &is_done) in done.iter().enumerate() {
            let agent = at % AGENTS;
            let before = if begun[agent] { &[0.0; WIDTH][..] } else { &after[agent] };
            assert_eq!(memory(&rollout.memory, at), before, "row {at}");
            let output = policy.forward_remembering(&[], &[], before, &seen(&rollout.obs, at), 1).expect("fits");
            assert_eq!(rollout.values[at], output.values[0], "row {at}: the value of what is remembered");
            (after[agent], begun[agent]) = (output.memory, is_done);
            ended += usize::from(is_done);
        }
        ends_are_valued_with_what_is_remembered(&policy, rollout, &after, &begun);
    }
    assert!(ended > 4, "{ended} episodes ended");
}

fn ends_are_valued_with_what_is_remembered(policy: &Policy, rollout: &Rollout, after: &[Vec<f32>], begun: &[bool]) {
    let ends = &rollout.ends;
    let value = |memory: &[f32], obs: &[f32]| policy.values_remembering(&[], &[], memory, obs, 1).expect("fits")[0];
    for (i, &row) in ends.cut_rows.iter().enumerate() {
        let before = memory(&rollout.memory, row);
        let after = policy.forward_remembering(&[], &[], before, &seen(&rollout.obs, row), 1).expect("fits").memory;
        assert_eq!(memory(&ends.cut_memory, i), after, "row {row}");
        assert_eq!(rollout.final_values[row], value(&after, &seen(&ends.cut_obs, i)), "row {row}");
    }
    for agent in (0..AGENTS).filter(|&agent| !begun[agent]) {
        assert_eq!(memory(&ends.next_memory, agent), after[agent]);
        assert_eq!(rollout.next_values[agent], value(&after[agent], &seen(&ends.next_obs, agent)));
    }
}

/// Returns a trainer of policies that remember, with four Worlds.
fn trainer(threads: usize) -> Trainer {
    let text = r#"(game: "corridor", train: "plain:0..7", test: "plain:8..15", steps: 1024, arenas: 8, worlds: 4,
        algorithm: "ppo", ppo: (num_steps: 32, minibatches: 4, hidden: [16], lr: 0.003,
        memory: Gru(hidden: 8, sequence: 8, burn_in: 2)))"#;
    let experiment = parse_experiment(text, Path::new("test.ron")).expect("valid");
    assert_eq!((experiment.ppo.memory, experiment.algorithm), (GRU, Algorithm::Ppo));
    Trainer::new(&Corridor, &experiment, None, DeviceKind::Flex, threads).expect("fits")
}

#[test]
fn threads_and_stops_change_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let bytes: Vec<_> = [1, 2, 8]
        .into_iter()
        .map(|threads| {
            let run = folder.path().join(threads.to_string());
            train(&run, trainer(threads), None);
            written(&run)
        })
        .collect();
    assert!(bytes[0] == bytes[1] && bytes[1] == bytes[2], "the number of threads changes the run");
    check_resuming(&Corridor, trainer, 2);
}

#[test]
fn an_agent_without_a_memory_is_named() {
    let spec = PolicySpec { obs: 1.into(), latent: 0, action_space: ActionSpace::Discrete(3) };
    let tick = |memory, without| {
        let policy = PpoLearner::new(PpoConfig { memory, ..PpoConfig::default() }, spec, 1, DeviceKind::Flex);
        let policy = policy.expect("good settings").policy();
        let mut app = headless_app();
        app.insert_resource(ActivePolicy { policy, draw: ActionDraw::Sample }).insert_resource(PlaybotSeed(7));
        app.add_systems(ObserveSchedule, |mut agents: Query<&mut Observation>| {
            agents.iter_mut().for_each(|mut seen| seen.set([0.5]));
        });
        let agent = (Agent::new(4, ActionSpace::Discrete(3)), VectorSensor::new(["x"]), Control::Policy);
        let agent = app.world_mut().spawn(agent).id();
        if without {
            app.world_mut().entity_mut(agent).remove::<AgentMemory>();
        }
        app.tick().map(|()| app.world().get::<AgentMemory>(agent).map_or(0, |memory| memory.0.len()))
    };
    assert_eq!(tick(GRU, false).expect("it remembers"), WIDTH);
    let fault = tick(GRU, true).expect_err("it cannot remember").to_string();
    assert!(fault.contains("agent 4: the policy remembers 8 numbers") && fault.contains("AgentMemory"), "{fault}");
    assert_eq!(tick(MemoryKind::None, true).expect("a policy without memory needs none"), 0);
}
