//! The replay buffer.

use super::transitions::{slice, transitions};
use crate::rng::below;
use crate::{ActionSpace, Actions, LearnError, Rollout, TimeLimit};
use rand::Rng;

/// Number of values of each kind in a transition.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Widths {
    /// Width of an observation.
    pub(super) obs: usize,
    /// Width of a skill.
    pub(super) latent: usize,
    /// 1 if the remaining share of a skill's ticks is kept, else 0.
    pub(super) clock: usize,
    /// 1 if the value of the next state has a weight of its own, else 0.
    pub(super) weight: usize,
}

/// The newest transitions, raw: a ring of `capacity` slots in flat memory, which grows as it fills.
///
/// Normalisation happens when transitions are read, so that old ones are seen with the present statistics.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ReplayBuffer {
    capacity: usize,
    pub(super) widths: Widths,
    /// Transitions added so far, kept or not.
    pub(super) seen: u64,
    pub(super) obs: Vec<f32>,
    pub(super) z: Vec<f32>,
    pub(super) next_obs: Vec<f32>,
    pub(super) next_z: Vec<f32>,
    /// Remaining shares of the skills' ticks, in the states and in the next states.
    pub(super) left: Vec<f32>,
    pub(super) next_left: Vec<f32>,
    /// Weights of the next states' values, beside the discount: not 1 for a skill that was cut off early.
    pub(super) weights: Vec<f32>,
    pub(super) actions: Actions,
    pub(super) rewards: Vec<f32>,
    pub(super) terminated: Vec<bool>,
    pub(super) truncated: Vec<bool>,
}

impl ReplayBuffer {
    /// Creates an empty buffer.
    pub(super) fn new(capacity: usize, widths: Widths, space: &ActionSpace) -> Self {
        Self::empty(capacity, widths, Actions::empty(space))
    }

    fn empty(capacity: usize, widths: Widths, actions: Actions) -> Self {
        Self {
            capacity,
            widths,
            seen: 0,
            obs: Vec::new(),
            z: Vec::new(),
            next_obs: Vec::new(),
            next_z: Vec::new(),
            left: Vec::new(),
            next_left: Vec::new(),
            weights: Vec::new(),
            actions,
            rewards: Vec::new(),
            terminated: Vec::new(),
            truncated: Vec::new(),
        }
    }

    /// Transitions in it.
    pub(super) fn len(&self) -> usize {
        self.seen.min(self.capacity as u64) as usize
    }

    /// Checks that a rollout has the remaining shares of the skills, if they are kept.
    ///
    /// # Errors
    /// [`LearnError::Shape`] names the missing part.
    pub(super) fn check_clock(&self, rollout: &Rollout) -> Result<(), LearnError> {
        if self.widths.clock == 0 {
            return Ok(());
        }
        let ends = &rollout.ends;
        LearnError::check("rollout left", rollout.rows(), rollout.left.len())?;
        LearnError::check("rollout ends cut_left", ends.cut_rows.len(), ends.cut_left.len())?;
        LearnError::check("rollout ends next_left", rollout.envs, ends.next_left.len())
    }

    /// Adds all transitions of a checked rollout, in order, and replaces the oldest. The next state after a
    /// termination is stored as zeros. `weights` has one entry per row if the buffer keeps them, else none.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observations are images, [`LearnError::Shape`] as [`Self::check_clock`] or for another number
    /// of weights.
    pub(super) fn push(&mut self, rollout: &Rollout, weights: &[f32]) -> Result<(), LearnError> {
        let Widths { obs: obs_dim, latent, clock, weight } = self.widths;
        let (no_obs, no_z) = (vec![0.0; obs_dim], vec![0.0; latent]);
        let obs = rollout.obs.as_slice().vectors("SAC")?;
        self.check_clock(rollout)?;
        LearnError::check("weights of transitions", rollout.rows() * weight, weights.len())?;
        for transition in transitions(rollout)? {
            let (row, at) = (transition.row, (self.seen % self.capacity as u64) as usize);
            write(&mut self.obs, at, slice(obs, obs_dim, row));
            write(&mut self.z, at, slice(&rollout.z, latent, row));
            write(&mut self.next_obs, at, transition.next_obs.unwrap_or(&no_obs));
            write(&mut self.next_z, at, transition.next_z.unwrap_or(&no_z));
            write(&mut self.left, at, slice(&rollout.left, clock, row));
            write(&mut self.next_left, at, &[transition.next_left.unwrap_or_default()][..clock]);
            write(&mut self.weights, at, slice(weights, weight, row));
            self.actions.write(at, &rollout.actions, row)?;
            write(&mut self.rewards, at, &[rollout.rewards[row]]);
            write(&mut self.terminated, at, &[rollout.terminated[row]]);
            write(&mut self.truncated, at, &[rollout.truncated[row]]);
            self.seen += 1;
        }
        Ok(())
    }

    /// Draws `n` slots uniformly from all that are filled. At least one must be.
    pub(super) fn draw<R: Rng + ?Sized>(&self, n: usize, rng: &mut R) -> Vec<usize> {
        let len = self.len() as u64;
        (0..n).map(|_| below(rng, len) as usize).collect()
    }

    /// Returns copies of the transitions in these slots, in order, and behind them of those in some slots of `more`.
    ///
    /// # Errors
    /// [`LearnError::Action`] if the two act in different kinds of spaces.
    pub(super) fn picked(&self, slots: &[usize], more: Option<(&Self, &[usize])>) -> Result<Self, LearnError> {
        let n = slots.len() + more.map_or(0, |(_, slots)| slots.len());
        let mut all = Self { seen: n as u64, ..Self::empty(n, self.widths, self.actions.gather(slots)) };
        let Widths { obs, latent, clock, weight } = self.widths;
        let parts = [Some((self, slots)), more];
        for (from, slots) in parts.iter().flatten() {
            for &slot in *slots {
                all.obs.extend_from_slice(slice(&from.obs, obs, slot));
                all.z.extend_from_slice(slice(&from.z, latent, slot));
                all.next_obs.extend_from_slice(slice(&from.next_obs, obs, slot));
                all.next_z.extend_from_slice(slice(&from.next_z, latent, slot));
                all.left.extend_from_slice(slice(&from.left, clock, slot));
                all.next_left.extend_from_slice(slice(&from.next_left, clock, slot));
                all.weights.extend_from_slice(slice(&from.weights, weight, slot));
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

    /// Returns the weight of the value of the slot's next state beside the discount: 1, or its own weight. It is 0 if
    /// the episode was over: after a termination, and by [`TimeLimit::Legacy`] after a truncation too.
    pub(super) fn continues(&self, slot: usize, limit: TimeLimit) -> f32 {
        let over = self.terminated[slot] || (self.truncated[slot] && limit == TimeLimit::Legacy);
        if over { 0.0 } else { self.weights.get(slot).copied().unwrap_or(1.0) }
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

    const PLAIN: Widths = Widths { obs: 1, latent: 1, clock: 0, weight: 0 };

    fn new(capacity: usize, widths: Widths) -> ReplayBuffer {
        ReplayBuffer::new(capacity, widths, &ActionSpace::Discrete(3))
    }

    fn filled(capacity: usize) -> ReplayBuffer {
        let mut buffer = new(capacity, Widths { clock: 1, weight: 1, ..PLAIN });
        buffer.push(&rollout(), &[2.0, 1.0, 1.0, 1.0, 0.5, 1.0]).expect("it fits");
        buffer
    }

    #[test]
    fn the_oldest_give_way() {
        let buffer = filled(4);
        assert_eq!((buffer.seen, buffer.len()), (6, 4));
        assert_eq!(buffer.obs, [4.0, 5.0, 2.0, 3.0]);
        assert_eq!(buffer.next_obs, [70.0, 71.0, 4.0, 0.0]);
        assert_eq!(buffer.next_z, [80.0, 81.0, 14.0, 0.0]);
        assert_eq!(buffer.left, [0.5, 0.5, 1.0, 1.0]);
        assert_eq!(buffer.next_left, [1.0, 0.75, 0.5, 0.0]);
        assert_eq!(buffer.weights, [0.5, 1.0, 1.0, 1.0]);
        assert_eq!(buffer.actions, Actions::Discrete(vec![1, 2, 2, 0]));
        assert_eq!(buffer.rewards, [24.0, 25.0, 22.0, 23.0]);
    }

    #[test]
    fn what_is_kept_goes_into_batches_and_files_and_what_is_not_needs_no_rollout_to_tell() {
        let buffer = filled(6);
        let picked = buffer.picked(&[4, 0], None).expect("the same actions");
        assert_eq!([picked.left, picked.next_left, picked.weights], [[0.5, 1.0], [1.0, 0.25], [0.5, 2.0]]);
        let silent = Rollout { left: Vec::new(), ..rollout() };
        let mut plain = new(6, PLAIN);
        plain.push(&silent, &[]).expect("nothing is missed");
        assert_eq!((plain.left.len(), plain.next_left.len(), plain.continues(0, TimeLimit::Bootstrap)), (0, 0, 1.0));
        let error = new(6, Widths { clock: 1, ..PLAIN }).push(&silent, &[]).expect_err("it does not tell");
        assert!(error.to_string().contains("rollout left"), "{error}");
        let error = new(6, Widths { weight: 1, ..PLAIN }).push(&silent, &[]).expect_err("no weights");
        assert!(error.to_string().contains("weights"), "{error}");
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
        assert_eq!(flags(TimeLimit::Bootstrap), [2.0, 1.0, 1.0, 0.0, 0.5, 1.0]);
        assert_eq!(flags(TimeLimit::Legacy), [0.0, 1.0, 1.0, 0.0, 0.5, 1.0]);
    }
}
