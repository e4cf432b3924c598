//! Image augmentations: networks become insensitive to them, and unsuitable inputs are errors.

use crate::image_task::{Driver, SHAPE, config, model};
use crate::pixels::{SPEC, ppo, score};
use playbot_learner::{
    Augmentation, DeviceKind, Learner, PolicySpec, PpoConfig, PpoLearner, SkillConfig, SkillTrainer,
};

fn changing(augmentation: Augmentation, augment_coef: f64) -> PpoConfig {
    PpoConfig { augment: vec![augmentation], augment_coef, ..config() }
}

#[test]
fn networks_learn_not_to_mind_what_is_changed() {
    for augmentation in [Augmentation::ColorJitter(0.6), Augmentation::Cutout(0.4), Augmentation::Translate(1)] {
        let minded = |coef| {
            let (mut learner, mut driver) = (ppo(changing(augmentation, coef), 1), Driver::new(16, 1));
            let losses: Vec<f32> = (0..30)
                .map(|_| {
                    let rollout = driver.rollout(&learner, 16);
                    learner.update(&rollout).expect("finite").augmentation_loss.expect("measured")
                })
                .collect();
            assert!(driver.recent(512) > 0.9, "{augmentation:?}: it learns the task all the same");
            losses[20..].iter().sum::<f32>()
        };
        let (with, without) = (minded(0.1), minded(0.0));
        assert!(with < 0.5 * without, "{augmentation:?}: {with} with the loss, {without} without");
    }
}

#[test]
fn without_weight_it_changes_nothing_and_without_changes_it_is_not_measured() {
    let rollout = Driver::new(16, 1).rollout(&ppo(config(), 1), 16);
    let updated = |config: PpoConfig| {
        let mut learner = ppo(config, 1);
        let metrics = learner.update(&rollout).expect("finite");
        (metrics.augmentation_loss, learner.policy().forward(&[], &rollout.obs, rollout.rows()).expect("finite").head)
    };
    let ((none, plain), (some, weightless)) =
        (updated(config()), updated(changing(Augmentation::ColorJitter(0.6), 0.0)));
    assert!(none.is_none() && some.is_some_and(|loss| loss > 0.0));
    assert_eq!(plain, weightless);
}

#[test]
fn the_policy_with_skills_learns_it_too_and_goes_on_from_a_checkpoint() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("checkpoint.safetensors");
    let config = PpoConfig { augment: vec![Augmentation::Translate(1), Augmentation::Cutout(0.5)], ..config() };
    let mut learner = score(config, &model(1, 1), 5);
    let mut driver = Driver::new(4, 1);
    learner.update(&driver.rollout(&learner, 16)).expect("finite");
    learner.save(&path).expect("written");
    let mut loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
    let rollout = driver.rollout(&learner, 16);
    let (one, other) = (learner.update(&rollout).expect("finite"), loaded.update(&rollout).expect("finite"));
    assert!(one.augmentation_loss.expect("measured") > 0.0);
    assert_eq!(one, other);
}

#[test]
fn images_that_cannot_be_changed_are_reported() {
    let refused = |augment: Augmentation, spec| {
        let config = PpoConfig { augment: vec![augment], ..config() };
        PpoLearner::new(config, spec, 1, DeviceKind::Flex).expect_err("does not fit").to_string()
    };
    let vectors = refused(Augmentation::Translate(2), PolicySpec { obs: 7.into(), ..SPEC });
    assert!(vectors.contains("`ppo.augment` Translate(2)") && vectors.contains("vectors of 7"), "{vectors}");
    assert!(refused(Augmentation::Translate(SHAPE.width), SPEC).contains("pixels"));
    let skills = SkillConfig { augment: vec![Augmentation::Cutout(0.3)], ..SkillConfig::default() };
    let error = skills.check_observation(7.into()).expect_err("vectors").to_string();
    assert!(error.contains("`skills.augment`"), "{error}");
}

#[test]
fn skill_models_learn_from_changed_pictures() {
    let learned = |augment: &[Augmentation]| {
        let (config, dataset) = crate::image_task::demonstrations(1);
        let config = SkillConfig { augment: augment.to_vec(), ..config };
        let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("good settings");
        trainer.train_batch().expect("finite").nll
    };
    let tint = [Augmentation::ColorJitter(0.6)];
    assert_eq!(learned(&tint), learned(&tint), "the same seed draws the same changes");
    assert_ne!(learned(&tint), learned(&[]), "it saw others");
}
