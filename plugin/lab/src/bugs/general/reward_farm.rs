//! Rewards that can be collected without end.

use bevy::prelude::*;
use bevy_playbot::{
    control::Control,
    episode::Episode,
    placement::{TickSchedules, is_tick},
    reward::Reward,
    systems::PlaybotSystems,
};

use super::{
    history::{History, remember},
    moves::Moves,
    when::one_of,
};
use crate::defect::DefectKind;

/// The behaviour that is paid.
#[derive(Clone, Copy, Debug)]
enum Farm {
    /// An action without progress, from this tick on.
    Idling(u32),
    /// Going back to the action before the last tick.
    GoingBack,
    /// Holding an action, paid once every this many ticks.
    Holding(u32),
}

/// The behaviour that is paid, and its reward.
const VARIANTS: [(Farm, f32); 4] =
    [(Farm::Idling(0), 1.0), (Farm::GoingBack, 1.0), (Farm::Holding(7), 0.5), (Farm::Idling(60), 1.0)];

/// Makes an action pay again and again, with no other effect.
pub(super) fn reward_farm(moves: &Moves) -> DefectKind {
    let moves = moves.clone();
    let about = "an action pays again and again, though it leads nowhere";
    DefectKind::rules("reward-farm", about, VARIANTS.len() as u32, move |app, variant| {
        remember(app);
        let (moves, (farm, amount)) = (moves.clone(), one_of(&VARIANTS, variant));
        let pay = move |mut agents: Query<(&Control, &Episode, &History, &mut Reward)>| {
            for (control, episode, history, mut reward) in &mut agents {
                if control.is_active() && episode.is_running() && pays(farm, &moves, episode, history) {
                    reward.add(amount);
                }
            }
        };
        let judge = TickSchedules::of(app).judge;
        app.add_systems(judge, pay.before(PlaybotSystems::Judge).run_if(is_tick));
    })
}

fn pays(farm: Farm, moves: &Moves, episode: &Episode, history: &History) -> bool {
    match farm {
        Farm::Idling(tick) => episode.tick >= tick && history.done(0).is_some_and(|action| moves.is_farming(action)),
        Farm::GoingBack => history.went_back(),
        Farm::Holding(ticks) => history.held() > 0 && history.held().is_multiple_of(ticks),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::general::testing::{Track, play, play_sound};

    #[test]
    fn what_leads_nowhere_pays() {
        let kind = reward_farm(&Moves::of(&Track));
        assert_eq!(play_sound(20, |_| 0).reward, 0.0);
        assert_eq!(play(&kind, 0, 20, |_| 0).reward, 20.0);
        assert_eq!(play(&kind, 0, 20, |_| 1).reward, 0.0);
        assert_eq!(play(&kind, 1, 20, |tick| 1 + tick % 2).reward, 18.0, "from the third tick on");
        assert_eq!(play(&kind, 1, 20, |_| 1).reward, 0.0);
        assert_eq!(play(&kind, 2, 20, |_| 2).reward, 1.0, "in the 7th and in the 14th tick");
        assert_eq!(play(&kind, 3, 70, |_| 0).reward, 10.0);
    }
}
