//! The replay of an episode, by its actions or by its player.

use bevy_playbot::{
    action::{ActionValue, misfit},
    episode::EpisodeResult,
    level_files::LevelFile,
    vision::{ObservationConfig, VisionError},
};

use super::{
    breakage::Breakage,
    moment::Watcher,
    solo::{Setting, Solo},
};
use crate::{eval::Player, idle::idle_action};

/// The result of a replayed episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replayed {
    /// Reward of each tick.
    pub rewards: Vec<f32>,
    /// Hash of the game's state after each tick.
    pub state_hashes: Vec<u32>,
    /// The result of the episode, if it ended.
    pub end: Option<EpisodeResult>,
    /// The panic or fault of the game, if there was one.
    pub broken: Option<Breakage>,
    /// The tick in which a watcher saw the finding; the replay ends there.
    pub noticed: Option<u32>,
    /// The file of the level, for levels from files.
    pub level_file: Option<LevelFile>,
}

impl Replayed {
    /// Returns the hash of the state after a tick, or after the last one before it.
    pub fn state_hash(&self, tick: u32) -> Option<u32> {
        self.state_hashes.get(tick as usize).or(self.state_hashes.last()).copied()
    }

    /// Adds a tick. Returns whether the episode goes on.
    fn note(&mut self, solo: &Solo, watcher: Option<&mut Watcher>) -> bool {
        let (reward, hash) = solo.outcome();
        self.rewards.push(reward);
        self.state_hashes.push(hash);
        self.end = solo.end();
        self.noticed = watcher.and_then(|watch| watch(&solo.moment()));
        self.end.is_none() && self.noticed.is_none()
    }
}

/// Plays actions up to their end, to that of the episode, or to the tick in which the watcher saw the finding.
pub(super) fn play_actions(setting: Setting, actions: &[ActionValue], mut watcher: Option<Watcher>) -> Replayed {
    // The watcher examines the World, not the observations.
    let built = Solo::new(setting, &ObservationConfig::default());
    let mut solo = built.expect("nothing can be wrong with a vector");
    if watcher.is_some() {
        solo.listen();
    }
    let mut replayed = Replayed { level_file: solo.level_file(), ..Replayed::default() };
    while let Some(action) = actions.get(solo.ticks() as usize) {
        solo.act(action.clone());
        match solo.tick() {
            Err(broken) => {
                replayed.broken = Some(broken);
                return replayed;
            }
            Ok(is_tick) => {
                if is_tick && !replayed.note(&solo, watcher.as_mut()) {
                    return replayed;
                }
            }
        }
    }
    replayed.broken = solo.endless();
    replayed
}

/// Lets a player play to the end of the episode, or until the game breaks. The actions include that of the tick in
/// which it broke.
///
/// # Errors
///
/// The player's observation cannot be drawn.
pub(super) fn play_player(
    setting: Setting,
    player: &Player,
    observation_config: &ObservationConfig,
) -> Result<(Vec<ActionValue>, Replayed), VisionError> {
    let sees = matches!(player, Player::Policy { .. });
    let observation_config = if sees { *observation_config } else { ObservationConfig::default() };
    let mut solo = Solo::new(setting, &observation_config)?;
    solo.seat(player);
    let (mut actions, mut replayed) = (Vec::new(), Replayed { level_file: solo.level_file(), ..Replayed::default() });
    let space = setting.game.actions();
    let done = |solo: &Solo| {
        // An action that does not fit had no effect.
        let action = solo.action().filter(|action| misfit(action, &space).is_none());
        action.unwrap_or_else(|| idle_action(setting.game))
    };
    loop {
        match solo.tick() {
            Err(broken) => {
                if broken.detector != "endless" {
                    actions.push(done(&solo));
                }
                replayed.broken = Some(broken);
                return Ok((actions, replayed));
            }
            Ok(true) => {
                actions.push(done(&solo));
                if !replayed.note(&solo, None) {
                    return Ok((actions, replayed));
                }
            }
            Ok(false) => {}
        }
    }
}
