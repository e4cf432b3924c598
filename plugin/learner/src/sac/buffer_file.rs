//! The replay buffer in the file of a checkpoint.

use super::buffer::{ReplayBuffer, Widths};
use crate::file::TensorFile;
use crate::nn::path;
use crate::{Actions, FileError};

impl ReplayBuffer {
    /// Adds all transitions to a file, under names that begin with `prefix`.
    pub(super) fn put(&self, file: &mut TensorFile, prefix: &str) {
        let (n, Widths { obs, latent, clock, weight }) = (self.len(), self.widths);
        file.put(&path(prefix, "obs"), &[n, obs], &self.obs);
        file.put(&path(prefix, "z"), &[n, latent], &self.z);
        file.put(&path(prefix, "next_obs"), &[n, obs], &self.next_obs);
        file.put(&path(prefix, "next_z"), &[n, latent], &self.next_z);
        if clock > 0 {
            file.put(&path(prefix, "left"), &[n], &self.left);
            file.put(&path(prefix, "next_left"), &[n], &self.next_left);
        }
        if weight > 0 {
            file.put(&path(prefix, "weights"), &[n], &self.weights);
        }
        match &self.actions {
            Actions::Discrete(values) => file.put_u32(&path(prefix, "actions"), values),
            Actions::Continuous { dim, values } => file.put(&path(prefix, "actions"), &[n, *dim], values),
        }
        file.put(&path(prefix, "rewards"), &[n], &self.rewards);
        file.put_flags(&path(prefix, "terminated"), &self.terminated);
        file.put_flags(&path(prefix, "truncated"), &self.truncated);
    }

    /// Takes all transitions out of a file, of which `seen` were ever added.
    pub(super) fn take(&mut self, file: &mut TensorFile, prefix: &str, seen: u64) -> Result<(), FileError> {
        self.seen = seen;
        let (n, Widths { obs, latent, clock, weight }) = (self.len(), self.widths);
        self.obs = file.take(&path(prefix, "obs"), &[n, obs])?;
        self.z = file.take(&path(prefix, "z"), &[n, latent])?;
        self.next_obs = file.take(&path(prefix, "next_obs"), &[n, obs])?;
        self.next_z = file.take(&path(prefix, "next_z"), &[n, latent])?;
        if clock > 0 {
            self.left = file.take(&path(prefix, "left"), &[n])?;
            self.next_left = file.take(&path(prefix, "next_left"), &[n])?;
        }
        let weights = path(prefix, "weights");
        self.weights = match weight {
            0 => Vec::new(),
            // The first checkpoints of SPiRL discounted all skills alike.
            _ if !file.has(&weights) => vec![1.0; n],
            _ => file.take(&weights, &[n])?,
        };
        match &mut self.actions {
            Actions::Discrete(values) => *values = file.take_u32(&path(prefix, "actions"), n)?,
            Actions::Continuous { dim, values } => *values = file.take(&path(prefix, "actions"), &[n, *dim])?,
        }
        self.rewards = file.take(&path(prefix, "rewards"), &[n])?;
        self.terminated = file.take_flags(&path(prefix, "terminated"), n)?;
        self.truncated = file.take_flags(&path(prefix, "truncated"), n)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::transitions::tests::rollout;
    use super::*;
    use crate::ActionSpace;
    use crate::file::FileKind;
    use std::path::Path;

    #[test]
    fn files_from_before_there_were_weights_hold_transitions_that_all_count_alike() {
        let plain_widths = Widths { obs: 1, latent: 1, ..Widths::default() };
        let actions = ActionSpace::Discrete(3);
        let mut plain = ReplayBuffer::new(6, plain_widths, &actions);
        plain.push(&rollout(), &[]).expect("it fits");
        let kind = FileKind { name: "buffer", version: 1 };
        let mut file = TensorFile::new(Path::new("buffer"), kind, &serde_json::json!({})).expect("a header");
        plain.put(&mut file, "old");
        let mut loaded = ReplayBuffer::new(6, Widths { weight: 1, ..plain_widths }, &actions);
        loaded.take(&mut file, "old", plain.seen).expect("read");
        assert_eq!((loaded.weights.as_slice(), &loaded.obs), (&[1.0; 6][..], &plain.obs));
    }
}
