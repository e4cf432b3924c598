//! Windows cut from demonstrations.

use super::Dataset;
use crate::LearnError;
use crate::rng::{Streams, below, shuffle};
use serde::{Deserialize, Serialize};

/// The rule by which windows are cut.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum WindowRule {
    /// Each episode is cut into consecutive windows from a random first step, anew and in a new order in every epoch,
    /// so that an epoch shows nearly every step once. No window crosses the end of an episode.
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
        let steps = self.steps();
        let Some(slack) = steps.checked_sub(window).filter(|_| window > 0) else { return Vec::new() };
        let mut rng = streams.stream("skill.windows", 0);
        // The step at which each episode begins, all of them laid end to end.
        let begins: Vec<usize> = self
            .lengths()
            .scan(0, |sum, len| {
                *sum += len;
                Some(*sum - len)
            })
            .collect();
        let starts = (0..steps / window).map(|_| below(&mut rng, slack as u64 + 1) as usize);
        starts
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
mod tests {
    use super::super::dataset::tests::dataset;
    use super::*;
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
