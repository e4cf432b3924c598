//! Reversal of a reached goal.

use bevy::reflect::{GetPath, enums::DynamicEnum};
use playbot_lab::prelude::*;

/// Lets an episode go on whose goal was reached in this tick. No game can do that; reflection can.
pub(crate) fn take_back(episode: &mut Episode) {
    if let Ok(reached) = episode.path_mut::<bool>("reached") {
        *reached = false;
    }
    if !episode.end().is_some_and(EpisodeEnd::is_success) {
        return;
    }
    if let Ok(state) = episode.reflect_path_mut("state") {
        // If the fields of episodes change, the test below fails.
        let _ = state.try_apply(&DynamicEnum::new("Running", ()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_episode_that_was_won_goes_on_and_one_that_was_lost_does_not() {
        let mut app = headless_app();
        let agent = Agent::new(0, ActionSpace::Discrete(2));
        let agent = app.world_mut().spawn((agent, Control::Human, LevelQueue::Always(0))).id();
        app.tick().expect("sound");
        let mut episode = app.world().get::<Episode>(agent).expect("every agent has one").clone();
        episode.reach();
        episode.terminate(true);
        assert!(episode.is_success());
        take_back(&mut episode);
        assert_eq!((episode.is_running(), episode.end(), episode.is_success()), (true, None, false));
        episode.terminate(false);
        take_back(&mut episode);
        assert_eq!(episode.end(), Some(EpisodeEnd::LOST));
    }
}
