//! Very short trainings of the corridor.

use std::path::Path;

use playbot_learner::{ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, SkillTrainer};
use playbot_train::{Algorithm, Experiment, Trainer, experiment::file::parse_experiment};

use crate::Corridor;

/// Steps of a recorded episode.
const STEPS: u16 = 12;

const EXPERIMENT: &str = r#"(
    game: "corridor", train: "plain:0..7", test: "plain:8..15", demos: "unused", steps: 128, arenas: 2, worlds: 1,
    skills: (window: 3, epochs: 2, batch: 16, hidden: [4], encoder_hidden: 4, gru_hidden: 4, latent: 2),
    ppo: (num_steps: 16, minibatches: 2, epochs: 1, hidden: [4]),
    sac: (num_steps: 8, batch: 8, buffer: 64, learning_starts: 16, hidden: [4], updates_per_step: 0.25),
    score: (horizon: 3),
    checkpoints: (keep: 2),
)"#;

/// Returns an experiment with this algorithm.
pub fn experiment(algorithm: Algorithm) -> Experiment {
    let experiment = parse_experiment(EXPERIMENT, Path::new("small.ron")).expect("valid");
    Experiment { algorithm, ..experiment }
}

/// Returns made-up recordings.
pub fn dataset() -> Dataset {
    let episode = |number: u16| DatasetEpisode {
        observations: (0..2 * STEPS).map(|at| f32::from((at * 5 + number) % 7) / 7.0).collect::<Vec<f32>>().into(),
        actions: Actions::Discrete((0..STEPS).map(|at| u32::from((at + number) % 3)).collect()),
    };
    Dataset::new(2, ActionSpace::Discrete(3), (0..4).map(episode).collect()).expect("good episodes")
}

/// Returns a trainer of skills at its start.
pub fn fresh_skills() -> SkillTrainer {
    let config = experiment(Algorithm::ScorePpo).skills;
    SkillTrainer::new(config, dataset(), 1, DeviceKind::Flex).expect("windows fit")
}

/// Returns a trainer of skills that has learned for a batch.
pub fn skills() -> SkillTrainer {
    let mut trainer = fresh_skills();
    trainer.train_batch().expect("finite");
    trainer
}

/// Returns a trainer at its start.
pub fn trainer(algorithm: Algorithm) -> Trainer {
    let model = algorithm.needs_skills().then(|| skills().into_model());
    Trainer::new(&Corridor, &experiment(algorithm), model.as_ref(), DeviceKind::Flex, 1).expect("fits")
}
