//! Inputs of networks: skills joined with observations.

use crate::{
    ObsKind, ObsSlice,
    nn::{ObsBatch, matrix},
    norm::ObsStats,
};
use burn::tensor::{Device, Tensor};
use playbot_kernels::kept_memory::{OF_A_MOVE, share};

/// Rows that a thread joins at a time.
const ROWS: usize = 64;

/// The input of actor and critic for many states, on a device.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one per batch, and it is never stored")]
pub enum NetInput {
    /// Skills joined with vectors: `[z, s]`, `[n, latent + obs_dim]`.
    Joined(Tensor<2>),
    /// Images, which the actor's trunk turns into features before the skills join them.
    Images {
        /// Skills, `[n, latent]`, for networks that read any.
        z: Option<Tensor<2>>,
        /// Pixels in 0..1, `[n, channels, height, width]`.
        pixels: Tensor<4>,
    },
}

impl From<Tensor<2>> for NetInput {
    fn from(joined: Tensor<2>) -> Self {
        Self::Joined(joined)
    }
}

/// Skills and raw observations of `n` states in host memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StateBatch<'a> {
    /// `n * latent`; not read by networks without skills.
    pub(crate) z: &'a [f32],
    /// Remaining share of each skill, `n`, or empty, as in [`Rollout::left`](crate::Rollout::left).
    pub(crate) left: &'a [f32],
    /// `n * memory`, or empty if all begin anew.
    pub(crate) memory: &'a [f32],
    /// `n` observations.
    pub(crate) obs: ObsSlice<'a>,
    pub(crate) n: usize,
}

/// Builds a network's input out of skills and raw observations in host memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InputBuilder<'a> {
    /// `n * latent`.
    pub(crate) z: &'a [f32],
    /// Number of the skill's values that the network reads: all or 0.
    pub(crate) latent: usize,
    /// `n` observations of `kind`.
    pub(crate) obs: ObsSlice<'a>,
    pub(crate) kind: &'a ObsKind,
    /// Normalises vectors, if given.
    pub(crate) stats: Option<&'a ObsStats>,
}

impl InputBuilder<'_> {
    /// Returns the given rows on `device`. Only these images are converted to numbers.
    pub(crate) fn input(&self, rows: &[usize], device: &Device) -> NetInput {
        let (n, width) = (rows.len(), self.kind.numbers());
        match (self.obs, self.kind) {
            (ObsSlice::Image(pixels), ObsKind::Image(shape)) => {
                let skills = || matrix(joined_rows(&[], 0, self.z, self.latent, None, rows), n, self.latent, device);
                NetInput::Images {
                    z: (self.latent > 0).then(skills),
                    pixels: ObsBatch::gather(pixels, [shape.channels, shape.height, shape.width], rows, device),
                }
            }
            (ObsSlice::Vector(values), _) => {
                let joined = joined_rows(self.z, self.latent, values, width, self.stats, rows);
                NetInput::Joined(matrix(joined, n, self.latent + width, device))
            }
            (ObsSlice::Image(_), ObsKind::Vector(_)) => unreachable!("observations are checked to be of their kind"),
        }
    }
}

/// Returns rows `[z, obs]` for the given row numbers: `latent` numbers of `z` (may be 0), then `obs_dim` of `obs`,
/// which `stats` normalises if given.
pub(crate) fn joined_rows(
    z: &[f32],
    latent: usize,
    obs: &[f32],
    obs_dim: usize,
    stats: Option<&ObsStats>,
    rows: &[usize],
) -> Vec<f32> {
    let width = latent + obs_dim;
    let mut out = vec![0.0; rows.len() * width];
    let numbers = out.len();
    share(&mut out, (ROWS * width).max(1), numbers * OF_A_MOVE, |piece, joined| {
        for (joined, &row) in joined.chunks_exact_mut(width.max(1)).zip(&rows[piece * ROWS..]) {
            let (skill, to) = joined.split_at_mut(latent);
            skill.copy_from_slice(&z[row * latent..(row + 1) * latent]);
            let observation = &obs[row * obs_dim..(row + 1) * obs_dim];
            match stats {
                None => to.copy_from_slice(observation),
                Some(stats) => stats.normalize_into(observation, to),
            }
        }
    });
    out
}
