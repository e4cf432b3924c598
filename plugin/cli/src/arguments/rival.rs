//! Rivals named on the command line: bots, policy files and runs.

use crate::{
    arguments::player::{LoadedPlayer, check_run_of},
    error::CliError,
};
use bevy_playbot::{policy::ActionDraw, unknown_name::UnknownName};
use playbot_harness::{
    eval::all_bots,
    game::Game,
    rivals::{RivalError, check_rivals, find_seat},
};
use playbot_learner::DeviceKind;
use playbot_train::{checkpoint::CheckpointChoice, run_dir::RunDir};
use std::path::Path;

/// Options for the player of the other agents of an arena.
#[derive(clap::Args, Clone, Debug, Default)]
pub struct RivalArgs {
    /// Player of the other side, in a game whose agents play together: a bot of the game, a policy file, or the folder of
    /// a run.
    #[arg(long, value_name = "RIVAL")]
    pub rival: Option<String>,
    /// Seat of the player, by its name (default: all of them, one after the other).
    #[arg(long, value_name = "NAME", requires = "rival")]
    pub seat: Option<String>,
}

impl RivalArgs {
    /// Loads the rival; `None` if none is named. Policies draw their actions as `draw` says.
    ///
    /// # Errors
    ///
    /// The game has no rivals, no such bot and no such seat, or the policy was made for another game.
    pub fn load(
        &self,
        game: &dyn Game,
        mode: &str,
        draw: ActionDraw,
        device: DeviceKind,
    ) -> Result<Option<LoadedPlayer>, CliError> {
        let Some(name) = &self.rival else { return Ok(None) };
        check_rivals(game, mode)?;
        self.seat(game)?;
        let bots = all_bots(game);
        let names: Vec<&str> = bots.iter().map(|(name, _)| *name).collect();
        if names.contains(&name.as_str()) {
            return Ok(Some(LoadedPlayer::bot(game, name)?));
        }
        let path = Path::new(name);
        let mut rival = if path.is_dir() {
            let opened = RunDir::open(path)?;
            check_run_of(path, &opened.experiment.game, game.name())?;
            LoadedPlayer::run(game, &opened, CheckpointChoice::Last, draw, device)?
        } else if path.exists() || name.contains(['/', '\\', '.']) {
            LoadedPlayer::policy_file(game, path, draw, device)?
        } else {
            let unknown = UnknownName::new("rival", name, &names);
            return Err(CliError::Usage(format!("{unknown}; or name a policy file, or the folder of a run")));
        };
        rival.check_fit(game)?;
        if rival.observation_config.is_image() {
            return Err(CliError::Usage(format!(
                "{name}: the policy sees pictures, and rivals see vectors: name a policy that reads vectors, or a bot"
            )));
        }
        rival.name = name.clone();
        Ok(Some(rival))
    }

    /// Returns the place of the player's seat, if one is named.
    ///
    /// # Errors
    ///
    /// The game has no such seat.
    pub fn seat(&self, game: &dyn Game) -> Result<Option<usize>, RivalError> {
        self.seat.as_deref().map(|name| find_seat(game, name)).transpose()
    }
}
