//! Replay of an episode before the person plays.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::{demo::file::DemoEpisode, placement::TickSchedules};
use playbot_lab::prelude::*;

/// Hands the agent over to a recorded episode.
pub(super) fn build(app: &mut App, agent: Entity, episode: DemoEpisode) {
    let judge = TickSchedules::of(app).judge;
    Replay::begin(Arc::new(episode), &mut app.world_mut().entity_mut(agent));
    app.add_systems(judge, hand_over.in_set(PlaybotSystems::Reset));
}

/// Gives the person control after the last recorded tick.
fn hand_over(mut agents: Query<(&mut Control, &Replay)>) {
    for (mut control, replay) in &mut agents {
        if *control == Control::Replay && replay.is_finished() {
            *control = Control::Human;
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy_playbot::demo::file::{Decider, DemoActions, EpisodeActions};

    use super::*;

    #[test]
    fn the_person_goes_on_behind_the_last_tick() {
        let mut episode = DemoEpisode::new(7, DemoActions::Discrete(2));
        episode.actions = EpisodeActions::Discrete(vec![1, 0, 1]);
        (episode.rewards, episode.state_hashes) = (vec![0.0; 3], vec![0; 3]);
        episode.deciders = vec![Decider::Bot; 3];
        let mut app = headless_app();
        let agent = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
        build(&mut app, agent, episode);
        app.ticks(2).expect("no agent broke its contract");
        assert_eq!(Control::of(app.world(), agent), Control::Replay);
        app.tick().expect("no agent broke its contract");
        assert_eq!(Control::of(app.world(), agent), Control::Human);
        assert_eq!(app.world().get::<Episode>(agent).map(|episode| (episode.level, episode.tick)), Some((7, 3)));
    }
}
