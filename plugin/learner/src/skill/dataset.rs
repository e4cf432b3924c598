//! Demonstrations, and the windows cut from them.

use crate::rng::{Streams, below, shuffle};
use crate::{ActionSpace, Actions, LearnError};

/// One recorded episode.
#[derive(Clone, Debug, PartialEq)]
pub struct DemoEpisode {
    /// One observation per step, `len * obs_dim`.
    pub observations: Vec<f32>,
    /// The action taken at each observation, `len`.
    pub actions: Actions,
}

/// Demonstrations of one game.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    pub(crate) obs_dim: usize,
    pub(crate) space: ActionSpace,
    pub(crate) episodes: Vec<DemoEpisode>,
}

/// A stretch of one episode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Number of the episode.
    pub episode: usize,
    /// Its first step.
    pub start: usize,
}

impl Dataset {
    /// Checks and keeps `episodes`.
    ///
    /// # Errors
    /// [`LearnError::Shape`] if an episode's observations do not match its actions, [`LearnError::Action`] if an
    /// action is outside `space`, [`LearnError::NotFinite`] if an observation is.
    pub fn new(obs_dim: usize, space: ActionSpace, episodes: Vec<DemoEpisode>) -> Result<Self, LearnError> {
        if obs_dim == 0 || space.dim() == 0 {
            return Err(LearnError::Config("observations and actions must not be empty".to_owned()));
        }
        for (i, episode) in episodes.iter().enumerate() {
            let expected = episode.actions.len() * obs_dim;
            LearnError::check(&format!("observations of episode {i}"), expected, episode.observations.len())?;
            space.check(&episode.actions)?;
            if episode.observations.iter().any(|x| !x.is_finite()) {
                return Err(LearnError::NotFinite { tensor: format!("observations of episode {i}"), steps: 0 });
            }
        }
        Ok(Self { obs_dim, space, episodes })
    }

    /// Width of an observation.
    pub fn obs_dim(&self) -> usize {
        self.obs_dim
    }

    /// The space of the actions.
    pub fn action_space(&self) -> ActionSpace {
        self.space
    }

    /// Number of episodes.
    pub fn episodes(&self) -> usize {
        self.episodes.len()
    }

    /// Steps in all episodes together.
    pub fn steps(&self) -> usize {
        self.episodes.iter().map(|episode| episode.actions.len()).sum()
    }

    /// The windows of one epoch, in random order.
    ///
    /// Each episode is cut into consecutive windows from a random first step, anew in every epoch, so that an epoch
    /// shows nearly every step once. No window crosses the end of an episode.
    ///
    /// # Errors
    /// [`LearnError::NoWindow`] if every episode is shorter than `window`.
    pub fn windows(&self, window: usize, streams: &Streams, epoch: u64) -> Result<Vec<Window>, LearnError> {
        let mut rng = streams.stream("skill.windows", epoch);
        let mut windows = Vec::new();
        for (i, episode) in self.episodes.iter().enumerate() {
            let len = episode.actions.len();
            let Some(slack) = len.checked_sub(window).filter(|_| window > 0) else { continue };
            let first = below(&mut rng, slack.min(window - 1) as u64 + 1) as usize;
            let starts = (first..=slack).step_by(window);
            windows.extend(starts.map(|start| Window { episode: i, start }));
        }
        if windows.is_empty() {
            let longest = self.episodes.iter().map(|episode| episode.actions.len()).max();
            return Err(LearnError::NoWindow { window, longest: longest.unwrap_or(0) });
        }
        shuffle(&mut windows, &mut rng);
        Ok(windows)
    }

    /// Observations and actions of `windows`, time-major: row `t * windows + b`.
    pub(crate) fn gather(&self, windows: &[Window], steps: usize) -> Result<(Vec<f32>, Actions), LearnError> {
        let mut observations = Vec::with_capacity(windows.len() * steps * self.obs_dim);
        let mut actions = Actions::empty(&self.space);
        for t in 0..steps {
            for window in windows {
                let episode = &self.episodes[window.episode];
                let row = window.start + t;
                let range = row * self.obs_dim..(row + 1) * self.obs_dim;
                observations.extend_from_slice(&episode.observations[range]);
                actions.extend_rows(&episode.actions, row, row + 1)?;
            }
        }
        Ok((observations, actions))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dataset(lengths: &[usize]) -> Dataset {
        let episodes = lengths
            .iter()
            .map(|&len| DemoEpisode {
                observations: (0..len).map(|t| t as f32).collect(),
                actions: Actions::Discrete(vec![0; len]),
            })
            .collect();
        Dataset::new(1, ActionSpace::Discrete(2), episodes).expect("consistent episodes")
    }

    #[test]
    fn windows_stay_inside_episodes_and_change_with_the_epoch() {
        let data = dataset(&[37, 4, 10, 25]);
        let streams = Streams::new(1);
        let first = data.windows(10, &streams, 0).expect("some fit");
        for epoch in 0..20 {
            let windows = data.windows(10, &streams, epoch).expect("some fit");
            assert!(windows.iter().all(|w| w.episode != 1));
            assert!(windows.iter().any(|w| w.episode == 2));
            for w in &windows {
                assert!(w.start + 10 <= data.episodes[w.episode].actions.len());
            }
            assert_eq!(windows, data.windows(10, &streams, epoch).expect("some fit"));
        }
        assert_ne!(first, data.windows(10, &streams, 1).expect("some fit"));
    }

    #[test]
    fn too_short_episodes_are_an_error() {
        let error = dataset(&[3, 9]).windows(10, &Streams::new(1), 0).expect_err("none fits");
        assert!(matches!(error, LearnError::NoWindow { window: 10, longest: 9 }));
    }

    #[test]
    fn bad_demonstrations_are_refused() {
        let episode =
            |n: usize, a: u32| DemoEpisode { observations: vec![0.0; n], actions: Actions::Discrete(vec![a; 3]) };
        let new = |e| Dataset::new(2, ActionSpace::Discrete(2), vec![e]);
        assert!(new(episode(6, 1)).is_ok());
        assert!(matches!(new(episode(5, 1)), Err(LearnError::Shape { .. })));
        assert!(matches!(new(episode(6, 2)), Err(LearnError::Action(_))));
    }
}
