//! The moments at which a planted defect shows.

use bevy_playbot::episode::Episode;

use super::history::History;

/// The moment of an episode from which a defect shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum When {
    /// From this tick on, counted from 0.
    Tick(u32),
    /// Once the agent has held one action for this many ticks.
    Held(u32),
    /// In this episode of an agent in its World, counted from 1, and in all later ones, from this tick on.
    Later {
        /// The episode.
        episode: u32,
        /// The tick.
        tick: u32,
    },
}

impl When {
    /// The default moments: early, after an action was held, in later episodes, and late.
    pub(super) const USUAL: [Self; 4] =
        [Self::Tick(25), Self::Held(7), Self::Later { episode: 2, tick: 10 }, Self::Tick(60)];

    /// The number of default moments, [`USUAL`](Self::USUAL).
    pub(super) const VARIANTS: u32 = Self::USUAL.len() as u32;

    /// Returns the moment of a variant.
    pub(super) fn of(variant: u32) -> Self {
        one_of(&Self::USUAL, variant)
    }

    /// Returns whether the defect shows in this tick of an episode.
    pub(super) fn is_now(self, history: &History, episode: &Episode) -> bool {
        match self {
            Self::Tick(tick) => episode.tick >= tick,
            Self::Held(ticks) => history.longest() >= ticks,
            Self::Later { episode: number, tick } => history.episodes() >= number && episode.tick >= tick,
        }
    }
}

/// Returns the entry of a variant.
pub(super) fn one_of<T: Copy>(of: &[T], variant: u32) -> T {
    of[variant as usize % of.len()]
}

#[cfg(test)]
mod tests {
    use bevy_playbot::action::ActionValue;

    use super::*;

    #[test]
    fn a_moment_comes_by_the_tick_by_what_was_held_or_by_the_episode() {
        let mut history = History::default();
        let at = |tick| {
            let mut episode = Episode::default();
            episode.tick = tick;
            episode
        };
        history.begin();
        assert!(!When::Tick(3).is_now(&history, &at(2)) && When::Tick(3).is_now(&history, &at(3)));
        for action in [1, 1, 2, 2, 2, 1] {
            history.note(&ActionValue::Discrete(action));
        }
        assert!(When::Held(3).is_now(&history, &at(0)), "it was held once");
        assert!(!When::Held(4).is_now(&history, &at(0)));
        let later = When::Later { episode: 2, tick: 5 };
        assert!(!later.is_now(&history, &at(9)));
        history.begin();
        assert!(later.is_now(&history, &at(5)) && !later.is_now(&history, &at(4)));
        assert!(!When::Held(3).is_now(&history, &at(0)), "an episode begins with nothing held");
    }
}
