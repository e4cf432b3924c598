//! Demonstrations for a skill model.

use crate::{
    ActionSpace, Actions, EntityBlock, LearnError, ObsKind, Observations, SeenLevels, legacy, legal,
    norm::ObsStats,
    rng::{Streams, below, fnv1a, shuffle},
};
use playbot_kernels::kept_memory::{OF_A_MOVE, share};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// One recorded episode.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetEpisode {
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
    pub(crate) episodes: Arc<[Arc<DatasetEpisode>]>,
    /// The level of each episode.
    pub(super) levels: Arc<[usize]>,
    /// The same episodes as vectors of the game's state, if they are known.
    pub(super) states: Option<Arc<Self>>,
    /// The levels that they show, if known.
    pub(super) seen: Option<Arc<SeenLevels>>,
    /// The masks of each episode; empty if every action was always legal.
    pub(crate) legal: Arc<[Arc<[bool]>]>,
    /// Episodes whose masks are not known.
    pub(super) unmasked: usize,
}

impl Dataset {
    /// Checks and keeps `episodes`, whose observations are all of one kind: a number is the width of a vector.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if an episode's observations do not match its actions, [`LearnError::Config`] if they are
    /// of another kind, [`LearnError::Action`] if an action is outside `space`, [`LearnError::Input`] if an observation
    /// is not finite.
    pub fn new(
        observation: impl Into<ObsKind>,
        space: ActionSpace,
        episodes: Vec<DatasetEpisode>,
    ) -> Result<Self, LearnError> {
        let observation = observation.into();
        if observation.numbers() == 0 || space.is_empty() {
            return Err(LearnError::Config("observations and actions must not be empty".to_owned()));
        }
        for (i, episode) in episodes.iter().enumerate() {
            let what = format!("observations of episode {i}");
            episode.observations.as_slice().check(&what, &observation, episode.actions.len())?;
            space.check(&episode.actions)?;
        }
        let levels = (0..episodes.len()).collect();
        let episodes = episodes.into_iter().map(Arc::new).collect();
        let (states, seen, legal, unmasked) = (None, None, Arc::default(), 0);
        Ok(Self { observation, space, episodes, levels, states, seen, legal, unmasked })
    }

    /// Assigns a level to each episode, by any number that is equal for episodes on the same level.
    /// [`SkillConfig::held_out`](crate::skill::SkillConfig::held_out) then holds out whole levels. Without it each
    /// episode counts as a level.
    ///
    /// # Errors
    /// [`LearnError::Shape`] unless there is a number for each episode.
    pub fn with_levels(self, levels: Vec<usize>) -> Result<Self, LearnError> {
        LearnError::check("levels of episodes", self.episodes.len(), levels.len())?;
        Ok(Self { levels: levels.into(), ..self })
    }

    /// Adds the masks of the actions, episode by episode, as [`Rollout::legal`](crate::Rollout::legal) has them. In an
    /// episode with an empty mask everything was legal, and it counts as legal where the mask is not known, `None`. Masks
    /// that forbid nothing are dropped.
    ///
    /// # Errors
    /// [`LearnError::Shape`] unless there is a mask of the right length for each episode, [`LearnError::Action`] if one
    /// forbids an action that was taken.
    pub fn with_legal(self, masks: Vec<Option<Vec<bool>>>) -> Result<Self, LearnError> {
        LearnError::check("masks of episodes", self.episodes.len(), masks.len())?;
        for (episode, mask) in self.episodes.iter().zip(&masks) {
            legal::check(mask.as_deref().unwrap_or_default(), &self.space, &episode.actions)?;
        }
        let unmasked = masks.iter().filter(|mask| mask.is_none()).count();
        let forbids = masks.iter().flatten().any(|mask| mask.contains(&false));
        let masks = masks.into_iter().filter(|_| forbids);
        Ok(Self { legal: masks.map(|mask| mask.unwrap_or_default().into()).collect(), unmasked, ..self })
    }

    /// Returns whether an action was illegal in some step.
    pub fn has_masks(&self) -> bool {
        !self.legal.is_empty()
    }

    /// Returns the levels that they show, if known.
    pub fn seen(&self) -> Option<&SeenLevels> {
        self.seen.as_deref()
    }

    /// Returns the number of episodes whose masks are not known.
    pub fn unmasked(&self) -> usize {
        self.unmasked
    }

    /// Notes the levels that they show: skill models that are learned from them [keep
    /// this](crate::skill::SkillModel::demos).
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
            legal: numbers.iter().filter_map(|&i| self.legal.get(i)).cloned().collect(),
            unmasked: self.unmasked,
        }
    }

    /// Returns the mean and deviation of each number of the observations over all steps; `None` for images. The things of
    /// a set share theirs.
    pub(super) fn stats(&self, sets: &[EntityBlock]) -> Option<ObsStats> {
        let ObsKind::Vector(width) = self.observation else { return None };
        let rows = self.episodes.iter().flat_map(|episode| match &episode.observations {
            Observations::Vector(values) => values.chunks_exact(width),
            Observations::Image(_) => [].chunks_exact(width),
        });
        Some(ObsStats::tied(rows, width, sets))
    }

    /// Returns a hash of all observations, actions, states and masks, the same on any number of threads.
    pub(super) fn fingerprint(&self) -> u64 {
        let mut hashes = vec![[0; 2]; self.episodes.len()];
        let numbers = self.steps() * self.observation.numbers();
        share(&mut hashes, 1, numbers * OF_A_MOVE, |number, hashes| {
            let episode = &self.episodes[number];
            let observations = match &episode.observations {
                Observations::Vector(values) => fnv1a(bytemuck::cast_slice(values)),
                Observations::Image(pixels) => fnv1a(pixels),
            };
            let actions = match &episode.actions {
                Actions::Discrete(choices) => fnv1a(bytemuck::cast_slice(choices)),
                Actions::Continuous { values, .. } => fnv1a(bytemuck::cast_slice(values)),
                Actions::Mixed { options, values, .. } => {
                    let hashes = [fnv1a(bytemuck::cast_slice(options)), fnv1a(bytemuck::cast_slice(values))];
                    fnv1a(bytemuck::cast_slice(&hashes))
                }
            };
            hashes[0] = [observations, actions];
        });
        hashes.extend(self.states.as_ref().map(|states| [states.fingerprint(), 0]));
        hashes.extend(self.legal.iter().map(|mask| [fnv1a(bytemuck::cast_slice(mask)), 0]));
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

    /// Returns the masks of `windows`, time-major as [`Self::gather`]; nothing without masks.
    pub(super) fn legal_of(&self, windows: &[Window], steps: usize) -> Vec<bool> {
        if self.legal.is_empty() {
            return Vec::new();
        }
        let width = self.space.mask_width();
        let mut legal = Vec::with_capacity(windows.len() * steps * width);
        for t in 0..steps {
            for window in windows {
                let (episode, row) = self.step_of(window, t);
                match self.legal[episode].get(row * width..(row + 1) * width) {
                    Some(mask) => legal.extend_from_slice(mask),
                    None => legal.resize(legal.len() + width, true),
                }
            }
        }
        legal
    }
}

// Windows cut from demonstrations.

/// The rule by which windows are cut.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum WindowRule {
    /// Each episode is cut into consecutive windows from a random first step, anew and in a new order in every epoch.
    /// So an epoch shows nearly every step once. No window crosses the end of an episode.
    #[default]
    WithinEpisodes,
    /// The released code's: as many windows as fit side by side, but from starts drawn once, uniformly with
    /// replacement over all steps, regardless of the ends of episodes. They are the same in the same order in every
    /// epoch. For comparison only.
    Legacy,
}

/// A stretch of one episode; with [`WindowRule::Legacy`] it may continue in those that follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Number of the episode.
    pub episode: usize,
    /// Its first step.
    pub start: usize,
}

impl Dataset {
    /// Returns the windows of one epoch, in the order in which they are learned from.
    ///
    /// # Errors
    /// [`LearnError::NoWindow`] if every episode (or with [`WindowRule::Legacy`] all together) is shorter than
    /// `window`.
    pub fn windows(
        &self,
        window: usize,
        rule: WindowRule,
        streams: &Streams,
        epoch: u64,
    ) -> Result<Vec<Window>, LearnError> {
        let windows = match rule {
            WindowRule::WithinEpisodes => self.inner_windows(window, streams, epoch),
            WindowRule::Legacy => self.legacy_windows(window, streams),
        };
        if windows.is_empty() {
            let longest = match rule {
                WindowRule::WithinEpisodes => self.lengths().max().unwrap_or(0),
                WindowRule::Legacy => self.steps(),
            };
            return Err(LearnError::NoWindow { window, longest });
        }
        Ok(windows)
    }

    fn inner_windows(&self, window: usize, streams: &Streams, epoch: u64) -> Vec<Window> {
        let mut rng = streams.stream("skill.windows", epoch);
        let mut windows = Vec::new();
        for (episode, len) in self.lengths().enumerate() {
            let Some(slack) = len.checked_sub(window).filter(|_| window > 0) else { continue };
            let first = below(&mut rng, slack.min(window - 1) as u64 + 1) as usize;
            windows.extend((first..=slack).step_by(window).map(|start| Window { episode, start }));
        }
        shuffle(&mut windows, &mut rng);
        windows
    }

    fn legacy_windows(&self, window: usize, streams: &Streams) -> Vec<Window> {
        // The step at which each episode begins, all of them laid end to end.
        let begins: Vec<usize> = self
            .lengths()
            .scan(0, |sum, len| {
                *sum += len;
                Some(*sum - len)
            })
            .collect();
        legacy::window_starts(self.steps(), window, &mut streams.stream("skill.windows", 0))
            .into_iter()
            .map(|start| {
                // The last episode that begins there or before holds the step: empty ones come first.
                let episode = begins.partition_point(|&begin| begin <= start) - 1;
                Window { episode, start: start - begins[episode] }
            })
            .collect()
    }

    /// Returns the position of step `step` of `window`: the episode and the step in it.
    pub(super) fn step_of(&self, window: &Window, step: usize) -> (usize, usize) {
        let (mut episode, mut row) = (window.episode, window.start + step);
        while row >= self.episodes[episode].actions.len() {
            row -= self.episodes[episode].actions.len();
            episode += 1;
        }
        (episode, row)
    }

    fn lengths(&self) -> impl Iterator<Item = usize> {
        self.episodes.iter().map(|episode| episode.actions.len())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::ImageShape;

    /// Returns episodes whose one-number observations count their steps.
    pub(in crate::skill) fn dataset(lengths: &[usize]) -> Dataset {
        let episodes = lengths
            .iter()
            .map(|&len| DatasetEpisode {
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
    fn masks_are_gathered_as_the_actions_they_belong_to() {
        let mask = vec![true, false, true, true, true, false];
        let all = dataset(&[3, 1, 2]).with_legal(vec![Some(mask), Some(Vec::new()), None]).expect("action 0 is legal");
        assert_eq!((all.has_masks(), all.unmasked()), (true, 1));
        let windows = [Window { episode: 0, start: 1 }, Window { episode: 2, start: 0 }];
        assert_eq!(all.legal_of(&windows, 2), [true, true, true, true, true, false, true, true]);
        let some = all.subset(&[2, 0]);
        assert_eq!(some.legal_of(&[Window { episode: 1, start: 0 }], 1), [true, false]);
    }

    #[test]
    fn masks_that_forbid_nothing_change_nothing() {
        let plain = dataset(&[2, 1]);
        let masked = plain.clone().with_legal(vec![Some(vec![true; 4]), Some(Vec::new())]).expect("all is legal");
        assert_eq!((&masked, masked.fingerprint(), masked.has_masks()), (&plain, plain.fingerprint(), false));
        let forbids = plain.clone().with_legal(vec![Some(vec![true, false, true, true]), Some(Vec::new())]);
        assert_ne!(forbids.expect("action 0 is legal").fingerprint(), plain.fingerprint(), "other demonstrations");
    }

    #[test]
    fn masks_of_another_size_and_illegal_actions_are_refused() {
        let masked = |masks| dataset(&[2]).with_legal(masks).expect_err("refused").to_string();
        assert!(masked(Vec::new()).contains("masks of episodes"));
        assert!(masked(vec![Some(vec![true; 3])]).contains("legal"));
        let text = masked(vec![Some(vec![true, true, false, true])]);
        assert!(text.contains("row 1 is 0, which its mask forbids"), "{text}");
    }

    #[test]
    fn bad_demonstrations_are_refused() {
        let episode = |observations: Observations, a: u32| DatasetEpisode {
            observations,
            actions: Actions::Discrete(vec![a; 3]),
        };
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

#[cfg(test)]
mod windows_tests {
    use super::*;
    use crate::skill::dataset::tests::dataset;
    use crate::{Actions, Observations};

    #[test]
    fn windows_stay_inside_episodes_and_change_with_the_epoch() {
        let data = dataset(&[37, 4, 10, 25]);
        let streams = Streams::new(1);
        let cut = |epoch| data.windows(10, WindowRule::WithinEpisodes, &streams, epoch).expect("some fit");
        for epoch in 0..20 {
            let windows = cut(epoch);
            assert!(windows.iter().all(|w| w.episode != 1));
            assert!(windows.iter().any(|w| w.episode == 2));
            for w in &windows {
                assert!(w.start + 10 <= data.episodes[w.episode].actions.len());
            }
            assert_eq!(windows, cut(epoch));
        }
        assert_ne!(cut(0), cut(1));
    }

    #[test]
    fn legacy_windows_cross_the_ends_of_episodes_and_stay_the_same() {
        let data = dataset(&[3, 0, 4, 30]);
        let streams = Streams::new(2);
        let cut = |epoch| data.windows(5, WindowRule::Legacy, &streams, epoch).expect("they fit");
        let windows = cut(0);
        assert_eq!(windows.len(), 37 / 5);
        assert_eq!(windows, cut(7));
        let many: Vec<Window> = (0..200).flat_map(|seed| data.legacy_windows(5, &Streams::new(seed))).collect();
        assert!(many.iter().all(|w| w.start < data.episodes[w.episode].actions.len()));
        let first = many.iter().filter(|w| w.episode == 0).count() as f64 / many.len() as f64;
        assert!((first - 3.0 / 33.0).abs() < 0.03, "{first} of the windows start in the first 3 of 33 places");
        // From the third step of the first episode over the second to the third, whose steps are numbered anew.
        let across = Window { episode: 0, start: 2 };
        let (observations, actions) = data.gather(&[across], 5).expect("one kind");
        assert_eq!(observations, Observations::Vector(vec![2.0, 0.0, 1.0, 2.0, 3.0]));
        assert_eq!(actions, Actions::Discrete(vec![0; 5]));
        let last = Window { episode: 3, start: 25 };
        assert!(data.gather(&[last], 5).is_ok(), "the last window ends with the data");
    }

    #[test]
    fn too_short_episodes_are_an_error() {
        for (rule, stretch) in [(WindowRule::WithinEpisodes, 9), (WindowRule::Legacy, 12)] {
            let error = dataset(&[3, 9]).windows(13, rule, &Streams::new(1), 0).expect_err("none fits");
            assert!(matches!(error, LearnError::NoWindow { window: 13, longest } if longest == stretch), "{error}");
        }
        assert!(dataset(&[3, 9]).windows(10, WindowRule::WithinEpisodes, &Streams::new(1), 0).is_err());
        assert!(dataset(&[3, 9]).windows(10, WindowRule::Legacy, &Streams::new(1), 0).is_ok());
    }
}
