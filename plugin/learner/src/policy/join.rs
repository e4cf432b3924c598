//! Joining skills and observations into network inputs, on the host.

use crate::norm::ObsStats;

/// Rows `[z, obs]` for the given row numbers: `latent` numbers of `z` (may be 0), then `obs_dim` of `obs`, which
/// `stats` normalises if given.
pub(crate) fn joined_rows(
    z: &[f32],
    latent: usize,
    obs: &[f32],
    obs_dim: usize,
    stats: Option<&ObsStats>,
    rows: impl ExactSizeIterator<Item = usize>,
) -> Vec<f32> {
    let mut out = Vec::with_capacity(rows.len() * (latent + obs_dim));
    for row in rows {
        out.extend_from_slice(&z[row * latent..(row + 1) * latent]);
        let observation = &obs[row * obs_dim..(row + 1) * obs_dim];
        match stats {
            None => out.extend_from_slice(observation),
            Some(stats) => stats.normalize_into(observation, &mut out),
        }
    }
    out
}
