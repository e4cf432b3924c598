//! Skills from demonstrations of half a task, which make the whole task quicker to learn.

use crate::corridor;
use crate::skill::demos_until;
use crate::toy::{BEST, Driver, OBS, SPACE};
use playbot_learner::{
    DeviceKind, PolicySpec, PpoConfig, PpoLearner, ScoreConfig, SkillConfig, SkillModel, SkillTrainer,
};
use std::ops::ControlFlow;

const ENVS: usize = 4;
/// Largest number of updates.
const PATIENCE: usize = 200;

fn config() -> PpoConfig {
    PpoConfig { num_steps: 16, minibatches: 2, ..corridor::config() }
}

/// Returns skills of demonstrators who were recorded in the first half of the corridor only.
fn half_the_task(seed: u64) -> SkillModel {
    let config = SkillConfig { window: 3, ..crate::skill::config() };
    let demos = demos_until(BEST as usize / 2, 100);
    let mut trainer = SkillTrainer::new(config, demos, seed, DeviceKind::Flex).expect("windows fit");
    for _ in 0..8 {
        trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    }
    trainer.into_model()
}

/// Returns the updates until the last 20 episodes took hardly longer than the shortest one.
fn updates_to_solve(mut learner: PpoLearner, seed: u64) -> usize {
    let mut driver = Driver::new(ENVS, seed);
    for update in 1..=PATIENCE {
        let rollout = driver.rollout(&learner, config().num_steps);
        learner.update(&rollout).expect("finite");
        if driver.lengths.len() >= 20 && driver.recent(20) < 1.5 * BEST {
            return update;
        }
    }
    PATIENCE + 1
}

fn median(mut counts: Vec<usize>) -> usize {
    counts.sort_unstable();
    counts[counts.len() / 2]
}

#[test]
fn score_learns_the_whole_faster_than_ppo() {
    let spec = PolicySpec { obs: OBS.into(), latent: 0, action_space: SPACE };
    let (mut with_skills, mut without) = (Vec::new(), Vec::new());
    for seed in 1..=5 {
        let model = half_the_task(seed);
        let score = PpoLearner::with_skill(config(), ScoreConfig::default(), &model, seed, DeviceKind::Flex);
        with_skills.push(updates_to_solve(score.expect("good settings"), seed));
        let ppo = PpoLearner::new(config(), spec, seed, DeviceKind::Flex).expect("good settings");
        without.push(updates_to_solve(ppo, seed));
    }
    let (score, ppo) = (median(with_skills.clone()), median(without.clone()));
    assert!(ppo <= PATIENCE, "PPO alone must solve it too: {without:?}");
    assert!(3 * score <= 2 * ppo, "median of updates {score} of {with_skills:?} against {ppo} of {without:?}");
}
