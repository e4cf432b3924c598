//! The learner of π(z | s): PPO or SAC, tied to the prior.

use crate::{
    ActionValue, Actions, FileError, LearnError, PpoLearner, Rollout, SacLearner,
    file::TensorFile,
    learner::Learner,
    nn::unsquashed_action,
    norm::RewardNormalizer,
    policy::Policy,
    score::{ConfidenceKind, KlDirection, PenaltyForm, PriorKind, ScoreConfig, Teacher},
    skill::{Prior, SkillDraw},
    spirl::{
        SpirlConfig,
        skill_steps::{SkillRollout, skill_rollout},
    },
};
use std::path::Path;

/// The learner of π(z | s).
#[derive(Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per training")]
pub(super) enum OverSkills {
    Ppo(PpoLearner),
    Sac(SacLearner),
}

impl OverSkills {
    pub(super) fn learner(&self) -> &dyn Learner {
        match self {
            Self::Ppo(learner) => learner,
            Self::Sac(learner) => learner,
        }
    }

    pub(super) fn teacher(&self) -> &Teacher {
        self.learner().base().teacher.as_ref().expect("a policy over skills starts as a prior")
    }

    /// Returns π(z | s) as a source of skills.
    pub(super) fn prior(&self) -> Prior {
        let (actor, device) = match self {
            Self::Ppo(learner) => (&learner.nets.actor, learner.base.device),
            Self::Sac(learner) => (&learner.nets.actor, learner.base.device),
        };
        self.teacher().prior_of(actor, device)
    }

    pub(super) fn checkpoint(&self, path: &Path) -> Result<TensorFile, FileError> {
        match self {
            Self::Ppo(learner) => learner.checkpoint(path),
            Self::Sac(learner) => learner.checkpoint(path),
        }
    }

    /// Returns the discount per tick, from that of a skill.
    pub(super) fn discount_of_tick(&self) -> f64 {
        let gamma = match self {
            Self::Ppo(learner) => learner.config().gamma,
            Self::Sac(learner) => learner.config().gamma,
        };
        libm::pow(gamma, 1.0 / self.teacher().config.skill_interval as f64)
    }

    /// Learns π(z | s) from a rollout of ticks, and returns the metrics under names that differ from those of the
    /// acting policy. PPO puts the sizes of its advantages into the rows in which skills were drawn.
    pub(super) fn learn(
        &mut self,
        config: &SpirlConfig,
        rollout: &Rollout,
        advantage_sizes: &mut Vec<Option<f32>>,
    ) -> Result<Vec<(&'static str, f64)>, LearnError> {
        let (gamma, skill_interval) = (self.discount_of_tick(), self.teacher().config.skill_interval);
        let tanh = self.teacher().description.config.tanh_latent;
        match self {
            Self::Sac(learner) => {
                // Its buffer keeps raw rewards: they are scaled when they are read.
                scaled(learner.base.rewards.as_mut(), gamma, rollout)?;
                let skills = skill_rollout(rollout, &rollout.rewards, gamma, skill_interval)?;
                let of_whole = learner.config().gamma;
                let weights: Vec<f32> = skills.discounts.iter().map(|discount| (discount / of_whole) as f32).collect();
                Ok(learner.update_of_skills(&skills.rows, &weights)?.scalars())
            }
            Self::Ppo(learner) => {
                let rewards = scaled(learner.base.rewards.as_mut(), gamma, rollout)?;
                let SkillRollout { rows: mut skills, discounts, drawn_at, chains } =
                    skill_rollout(rollout, &rewards, gamma, skill_interval)?;
                if let (true, Actions::Continuous { values, .. }) = (tanh, &mut skills.actions) {
                    // PPO does not squash: its actions are the normal numbers whose tanh the decoder reads.
                    values.iter_mut().for_each(|z| *z = unsquashed_action(*z));
                }
                score_rows(&mut skills, &learner.policy())?;
                discount_cuts(&mut skills, &discounts, learner.config().gamma);
                let is_warming_up = learner.updates() < learner.config().critic_warmup;
                let normalizer = learner.base.rewards.take();
                let metrics = learner.update_of_skills(&skills, &chains);
                learner.base.rewards = normalizer;
                let metrics = metrics?;
                advantage_sizes.clear();
                advantage_sizes.resize(rollout.rows(), None);
                for (&row, &size) in drawn_at.iter().zip(learner.advantage_sizes()) {
                    advantage_sizes[row] = size;
                }
                // While only the critic learns, the policy stays the same whatever that costs.
                if let (Some(kl), Some(teacher), false) = (metrics.decoder_kl, &mut learner.base.teacher, is_warming_up)
                {
                    teacher.config.kl_coef = config.tuned(teacher.config.kl_coef, f64::from(kl));
                }
                Ok(metrics.scalars())
            }
        }
    }
}

/// Returns the rewards of all ticks, scaled by the spread of the return, whose discount is per tick. The return of an
/// environment continues from rollout to rollout. Without a normaliser the rewards are unchanged.
fn scaled(normalizer: Option<&mut RewardNormalizer>, gamma: f64, rollout: &Rollout) -> Result<Vec<f32>, LearnError> {
    match normalizer {
        Some(normalizer) => {
            normalizer.gamma = gamma;
            normalizer.normalize(&rollout.rewards, &rollout.done(), rollout.envs)
        }
        None => Ok(rollout.rewards.clone()),
    }
}

/// Corrects a discount that is the same for every skill. The value behind a skill that was cut off after k ticks is
/// discounted by γᵏ, not by `gamma`, that of a whole one.
fn discount_cuts(skills: &mut Rollout, discounts: &[f64], gamma: f64) {
    for &row in &skills.ends.cut_rows {
        let value = f64::from(skills.final_values[row]);
        skills.rewards[row] += ((discounts[row] - gamma) * value) as f32;
    }
}

/// Returns the settings that tie a policy over skills to the prior.
pub(super) fn of_prior(config: &SpirlConfig, score: &ScoreConfig, kl: bool) -> ScoreConfig {
    ScoreConfig {
        condition: true,
        init_from_decoder: true,
        kl,
        kl_coef: config.kl_coef,
        kl_coef_end: None,
        kl_direction: KlDirection::PolicyDecoder,
        confidence: ConfidenceKind::Off,
        penalty: PenaltyForm::Mean,
        skill_draw: SkillDraw::Sample,
        skill_interval: score.skill_interval,
        prior: PriorKind::Learned,
        critic_clock: false,
    }
}

/// Fills in the log-probability of each action of a rollout under the policy that played it, and the policy's value.
fn score_rows(rollout: &mut Rollout, policy: &Policy) -> Result<(), LearnError> {
    let output = policy.forward_remembering(&[], &[], &rollout.memory, &rollout.obs, rollout.rows())?;
    let Actions::Continuous { dim, values } = &rollout.actions else {
        return Err(LearnError::Action("skills are vectors".to_owned()));
    };
    let rows = values.chunks_exact(*dim).enumerate();
    let log_probs: Result<_, _> =
        rows.map(|(row, z)| output.log_prob(row, &ActionValue::Continuous(z.to_vec()))).collect();
    (rollout.log_probs, rollout.values) = (log_probs?, output.values);
    rollout.bootstrap(policy)
}

/// Returns the tag of a learner of skills, which has names of its own.
pub(super) fn tag_of_skills(tag: &'static str) -> Option<&'static str> {
    Some(match tag {
        "charts/learning_rate" => "spirl/learning_rate",
        "charts/transitions" => "spirl/transitions",
        "charts/gradient_steps" => "spirl/gradient_steps",
        "losses/policy_loss" => "spirl/policy_loss",
        "losses/value_loss" => "spirl/value_loss",
        "losses/approx_kl" => "spirl/approx_kl",
        "losses/clip_fraction" => "spirl/clip_fraction",
        "losses/explained_variance" => "spirl/explained_variance",
        "losses/grad_norm" => "spirl/grad_norm",
        "losses/qf_loss" => "spirl/qf_loss",
        "losses/qf_values" => "spirl/qf_values",
        "losses/critic_grad_norm" => "spirl/critic_grad_norm",
        "losses/actor_loss" => "spirl/actor_loss",
        "losses/actor_grad_norm" => "spirl/actor_grad_norm",
        "losses/entropy" => "spirl/entropy",
        // A decoder that learns below is not curious, so these keep their names.
        "losses/intrinsic_value_loss" => tag,
        "curiosity/intrinsic_reward" => tag,
        "curiosity/predictor_loss" => tag,
        "score/decoder_kl" => "spirl/prior_kl",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ActionSpace;

    #[test]
    fn returns_go_on_from_rollout_to_rollout() {
        let rollout = Rollout {
            steps: 3,
            rewards: vec![1.0, 0.0, 2.0, -1.0, 0.5, 3.0],
            terminated: vec![false, false, false, true, false, false],
            truncated: vec![false; 6],
            ..Rollout::new(2, 1, 1, &ActionSpace::Discrete(2))
        };
        // As if both had been one.
        let mut whole = RewardNormalizer::new(0.9);
        whole.normalize(&rollout.rewards.repeat(2), &rollout.done().repeat(2), 2).expect("it fits");
        // Independent of the discount that the learner of skills has made it with.
        let mut normalizer = RewardNormalizer::new(0.9f64.powi(8));
        for _ in 0..2 {
            scaled(Some(&mut normalizer), 0.9, &rollout).expect("it fits");
        }
        assert_eq!(normalizer, whole);
        assert!(normalizer.returns.iter().all(|g| *g != 0.0), "nothing ended with the rollout");
        assert_eq!(scaled(None, 0.9, &rollout).expect("as they are"), rollout.rewards);
    }

    #[test]
    fn what_was_cut_early_is_discounted_less() {
        let mut skills = Rollout {
            rewards: vec![1.0; 3],
            final_values: vec![0.0, 4.0, 4.0],
            ..Rollout::new(1, 1, 1, &ActionSpace::Continuous(1))
        };
        skills.ends.cut_rows = vec![1, 2];
        discount_cuts(&mut skills, &[0.25, 0.5, 0.25], 0.25);
        // Each row's target is reward + 0.25 times the value behind it: 1 + 0.5 * 4 in the middle, 1 + 0.25 * 4 in the
        // last.
        assert_eq!(skills.rewards, [1.0, 2.0, 1.0]);
    }
}
