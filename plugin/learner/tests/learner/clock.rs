//! Critics that count the remaining ticks of a skill.

use crate::corridor;
use crate::score::model;
use crate::switches::{ppo, rollout};
use playbot_learner::{
    DeviceKind, Learner, PpoConfig, PpoLearner, Rollout, SacConfig, SacLearner, ScoreConfig, SkillModel,
};

/// Returns rows that end at once with a reward equal to the remaining share of their skills.
fn paid_by_the_clock(model: &SkillModel) -> Rollout {
    let mut rollout = rollout(model);
    let rows = rollout.rows();
    rollout.left = (0..rows).map(|row| if row % 2 == 0 { 1.0 } else { 0.125 }).collect();
    rollout.rewards = rollout.left.clone();
    rollout.terminated = vec![true; rows];
    rollout.truncated = vec![false; rows];
    (rollout.ends.cut_rows, rollout.ends.cut_obs, rollout.ends.cut_z) =
        (Vec::new(), Vec::<f32>::new().into(), Vec::new());
    rollout.ends.cut_left = Vec::new();
    rollout.ends.next_left = vec![1.0; rollout.envs];
    rollout
}

#[test]
fn the_critic_counts_the_ticks_of_a_skill_if_it_has_a_clock() {
    let model = model(1);
    let mut rollout = rollout(&model);
    let rows = rollout.rows();
    // Half of the rows are about to draw another skill.
    rollout.left = (0..rows).map(|row| if row % 2 == 0 { 1.0 } else { 0.125 }).collect();
    for critic_clock in [true, false] {
        let mut learner = ppo(ScoreConfig { critic_clock, ..ScoreConfig::default() }, &model);
        let values = |learner: &PpoLearner, left: &[f32]| {
            learner.policy().values_held(&rollout.z, left, &rollout.obs, rows).expect("finite")
        };
        let (new, old) = (vec![1.0; rows], vec![0.125; rows]);
        assert_eq!(values(&learner, &new), values(&learner, &old), "it knows nothing yet");
        learner.update(&rollout).expect("finite");
        assert_eq!(values(&learner, &new) != values(&learner, &old), critic_clock);
        assert_eq!(values(&learner, &new), values(&learner, &[]), "who does not count has skills that were just drawn");
        let bytes = tempfile::tempdir().expect("a folder");
        let path = bytes.path().join("checkpoint.safetensors");
        learner.save(&path).expect("written");
        let loaded = PpoLearner::load(&path, DeviceKind::Flex).expect("read");
        assert_eq!(values(&loaded, &old), values(&learner, &old), "a file keeps the clock");
    }
}

#[test]
fn the_clock_learns_what_skills_that_run_out_are_worth() {
    let model = model(1);
    let rollout = paid_by_the_clock(&model);
    let error = |critic_clock| {
        let config = PpoConfig { norm_reward: false, clip_value_loss: false, epochs: 40, ..corridor::config() };
        let score = ScoreConfig { critic_clock, ..ScoreConfig::default() };
        let learner = PpoLearner::with_skill(config, score, &model, 1, DeviceKind::Flex);
        let mut learner = learner.expect("good settings");
        (0..3).map(|_| learner.update(&rollout).expect("finite").value_loss).last().expect("three")
    };
    let (with, without) = (error(true), error(false));
    // Without it only states and skills distinguish the rows.
    assert!(with < 0.001 && without > 0.01, "{with} with a clock, {without} without");
}

#[test]
fn the_critics_of_sac_count_too_and_a_file_keeps_what_they_count() {
    let model = model(1);
    let rollout = paid_by_the_clock(&model);
    let config = SacConfig { learning_starts: 1, updates_per_step: 1.0, ..crate::sac::config() };
    let error = |critic_clock| {
        let score = ScoreConfig { critic_clock, ..ScoreConfig::default() };
        let learner = SacLearner::with_skill(config.clone(), score, &model, 1, DeviceKind::Flex);
        let mut learner = learner.expect("good settings");
        learner.update(&rollout).expect("finite");
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("checkpoint.safetensors");
        learner.save(&path).expect("written");
        let mut loaded = SacLearner::load(&path, DeviceKind::Flex).expect("read");
        let metrics: Vec<_> = (0..6).map(|_| learner.update(&rollout).expect("finite")).collect();
        let again: Vec<_> = (0..6).map(|_| loaded.update(&rollout).expect("finite")).collect();
        assert_eq!(metrics, again);
        metrics.last().and_then(|metrics| metrics.qf_loss).expect("gradient steps")
    };
    let (with, without) = (error(true), error(false));
    assert!(with < 0.2 * without, "{with} with a clock, {without} without");
    let silent = Rollout { left: Vec::new(), ..rollout.clone() };
    let score = ScoreConfig { critic_clock: true, ..ScoreConfig::default() };
    let mut counting = SacLearner::with_skill(config, score, &model, 1, DeviceKind::Flex).expect("good settings");
    let error = counting.update(&silent).expect_err("a rollout that does not count").to_string();
    assert!(error.contains("rollout left"), "{error}");
}
