//! Entities that are never removed.

use crate::bugs::general::{
    When,
    actions::{Moves, change_actions},
    history::{History, remember},
    one_of,
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    engine::{TickSchedules, is_tick},
    episode::Episode,
    systems::PlaybotSystems,
};
use playbot_harness::defect::DefectKind;

/// The moments at which entities are left behind.
#[derive(Clone, Copy, Debug)]
enum Leak {
    /// At the start of an episode, from this episode of a World on: this many.
    Start(u32, u32),
    /// One entity in each tick.
    Tick,
    /// One entity whenever the agent changes its action.
    Change,
}

const VARIANTS: [Leak; 4] = [Leak::Start(1, 8), Leak::Tick, Leak::Change, Leak::Start(3, 1)];

impl Leak {
    /// Returns the number of entities in this tick.
    fn count(self, episode: &Episode, history: &History) -> u32 {
        match self {
            Self::Start(first, count) if episode.tick == 0 && history.episodes() >= first => count,
            Self::Start(..) => 0,
            Self::Tick => 1,
            Self::Change => u32::from(history.held() == 1),
        }
    }
}

/// Leaves entities behind in every episode.
pub(super) fn entity_leak() -> DefectKind {
    let about = "entities are left behind in every episode";
    DefectKind::rules("entity-leak", about, VARIANTS.len() as u32, |app, variant| {
        remember(app);
        let leak = one_of(&VARIANTS, variant);
        let leave = move |agents: Query<(&Control, &Episode, &History)>, mut commands: Commands| {
            for (control, episode, history) in &agents {
                if control.is_active() && episode.is_running() {
                    leave_behind(leak.count(episode, history), &mut commands);
                }
            }
        };
        let judge = TickSchedules::of(app).judge;
        app.add_systems(judge, leave.before(PlaybotSystems::Judge).run_if(is_tick));
    })
}

/// Leaves behind systems that are registered and forgotten, as games do that register them at each restart. A restart
/// removes the entities of the game, and these stay.
fn leave_behind(count: u32, commands: &mut Commands) {
    commands.queue(move |world: &mut World| {
        for _ in 0..count {
            world.register_system(nothing);
        }
    });
}

fn nothing() {}

// State that leaks from one episode into the next.

/// The effect of the leaked state.
#[derive(Clone, Copy, Debug)]
enum Effect {
    /// The n-th of the actions that matter does nothing.
    Dead(usize),
    /// Actions take effect this many ticks later.
    Delay(usize),
}

/// The first episode of a World with an effect, and the effect.
const STATE_LEAK_VARIANTS: [(u32, Effect); 4] =
    [(2, Effect::Dead(0)), (2, Effect::Delay(3)), (3, Effect::Delay(6)), (4, Effect::Dead(1))];

/// Leaves the first episodes of a World unmutated, and changes later ones.
pub(super) fn state_leak(moves: &Moves) -> DefectKind {
    let moves = moves.clone();
    let about = "a World keeps something from one episode to the next: an action stops working, or comes late";
    DefectKind::rules("state-leak", about, STATE_LEAK_VARIANTS.len() as u32, move |app, variant| {
        let (moves, (episode, effect)) = (moves.clone(), one_of(&STATE_LEAK_VARIANTS, variant));
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

    /// The entities that the second and the third episode leave behind.
    fn left(variant: u32) -> u32 {
        let entities = |ticks| play(&entity_leak(), variant, ticks, |_| 1).entities;
        entities(90) - entities(30)
    }

    #[test]
    fn entities_pile_up() {
        assert_eq!(left(0), 2 * 8);
        assert_eq!(left(1), 60);
        assert_eq!(left(2), 2, "an episode begins with something else");
        assert_eq!(left(3), 1, "from the third episode on");
    }

    #[test]
    fn the_first_episodes_are_sound_and_later_ones_are_not() {
        let kind = state_leak(&Moves::of(&Track));
        let stuck = play(&kind, 0, 70, |_| 1);
        assert_eq!((stuck.episodes.as_slice(), stuck.place), (&[(true, 30)][..], 0));
        assert_eq!(play(&kind, 1, 70, |_| 1).episodes, [(true, 30), (true, 33)]);
        assert_eq!(play(&kind, 2, 100, |_| 1).episodes, [(true, 30), (true, 30), (true, 36)]);
        assert_eq!(play(&kind, 3, 120, |_| 1).episodes.len(), 4, "the path back is not needed");
    }
}
