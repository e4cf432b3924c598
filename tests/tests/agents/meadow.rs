//! The example `meadow`: sets of things from the game through recordings and training to a policy file.

#[path = "../../../plugin/cli/examples/meadow.rs"]
#[allow(dead_code, reason = "its `main` is for those who run the example")]
mod meadow_example;

use std::path::Path;

use bevy_playbot::{entities::EntitySet, observation::Observation};
use playbot::prelude::*;
use playbot_harness::{demo::verify_file, held_out::HeldOut, worlds::build_world};
use playbot_learner::{DeviceKind, EntityKind, PolicyFile, SkillModel};
use playbot_tests::{
    recording::record_random,
    training::{check_resuming, learn_skills},
};
use playbot_train::{
    Algorithm, Experiment, TrainError, Trainer,
    experiment::file::parse_experiment,
    policy_export::{Provenance, policy_file},
};

use meadow_example::Meadow;

const EXPERIMENT: &str = r#"(
    game: "meadow", train: "few:0..7", test: "few:8..15", demos: "unused", steps: 1024, arenas: 8, worlds: 2,
    skills: (window: 3, epochs: 2, batch: 16, hidden: [16], encoder_hidden: 8, gru_hidden: 8, latent: 2, norm_obs: true,
             entities: Set(hidden: 8)),
    ppo: (num_steps: 32, minibatches: 4, hidden: [16, 16], lr: 0.003, entities: Set(hidden: 8)),
    sac: (num_steps: 8, batch: 32, buffer: 512, learning_starts: 200, hidden: [16, 16], updates_per_step: 0.1),
    score: (horizon: 3),
)"#;

fn experiment(algorithm: Algorithm) -> Experiment {
    Experiment { algorithm, ..parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid") }
}

fn skills(folder: &Path, algorithm: Algorithm) -> SkillModel {
    let path = folder.join(format!("{algorithm}.demo"));
    record_random(&Meadow, "few", 5, &path, 16..40);
    let report = verify_file(&Meadow, &path, |_| {}).expect("readable");
    assert!(report.ticks > 50 && report.divergences.is_empty(), "{report:?}");
    learn_skills(&Meadow, &Experiment { demos: Some(path), ..experiment(algorithm) }, 2)
}

fn trainer(algorithm: Algorithm, skills: Option<&SkillModel>, threads: usize) -> Result<Trainer, TrainError> {
    Trainer::with_demos(&Meadow, &experiment(algorithm), skills, &[], DeviceKind::Flex, threads)
}

#[test]
fn the_meadow_shows_what_is_there_and_the_nearest_first() {
    let sets = Meadow.observation().sets();
    let words: Vec<String> = sets.iter().map(ToString::to_string).collect();
    assert_eq!(words, ["berry: up to 8 with dx, dy", "wasp: up to 4 with dx, dy, vx, vy"]);
    for (mode, berries) in [("few", 2..=3), ("many", 6..=8)] {
        let (mut world, agents) = build_world(&Meadow, mode, 1, 0, 2);
        for (agent, level) in agents.iter().zip([3, 4]) {
            world.entity_mut(*agent).insert((
                Control::Bot,
                BlindBot::Constant(ActionValue::Discrete(0)),
                LevelQueue::list([level]),
            ));
        }
        world.tick().expect("sound");
        for agent in agents {
            let seen = world.get::<Observation>(agent).expect("every agent has one").vector.clone();
            let slots: Vec<&[f32]> = seen[sets[0].block.range()].chunks(3).collect();
            let far: Vec<f32> =
                slots.iter().filter(|slot| slot[0] == 1.0).map(|slot| slot[1] * slot[1] + slot[2] * slot[2]).collect();
            assert!(berries.contains(&far.len()) && far.is_sorted(), "{mode}: {slots:?}");
            assert!(slots[far.len()..].iter().all(|slot| *slot == [0.0; 3]), "{slots:?}");
        }
    }
}

#[test]
fn all_learners_of_sets_go_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let skills = skills(folder.path(), Algorithm::ScorePpo);
    assert_eq!(skills.config().entities.blocks().len(), 2);
    for algorithm in [Algorithm::Ppo, Algorithm::ScorePpo, Algorithm::SpirlPpo] {
        let given = algorithm.needs_skills().then_some(&skills);
        let policy = trainer(algorithm, given, 1).expect("fits").policy();
        assert_eq!(policy.entities().len(), 2, "{algorithm}");
        check_resuming(&Meadow, |threads| trainer(algorithm, given, threads).expect("fits"), 2);
    }
}

#[test]
fn a_policy_file_of_sets_plays_in_the_game() {
    let folder = tempfile::tempdir().expect("a folder");
    let trainer = trainer(Algorithm::Ppo, None, 1).expect("fits");
    let about = Provenance { algorithm: "ppo".into(), training: "none".into(), seen: None, code: "test".into() };
    let config = trainer.experiment().observation_config();
    let file = policy_file(&Meadow, &config, trainer.policy(), None, about);
    let path = folder.path().join("meadow.policy");
    playbot_train::policy_export::export_policy(&Meadow, &file, &trainer.experiment().train, 1, &path)
        .expect("written");
    let loaded = PolicyFile::load(&path, DeviceKind::Flex).expect("read");
    let sets: Vec<_> = EntitySet::all_in(&loaded.metadata.observations).into_iter().map(|set| set.block).collect();
    assert_eq!(loaded.policy.entities(), sets);
    let (mut world, agents) = build_world(&Meadow, "many", 1, 0, 1);
    bevy_playbot::policy_file::check_policy(&Meadow.metadata(), &loaded).expect("made for this game");
    bevy_playbot::policy_file::install_policy(&mut world, &loaded, ActionDraw::Sample);
    world.entity_mut(agents[0]).insert((Control::Policy, LevelQueue::list([5])));
    for _ in 0..250 {
        world.tick().expect("the policy acts as the game allows");
    }
    assert_eq!(world.get::<EpisodeCount>(agents[0]).expect("required by Agent").finished, 1);
}

#[test]
fn sac_reads_the_slots_as_values_and_so_do_its_skills() {
    let folder = tempfile::tempdir().expect("a folder");
    let of_sets = skills(folder.path(), Algorithm::ScorePpo);
    let error = trainer(Algorithm::ScoreSac, Some(&of_sets), 1).map(|_| ()).expect_err("it reads values").to_string();
    assert!(error.contains("skills.entities=Flat"), "{error}");
    let flat = skills(folder.path(), Algorithm::ScoreSac);
    assert_eq!(flat.config().entities, EntityKind::Flat);
    for (algorithm, skills) in [(Algorithm::ScoreSac, Some(&flat)), (Algorithm::Sac, None)] {
        let policy = trainer(algorithm, skills, 1).expect("fits").policy();
        assert!(policy.entities().is_empty(), "{algorithm}");
    }
}

#[test]
fn a_stack_of_sets_is_refused_before_a_training() {
    let stack = experiment(Algorithm::Ppo).with_set(&["ppo.memory=Stack(ticks: 3)"]).expect("valid");
    let error = stack.check_agent(&Meadow).expect_err("no stack of sets").to_string();
    assert!(error.contains("ppo.memory") && error.contains("use a Gru"), "{error}");
    let flat = stack.with_set(&["ppo.entities=Flat"]).expect("valid");
    flat.check_agent(&Meadow).expect("a stack of values");
    assert!(HeldOut::new(&Meadow, &flat.test).first_of(&flat.train).is_none());
}
