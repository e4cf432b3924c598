//! The skill model on vectors: it learns from scripted demonstrators, keeps them apart, and survives its file.

use crate::toy::{Corridor, OBS, SPACE};
use playbot_learner::rng::{Streams, normal, unit};
use playbot_learner::{
    ActionSpace, ActionValue, Actions, Dataset, DatasetEpisode, DeviceKind, FileError, SkillConfig, SkillDraw,
    SkillMetrics, SkillModel, SkillTrainer,
};
use std::ops::ControlFlow;

pub fn config() -> SkillConfig {
    SkillConfig {
        latent: 2,
        window: 5,
        hidden: vec![32, 32],
        encoder_hidden: 16,
        gru_hidden: 16,
        lr: 3e-3,
        batch: 20,
        ..SkillConfig::default()
    }
}

/// Returns demonstrations that walk to the goal but dawdle in one step of ten.
pub fn corridor_demos(episodes: u64) -> Dataset {
    demos_until(usize::MAX, episodes)
}

/// Returns the same demonstrations, which break off at a position.
pub fn demos_until(place: usize, episodes: u64) -> Dataset {
    let streams = Streams::new(11);
    let demos = (0..episodes).map(|i| {
        let mut rng = streams.stream("demo", i);
        let mut corridor = Corridor::default();
        let (mut observations, mut actions) = (Vec::new(), Vec::new());
        loop {
            corridor.observe(&mut observations);
            let action = if unit(&mut rng) < 0.1 { 2 } else { corridor.best() };
            actions.push(action);
            let (_, end, cut) = corridor.step(action);
            if end || cut || corridor.place() >= place {
                return DatasetEpisode { observations: observations.into(), actions: Actions::Discrete(actions) };
            }
        }
    });
    Dataset::new(OBS, SPACE, demos.collect()).expect("consistent")
}

fn train(trainer: &mut SkillTrainer, epochs: usize) -> Vec<SkillMetrics> {
    (0..epochs).filter_map(|_| trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite")).collect()
}

#[test]
fn the_decoder_does_what_the_players_did() {
    for device in DeviceKind::CPU {
        let mut trainer = SkillTrainer::new(config(), corridor_demos(200), 1, device).expect("windows fit");
        let history = train(&mut trainer, 15);
        let (first, last) = (history[0], history[14]);
        assert_eq!(trainer.epochs_done(), 15);
        // ln 3 per step at first; the entropy of the dawdling is 0.33.
        assert!(first.nll > 2.5 && last.nll < 2.0, "{} to {}", first.nll, last.nll);
        assert!(last.loss < 0.7 * first.loss);
        let accuracy = last.accuracy.expect("discrete");
        assert!(accuracy > 0.85, "{accuracy}");
        let model = trainer.into_model();
        assert!(walks(&model) > 0.95, "share of right steps under the prior");
    }
}

/// Returns how often the most likely action under the prior's mean is the one that leads to the goal.
fn walks(model: &SkillModel) -> f64 {
    let (prior, policy) = (model.prior(), model.policy());
    let (mut right, mut steps) = (0, 0);
    for _ in 0..10 {
        let mut corridor = Corridor::default();
        loop {
            let mut obs = Vec::new();
            corridor.observe(&mut obs);
            let z = prior.sample(&obs, 1, SkillDraw::Mean, &mut |_| panic!("no draw")).expect("finite");
            let output = policy.forward(&z, &obs, 1).expect("finite");
            assert_eq!(output.values, [0.0]);
            let ActionValue::Discrete(action) = output.greedy(0) else { panic!("discrete") };
            right += usize::from(action == corridor.best());
            steps += 1;
            let (_, end, cut) = corridor.step(action);
            if end || cut {
                break;
            }
        }
    }
    right as f64 / steps as f64
}

/// Two kinds of demonstrators, who always press 0 or always 1: only z can distinguish them.
#[test]
fn skills_keep_players_apart() {
    let episodes = (0..60)
        .map(|i| DatasetEpisode { observations: vec![1.0; 20].into(), actions: Actions::Discrete(vec![i % 2; 20]) });
    let data = Dataset::new(1, ActionSpace::Discrete(2), episodes.collect()).expect("consistent");
    let mut trainer = SkillTrainer::new(config(), data, 3, DeviceKind::Flex).expect("windows fit");
    let history = train(&mut trainer, 25);
    // Without z the best is 5 ln 2 = 3.47 per window.
    assert!(history[24].nll < 0.5, "{}", history[24].nll);
    let model = trainer.into_model();
    let mut rng = Streams::new(1).stream("draw", 0);
    let n = 400;
    let obs = vec![1.0; n];
    let z = model.prior().sample(&obs, n, SkillDraw::Sample, &mut |_| normal(&mut rng)).expect("finite");
    assert!(z.iter().all(|x| x.abs() <= 1.0), "skills are squashed");
    let output = model.policy().forward(&z, &obs, n).expect("finite");
    let ones = (0..n).filter(|&row| output.greedy(row) == ActionValue::Discrete(1)).count();
    assert!((n / 5..4 * n / 5).contains(&ones), "{ones} of {n} skills press 1");
}

/// Returns demonstrations whose two actions are half of and minus the observation.
pub fn continuous_demos() -> Dataset {
    let streams = Streams::new(5);
    let episodes = (0..60).map(|i| {
        let mut rng = streams.stream("demo", i);
        let observations: Vec<f32> = (0..20).map(|_| normal(&mut rng)).collect();
        let values = observations.iter().flat_map(|x| [0.5 * x, -x]).collect();
        DatasetEpisode { observations: observations.into(), actions: Actions::Continuous { dim: 2, values } }
    });
    Dataset::new(1, ActionSpace::Continuous(2), episodes.collect()).expect("consistent")
}

#[test]
fn continuous_actions_are_learned_too() {
    let mut trainer = SkillTrainer::new(config(), continuous_demos(), 3, DeviceKind::Flex).expect("windows fit");
    let history = train(&mut trainer, 30);
    assert!(history[29].nll < history[0].nll - 8.0, "{} to {}", history[0].nll, history[29].nll);
    assert_eq!(history[29].accuracy, None);
    let model = trainer.into_model();
    let obs = [0.8, -0.6];
    let z = model.prior().sample(&obs, 2, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
    let output = model.policy().forward(&z, &obs, 2).expect("finite");
    for (got, want) in output.head.iter().zip([0.4, -0.8, -0.3, 0.6]) {
        assert!((got - want).abs() < 0.2, "{:?}", output.head);
    }
}

#[test]
fn training_can_stop_between_batches() {
    let start = || SkillTrainer::new(config(), corridor_demos(50), 1, DeviceKind::Flex).expect("windows fit");
    let (mut whole, mut parts) = (start(), start());
    let expected = train(&mut whole, 1)[0];
    let mut calls = 0;
    let stopped = parts.train_epoch(&mut |progress| {
        calls = progress.batch;
        if progress.batch == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(stopped.expect("finite"), None);
    assert_eq!((calls, parts.batches_done()), (2, 2));
    assert_eq!(train(&mut parts, 1)[0], expected);
}

#[test]
fn a_loaded_trainer_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("trainer.safetensors");
    let mut trainer = SkillTrainer::new(config(), corridor_demos(50), 7, DeviceKind::Flex).expect("windows fit");
    train(&mut trainer, 1);
    trainer.train_batch().expect("finite");
    trainer.save(&path).expect("written");
    let mut loaded = SkillTrainer::load(&path, corridor_demos(50), DeviceKind::Flex).expect("read");
    assert_eq!((loaded.epochs_done(), loaded.batches_done()), (1, 1));
    assert_eq!(train(&mut loaded, 2), train(&mut trainer, 2));
    let (first, second) = (folder.path().join("a"), folder.path().join("b"));
    trainer.save(&first).expect("written");
    loaded.save(&second).expect("written");
    assert_eq!(std::fs::read(first).expect("readable"), std::fs::read(second).expect("readable"));
    let other = SkillTrainer::load(&path, corridor_demos(49), DeviceKind::Flex).expect_err("other demonstrations");
    assert!(other.to_string().contains("episodes"), "{other}");
}

#[test]
fn an_annealed_rate_falls_to_nothing_over_the_epochs_and_over_a_stop() {
    let settings = SkillConfig { anneal_lr: true, epochs: 2, lr: 0.5, ..config() };
    let rates = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0].map(|epochs| settings.lr_at(epochs));
    assert_eq!(rates, [0.5, 0.375, 0.25, 0.125, 0.0, 0.0]);
    let annealed = SkillConfig { anneal_lr: true, epochs: 2, ..config() };
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("trainer.safetensors");
    let mut trainer = SkillTrainer::new(annealed, corridor_demos(50), 7, DeviceKind::Flex).expect("windows fit");
    train(&mut trainer, 1);
    trainer.train_batch().expect("finite");
    trainer.save(&path).expect("written");
    let mut loaded = SkillTrainer::load(&path, corridor_demos(50), DeviceKind::Flex).expect("read");
    let to_the_end = train(&mut loaded, 1);
    assert_eq!(to_the_end, train(&mut trainer, 1));
    let bytes = |trainer: &SkillTrainer, name: &str| {
        let path = folder.path().join(name);
        trainer.model().save(&path).expect("written");
        std::fs::read(path).expect("readable")
    };
    let at_the_end = bytes(&trainer, "end");
    assert!(at_the_end == bytes(&loaded, "loaded"), "a stop changes nothing");
    train(&mut trainer, 1);
    assert!(at_the_end == bytes(&trainer, "later"), "at a rate of nothing no weight moves");
    let mut steady = SkillTrainer::new(config(), corridor_demos(50), 7, DeviceKind::Flex).expect("windows fit");
    let last = *train(&mut steady, 2).last().expect("two epochs");
    assert!(last != to_the_end[0], "a rate that stays learns something else");
}

#[test]
fn a_model_comes_back_from_its_file_as_it_was() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("skill.safetensors");
    let mut trainer = SkillTrainer::new(config(), corridor_demos(50), 1, DeviceKind::Flex).expect("windows fit");
    train(&mut trainer, 1);
    let model = trainer.into_model();
    model.save(&path).expect("written");
    model.save(&path).expect("written over");
    assert_eq!(std::fs::read_dir(&folder).expect("readable").count(), 1, "nothing temporary is left");
    let back = SkillModel::load(&path, DeviceKind::Flex).expect("read");
    assert_eq!(back.config(), model.config());
    assert_eq!((back.obs_dim(), back.action_space()), (OBS, SPACE));
    let obs = vec![0.3; 3 * OBS];
    let sample = |m: &SkillModel| m.prior().sample(&obs, 3, SkillDraw::Sample, &mut |row| row as f32).expect("finite");
    assert_eq!(sample(&back), sample(&model));
    let z = sample(&model);
    assert_eq!(
        back.policy().forward(&z, &obs, 3).expect("finite"),
        model.policy().forward(&z, &obs, 3).expect("finite")
    );

    let bytes = std::fs::read(&path).expect("readable");
    std::fs::write(&path, &bytes[..bytes.len() - 8]).expect("written");
    assert!(matches!(SkillModel::load(&path, DeviceKind::Flex), Err(FileError::CutOff { .. })));
    let missing = folder.path().join("none");
    assert!(matches!(SkillModel::load(&missing, DeviceKind::Flex), Err(FileError::Io { .. })));
}
