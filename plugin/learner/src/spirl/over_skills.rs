//! What learns π(z | s): PPO or SAC, tied to the prior.

use super::SpirlConfig;
use crate::file::TensorFile;
use crate::learner::Learner;
use crate::nn::unsquashed_action;
use crate::policy::Policy;
use crate::score::{ConfidenceKind, KlDirection, PenaltyForm, PriorKind, ScoreConfig, Teacher};
use crate::skill::{Prior, SkillDraw};
use crate::{Action, Actions, FileError, LearnError, PpoLearner, Rollout, SacLearner};
use std::path::Path;

/// What learns π(z | s).
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

    /// π(z | s) as a source of skills.
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

    /// How much later a skill is than its predecessor is worth, per tick.
    pub(super) fn discount_of_tick(&self) -> f64 {
        let gamma = match self {
            Self::Ppo(learner) => learner.config().gamma,
            Self::Sac(learner) => learner.config().gamma,
        };
        gamma.powf(1.0 / self.teacher().config.horizon as f64)
    }

    /// Learns π(z | s) from a rollout of skills; gives what there is to report, by other names than what acts reports.
    pub(super) fn learn(
        &mut self,
        config: &SpirlConfig,
        mut skills: Rollout,
    ) -> Result<Vec<(&'static str, f64)>, LearnError> {
        let tanh = self.teacher().description.config.tanh_latent;
        match self {
            Self::Sac(learner) => Ok(learner.update(&skills)?.scalars()),
            Self::Ppo(learner) => {
                if let (true, Actions::Continuous { values, .. }) = (tanh, &mut skills.actions) {
                    // PPO knows no squashing: its actions are the normal numbers whose tanh the decoder reads.
                    values.iter_mut().for_each(|z| *z = unsquashed_action(*z));
                }
                score_rows(&mut skills, &learner.policy())?;
                let metrics = learner.update(&skills)?;
                if let (Some(kl), Some(teacher)) = (metrics.decoder_kl, &mut learner.base.teacher) {
                    teacher.config.kl_coef = config.tuned(teacher.config.kl_coef, f64::from(kl));
                }
                Ok(metrics.scalars())
            }
        }
    }
}

/// How a policy over skills is tied to the prior.
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
        horizon: score.horizon,
        prior: PriorKind::Learned,
        critic_clock: false,
    }
}

/// Fills in how likely each action of a rollout was under the policy that played it, and what that expected.
fn score_rows(rollout: &mut Rollout, policy: &Policy) -> Result<(), LearnError> {
    let output = policy.forward(&[], &rollout.obs, rollout.rows())?;
    let Actions::Continuous { dim, values } = &rollout.actions else {
        return Err(LearnError::Action("skills are vectors".to_owned()));
    };
    let rows = values.chunks_exact(*dim).enumerate();
    let log_probs: Result<_, _> = rows.map(|(row, z)| output.log_prob(row, &Action::Continuous(z.to_vec()))).collect();
    (rollout.log_probs, rollout.values) = (log_probs?, output.values);
    rollout.bootstrap(policy)
}

/// What a learner of skills reports, by names of its own.
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
        "score/decoder_kl" => "spirl/prior_kl",
        _ => return None,
    })
}
