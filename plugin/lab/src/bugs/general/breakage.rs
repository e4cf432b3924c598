//! Games that panic or log errors.

use bevy::prelude::*;
use bevy_playbot::{
    control::Control,
    episode::Episode,
    placement::{TickSchedules, is_tick},
    systems::PlaybotSystems,
};

use super::{
    history::{History, remember},
    when::When,
};
use crate::defect::DefectKind;

/// Makes the game panic.
pub(super) fn panic() -> DefectKind {
    DefectKind::rules("panic", "the game panics", When::VARIANTS, |app, variant| {
        once_in_an_episode(app, When::of(variant), || panic!("index out of bounds: the len is 4 but the index is 4"));
    })
}

/// Makes the game log an error.
pub(super) fn error_log() -> DefectKind {
    DefectKind::rules("error-log", "the game logs an error", When::VARIANTS, |app, variant| {
        // Errors of this crate would not count as the game's.
        once_in_an_episode(app, When::of(variant), || tracing::error!(target: "game", "no entity of that name"));
    })
}

fn once_in_an_episode(app: &mut App, when: When, work: impl Fn() + Send + Sync + 'static) {
    remember(app);
    let show = move |mut agents: Query<(&Control, &Episode, &mut History)>| {
        for (control, episode, mut history) in &mut agents {
            let is_playing = control.is_active() && episode.is_running();
            if is_playing && !history.has_shown && when.is_now(&history, episode) {
                history.has_shown = true;
                work();
            }
        }
    };
    let judge = TickSchedules::of(app).judge;
    app.add_systems(judge, show.before(PlaybotSystems::Judge).run_if(is_tick));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bugs::general::testing::play, detectors::Ear};

    #[test]
    fn a_panic_is_a_fault_at_its_moment() {
        for (variant, tick) in [(0, 25), (1, 6), (2, 40), (3, 60)] {
            let way = |tick: u32| if variant == 3 { tick % 4 / 3 } else { 1 };
            let played = play(&panic(), variant, 70, way);
            let fault = played.fault.expect("it panics");
            assert!(fault.contains("the game panicked: index out of bounds"), "{fault}");
            assert_eq!(played.places.len(), tick, "variant {variant}");
        }
    }

    #[test]
    fn an_error_is_logged_once_in_an_episode() {
        let ear = Ear::new();
        let played = ear.listen(|| play(&error_log(), 0, 60, |_| 1));
        assert_eq!(played.episodes.len(), 2);
        // Two episodes, in a game with fixed ticks and in one whose ticks are frames.
        assert_eq!(ear.take(), ["no entity of that name"; 4]);
    }
}
