//! The critic's influence on the trunk through which the policy sees pictures (`critic_trains_cnn`).

use crate::image_task::{Driver, config};
use crate::pixels::ppo;
use playbot_learner::{Learner, PolicyOutput, PpoConfig, PpoLearner};

/// Returns the outputs of the policy and its critic before and after an update with much to learn for the critic and
/// nothing for the policy: each step earned the expected reward, so that no action was better than another.
fn before_and_after(changes: PpoConfig) -> [PolicyOutput; 2] {
    let still =
        PpoConfig { gamma: 0.0, ent_coef: 0.0, vf_coef: 1e3, norm_reward: false, clip_value_loss: false, ..changes };
    let mut learner = ppo(still, 1);
    let mut rollout = Driver::new(16, 1).rollout(&learner, 16);
    rollout.values = rollout.rewards.clone();
    let says =
        |learner: &PpoLearner| learner.policy().forward(&[], &rollout.obs, rollout.rows()).expect("one row each");
    let before = says(&learner);
    learner.update(&rollout).expect("finite");
    let after = says(&learner);
    assert_ne!(before.values, after.values, "the critic learns");
    [before, after]
}

#[test]
fn a_critic_that_is_kept_apart_leaves_the_policy_what_it_sees() {
    let [before, after] = before_and_after(PpoConfig { critic_trains_cnn: false, ..config() });
    assert_eq!(before.head, after.head, "the policy has moved, and had nothing to learn");
}

#[test]
fn a_critic_that_shares_the_trunk_moves_the_policy_but_not_while_it_warms_up() {
    let [before, after] = before_and_after(PpoConfig { critic_trains_cnn: true, ..config() });
    let moved = before.head.iter().zip(&after.head).filter(|(before, after)| before != after).count();
    assert!(2 * moved > before.head.len(), "{moved} of {} numbers have moved", before.head.len());
    let [before, after] = before_and_after(PpoConfig { critic_trains_cnn: true, critic_warmup: 1, ..config() });
    assert_eq!(before.head, after.head, "the critic warms up alone");
}
