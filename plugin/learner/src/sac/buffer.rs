//! The replay buffer.

use super::transitions::{slice, transitions};
use crate::file::TensorFile;
use crate::nn::path;
use crate::rng::below;
use crate::{ActionSpace, Actions, FileError, LearnError, Rollout, TimeLimit};
use rand::Rng;

/// The newest transitions, raw as they were played: a ring of `capacity` slots in flat memory, which grows as it fills.
///
/// Normalisation happens when transitions are read, so that old ones are seen with the present statistics.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReplayBuffer {
    capacity: usize,
    pub(super) obs_dim: usize,
    pub(super) latent: usize,
    /// Transitions taken in so far, kept or not.
    pub(super) seen: u64,
    pub(super) obs: Vec<f32>,
    pub(super) z: Vec<f32>,
    pub(super) next_obs: Vec<f32>,
    pub(super) next_z: Vec<f32>,
    pub(super) actions: Actions,
    pub(super) rewards: Vec<f32>,
    terminated: Vec<bool>,
    truncated: Vec<bool>,
}

impl ReplayBuffer {
    /// Empty, for rollouts whose skills are `latent` wide.
    pub(super) fn new(capacity: usize, obs_dim: usize, latent: usize, space: &ActionSpace) -> Self {
        Self {
            capacity,
            obs_dim,
            latent,
            seen: 0,
            obs: Vec::new(),
            z: Vec::new(),
            next_obs: Vec::new(),
            next_z: Vec::new(),
            actions: Actions::empty(space),
            rewards: Vec::new(),
            terminated: Vec::new(),
            truncated: Vec::new(),
        }
    }

    /// Transitions in it.
    pub(super) fn len(&self) -> usize {
        self.seen.min(self.capacity as u64) as usize
    }

    /// Takes in all transitions of a checked rollout, in order; the oldest give way. The next state after a
    /// termination is stored as zeros.
    pub(super) fn push(&mut self, rollout: &Rollout) -> Result<(), LearnError> {
        let (no_obs, no_z) = (vec![0.0; self.obs_dim], vec![0.0; self.latent]);
        let obs = rollout.obs.as_slice().vectors("SAC")?;
        for transition in transitions(rollout)? {
            let (row, at) = (transition.row, (self.seen % self.capacity as u64) as usize);
            write(&mut self.obs, at, slice(obs, self.obs_dim, row));
            write(&mut self.z, at, slice(&rollout.z, self.latent, row));
            write(&mut self.next_obs, at, transition.next_obs.unwrap_or(&no_obs));
            write(&mut self.next_z, at, transition.next_z.unwrap_or(&no_z));
            self.actions.write(at, &rollout.actions, row)?;
            write(&mut self.rewards, at, &[rollout.rewards[row]]);
            write(&mut self.terminated, at, &[rollout.terminated[row]]);
            write(&mut self.truncated, at, &[rollout.truncated[row]]);
            self.seen += 1;
        }
        Ok(())
    }

    /// `n` slots, each drawn from all that are filled. There must be one.
    pub(super) fn draw<R: Rng + ?Sized>(&self, n: usize, rng: &mut R) -> Vec<usize> {
        let len = self.len() as u64;
        (0..n).map(|_| below(rng, len) as usize).collect()
    }

    /// Copies of the transitions in these slots, in their order, and behind them of those in some slots of `more`.
    ///
    /// # Errors
    /// [`LearnError::Action`] if the two act in different kinds of spaces.
    pub(super) fn picked(&self, slots: &[usize], more: Option<(&Self, &[usize])>) -> Result<Self, LearnError> {
        let n = slots.len() + more.map_or(0, |(_, slots)| slots.len());
        let mut all = Self { capacity: n, seen: n as u64, actions: self.actions.gather(slots), ..self.emptied() };
        let parts = [Some((self, slots)), more];
        for (from, slots) in parts.iter().flatten() {
            for &slot in *slots {
                all.obs.extend_from_slice(slice(&from.obs, self.obs_dim, slot));
                all.z.extend_from_slice(slice(&from.z, self.latent, slot));
                all.next_obs.extend_from_slice(slice(&from.next_obs, self.obs_dim, slot));
                all.next_z.extend_from_slice(slice(&from.next_z, self.latent, slot));
                all.rewards.push(from.rewards[slot]);
                all.terminated.push(from.terminated[slot]);
                all.truncated.push(from.truncated[slot]);
            }
        }
        if let Some((from, slots)) = more {
            all.actions.extend_rows(&from.actions.gather(slots), 0, slots.len())?;
        }
        Ok(all)
    }

    /// A buffer without transitions, of the same widths.
    fn emptied(&self) -> Self {
        Self {
            capacity: self.capacity,
            obs_dim: self.obs_dim,
            latent: self.latent,
            seen: 0,
            obs: Vec::new(),
            z: Vec::new(),
            next_obs: Vec::new(),
            next_z: Vec::new(),
            actions: self.actions.gather(&[]),
            rewards: Vec::new(),
            terminated: Vec::new(),
            truncated: Vec::new(),
        }
    }

    /// 1 if the value of the slot's next state counts, 0 if the episode was over: after a termination, and by
    /// [`TimeLimit::Legacy`] after a truncation too.
    pub(super) fn continues(&self, slot: usize, limit: TimeLimit) -> f32 {
        let over = self.terminated[slot] || (self.truncated[slot] && limit == TimeLimit::Legacy);
        if over { 0.0 } else { 1.0 }
    }

    /// Adds all transitions to a file, under names that begin with `prefix`.
    pub(super) fn put(&self, file: &mut TensorFile, prefix: &str) {
        let n = self.len();
        file.put(&path(prefix, "obs"), &[n, self.obs_dim], &self.obs);
        file.put(&path(prefix, "z"), &[n, self.latent], &self.z);
        file.put(&path(prefix, "next_obs"), &[n, self.obs_dim], &self.next_obs);
        file.put(&path(prefix, "next_z"), &[n, self.latent], &self.next_z);
        match &self.actions {
            Actions::Discrete(values) => file.put_u32(&path(prefix, "actions"), values),
            Actions::Continuous { dim, values } => file.put(&path(prefix, "actions"), &[n, *dim], values),
        }
        file.put(&path(prefix, "rewards"), &[n], &self.rewards);
        file.put_flags(&path(prefix, "terminated"), &self.terminated);
        file.put_flags(&path(prefix, "truncated"), &self.truncated);
    }

    /// Takes all transitions out of a file, of which `seen` were ever taken in.
    pub(super) fn take(&mut self, file: &mut TensorFile, prefix: &str, seen: u64) -> Result<(), FileError> {
        self.seen = seen;
        let n = self.len();
        self.obs = file.take(&path(prefix, "obs"), &[n, self.obs_dim])?;
        self.z = file.take(&path(prefix, "z"), &[n, self.latent])?;
        self.next_obs = file.take(&path(prefix, "next_obs"), &[n, self.obs_dim])?;
        self.next_z = file.take(&path(prefix, "next_z"), &[n, self.latent])?;
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

/// Puts `from` in slot `at` of `to`, or behind its end if that is where the slot lies.
fn write<T: Copy>(to: &mut Vec<T>, at: usize, from: &[T]) {
    let start = at * from.len();
    if start == to.len() {
        to.extend_from_slice(from);
    } else {
        to[start..start + from.len()].copy_from_slice(from);
    }
}

#[cfg(test)]
mod tests {
    use super::super::transitions::tests::rollout;
    use super::*;
    use crate::ActionSpace;
    use crate::rng::Streams;

    fn filled(capacity: usize) -> ReplayBuffer {
        let mut buffer = ReplayBuffer::new(capacity, 1, 1, &ActionSpace::Discrete(3));
        buffer.push(&rollout()).expect("it fits");
        buffer
    }

    #[test]
    fn the_oldest_give_way() {
        let buffer = filled(4);
        assert_eq!((buffer.seen, buffer.len()), (6, 4));
        assert_eq!(buffer.obs, [4.0, 5.0, 2.0, 3.0]);
        assert_eq!(buffer.next_obs, [70.0, 71.0, 4.0, 0.0]);
        assert_eq!(buffer.next_z, [80.0, 81.0, 14.0, 0.0]);
        assert_eq!(buffer.actions, Actions::Discrete(vec![1, 2, 2, 0]));
        assert_eq!(buffer.rewards, [24.0, 25.0, 22.0, 23.0]);
    }

    #[test]
    fn only_filled_slots_are_drawn_and_all_of_them() {
        let buffer = filled(100);
        let mut counts = [0; 6];
        for slot in buffer.draw(6000, &mut Streams::new(1).stream("draw", 0)) {
            counts[slot] += 1;
        }
        assert!(counts.iter().all(|n| (850..1150).contains(n)), "{counts:?}");
    }

    #[test]
    fn time_limits_end_nothing_unless_asked_to() {
        let buffer = filled(6);
        let flags = |limit| (0..6).map(|slot| buffer.continues(slot, limit)).collect::<Vec<f32>>();
        assert_eq!(flags(TimeLimit::Bootstrap), [1.0, 1.0, 1.0, 0.0, 1.0, 1.0]);
        assert_eq!(flags(TimeLimit::Legacy), [0.0, 1.0, 1.0, 0.0, 1.0, 1.0]);
    }
}
