//! Held-out demonstrations in the training of a skill model.

use crate::skill::corridor_demos;
use playbot_learner::rng::{Streams, below, normal};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, DeviceKind, LearnError, SkillConfig, SkillMetrics, SkillTrainer,
};
use std::ops::ControlFlow;

fn config() -> SkillConfig {
    SkillConfig { held_out: 0.2, lr: 1e-2, hidden: vec![64, 64], ..crate::skill::config() }
}

/// Returns actions that are independent of the observations: a model can only memorise them.
fn coins() -> Dataset {
    let mut rng = Streams::new(3).stream("coins", 0);
    let episode = |_| DatasetEpisode {
        observations: (0..30 * 6).map(|_| normal(&mut rng)).collect::<Vec<f32>>().into(),
        actions: Actions::Discrete((0..30).map(|_| below(&mut rng, 3) as u32).collect()),
    };
    Dataset::new(6, ActionSpace::Discrete(3), (0..20).map(episode).collect()).expect("consistent")
}

fn epoch(trainer: &mut SkillTrainer) -> SkillMetrics {
    trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite").expect("not stopped")
}

fn trainer(config: SkillConfig, demos: Dataset) -> SkillTrainer {
    SkillTrainer::new(config, demos, 1, DeviceKind::Flex).expect("windows fit")
}

#[test]
fn what_is_kept_apart_tells_learning_from_knowing_by_heart() {
    let losses = |demos: Dataset, epochs: usize| -> Vec<(f32, f32)> {
        let mut trainer = trainer(SkillConfig { beta: 1.0, ..config() }, demos);
        let all = (0..epochs).map(|_| epoch(&mut trainer));
        all.map(|metrics| (metrics.loss, metrics.held_out.expect("some are kept apart").loss)).collect()
    };
    let heart = losses(coins(), 60);
    let (first, last) = (heart[0], heart[59]);
    assert!(last.0 < 0.7 * first.0, "it knows them better and better: {first:?} to {last:?}");
    assert!(last.1 > 1.1 * first.1, "and others worse and worse: {first:?} to {last:?}");
    let learned = losses(corridor_demos(100), 10);
    let (first, last) = (learned[0], learned[9]);
    assert!((last.0 - last.1).abs() < 0.4 && last.1 < 0.7 * first.1, "{first:?} to {last:?}");
}

#[test]
fn whole_levels_are_kept_apart() {
    // Each level is played ten times over, with the same random actions, so one of its episodes gives away the
    // others.
    let mut rng = Streams::new(3).stream("coins", 0);
    let mut once = || DatasetEpisode {
        observations: (0..30 * 6).map(|_| normal(&mut rng)).collect::<Vec<f32>>().into(),
        actions: Actions::Discrete((0..30).map(|_| below(&mut rng, 3) as u32).collect()),
    };
    let levels: Vec<DatasetEpisode> = (0..8).map(|_| once()).collect();
    let episodes: Vec<DatasetEpisode> = (0..80).map(|i| levels[i % 8].clone()).collect();
    let demos = || Dataset::new(6, ActionSpace::Discrete(3), episodes.clone()).expect("consistent");
    let last = |demos: Dataset| {
        let mut trainer = trainer(SkillConfig { beta: 1.0, ..config() }, demos);
        let metrics = (0..20).map(|_| epoch(&mut trainer)).last().expect("some");
        metrics.held_out.expect("some are kept apart").loss - metrics.loss
    };
    let by_episode = last(demos());
    assert!(by_episode < 0.3, "what is kept apart was learned: {by_episode}");
    let by_level = last(demos().with_levels((0..80).map(|i| i % 8).collect()).expect("one each"));
    assert!(by_level > 1.0, "what is kept apart is new: {by_level}");
    // A single level has only episodes to choose from.
    assert!(last(demos().with_levels(vec![7; 80]).expect("one each")) < 0.3);
    assert!(demos().with_levels(vec![0; 79]).is_err());
}

#[test]
fn learning_stops_in_time_and_the_best_model_is_kept() {
    let patient = SkillConfig { beta: 1.0, patience: Some(4), ..config() };
    let mut trainer = trainer(patient, coins());
    let (mut best, mut model) = (f32::INFINITY, None);
    while !trainer.is_over() {
        let nll = epoch(&mut trainer).held_out_nll().expect("some are kept apart");
        if nll < best {
            (best, model) = (nll, Some(trainer.model()));
        }
        assert!(trainer.epochs_done() < 60, "it never stops");
    }
    assert_eq!((trainer.best_epoch(), trainer.best_nll()), (Some(trainer.epochs_done() - 4), Some(best)));
    let says = |model: &playbot_learner::SkillModel| model.policy().forward(&[0.1; 2], &[0.5; 6], 1).expect("finite");
    let kept = trainer.model();
    assert_eq!(says(&kept), says(&model.expect("there was a best one")));
    epoch(&mut trainer);
    assert_eq!(says(&trainer.into_model()), says(&kept), "what comes later is not better");
}

#[test]
fn the_best_epoch_is_that_of_the_least_nll_whatever_the_loss_says() {
    // The divergence weighs so much that the loss still decreases when the decoder begins to memorise the actions.
    let mut trainer = trainer(SkillConfig { beta: 100.0, patience: Some(4), ..config() }, coins());
    let (mut nlls, mut losses) = (Vec::new(), Vec::new());
    while !trainer.is_over() {
        let held_out = epoch(&mut trainer).held_out.expect("some are kept apart");
        nlls.push(held_out.nll);
        losses.push(held_out.loss);
        assert!(trainer.epochs_done() < 60, "it never stops");
    }
    let least = |values: &[f32]| {
        let at = (0..values.len()).min_by(|&a, &b| values[a].total_cmp(&values[b])).expect("some epochs");
        Some(at as u64 + 1)
    };
    assert_eq!(trainer.best_epoch(), least(&nlls), "{nlls:?}");
    assert_ne!(trainer.best_epoch(), least(&losses), "the loss would have reported the same: {losses:?}");
}

#[test]
fn a_stopped_training_remembers_the_best_model() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skills.checkpoint");
    let mut whole = trainer(SkillConfig { patience: Some(4), beta: 1.0, ..config() }, coins());
    for _ in 0..8 {
        epoch(&mut whole);
    }
    whole.save(&path).expect("written");
    let mut loaded = SkillTrainer::load(&path, coins(), DeviceKind::Flex).expect("read");
    let best = |trainer: &SkillTrainer| (trainer.best_epoch(), trainer.best_nll(), trainer.is_over());
    assert_eq!(best(&loaded), best(&whole));
    assert_eq!(epoch(&mut loaded), epoch(&mut whole));
    let bytes = |trainer: &SkillTrainer| {
        trainer.save(&path).expect("written");
        std::fs::read(&path).expect("readable")
    };
    assert_eq!(bytes(&loaded), bytes(&whole));
}

#[test]
fn what_cannot_be_kept_apart_is_refused() {
    let error = |config: SkillConfig, demos| {
        SkillTrainer::new(config, demos, 1, DeviceKind::Flex).expect_err("cannot work").to_string()
    };
    assert!(error(config(), corridor_demos(1)).contains("leaves none"));
    assert!(error(SkillConfig { held_out: 1.0, ..config() }, corridor_demos(9)).contains("held_out"));
    let blind = SkillConfig { held_out: 0.0, patience: Some(3), ..config() };
    assert!(error(blind, corridor_demos(9)).contains("`skills.patience` needs"));
    assert!(matches!(
        SkillTrainer::new(SkillConfig { patience: Some(0), ..config() }, corridor_demos(9), 1, DeviceKind::Flex),
        Err(LearnError::Setting(error)) if error.why.contains("at least 1")
    ));
    assert_eq!(epoch(&mut trainer(crate::skill::config(), corridor_demos(9))).held_out, None);
}

#[test]
fn weights_of_skills_decay_if_they_shall() {
    let size = |weight_decay| {
        let mut trainer = trainer(SkillConfig { weight_decay, lr: 1e-6, ..config() }, coins());
        epoch(&mut trainer);
        let file = tempfile::NamedTempFile::new().expect("a file");
        trainer.model().save(file.path()).expect("written");
        let bytes = std::fs::read(file.path()).expect("readable");
        let tensors = safetensors::SafeTensors::deserialize(&bytes).expect("tensors");
        let numbers = tensors.iter().flat_map(|(_, tensor)| tensor.data().chunks_exact(4).collect::<Vec<_>>());
        numbers.map(|four| f64::from(f32::from_le_bytes(four.try_into().expect("four")).abs())).sum::<f64>()
    };
    let (plain, decayed) = (size(0.0), size(1e5));
    assert!(decayed < 0.8 * plain, "{decayed} of {plain}");
}
