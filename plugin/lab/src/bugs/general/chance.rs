//! Randomness without a seed.

use std::hash::{BuildHasher, Hasher, RandomState};

use bevy_playbot::bot::uniform;
use playbot_learner::{Streams, rng::unit};

use super::{
    action_changes::change_actions,
    when::{When, one_of},
};
use crate::defect::DefectKind;

/// The start of the defect, and the share of actions that are random then.
const VARIANTS: [(When, f64); 4] =
    [(When::Tick(0), 0.1), (When::Tick(25), 0.3), (When::Held(7), 0.5), (When::Tick(60), 0.05)];

/// Replaces some actions by random ones, different ones each time.
pub(super) fn unseeded_randomness() -> DefectKind {
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
    use super::*;
    use crate::bugs::general::testing::{play, play_sound};

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
