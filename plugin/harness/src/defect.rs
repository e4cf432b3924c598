//! The kinds of planted defects: see `playbot_mutation::bugs`.

use bevy::prelude::*;
use playbot_learner::rng::ChaCha8Rng;
use std::{fmt, sync::Arc};

/// Turns the text of an unmutated level into a broken one; `None` if this level has no place for the defect.
pub type ChangeLevel = dyn Fn(&str, &mut ChaCha8Rng) -> Option<String> + Send + Sync;

/// Breaks the rules of a game that has been built into this app, in one of the defect's variants.
pub type ChangeRules = dyn Fn(&mut App, u32) + Send + Sync;

/// A kind of defect that can be planted into a game.
#[derive(Clone)]
pub struct DefectKind {
    /// Its class, in small letters and hyphens: `walled-goal`.
    pub class: &'static str,
    /// The defect, in one line.
    pub about: &'static str,
    /// Its change of a level or of the rules.
    pub plant: Plant,
}

/// The change that plants a defect.
#[derive(Clone)]
pub enum Plant {
    /// Changes a level: takes the JSON text of an unmutated level, as `playbot level GAME --json` prints it, and a
    /// random stream. Returns the changed text, or `None` if this level has no place for the defect.
    Level(Arc<ChangeLevel>),
    /// Changes the rules of a game, after the game's own [`build`](crate::game::Game::build).
    Rules {
        /// Number of variants, from 0. They differ in strength, in time, or in distance from the start.
        variants: u32,
        /// Plants one of them.
        plant: Arc<ChangeRules>,
    },
}

impl DefectKind {
    /// Creates a defect of levels: see [`Plant::Level`].
    pub fn level(
        class: &'static str,
        about: &'static str,
        change: impl Fn(&str, &mut ChaCha8Rng) -> Option<String> + Send + Sync + 'static,
    ) -> Self {
        Self { class, about, plant: Plant::Level(Arc::new(change)) }
    }

    /// Creates a defect of rules: see [`Plant::Rules`].
    pub fn rules(
        class: &'static str,
        about: &'static str,
        variants: u32,
        plant: impl Fn(&mut App, u32) + Send + Sync + 'static,
    ) -> Self {
        Self { class, about, plant: Plant::Rules { variants, plant: Arc::new(plant) } }
    }
}

impl fmt::Debug for DefectKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let how = match &self.plant {
            Plant::Level(_) => "level".to_owned(),
            Plant::Rules { variants, .. } => format!("rules, {variants} variants"),
        };
        f.debug_struct("DefectKind").field("class", &self.class).field("plant", &how).finish_non_exhaustive()
    }
}

// Variants: first positions along the path, then strengths. So testers that get further find more.

/// Places: at the start, further on and late.
pub const PLACES: u32 = 3;

/// Returns the place of a variant, from 0.
pub fn place(variant: u32) -> usize {
    (variant % PLACES) as usize
}

/// Returns the strength of a variant.
pub fn pick<T: Copy>(strengths: &[T], variant: u32) -> T {
    strengths[(variant / PLACES) as usize % strengths.len()]
}

/// Returns the number of variants of a defect with so many strengths.
pub const fn variants(strengths: usize) -> u32 {
    PLACES * strengths as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_go_through_the_places_and_then_through_the_strengths() {
        assert_eq!((0..6).map(place).collect::<Vec<_>>(), [0, 1, 2, 0, 1, 2]);
        assert_eq!((variants(2), [2, 3].map(|variant| pick(&['a', 'b'], variant))), (6, ['a', 'b']));
    }
}
