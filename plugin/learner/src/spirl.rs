//! SPiRL (Pertsch et al. 2021, "Accelerating reinforcement learning with learned skill priors"): a policy over skills.
//!
//! The decoder acts. The policy over skills, π(z | s), learns and takes the place of the prior. It starts as a copy of
//! the prior and acts once per skill interval. It pays for the divergence KL(π(z | s) ‖ p(z | s)) instead of earning
//! entropy. To this policy a skill is one action. Its reward is the discounted sum of its ticks' rewards, and its next
//! state is discounted by γᵀ. PPO or SAC learn it like any other action.
//!
//! The folder, in reading order:
//!
//! - `skill_steps`: conversion of a rollout of ticks to one of skills.
//! - `over_skills`: the learner of π(z | s): PPO or SAC, tied to the prior.

mod over_skills;
mod skill_steps;

use crate::{
    Curiosity, DeviceKind, FileError, LearnError, ObsSlice, PolicySpec, PpoLearner, Rollout, SacLearner, StartFrom,
    TakenOver, TimeLimit,
    file::{FileKind, TensorFile},
    learner::{ContinuedSchedule, LearnTimes, Learner, LearnerBase, LearnerMetrics},
    policy::Policy,
    ppo::PpoConfig,
    sac::{EntropyCoef, SacConfig},
    score::{PriorKind, ScoreConfig, Teacher, TiedTo},
    settings,
    settings::{Range, Reader, Settings},
    skill::{Prior, SkillDraw, SkillModel, SkillSource},
    spirl::over_skills::{OverSkills, of_prior, tag_of_skills},
};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Learns which skills to play.
///
/// See [`self`]. The numbers depend only on the settings, the seed and the rollouts. These must be at least
/// twice as long as the skill interval, and hold the remaining shares of skills ([`Rollout::left`]) and the last
/// states ([`Rollout::ends`]).
#[derive(Debug)]
pub struct SpirlLearner {
    config: SpirlConfig,
    over_skills: OverSkills,
    /// The learner below the skills; `None` if the decoder is frozen.
    below: Option<PpoLearner>,
    /// Sizes of the advantages of the last rollout's skills, in the rows in which they were drawn.
    advantage_sizes: Vec<Option<f32>>,
}

impl SpirlLearner {
    /// Creates a learner of `model`'s skills by PPO. Of `score` only the skill interval counts. `ppo.gamma` is per
    /// tick, and so are the discount of the return by which rewards are scaled, whatever `ppo.reward_gamma` is, and that
    /// of curiosity. There is no bonus for entropy.
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
        let (gamma, ent_coef) = (ppo.gamma.powi(score.skill_interval as i32), 0.0);
        let curiosity = ppo.curiosity.clone().over(score.skill_interval);
        let ppo = PpoConfig { gamma, ent_coef, curiosity, ..ppo };
        let teacher = Teacher::new(of_prior(&config, score, true), TiedTo::Prior, model, device)?;
        let learner = PpoLearner::fresh(ppo, teacher.policy_spec(), Some(teacher), seed, device)?;
        Ok(Self { config, over_skills: OverSkills::Ppo(learner), below, advantage_sizes: Vec::new() })
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
        let sac = SacConfig { gamma: sac.gamma.powi(score.skill_interval as i32), entropy, random_start: false, ..sac };
        // It is tied to the prior by the cost of the divergence, without a penalty beside it.
        let teacher = Teacher::new(of_prior(&config, score, false), TiedTo::Prior, model, device)?;
        let learner = SacLearner::fresh(sac, teacher.policy_spec(), Some(teacher), seed, device)?;
        Ok(Self { config, over_skills: OverSkills::Sac(learner), below, advantage_sizes: Vec::new() })
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
        // What is new is for the policy over skills to look for.
        let ppo = PpoConfig { curiosity: Curiosity::Off, ..ppo.clone() };
        if !config.learn_decoder {
            return Ok(None);
        }
        ppo.refuse_memory(
            "is that of the policy over skills, and a decoder that learns below it has none: leave it `None`, or set \
             `spirl.learn_decoder` to false",
        )?;
        Self::with_skill(ppo, score.clone(), model, seed, device).map(Some)
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
        let of_skills = self.over_skills.learn(&self.config, rollout, &mut self.advantage_sizes)?;
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

    /// Returns those of the policy over skills, in the rows in which a skill was drawn.
    fn advantage_sizes(&self) -> &[Option<f32>] {
        &self.advantage_sizes
    }

    /// Saves the learner. The checkpoints of its learners are in it whole, as bytes `over_skills` and `below`.
    fn save(&self, path: &Path) -> Result<(), FileError> {
        self.checkpoint(path)?.write()
    }

    /// Takes over the policy over skills, if it learns by PPO, and the decoder's learner if both have one.
    fn start_from(&mut self, start: &StartFrom<'_>) -> Result<TakenOver, FileError> {
        let refuse = |source| FileError::Learner { path: start.path.to_owned(), source };
        let other = Self::load(start.path, self.base().device)?;
        let (OverSkills::Ppo(own), OverSkills::Ppo(theirs)) = (&mut self.over_skills, other.over_skills) else {
            let text = "only a policy over skills by PPO can start from the weights of another one".to_owned();
            return Err(refuse(LearnError::Config(text)));
        };
        let mut report = own.take_over(theirs, start).map_err(refuse)?;
        if let (Some(own), Some(theirs)) = (&mut self.below, other.below) {
            let of_decoder = own.take_over(theirs, start).map_err(refuse)?;
            report.is_same_policy &= of_decoder.is_same_policy;
            report.join(of_decoder);
        }
        Ok(report)
    }

    fn set_total_updates(&mut self, total: Option<u64>) -> Option<ContinuedSchedule> {
        let of_skills = match &mut self.over_skills {
            OverSkills::Ppo(learner) => learner.set_total_updates(total),
            OverSkills::Sac(_) => None,
        };
        let of_actions = self.below.as_mut().and_then(|below| below.set_total_updates(total));
        of_skills.or(of_actions)
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

    fn times(&self) -> LearnTimes {
        let below = self.below.as_ref().map(|below| below.times()).unwrap_or_default();
        self.base().times.zip(below, |one, other| one + other)
    }

    fn prior(&self) -> Option<Prior> {
        Some(self.over_skills.prior())
    }

    fn skills(&self) -> Option<SkillSource> {
        Some(self.over_skills.teacher().source_of(self.over_skills.prior(), self.base().device))
    }
}

settings! {
    /// Hyperparameters of SPiRL beside those of the learner of skills, PPO or SAC, and the skill interval
    /// ([`ScoreConfig::skill_interval`](crate::ScoreConfig::skill_interval)).
    #[derive(Clone, PartialEq, Debug)]
    pub struct SpirlConfig in "spirl", read by &[Reader::SPIRL_PPO, Reader::SPIRL_SAC];

    /// Cost of leaving the prior, per nat of KL(π(z | s) ‖ p(z | s)); at the start if it is tuned.
    kl_coef: f64 = 0.1, in Range::Positive(1e6);
    /// Divergence in nats per skill that `spirl.kl_coef` is tuned for; `None` keeps it constant.
    target_kl: Option<f64> = Some(1.0), in Range::Positive(1e6);
    /// True if the decoder continues to learn below the skills, by SCORE-PPO with the settings of `ppo` and `score`.
    /// It is frozen otherwise.
    learn_decoder: bool = false;
}

impl SpirlConfig {
    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first impossible setting.
    pub fn validate(&self) -> Result<(), LearnError> {
        Ok(self.check_ranges()?)
    }

    /// Returns the weight after an update whose policy was `kl` nats from the prior. It is doubled or halved if that
    /// is far from the target (the adaptive penalty of Schulman et al. 2017, "Proximal policy optimization
    /// algorithms"), within bounds.
    fn tuned(&self, kl_coef: f64, kl: f64) -> f64 {
        const FAR: f64 = 1.5;
        const BOUNDS: (f64, f64) = (1e-6, 1e3);
        match self.target_kl {
            Some(target) if kl > FAR * target => (kl_coef * 2.0).min(BOUNDS.1),
            Some(target) if kl < target / FAR => (kl_coef / 2.0).max(BOUNDS.0),
            _ => kl_coef,
        }
    }
}

// A policy over skills in one file: the checkpoints of its learners, whole, as bytes.

const FILE: FileKind = FileKind { name: "spirl checkpoint", version: 2 };

/// The description in its header.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    spirl: SpirlConfig,
    is_sac: bool,
    over_skills: usize,
    below: Option<usize>,
}

impl SpirlLearner {
    /// Reads a file that [`Learner::save`] wrote. The learner continues exactly as the saved
    /// one would have.
    ///
    /// # Errors
    /// [`FileError`] describes the problem of the file.
    pub fn load(path: &Path, device: DeviceKind) -> Result<Self, FileError> {
        let mut file = TensorFile::read(path)?;
        let Header { spirl, is_sac, over_skills, below } = file.header(FILE)?;
        spirl.validate().map_err(|error| file.learner(error))?;
        let mut part = |name: &str, len| TensorFile::parse(path, &file.take_bytes(name, &[len])?);
        let over_skills = part("over_skills", over_skills)?;
        let below = below.map(|len| part("below", len)).transpose()?;
        file.finish()?;
        let over_skills = match is_sac {
            true => OverSkills::Sac(SacLearner::stored(over_skills, device)?),
            false => OverSkills::Ppo(PpoLearner::stored(over_skills, device)?),
        };
        let is_whole = over_skills.learner().base().prior_origin().is_some();
        if !is_whole || below.is_some() != spirl.learn_decoder {
            let detail = "its learners are not those of its description".to_owned();
            return Err(FileError::Format { path: path.to_owned(), detail });
        }
        let below = below.map(|file| PpoLearner::stored(file, device)).transpose()?;
        Ok(Self { config: spirl, over_skills, below, advantage_sizes: Vec::new() })
    }

    /// Returns the file that [`Learner::save`] writes.
    fn checkpoint(&self, path: &Path) -> Result<TensorFile, FileError> {
        let over_skills = self.over_skills.checkpoint(path)?.to_bytes()?;
        let below = self.below.as_ref().map(|below| below.checkpoint(path)?.to_bytes()).transpose()?;
        let header = Header {
            spirl: self.config.clone(),
            is_sac: matches!(self.over_skills, OverSkills::Sac(_)),
            over_skills: over_skills.len(),
            below: below.as_ref().map(Vec::len),
        };
        let mut file = TensorFile::new(path, FILE, &header)?;
        file.put_bytes("over_skills", &[over_skills.len()], &over_skills);
        if let Some(below) = &below {
            file.put_bytes("below", &[below.len()], below);
        }
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_follows_the_divergence() {
        let config = SpirlConfig { target_kl: Some(2.0), ..SpirlConfig::default() };
        assert_eq!([4.0, 2.0, 1.0].map(|kl| config.tuned(0.5, kl)), [1.0, 0.5, 0.25]);
        assert_eq!((config.tuned(1e-6, 0.0), config.tuned(1e3, 9.0)), (1e-6, 1e3));
        assert_eq!(SpirlConfig { target_kl: None, ..config }.tuned(0.5, 9.0), 0.5);
    }

    #[test]
    fn settings_that_cannot_work_are_named() {
        let error = |config: SpirlConfig| config.validate().expect_err("cannot work").to_string();
        assert!(error(SpirlConfig { kl_coef: 0.0, ..SpirlConfig::default() }).contains("kl_coef"));
        assert!(error(SpirlConfig { target_kl: Some(f64::NAN), ..SpirlConfig::default() }).contains("target_kl"));
        assert!(SpirlConfig::default().validate().is_ok());
    }
}
