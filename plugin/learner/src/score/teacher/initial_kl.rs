//! The divergence of a policy from its teacher, which must be 0 if it starts as a copy.

use super::Teacher;
use crate::nn::{HostDist, scalar, unsquashed};
use crate::policy::{Policy, StateBatch};
use crate::score::decoder_kl;
use crate::{DeviceKind, LearnError};

impl Teacher {
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
