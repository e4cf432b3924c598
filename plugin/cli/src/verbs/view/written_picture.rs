//! Report of a written picture.

use crate::{error::CliError, output::print_line};
use bevy_playbot::{
    demo::replay::Divergence,
    episode::{EpisodeEnd, EpisodeEnded},
};
use playbot_harness::game::Game;
use playbot_report::counted;
use serde_json::json;
use std::path::Path;

/// A written picture and its contents.
pub struct WrittenPicture<'a> {
    /// The file.
    pub path: &'a Path,
    /// The game.
    pub game: &'a dyn Game,
    /// Mode that was played.
    pub mode: &'a str,
    /// The mode was named on the command line.
    pub is_mode_named: bool,
    /// Level that was played.
    pub level: u64,
    /// Name of the player.
    pub player: &'a str,
    /// The recording, if one was shown.
    pub demo: Option<&'a Path>,
    /// The shown tick; `None` for a whole episode.
    pub tick: Option<u32>,
    /// Number of pictures.
    pub frames: usize,
    /// Length of the file.
    pub bytes: usize,
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Ticks that were played.
    pub ticks: u32,
    /// The end of the episode, if it ended.
    pub end: Option<EpisodeEnded>,
    /// The first difference of a recording from the game.
    pub divergence: Option<&'a Divergence>,
}

impl WrittenPicture<'_> {
    /// Prints it: as a line of JSON on standard output, or as text.
    ///
    /// # Errors
    ///
    /// Standard output is closed.
    pub fn print(&self, as_json: bool) -> Result<(), CliError> {
        if !as_json {
            report!("{}", self.sentence());
            return Ok(());
        }
        let [width, height] = self.size;
        print_line(json!({
            "path": self.path.display().to_string(), "bytes": self.bytes, "width": width, "height": height,
            "frames": self.frames, "ticks": self.ticks, "end": self.end.map(|ended| ended.end), "player": self.player,
            "game": self.game.name(), "mode": self.mode, "level": self.level,
            "divergence": self.divergence.map(ToString::to_string),
        }))
    }

    fn sentence(&self) -> String {
        let what = match self.tick {
            Some(tick) => format!("tick {tick}"),
            None => counted(self.frames as u64, "frame"),
        };
        let who = match self.demo {
            Some(demo) => format!("as recorded in {}", demo.display()),
            None => format!("played by {}", self.player),
        };
        let modes = self.game.modes();
        let choice = if self.is_mode_named || modes.len() < 2 {
            String::new()
        } else {
            format!(" (no --mode was named; the game has {})", modes.join(", "))
        };
        let [width, height] = self.size;
        format!(
            "{} shows {what} of level {} of {} in mode {}{choice}, {who}, on {width} × {height} pixels; after {} the \
             episode {}",
            self.path.display(),
            self.level,
            self.game.name(),
            self.mode,
            counted(self.ticks.into(), "tick"),
            self.end.map_or("was still running", describe_end),
        )
    }
}

/// Describes the end of an episode, after "the episode".
fn describe_end(ended: EpisodeEnded) -> &'static str {
    match ended.end {
        EpisodeEnd::Terminated { success: true } => "was won",
        EpisodeEnd::Terminated { success: false } => "was lost",
        EpisodeEnd::Truncated if ended.success => "ran out of time, with the goal reached",
        EpisodeEnd::Truncated => "ran out of time",
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::App;
    use playbot_harness::foreign::ForeignGame;

    use super::*;

    #[test]
    fn a_sentence_says_what_is_seen_of_whom_and_how_it_went() {
        let game = ForeignGame::new("runner", 1, |_: &mut App| {});
        let still = WrittenPicture {
            path: Path::new("view.png"),
            game: &game,
            mode: "default",
            is_mode_named: false,
            level: 5,
            player: "walker",
            demo: None,
            tick: Some(0),
            frames: 1,
            bytes: 100,
            size: [64, 48],
            ticks: 1,
            end: None,
            divergence: None,
        };
        let words = "view.png shows tick 0 of level 5 of runner in mode default, played by walker, on 64 × 48 pixels; \
                     after 1 tick the episode was still running";
        assert_eq!(still.sentence(), words);
        let film = WrittenPicture { demo: Some(Path::new("a.demo")), tick: None, frames: 2, ticks: 2, ..still };
        let words = "view.png shows 2 frames of level 5 of runner in mode default, as recorded in a.demo, on 64 × 48 \
                     pixels; after 2 ticks the episode was still running";
        assert_eq!(film.sentence(), words);
    }
}
