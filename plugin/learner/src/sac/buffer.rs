//! The replay buffer.

use crate::{
    ActionSpace, Actions, FileError, LearnError, Observations, PolicySpec, Rollout, TimeLimit, file::TensorFile,
    nn::path, rng::below, sac::SacConfig,
};
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
    /// Number of discrete actions if masks are kept, else 0. It is set by the first rollout with a mask.
    pub(super) legal: usize,
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
    /// Masks of the actions, in the states and in the next states.
    pub(super) legal: Vec<bool>,
    pub(super) next_legal: Vec<bool>,
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
            legal: Vec::new(),
            next_legal: Vec::new(),
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
    /// [`LearnError::Config`] if the observations are images, [`LearnError::Shape`] as [`Self::check_clock`] or for
    /// another number of weights.
    pub(super) fn push(&mut self, rollout: &Rollout, weights: &[f32]) -> Result<(), LearnError> {
        self.keep_masks_of(rollout);
        let Widths { obs: obs_dim, latent, clock, weight, legal } = self.widths;
        let all_legal = vec![true; legal];
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
            write(&mut self.legal, at, mask_of(&rollout.legal, row, &all_legal));
            write(&mut self.next_legal, at, transition.next_legal.unwrap_or(&all_legal));
            self.actions.write(at, &rollout.actions, row)?;
            write(&mut self.rewards, at, &[rollout.rewards[row]]);
            write(&mut self.terminated, at, &[rollout.terminated[row]]);
            write(&mut self.truncated, at, &[rollout.truncated[row]]);
            self.seen += 1;
        }
        Ok(())
    }

    /// Makes room for masks at the first rollout that has some. Everything was legal before.
    fn keep_masks_of(&mut self, rollout: &Rollout) {
        if self.widths.legal == 0 && !rollout.legal.is_empty() {
            self.widths.legal = rollout.choices();
            let mask = vec![true; self.len() * self.widths.legal];
            (self.legal, self.next_legal) = (mask.clone(), mask);
        }
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
        // One of the two may have masks alone.
        let legal = more.map_or(0, |(from, _)| from.widths.legal).max(self.widths.legal);
        let widths = Widths { legal, ..self.widths };
        let mut all = Self { seen: n as u64, ..Self::empty(n, widths, self.actions.gather(slots)) };
        let Widths { obs, latent, clock, weight, legal } = widths;
        let all_legal = vec![true; legal];
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
                all.legal.extend_from_slice(mask_of(&from.legal, slot, &all_legal));
                all.next_legal.extend_from_slice(mask_of(&from.next_legal, slot, &all_legal));
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

/// Returns the mask of a row, or `all_legal` without masks.
fn mask_of<'a>(masks: &'a [bool], row: usize, all_legal: &'a [bool]) -> &'a [bool] {
    let width = all_legal.len();
    masks.get(row * width..(row + 1) * width).unwrap_or(all_legal)
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

// The replay buffer in the file of a checkpoint.

impl ReplayBuffer {
    /// Adds all transitions to a file, under names that begin with `prefix`.
    pub(super) fn put(&self, file: &mut TensorFile, prefix: &str) {
        let (n, Widths { obs, latent, clock, weight, legal }) = (self.len(), self.widths);
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
        if legal > 0 {
            file.put_flags(&path(prefix, "legal"), &self.legal);
            file.put_flags(&path(prefix, "next_legal"), &self.next_legal);
        }
        match &self.actions {
            Actions::Discrete(values) => file.put_u32(&path(prefix, "actions"), values),
            Actions::Continuous { dim, values } => file.put(&path(prefix, "actions"), &[n, *dim], values),
            // `SacConfig::check_space` refuses them.
            Actions::Mixed { .. } => {}
        }
        file.put(&path(prefix, "rewards"), &[n], &self.rewards);
        file.put_flags(&path(prefix, "terminated"), &self.terminated);
        file.put_flags(&path(prefix, "truncated"), &self.truncated);
    }

    /// Takes all transitions out of a file, of which `seen` were ever added.
    pub(super) fn take(
        &mut self,
        file: &mut TensorFile,
        prefix: &str,
        seen: u64,
        space: &ActionSpace,
    ) -> Result<(), FileError> {
        self.seen = seen;
        let (n, Widths { obs, latent, clock, weight, .. }) = (self.len(), self.widths);
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
        if let (true, ActionSpace::Discrete(choices)) = (file.has(&path(prefix, "legal")), space) {
            self.widths.legal = *choices;
            self.legal = file.take_flags(&path(prefix, "legal"), n * choices)?;
            self.next_legal = file.take_flags(&path(prefix, "next_legal"), n * choices)?;
        }
        match &mut self.actions {
            Actions::Discrete(values) => *values = file.take_u32(&path(prefix, "actions"), n)?,
            Actions::Continuous { dim, values } => *values = file.take(&path(prefix, "actions"), &[n, *dim])?,
            Actions::Mixed { .. } => {}
        }
        self.rewards = file.take(&path(prefix, "rewards"), &[n])?;
        self.terminated = file.take_flags(&path(prefix, "terminated"), n)?;
        self.truncated = file.take_flags(&path(prefix, "truncated"), n)?;
        Ok(())
    }
}

// Conversion of rollouts to transitions.

/// One step of one environment: row `row` of a rollout and its next state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Transition<'a> {
    /// The rollout's row, for everything but the next state.
    pub(super) row: usize,
    /// The observation after the action; `None` after a termination, where there is none.
    pub(super) next_obs: Option<&'a [f32]>,
    /// The skill under which that observation is valued; `None` likewise.
    pub(super) next_z: Option<&'a [f32]>,
    /// The remaining share of that skill's ticks; `None` likewise, and if the rollout does not have it.
    pub(super) next_left: Option<f32>,
    /// The mask in that state; `None` likewise, and if the rollout does not have it.
    pub(super) next_legal: Option<&'a [bool]>,
}

/// Checks that no numbers are held from an earlier tick: a critic would have to know how long they still are.
///
/// # Errors
/// [`LearnError::Action`] otherwise.
pub(crate) fn check_free(rollout: &Rollout, space: &ActionSpace) -> Result<(), LearnError> {
    if rollout.legal.is_empty() || space.numbers() == 0 {
        return Ok(());
    }
    let text = "sac cannot learn numbers that the game holds for several ticks: let the agent decide in each tick, or \
                learn with ppo";
    Err(LearnError::Action(text.to_owned()))
}

/// Checks that a checked rollout holds the states where episodes were cut off and where it stops.
///
/// # Errors
/// [`LearnError::Shape`] names the first length that does not fit; [`LearnError::Config`] names a row.
pub(crate) fn check_ends(rollout: &Rollout) -> Result<(), LearnError> {
    let ends = &rollout.ends;
    let mut listed = ends.cut_rows.iter().copied();
    for row in (0..rollout.rows()).filter(|&row| is_cut(rollout, row)) {
        if listed.next() != Some(row) {
            let text = format!("rollout ends: row {row} cuts an episode off, but its last observation is missing");
            return Err(LearnError::Config(text));
        }
    }
    if let Some(row) = listed.next() {
        return Err(LearnError::Config(format!("rollout ends: row {row} is listed but cuts no episode off")));
    }
    ends.next_obs.as_slice().check_size("rollout ends next_obs", &rollout.obs_kind, rollout.envs)?;
    LearnError::check("rollout ends next_z", rollout.envs * rollout.latent, ends.next_z.len())
}

/// Returns the transitions of a checked rollout, in order of its rows.
///
/// The next state is the same environment's next row. Where the episode was cut off it is the episode's own last
/// state, and behind the last row the state where the rollout stopped. A row with both flags terminated.
///
/// # Errors
/// [`LearnError::Config`] if the observations are images.
pub(super) fn transitions<'a>(rollout: &'a Rollout) -> Result<impl Iterator<Item = Transition<'a>>, LearnError> {
    let ends = &rollout.ends;
    let width = rollout.obs_kind.numbers();
    let (obs, cut_obs, next_obs) = (vectors(&rollout.obs)?, vectors(&ends.cut_obs)?, vectors(&ends.next_obs)?);
    let mut cut = 0;
    Ok((0..rollout.rows()).map(move |row| {
        let choices = rollout.choices();
        let next = |obs, z, left: &[f32], legal: &'a [bool], at: usize| Transition {
            row,
            next_obs: Some(slice(obs, width, at)),
            next_z: Some(slice(z, rollout.latent, at)),
            next_left: left.get(at).copied(),
            next_legal: legal.get(at * choices..(at + 1) * choices).filter(|legal| !legal.is_empty()),
        };
        let following = row + rollout.envs;
        if rollout.terminated[row] {
            Transition { row, next_obs: None, next_z: None, next_left: None, next_legal: None }
        } else if is_cut(rollout, row) {
            cut += 1;
            next(cut_obs, &ends.cut_z, &ends.cut_left, &ends.cut_legal, cut - 1)
        } else if following < rollout.rows() {
            next(obs, &rollout.z, &rollout.left, &rollout.legal, following)
        } else {
            next(next_obs, &ends.next_z, &ends.next_left, &ends.next_legal, following - rollout.rows())
        }
    }))
}

fn is_cut(rollout: &Rollout, row: usize) -> bool {
    rollout.truncated[row] && !rollout.terminated[row]
}

fn vectors(observations: &Observations) -> Result<&[f32], LearnError> {
    observations.as_slice().vectors("SAC")
}

/// Returns row `at` of a flat matrix.
pub(super) fn slice(values: &[f32], width: usize, at: usize) -> &[f32] {
    &values[at * width..(at + 1) * width]
}

// Recordings in a replay buffer of their own.

/// Recorded transitions, and their share of each batch.
#[derive(Debug)]
pub(super) struct Demos {
    pub(super) buffer: ReplayBuffer,
    pub(super) share: f64,
}

impl Demos {
    /// Creates the buffer from all transitions of `episodes`, each a rollout of one environment. Actions are clamped
    /// to [-1, 1], as the actor's are.
    ///
    /// # Errors
    /// [`LearnError::Config`] if there is nothing to learn from; else as [`Rollout::check`].
    pub(super) fn new(
        episodes: &[Rollout],
        share: f64,
        obs_dim: usize,
        space: &ActionSpace,
    ) -> Result<Self, LearnError> {
        let rows: usize = episodes.iter().map(Rollout::rows).sum();
        if rows == 0 {
            return Err(LearnError::Config("the recordings hold no steps to learn from".to_owned()));
        }
        if !episodes.iter().any(Rollout::is_rewarded) {
            let text = "the recordings hold no reward, but this algorithm learns from rewards: learn skills from them \
                        instead";
            return Err(LearnError::Config(text.to_owned()));
        }
        let mut buffer = ReplayBuffer::new(rows, Widths { obs: obs_dim, ..Widths::default() }, space);
        for episode in episodes {
            buffer.push(episode, &[])?;
        }
        if let Actions::Continuous { values, .. } = &mut buffer.actions {
            values.iter_mut().for_each(|value| *value = value.clamp(-1.0, 1.0));
        }
        Ok(Self { buffer, share })
    }

    /// Reads the recordings of a checkpoint.
    ///
    /// # Errors
    /// [`FileError`] names the first tensor that is missing or misshapen.
    pub(super) fn stored(file: &mut TensorFile, rows: u64, share: f64, spec: &PolicySpec) -> Result<Self, FileError> {
        if rows == 0 || !(share > 0.0 && share < 1.0) {
            return Err(file.format(format!("a share of {share} of each batch from {rows} recorded steps")));
        }
        let widths = Widths { obs: spec.obs.numbers(), ..Widths::default() };
        let mut buffer = ReplayBuffer::new(rows as usize, widths, &spec.action_space);
        buffer.take(file, "demos", rows, &spec.action_space)?;
        spec.action_space.check(&buffer.actions).map_err(|error| file.learner(error))?;
        Ok(Self { buffer, share })
    }

    /// Returns the number of recorded transitions in a batch.
    pub(super) fn of_batch(&self, config: &SacConfig) -> usize {
        (self.share * config.batch as f64).round() as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ActionSpace;
    use crate::rng::Streams;
    use crate::sac::buffer::transitions_tests::rollout;

    const PLAIN: Widths = Widths { obs: 1, latent: 1, clock: 0, weight: 0, legal: 0 };

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
    fn what_is_kept_goes_into_batches_and_files() {
        let buffer = filled(6);
        let picked = buffer.picked(&[4, 0], None).expect("the same actions");
        assert_eq!([picked.left, picked.next_left, picked.weights], [[0.5, 1.0], [1.0, 0.25], [0.5, 2.0]]);
        let silent = Rollout { left: Vec::new(), ..rollout() };
        let mut plain = new(6, PLAIN);
        plain.push(&silent, &[]).expect("nothing is missed");
        assert_eq!((plain.left.len(), plain.next_left.len(), plain.continues(0, TimeLimit::Bootstrap)), (0, 0, 1.0));
        let error = new(6, Widths { clock: 1, ..PLAIN }).push(&silent, &[]).expect_err("it has no share");
        assert!(error.to_string().contains("rollout left"), "{error}");
        let error = new(6, Widths { weight: 1, ..PLAIN }).push(&silent, &[]).expect_err("no weights");
        assert!(error.to_string().contains("weights"), "{error}");
    }

    /// Returns the rollout with a mask that forbids action 0 in state 4, and action 1 where it was cut off.
    fn masked() -> Rollout {
        let mut rollout = rollout();
        rollout.legal = vec![true; 18];
        rollout.legal[12] = false;
        rollout.ends.cut_legal = vec![true, false, true];
        rollout.ends.next_legal = vec![true; 6];
        rollout
    }

    #[test]
    fn masks_of_states_and_next_states_are_kept_from_the_first_one_on() {
        let mut buffer = new(100, PLAIN);
        buffer.push(&rollout(), &[]).expect("it fits");
        assert!(buffer.legal.is_empty());
        buffer.push(&masked(), &[]).expect("it fits");
        buffer.push(&rollout(), &[]).expect("it fits");
        let forbidden = |mask: &[bool]| {
            let places = mask.iter().enumerate().filter(|(_, is_legal)| !**is_legal);
            places.map(|(at, _)| at).collect::<Vec<_>>()
        };
        assert_eq!((buffer.legal.len(), buffer.next_legal.len()), (54, 54));
        // Row 4 of the second rollout is state 4, to which row 2 leads; row 0 was cut off.
        assert_eq!(forbidden(&buffer.legal), [(6 + 4) * 3]);
        assert_eq!(forbidden(&buffer.next_legal), [6 * 3 + 1, (6 + 2) * 3]);
        let picked = buffer.picked(&[10, 0], None).expect("the same actions");
        assert_eq!(picked.legal, [false, true, true, true, true, true]);
        let mut plain = new(6, PLAIN);
        plain.push(&rollout(), &[]).expect("it fits");
        let joined = plain.picked(&[1], Some((&buffer, &[10]))).expect("the same actions");
        assert_eq!((joined.legal, joined.widths.legal), (vec![true, true, true, false, true, true], 3));
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

#[cfg(test)]
mod buffer_file_tests {
    use super::*;
    use crate::ActionSpace;
    use crate::file::FileKind;
    use crate::sac::buffer::transitions_tests::rollout;
    use std::path::Path;

    #[test]
    fn masks_go_into_files_and_come_back() {
        let (widths, actions) = (Widths { obs: 1, latent: 1, ..Widths::default() }, ActionSpace::Discrete(3));
        let mut masked = ReplayBuffer::new(6, widths, &actions);
        let mut played = rollout();
        played.legal = (0..18).map(|at| at % 4 != 1).collect();
        masked.push(&played, &[]).expect("it fits");
        let kind = FileKind { name: "buffer", version: 1 };
        let mut file = TensorFile::new(Path::new("buffer"), kind, &serde_json::json!({})).expect("a header");
        masked.put(&mut file, "new");
        let mut loaded = ReplayBuffer::new(6, widths, &actions);
        loaded.take(&mut file, "new", masked.seen, &actions).expect("read");
        assert_eq!(loaded, masked);
    }

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
        loaded.take(&mut file, "old", plain.seen, &actions).expect("read");
        assert_eq!((loaded.weights.as_slice(), &loaded.obs), (&[1.0; 6][..], &plain.obs));
    }
}

#[cfg(test)]
pub(super) mod transitions_tests {
    use super::*;
    use crate::{ActionSpace, Actions, EndStates, ObsKind};

    /// Returns a rollout of two environments, three steps, observations 0 to 5 and skills 10 to 15. Environment 0 is
    /// cut off at step 0 (its last observation is 50), environment 1 terminates at step 1 with both flags set.
    pub(in crate::sac) fn rollout() -> Rollout {
        let numbers = |base: f32| (0..6u8).map(|i| base + f32::from(i)).collect::<Vec<f32>>();
        let at = |rows: &[usize]| (0..6).map(|row| rows.contains(&row)).collect::<Vec<bool>>();
        Rollout {
            steps: 3,
            obs: numbers(0.0).into(),
            z: numbers(10.0),
            actions: Actions::Discrete(vec![0, 1, 2, 0, 1, 2]),
            log_probs: vec![0.0; 6],
            values: vec![0.0; 6],
            rewards: numbers(20.0),
            terminated: at(&[3]),
            truncated: at(&[0, 3]),
            final_values: vec![0.0; 6],
            next_values: vec![0.0; 2],
            left: vec![1.0, 0.5, 1.0, 1.0, 0.5, 0.5],
            ends: EndStates {
                cut_left: vec![0.25],
                next_left: vec![1.0, 0.75],
                cut_rows: vec![0],
                cut_obs: vec![50.0].into(),
                cut_z: vec![60.0],
                next_obs: vec![70.0, 71.0].into(),
                next_z: vec![80.0, 81.0],
                ..EndStates::new(&ObsKind::Vector(1))
            },
            ..Rollout::new(2, 1, 1, &ActionSpace::Discrete(3))
        }
    }

    #[test]
    fn every_row_leads_to_its_own_next_state() {
        let rollout = rollout();
        rollout.check().expect("it fits");
        check_ends(&rollout).expect("it fits");
        let next: Vec<_> = transitions(&rollout)
            .expect("vectors")
            .map(|t| t.next_obs.zip(t.next_z).zip(t.next_left).map(|((obs, z), left)| (obs[0], z[0], left)))
            .collect();
        let expected = [
            Some((50.0, 60.0, 0.25)), // cut off: not the row below, which belongs to the next episode
            Some((3.0, 13.0, 1.0)),
            Some((4.0, 14.0, 0.5)),
            None, // terminated, though also cut off
            Some((70.0, 80.0, 1.0)),
            Some((71.0, 81.0, 0.75)),
        ];
        assert_eq!(next, expected);
        assert!(transitions(&rollout).expect("vectors").map(|t| t.row).eq(0..6));
    }

    #[test]
    fn ends_that_do_not_fit_are_named() {
        let after = |change: fn(&mut Rollout)| {
            let mut rollout = rollout();
            change(&mut rollout);
            rollout.check().and_then(|()| check_ends(&rollout)).expect_err("does not fit").to_string()
        };
        assert!(after(|r| r.ends = EndStates::new(&r.obs_kind)).contains("row 0"));
        assert!(
            after(|r| {
                r.ends.cut_rows.push(3);
                r.ends.cut_obs.push(&[0.0]).expect("vectors");
                r.ends.cut_z.push(0.0);
                r.ends.cut_left.push(0.0);
            })
            .contains("row 3")
        );
        assert!(after(|r| r.truncated[4] = true).contains("row 4"));
        assert!(after(|r| r.ends.cut_obs.clear()).contains("cut_obs"));
        assert!(after(|r| r.ends.next_z.clear()).contains("next_z"));
    }
}

#[cfg(test)]
pub(super) mod demos_tests {
    use super::*;
    use crate::sac::{RlpdConfig, SacLearner};
    use crate::{DeviceKind, EndStates, ObsKind};

    pub const SPEC: PolicySpec =
        PolicySpec { obs: ObsKind::Vector(1), latent: 0, action_space: ActionSpace::Discrete(2) };

    /// Returns episodes of this many environments, with observations `sign` times 1, 2, 3, ..., which end together.
    pub fn episodes(envs: usize, sign: f32, action: u32, rewards: &[f32]) -> Rollout {
        let rows = rewards.len();
        let zeros = || vec![0.0; rows];
        Rollout {
            steps: rows / envs,
            obs: (1..=rows).map(|row| sign * row as f32).collect::<Vec<f32>>().into(),
            actions: Actions::Discrete(vec![action; rows]),
            log_probs: zeros(),
            values: zeros(),
            final_values: zeros(),
            rewards: rewards.to_vec(),
            terminated: (0..rows).map(|row| row >= rows - envs).collect(),
            truncated: vec![false; rows],
            next_values: vec![0.0; envs],
            ends: EndStates { next_obs: vec![0.0; envs].into(), ..EndStates::new(&SPEC.obs) },
            ..Rollout::new(envs, SPEC.obs, 0, &SPEC.action_space)
        }
    }

    /// Returns a learner that only observes, with these recordings.
    fn looking_on(config: SacConfig, demo_share: f64, demos: &[Rollout]) -> SacLearner {
        let config = SacConfig { hidden: vec![4], learning_starts: 1000, ..config };
        let rlpd = RlpdConfig { demo_share, critics: 2, ..RlpdConfig::default() };
        SacLearner::with_demos(config, &rlpd, demos, SPEC, 1, DeviceKind::Flex).expect("good settings")
    }

    #[test]
    fn the_share_of_each_batch_is_recorded() {
        for (share, batch, expected) in [(0.5, 64, 32), (0.25, 64, 16), (0.5, 7, 4)] {
            let demos = [episodes(1, 1.0, 1, &[5.0; 4]), episodes(1, 1.0, 1, &[5.0; 6])];
            let mut learner = looking_on(SacConfig { batch, ..SacConfig::default() }, share, &demos);
            learner.update(&episodes(2, -1.0, 0, &[0.0; 8])).expect("finite");
            let mut seen: Vec<f32> = Vec::new();
            for number in 0..60 {
                let drawn = learner.draw(number).expect("played and recorded");
                let Actions::Discrete(actions) = &drawn.actions else { panic!("choices") };
                let recorded = |row: &usize| drawn.obs[*row] > 0.0;
                assert_eq!((drawn.len(), (0..batch).filter(recorded).count()), (batch, expected));
                // Observation, action and reward belong together.
                for (row, paid) in actions.iter().zip(&drawn.rewards).enumerate() {
                    let whole = if recorded(&row) { (&1, &5.0) } else { (&0, &0.0) };
                    assert_eq!(paid, whole);
                }
                seen.extend_from_slice(&drawn.obs);
            }
            seen.sort_by(f32::total_cmp);
            seen.dedup();
            let all: Vec<f32> = (-8..=6).filter(|&number| number != 0).map(|number| number as f32).collect();
            assert_eq!(seen, all, "every step is drawn some time");
        }
    }

    #[test]
    fn recorded_rewards_have_their_scale_from_the_start_and_keep_it() {
        let paid = episodes(1, 1.0, 1, &[0.0, 0.0, 0.0, 1.0]);
        let config = SacConfig { norm_reward: true, gamma: 0.5, ..SacConfig::default() };
        let mut learner = looking_on(config, 0.5, &[paid.clone(), paid]);
        let scaled = |learner: &SacLearner| learner.base.rewards.as_ref().expect("normalised").scale(1.0);
        // Six returns of 0 and two of 1 have the variance 3/16.
        assert!((scaled(&learner) - (16.0f32 / 3.0).sqrt()).abs() < 1e-3, "{}", scaled(&learner));
        learner.update(&episodes(2, -1.0, 0, &[0.0; 8])).expect("another number of environments");
        // Fourteen of 0 and two of 1: 7/64.
        assert!((scaled(&learner) - (64.0f32 / 7.0).sqrt()).abs() < 1e-3, "{}", scaled(&learner));
    }
}
