//! Demonstrations for a skill model.

use super::Window;
use crate::norm::ObsStats;
use crate::rng::fnv1a;
use crate::{ActionSpace, Actions, LearnError, ObsKind, Observations, SeenLevels};
use rayon::prelude::*;
use std::sync::Arc;

/// One recorded episode.
#[derive(Clone, Debug, PartialEq)]
pub struct DemoEpisode {
    /// One observation per step.
    pub observations: Observations,
    /// The action taken at each observation, `len`.
    pub actions: Actions,
}

/// Demonstrations of one game. Clones and subsets share the memory, because images need much.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    pub(super) observation: ObsKind,
    pub(super) space: ActionSpace,
    pub(super) episodes: Arc<[Arc<DemoEpisode>]>,
    /// The level of each episode.
    pub(super) levels: Arc<[usize]>,
    /// The same episodes as vectors of the game's state, if they are known.
    pub(super) states: Option<Arc<Self>>,
    /// The levels that they show, if known.
    pub(super) seen: Option<Arc<SeenLevels>>,
}

impl Dataset {
    /// Checks and keeps `episodes`, whose observations are all of one kind: a number is the width of a vector.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if an episode's observations do not match its actions, [`LearnError::Config`] if they are of
    /// another kind, [`LearnError::Action`] if an action is outside `space`, [`LearnError::Input`] if an observation is
    /// not finite.
    pub fn new(
        observation: impl Into<ObsKind>,
        space: ActionSpace,
        episodes: Vec<DemoEpisode>,
    ) -> Result<Self, LearnError> {
        let observation = observation.into();
        if observation.numbers() == 0 || space.dim() == 0 {
            return Err(LearnError::Config("observations and actions must not be empty".to_owned()));
        }
        for (i, episode) in episodes.iter().enumerate() {
            let what = format!("observations of episode {i}");
            episode.observations.as_slice().check(&what, &observation, episode.actions.len())?;
            space.check(&episode.actions)?;
        }
        let levels = (0..episodes.len()).collect();
        let episodes = episodes.into_iter().map(Arc::new).collect();
        Ok(Self { observation, space, episodes, levels, states: None, seen: None })
    }

    /// Assigns a level to each episode, by any number that is equal for episodes on the same level.
    /// [`SkillConfig::held_out`](super::SkillConfig::held_out) then holds out whole levels. Without it each episode
    /// counts as a level.
    ///
    /// # Errors
    /// [`LearnError::Shape`] unless there is a number for each episode.
    pub fn with_levels(self, levels: Vec<usize>) -> Result<Self, LearnError> {
        LearnError::check("levels of episodes", self.episodes.len(), levels.len())?;
        Ok(Self { levels: levels.into(), ..self })
    }

    /// Notes the levels that they show: skill models that are learned from them [keep
    /// this](super::SkillModel::demos).
    pub fn with_seen(self, seen: SeenLevels) -> Self {
        Self { seen: Some(Arc::new(seen)), ..self }
    }

    /// Returns the kind of observations.
    pub fn observation(&self) -> ObsKind {
        self.observation
    }

    /// Numbers in an observation.
    pub fn obs_dim(&self) -> usize {
        self.observation.numbers()
    }

    /// Returns the space of the actions.
    pub fn action_space(&self) -> ActionSpace {
        self.space
    }

    /// Returns the number of episodes.
    pub fn episodes(&self) -> usize {
        self.episodes.len()
    }

    /// Steps in all episodes together.
    pub fn steps(&self) -> usize {
        self.episodes.iter().map(|episode| episode.actions.len()).sum()
    }

    /// Returns the episodes of these numbers.
    pub(super) fn subset(&self, numbers: &[usize]) -> Self {
        Self {
            observation: self.observation,
            space: self.space,
            episodes: numbers.iter().map(|&i| Arc::clone(&self.episodes[i])).collect(),
            levels: numbers.iter().map(|&i| self.levels[i]).collect(),
            states: self.states.as_ref().map(|states| Arc::new(states.subset(numbers))),
            seen: self.seen.clone(),
        }
    }

    /// Returns the mean and deviation of each number of the observations over all steps; `None` for images.
    pub(super) fn stats(&self) -> Option<ObsStats> {
        let ObsKind::Vector(width) = self.observation else { return None };
        let rows = self.episodes.iter().flat_map(|episode| match &episode.observations {
            Observations::Vector(values) => values.chunks_exact(width),
            Observations::Image(_) => [].chunks_exact(width),
        });
        Some(ObsStats::of(rows, width))
    }

    /// Returns a hash of all observations, actions and states, the same on any number of threads.
    pub(super) fn fingerprint(&self) -> u64 {
        let mut hashes: Vec<[u64; 2]> = self
            .episodes
            .par_iter()
            .map(|episode| {
                let observations = match &episode.observations {
                    Observations::Vector(values) => fnv1a(bytemuck::cast_slice(values)),
                    Observations::Image(pixels) => fnv1a(pixels),
                };
                let actions = match &episode.actions {
                    Actions::Discrete(choices) => fnv1a(bytemuck::cast_slice(choices)),
                    Actions::Continuous { values, .. } => fnv1a(bytemuck::cast_slice(values)),
                };
                [observations, actions]
            })
            .collect();
        hashes.extend(self.states.as_ref().map(|states| [states.fingerprint(), 0]));
        fnv1a(bytemuck::cast_slice(&hashes))
    }

    /// Returns observations and actions of `windows`, time-major: row `t * windows + b`.
    pub(super) fn gather(&self, windows: &[Window], steps: usize) -> Result<(Observations, Actions), LearnError> {
        let width = self.observation.numbers();
        let mut observations = Observations::with_capacity(&self.observation, windows.len() * steps);
        let mut actions = Actions::empty(&self.space);
        for t in 0..steps {
            for window in windows {
                let (episode, row) = self.step_of(window, t);
                let episode = &self.episodes[episode];
                observations.push(episode.observations.row(row, width))?;
                actions.extend_rows(&episode.actions, row, row + 1)?;
            }
        }
        Ok((observations, actions))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::ImageShape;

    /// Returns episodes whose one-number observations count their steps.
    pub(in super::super) fn dataset(lengths: &[usize]) -> Dataset {
        let episodes = lengths
            .iter()
            .map(|&len| DemoEpisode {
                observations: Observations::Vector((0..len).map(|t| t as f32).collect()),
                actions: Actions::Discrete(vec![0; len]),
            })
            .collect();
        Dataset::new(1, ActionSpace::Discrete(2), episodes).expect("consistent episodes")
    }

    #[test]
    fn a_subset_needs_no_memory_of_its_own() {
        let all = dataset(&[3, 4, 5]);
        let some = all.subset(&[2, 0]);
        assert_eq!((some.steps(), some.levels.to_vec()), (8, vec![2, 0]));
        assert!(Arc::ptr_eq(&some.episodes[0], &all.episodes[2]));
    }

    #[test]
    fn bad_demonstrations_are_refused() {
        let episode =
            |observations: Observations, a: u32| DemoEpisode { observations, actions: Actions::Discrete(vec![a; 3]) };
        let new = |kind: ObsKind, e| Dataset::new(kind, ActionSpace::Discrete(2), vec![e]);
        let vector = ObsKind::Vector(2);
        assert!(new(vector, episode(vec![0.0; 6].into(), 1)).is_ok());
        assert!(matches!(new(vector, episode(vec![0.0; 5].into(), 1)), Err(LearnError::Shape { .. })));
        assert!(matches!(new(vector, episode(vec![0.0; 6].into(), 2)), Err(LearnError::Action(_))));
        assert!(matches!(new(vector, episode(vec![f32::NAN; 6].into(), 1)), Err(LearnError::Input { row: 0, .. })));
        assert!(matches!(new(vector, episode(vec![0u8; 6].into(), 1)), Err(LearnError::Config(_))));
        let image = ObsKind::Image(ImageShape { channels: 1, height: 1, width: 2 });
        assert!(new(image, episode(vec![0u8; 6].into(), 1)).is_ok());
        assert!(matches!(new(image, episode(vec![0.0; 6].into(), 1)), Err(LearnError::Config(_))));
        assert!(matches!(new(image, episode(vec![0u8; 7].into(), 1)), Err(LearnError::Shape { .. })));
    }
}
