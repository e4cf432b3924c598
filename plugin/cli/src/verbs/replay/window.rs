//! Window of a finding.

use crate::{
    error::CliError,
    progress::interrupt,
    window::{GameWindow, Playlist, WindowError, WindowSetup},
};
use bevy_playbot::vision::ObservationConfig;
use playbot_harness::{game::Game, split::LevelSplit};
use playbot_test::findings::StoredFinding;

/// Plays the actions in a window; after them a person plays on.
///
/// # Errors
///
/// There is no display, the game cannot be shown in a window, or the finding is that the game breaks.
pub(crate) fn show(game: &dyn Game, finding: &StoredFinding) -> Result<(), CliError> {
    let level = finding.episode.level_seed;
    let levels = LevelSplit { mode: finding.header.mode.clone(), first: level, last: level };
    let mut window = GameWindow::open(WindowSetup {
        game,
        playlist: Playlist::new(levels, level),
        autopilot: None,
        observation_config: ObservationConfig::default(),
        seed: 0,
        stop: interrupt::asked,
    })
    .map_err(or_a_picture)?;
    window.replay(finding.episode.clone());
    interrupt::listen();
    report!("the finding is played first, then you play on; P pause, R again, Escape ends");
    Ok(window.run()?)
}

/// Adds the advice to draw pictures where no window opens.
fn or_a_picture(error: WindowError) -> CliError {
    match error {
        WindowError::NoDisplay(_) | WindowError::NoLibrary(_) | WindowError::NoAdapter(_) => {
            let words = error.to_string();
            CliError::Usage(words.replace("there is `playbot eval`", "--png FILE and --apng FILE draw the finding"))
        }
        error => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_display_pictures_are_named() {
        let missing = || "DISPLAY is not set".to_owned();
        let all = [WindowError::NoDisplay, WindowError::NoLibrary, WindowError::NoAdapter];
        for error in all.map(|of| of(missing())) {
            let words = or_a_picture(error).to_string();
            assert!(words.contains("--png FILE and --apng FILE") && !words.contains("eval"), "{words}");
        }
        assert!(!or_a_picture(WindowError::Lost(missing())).to_string().contains("--png"));
    }
}
