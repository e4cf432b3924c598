//! The writer of findings during a test.

use crate::findings::{
    FindingError, FindingHead, FindingStatus, StoredFinding,
    checks::{Check, Checks, failure_of},
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
use playbot_report::counted;
use serde::Serialize;
use std::path::PathBuf;

/// The folder of findings, and the settings of their writer.
#[derive(Clone)]
pub struct FindingFiles {
    /// Folder of the test; files go into its `findings`.
    pub folder: PathBuf,
    /// The budget of minimisation; `None` for no minimisation.
    pub minimise: Option<Budget>,
    /// Whether a failed episode is written as well, of each level that was not solved.
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
        let alone = alone(game, level);
        let kept = match seen.played {
            None => self.store(game, alone, head, &[]),
            Some(played) => {
                let again = play_player(setting(game, &alone, played), played.player, played.observation_config);
                // Cannot fail: the test has drawn the same observation.
                let Ok((actions, _)) = again else { return Ok(None) };
                self.store(game, alone, by(head, played), &actions)
            }
        };
        Ok(kept?.file())
    }

    /// Plays an episode that failed again, alone, and writes it: as `lost` if the game ended it, or as `not-solved` if
    /// the time limit did. An episode that does not fail again, or whose actions do not lead to the same end, is not
    /// written.
    ///
    /// # Errors
    ///
    /// The file cannot be written.
    pub fn keep_failure(&self, game: &dyn Game, level: SeenLevel, played: Played) -> Result<KeptFailure, FindingError> {
        let alone = alone(game, level);
        let again = play_player(setting(game, &alone, played), played.player, played.observation_config);
        let (actions, replayed) = match again {
            Ok(again) => again,
            Err(error) => return Ok(KeptFailure::Missing(format!("it cannot be played alone: {error}"))),
        };
        let Some((detector, message)) = replayed.end.as_ref().and_then(failure_of) else {
            return Ok(KeptFailure::Missing(format!(
                "it does not fail when it is played alone: {}",
                end_of(&replayed)
            )));
        };
        self.store(game, alone, by(FindingHead::new(level.name, detector, message), played), &actions)
    }

    fn store(
        &self,
        game: &dyn Game,
        (mode, level): (String, u64),
        head: FindingHead,
        actions: &[ActionValue],
    ) -> Result<KeptFailure, FindingError> {
        let setting = Setting { game, mode: &mode, level, seed: head.seed };
        let Some(check) = self.checks.of_finding(game, &head) else {
            return Ok(KeptFailure::Missing(format!("the detector `{}` has no check", head.detector)));
        };
        let seen = match seen_again(setting, head, actions, &check) {
            Ok(seen) => seen,
            Err(missing) => return Ok(KeptFailure::Missing(missing)),
        };
        // A minimised finding is the same one, though the numbers in its message may differ.
        let name = seen.file_name();
        let shorter = self.minimise.map(|budget| minimise(game, &seen, &self.checks, budget, &|_| {}, &|| false));
        let shorter = shorter.and_then(Result::ok).map(|shorter| shorter.finding);
        let mut missing = String::new();
        // The shorter episode is another one. If it does not happen twice, the whole one may.
        for finding in shorter.into_iter().chain([seen]) {
            match difference(game, &finding, &self.checks) {
                Some(difference) => missing = difference,
                None => {
                    let below = self.folder.join(FINDINGS);
                    disk::create_dir_all(&below).map_err(io_error("create", &below))?;
                    finding.write(&below.join(&name))?;
                    return Ok(KeptFailure::File(format!("{FINDINGS}/{name}")));
                }
            }
        }
        Ok(KeptFailure::Missing(missing))
    }
}

/// The result of keeping a finding or a failed episode.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum KeptFailure {
    /// Its file, relative to the folder of the test.
    File(String),
    /// There is no file, for this reason.
    Missing(String),
}

impl KeptFailure {
    /// Returns the file, if there is one.
    pub fn file(self) -> Option<String> {
        match self {
            Self::File(file) => Some(file),
            Self::Missing(_) => None,
        }
    }
}

/// Returns the finding that these actions lead to, or the reason why they do not.
fn seen_again(
    setting: Setting,
    head: FindingHead,
    actions: &[ActionValue],
    check: &Check,
) -> Result<StoredFinding, String> {
    let Look { is_there, tick, replayed, .. } = look(setting, &head, actions, check);
    if is_there {
        return Ok(StoredFinding::of_replay(setting, head, actions, replayed, tick));
    }
    Err(format!("{}, but its actions lead elsewhere when they are played again: {}", head.message, end_of(&replayed)))
}

/// Describes the difference between a finding and its replay; `None` if it happens exactly as stored.
fn difference(game: &dyn Game, finding: &StoredFinding, checks: &Checks) -> Option<String> {
    let again = match recheck(game, finding, checks) {
        Ok(again) => again,
        Err(unplayable) => return Some(unplayable.to_string()),
    };
    if again.is_same(finding) {
        return None;
    }
    let elsewhere = match again.sighting {
        None => end_of(&again.replayed),
        Some(Sighting { tick, .. }) if tick == finding.head.tick => "the state is another one in that tick".to_owned(),
        Some(Sighting { tick, .. }) => {
            let [then, now] = [finding.head.tick, tick].map(|tick| tick.unwrap_or(0));
            format!("it happens in tick {now}, not in tick {then}")
        }
    };
    Some(format!("{}, but the same actions lead elsewhere the next time: {elsewhere}", finding.head.message))
}

/// Describes how a replayed episode ended.
fn end_of(replayed: &Replayed) -> String {
    match (&replayed.broken, &replayed.end) {
        (Some(broken), _) => format!("{} in tick {}: {}", broken.detector, broken.tick, broken.message),
        (None, Some(end)) => failure_of(end).map_or_else(
            || format!("the goal was reached after {}", counted(u64::from(end.ticks), "tick")),
            |(_, failure)| failure,
        ),
        (None, None) => format!("the episode was not over after {}", counted(replayed.rewards.len() as u64, "tick")),
    }
}

fn setting<'a>(game: &'a dyn Game, (mode, level): &'a (String, u64), played: Played) -> Setting<'a> {
    Setting { game, mode, level: *level, seed: played.seed }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::{
        checks::{LOST, NOT_SOLVED},
        folder::list_findings,
    };
    use bevy_playbot::bot::BlindBot;
    use playbot_corridor::Corridor;
    use std::path::Path;

    fn files(folder: &Path) -> FindingFiles {
        FindingFiles { folder: folder.to_owned(), minimise: None, keep_failures: true, checks: Checks::default() }
    }

    /// Keeps the episode of a player on level 3 of the corridor, as a failed one.
    fn kept(folder: &Path, player: &Player) -> KeptFailure {
        let level = SeenLevel { mode: "plain", level: 3, name: "plain:3" };
        let played = Played { tester: "it", player, observation_config: &ObservationConfig::default(), seed: 5 };
        files(folder).keep_failure(&Corridor::default(), level, played).expect("writable")
    }

    fn lost() -> Vec<ActionValue> {
        vec![ActionValue::Discrete(0); 3]
    }

    #[test]
    fn a_failed_episode_has_a_file_and_one_that_does_not_fail_alone_a_reason() {
        let folder = tempfile::tempdir().expect("a folder");
        let idle = Player::Blind(BlindBot::Constant(ActionValue::Discrete(0)));
        let file = kept(folder.path(), &idle).file().expect("it is lost");
        assert!(file.starts_with("findings/plain-3.lost.it-") && folder.path().join(&file).is_file(), "{file}");
        let KeptFailure::Missing(why) = kept(folder.path(), &Player::Demonstrator) else { panic!("it wins") };
        assert!(why.starts_with("it does not fail when it is played alone: the goal was reached after "), "{why}");
        assert_eq!(list_findings(folder.path()).expect("one").len(), 1);
    }

    #[test]
    fn actions_that_lead_elsewhere_are_not_kept_and_say_where() {
        let folder = tempfile::tempdir().expect("a folder");
        let head = FindingHead::new("plain:3", NOT_SOLVED, "time was up after 30 ticks");
        let stored = files(folder.path()).store(&Corridor::default(), ("plain".to_owned(), 3), head, &lost());
        let why = "time was up after 30 ticks, but its actions lead elsewhere when they are played again: the game ended the \
                   episode after 3 ticks";
        assert_eq!(stored.expect("writable"), KeptFailure::Missing(why.to_owned()));
        assert!(list_findings(folder.path()).is_err(), "nothing is written");
    }

    #[test]
    fn a_replay_that_differs_says_in_what() {
        let (game, checks) = (Corridor::default(), Checks::default());
        let head = FindingHead::new("plain:3", LOST, "lost");
        let found = StoredFinding::of_actions(&game, "plain", 3, head, &lost(), &checks).expect("it is lost");
        let said = |change: &dyn Fn(&mut FindingHead)| {
            let mut other = found.clone();
            change(&mut other.head);
            difference(&game, &other, &checks)
        };
        assert_eq!(said(&|_| {}), None);
        let why =
            |elsewhere: &str| Some(format!("lost, but the same actions lead elsewhere the next time: {elsewhere}"));
        assert_eq!(said(&|head| head.tick = Some(9)), why("it happens in tick 2, not in tick 9"));
        let state = "the state is another one in that tick";
        assert_eq!(said(&|head| head.state_hash = head.state_hash.map(|hash| hash + 1)), why(state));
        let end = "the game ended the episode after 3 ticks";
        assert_eq!(said(&|head| head.detector = NOT_SOLVED.to_owned()), why(end));
    }
}
