//! The defects that can be planted into a game.

use super::general::general_defects;
use crate::{defect::DefectKind, game::Game};

/// Returns the game's own defects, and the general ones. A class of the game's own replaces a general one.
pub fn defect_kinds(game: &dyn Game) -> Vec<DefectKind> {
    let mut kinds = game.tools().tests.defects();
    let is_own = |class: &str| kinds.iter().any(|kind| kind.class == class);
    let general: Vec<_> = general_defects(game).into_iter().filter(|kind| !is_own(kind.class)).collect();
    kinds.extend(general);
    kinds
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;

    use super::*;
    use crate::foreign::ForeignGame;

    #[test]
    fn an_own_class_takes_the_place_of_a_general_one() {
        let game = ForeignGame::new("ball", 1, |_: &mut App| {})
            .defect(DefectKind::rules("sticky-floor", "the ball sticks", 1, |_, _| {}))
            .defect(DefectKind::rules("panic", "the ball bursts", 2, |_, _| {}));
        let kinds = defect_kinds(&game);
        assert_eq!((kinds[0].class, kinds[1].about), ("sticky-floor", "the ball bursts"));
        assert_eq!(kinds.iter().filter(|kind| kind.class == "panic").count(), 1);
        assert_eq!(kinds.len(), general_defects(&game).len() + 1);
    }
}
