//! The writer of findings during a test.

use crate::findings::{
    FindingError, FindingHead, FindingStatus, StoredFinding,
    checks::{Checks, failure_of},
    course::{Look, look},
    folder::FINDINGS,
    io_error,
    minimise::{Budget, minimise},
    play::{Replayed, Setting, Unplayable, play_player},
};
use bevy_playbot::{action::ActionValue, vision::ObservationConfig};
use playbot_harness::{
    eval::Player,
    game::{Game, level_designs},
    level_files::{is_level_files, level_files_mode},
};
use playbot_learner::disk;
use serde::Serialize;
use std::path::PathBuf;

/// The folder of findings, and the settings of their writer.
#[derive(Clone)]
pub struct FindingFiles {
    /// Folder of the test; files go into its `findings`.
    pub folder: PathBuf,
    /// The budget of minimisation; `None` for no minimisation.
    pub minimise: Option<Budget>,
    /// Whether failed episodes of testers without random numbers are written as well, on levels that were not solved.
    pub keep_failures: bool,
    /// Checks of the detectors. Findings without a check are not written.
    pub checks: Checks,
}

/// The tester of an episode.
#[derive(Clone, Copy)]
pub struct Played<'a> {
    /// Name of the tester.
    pub tester: &'a str,
    /// The tester.
    pub player: &'a Player,
    /// The observation of a learned policy.
    pub observation_config: &'a ObservationConfig,
    /// Seed of the episode.
    pub seed: u64,
}

/// A finding in a level, during a test.
pub struct SeenFinding<'a> {
    /// Name of the detector.
    pub detector: &'a str,
    /// The message.
    pub message: &'a str,
    /// Settings of the detector, as `name.key=value`, in addition to those of the test.
    pub settings: &'a [String],
    /// The tester, if the finding needs one.
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
    /// Replays the episode of a finding, alone, and writes it. Returns the file, relative to the folder of the test.
    /// `None` if the detector has no check, or if the finding does not happen again in the same tick and with the same
    /// state.
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
                // Cannot fail: the test has drawn the same observation.
                let Ok((actions, _)) = again else { return Ok(None) };
                self.store(game, &mode, number, by(head, played), &actions)
            }
        }
    }

    /// Writes an episode that failed: as `lost` if the game ended it, or as `not-solved` if the time limit did. An
    /// episode that does not fail again is not written.
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
        // A minimised finding is the same one, though the numbers in its message may differ.
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

/// Returns mode and number of the level alone. For a level file they do not depend on other files.
fn alone(game: &dyn Game, level: SeenLevel) -> (String, u64) {
    if is_level_files(level.mode) {
        let mode = level_files_mode(level.name);
        if level_designs(game, &mode).is_ok() {
            return (mode, 0);
        }
    }
    (level.mode.to_owned(), level.level)
}

// Rechecks of findings.

/// The tick and state in which a finding was seen again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Sighting {
    /// Tick of the episode; `None` if the finding needs no play.
    pub tick: Option<u32>,
    /// Hash of the state, in the form of a finding's head.
    pub state_hash: Option<u32>,
}

/// The result of replaying a finding.
#[derive(Clone, Debug, PartialEq)]
pub struct Recheck {
    /// The sighting, if there was one.
    pub sighting: Option<Sighting>,
    /// The replayed episode.
    pub replayed: Replayed,
}

impl Recheck {
    /// Returns whether it happened exactly as stored.
    pub fn is_same(&self, finding: &StoredFinding) -> bool {
        let (tick, state_hash) = (finding.head.tick, finding.head.state_hash);
        self.sighting == Some(Sighting { tick, state_hash })
    }

    /// Returns its status.
    pub fn status(&self, finding: &StoredFinding) -> FindingStatus {
        match self.sighting {
            None => FindingStatus::Gone,
            Some(_) if self.is_same(finding) => FindingStatus::StillThere,
            Some(_) => FindingStatus::Changed,
        }
    }
}

/// Replays a finding's actions in a World of their own, and runs its check.
///
/// # Errors
///
/// [`Unplayable`]: another game or version, a level that no longer exists, or a detector without a check.
pub fn recheck(game: &dyn Game, finding: &StoredFinding, checks: &Checks) -> Result<Recheck, Unplayable> {
    let StoredFinding { header, head, episode } = finding;
    let check = checks.of_finding(game, head).ok_or_else(|| {
        let known = checks.names().collect::<Vec<_>>().join(", ");
        Unplayable(format!("this program has no check of the detector `{}`; it has {known}", head.detector))
    })?;
    finding.check_playable(game)?;
    let (mode, level) = (header.mode.as_str(), episode.level_seed);
    let setting = Setting { game, mode, level, seed: head.seed };
    let Look { is_there, tick, replayed, .. } = look(setting, head, &finding.actions(), &check);
    let state_hash = tick.and_then(|tick| replayed.state_hash(tick));
    Ok(Recheck { sighting: is_there.then_some(Sighting { tick, state_hash }), replayed })
}
