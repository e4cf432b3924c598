//! Tests of games with fixed ticks that pause Bevy's clock: each program ends with a fault.

use std::collections::BTreeSet;

use bevy::prelude::*;
use bevy_playbot::vision::ObservationConfig;
use playbot::prelude::*;
use playbot_harness::{
    doctor::{DoctorOptions, examine},
    eval::{EvalPlan, Player, evaluate},
    worlds::build_world,
};
use playbot_learner::DeviceKind;
use playbot_test::{
    detectors::Detectors,
    verdict::{LevelVerdict, TestEnd, TestError, TestObserver, TestPlan, Tester, TesterRecord, run_tests},
};
use playbot_tests::{as_corridor, corridor_plugin, measuring::plan, small::experiment};
use playbot_train::{Algorithm, Trainer};

/// The corridor, which pauses its clock in the third tick of this level and of those after it.
struct Asleep {
    from: u64,
}

impl Game for Asleep {
    as_corridor! { but build }

    fn build(&self, app: &mut App, _mode: &str) {
        corridor_plugin(app);
        let from = self.from;
        app.add_systems(FixedUpdate, move |episodes: Query<&Episode>, mut clock: ResMut<Time<Virtual>>| {
            if episodes.iter().any(|episode| episode.level >= from && episode.tick == 2) {
                clock.pause();
            }
        });
    }
}

const WORDS: &str = "no tick passes since tick 3: the game's clock (`Time<Virtual>`) is paused";

/// A bot that stays, so that no episode ends before its time is up.
fn stay() -> BlindBot {
    BlindBot::Constant(ActionValue::Discrete(2))
}

#[test]
fn an_evaluation_ends_with_agent_level_and_tick() {
    let plan = EvalPlan { arenas: 1, worlds: 1, threads: 1, ..plan("plain:0..3") };
    let fault = evaluate(&Asleep { from: 3 }, &Player::Blind(stay()), &plan, |_| {}).expect_err("the clock is paused");
    let words = format!("agent 0, level 3, tick 3: {WORDS}");
    assert!(fault.to_string().contains(&words), "{fault}");
}

#[test]
fn a_recording_ends_in_the_tick_after_the_pause() {
    let (mut world, agents) = build_world(&Asleep { from: 0 }, "plain", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, stay()));
    world.ticks(3).expect("the clock runs");
    assert!(world.tick().expect_err("the clock is paused").to_string().contains(WORDS));
}

#[test]
fn a_test_has_a_finding_on_the_level_that_pauses_the_clock() {
    let tester = Tester {
        record: TesterRecord::bot("stay"),
        player: Player::Blind(stay()),
        observation_config: ObservationConfig::default(),
    };
    let plan = TestPlan {
        split: "plain:2..3".parse().expect("levels"),
        testers: vec![tester],
        episodes: 1,
        seed: 2,
        detectors: Detectors::default(),
        shard: None,
        threads: 1,
    };
    let mut verdicts: Vec<LevelVerdict> = Vec::new();
    let mut keep = |verdict: LevelVerdict| -> Result<(), TestError> {
        verdicts.push(verdict);
        Ok(())
    };
    let watch = TestObserver { progress: &|_| {}, stop: &|| false };
    let end = run_tests(&Asleep { from: 3 }, &plan, &BTreeSet::new(), &mut keep, &watch).expect("it can be played");
    assert_eq!(end, TestEnd::Done);
    verdicts.sort_by_key(|verdict| verdict.index);
    let is_paused = |verdict: &LevelVerdict| verdict.findings.iter().any(|finding| finding.message.contains(WORDS));
    assert_eq!(verdicts.iter().map(is_paused).collect::<Vec<_>>(), [false, true], "{verdicts:?}");
}

#[test]
fn a_training_ends_instead_of_learning_the_same_tick_again_and_again() {
    let experiment = experiment(Algorithm::Ppo);
    let mut trainer = Trainer::new(&Asleep { from: 0 }, &experiment, None, DeviceKind::Flex, 1).expect("fits");
    // Both arenas play more than three ticks of an episode in the 16 ticks of an update.
    let error = trainer.update().expect_err("the clock is paused").to_string();
    assert!(error.contains("the game's clock (`Time<Virtual>`) is paused"), "{error}");
}

#[test]
fn the_doctor_reports_the_pause() {
    let report = examine(&Asleep { from: 0 }, &DoctorOptions::new("plain"), |_| {}).expect("it has the mode");
    assert!(report.findings.iter().any(|finding| finding.what.contains(WORDS)), "{report}");
}
