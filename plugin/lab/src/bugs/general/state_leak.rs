//! State that leaks from one episode into the next.

use super::{
    action_changes::change_actions,
    moves::Moves,
    when::{When, one_of},
};
use crate::defect::DefectKind;

/// The effect of the leaked state.
#[derive(Clone, Copy, Debug)]
enum Effect {
    /// The n-th of the actions that matter does nothing.
    Dead(usize),
    /// Actions take effect this many ticks later.
    Delay(usize),
}

/// The first episode of a World with an effect, and the effect.
const VARIANTS: [(u32, Effect); 4] =
    [(2, Effect::Dead(0)), (2, Effect::Delay(3)), (3, Effect::Delay(6)), (4, Effect::Dead(1))];

/// Leaves the first episodes of a World unmutated, and changes later ones.
pub(super) fn state_leak(moves: &Moves) -> DefectKind {
    let moves = moves.clone();
    let about = "a World keeps something from one episode to the next: an action stops working, or comes late";
    DefectKind::rules("state-leak", about, VARIANTS.len() as u32, move |app, variant| {
        let (moves, (episode, effect)) = (moves.clone(), one_of(&VARIANTS, variant));
        let when = When::Later { episode, tick: 0 };
        change_actions(app, move |doing| {
            if !when.is_now(doing.history, doing.episode) {
                return None;
            }
            match effect {
                Effect::Dead(which) => moves.without(which, doing.action),
                Effect::Delay(ticks) => Some(doing.history.done(ticks).cloned().unwrap_or_else(|| moves.idle())),
            }
        });
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::general::testing::{Track, play};

    #[test]
    fn the_first_episodes_are_sound_and_later_ones_are_not() {
        let kind = state_leak(&Moves::of(&Track));
        let stuck = play(&kind, 0, 70, |_| 1);
        assert_eq!((stuck.episodes.as_slice(), stuck.place), (&[(true, 30)][..], 0));
        assert_eq!(play(&kind, 1, 70, |_| 1).episodes, [(true, 30), (true, 33)]);
        assert_eq!(play(&kind, 2, 100, |_| 1).episodes, [(true, 30), (true, 30), (true, 36)]);
        assert_eq!(play(&kind, 3, 120, |_| 1).episodes.len(), 4, "nobody needs the way back");
    }
}
