//! Tests of learning with continuous actions, from recording to measurement, on Maze2D.

use std::path::Path;

use bevy_playbot::{demo::file::DemoWriter, policy::ActionDraw};
use playbot::prelude::*;
use playbot_games::maze2d::Maze2d;
use playbot_harness::{
    eval::{EvalPlan, Player, evaluate, summarize},
    worlds::build_world,
};
use playbot_learner::{DeviceKind, SkillModel};
use playbot_tests::{measuring::plan, training::learn_skills};
use playbot_train::{Algorithm, Experiment, LearnerKind, Trainer, experiment::file::parse_experiment};

const GAME: Maze2d = Maze2d { physics: false };

const EXPERIMENT: &str = r#"(
    game: "maze2d", train: "umaze:0..63", test: "umaze:64..127", demos: "unused",
    steps: 200000, arenas: 32, worlds: 2,
    skills: (
        window: 10, epochs: 3, batch: 64, hidden: [64, 64], encoder_hidden: 32, gru_hidden: 32, gru_layers: 1, lr: 0.001,
    ),
    ppo: (num_steps: 128, minibatches: 8, epochs: 4, hidden: [64, 64], lr: 0.001, ent_coef: 0.0, gamma: 0.99),
    sac: (
        num_steps: 4, batch: 64, buffer: 60000, learning_starts: 1000, hidden: [64, 64], updates_per_step: 0.1,
        actor_lr: 0.001, critic_lr: 0.001, gamma: 0.98, entropy: Fixed(0.02),
    ),
    score: (horizon: 8),
)"#;

fn experiment(algorithm: Algorithm) -> Experiment {
    let experiment = parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid");
    // Learning from a buffer takes fewer steps and more time for each.
    let (steps, arenas) = match algorithm.learner() {
        LearnerKind::Ppo => (experiment.steps, experiment.arenas),
        LearnerKind::Sac => (60_000, 8),
    };
    let mut experiment = Experiment { algorithm, steps, arenas, ..experiment };
    // SAC squashes its actions, so its policy cannot be a copy of the decoder.
    experiment.score.init_from_decoder = algorithm.learner() != LearnerKind::Sac;
    experiment
}

/// Skills from 20,000 steps of the demonstrator.
fn skills() -> SkillModel {
    let folder = tempfile::tempdir().expect("a folder");
    let (path, mode) = (folder.path().join("umaze.demo"), "umaze+retarget");
    let header = GAME.demo_header(mode);
    let (mut world, agents) = build_world(&GAME, mode, 1, 0, 1);
    world.insert_resource(
        Recorder::new(DemoWriter::create(&path, header).expect("a fresh file")).with_step_limit(20_000),
    );
    GAME.tools().bots.attach_demonstrator(&mut world, agents[0], 0.5);
    let queue = LevelQueue::Uniform { first: 1000, last: 1999 };
    world.entity_mut(agents[0]).insert((Control::Bot, Recording::default(), queue));
    while world.resource::<Recorder>().steps() < 20_000 {
        world.tick().expect("sound");
    }
    let experiment = Experiment { demos: Some(path), ..experiment(Algorithm::ScorePpo) };
    learn_skills(&GAME, &experiment, 2)
}

/// Returns the mean return and success rate on the held-out levels.
fn measure(player: &Player) -> (f64, f64) {
    let plan = EvalPlan { arenas: 32, ..plan("umaze:64..127") };
    let summary = summarize("player", &plan.split, &evaluate(&GAME, player, &plan, |_| {}).expect("sound"));
    (summary.return_mean, summary.success)
}

fn train(algorithm: Algorithm, skills: &SkillModel) -> Player {
    let skills = algorithm.needs_skills().then_some(skills);
    let mut trainer = Trainer::new(&GAME, &experiment(algorithm), skills, DeviceKind::Flex, 2).expect("fits");
    let mut clipped = None;
    while !trainer.is_done() {
        clipped = trainer.update().expect("learns").clipped_share.or(clipped);
    }
    // A Gaussian has tails beyond the range, a squashed one has not.
    let clipped = clipped.unwrap_or_else(|| panic!("{algorithm}: clipped actions are counted"));
    let is_expected = match algorithm.learner() {
        LearnerKind::Ppo => clipped > 0.01,
        LearnerKind::Sac => clipped == 0.0,
    };
    assert!(is_expected, "{algorithm}: {clipped}");
    Player::Policy { policy: trainer.policy(), prior: trainer.skill_prior(), draw: ActionDraw::Sample }
}

#[test]
fn with_continuous_actions_everybody_beats_chance() {
    let skills = skills();
    let (chance, chance_success) = measure(&Player::Blind(BlindBot::Uniform));
    for algorithm in [Algorithm::Ppo, Algorithm::ScorePpo, Algorithm::Sac, Algorithm::ScoreSac] {
        let (mean, success) = measure(&train(algorithm, &skills));
        let factor = match algorithm.learner() {
            LearnerKind::Ppo => 2.0,
            LearnerKind::Sac => 1.5,
        };
        let learned = mean > factor * chance && success > factor * chance_success;
        assert!(learned, "{algorithm}: {mean} and {success} against {chance} and {chance_success}");
    }
}
