//! The corridor as pictures: recordings, skills and policies of it.

use std::path::Path;

use bevy_playbot::{bot::BlindBot, demo::file::DemoWriter, vision::ObservationConfig};
use playbot_lab::{
    demo::dataset::Demonstrations,
    prelude::*,
    train::{Experiment, config_file::parse_experiment},
    worlds::build_world,
};
use playbot_learner::{DeviceKind, Learner as _, Policy, PolicySpec, PpoLearner, SkillModel, SkillTrainer};
use playbot_tests::{Corridor, PaintedCorridor};

const EXPERIMENT: &str = r#"(
    game: "corridor", train: "plain:0..7", test: "plain:8..15", demos: "unused",
    observation: Raster, image: (width: 16, height: 16, stack: 4, grayscale: true),
    steps: 1536, arenas: 8, worlds: 2,
    skills: (window: 3, epochs: 3, batch: 16, hidden: [16], gru_hidden: 8, latent: 2, lr: 0.003,
        cnn: Impala(channels: [4], feature: 16)),
    ppo: (num_steps: 32, minibatches: 4, hidden: [16], lr: 0.003, cnn: Impala(channels: [4], feature: 16)),
    score: (horizon: 3),
)"#;

pub fn experiment() -> Experiment {
    parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid")
}

/// Recordings of a random walker, on levels that are not held out, with one episode that is there twice.
pub fn record(folder: &Path) {
    let header = Corridor.demo_header("plain");
    for (name, seed) in [("a.demo", 5), ("b.demo", 6), ("c.demo", 6)] {
        let (mut world, agents) = build_world(&Corridor, "plain", seed, 0, 1);
        world.insert_resource(Recorder::new(DemoWriter::create(folder.join(name), header.clone()).expect("fresh")));
        let levels: Vec<u64> = (20..44).collect();
        let queue = LevelQueue::list(levels);
        world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, Recording::default(), queue));
        while world.get::<Control>(agents[0]).is_some_and(|control| control.is_active()) {
            world.tick().expect("sound");
        }
    }
}

pub fn demonstrations(folder: &Path, observation_config: &ObservationConfig) -> Demonstrations {
    let test = experiment().test;
    Demonstrations::read(&PaintedCorridor, observation_config, folder, Some(&test)).expect("readable")
}

/// A skill model that has seen the recordings of `folder`.
pub fn skills(folder: &Path) -> SkillModel {
    let (config, observation_config) = (experiment().skills, experiment().observation_config());
    let dataset = demonstrations(folder, &observation_config).dataset(&PaintedCorridor, 2, |_| {}).expect("replays");
    let epochs = config.epochs;
    let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("valid");
    for _ in 0..epochs {
        trainer.train_epoch(&mut |_| std::ops::ControlFlow::Continue(())).expect("learns");
    }
    let path = folder.join("skills.safetensors");
    trainer.into_model().with_picture(observation_config.card()).save(&path).expect("writable");
    SkillModel::load(&path, DeviceKind::Flex).expect("as written")
}

/// An untrained policy of pictures.
pub fn untrained(observation_config: &ObservationConfig) -> Policy {
    let config = experiment().ppo;
    let spec =
        PolicySpec { obs: observation_config.image.obs_kind(), latent: 0, action_space: PaintedCorridor.actions() };
    PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect("valid").policy()
}
