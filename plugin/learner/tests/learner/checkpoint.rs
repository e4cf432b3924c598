//! A saved learner continues bit for bit.

use crate::corridor::config;
use crate::score::model;
use crate::toy::{Driver, OBS, SPACE};
use playbot_learner::{DeviceKind, Learner, PolicySpec, PpoConfig, PpoLearner, ScoreConfig, StartFrom};

fn learners() -> Vec<PpoLearner> {
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    let awkward = PpoConfig { lr: 0.1 + 0.2 - 0.297, norm_obs: true, ..config() };
    let anneal = PpoConfig { anneal_lr: true, total_updates: Some(7), norm_reward: false, ..config() };
    vec![
        PpoLearner::new(awkward, spec, 5, DeviceKind::Flex).expect("good settings"),
        PpoLearner::new(anneal, spec, u64::MAX, DeviceKind::Flex).expect("good settings"),
        PpoLearner::with_skill(config(), ScoreConfig::default(), &model(1), 5, DeviceKind::Flex)
            .expect("good settings"),
    ]
}

#[test]
fn a_loaded_learner_goes_on_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    for mut learner in learners() {
        let mut driver = Driver::new(4, 1);
        for _ in 0..2 {
            learner.update(&driver.rollout(&learner, 16)).expect("finite");
        }
        learner.save(&path).expect("written");
        let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
        assert_eq!((loaded.updates(), loaded.seed()), (2, learner.seed()));
        assert_eq!(loaded.config(), learner.config());
        for _ in 0..2 {
            let rollout = driver.rollout(&learner, 16);
            let expected = learner.update(&rollout).expect("finite");
            assert_eq!(loaded.update(&rollout).expect("finite"), expected);
        }
        let (first, second) = (folder.path().join("a"), folder.path().join("b"));
        learner.save(&first).expect("written");
        loaded.save(&second).expect("written");
        let read = |path| std::fs::read(path).expect("readable");
        assert_eq!(read(&first), read(&second), "whole states are equal, byte for byte");
    }
}

#[test]
fn a_learner_starts_from_the_weights_of_another_run_with_its_own_settings() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    let new = |config, seed| PpoLearner::new(config, spec, seed, DeviceKind::Flex).expect("good settings");
    let mut first = new(PpoConfig { norm_obs: true, ..config() }, 5);
    let mut driver = Driver::new(4, 1);
    first.update(&driver.rollout(&first, 16)).expect("finite");
    first.save(&path).expect("written");
    let mut second = new(PpoConfig { norm_obs: true, lr: 0.004, ..config() }, 6);
    let values = |learner: &PpoLearner| Driver::new(4, 1).rollout(learner, 16).values;
    assert_ne!(values(&second), values(&first));
    let report = second.start_from(&StartFrom::new(&path)).expect("the same networks");
    assert!(report.is_same_policy && report.anew.is_empty(), "{report}");
    assert_eq!(values(&second), values(&first));
    assert_eq!((second.updates(), second.config().lr), (0, 0.004));
    let raw = new(config(), 6).start_from(&StartFrom::new(&path)).expect_err("without a normaliser").to_string();
    assert!(raw.contains("and that of the new run is"), "{raw}");
    let wide = PpoConfig { hidden: vec![3], norm_obs: true, ..config() };
    let wide = new(wide, 6).start_from(&StartFrom::new(&path)).expect_err("other layers").to_string();
    assert!(wide.contains("no layer of its policy fits: its hidden layers are"), "{wide}");
}

#[test]
fn a_prolonged_learner_begins_with_its_last_rate_also_after_it_was_loaded() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    let config = PpoConfig { anneal_lr: true, total_updates: Some(2), lr: 0.004, ..config() };
    let mut learner = PpoLearner::new(config, spec, 5, DeviceKind::Flex).expect("good settings");
    let mut driver = Driver::new(4, 1);
    let mut rate = |learner: &mut PpoLearner| {
        let rollout = driver.rollout(&*learner, 16);
        learner.update(&rollout).expect("finite").lr
    };
    assert_eq!([rate(&mut learner), rate(&mut learner)], [0.004, 0.002]);
    assert_eq!(learner.set_total_updates(Some(2)), None, "the length is the same");
    learner.save(&path).expect("written");
    let holds = || String::from_utf8_lossy(&std::fs::read(&path).expect("readable")).contains("taken_up");
    assert!(!holds(), "files of other runs are as before");
    let continued = learner.set_total_updates(Some(4)).expect("the rate falls");
    assert_eq!((continued.lr, continued.kl_coef), (Some(0.002), None));
    assert_eq!(rate(&mut learner), 0.002, "it does not jump to that of half a run");
    learner.save(&path).expect("written");
    assert!(holds());
    let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
    assert_eq!(rate(&mut loaded), 0.001);
}
