//! The loss that makes actor and critic insensitive to image augmentations (Raileanu et al. 2021, "Automatic data
//! augmentation for generalization in reinforcement learning", DrAC). It grows with the difference between their
//! outputs for a changed picture and for the original. The rollout itself is never changed.

use super::step::{Minibatch, Moment, outputs};
use super::{PpoConfig, PpoNets};
use crate::LearnError;
use crate::nn::Dist;
use burn::tensor::Tensor;

/// Returns mean(KL(π(s) ‖ π(s'))) + mean((V(s') - V(s))²) for the changed pictures s' of a minibatch, `[1]`; `None`
/// without any, and while the critic warms up. The outputs for the originals, `dist` and `values`, are constants.
///
/// # Errors
/// [`LearnError::Config`] if the networks do not read such observations.
pub(super) fn augmentation_loss(
    nets: &PpoNets,
    dist: &Dist,
    values: &Tensor<1>,
    batch: &Minibatch,
    config: &PpoConfig,
    moment: &Moment<'_>,
) -> Result<Option<Tensor<1>>, LearnError> {
    // While only the critic learns the actor must not change.
    let Some(changed) = batch.augmented.as_ref().filter(|_| !moment.is_warming_up) else { return Ok(None) };
    let (dist_of_changed, values_of_changed) = outputs(nets, changed, batch, config, moment)?;
    let divergence = dist.clone().detach().kl(&dist_of_changed)?.mean();
    let difference = (values_of_changed - values.clone().detach()).square().mean();
    Ok(Some(divergence + difference))
}
