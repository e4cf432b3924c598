//! What keeps actor and critic from minding changed pictures (Raileanu et al. 2021, "Automatic data augmentation for
//! generalization in reinforcement learning", DrAC): the more they differ on a changed picture from what they say of the
//! original, the larger the loss. The rollout itself is never changed.

use super::step::{Minibatch, Moment, outputs};
use super::{PpoConfig, PpoNets};
use crate::LearnError;
use crate::nn::Dist;
use burn::tensor::Tensor;

/// mean(KL(π(s) ‖ π(s'))) + mean((V(s') - V(s))²) for the changed pictures s' of a minibatch, `[1]`; `None` without any,
/// and while the critic warms up.
/// What is said of the originals, `dist` and `values`, is a constant.
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
    // While only the critic learns the actor stays as it is.
    let Some(changed) = batch.augmented.as_ref().filter(|_| !moment.is_warming_up) else { return Ok(None) };
    let (dist_of_changed, values_of_changed) = outputs(nets, changed, batch, config, moment)?;
    let divergence = dist.clone().detach().kl(&dist_of_changed)?.mean();
    let difference = (values_of_changed - values.clone().detach()).square().mean();
    Ok(Some(divergence + difference))
}
