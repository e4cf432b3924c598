//! Tests of a rollout in which a game breaks its contract.

use std::path::Path;

use bevy::prelude::*;
use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_learner::{DeviceKind, PpoConfig};
use playbot_tests::{
    as_corridor,
    come_and_go::{Crowded, Deadly},
    corridor_plugin,
    training::untrained,
};
use playbot_train::{collect::Collector, experiment::file::parse_experiment, trainer::Trainer};

/// A corridor that once replaces a decided action by one of another kind.
struct Meddling;

impl Game for Meddling {
    as_corridor!(but build);

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
        app.add_systems(FixedUpdate, meddle);
    }
}

fn meddle(mut ticks: Local<u32>, mut actions: Query<&mut Action>) {
    *ticks += 1;
    if *ticks == 3 {
        actions.iter_mut().for_each(|mut action| action.0 = ActionValue::Continuous(vec![0.5]));
    }
}

#[test]
fn a_collector_that_met_a_fault_goes_on() {
    let observation_config = ObservationConfig::default();
    let split: LevelSplit = "plain:0..7".parse().expect("a split");
    let mut collector = Collector::new(&Meddling, &split, &observation_config, 1, 0, 2, None).expect("can be seen");
    let policy = untrained(&Meddling, &observation_config, PpoConfig { hidden: vec![8], ..PpoConfig::default() });
    let fault = collector.collect(&policy, 0, 10).expect_err("the action is of another kind").to_string();
    assert!(fault.contains("action"), "{fault}");
    let (rollout, _) = collector.collect(&policy, 0, 10).expect("the game meddles no more");
    assert_eq!((rollout.steps, rollout.rewards.len()), (10, 20));
}

/// Returns the fault of a rollout with four agents.
fn fault_of(game: &dyn Game) -> String {
    let observation_config = ObservationConfig::default();
    let split: LevelSplit = "plain:0..7".parse().expect("a split");
    let mut collector = Collector::new(game, &split, &observation_config, 1, 0, 4, None).expect("can be seen");
    let policy = untrained(game, &observation_config, PpoConfig { hidden: vec![8], ..PpoConfig::default() });
    collector.collect(&policy, 0, 120).expect_err("the agents change").to_string()
}

#[test]
fn an_agent_that_is_despawned_in_a_rollout_is_a_fault_with_its_number_and_the_tick() {
    let fault = fault_of(&Deadly { agent: 2, tick: 100 });
    assert!(fault.starts_with("agent 2: the game despawned it in tick 100 of its World, "), "{fault}");
    assert!(fault.contains("`Episode::terminate`"), "{fault}");
}

#[test]
fn an_agent_that_is_spawned_in_a_rollout_is_a_fault_with_its_number() {
    let fault = fault_of(&Crowded);
    assert!(fault.starts_with("agent 9: the game spawned it in tick "), "{fault}");
}

#[test]
fn worlds_that_decide_together_do_not_wait_for_one_that_met_a_fault() {
    let experiment = r#"(
        game: "corridor", train: "plain:0..7", test: "plain:8..15",
        steps: 2048, arenas: 8, worlds: 8, algorithm: "ppo", ppo: (num_steps: 16, hidden: [8]),
    )"#;
    let experiment = parse_experiment(experiment, Path::new("test.ron")).expect("valid");
    let mut trainer = Trainer::new(&Meddling, &experiment, None, DeviceKind::Flex, 2).expect("fits");
    let fault = trainer.update().expect_err("the action is of another kind").to_string();
    assert!(fault.contains("action"), "{fault}");
    trainer.update().expect("the game meddles no more");
}
