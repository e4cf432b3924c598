//! The takeover `replay:FILE`.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::Arc,
};

use bevy::prelude::*;

use super::{
    error::TakeoverError,
    identity::GameIdentity,
    seats::{Seat, playing_agents},
};
use crate::{
    demo::{
        file::{DemoEpisode, DemoReader},
        replay::Replay,
    },
    fault::Faults,
};

/// A recording that plays.
#[derive(Debug)]
pub(super) struct Playing {
    path: PathBuf,
    seat: Seat,
    left: VecDeque<Arc<DemoEpisode>>,
    /// Episodes that were begun.
    begun: usize,
}

/// Hands the first playing agent over to a recording.
pub(super) fn start(world: &mut World, path: &Path) -> Result<Option<Playing>, TakeoverError> {
    let game = world.resource::<GameIdentity>();
    let reader = DemoReader::open_for_game(path, &game.name, game.version, Some(&game.mode))?;
    let episodes = reader.read_all()?;
    let left: VecDeque<_> = episodes.into_iter().filter(|episode| !episode.is_empty()).map(Arc::new).collect();
    if left.is_empty() {
        return Err(TakeoverError::Empty { path: path.to_owned() });
    }
    let seat = playing_agents(world).first().and_then(|&agent| Seat::of(world, agent));
    let mut playing = seat.map(|seat| Playing { path: path.to_owned(), seat, left, begun: 0 });
    if let Some(playing) = &mut playing {
        playing.next(world);
    }
    Ok(playing)
}

impl Playing {
    /// Begins the next episode. Returns false if there is no next one.
    fn next(&mut self, world: &mut World) -> bool {
        let Some(episode) = self.left.pop_front() else { return false };
        self.begun += 1;
        let Ok(mut agent) = world.get_entity_mut(self.seat.agent) else { return false };
        Replay::begin(episode, &mut agent);
        true
    }

    /// Goes on to the next episode when this one is over. Returns false after the last one.
    pub fn go_on(&mut self, world: &mut World) -> bool {
        let Some(replay) = world.get::<Replay>(self.seat.agent) else { return false };
        if !replay.is_finished() {
            return true;
        }
        if let Some(divergence) = replay.divergence() {
            let what = format!(
                "{}: episode {} does not replay ({divergence}): the game differs from the recorded one",
                self.path.display(),
                self.begun - 1
            );
            world.resource_mut::<Faults>().report(what);
        }
        self.next(world)
    }

    /// Gives the agent back.
    pub fn stop(self, world: &mut World) {
        if let Ok(mut agent) = world.get_entity_mut(self.seat.agent) {
            agent.remove::<Replay>();
        }
        self.seat.give_back_anew(world);
    }
}
