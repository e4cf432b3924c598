//! Entities that are never removed.

use bevy::prelude::*;
use bevy_playbot::{
    control::Control,
    episode::Episode,
    placement::{TickSchedules, is_tick},
    systems::PlaybotSystems,
};

use super::{
    history::{History, remember},
    when::one_of,
};
use crate::defect::DefectKind;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::general::testing::play;

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
}
