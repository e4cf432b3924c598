//! Writing findings while levels are tested.

use std::path::PathBuf;

use bevy_playbot::{action::ActionValue, vision::ObservationConfig};
use playbot_learner::disk;

use super::{
    checks::Checks,
    error::{FindingError, io_error},
    failure::failure_of,
    folder::FINDINGS,
    head::FindingHead,
    minimise::{Budget, minimise},
    play::play_player,
    recheck::recheck,
    solo::Setting,
    stored::StoredFinding,
};
use crate::{
    eval::Player,
    game::{Game, level_designs},
    level_files::{is_level_files, level_files_mode},
};

/// Where findings are written, and which.
#[derive(Clone)]
pub struct FindingFiles {
    /// Folder of the test; files go into its `findings`.
    pub folder: PathBuf,
    /// How much is tried to make them shorter; nothing if there is no budget.
    pub minimise: Option<Budget>,
    /// Whether failed episodes of testers that leave nothing to chance are written too, on levels that nobody solved.
    pub keep_failures: bool,
    /// Checks of the detectors. What none of them can check is not written.
    pub checks: Checks,
}

/// Who played an episode.
#[derive(Clone, Copy)]
pub struct Played<'a> {
    /// Name of the tester.
    pub tester: &'a str,
    /// The tester.
    pub player: &'a Player,
    /// What a learned policy sees.
    pub observation_config: &'a ObservationConfig,
    /// Seed of the episode.
    pub seed: u64,
}

/// Something that was found in a level.
pub struct SeenFinding<'a> {
    /// What found it.
    pub detector: &'a str,
    /// What is wrong.
    pub message: &'a str,
    /// Settings of the detector, as `name.key=value`, that count beside those of the test.
    pub settings: &'a [String],
    /// Who played, if somebody had to.
    pub played: Option<Played<'a>>,
}

/// A level by its number, and the name that results have for it.
#[derive(Clone, Copy)]
pub struct SeenLevel<'a> {
    /// Mode of the game.
    pub mode: &'a str,
    /// Number of the level.
    pub level: u64,
    /// The name.
    pub name: &'a str,
}

impl FindingFiles {
    /// Plays the episode of a finding again, alone, and writes it. Returns the file, seen from the folder of the test; `None`
    /// if there is no check for it, or if it is not there again in the same tick and with the same state.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn keep(&self, game: &dyn Game, level: SeenLevel, seen: &SeenFinding) -> Result<Option<String>, FindingError> {
        if self.checks.of(seen.detector).is_none() {
            return Ok(None);
        }
        let settings = [self.checks.settings_of(game, seen.detector), seen.settings.to_vec()].concat();
        let head = FindingHead { settings, ..FindingHead::new(level.name, seen.detector, seen.message) };
        let (mode, number) = alone(game, level);
        match seen.played {
            None => self.store(game, &mode, number, head, &[]),
            Some(played) => {
                let setting = Setting { game, mode: &mode, level: number, seed: played.seed };
                let again = play_player(setting, played.player, played.observation_config);
                // Whoever has played it once can see it.
                let Ok((actions, _)) = again else { return Ok(None) };
                self.store(game, &mode, number, by(head, played), &actions)
            }
        }
    }

    /// The same for an episode that failed: as `lost` if the game ended it, or as `not-solved` if time was up. One that does
    /// not fail again is not written.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn keep_failure(
        &self,
        game: &dyn Game,
        level: SeenLevel,
        played: Played,
    ) -> Result<Option<String>, FindingError> {
        let (mode, number) = alone(game, level);
        let setting = Setting { game, mode: &mode, level: number, seed: played.seed };
        let again = play_player(setting, played.player, played.observation_config);
        let Ok((actions, replayed)) = again else { return Ok(None) };
        let Some((detector, message)) = replayed.end.as_ref().and_then(failure_of) else { return Ok(None) };
        let head = FindingHead::new(level.name, detector, message);
        self.store(game, &mode, number, by(head, played), &actions)
    }

    fn store(
        &self,
        game: &dyn Game,
        mode: &str,
        level: u64,
        head: FindingHead,
        actions: &[ActionValue],
    ) -> Result<Option<String>, FindingError> {
        let found = StoredFinding::of_actions(game, mode, level, head, actions, &self.checks);
        let Some(mut finding) = found else { return Ok(None) };
        // A shorter way is the same finding, though its words may have other numbers.
        let name = finding.file_name();
        if let Some(budget) = self.minimise
            && let Ok(shorter) = minimise(game, &finding, &self.checks, budget, &|_| {}, &|| false)
        {
            finding = shorter.finding;
        }
        let again = recheck(game, &finding, &self.checks);
        if !again.is_ok_and(|again| again.is_same(&finding)) {
            return Ok(None);
        }
        let below = self.folder.join(FINDINGS);
        disk::create_dir_all(&below).map_err(io_error("create", &below))?;
        finding.write(&below.join(&name))?;
        Ok(Some(format!("{FINDINGS}/{name}")))
    }
}

fn by(head: FindingHead, played: Played) -> FindingHead {
    FindingHead { tester: Some(played.tester.to_owned()), seed: played.seed, ..head }
}

/// Mode and number by which the level is played for itself: that of a file does not change when others come and go.
fn alone(game: &dyn Game, level: SeenLevel) -> (String, u64) {
    if is_level_files(level.mode) {
        let mode = level_files_mode(level.name);
        if level_designs(game, &mode).is_ok() {
            return (mode, 0);
        }
    }
    (level.mode.to_owned(), level.level)
}
