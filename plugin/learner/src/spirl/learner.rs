//! The SPiRL learner: a policy over skills, and the decoder that plays them.

use super::SpirlConfig;
use super::over_skills::{OverSkills, of_prior, tag_of_skills};
use crate::learner::{Learner, LearnerBase, LearnerMetrics};
use crate::policy::Policy;
use crate::ppo::PpoConfig;
use crate::sac::{EntropyCoef, SacConfig};
use crate::score::{PriorKind, ScoreConfig, Teacher, TiedTo};
use crate::skill::{Prior, SkillDraw, SkillModel, SkillSource};
use crate::{DeviceKind, FileError, LearnError, ObsSlice, PolicySpec, PpoLearner, Rollout, SacLearner, TimeLimit};
use std::path::Path;
use std::time::Duration;

/// Learns which skills to play.
///
/// See [`crate::spirl`]. The numbers depend only on the settings, the seed and the rollouts. These must be at least
/// twice as long as the skill interval, and hold the remaining shares of skills ([`Rollout::left`]) and the last
/// states ([`Rollout::ends`]).
#[derive(Debug)]
pub struct SpirlLearner {
    pub(super) config: SpirlConfig,
    pub(super) over_skills: OverSkills,
    /// The learner below the skills; `None` if the decoder is frozen.
    pub(super) below: Option<PpoLearner>,
}

impl SpirlLearner {
    /// Creates a learner of `model`'s skills by PPO. Of `score` only the skill interval counts. `ppo.gamma` is per
    /// tick, and so is the discount of the return by which rewards are scaled, whatever `ppo.reward_gamma` is. There
    /// is no bonus for entropy.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings.
    pub fn ppo(
        config: SpirlConfig,
        ppo: PpoConfig,
        score: &ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        check(&config, score, ppo.time_limit)?;
        let below = PpoLearner::below(&config, &ppo, score, model, seed, device)?;
        let (gamma, ent_coef) = (ppo.gamma.powi(score.horizon as i32), 0.0);
        let ppo = PpoConfig { gamma, ent_coef, ..ppo };
        let teacher = Teacher::new(of_prior(&config, score, true), TiedTo::Prior, model, device)?;
        let learner = PpoLearner::fresh(ppo, teacher.policy_spec(), Some(teacher), seed, device)?;
        Ok(Self { config, over_skills: OverSkills::Ppo(learner), below })
    }

    /// Creates a learner of `model`'s skills by SAC, which learns from every whole rollout. Of `score` only the skill
    /// interval counts. `sac.gamma` is per tick. The temperature, which weighs the divergence from the prior, is that
    /// of `config`. `ppo` holds the settings of the decoder's learner, if it has one.
    ///
    /// # Errors
    /// [`LearnError::Config`] for impossible settings, or skills outside -1..1.
    pub fn sac(
        config: SpirlConfig,
        sac: SacConfig,
        ppo: &PpoConfig,
        score: &ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        check(&config, score, sac.time_limit)?;
        if !model.config().tanh_latent {
            return Err(LearnError::Config(
                "spirl by SAC squashes skills: it needs a skill model with tanh_latent".to_owned(),
            ));
        }
        let below = PpoLearner::below(&config, ppo, score, model, seed, device)?;
        let entropy = match config.target_kl {
            Some(target) => {
                EntropyCoef::Auto { initial: config.kl_coef, target_scale: Some(target / model.latent() as f64) }
            }
            None => EntropyCoef::Fixed(config.kl_coef),
        };
        let sac = SacConfig { gamma: sac.gamma.powi(score.horizon as i32), entropy, random_start: false, ..sac };
        // It is tied to the prior by the cost of the divergence, without a penalty beside it.
        let teacher = Teacher::new(of_prior(&config, score, false), TiedTo::Prior, model, device)?;
        let learner = SacLearner::fresh(sac, teacher.policy_spec(), Some(teacher), seed, device)?;
        Ok(Self { config, over_skills: OverSkills::Sac(learner), below })
    }

    /// Returns the settings.
    pub fn config(&self) -> &SpirlConfig {
        &self.config
    }

    /// Returns the present cost of the divergence from the prior, per nat.
    ///
    /// # Errors
    /// [`LearnError::Device`] if it cannot be read.
    pub fn kl_coef(&self) -> Result<f64, LearnError> {
        match &self.over_skills {
            OverSkills::Ppo(learner) => Ok(learner.base.score_config().map_or(0.0, |score| score.kl_coef)),
            OverSkills::Sac(learner) => learner.temperature(),
        }
    }
}

impl PpoLearner {
    /// Returns the learner of a decoder that continues to learn; `None` if the decoder is frozen.
    fn below(
        config: &SpirlConfig,
        ppo: &PpoConfig,
        score: &ScoreConfig,
        model: &SkillModel,
        seed: u64,
        device: DeviceKind,
    ) -> Result<Option<Self>, LearnError> {
        let learner = || Self::with_skill(ppo.clone(), score.clone(), model, seed, device);
        config.learn_decoder.then(learner).transpose()
    }
}

/// Checks that a policy over skills can be learned with these settings.
fn check(config: &SpirlConfig, score: &ScoreConfig, limit: TimeLimit) -> Result<(), LearnError> {
    let bad = |text: &str| Err(LearnError::Config(text.to_owned()));
    config.validate()?;
    score.validate()?;
    if score.prior != PriorKind::Learned {
        return bad("spirl starts as the prior that was learned: score prior must be Learned");
    }
    if score.skill_draw != SkillDraw::Sample {
        return bad("spirl learns from skills that are drawn: score skill_draw must be Sample");
    }
    if limit != TimeLimit::Bootstrap {
        return bad("spirl cuts episodes off between skills: time_limit must be Bootstrap");
    }
    Ok(())
}

impl Learner for SpirlLearner {
    /// Returns that of the policy over skills.
    fn base(&self) -> &LearnerBase {
        self.over_skills.learner().base()
    }

    /// Returns the acting policy: the decoder, or its trained successor.
    fn policy(&self) -> Policy {
        match &self.below {
            Some(below) => below.policy(),
            None => self.over_skills.teacher().decoder_policy(self.base().device),
        }
    }

    fn learn(&mut self, rollout: &Rollout) -> Result<LearnerMetrics, LearnError> {
        let spec = self.spec();
        rollout.check_for(&spec, self.rollout_latent())?;
        let kl_coef = self.kl_coef()?;
        let of_skills = self.over_skills.learn(&self.config, rollout)?;
        let of_skills = of_skills.into_iter().filter_map(|(tag, value)| Some((tag_of_skills(tag)?, value)));
        let mut scalars: Vec<_> = of_skills.chain([("spirl/kl_coef", kl_coef)]).collect();
        if let Some(below) = &mut self.below {
            scalars.extend(below.update(rollout)?.scalars());
        }
        Ok(LearnerMetrics::new(scalars))
    }

    /// Returns the divergence between the prior and the policy over skills.
    fn initial_kl(&self, _: &[f32], obs: ObsSlice<'_>, n: usize) -> Result<Option<f32>, LearnError> {
        self.over_skills.learner().initial_kl(&[], obs, n)
    }

    /// Saves the learner. The checkpoints of its learners are in it whole, as bytes `over_skills` and `below`.
    fn save(&self, path: &Path) -> Result<(), FileError> {
        self.checkpoint(path)?.write()
    }

    fn set_total_updates(&mut self, total: Option<u64>) {
        if let OverSkills::Ppo(learner) = &mut self.over_skills {
            learner.set_total_updates(total);
        }
        if let Some(below) = &mut self.below {
            below.set_total_updates(total);
        }
    }

    /// Returns the inputs and outputs of the acting policy.
    fn spec(&self) -> PolicySpec {
        match &self.below {
            Some(below) => below.spec(),
            None => self.over_skills.teacher().description.decoder_spec(),
        }
    }

    fn rollout_latent(&self) -> usize {
        self.over_skills.teacher().latent()
    }

    fn gathering(&self) -> Duration {
        self.base().gathering + self.below.as_ref().map_or(Duration::ZERO, |below| below.gathering())
    }

    fn prior(&self) -> Option<Prior> {
        Some(self.over_skills.prior())
    }

    fn skills(&self) -> Option<SkillSource> {
        Some(self.over_skills.teacher().source_of(self.over_skills.prior(), self.base().device))
    }
}
