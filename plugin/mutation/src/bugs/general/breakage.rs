//! Games that panic or log errors.

use crate::bugs::general::{
    When,
    history::{History, remember},
    one_of,
};
use bevy::prelude::*;
use bevy_playbot::{
    agent::Control,
    engine::{TickSchedules, check_observations, is_tick, run_observe_schedule},
    episode::Episode,
    observation::Observation,
    reward::Reward,
    systems::PlaybotSystems,
};
use playbot_harness::defect::DefectKind;

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

/// The value that is not a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// The first value of an observation; the reward if there is no observation.
    Observation,
    /// The reward.
    Reward,
}

const VARIANTS: [(When, Place); 4] = [
    (When::Tick(25), Place::Observation),
    (When::Held(7), Place::Reward),
    (When::Later { episode: 2, tick: 10 }, Place::Observation),
    (When::Tick(60), Place::Reward),
];

/// Makes a value of the observation or the reward NaN.
pub(super) fn nan() -> DefectKind {
    let about = "a value that an agent sees, or what it is paid, is not a number";
    DefectKind::rules("nan", about, VARIANTS.len() as u32, |app, variant| {
        remember(app);
        let (when, place) = one_of(&VARIANTS, variant);
        let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
        let spoil_observation = move |mut agents: Query<(&Control, &Episode, &History, &mut Observation)>| {
            for (control, episode, history, mut seen) in &mut agents {
                if control.is_active() && episode.is_running() && when.is_now(history, episode) {
                    seen.vector.iter_mut().take(1).for_each(|value| *value = f32::NAN);
                }
            }
        };
        let spoil_reward = move |mut agents: Query<(&Control, &Episode, &History, &Observation, &mut Reward)>| {
            for (control, episode, history, seen, mut reward) in &mut agents {
                let is_here = place == Place::Reward || seen.vector.is_empty();
                if is_here && control.is_active() && episode.is_running() && when.is_now(history, episode) {
                    reward.add(f32::NAN);
                }
            }
        };
        if place == Place::Observation {
            // After the game's sensors, and before any reader.
            let behind = spoil_observation.in_set(PlaybotSystems::Observe).after(run_observe_schedule);
            app.add_systems(decide, behind.before(check_observations));
        }
        app.add_systems(judge, spoil_reward.before(PlaybotSystems::Judge).run_if(is_tick));
    })
}

#[cfg(test)]
mod tests {
    use playbot_test::detectors::ErrorLogReader;

    use super::*;
    use crate::bugs::general::testing::play;

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
        let ear = ErrorLogReader::new();
        let played = ear.listen(|| play(&error_log(), 0, 60, |_| 1));
        assert_eq!(played.episodes.len(), 2);
        // Two episodes, in a game with fixed ticks and in one whose ticks are frames.
        assert_eq!(ear.take(), ["no entity of that name"; 4]);
    }

    #[test]
    fn what_is_no_number_is_a_fault_of_its_tick() {
        for (variant, tick, words) in [
            (0, 25, "observation `place` is NaN"),
            (1, 6, "the reward is NaN"),
            (2, 40, "observation `place` is NaN"),
            (3, 60, "the reward is NaN"),
        ] {
            let way = |tick: u32| if variant == 3 { tick % 4 / 3 } else { 1 };
            let played = play(&nan(), variant, 70, way);
            let fault = played.fault.expect("it is none");
            assert!(fault.contains(words), "{fault}");
            assert_eq!(played.places.len(), tick, "variant {variant}");
        }
    }
}
