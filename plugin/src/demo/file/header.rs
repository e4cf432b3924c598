//! The header of a recording: its contents and conditions.

use crate::{action::ActionSpace, demo::file::error::DemoFault};
use serde::{Deserialize, Serialize};

/// Newest format that this version of the crate reads and writes.
pub const DEMO_FORMAT: u32 = MIXED_FORMAT;

/// Format of recordings that name no level files. Written where possible, since older programs read it too.
const PLAIN_FORMAT: u32 = 1;

/// First format in which every episode names its level file.
pub(super) const LEVEL_FILES_FORMAT: u32 = 2;

/// First format in which every episode names the values that were drawn for its level.
pub(super) const RANDOMISED_FORMAT: u32 = 3;

/// First format with several choices at once.
const MIXED_FORMAT: u32 = 4;

/// Contents and conditions of a recording. Written as RON text at the top of the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DemoHeader {
    /// Format of the file: 1, 2 where levels are files, 3 where levels draw values of the game, or 4 where several choices
    /// are made at once.
    pub format: u32,
    /// Name of the game.
    pub game: String,
    /// Version of the game's rules: a recording replays only with the version that made it.
    pub game_version: u32,
    /// Mode (or difficulty) of the game.
    pub mode: String,
    /// Fixed ticks per second of game time.
    pub tick_hz: f64,
    /// Kind and number of actions.
    pub actions: ActionSpace,
    /// Names of the observation values kept for each tick; empty when observations are not kept.
    pub observation_names: Vec<String>,
    /// The player: a person's nickname, or the name of a bot.
    pub demonstrator: String,
    /// Noise added to the demonstrator's actions: the share of random actions (discrete), or the standard deviation
    /// (continuous); 0 for no noise.
    pub action_noise: f64,
    /// A note for people.
    pub note: String,
}

impl DemoHeader {
    /// Creates a header in the oldest sufficient format, without observations, noise or a note.
    pub fn new(game: &str, game_version: u32, mode: &str, tick_hz: f64, actions: ActionSpace) -> Self {
        Self {
            format: if matches!(actions, ActionSpace::Mixed(_)) { MIXED_FORMAT } else { PLAIN_FORMAT },
            game: game.to_owned(),
            game_version,
            mode: mode.to_owned(),
            tick_hz,
            actions,
            observation_names: Vec::new(),
            demonstrator: String::new(),
            action_noise: 0.0,
            note: String::new(),
        }
    }

    /// Changes the format to that of level files, which the episodes name.
    pub fn with_level_files(self) -> Self {
        Self { format: self.format.max(LEVEL_FILES_FORMAT), ..self }
    }

    /// Changes the format to that of levels that draw values of the game, which the episodes name.
    pub fn with_randomised_values(self) -> Self {
        Self { format: self.format.max(RANDOMISED_FORMAT), ..self }
    }

    /// Checks the values.
    ///
    /// # Errors
    ///
    /// [`DemoFault::NewerFormat`] or [`DemoFault::HeaderValue`].
    pub fn check(&self) -> Result<(), DemoFault> {
        let refuse = |field, why: String| Err(DemoFault::HeaderValue { field, why });
        if self.format > DEMO_FORMAT {
            return Err(DemoFault::NewerFormat { found: self.format, newest: DEMO_FORMAT });
        }
        if self.format == 0 {
            return refuse("format", "there is no format 0".to_owned());
        }
        if self.game.is_empty() {
            return refuse("game", "the name is empty".to_owned());
        }
        if !(self.tick_hz.is_finite() && self.tick_hz > 0.0) {
            return refuse("tick_hz", format!("{} is not a positive number of ticks per second", self.tick_hz));
        }
        if !(self.action_noise.is_finite() && self.action_noise >= 0.0) {
            return refuse("action_noise", format!("{} is neither 0 nor a positive number", self.action_noise));
        }
        // Counts are stored in 32 bits, and discrete actions are `u32`.
        if self.actions.is_empty() || self.actions.dim() > u32::MAX as usize {
            return refuse("actions", format!("{} cannot be played", self.actions));
        }
        Ok(())
    }

    /// Checks that the recording is of the given game, version and mode (`None`: any mode).
    ///
    /// # Errors
    ///
    /// [`DemoFault::ForeignGame`], [`DemoFault::ForeignVersion`] or [`DemoFault::ForeignMode`].
    pub fn check_game(&self, game: &str, game_version: u32, mode: Option<&str>) -> Result<(), DemoFault> {
        if self.game != game {
            return Err(DemoFault::ForeignGame { found: self.game.clone(), expected: game.to_owned() });
        }
        if self.game_version != game_version {
            return Err(DemoFault::ForeignVersion {
                game: self.game.clone(),
                found: self.game_version,
                expected: game_version,
            });
        }
        match mode {
            Some(expected) if self.mode != expected => Err(DemoFault::ForeignMode {
                game: self.game.clone(),
                found: self.mode.clone(),
                expected: expected.to_owned(),
            }),
            _ => Ok(()),
        }
    }

    /// Checks that episodes recorded under `wanted` may follow those in a file with this header.
    /// Every field must agree except `note`; the note of the file stays.
    ///
    /// # Errors
    ///
    /// [`DemoFault::HeaderDiffers`] names the first field that does not agree.
    pub fn check_append(&self, wanted: &Self) -> Result<(), DemoFault> {
        fn same<T: PartialEq + std::fmt::Debug>(field: &'static str, found: &T, wanted: &T) -> Result<(), DemoFault> {
            if found == wanted {
                return Ok(());
            }
            Err(DemoFault::HeaderDiffers { field, found: format!("{found:?}"), wanted: format!("{wanted:?}") })
        }
        same("format", &self.format, &wanted.format)?;
        same("game", &self.game, &wanted.game)?;
        same("game_version", &self.game_version, &wanted.game_version)?;
        same("mode", &self.mode, &wanted.mode)?;
        same("tick_hz", &self.tick_hz, &wanted.tick_hz)?;
        same("actions", &self.actions, &wanted.actions)?;
        same("observation_names", &self.observation_names, &wanted.observation_names)?;
        same("demonstrator", &self.demonstrator, &wanted.demonstrator)?;
        same("noise", &self.action_noise, &wanted.action_noise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> DemoHeader {
        DemoHeader::new("coinrun", 3, "easy", 60.0, ActionSpace::Discrete(15))
    }

    #[test]
    fn values_are_checked() {
        assert!(header().check().is_ok());
        for (field, header) in [
            ("game", DemoHeader { game: String::new(), ..header() }),
            ("tick_hz", DemoHeader { tick_hz: 0.0, ..header() }),
            ("tick_hz", DemoHeader { tick_hz: f64::NAN, ..header() }),
            ("action_noise", DemoHeader { action_noise: f64::INFINITY, ..header() }),
            ("actions", DemoHeader { actions: ActionSpace::Continuous(0), ..header() }),
            ("format", DemoHeader { format: 0, ..header() }),
        ] {
            let error = header.check().expect_err(field);
            assert!(matches!(error, DemoFault::HeaderValue { field: f, .. } if f == field), "{error}");
        }
    }

    #[test]
    fn foreign_recordings_are_named() {
        assert!(header().check_game("coinrun", 3, Some("easy")).is_ok());
        assert!(header().check_game("coinrun", 3, None).is_ok());
        let text = |r: Result<(), DemoFault>| r.expect_err("foreign").to_string();
        assert!(text(header().check_game("maze", 3, None)).contains("the game `coinrun`, not of `maze`"));
        assert!(
            text(header().check_game("coinrun", 4, None)).contains("version 3 of `coinrun`, but this is version 4")
        );
        assert!(text(header().check_game("coinrun", 3, Some("hard"))).contains("mode `easy`"));
    }

    #[test]
    fn only_the_note_may_differ_when_appending() {
        assert!(header().check_append(&DemoHeader { note: "later".into(), ..header() }).is_ok());
        let other = DemoHeader { demonstrator: "ada".into(), ..header() };
        let text = header().check_append(&other).expect_err("other player").to_string();
        assert_eq!(
            text,
            "cannot append: `demonstrator` is \"\" in the file, but \"ada\" is being recorded: record to another file"
        );
    }
}
