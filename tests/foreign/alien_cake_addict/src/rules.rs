//! Detector of the game's rules for its cakes. Playing needs none of it.

use bevy::math::UVec2;
use playbot::harness::{
    detector::{DetectorTick, EachTick},
    foreign::ForeignGame,
};

use crate::defects;

/// Adds the detector and the possible defects to the game.
pub fn add_to(game: ForeignGame) -> ForeignGame {
    defects::add_to(game).detector(|| {
        EachTick::new(
            "cake-rules",
            "a cake is eaten by a player that did not walk onto it, or not by one that did",
            broken_rule,
        )
    })
}

fn broken_rule(moment: &DetectorTick<'_>) -> Option<String> {
    let at = moment.position?.as_uvec2();
    // The observation before the tick, in tens: see the adapter.
    let &[i, j, cake_i, cake_j, cakes] = moment.observation else { return None };
    let field = |i: f32, j: f32| UVec2::new((10.0 * i).round() as u32, (10.0 * j).round() as u32);
    let has_walked = field(i, j) != at;
    let is_cake_here = cakes > 0.0 && field(cake_i, cake_j) == at;
    match (has_walked && is_cake_here, moment.reward > 0.0) {
        (true, false) => Some(format!("a player walks onto the cake at {at}, and it does not count")),
        (false, true) => Some(format!("a cake counts at {at}, and no player has walked onto one")),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::*;
    use playbot::prelude::ActionValue;

    use super::*;

    /// Returns the message about a player observed at the first position and now at the second one, with a cake at the
    /// third, and so many cakes eaten.
    fn said(before: [f32; 2], now: [f32; 2], cake: Option<[f32; 2]>, reward: f32) -> Option<String> {
        let (world, action) = (World::new(), ActionValue::Discrete(0));
        let ([i, j], [cake_i, cake_j]) = (before, cake.unwrap_or([0.0; 2]));
        let seen = [i, j, cake_i, cake_j, f32::from(u8::from(cake.is_some()))].map(|number| number / 10.0);
        let position = Some(Vec2::from_array(now));
        broken_rule(&DetectorTick { observation: &seen, reward, position, ..DetectorTick::of(&world, &action) })
    }

    #[test]
    fn a_cake_counts_only_for_the_player_that_walks_onto_it() {
        let (here, there) = ([7.0, 10.0], [8.0, 10.0]);
        let is_broken = |before, now, cake, reward| said(before, now, cake, reward).is_some();
        assert!(!is_broken(here, there, Some(there), 1.0) && !is_broken(here, there, Some(here), 0.0));
        assert!(!is_broken(here, here, None, 0.0) && !is_broken(here, there, None, 0.0));
        assert!(is_broken(here, there, Some(there), 0.0), "it is not counted");
        assert!(is_broken(here, here, Some(there), 1.0), "it is eaten from afar");
        assert!(is_broken(here, here, Some(here), 1.0), "it came along");
        assert!(is_broken(here, there, None, 1.0), "there was none");
    }
}
