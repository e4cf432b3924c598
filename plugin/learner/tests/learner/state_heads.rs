//! Trunks that learn to predict the game's state from pictures while a skill model is trained.

use crate::image_task::{SHAPE, SIDE, WINDOW, skill_config};
use playbot_learner::rng::{Streams, below};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, LearnError, SkillConfig, SkillMetrics, SkillModel,
    SkillTrainer,
};
use std::ops::ControlFlow;

const SPACE: ActionSpace = ActionSpace::Discrete(2);

fn config(state_weight: f64) -> SkillConfig {
    SkillConfig { held_out: 0.2, state_weight, ..skill_config() }
}

/// Returns pictures of a bright spot, as vectors its row and column, with demonstrators who press a key for the half
/// with the spot.
fn demos(count: u64) -> (Dataset, Dataset) {
    let streams = Streams::new(4);
    let (mut pictures, mut vectors) = (Vec::new(), Vec::new());
    for i in 0..count {
        let mut rng = streams.stream("episode", i);
        let (mut pixels, mut state, mut actions) = (Vec::new(), Vec::new(), Vec::new());
        for _ in 0..3 * WINDOW {
            let [row, column] = [0; 2].map(|_| below(&mut rng, SIDE as u64 - 2) as usize);
            let mut picture: Vec<u8> = (0..SHAPE.numbers()).map(|_| below(&mut rng, 40) as u8).collect();
            (row..row + 3).for_each(|y| picture[y * SIDE + column..][..3].fill(255));
            pixels.extend(picture);
            state.extend([row as f32, column as f32]);
            actions.push(u32::from(column >= SIDE / 2));
        }
        let episode = |observations| DatasetEpisode { observations, actions: Actions::Discrete(actions.clone()) };
        pictures.push(episode(pixels.into()));
        vectors.push(episode(state.into()));
    }
    let dataset = |kind: playbot_learner::ObsKind, episodes| Dataset::new(kind, SPACE, episodes).expect("consistent");
    (dataset(SHAPE.into(), pictures), dataset(2.into(), vectors))
}

fn demos_with_states(count: u64) -> Dataset {
    let (pictures, states) = demos(count);
    pictures.with_states(states).expect("the same episodes")
}

fn trainer(config: SkillConfig, dataset: Dataset) -> SkillTrainer {
    SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("windows fit")
}

fn train(trainer: &mut SkillTrainer, epochs: usize) -> SkillMetrics {
    let mut epoch = || trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite").expect("not stopped");
    (0..epochs).map(|_| epoch()).last().expect("at least one")
}

#[test]
fn trunks_learn_the_state_of_pictures_they_were_not_shown() {
    let error = |weight: f64| {
        let metrics = train(&mut trainer(config(weight), demos_with_states(120)), 12);
        assert!(metrics.nll < 1.6, "the actions are learned as well: {}", metrics.nll);
        let held_out = metrics.held_out.and_then(|held_out| held_out.state_error).expect("it is measured");
        (metrics.state_error.expect("it is measured"), held_out)
    };
    // Predicting the mean costs one per step, and one for the prior.
    let (trained, held_out) = error(1.0);
    assert!(trained < 1.5 && held_out < 1.5, "{trained}, {held_out}");
    // With next to no weight only the layers over the trunks learn, and the row is not needed to press a key.
    let (_, hardly) = error(1e-9);
    assert!(hardly > 1.4 * held_out, "the trunks themselves learn: {held_out} against {hardly}");
}

#[test]
fn heads_for_the_state_are_not_part_of_the_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skills.safetensors");
    let mut trainer = trainer(SkillConfig { patience: Some(9), ..config(1.0) }, demos_with_states(12));
    train(&mut trainer, 1);
    trainer.into_model().save(&path).expect("written");
    let bytes = std::fs::read(&path).expect("readable");
    let file = safetensors::SafeTensors::deserialize(&bytes).expect("safetensors");
    assert!(file.names().iter().all(|name| !name.contains("state_heads")), "{:?}", file.names());
    SkillModel::load(&path, DeviceKind::Flex).expect("read");
}

#[test]
fn a_stopped_training_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skills.checkpoint");
    let mut whole = trainer(SkillConfig { patience: Some(9), ..config(1.0) }, demos_with_states(12));
    train(&mut whole, 1);
    whole.train_batch().expect("finite");
    whole.save(&path).expect("written");
    let mut loaded = SkillTrainer::load(&path, demos_with_states(12), DeviceKind::Flex).expect("read");
    assert_eq!(train(&mut loaded, 2), train(&mut whole, 2));
    let bytes = |trainer: &SkillTrainer| {
        trainer.save(&path).expect("written");
        std::fs::read(&path).expect("readable")
    };
    assert_eq!(bytes(&loaded), bytes(&whole));
    let without = SkillTrainer::load(&path, demos(12).0, DeviceKind::Flex).expect_err("other demonstrations");
    assert!(without.to_string().contains("state_weight needs"), "{without}");
}

#[test]
fn impossible_settings_are_refused() {
    let error = |config: SkillConfig, dataset: Dataset| {
        SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect_err("cannot work").to_string()
    };
    let (pictures, states) = demos(12);
    assert!(error(config(1.0), pictures.clone()).contains("needs demonstrations with states"));
    assert!(error(config(-1.0), pictures.clone()).contains("`skills.state_weight` must not be negative"));
    assert!(error(config(1.0), states).contains("`skills.state_weight` is for pictures"));
    let shape = |error: Result<Dataset, LearnError>| matches!(error, Err(LearnError::Shape { .. }));
    assert!(shape(pictures.clone().with_states(demos(11).1)), "other episodes");
    assert!(matches!(pictures.clone().with_states(pictures), Err(LearnError::Config(_))), "pictures are no states");
}
