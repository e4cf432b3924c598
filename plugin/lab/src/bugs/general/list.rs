//! All general defects.

use super::{
    breakage::{error_log, panic},
    chance::unseeded_randomness,
    dead_action::dead_action,
    endings::{ends_by_itself, short_time_out},
    entity_leak::entity_leak,
    frozen::frozen_world,
    moves::Moves,
    not_a_number::nan,
    reward_farm::reward_farm,
    state_leak::state_leak,
};
use crate::{defect::DefectKind, game::Game};

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

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::{bugs::general::testing::Track, defect::Plant};

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
}
