//! An action that does nothing.

use super::{
    action_changes::change_actions,
    moves::Moves,
    when::{When, one_of},
};
use crate::defect::DefectKind;

/// The start of the defect, and the index of the dead action among those that matter.
const VARIANTS: [(When, usize); 5] =
    [(When::Tick(0), 0), (When::Tick(25), 0), (When::Held(7), 0), (When::Tick(0), 1), (When::Tick(0), 2)];

/// Makes one action do nothing.
pub(super) fn dead_action(moves: &Moves) -> DefectKind {
    let moves = moves.clone();
    DefectKind::rules("dead-action", "one action does nothing", VARIANTS.len() as u32, move |app, variant| {
        let (moves, (when, which)) = (moves.clone(), one_of(&VARIANTS, variant));
        change_actions(app, move |doing| {
            when.is_now(doing.history, doing.episode).then(|| moves.without(which, doing.action)).flatten()
        });
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::general::testing::{Track, play, play_sound};

    #[test]
    fn an_agent_that_needs_the_action_does_not_get_on_but_is_recorded_as_it_decided() {
        let kind = dead_action(&Moves::of(&Track));
        let sound = play_sound(40, |_| 1);
        assert_eq!(sound.episodes, [(true, 30)]);
        for (variant, place) in [(0, 0), (1, 25), (2, 6)] {
            let played = play(&kind, variant, 40, |_| 1);
            assert_eq!((played.place, played.episodes.len()), (place, 0), "variant {variant}");
            assert!(played.actions.iter().all(|action| *action == 1));
        }
        assert_eq!(play(&kind, 3, 40, |_| 1).episodes, [(true, 30)], "another action is dead");
    }
}
