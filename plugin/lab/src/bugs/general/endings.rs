//! Episodes that end without a reason.

use bevy::prelude::*;
use bevy_playbot::{
    control::Control,
    episode::{Episode, EpisodeEnd},
    placement::{TickSchedules, is_tick},
    systems::PlaybotSystems,
};

use super::{
    history::{History, remember},
    when::When,
};
use crate::defect::DefectKind;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::general::testing::{play, play_sound};

    #[test]
    fn episodes_are_lost_at_their_moment() {
        let kind = ends_by_itself();
        assert_eq!(play_sound(30, |_| 1).ends, [EpisodeEnd::WON]);
        let slowly = |tick: u32| tick % 2;
        let lost = play(&kind, 0, 26, slowly);
        assert_eq!((lost.ends, lost.episodes), (vec![EpisodeEnd::LOST], vec![(false, 26)]));
        assert_eq!(play(&kind, 1, 7, |_| 1).episodes, [(false, 7)], "after seven ticks of the same");
        assert_eq!(play(&kind, 1, 59, slowly).episodes, [], "nobody held anything");
        assert_eq!(play(&kind, 2, 41, |_| 1).episodes, [(true, 30), (false, 11)], "the second episode");
        assert_eq!(play(&kind, 3, 61, |tick| tick % 4 / 3).episodes, [(false, 61)]);
    }

    #[test]
    fn time_is_up_too_early() {
        let out = play(&short_time_out(), 0, 26, |_| 1);
        assert_eq!((out.ends, out.episodes), (vec![EpisodeEnd::Truncated], vec![(false, 26)]));
        assert_eq!(play(&short_time_out(), 3, 60, |_| 1).episodes, [(true, 30), (true, 30)], "whoever is quick");
    }
}
