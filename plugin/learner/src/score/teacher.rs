//! The teacher: the frozen decoder and prior of a skill model.

use crate::{
    Actions, DeviceKind, FileError, LearnError, PolicySpec,
    file::TensorFile,
    nn::{Dist, HostDist, moved, scalar, unsquashed, vector},
    norm::{ObsStats, put_obs_stats},
    policy::{Actor, ActorShape, Policy, StateBatch},
    score::{PriorKind, ScoreConfig, decoder_kl, penalty_weights},
    skill::{Actors, Prior, SKILL_STATS, SkillDescription, SkillModel, SkillSource},
};
use burn::tensor::{Device, Tensor};
use rand::Rng;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The network of a skill model that a policy starts as and stays close to.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) enum TiedTo {
    /// The decoder π(a | s, z), for a policy that acts.
    #[default]
    Decoder,
    /// The prior p(z | s), for a policy whose actions are skills.
    Prior,
}

impl TiedTo {
    pub(crate) fn is_decoder(&self) -> bool {
        *self == Self::Decoder
    }
}

/// The decoder and the prior of a skill model, and the settings for their use.
#[derive(Clone, Debug)]
pub(crate) struct Teacher {
    pub(crate) config: ScoreConfig,
    pub(crate) tied_to: TiedTo,
    pub(crate) description: SkillDescription,
    pub(crate) actors: Actors,
    /// Frozen normalisation of observations for decoder, prior and the policy that is tied to them.
    pub(crate) stats: Option<Arc<ObsStats>>,
}

impl Teacher {
    /// Creates a teacher of `model`, used by the settings of `config`.
    pub(crate) fn new(
        config: ScoreConfig,
        tied_to: TiedTo,
        model: &SkillModel,
        device: DeviceKind,
    ) -> Result<Self, LearnError> {
        let mut actors = Actors { decoder: model.nets.decoder.clone(), prior: model.nets.prior.clone() };
        if model.device != device {
            device.check()?;
            let to = device.plain();
            actors = Actors { decoder: moved(&actors.decoder, &to)?, prior: moved(&actors.prior, &to)? };
        }
        let (description, stats) = (model.description.clone(), model.stats.clone());
        Ok(Self { config, tied_to, description, actors, stats })
    }

    /// Returns the inputs and outputs of a policy that is tied to this skill model.
    pub(crate) fn policy_spec(&self) -> PolicySpec {
        let latent = if self.config.condition { self.latent() } else { 0 };
        match self.tied_to {
            TiedTo::Decoder => PolicySpec { latent, ..self.description.decoder_spec() },
            TiedTo::Prior => self.description.prior_spec(),
        }
    }

    /// Returns the layers of a policy that is a copy.
    pub(crate) fn shape(&self) -> ActorShape {
        match self.tied_to {
            TiedTo::Decoder => self.description.decoder_shape(),
            TiedTo::Prior => self.description.prior_shape(),
        }
    }

    /// Returns the width of the skills that a rollout of the policy must hold.
    pub(crate) fn rollout_latent(&self) -> usize {
        match self.tied_to {
            TiedTo::Decoder => self.latent(),
            TiedTo::Prior => 0,
        }
    }

    /// Returns the width of a skill.
    pub(crate) fn latent(&self) -> usize {
        self.description.config.latent
    }

    /// Returns whether the policy's layers are those of the network that it is tied to, and not those of the
    /// learner's settings.
    pub(crate) fn is_copied(&self) -> bool {
        self.config.init_from_decoder
    }

    /// Returns the network that a copying policy starts as.
    pub(crate) fn origin(&self) -> &Actor {
        match self.tied_to {
            TiedTo::Decoder => &self.actors.decoder,
            TiedTo::Prior => &self.actors.prior,
        }
    }

    /// Checks that these settings are possible. `norm_obs`: the learner would normalise observations itself.
    ///
    /// # Errors
    /// [`LearnError::Config`] if they are not.
    pub(crate) fn check(&self, norm_obs: bool) -> Result<(), LearnError> {
        self.config.validate()?;
        self.config.check_space(self.policy_spec().action_space)?;
        let bad = |text: &str| Err(LearnError::Config(text.to_owned()));
        if norm_obs && self.description.config.norm_obs {
            return bad(
                "norm_obs cannot be combined with a skill model that normalises observations: the policy uses the same \
                 frozen normaliser",
            );
        }
        if norm_obs && self.is_copied() {
            return bad(
                "norm_obs cannot be combined with score init_from_decoder: the decoder reads raw observations; set \
                 norm_obs of the skill model, which then normalises for both",
            );
        }
        Ok(())
    }

    /// Returns the source of skills, by [`ScoreConfig::prior`].
    pub(crate) fn prior(&self, device: DeviceKind) -> Prior {
        match self.config.prior {
            PriorKind::StandardNormal => Prior::standard_normal(self.latent(), self.description.config.tanh_latent),
            PriorKind::Learned => self.prior_of(&self.actors.prior, device),
        }
    }

    /// Returns skills from `actor`, which has the prior's layers.
    pub(crate) fn prior_of(&self, actor: &Actor, device: DeviceKind) -> Prior {
        let (latent, tanh) = (self.latent(), self.description.config.tanh_latent);
        Prior::learned(actor, self.stats.clone(), self.description.observation, latent, tanh, device.plain())
    }

    /// Returns prior and decoder with the skill interval and the draw, as a policy needs them in play.
    pub(crate) fn source(&self, device: DeviceKind) -> SkillSource {
        self.source_of(self.prior(device), device)
    }

    /// Does [`Self::source`] with skills from `prior`.
    pub(crate) fn source_of(&self, prior: Prior, device: DeviceKind) -> SkillSource {
        let (skill_interval, draw) = (self.config.skill_interval, self.config.skill_draw);
        SkillSource { prior, decoder: self.decoder_policy(device), skill_interval, draw }
    }

    /// Returns the network that the policy is tied to, as a policy.
    fn origin_policy(&self, device: DeviceKind) -> Policy {
        match self.tied_to {
            TiedTo::Decoder => self.decoder_policy(device),
            TiedTo::Prior => self.policy_of(&self.actors.prior, self.description.prior_spec(), device),
        }
    }

    /// Returns the decoder as a policy.
    pub(crate) fn decoder_policy(&self, device: DeviceKind) -> Policy {
        self.policy_of(&self.actors.decoder, self.description.decoder_spec(), device)
    }

    fn policy_of(&self, actor: &Actor, spec: PolicySpec, device: DeviceKind) -> Policy {
        Policy::new(actor, None, self.stats.clone(), spec, device.plain())
    }

    /// Adds the weights of decoder and prior to a file, and their normaliser.
    pub(crate) fn put(&self, file: &mut TensorFile) -> Result<(), FileError> {
        if let Some(stats) = &self.stats {
            put_obs_stats(file, SKILL_STATS, stats);
        }
        file.put_network("decoder", &self.actors.decoder)?;
        file.put_network("prior", &self.actors.prior)
    }

    /// Takes the teacher that [`Self::put`] has added out of `file`, the checkpoint of a policy of `spec`.
    pub(crate) fn take(
        (config, tied_to): (ScoreConfig, TiedTo),
        description: SkillDescription,
        spec: PolicySpec,
        file: &mut TensorFile,
        device: DeviceKind,
    ) -> Result<Self, FileError> {
        let actors = Actors::stored(&description, file, "", &device.plain())?;
        let mut teacher = Self { config, tied_to, description, actors, stats: None };
        let tied = teacher.policy_spec();
        if tied != spec {
            return Err(file.format(format!("the policy is {spec:?}, but its skill model makes it {tied:?}")));
        }
        teacher.stats = teacher.description.take_stats(file, SKILL_STATS)?;
        Ok(teacher)
    }

    /// Returns the mean divergence between decoder and `policy` over `states`, in nats, which must be exactly 0 for a
    /// copy that is `untrained`.
    pub(crate) fn initial_kl(
        &self,
        policy: &Policy,
        untrained: bool,
        states: StateBatch<'_>,
        device: DeviceKind,
    ) -> Result<f32, LearnError> {
        let StateBatch { z, obs, n, .. } = states;
        if n == 0 {
            return Err(LearnError::Config("no rows to compare decoder and policy on".to_owned()));
        }
        let played = policy.forward(z, obs, n)?;
        let squashed = played.squashed;
        let mut decoded = self.origin_policy(device).forward(z, obs, n)?.into_dist();
        if squashed {
            decoded = unsquashed(&decoded);
        }
        let rows: Vec<usize> = (0..n).collect();
        let dist = |host: HostDist| host.rows(&rows, &device.plain());
        let kl = decoder_kl(&dist(decoded), &dist(played.into_dist()), self.config.direction())?;
        let kl = scalar(kl.mean())?;
        if self.config.init_from_decoder && untrained && kl != 0.0 {
            return Err(LearnError::InitialKl { kl });
        }
        Ok(kl)
    }
}

// The teacher's side of the penalty: its distributions and its confidence for the rows that an update reads.

/// The decoder's outputs for many rows, in host memory.
#[derive(Clone, Debug)]
pub(crate) struct TeacherOutput {
    /// The decoder's distributions, in the form that is compared with the policy's.
    pub(crate) dist: HostDist,
    /// The weight of each row: the decoder's confidence.
    pub(crate) confidence: Vec<f32>,
}

/// The teacher's side of a minibatch.
#[derive(Clone, Debug)]
pub struct TeacherBatch {
    /// The decoder's distributions.
    pub dist: Dist,
    /// The weight of each row, α in the paper, `[n]`.
    pub confidence: Tensor<1>,
    /// Mean of the weights.
    pub mean_confidence: f64,
}

impl TeacherOutput {
    /// Returns the given rows as constants on `device`.
    pub(crate) fn batch(&self, rows: &[usize], device: &Device) -> TeacherBatch {
        TeacherBatch {
            dist: self.dist.rows(rows, device),
            mean_confidence: self.mean_confidence(rows),
            confidence: vector(rows.iter().map(|&r| self.confidence[r]).collect(), device),
        }
    }

    /// Returns the mean confidence of some rows.
    pub(crate) fn mean_confidence(&self, rows: &[usize]) -> f64 {
        let sum: f64 = rows.iter().map(|&r| f64::from(self.confidence[r])).sum();
        sum / rows.len() as f64
    }
}

impl Teacher {
    /// Returns the distributions of the network that the policy is tied to, and its confidence, in `states` where
    /// `actions` were taken. Returns `None` if there is no penalty. `legal` is the mask of the states, or empty.
    /// `squashed`: the policy is a squashed Gaussian.
    pub(crate) fn output<R: Rng + ?Sized>(
        &self,
        states: StateBatch<'_>,
        (actions, legal): (&Actions, &[bool]),
        squashed: bool,
        own_samples_from: &mut R,
        device: DeviceKind,
    ) -> Result<Option<TeacherOutput>, LearnError> {
        if !self.config.kl {
            return Ok(None);
        }
        let mut output = self.origin_policy(device).forward(states.z, states.obs, states.n)?;
        output.restrict(legal);
        let dist = output.into_dist();
        let confidence = penalty_weights(&self.config, &dist, actions, own_samples_from)?;
        let dist = if squashed { unsquashed(&dist) } else { dist };
        Ok(Some(TeacherOutput { dist, confidence }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::policy::VECTORS_AT_A_TIME;
    use crate::rng::{Streams, normal};
    use crate::score::ScoreConfig;

    use crate::skill::{SkillConfig, SkillDescription, SkillModel, SkillNets};
    use crate::{ActionSpace, ObsKind};

    #[test]
    fn a_row_left_over_is_like_any_other() {
        let device = DeviceKind::Flex;
        let (obs_dim, space) = (130, ActionSpace::Discrete(15));
        let config = SkillConfig { gru_hidden: 1, encoder_hidden: 1, ..SkillConfig::default() };
        let observation = ObsKind::Vector(obs_dim);
        let nets =
            SkillNets::new(&config, observation, space, &Streams::new(0), &device.plain()).expect("good settings");
        let description = SkillDescription { config, observation, action_space: space };
        let model = SkillModel::new(description, &nets, None, device);
        let teacher = Teacher::new(ScoreConfig::default(), TiedTo::Decoder, &model, device).expect("the same device");
        let mut rng = Streams::new(1).stream("rows", 0);
        let n = VECTORS_AT_A_TIME + 1;
        let mut numbers = |width: usize| -> Vec<f32> { (0..n * width).map(|_| normal(&mut rng)).collect() };
        let (z, obs) = (numbers(teacher.latent()), numbers(obs_dim));
        let actions = Actions::Discrete(vec![0; n]);
        let states = StateBatch { z: &z, left: &[], memory: &[], obs: (&obs).into(), n };
        let rows = teacher.output(states, (&actions, &[]), false, &mut Streams::new(1).stream("own", 0), device);
        let rows = rows.expect("finite").expect("there is a penalty");
        // The same row among others.
        let tail = |values: &[f32], width: usize| values[(n - 3) * width..].to_vec();
        let among = model.policy().forward(&tail(&z, teacher.latent()), &tail(&obs, obs_dim), 3).expect("finite");
        assert_eq!(rows.dist.head.len(), n * 15);
        assert_eq!(rows.dist.head[(n - 1) * 15..], among.head[2 * 15..]);
    }
}
