//! Made-up evidence for tests of the checks.

use crate::{
    diagnose::{
        evidence::Evidence,
        play::{Played, PlayedEpisode, Seat},
        recordings::{RecordedEpisode, RecordedSet},
    },
    experiment::file::parse_experiment,
};
use bevy_playbot::{
    action::{ActionSpace, ActionValue, Actions},
    demo::file::{DemoEnd, DemoEpisode},
};
use std::{path::Path, sync::Arc};

/// Returns the evidence of an experiment of version 1 of a game, with these further settings.
pub fn evidence(algorithm: &str, settings: &str) -> Evidence {
    let text = format!(
        r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "d", steps: 1000, algorithm: "{algorithm}", {settings})"#
    );
    let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
    Evidence { action_space: ActionSpace::Discrete(3), ..Evidence::new(&experiment, 1) }
}

/// Returns a player with one unfinished episode. `tick` gives observation, action and reward.
pub fn played(seat: Seat, ticks: usize, tick: impl Fn(usize) -> (Vec<f32>, u32, f32)) -> Played {
    let mut episode = PlayedEpisode::default();
    for (observation, action, reward) in (0..ticks).map(tick) {
        episode.width = observation.len();
        episode.observations.extend(observation);
        episode.actions.push(ActionValue::Discrete(action));
        episode.rewards.push(reward);
    }
    Played { seat, episodes: vec![episode], fault: None }
}

/// Returns four recordings of version 1 of a game, in which one action is taken, won or lost.
pub fn recorded(action: u32, is_won: bool) -> RecordedSet {
    let mut episode = DemoEpisode::new(0, ActionSpace::Discrete(2));
    episode.actions = Actions::Discrete(vec![action; 20]);
    (episode.rewards, episode.state_hashes) = (vec![0.0; 20], vec![1; 20]);
    episode.end = DemoEnd::Terminated { success: is_won };
    let recorded =
        RecordedEpisode { mode: "hard".into(), version: 1, noise: 0.0, width: 0, episode: Arc::new(episode) };
    RecordedSet {
        games: vec!["coinrun".to_owned()],
        episodes: vec![recorded; 4],
        idle: Some(ActionValue::Discrete(0)),
        ..RecordedSet::default()
    }
}
