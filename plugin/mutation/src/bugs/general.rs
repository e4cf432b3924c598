//! Defects of rules that can be planted into any game, through the plugin's components of agents: episode, action,
//! reward and observation.
//!
//! The folder, in reading order:
//!
//! - `history`: the actions of an agent so far, on which defects depend.
//! - `actions`: games that receive other actions than their agents decided on, and games that stand still.
//! - `rewards`: episodes that end without a reason, and rewards that can be collected without end.
//! - `leaks`: entities that are never removed, and state that leaks into the next episode.
//! - `breakage`: games that panic or log errors, and values that are not numbers.

mod actions;
mod breakage;
mod history;
mod leaks;
mod rewards;
#[cfg(test)]
pub(crate) mod testing;

use crate::bugs::general::{
    actions::{Moves, change_actions, dead_action, frozen_world},
    breakage::{error_log, nan, panic},
    history::History,
    leaks::{entity_leak, state_leak},
    rewards::{ends_by_itself, reward_farm, short_time_out},
};
use bevy_playbot::{bot::uniform, episode::Episode};
use playbot_harness::{defect::DefectKind, game::Game};
use playbot_learner::{Streams, rng::unit};
use std::hash::{BuildHasher, Hasher, RandomState};

/// Returns the defects that can be planted into this game as into any other.
pub fn general_defects(game: &dyn Game) -> Vec<DefectKind> {
    let moves = Moves::of(game);
    let mut kinds = vec![
        ends_by_itself(),
        short_time_out(),
        reward_farm(&moves),
        unseeded_randomness(),
        state_leak(&moves),
        panic(),
        error_log(),
        nan(),
        frozen_world(),
        dead_action(&moves),
    ];
    // A World that is rebuilt has lost the leaked state.
    if game.built_anew().is_none() {
        kinds.push(entity_leak());
    }
    kinds
}

/// The moment of an episode from which a defect shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum When {
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
    const DEFAULTS: [Self; 4] = [Self::Tick(25), Self::Held(7), Self::Later { episode: 2, tick: 10 }, Self::Tick(60)];

    /// The number of default moments, [`DEFAULTS`](Self::DEFAULTS).
    const VARIANTS: u32 = Self::DEFAULTS.len() as u32;

    /// Returns the moment of a variant.
    fn of(variant: u32) -> Self {
        one_of(&Self::DEFAULTS, variant)
    }

    /// Returns whether the defect shows in this tick of an episode.
    fn is_now(self, history: &History, episode: &Episode) -> bool {
        match self {
            Self::Tick(tick) => episode.tick >= tick,
            Self::Held(ticks) => history.longest() >= ticks,
            Self::Later { episode: number, tick } => history.episodes() >= number && episode.tick >= tick,
        }
    }
}

/// Returns the entry of a variant.
fn one_of<T: Copy>(of: &[T], variant: u32) -> T {
    of[variant as usize % of.len()]
}

/// The start of the defect, and the share of actions that are random then.
const VARIANTS: [(When, f64); 4] =
    [(When::Tick(0), 0.1), (When::Tick(25), 0.3), (When::Held(7), 0.5), (When::Tick(60), 0.05)];

/// Replaces some actions by random ones, different ones each time.
fn unseeded_randomness() -> DefectKind {
    let about = "some actions are replaced by random ones, drawn from a generator without a seed";
    DefectKind::rules("unseeded-randomness", about, VARIANTS.len() as u32, |app, variant| {
        let (when, share) = one_of(&VARIANTS, variant);
        // The keys of hashers are the system's own randomness: nothing may be reproducible here.
        let seed = RandomState::new().build_hasher().finish();
        let mut chance = Streams::new(seed).stream("unseeded", 0);
        change_actions(app, move |doing| {
            let is_random = when.is_now(doing.history, doing.episode) && unit(&mut chance) < share;
            is_random.then(|| uniform(doing.space, &mut chance))
        });
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use bevy_playbot::action::ActionValue;
    use playbot_harness::defect::Plant;

    use super::*;
    use crate::bugs::general::testing::{Track, play, play_sound};

    #[test]
    fn each_general_defect_has_a_class_of_its_own_and_three_variants_or_more() {
        let kinds = general_defects(&Track);
        let classes: BTreeSet<_> = kinds.iter().map(|kind| kind.class).collect();
        assert_eq!((classes.len(), kinds.len()), (11, 11));
        for kind in kinds {
            assert!(kind.class.chars().all(|letter| letter.is_ascii_lowercase() || letter == '-'), "{}", kind.class);
            assert!(matches!(kind.plant, Plant::Rules { variants: 3.., .. }), "{kind:?}");
        }
    }

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

    #[test]
    fn the_same_actions_lead_elsewhere_each_time() {
        let back_and_forth = |tick: u32| 1 + tick / 8 % 2;
        assert_eq!(play_sound(200, back_and_forth).places, play_sound(200, back_and_forth).places);
        for variant in 0..VARIANTS.len() as u32 {
            let one = play(&unseeded_randomness(), variant, 200, back_and_forth).places;
            // Two equal runs may be chance, four may not.
            let differs = (0..4).any(|_| play(&unseeded_randomness(), variant, 200, back_and_forth).places != one);
            assert!(differs, "variant {variant}");
        }
    }
}
