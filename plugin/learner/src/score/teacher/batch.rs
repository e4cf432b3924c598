//! The teacher's side of the penalty: its distributions and its confidence for the rows that an update reads.

use super::Teacher;
use crate::nn::{Dist, HostDist, unsquashed, vector};
use crate::policy::StateBatch;
use crate::score::penalty_weights;
use crate::{Actions, DeviceKind, LearnError};
use burn::tensor::{Device, Tensor};
use rand::Rng;

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
    /// `actions` were taken; `None` if there is no penalty. `squashed`: the policy is a squashed Gaussian.
    pub(crate) fn output<R: Rng + ?Sized>(
        &self,
        states: StateBatch<'_>,
        actions: &Actions,
        squashed: bool,
        own_samples_from: &mut R,
        device: DeviceKind,
    ) -> Result<Option<TeacherOutput>, LearnError> {
        if !self.config.kl {
            return Ok(None);
        }
        let dist = self.origin_policy(device).forward(states.z, states.obs, states.n)?.into_dist();
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
    use crate::score::TiedTo;
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
        let states = StateBatch { z: &z, left: &[], obs: (&obs).into(), n };
        let rows = teacher.output(states, &actions, false, &mut Streams::new(1).stream("own", 0), device);
        let rows = rows.expect("finite").expect("there is a penalty");
        // The same row among others.
        let tail = |values: &[f32], width: usize| values[(n - 3) * width..].to_vec();
        let among = model.policy().forward(&tail(&z, teacher.latent()), &tail(&obs, obs_dim), 3).expect("finite");
        assert_eq!(rows.dist.head.len(), n * 15);
        assert_eq!(rows.dist.head[(n - 1) * 15..], among.head[2 * 15..]);
    }
}
