//! Rollouts: the steps played since the last update.

#[cfg(test)]
mod tests;

use crate::{ActionSpace, Actions, LearnError, ObsKind, ObsSlice, Observations, Policy, PolicySpec, legal};

/// Steps of B environments over T ticks, flat and row-major: row `t * envs + b`.
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout {
    /// T.
    pub steps: usize,
    /// B.
    pub envs: usize,
    /// The kind of observations.
    pub obs_kind: ObsKind,
    /// Width of a skill; may be 0.
    pub latent: usize,
    /// Raw observations, `T * B`; pixels as bytes.
    pub obs: Observations,
    /// The skill active at each step, `T * B * latent`.
    pub z: Vec<f32>,
    /// The remaining share of that skill's ticks, this one included, above 0 and up to 1, `T * B`. Empty if ticks are
    /// not counted: all skills count as newly drawn then.
    pub left: Vec<f32>,
    /// What the policy remembered before each step, `T * B * memory`; empty for a policy without memory.
    pub memory: Vec<f32>,
    /// The actions taken, `T * B`.
    pub actions: Actions,
    /// True for each option that was legal, and in spaces with numbers for numbers that were chosen and not held, `T * B *
    /// mask_width()`. Empty if everything was.
    pub legal: Vec<bool>,
    /// Their log-probabilities when taken.
    pub log_probs: Vec<f32>,
    /// Values of the observations when seen.
    pub values: Vec<f32>,
    /// Raw rewards of the actions.
    pub rewards: Vec<f32>,
    /// True where the action ended the episode by the game's own rules.
    pub terminated: Vec<bool>,
    /// True where the episode was cut off after the action.
    pub truncated: Vec<bool>,
    /// Value of the last observation of an episode that was cut off after this step; not read elsewhere.
    pub final_values: Vec<f32>,
    /// Value of the observation after the last step of each environment (under the skill active then), `B`.
    pub next_values: Vec<f32>,
    /// The states behind `final_values` and `next_values`, for learners that keep transitions; may be left empty for
    /// PPO.
    pub ends: EndStates,
}

/// One tick of all environments of a [`Rollout`].
#[derive(Clone, Copy, Debug)]
pub struct RolloutStep<'a> {
    /// `B` observations.
    pub obs: ObsSlice<'a>,
    /// `B * latent`.
    pub z: &'a [f32],
    /// `B`.
    pub actions: &'a Actions,
    /// `B`.
    pub log_probs: &'a [f32],
    /// `B`.
    pub values: &'a [f32],
    /// `B`.
    pub rewards: &'a [f32],
    /// `B`.
    pub terminated: &'a [bool],
    /// `B`.
    pub truncated: &'a [bool],
    /// `B`; read only where cut off and not terminated.
    pub final_values: &'a [f32],
}

impl Rollout {
    /// Creates a rollout without steps.
    pub fn new(envs: usize, obs: impl Into<ObsKind>, latent: usize, space: &ActionSpace) -> Self {
        let obs_kind = obs.into();
        Self {
            steps: 0,
            envs,
            obs_kind,
            latent,
            obs: Observations::empty(&obs_kind),
            z: Vec::new(),
            left: Vec::new(),
            memory: Vec::new(),
            actions: Actions::empty(space),
            legal: Vec::new(),
            log_probs: Vec::new(),
            values: Vec::new(),
            rewards: Vec::new(),
            terminated: Vec::new(),
            truncated: Vec::new(),
            final_values: Vec::new(),
            next_values: Vec::new(),
            ends: EndStates::new(&obs_kind),
        }
    }

    /// Returns the number of rows, T · B.
    pub fn rows(&self) -> usize {
        self.steps * self.envs
    }

    /// Returns whether any reward is not 0: otherwise there is nothing to learn from rewards.
    pub fn is_rewarded(&self) -> bool {
        self.rewards.iter().any(|&reward| reward != 0.0)
    }

    /// Removes all steps and keeps the memory.
    pub fn clear(&mut self) {
        self.steps = 0;
        self.obs.clear();
        self.actions.clear();
        for values in [
            &mut self.z,
            &mut self.left,
            &mut self.memory,
            &mut self.log_probs,
            &mut self.values,
            &mut self.rewards,
            &mut self.final_values,
            &mut self.next_values,
        ] {
            values.clear();
        }
        self.legal.clear();
        self.terminated.clear();
        self.truncated.clear();
        self.ends.clear();
    }

    /// Keeps the last observation of an episode of environment `env` that the newest step has cut off, with the skill
    /// under which it is valued. Environments come in ascending order within a step.
    ///
    /// # Errors
    /// [`LearnError::Config`] if the observation is of another kind.
    ///
    /// # Panics
    /// If no step was pushed yet.
    pub fn push_cut<'a>(&mut self, env: usize, obs: impl Into<ObsSlice<'a>>, z: &[f32]) -> Result<(), LearnError> {
        self.ends.cut_obs.push(obs)?;
        self.ends.cut_rows.push((self.steps - 1) * self.envs + env);
        self.ends.cut_z.extend_from_slice(z);
        Ok(())
    }

    /// Adds the remaining shares of the skills of the newest step, `B`.
    pub fn push_left(&mut self, left: &[f32]) {
        self.left.extend_from_slice(left);
    }

    /// Adds what the policy remembered before the newest step, `B * memory`.
    pub fn push_memory(&mut self, memory: &[f32]) {
        self.memory.extend_from_slice(memory);
    }

    /// Adds the mask of the newest step, `B * choices`, or nothing if the game has none.
    ///
    /// # Panics
    /// If no step was pushed yet.
    pub fn push_legal(&mut self, legal: &[bool]) {
        let before = (self.steps - 1) * self.envs;
        let choices = match legal.len().checked_div(self.envs) {
            Some(choices) if choices > 0 => choices,
            _ => self.legal.len().checked_div(before).unwrap_or_default(),
        };
        legal::extend(&mut self.legal, before, legal, self.envs, choices);
    }

    /// Returns the number of discrete actions that its mask is about; 0 without a mask.
    pub(crate) fn choices(&self) -> usize {
        self.legal.len().checked_div(self.rows()).unwrap_or_default()
    }

    /// Returns the numbers that the policy remembers; 0 without memory.
    pub(crate) fn memory_width(&self) -> usize {
        self.memory.len().checked_div(self.rows()).unwrap_or_default()
    }

    /// Adds one tick.
    ///
    /// # Errors
    /// [`LearnError::Action`] or [`LearnError::Config`] if actions or observations are of another kind. Lengths are
    /// checked when the rollout is used.
    pub fn push_step(&mut self, step: RolloutStep<'_>) -> Result<(), LearnError> {
        self.actions.extend_rows(step.actions, 0, step.actions.len())?;
        self.obs.push(step.obs)?;
        self.z.extend_from_slice(step.z);
        self.log_probs.extend_from_slice(step.log_probs);
        self.values.extend_from_slice(step.values);
        self.rewards.extend_from_slice(step.rewards);
        self.terminated.extend_from_slice(step.terminated);
        self.truncated.extend_from_slice(step.truncated);
        self.final_values.extend_from_slice(step.final_values);
        self.steps += 1;
        Ok(())
    }

    /// Returns whether an episode ended at each row, in either way.
    pub fn done(&self) -> Vec<bool> {
        self.terminated.iter().zip(&self.truncated).map(|(a, b)| *a || *b).collect()
    }

    /// Fills [`Self::final_values`] and [`Self::next_values`] with `policy`'s values of the [`Self::ends`], all in
    /// one batch, as an alternative to one call per tick. Values that are never read become 0.
    ///
    /// # Errors
    /// As [`Self::check`]; [`LearnError::Shape`] or [`LearnError::Config`] if the states do not fit the policy.
    pub fn bootstrap(&mut self, policy: &Policy) -> Result<(), LearnError> {
        let rows = self.rows();
        self.final_values = vec![0.0; rows];
        self.next_values = vec![0.0; self.envs];
        self.check()?;
        let (width, latent) = (self.obs_kind.numbers(), self.latent);
        let done = self.done();
        let going_on = |&env: &usize| rows == 0 || !done[rows - self.envs + env];
        let running: Vec<usize> = (0..self.envs).filter(going_on).collect();
        let ends = &self.ends;
        ends.next_obs.as_slice().check_size("rollout ends next_obs", &self.obs_kind, self.envs)?;
        LearnError::check("rollout ends next_z", self.envs * latent, ends.next_z.len())?;
        let (mut obs, mut z, mut left) = (ends.cut_obs.clone(), ends.cut_z.clone(), ends.cut_left.clone());
        let (mut memory, remembered) = (ends.cut_memory.clone(), self.memory_width());
        for &env in &running {
            obs.push(ends.next_obs.row(env, width))?;
            z.extend_from_slice(&ends.next_z[env * latent..(env + 1) * latent]);
            left.extend(ends.next_left.get(env));
            memory.extend(ends.next_memory.get(env * remembered..(env + 1) * remembered).unwrap_or_default());
        }
        let cuts = ends.cut_rows.len();
        let values = policy.values_remembering(&z, &left, &memory, &obs, cuts + running.len())?;
        for (&row, &value) in ends.cut_rows.iter().zip(&values) {
            self.final_values[row] = value;
        }
        for (&env, &value) in running.iter().zip(&values[cuts..]) {
            self.next_values[env] = value;
        }
        Ok(())
    }

    /// Checks that all lengths fit T and B, and that [`EndStates::cut_rows`] ascend and
    /// are rows of this rollout.
    ///
    /// # Errors
    /// [`LearnError::Shape`] names the first length that does not; [`LearnError::Config`] names a row.
    pub fn check(&self) -> Result<(), LearnError> {
        self.obs.as_slice().check_size("rollout obs", &self.obs_kind, self.rows())?;
        self.check_beside_obs()
    }

    /// Does [`Self::check`] for a rollout whose observations are kept elsewhere.
    fn check_beside_obs(&self) -> Result<(), LearnError> {
        let (rows, cuts) = (self.rows(), self.ends.cut_rows.len());
        self.ends.cut_obs.as_slice().check_size("rollout ends cut_obs", &self.obs_kind, cuts)?;
        for (name, expected, found) in [
            ("rollout z", rows * self.latent, self.z.len()),
            ("rollout actions", rows, self.actions.len()),
            ("rollout log_probs", rows, self.log_probs.len()),
            ("rollout values", rows, self.values.len()),
            ("rollout rewards", rows, self.rewards.len()),
            ("rollout terminated", rows, self.terminated.len()),
            ("rollout truncated", rows, self.truncated.len()),
            ("rollout final_values", rows, self.final_values.len()),
            ("rollout next_values", self.envs, self.next_values.len()),
            ("rollout ends cut_z", cuts * self.latent, self.ends.cut_z.len()),
        ] {
            LearnError::check(name, expected, found)?;
        }
        for (name, expected, left) in [
            ("rollout left", rows, &self.left),
            ("rollout ends cut_left", cuts, &self.ends.cut_left),
            ("rollout ends next_left", self.envs, &self.ends.next_left),
        ] {
            if !left.is_empty() {
                LearnError::check(name, expected, left.len())?;
            }
        }
        let width = self.memory_width();
        for (name, expected, memory) in [
            ("rollout memory", rows * width, &self.memory),
            ("rollout ends cut_memory", cuts * width, &self.ends.cut_memory),
            ("rollout ends next_memory", self.envs * width, &self.ends.next_memory),
        ] {
            if !memory.is_empty() {
                LearnError::check(name, expected, memory.len())?;
            }
        }
        let cut_rows = &self.ends.cut_rows;
        if let Some(row) = cut_rows.iter().find(|row| **row >= rows) {
            return Err(LearnError::Config(format!("rollout ends: row {row} is listed, but there are {rows} rows")));
        }
        if let Some(pair) = cut_rows.windows(2).find(|pair| pair[0] >= pair[1]) {
            let text = format!("rollout ends: row {} is listed after row {}: they must ascend", pair[1], pair[0]);
            return Err(LearnError::Config(text));
        }
        Ok(())
    }

    /// Checks that a learner of `spec` can learn from this rollout with skills of width `latent`. It must fit and not
    /// be empty, and every observation, skill and number that is learned from must be finite.
    ///
    /// # Errors
    /// As [`Self::check`]; [`LearnError::Action`] if the actions do not fit; [`LearnError::Input`] names the first row
    /// that is not finite; [`LearnError::Config`] if there are no rows.
    pub(crate) fn check_for(&self, spec: &PolicySpec, latent: usize) -> Result<(), LearnError> {
        self.check()?;
        spec.action_space.check(&self.actions)?;
        legal::check(&self.legal, &spec.action_space, &self.actions)?;
        self.check_legal_ends(spec.action_space.mask_width())?;
        spec.obs.same_as(&self.obs_kind, "the rollout")?;
        LearnError::check("latent of the rollout", latent, self.latent)?;
        if self.rows() == 0 {
            return Err(LearnError::Config("the rollout is empty".to_owned()));
        }
        let ends = &self.ends;
        for (name, obs) in [
            ("rollout obs", &self.obs),
            ("rollout ends cut_obs", &ends.cut_obs),
            ("rollout ends next_obs", &ends.next_obs),
        ] {
            obs.as_slice().check_finite(name, self.obs_kind.numbers())?;
        }
        for (name, width, values) in [
            ("rollout z", self.latent, &self.z),
            ("rollout left", 1, &self.left),
            ("rollout memory", self.memory_width(), &self.memory),
            ("rollout rewards", 1, &self.rewards),
            ("rollout ends cut_z", self.latent, &ends.cut_z),
            ("rollout ends next_z", self.latent, &ends.next_z),
        ] {
            LearnError::check_finite(name, width, values)?;
        }
        Ok(())
    }
}

impl Rollout {
    /// Checks that the masks of the end states have `width` entries each, if there are any.
    fn check_legal_ends(&self, width: usize) -> Result<(), LearnError> {
        let ends = &self.ends;
        for (name, states, legal) in [
            ("rollout ends cut_legal", ends.cut_rows.len(), &ends.cut_legal),
            ("rollout ends next_legal", self.envs, &ends.next_legal),
        ] {
            if !legal.is_empty() {
                LearnError::check(name, states * width, legal.len())?;
            }
        }
        Ok(())
    }
}

/// The observations of some environments in a rollout of more, tick by tick.
#[derive(Debug)]
pub struct ObsColumns<'a> {
    /// The remaining ticks, the next one last.
    ticks: Vec<Tick<'a>>,
}

#[derive(Debug)]
enum Tick<'a> {
    Vector(&'a mut [f32]),
    Image(&'a mut [u8]),
}

impl ObsColumns<'_> {
    /// Writes the observations of the next tick.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if their number differs from that of environments, or the rollout is full;
    /// [`LearnError::Config`] if they are of another kind.
    pub fn fill_next(&mut self, obs: ObsSlice<'_>) -> Result<(), LearnError> {
        let what = "observations of a tick";
        match (self.ticks.pop(), obs) {
            (Some(Tick::Vector(to)), ObsSlice::Vector(from)) => {
                LearnError::check(what, to.len(), from.len())?;
                to.copy_from_slice(from);
            }
            (Some(Tick::Image(to)), ObsSlice::Image(from)) => {
                LearnError::check(what, to.len(), from.len())?;
                to.copy_from_slice(from);
            }
            (None, obs) => LearnError::check(what, 0, obs.numbers())?,
            (Some(_), _) => return Err(LearnError::Config("a tick's observations are of another kind".to_owned())),
        }
        Ok(())
    }
}

impl Observations {
    /// Makes room for `steps` ticks of the environments of all `shares`, if needed, and returns the columns of each
    /// share.
    pub fn columns(&mut self, kind: &ObsKind, steps: usize, shares: &[usize]) -> Vec<ObsColumns<'_>> {
        let rows = steps * shares.iter().sum::<usize>();
        if self.as_slice().check_size("rollout obs", kind, rows).is_err() {
            *self = Self::zeros(kind, rows);
        }
        let sizes: Vec<usize> = shares.iter().map(|share| share * kind.numbers()).collect();
        let all = match self {
            Self::Vector(values) => split(values, steps, &sizes, Tick::Vector),
            Self::Image(pixels) => split(pixels, steps, &sizes, Tick::Image),
        };
        all.into_iter().map(|ticks| ObsColumns { ticks }).collect()
    }
}

/// Splits each tick into the parts of all shares, from the last tick to the first.
fn split<'a, T>(
    mut rest: &'a mut [T],
    steps: usize,
    sizes: &[usize],
    tick: impl Fn(&'a mut [T]) -> Tick<'a>,
) -> Vec<Vec<Tick<'a>>> {
    let mut all: Vec<Vec<Tick<'a>>> = sizes.iter().map(|_| Vec::with_capacity(steps)).collect();
    for _ in 0..steps {
        for (ticks, size) in all.iter_mut().zip(sizes) {
            let (part, behind) = rest.split_at_mut(*size);
            ticks.push(tick(part));
            rest = behind;
        }
    }
    all.iter_mut().for_each(|ticks| ticks.reverse());
    all
}

/// States that are in no row of a rollout: where episodes were cut off, and where the rollout stopped.
#[derive(Clone, Debug, PartialEq)]
pub struct EndStates {
    /// Rows that cut an episode off without terminating it, ascending.
    pub cut_rows: Vec<usize>,
    /// Last observation of each of those episodes.
    pub cut_obs: Observations,
    /// The skill under which that observation is valued, `cut_rows * latent`.
    pub cut_z: Vec<f32>,
    /// Remaining share of that skill, as in [`Rollout::left`].
    pub cut_left: Vec<f32>,
    /// What the policy remembers before that observation, `cut_rows * memory`, or empty.
    pub cut_memory: Vec<f32>,
    /// The mask in that state, as in [`Rollout::legal`].
    pub cut_legal: Vec<bool>,
    /// Observation after the last row of each environment, `B`; zeros where that row ended an episode.
    pub next_obs: Observations,
    /// The skill active there, `B * latent`.
    pub next_z: Vec<f32>,
    /// Remaining share of that skill, `B`, or empty.
    pub next_left: Vec<f32>,
    /// What the policy remembers before it, `B * memory`, or empty.
    pub next_memory: Vec<f32>,
    /// The mask in that state, `B * choices`, or empty.
    pub next_legal: Vec<bool>,
}

impl EndStates {
    /// Creates a value without states.
    pub fn new(kind: &ObsKind) -> Self {
        let none = || Observations::empty(kind);
        let empty = Vec::new;
        Self {
            cut_rows: Vec::new(),
            cut_obs: none(),
            cut_z: empty(),
            cut_left: empty(),
            cut_memory: empty(),
            cut_legal: Vec::new(),
            next_obs: none(),
            next_z: empty(),
            next_left: empty(),
            next_memory: empty(),
            next_legal: Vec::new(),
        }
    }

    /// Removes all states and keeps the memory.
    fn clear(&mut self) {
        self.cut_rows.clear();
        self.cut_obs.clear();
        self.cut_z.clear();
        self.cut_left.clear();
        self.cut_memory.clear();
        self.cut_legal.clear();
        self.next_obs.clear();
        self.next_z.clear();
        self.next_left.clear();
        self.next_memory.clear();
        self.next_legal.clear();
    }
}

impl Rollout {
    /// Puts rollouts of the same length side by side: the environments of the first, then those of the second, ... A
    /// single one is returned unchanged.
    ///
    /// # Errors
    /// [`LearnError::Config`] for no parts; [`LearnError::Shape`], [`LearnError::Config`] or [`LearnError::Action`]
    /// if they do not fit together.
    pub fn join(mut parts: Vec<Self>) -> Result<Self, LearnError> {
        parts.iter().try_for_each(Self::check)?;
        if parts.len() == 1 {
            return Ok(parts.remove(0));
        }
        let mut all = Self::join_beside_obs(&parts)?;
        all.obs = side_by_side(&parts, &all.obs_kind)?;
        Ok(all)
    }

    /// Joins parts as [`Self::join`] does, with observations that are in `obs` already, each in its
    /// [columns](Observations::columns); observations in the parts are ignored.
    ///
    /// # Errors
    /// As [`Self::join`].
    pub fn join_around(obs: Observations, mut parts: Vec<Self>) -> Result<Self, LearnError> {
        let mut all = match parts.len() {
            1 => parts.remove(0),
            _ => Self::join_beside_obs(&parts)?,
        };
        all.obs = obs;
        all.check()?;
        Ok(all)
    }

    fn join_beside_obs(parts: &[Self]) -> Result<Self, LearnError> {
        let Some(first) = parts.first() else {
            return Err(LearnError::Config("no rollouts to join".to_owned()));
        };
        let kind = first.obs_kind;
        let mut all =
            Self { actions: first.actions.clone(), ..Self::new(0, kind, first.latent, &ActionSpace::Discrete(0)) };
        all.actions.clear();
        all.steps = first.steps;
        let choices = parts.iter().map(Self::choices).max().unwrap_or_default();
        for part in parts {
            part.check_beside_obs()?;
            LearnError::check("steps of a joined rollout", first.steps, part.steps)?;
            kind.same_as(&part.obs_kind, "a joined rollout")?;
            LearnError::check("latent of a joined rollout", first.latent, part.latent)?;
            legal::extend(&mut all.ends.next_legal, all.envs, &part.ends.next_legal, part.envs, choices);
            all.envs += part.envs;
            all.next_values.extend_from_slice(&part.next_values);
            all.ends.next_obs.push(&part.ends.next_obs)?;
            all.ends.next_z.extend_from_slice(&part.ends.next_z);
            all.ends.next_left.extend_from_slice(&part.ends.next_left);
            all.ends.next_memory.extend_from_slice(&part.ends.next_memory);
        }
        for t in 0..first.steps {
            for part in parts {
                let rows = t * part.envs..(t + 1) * part.envs;
                all.actions.extend_rows(&part.actions, rows.start, rows.end)?;
                all.z.extend_from_slice(&part.z[rows.start * part.latent..rows.end * part.latent]);
                all.left.extend_from_slice(part.left.get(rows.clone()).unwrap_or_default());
                let width = part.memory_width();
                all.memory.extend_from_slice(&part.memory[rows.start * width..rows.end * width]);
                let legal = part.legal.get(rows.start * choices..rows.end * choices).unwrap_or_default();
                let before = all.rewards.len();
                legal::extend(&mut all.legal, before, legal, part.envs, choices);
                all.log_probs.extend_from_slice(&part.log_probs[rows.clone()]);
                all.values.extend_from_slice(&part.values[rows.clone()]);
                all.rewards.extend_from_slice(&part.rewards[rows.clone()]);
                all.terminated.extend_from_slice(&part.terminated[rows.clone()]);
                all.truncated.extend_from_slice(&part.truncated[rows.clone()]);
                all.final_values.extend_from_slice(&part.final_values[rows]);
            }
        }
        all.join_cuts(parts, choices)?;
        Ok(all)
    }

    /// Adds the cut episodes of all parts, in ascending order of their joined rows.
    fn join_cuts(&mut self, parts: &[Self], choices: usize) -> Result<(), LearnError> {
        let mut cuts = Vec::new();
        let mut offset = 0;
        for part in parts {
            for (i, &row) in part.ends.cut_rows.iter().enumerate() {
                let joined = row / part.envs * self.envs + offset + row % part.envs;
                cuts.push((joined, part, i));
            }
            offset += part.envs;
        }
        cuts.sort_by_key(|(row, ..)| *row);
        for (row, part, i) in cuts {
            self.ends.cut_rows.push(row);
            self.ends.cut_obs.push(part.ends.cut_obs.row(i, self.obs_kind.numbers()))?;
            self.ends.cut_left.extend(part.ends.cut_left.get(i));
            let width = part.memory_width();
            let memory = part.ends.cut_memory.get(i * width..(i + 1) * width);
            self.ends.cut_memory.extend_from_slice(memory.unwrap_or_default());
            let legal = part.ends.cut_legal.get(i * choices..(i + 1) * choices).unwrap_or_default();
            legal::extend(&mut self.ends.cut_legal, self.ends.cut_rows.len() - 1, legal, 1, choices);
            self.ends.cut_z.extend_from_slice(&part.ends.cut_z[i * self.latent..(i + 1) * self.latent]);
        }
        Ok(())
    }
}

/// Returns the observations of parts that fit together, tick by tick.
fn side_by_side(parts: &[Rollout], kind: &ObsKind) -> Result<Observations, LearnError> {
    let mut obs = Observations::with_capacity(kind, parts.iter().map(Rollout::rows).sum());
    for t in 0..parts.first().map_or(0, |part| part.steps) {
        for part in parts {
            obs.push(part.obs.rows(t * part.envs..(t + 1) * part.envs, kind.numbers()))?;
        }
    }
    Ok(obs)
}

#[cfg(test)]
mod columns_tests {
    use super::*;

    #[test]
    fn worlds_fill_what_belongs_to_them() {
        let (kind, mut all) = (ObsKind::Vector(2), Observations::Vector(vec![7.0]));
        let mut parts = all.columns(&kind, 2, &[2, 1]);
        for tick in 0..2 {
            let from = 10.0 * tick as f32;
            parts[1].fill_next(ObsSlice::Vector(&[from + 5.0, from + 6.0])).expect("fits");
            parts[0].fill_next(ObsSlice::Vector(&[from + 1.0, from + 2.0, from + 3.0, from + 4.0])).expect("fits");
        }
        assert!(parts[0].fill_next(ObsSlice::Vector(&[1.0])).is_err(), "it is full");
        drop(parts);
        let want = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 11.0, 12.0, 13.0, 14.0, 15.0, 16.0];
        assert_eq!(all, Observations::Vector(want));
    }

    #[test]
    fn a_misfit_is_reported() {
        let kind = ObsKind::Vector(2);
        let mut all = Observations::empty(&kind);
        let mut parts = all.columns(&kind, 2, &[1]);
        let error = parts[0].fill_next(ObsSlice::Vector(&[1.0])).expect_err("too short").to_string();
        assert!(error.contains("observations of a tick"), "{error}");
        assert!(parts[0].fill_next(ObsSlice::Image(&[1, 2])).is_err());
    }
}
