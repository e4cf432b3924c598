//! Findings of a folder, with what was decided on them.
//!
//! Decisions are where tests look for them: a finding is kept if its file is among the regression tests, and pinned if
//! `pins.ron` says so. So nothing has to be remembered besides.

use crate::error::CliError;
use playbot_report::counted;
use playbot_test::{
    findings::{Date, FindingError, PinState, Pins, StoredFinding, list_findings},
    verdict::{Finding, RESULTS, ResultLines},
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The decision on a finding that is among the regression tests.
pub(super) const KEPT: &str = "kept";

/// The decision on a finding whose pin holds.
pub(super) const PINNED: &str = "pinned";

/// A finding, and what was decided on it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct ListedFinding {
    /// The name of its file without the ending; `None` without a file.
    pub finding: Option<String>,
    /// Its file.
    pub path: Option<PathBuf>,
    /// The game; `None` for a file that cannot be read, here and below.
    pub game: Option<String>,
    /// The level.
    pub level: Option<String>,
    /// The detector.
    pub detector: Option<String>,
    /// The tester, if the finding needs one.
    pub tester: Option<String>,
    /// The tick of the episode, if the finding needs play.
    pub tick: Option<u32>,
    /// The message.
    pub message: Option<String>,
    /// The reason why it cannot be played.
    pub problem: Option<String>,
    /// What was decided: [`KEPT`], [`PINNED`], or nothing.
    pub decision: Option<&'static str>,
    /// Its file among the regression tests.
    pub kept: Option<PathBuf>,
    /// Its pin.
    pub pin: Option<PinState>,
}

impl ListedFinding {
    /// Notes what follows from the file among the regression tests and from the pin.
    pub fn decide(&mut self) {
        let is_pinned = self.pin.as_ref().is_some_and(|pin| !pin.expired);
        self.decision = match (&self.kept, is_pinned) {
            (Some(_), _) => Some(KEPT),
            (None, true) => Some(PINNED),
            (None, false) => None,
        };
    }

    /// Returns its name, or what it says of itself.
    pub fn title(&self) -> String {
        let of = |part: &Option<String>| part.clone().unwrap_or_default();
        let tester = self.tester.as_ref().map_or_else(String::new, |tester| format!(" ({tester})"));
        let described = || format!("{} {}{tester}: {}", of(&self.level), of(&self.detector), of(&self.message));
        self.finding.clone().unwrap_or_else(described)
    }

    fn of_file(name: String, path: PathBuf) -> Self {
        let known = Self { finding: Some(name), path: Some(path.clone()), ..Self::unknown() };
        match StoredFinding::read(&path) {
            Err(error) => Self { problem: Some(error.to_string()), ..known },
            Ok(StoredFinding { header, head, .. }) => Self {
                game: Some(header.game),
                level: Some(head.level),
                detector: Some(head.detector),
                tester: head.tester,
                tick: head.tick,
                message: Some(head.message),
                ..known
            },
        }
    }

    /// Lists a finding of results that has no file.
    fn of_results(game: &str, level: &str, finding: &Finding) -> Self {
        let problem = "it has no file: it did not happen again when it was played alone, or its detector has no check";
        Self {
            game: Some(game.to_owned()),
            level: Some(level.to_owned()),
            detector: Some(finding.detector.clone()),
            tester: finding.tester.clone(),
            tick: finding.tick,
            message: Some(finding.message.clone()),
            problem: Some(problem.to_owned()),
            ..Self::unknown()
        }
    }

    fn unknown() -> Self {
        Self {
            finding: None,
            path: None,
            game: None,
            level: None,
            detector: None,
            tester: None,
            tick: None,
            message: None,
            problem: None,
            decision: None,
            kept: None,
            pin: None,
        }
    }
}

/// Returns the file of a finding among the regression tests.
pub(super) fn kept_as(regressions: &Path, name: &str) -> PathBuf {
    regressions.join(format!("{name}.finding"))
}

/// Lists the findings of a folder: those with a file by name, and then those of the results without one.
///
/// # Errors
///
/// There is no such folder, it has neither results nor findings, or the results or pins are damaged.
pub(super) fn list(folder: &Path, regressions: &Path) -> Result<Vec<ListedFinding>, CliError> {
    let has_results = folder.join(RESULTS).exists();
    let files = match list_findings(folder) {
        Ok(files) => files,
        Err(FindingError::None(_)) if has_results => Vec::new(),
        Err(FindingError::None(_) | FindingError::NoFolder(_)) => {
            let what = if folder.is_dir() { "has neither results nor findings" } else { "is no folder" };
            return Err(CliError::Usage(format!(
                "{} {what}: name the folder of a test, which `playbot test GAME --out DIR` writes",
                folder.display()
            )));
        }
        Err(error) => return Err(error.into()),
    };
    let mut listed: Vec<ListedFinding> =
        files.into_iter().map(|(name, path)| ListedFinding::of_file(name, path)).collect();
    if has_results {
        let mut lines = ResultLines::open(folder)?;
        let game = lines.record().game.clone();
        while let Some(level) = lines.next_level()? {
            let without = level.findings.iter().filter(|finding| finding.file.is_none());
            listed.extend(without.map(|finding| ListedFinding::of_results(&game, &level.level, finding)));
            // A file may have been deleted by hand.
            let gone = level.findings.iter().filter_map(|finding| Some((finding, folder.join(finding.file.as_ref()?))));
            for (finding, file) in gone.filter(|(_, file)| !file.exists()) {
                let problem = Some(format!("its file {} is gone: test the level again", file.display()));
                listed.push(ListedFinding { problem, ..ListedFinding::of_results(&game, &level.level, finding) });
            }
        }
    }
    let (pins, today) = (Pins::read(folder)?, Date::today());
    for finding in &mut listed {
        let Some(name) = &finding.finding else { continue };
        finding.pin = pins.of(name, today);
        finding.kept = Some(kept_as(regressions, name)).filter(|file| file.exists());
        finding.decide();
    }
    let damaged = listed.iter().filter(|finding| finding.path.is_some() && finding.problem.is_some()).count();
    if damaged > 0 {
        report!("warning: {} of {} cannot be read", counted(damaged as u64, "file"), folder.display());
    }
    Ok(listed)
}
