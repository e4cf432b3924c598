//! Data sets for the skill model, made from recordings.
//!
//! The folder has:
//!
//! - `observe`: the replay of recordings whose files lack observations, or masks.

mod observe;

use crate::{Experiment, demo::observe::ObservedEpisode};
use bevy_playbot::{
    demo::{
        file::{DemoEnd, DemoEpisode, DemoReader},
        replay::Replay,
    },
    engine::find_demos,
    vision::ObservationConfig,
};
use playbot_harness::{
    demo::VerifyError,
    game::{Game, level_designs},
    held_out::HeldOut,
    machine::free_memory,
    sensors::GameSensors,
    split::LevelSplit,
};
use playbot_learner::{
    ActionSpace, Actions, Dataset, DatasetEpisode, LearnError, ObsKind, Observations, Rollout, SeenLevels, Streams,
    rng::shuffle,
};
use std::{
    collections::{BTreeMap, BTreeSet},
    ops::Range,
    path::Path,
    sync::Arc,
};

/// Recorded episodes of a game, read and checked, before each action is paired with its observation.
///
/// Recordings contain no pictures, and their vectors may be older than the game's, so an episode is replayed through
/// the sensor. Vectors of the right kind are used as they are.
#[derive(Debug)]
pub struct Demonstrations {
    /// Observations of the learner.
    pub observation_config: ObservationConfig,
    /// The episodes, in the order of files and of their ends.
    pub episodes: Vec<Demonstration>,
    /// The learner of pictures also predicts the game's state.
    with_states: bool,
    /// Levels that the demonstrator has learned from.
    learned: Vec<LevelSplit>,
}

/// One episode and its source.
#[derive(Debug)]
pub struct Demonstration {
    /// The recording.
    pub file: Arc<Path>,
    /// Number of the episode in the recording, from 0.
    pub index: usize,
    /// Mode of the game.
    pub mode: Arc<str>,
    /// The recorded actions.
    pub episode: Arc<DemoEpisode>,
    /// The file has the vectors that the game has now.
    pub is_seen: bool,
}

impl Demonstration {
    /// Returns mode and seed, or the hash of the level file, whose number differs from recording to recording.
    fn level(&self) -> (Arc<str>, Result<u64, u64>) {
        let Some(file) = &self.episode.level_file else { return (self.mode.clone(), Ok(self.episode.level_seed)) };
        (self.mode.clone(), Err(file.hash))
    }
}

impl Demonstrations {
    /// Reads all recordings of a game below a path.
    ///
    /// The files may differ in mode, but the observation must not depend on it. If there is a split `held_out`, no
    /// recording may show a level of it: results on these levels would be no generalisation.
    ///
    /// # Errors
    ///
    /// [`VerifyError`] for files that cannot be read, belong to another game or version, or show a held-out level, and
    /// for a game that cannot be observed this way.
    pub fn read(
        game: &dyn Game,
        observation_config: &ObservationConfig,
        path: &Path,
        held_out: Option<&LevelSplit>,
    ) -> Result<Self, VerifyError> {
        observation_config.check(game)?;
        let names = game.observation().names;
        let mut episodes = Vec::new();
        let held_out = held_out.map(|split| HeldOut::new(game, split));
        for file in find_demos(path)? {
            let reader = DemoReader::open_for_game(&file, game.name(), game.version(), None)?;
            let header = reader.header().clone();
            game.check_mode(&header.mode).map_err(|source| VerifyError::Mode { path: file.clone(), source })?;
            let is_seen = !observation_config.is_image() && header.observation_names == names;
            let (shared, mode) = (Arc::<Path>::from(file.as_path()), Arc::<str>::from(header.mode.as_str()));
            for (index, episode) in reader.enumerate() {
                let mut episode = episode?;
                let level = episode.level_seed;
                let is_hidden = |hidden: &&HeldOut| match &episode.level_file {
                    Some(file) => hidden.contains_file(file),
                    None => hidden.contains(&header.mode, level),
                };
                if let Some(hidden) = held_out.as_ref().filter(is_hidden) {
                    return Err(VerifyError::HeldOut { path: file, level, split: hidden.split().clone() });
                }
                if !is_seen {
                    // Unused vectors would only take memory.
                    episode.observations = Vec::new();
                }
                let (file, mode, episode) = (shared.clone(), mode.clone(), Arc::new(episode));
                episodes.push(Demonstration { file, index, mode, episode, is_seen });
            }
        }
        Ok(Self { observation_config: *observation_config, episodes, with_states: false, learned: Vec::new() })
    }

    /// Selects the episodes that an experiment learns skills from, of all recordings below a path. It excludes held-out
    /// levels, keeps at most the steps that the experiment asks for, and only won episodes if it wants that.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read).
    pub fn of(game: &dyn Game, experiment: &Experiment, path: &Path) -> Result<Self, VerifyError> {
        let demos = Self::read(game, &experiment.observation_config(), path, Some(&experiment.test))?;
        let (with_states, learned) = (experiment.skills.tells_states(), experiment.demo_learned.clone());
        let demos = Self { with_states, learned, ..demos };
        let demos = if experiment.demo_wins { demos.won(path)? } else { demos };
        Ok(match experiment.demo_steps {
            Some(steps) => demos.at_most(steps),
            None => demos,
        })
    }

    /// Returns the recorded modes, each once.
    pub fn modes(&self) -> BTreeSet<&str> {
        self.episodes.iter().map(|demo| &*demo.mode).collect()
    }

    /// Returns the number of steps of all episodes together.
    pub fn steps(&self) -> u64 {
        self.episodes.iter().map(|demo| demo.episode.len() as u64).sum()
    }

    /// Returns the number of episodes.
    pub fn episodes(&self) -> usize {
        self.episodes.len()
    }

    /// Returns the memory that the pictures will take; 0 for vectors.
    pub fn picture_bytes(&self) -> u64 {
        if self.observation_config.is_image() {
            self.steps() * self.observation_config.image.shape().numbers() as u64
        } else {
            0
        }
    }

    /// Pairs each action with the observation before it, in the order of the recordings. Each distinct demonstration
    /// that needs a replay is replayed once, on at most `threads` threads. Idle starts are left out: they are replayed,
    /// and demonstrate nothing. Masks of actions are restored by a replay, too, of files with observations as well. In an
    /// episode with stored observations that does not replay, every action counts as legal ([`Dataset::unmasked`]).
    /// `progress` receives numbers of finished steps, from several threads.
    ///
    /// # Errors
    ///
    /// [`VerifyError`] if an episode does not replay, or the pictures would need more memory than is free.
    pub fn dataset(
        self,
        game: &dyn Game,
        threads: usize,
        progress: impl Fn(u64) + Sync,
    ) -> Result<Dataset, VerifyError> {
        let seen = self.seen(game, threads, &progress)?;
        let seen = seen.with_seen(self.seen_levels(game));
        if !self.with_states {
            return Ok(seen);
        }
        let states = Self { observation_config: ObservationConfig::default(), ..self };
        Ok(seen.with_states(states.seen(game, threads, &|_| {})?)?)
    }

    /// Returns the data set of the sensor's observations.
    fn seen(&self, game: &dyn Game, threads: usize, progress: &(impl Fn(u64) + Sync)) -> Result<Dataset, VerifyError> {
        self.check_room(self.bytes(game), free_memory())?;
        let originals = self.originals();
        let mut observed = self.observe(game, threads, &originals, Replay::new, progress)?;
        let mut masks_of_seen = self.masks_of_seen(game, threads, &originals)?;
        let (mut episodes, mut masks) = (Vec::new(), Vec::<Option<Vec<bool>>>::new());
        for (i, demo) in self.episodes.iter().enumerate() {
            let mut mask = match masks_of_seen.remove(&i) {
                // An earlier episode is equal.
                None if originals[i] < i => masks[originals[i]].clone(),
                None => Some(Vec::new()),
                Some(mask) => mask,
            };
            let observations = if demo.is_seen {
                progress(demo.episode.len() as u64);
                Observations::Vector(demo.episode.observations.clone())
            } else if let Some(ObservedEpisode { observations, legal, .. }) = observed.remove(&i) {
                mask = Some(legal);
                observations
            } else {
                progress(demo.episode.len() as u64);
                let earlier: &DatasetEpisode = &episodes[originals[i]];
                earlier.observations.clone()
            };
            episodes.push(DatasetEpisode { observations, actions: demo.episode.actions.clone() });
            masks.push(mask);
        }
        let (kind, space) = (self.observation_config.obs_kind(game), game.actions());
        for ((demo, episode), mask) in self.episodes.iter().zip(&mut episodes).zip(masks.iter_mut()) {
            let start = demo.episode.idle_start();
            leave_out(start, episode, &kind, &space)?;
            if let Some(mask) = mask {
                mask.drain(..mask.len().min(start * space.mask_width()));
            }
        }
        let dataset = Dataset::new(kind, space, episodes)?.with_legal(masks)?;
        Ok(dataset.with_levels(self.levels())?)
    }

    /// Returns the memory of the pictures, and of the states if those are predicted.
    pub fn bytes(&self, game: &dyn Game) -> u64 {
        let numbers = ObservationConfig::default().obs_kind(game).numbers() as u64;
        let states = if self.with_states { self.steps() * numbers * size_of::<f32>() as u64 } else { 0 };
        self.picture_bytes() + states
    }

    /// Checks that there is memory for the pictures, before the replay.
    fn check_room(&self, bytes: u64, free: u64) -> Result<(), VerifyError> {
        let (steps, observation_config) = (self.steps(), self.observation_config);
        if bytes > free { Err(VerifyError::TooLarge { steps, observation_config, bytes, free }) } else { Ok(()) }
    }

    /// Returns for each episode the index of the first one of the same level.
    fn levels(&self) -> Vec<usize> {
        let mut first = BTreeMap::new();
        self.episodes.iter().enumerate().map(|(i, demo)| *first.entry(demo.level()).or_insert(i)).collect()
    }

    /// Returns for each episode the index of the first one that is equal from start to end.
    pub fn originals(&self) -> Vec<usize> {
        let mut first = BTreeMap::new();
        let key = |demo: &Demonstration| (demo.level(), bits(&demo.episode.actions));
        self.episodes.iter().enumerate().map(|(i, demo)| *first.entry(key(demo)).or_insert(i)).collect()
    }

    /// Returns the episodes with their rewards, as rollouts of one environment each, for algorithms that learn from
    /// recordings beside their own play. Every episode is replayed, and its
    /// rewards are those of the current game. Recordings with no rewards or older ones serve as well, if the game still
    /// reaches the recorded states. The last step of an episode that the rules did not end is left out, since its
    /// outcome was not recorded.
    ///
    /// # Errors
    ///
    /// [`VerifyError`] if an episode does not replay, since its rewards are then unknown.
    pub fn rollouts(
        mut self,
        game: &dyn Game,
        threads: usize,
        progress: impl Fn(u64) + Sync,
    ) -> Result<Vec<Rollout>, VerifyError> {
        self.episodes.iter_mut().for_each(|demo| demo.is_seen = false);
        let originals = self.originals();
        let observed =
            self.observe(game, threads, &originals, |episode| Replay::new(episode).paid_anew(), &progress)?;
        let kind = self.observation_config.obs_kind(game);
        let mut rollouts = Vec::new();
        for (demo, original) in self.episodes.iter().zip(originals) {
            if let Some(observed) = observed.get(&original) {
                rollouts.extend(rollout(&demo.episode, observed, &kind, &game.actions())?);
            }
        }
        Ok(rollouts)
    }
}

/// Removes the first steps of an episode.
fn leave_out(
    start: usize,
    episode: &mut DatasetEpisode,
    kind: &ObsKind,
    space: &ActionSpace,
) -> Result<(), LearnError> {
    if start == 0 {
        return Ok(());
    }
    let steps = episode.actions.len();
    let (mut observations, mut actions) = (Observations::empty(kind), Actions::empty(space));
    observations.push(episode.observations.rows(start..steps, kind.numbers()))?;
    actions.extend_rows(&episode.actions, start, steps)?;
    *episode = DatasetEpisode { observations, actions };
    Ok(())
}

/// Returns the steps of an episode with a known outcome, if there are any.
fn rollout(
    episode: &DemoEpisode,
    ObservedEpisode { observations, rewards, legal, .. }: &ObservedEpisode,
    kind: &ObsKind,
    space: &ActionSpace,
) -> Result<Option<Rollout>, LearnError> {
    let is_terminated = matches!(episode.end, DemoEnd::Terminated { .. });
    let steps = episode.len().saturating_sub(usize::from(!is_terminated));
    if steps == 0 {
        return Ok(None);
    }
    let (width, mut actions) = (kind.numbers(), Actions::empty(space));
    actions.extend_rows(&episode.actions, 0, steps)?;
    let mut rollout = Rollout { steps, actions, ..Rollout::new(1, *kind, 0, space) };
    rollout.obs.push(observations.rows(0..steps, width))?;
    rollout.rewards = rewards[..steps].to_vec();
    (rollout.log_probs, rollout.values, rollout.final_values) = (vec![0.0; steps], vec![0.0; steps], vec![0.0; steps]);
    (rollout.terminated, rollout.truncated) = (vec![false; steps], vec![false; steps]);
    rollout.terminated[steps - 1] = is_terminated;
    rollout.next_values = vec![0.0];
    rollout.ends.next_obs.push(observations.row(episode.len() - 1, width))?;
    if !legal.is_empty() {
        let width = space.mask_width();
        let mask_of = |rows: Range<usize>| legal[rows.start * width..rows.end * width].to_vec();
        rollout.legal = mask_of(0..steps);
        rollout.ends.next_legal = mask_of(episode.len() - 1..episode.len());
    }
    Ok(Some(rollout))
}

/// Returns the actions as numbers that can be compared.
fn bits(actions: &Actions) -> Vec<u32> {
    match actions {
        Actions::Discrete(list) => list.clone(),
        Actions::Continuous { values, .. } => values.iter().map(|value| value.to_bits()).collect(),
        Actions::Mixed { options, values, .. } => {
            options.iter().copied().chain(values.iter().map(|value| value.to_bits())).collect()
        }
    }
}

// The selection of recorded episodes to learn from.

impl Demonstrations {
    /// Keeps the episodes that ended at the goal.
    ///
    /// # Errors
    ///
    /// [`VerifyError::NoneWon`] if there are none.
    pub fn won(mut self, path: &Path) -> Result<Self, VerifyError> {
        let episodes = self.episodes.len();
        self.episodes.retain(|demo| demo.episode.is_success());
        if self.episodes.is_empty() {
            return Err(VerifyError::NoneWon { path: path.to_owned(), episodes });
        }
        Ok(self)
    }

    /// Keeps whole episodes of at most `steps` steps together, but at least one episode. They are drawn evenly over the
    /// recordings. The choice is reproducible, and more steps only add episodes.
    pub fn at_most(mut self, steps: u64) -> Self {
        // At random, since recordings repeat the same levels in the same order: every n-th episode might always be on
        // the same level.
        let mut order: Vec<usize> = (0..self.episodes.len()).collect();
        shuffle(&mut order, &mut Streams::new(0).stream("demonstrations", 0));
        let mut sum = 0;
        let kept = order.iter().take_while(|index| {
            sum += self.episodes[**index].episode.len() as u64;
            sum <= steps
        });
        let kept = kept.count().max(1);
        let mut keep = vec![false; self.episodes.len()];
        order.iter().take(kept).for_each(|&index| keep[index] = true);
        let mut keep = keep.into_iter();
        self.episodes.retain(|_| keep.next().unwrap_or(false));
        self
    }

    /// Returns the levels that the demonstrations show, or their demonstrator has learned from. Recordings keep the hashes of files and not their layouts, so the
    /// layouts are those of the files that are still there.
    pub fn seen_levels(&self, game: &dyn Game) -> SeenLevels {
        let (mut levels, mut files) = (BTreeMap::<&str, BTreeSet<u64>>::new(), BTreeSet::new());
        let mut modes_of_files = BTreeSet::<&str>::new();
        for demo in &self.episodes {
            match &demo.episode.level_file {
                Some(file) => {
                    files.insert(file.hash);
                    modes_of_files.insert(&demo.mode);
                }
                None => {
                    levels.entry(&demo.mode).or_default().insert(demo.episode.level_seed);
                }
            }
        }
        let mut layouts = BTreeSet::new();
        for designs in modes_of_files.iter().filter_map(|mode| level_designs(game, mode).ok()) {
            let is_recorded = |level: &u64| designs.hash(*level).is_some_and(|hash| files.contains(&hash));
            layouts.extend((0..designs.count()).filter(is_recorded).filter_map(|level| designs.layout(level)));
        }
        let ranges = levels
            .into_iter()
            .flat_map(|(mode, seeds)| LevelSplit::ranges(mode, &seeds.into_iter().collect::<Vec<_>>()));
        SeenLevels {
            game: game.name().to_owned(),
            levels: ranges.chain(self.learned.iter().cloned()).map(|range| range.to_string()).collect(),
            level_files: files.into_iter().collect(),
            layouts: layouts.into_iter().collect(),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use bevy_playbot::{
        level::LevelFile,
        vision::{ImageOptions, ObservationKind},
    };

    pub(crate) fn all(episodes: impl Iterator<Item = DemoEpisode>) -> Demonstrations {
        let demo = |(index, episode)| Demonstration {
            file: Path::new("a.demo").into(),
            index,
            mode: "plain".into(),
            episode: Arc::new(episode),
            is_seen: false,
        };
        Demonstrations {
            observation_config: ObservationConfig::default(),
            episodes: episodes.enumerate().map(demo).collect(),
            with_states: false,
            learned: Vec::new(),
        }
    }

    #[test]
    fn levels_from_files_are_distinguished_by_what_is_in_them() {
        // Each recording counts its files from 0.
        let levels = [(0, None), (1, None), (0, None), (0, Some(5)), (0, Some(6)), (3, Some(5))];
        let demos = all(levels.into_iter().map(|(seed, hash)| DemoEpisode {
            level_file: hash.map(|hash| LevelFile { path: "a.json".to_owned(), hash }),
            ..DemoEpisode::new(seed, ActionSpace::Discrete(2))
        }));
        assert_eq!(demos.levels(), [0, 1, 0, 3, 4, 3]);
        assert_eq!(demos.originals(), [0, 1, 0, 3, 4, 3], "all of them were left before their first action");
    }

    #[test]
    fn steps_that_are_left_out_take_their_observations_along() {
        let (kind, space) = (ObsKind::Vector(2), ActionSpace::Discrete(3));
        let whole = DatasetEpisode {
            observations: Observations::Vector(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
            actions: Actions::Discrete(vec![0, 0, 2]),
        };
        let mut episode = whole.clone();
        leave_out(0, &mut episode, &kind, &space).expect("fits");
        assert_eq!(episode, whole);
        leave_out(2, &mut episode, &kind, &space).expect("fits");
        let rest =
            DatasetEpisode { observations: Observations::Vector(vec![4.0, 5.0]), actions: Actions::Discrete(vec![2]) };
        assert_eq!(episode, rest);
    }

    #[test]
    fn pictures_that_have_no_room_are_refused() {
        let episode = DemoEpisode { state_hashes: vec![0; 10], ..DemoEpisode::new(0, ActionSpace::Discrete(2)) };
        let image = ImageOptions { width: 1024, height: 1024, stack: 16, ..ImageOptions::default() };
        let observation_config = ObservationConfig { kind: ObservationKind::Raster, image };
        let demos = Demonstrations { observation_config, ..all(std::iter::once(episode)) };
        let bytes = demos.picture_bytes();
        assert_eq!(bytes, (10 * 48) << 20);
        assert!(demos.check_room(bytes, bytes).is_ok());
        let error = demos.check_room(bytes, bytes - 1).expect_err("too large").to_string();
        for words in ["0.5 GiB", "`demo_steps`", "1024×1024 colour pictures of the raster, 16 in a stack"] {
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn lost_episodes_are_left_out_where_only_won_ones_are_wanted() {
        let ended = |ends: &[DemoEnd]| {
            all(ends.iter().map(|&end| DemoEpisode { end, ..DemoEpisode::new(0, ActionSpace::Discrete(2)) }))
        };
        let (won, lost) = (DemoEnd::Terminated { success: true }, DemoEnd::Terminated { success: false });
        let path = Path::new("a.demo");
        let kept = ended(&[lost, won, DemoEnd::Truncated, won, DemoEnd::Aborted]).won(path).expect("two are won");
        assert_eq!(kept.episodes.iter().map(|demo| demo.index).collect::<Vec<_>>(), [1, 3]);
        let error = ended(&[lost, DemoEnd::Truncated]).won(path).expect_err("none is won").to_string();
        assert!(error.contains("a.demo: none of the 2 recorded episodes"), "{error}");
    }

    #[test]
    fn what_is_kept_is_drawn_from_all_episodes_and_levels() {
        let all = || {
            all((0..80).map(|index| DemoEpisode {
                state_hashes: vec![0; 10],
                ..DemoEpisode::new(index % 8, ActionSpace::Discrete(2))
            }))
        };
        let kept = |steps| all().at_most(steps).episodes.iter().map(|demo| demo.index).collect::<Vec<_>>();
        let part = kept(209);
        assert_eq!(part.len(), 20);
        let early = part.iter().filter(|index| **index < 40).count();
        assert!((3..=17).contains(&early), "{part:?}");
        let levels: std::collections::BTreeSet<usize> = part.iter().map(|index| index % 8).collect();
        assert!(levels.len() >= 5, "levels follow one another in a rhythm of 8, of which {levels:?} are kept");
        assert!(kept(150).iter().all(|index| part.contains(index)), "fewer steps are a part of more");
        assert_eq!((kept(1).len(), kept(800).len(), kept(u64::MAX).len()), (1, 80, 80));
    }
}
