//! Settings of PPO.
//!
//! - `curiosity`: those of a reward for what is new.

mod curiosity;

use crate::{
    Augmentation, EntityBlock, LearnError, ObsKind, SettingError, TimeLimit,
    nn::CnnKind,
    norm::{RewardNormalizer, RewardReset},
    policy::{EntityKind, MemoryKind},
    settings,
    settings::{Range, Reader, Settings},
    skill::SkillConfig,
};
use playbot_kernels::elementwise::Activation;

pub use crate::ppo::config::curiosity::Curiosity;

/// The algorithms that learn by PPO.
const PPO: &[Reader] = &[Reader::SCORE_PPO, Reader::PPO, Reader::SPIRL_PPO, Reader::SPIRL_SAC_DECODER];

/// The algorithms whose networks its settings describe.
const NETWORKS: &[Reader] =
    &[Reader::SCORE_PPO, Reader::PPO, Reader::SPIRL_PPO, Reader::SPIRL_SAC_DECODER, Reader::IMITATION];

/// Those of them whose policy is over actions.
const OVER_ACTIONS: &[Reader] = &[Reader::SCORE_PPO, Reader::PPO, Reader::SPIRL_PPO_DECODER, Reader::SPIRL_SAC_DECODER];

/// Those of them whose policy may be curious.
const CURIOUS: &[Reader] = &[Reader::SCORE_PPO, Reader::PPO, Reader::SPIRL_PPO];

/// Those of them whose policy may remember.
const REMEMBERING: &[Reader] = &[Reader::SCORE_PPO, Reader::PPO, Reader::SPIRL_PPO, Reader::IMITATION];

settings! {
    /// Hyperparameters of PPO. The defaults are those of the paper's CoinRun runs, with 64 environments in mind.
    #[derive(Clone, PartialEq, Debug)]
    pub struct PpoConfig in "ppo", read by PPO;

    /// Learning rate of Adam.
    lr: f64 = 5e-4, in Range::RATE;
    /// True if the learning rate decreases linearly to 0 over `ppo.total_updates`. A run that is prolonged goes on from
    /// its last rate.
    anneal_lr: bool = false;
    /// Updates of the whole run. Only `ppo.anneal_lr` and `score.kl_coef_end` need it. An experiment sets it to the
    /// length of its run.
    total_updates: Option<u64> = None;
    /// Steps per environment in a rollout.
    num_steps: usize = 256, in Range::COUNT;
    /// Parts into which a rollout is shuffled.
    minibatches: usize = 8, in Range::COUNT;
    /// Passes over a rollout.
    epochs: usize = 3, in Range::PASSES;
    /// Discount γ.
    gamma: f64 = 0.999, in Range::SHARE;
    /// λ of the generalised advantage estimate.
    lambda: f64 = 0.95, in Range::SHARE;
    /// Bound of the probability ratio's distance from 1, and of the value's change if that is clipped.
    clip: f64 = 0.2, in Range::Positive(1e6);
    /// True if the value loss is clipped too.
    clip_value_loss: bool = true;
    /// Weight of the value loss.
    vf_coef: f64 = 0.5, in Range::WEIGHT;
    /// Weight of the entropy bonus.
    ent_coef: f64 = 0.01, in Range::WEIGHT, by OVER_ACTIONS;
    /// Bound of the gradient's Euclidean norm over all parameters.
    max_grad_norm: f64 = 0.5, in Range::RATE;
    /// True if advantages are normalised within each minibatch.
    norm_adv: bool = true;
    /// Treatment of a step that reached the time limit.
    time_limit: TimeLimit = TimeLimit::Bootstrap;
    /// True if rewards are divided by the running deviation of the discounted return.
    norm_reward: bool = true;
    /// Discount of that return; `ppo.gamma` if `None`.
    reward_gamma: Option<f64> = None, in Range::SHARE;
    /// The time at which the end of an episode resets that return.
    reward_reset: RewardReset = RewardReset::AfterStep;
    /// True if actor and critic normalise observations by running statistics of their own. It cannot be combined with
    /// a copied decoder, whose observations are raw or, by `skills.norm_obs`, normalised by frozen statistics. Not
    /// for images, whose pixels are divided by 255.
    norm_obs: bool = false, by NETWORKS;
    /// The way in which actor and critic read sets of things, such as enemies (`EntitySensor`). By `Set` every thing goes
    /// through the same two layers of width `hidden`, and mean and maximum over all things join the other values: their
    /// order is without effect. `Flat` reads the slots as other values. A copied decoder brings its own. Without effect
    /// on observations without sets.
    entities: EntityKind = EntityKind::default(), in Range::COUNT, by NETWORKS, off "settings::is_off";
    /// The memory of actor and critic. A policy that starts as a copy of the decoder or of the prior has one that is
    /// without effect at first. `sequence` ticks are trained together, and `burn_in` is explained with them; to a policy
    /// over skills a tick is a skill.
    memory: MemoryKind = MemoryKind::None, in Range::COUNT, by REMEMBERING, such as "Gru(hidden: 128)", off "settings::is_off";
    /// Hidden layers of actor and critic. A copied decoder brings its own.
    hidden: Vec<usize> = vec![200, 200], in Range::COUNT, by NETWORKS;
    /// The function after each hidden layer.
    activation: Activation = Activation::Relu, by NETWORKS;
    /// The convolutions over images, which actor and critic share. A copied decoder brings its own. Not used for
    /// vectors.
    cnn: CnnKind = CnnKind::default(), in Range::COUNT, by NETWORKS;
    /// ε of Adam.
    adam_eps: f64 = 1e-5, in Range::Positive(1.0);
    /// Decoupled weight decay of Adam: a weight loses lr · weight_decay of itself in each step.
    weight_decay: f64 = 0.0, in Range::Weight(1e30);
    /// Updates in which only the critic learns. An untrained critic would drive a policy that starts as a copy of the
    /// decoder away from it. Adam begins anew when the policy begins to learn. A decreasing weight of the penalty
    /// decreases from the first update on.
    critic_warmup: u64 = 0;
    /// Image augmentations to which actor and critic become insensitive (Raileanu et al. 2021, "Automatic data
    /// augmentation for generalization in reinforcement learning", DrAC). All of them apply at once.
    augment: Vec<Augmentation> = Vec::new(), such as "[Translate(1)]";
    /// Weight of the augmentation loss: the divergence of the actor and the squared error of the critic under
    /// `ppo.augment`.
    augment_coef: f64 = 0.1, in Range::WEIGHT;
    /// True if the critic's loss trains the convolutions over images too, instead of only reading the policy's
    /// features. It never does while the critic warms up.
    critic_trains_cnn: bool = true;
    /// A reward for what is new, with a value of its own: `Off`, or `Rnd` for random network distillation (Burda et al.
    /// 2018, "Exploration by random network distillation"). `extrinsic` and `intrinsic` weigh the advantages of both
    /// rewards. `gamma` discounts the intrinsic one, whose return goes on over the ends of episodes. `share` of the
    /// samples train the predictor, with the rate `lr`. `hidden` and `features` are its sizes. A policy over skills is
    /// rewarded for the state to which a skill leads; `gamma` is per tick all the same.
    curiosity: Curiosity = Curiosity::Off,
        within "`extrinsic`, `intrinsic` 0 to 1000000; `gamma` at least 0 and below 1; `share` above 0, at most 1; `lr` \
        above 0; sizes at least 1", by CURIOUS,
        such as "Rnd(extrinsic: 2.0, intrinsic: 1.0, gamma: 0.99, share: 0.25)", off "crate::settings::is_off";
}

impl PpoConfig {
    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first impossible setting.
    pub fn validate(&self) -> Result<(), LearnError> {
        self.check_ranges()?;
        self.curiosity.check()?;
        if self.anneal_lr && self.total_updates.is_none_or(|n| n == 0) {
            return Err(SettingError::new("ppo.anneal_lr", "needs `ppo.total_updates`").into());
        }
        Ok(())
    }

    /// Checks that the augmentations and the memory apply to such observations.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first setting that does not apply.
    pub fn check_observation(&self, observation: &ObsKind) -> Result<(), LearnError> {
        if let (MemoryKind::Stack { .. }, ObsKind::Image(_)) = (self.memory, observation) {
            let text = "must not be a Stack for pictures: stack them with `image.stack`";
            return Err(SettingError::new("ppo.memory", text).into());
        }
        EntityBlock::check_all(self.entities.blocks(), observation)?;
        self.refuse_stack_of_sets(self.entities.blocks())?;
        self.augment.iter().try_for_each(|augmentation| augmentation.check("ppo.augment", observation))
    }

    /// Checks that these settings of sets go together with those of a skill model, of which the policy is a copy or not.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the setting to change.
    pub(super) fn check_sets(&self, skills: &SkillConfig, is_copied: bool) -> Result<(), LearnError> {
        let (own, theirs) = (self.entities.blocks(), skills.entities.blocks());
        if is_copied {
            return self.refuse_stack_of_sets(theirs);
        }
        if skills.norm_obs && !own.is_empty() && own != theirs {
            let text = "must be like `skills.entities`, as the policy sees through the frozen normaliser of its skills: make \
                        both `Set` or both `Flat`";
            return Err(SettingError::new("ppo.entities", text).into());
        }
        Ok(())
    }

    /// Checks that no stack is wanted of sets that are read as sets.
    ///
    /// # Errors
    /// [`LearnError::Setting`] if there is one.
    fn refuse_stack_of_sets(&self, sets: &[EntityBlock]) -> Result<(), LearnError> {
        let (MemoryKind::Stack { .. }, [_, ..]) = (self.memory, sets) else { return Ok(()) };
        let text = "must not be a Stack of sets of things, whose encoder changes while it learns: use a Gru, or set \
                    `ppo.entities` and `skills.entities` to Flat";
        Err(SettingError::new("ppo.memory", text).into())
    }

    /// Refuses a memory, for a policy that decides below another one.
    ///
    /// # Errors
    /// [`LearnError::Setting`] if there is one.
    pub(crate) fn refuse_memory(&self, why: &str) -> Result<(), LearnError> {
        match self.memory {
            MemoryKind::None => Ok(()),
            _ => Err(SettingError::new("ppo.memory", why.to_owned()).into()),
        }
    }

    /// Returns the normaliser of rewards that these settings describe.
    pub(super) fn reward_normalizer(&self) -> RewardNormalizer {
        let gamma = self.reward_gamma.unwrap_or(self.gamma);
        RewardNormalizer { reset: self.reward_reset, ..RewardNormalizer::new(gamma) }
    }

    /// Returns the learning rate of update number `update`, from 0.
    pub fn lr_at(&self, update: u64) -> f64 {
        match self.total_updates.filter(|_| self.anneal_lr) {
            Some(total) => self.lr * (1.0 - update as f64 / total as f64).max(0.0),
            None => self.lr,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reward_normaliser_follows_its_settings() {
        let config = PpoConfig { gamma: 0.9, ..PpoConfig::default() };
        assert_eq!(config.reward_normalizer(), RewardNormalizer::new(0.9));
        let legacy = PpoConfig { reward_gamma: Some(0.5), reward_reset: RewardReset::SameStep, ..config };
        let mut normalizer = legacy.reward_normalizer();
        normalizer.normalize(&[4.0, 2.0], &[false, true], 1).expect("they fit");
        assert_eq!(normalizer.returns, [2.0]);
        normalizer.normalize(&[1.0], &[false], 1).expect("they fit");
        assert_eq!(normalizer.returns, [2.0]);
        let bad = PpoConfig { reward_gamma: Some(1.5), ..legacy };
        assert!(bad.validate().expect_err("above 1").to_string().contains("reward_gamma"));
    }
}
