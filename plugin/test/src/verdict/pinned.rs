//! Pinned findings in results: for a while they do not count.

use crate::{
    findings::{Date, LOST, NOT_SOLVED, PinState, Pins, StoredFinding, list_findings},
    verdict::{Finding, LevelOutcome, LevelVerdict, error::TestError, results::ResultLines},
};
use playbot_report::counted;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};

/// The pins of a test that hold on a day, by what they are about.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PinnedFindings {
    /// Pins by the names of findings.
    findings: BTreeMap<String, PinState>,
    /// Pins of failed episodes by their levels. Such an episode is kept for a level without findings.
    failed: BTreeMap<String, PinState>,
}

impl PinnedFindings {
    /// Reads the pins in the folder of a test.
    ///
    /// # Errors
    ///
    /// [`TestError::Finding`]: the pins cannot be read.
    pub fn read(folder: &Path, today: Date) -> Result<Self, TestError> {
        let pins = Pins::read(folder)?;
        let files = if pins.is_empty() { Vec::new() } else { list_findings(folder).unwrap_or_default() };
        Ok(Self::of(&pins, &files, today))
    }

    /// Takes those pins that hold, of findings with these names and files.
    pub fn of(pins: &Pins, files: &[(String, PathBuf)], today: Date) -> Self {
        let mut pinned = Self::default();
        for (name, path) in files {
            let Some(pin) = pins.of(name, today).filter(|pin| !pin.expired) else { continue };
            let stored = StoredFinding::read(path).ok();
            let failed = stored.filter(|stored| [LOST, NOT_SOLVED].contains(&stored.head.detector.as_str()));
            if let Some(stored) = failed {
                pinned.failed.insert(stored.head.level, pin.clone());
            }
            pinned.findings.insert(name.clone(), pin);
        }
        pinned
    }

    /// Returns the number of pinned findings.
    pub fn len(&self) -> usize {
        self.findings.len()
    }

    /// Returns whether nothing is pinned.
    pub fn is_empty(&self) -> bool {
        self.findings.is_empty()
    }

    /// Returns the pin of a finding.
    pub fn of_finding(&self, finding: &Finding) -> Option<&PinState> {
        self.findings.get(Path::new(finding.file.as_ref()?).file_stem()?.to_str()?)
    }

    /// Returns the pin of a level that no tester solved and that has no finding: that of its failed episode.
    pub fn of_unsolved(&self, level: &LevelVerdict) -> Option<&PinState> {
        let is_unsolved = level.outcome == LevelOutcome::BotFailed && level.findings.is_empty();
        self.failed.get(&level.level).filter(|_| is_unsolved)
    }

    /// Returns the pins of a level that does not count: all that is wrong with it is pinned. There are none otherwise.
    pub fn of_level(&self, level: &LevelVerdict) -> Vec<&PinState> {
        if level.is_sound() || level.is_regression() {
            return Vec::new();
        }
        let pins: Option<Vec<&PinState>> = match level.findings.as_slice() {
            [] => self.of_unsolved(level).map(|pin| vec![pin]),
            findings => findings.iter().map(|finding| self.of_finding(finding)).collect(),
        };
        pins.unwrap_or_default()
    }

    /// Counts the levels of results that do not count.
    ///
    /// # Errors
    ///
    /// The results cannot be read.
    pub fn excused(&self, folder: &Path) -> Result<u64, TestError> {
        if self.is_empty() {
            return Ok(0);
        }
        let (mut excused, mut lines) = (0, ResultLines::open(folder)?);
        while let Some(level) = lines.next_level()? {
            excused += u64::from(!self.of_level(&level).is_empty());
        }
        Ok(excused)
    }
}

impl PinnedFindings {
    /// Describes the pin of a finding, for reports; `None` without a pin.
    pub fn describe(&self, finding: &Finding) -> Option<String> {
        self.of_finding(finding).map(pinned_words)
    }

    /// Describes the pin of the failed episode of a level that has no findings, for reports; `None` without a pin.
    pub fn describe_failure(&self, level: &LevelVerdict) -> Option<String> {
        self.of_unsolved(level).map(pinned_words)
    }

    /// Describes the pins of a level, for reports; `None` without pins. If something else is wrong with it, each pin has
    /// the name of its detector.
    pub fn describe_level(&self, level: &LevelVerdict) -> Option<String> {
        let all: BTreeSet<String> = self.of_level(level).into_iter().map(pinned_words).collect();
        let words = if all.is_empty() {
            let some = level.findings.iter();
            some.filter_map(|finding| Some(format!("{} {}", finding.detector, self.describe(finding)?))).collect()
        } else {
            all
        };
        let more = words.len().saturating_sub(MOST_PINS);
        let mut listed: Vec<String> = words.into_iter().take(MOST_PINS).collect();
        listed.extend((more > 0).then(|| format!("and {}", counted(more as u64, "more pin"))));
        (!listed.is_empty()).then(|| listed.join("; "))
    }
}

/// Most different pins of a level that are described.
const MOST_PINS: usize = 3;

/// Describes a pin that holds.
pub(super) fn pinned_words(pin: &PinState) -> String {
    format!("pinned until {}: {}", pin.until, pin.reason)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::{
        findings::{PINS, testing::course},
        verdict_report::testing::{finding, level},
    };
    use std::fs;

    pub(crate) use crate::verdict_report::testing::{in_file, pin};

    #[test]
    fn a_level_does_not_count_if_all_its_findings_are_pinned_today() {
        let folder = tempfile::tempdir().expect("a folder");
        pin(folder.path(), &["a", "b"], "2027-01-31");
        let read = |day: &str| PinnedFindings::read(folder.path(), day.parse().expect("a day")).expect("pins");
        let pinned = read("2027-01-31");
        let with = |findings: &[Finding]| LevelVerdict { findings: findings.to_vec(), ..level(0, 0, 9, 0) };
        let reasons = |level: &LevelVerdict| pinned.of_level(level).len();
        assert_eq!(
            (pinned.len(), reasons(&with(&[in_file("a")])), reasons(&with(&[in_file("a"), in_file("b")]))),
            (2, 1, 2)
        );
        for level in [
            with(&[in_file("a"), in_file("c")]),
            with(&[finding("panic", "it has no file")]),
            with(&[]),
            level(1, 9, 9, 30),
            LevelVerdict { recorded: Some(course(80)), ..with(&[in_file("a")]) },
        ] {
            assert_eq!(reasons(&level), 0, "{level:?}");
        }
        let words = pinned.of_finding(&in_file("a")).map(pinned_words);
        assert_eq!(words.as_deref(), Some("pinned until 2027-01-31: drawn anew in spring"));
        let described = |findings: &[Finding]| pinned.describe_level(&with(findings));
        assert_eq!(described(&[in_file("a"), in_file("b")]), words, "equal pins are described once");
        let one = described(&[in_file("a"), in_file("c")]);
        assert_eq!(one.as_deref(), Some("panic pinned until 2027-01-31: drawn anew in spring"));
        assert_eq!((described(&[in_file("c")]), described(&[])), (None, None));
        assert!(read("2027-02-01").is_empty(), "they have expired");
        fs::write(folder.path().join(PINS), "[a]").expect("writable");
        let error = PinnedFindings::read(folder.path(), Date::today()).expect_err("no pins");
        assert!(error.to_string().contains("pins.ron, line 1"), "{error}");
        assert_eq!(playbot_learner::HasExitCode::exit_code(&error), 3);
    }
}
