//! The corridor as pictures: recordings, skills and policies of it.

use std::path::Path;

use bevy_playbot::vision::ObservationConfig;
use playbot_learner::{DeviceKind, SkillModel};
use playbot_tests::{Corridor, PaintedCorridor, recording::record_random, training::learn_skills};
use playbot_train::{Experiment, demo::Demonstrations, experiment::file::parse_experiment};

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

/// Records a random walker, on levels that are not held out, with one episode that is there twice.
pub fn record(folder: &Path) {
    for (name, seed) in [("a.demo", 5), ("b.demo", 6), ("c.demo", 6)] {
        record_random(&Corridor, "plain", seed, &folder.join(name), 20..44);
    }
}

pub fn demonstrations(folder: &Path, observation_config: &ObservationConfig) -> Demonstrations {
    let test = experiment().test;
    Demonstrations::read(&PaintedCorridor, observation_config, folder, Some(&test)).expect("readable")
}

/// Learns a skill model from the recordings of `folder`.
pub fn skills(folder: &Path) -> SkillModel {
    let experiment = Experiment { demos: Some(folder.to_owned()), ..experiment() };
    let learned = learn_skills(&PaintedCorridor, &experiment, 2);
    let path = folder.join("skills.safetensors");
    learned.save(&path).expect("writable");
    SkillModel::load(&path, DeviceKind::Flex).expect("as written")
}
