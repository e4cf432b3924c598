//! Showing a finding in a window.

use bevy_playbot::vision::ObservationConfig;
use playbot_lab::{findings::StoredFinding, game::Game, split::LevelSplit};

use crate::{
    error::CliError,
    interrupt,
    window::{GameWindow, Playlist, WindowSetup},
};

/// Plays the actions in a window; behind them a person goes on.
///
/// # Errors
///
/// There is no display, the game cannot be shown in a window, or the finding is that the game breaks.
pub fn show(game: &dyn Game, finding: &StoredFinding) -> Result<(), CliError> {
    let level = finding.episode.level_seed;
    let levels = LevelSplit { mode: finding.header.mode.clone(), first: level, last: level };
    let mut window = GameWindow::open(WindowSetup {
        game,
        playlist: Playlist::new(levels, level),
        autopilot: None,
        observation_config: ObservationConfig::default(),
        seed: 0,
        stop: interrupt::asked,
    })?;
    window.replay(finding.episode.clone());
    interrupt::listen();
    tell!("what was found is played first, then you go on; P pause, R again, Escape ends");
    Ok(window.run()?)
}
