//! Episodes that end without a reason.

use crate::bugs::general::{
    When,
    actions::Moves,
    history::{History, remember},
    one_of,
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    engine::{TickSchedules, is_tick},
    episode::{Episode, EpisodeEnd},
    reward::Reward,
    systems::PlaybotSystems,
};
use playbot_harness::defect::DefectKind;

/// Loses the episode without a reason.
pub(super) fn ends_by_itself() -> DefectKind {
    let about = "the episode is lost all of a sudden, though nothing has happened to the agent";
    DefectKind::rules("ends-by-itself", about, When::VARIANTS, |app, variant| end(app, variant, EpisodeEnd::LOST))
}

/// Ends the episode by a time limit long before the level can be solved.
pub(super) fn short_time_out() -> DefectKind {
    let about = "time is up long before the level can be done";
    DefectKind::rules("short-time-out", about, When::VARIANTS, |app, variant| end(app, variant, EpisodeEnd::Truncated))
}

fn end(app: &mut App, variant: u32, how: EpisodeEnd) {
    remember(app);
    let when = When::of(variant);
    let end_episodes = move |mut agents: Query<(&Control, &History, &mut Episode)>| {
        for (control, history, mut episode) in &mut agents {
            // An episode that is just won stays won.
            let is_playing = control.is_active() && episode.is_running() && episode.end().is_none();
            if !is_playing || !when.is_now(history, &episode) {
                continue;
            }
            match how {
                EpisodeEnd::Terminated { success } => episode.terminate(success),
                EpisodeEnd::Truncated => episode.truncate(),
            }
        }
    };
    let judge = TickSchedules::of(app).judge;
    app.add_systems(judge, end_episodes.before(PlaybotSystems::Judge).run_if(is_tick));
}

// Rewards that can be collected without end.

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
    fn episodes_are_lost_at_their_moment() {
        let kind = ends_by_itself();
        assert_eq!(play_sound(30, |_| 1).ends, [EpisodeEnd::WON]);
        let slowly = |tick: u32| tick % 2;
        let lost = play(&kind, 0, 26, slowly);
        assert_eq!((lost.ends, lost.episodes), (vec![EpisodeEnd::LOST], vec![(false, 26)]));
        assert_eq!(play(&kind, 1, 7, |_| 1).episodes, [(false, 7)], "after seven ticks of the same");
        assert_eq!(play(&kind, 1, 59, slowly).episodes, [], "no key was held");
        assert_eq!(play(&kind, 2, 41, |_| 1).episodes, [(true, 30), (false, 11)], "the second episode");
        assert_eq!(play(&kind, 3, 61, |tick| tick % 4 / 3).episodes, [(false, 61)]);
    }

    #[test]
    fn time_is_up_too_early() {
        let out = play(&short_time_out(), 0, 26, |_| 1);
        assert_eq!((out.ends, out.episodes), (vec![EpisodeEnd::Truncated], vec![(false, 26)]));
        assert_eq!(
            play(&short_time_out(), 3, 60, |_| 1).episodes,
            [(true, 30), (true, 30)],
            "quick actions do not help"
        );
    }

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
