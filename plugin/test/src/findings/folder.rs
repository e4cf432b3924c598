//! Folders of findings.

use crate::findings::{FindingError, StoredFinding, io_error};
use bevy_playbot::state_hash::StateHash;
use playbot_learner::disk;
use serde::{Deserialize, Serialize};
use std::{
    fmt, fs, io,
    path::{Path, PathBuf},
    str::FromStr,
    time::{SystemTime, UNIX_EPOCH},
};
use thiserror::Error;

/// Name of the folder with findings, in that of a test.
pub const FINDINGS: &str = "findings";

/// Returns the files of findings in a folder and in its `findings`, with their names without ending, sorted by name.
///
/// # Errors
///
/// [`FindingError::None`] if there are no findings, [`FindingError::NoFolder`] if the path is not a folder; or the
/// folder cannot be read.
pub fn list_findings(folder: &Path) -> Result<Vec<(String, PathBuf)>, FindingError> {
    let mut found = files_in(folder).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => FindingError::NoFolder(folder.into()),
        _ => io_error("list", folder)(source),
    })?;
    let below = folder.join(FINDINGS);
    if below.is_dir() {
        found.extend(files_in(&below).map_err(io_error("list", &below))?);
    }
    if found.is_empty() {
        return Err(FindingError::None(folder.into()));
    }
    // The file system's order is not reproducible.
    found.sort();
    Ok(found)
}

/// Returns the first file of a finding in the folder itself, as in the `findings` of a test; `None` without one.
pub fn first_finding(folder: &Path) -> Option<PathBuf> {
    files_in(folder).ok()?.into_iter().min().map(|(_, path)| path)
}

/// Removes the findings of an earlier test from its folder.
///
/// # Errors
///
/// The system cannot remove them.
pub fn clear_findings(folder: &Path) -> Result<(), FindingError> {
    let below = folder.join(FINDINGS);
    if !below.is_dir() {
        return Ok(());
    }
    for (_, file) in files_in(&below).map_err(io_error("list", &below))? {
        disk::remove_file(&file).map_err(io_error("remove", &file))?;
    }
    Ok(())
}

/// Copies the findings of several tests into the folder of another one.
///
/// # Errors
///
/// The system cannot copy them.
pub fn gather_findings(folders: &[PathBuf], out: &Path) -> Result<(), FindingError> {
    for folder in folders {
        let (below, target) = (folder.join(FINDINGS), out.join(FINDINGS));
        if !below.is_dir() {
            continue;
        }
        disk::create_dir_all(&target).map_err(io_error("create", &target))?;
        for (name, file) in files_in(&below).map_err(io_error("list", &below))? {
            let copy = target.join(format!("{name}.{ENDING}"));
            let bytes = fs::read(&file).map_err(io_error("read", &file))?;
            playbot_learner::write_atomically(&copy, &bytes).map_err(io_error("write", &copy))?;
        }
    }
    Ok(())
}

fn files_in(folder: &Path) -> io::Result<Vec<(String, PathBuf)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|ending| ending == ENDING) && path.is_file() {
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            found.push((name, path));
        }
    }
    Ok(found)
}

/// Ending of the files.
pub(super) const ENDING: &str = "finding";

/// Most letters of the descriptive part of a name.
const MOST_LETTERS: usize = 80;

impl StoredFinding {
    /// Returns the name of its file, such as `hard-7.panic.random-1f2e3d4c.finding`: level, detector, tester, and
    /// letters that make it unique. In a test, a minimised finding keeps its name.
    pub fn file_name(&self) -> String {
        let head = &self.head;
        let parts = [Some(&head.level), Some(&head.detector), head.tester.as_ref()];
        let parts: Vec<&str> = parts.into_iter().flatten().map(String::as_str).collect();
        let plain = |letter: char| if letter.is_ascii_alphanumeric() || "-_".contains(letter) { letter } else { '-' };
        let parts: Vec<String> = parts.iter().map(|part| part.chars().map(plain).collect()).collect();
        let text: String = parts.join(".").chars().take(MOST_LETTERS).collect();
        let game = [self.header.game.as_str(), &head.level, &head.detector, head.tester.as_deref().unwrap_or("")];
        let bytes = game.into_iter().chain([head.message.as_str()]).flat_map(|part| {
            // A value that is no byte ends each part.
            part.bytes().map(u64::from).chain([u64::from(u8::MAX) + 1])
        });
        let hash = StateHash::of(bytes.chain([head.seed])).folded();
        format!("{text}-{hash:08x}.{ENDING}")
    }
}

// Dates.

/// Seconds of a day.
pub(crate) const DAY: u64 = 24 * 60 * 60;

/// A date, such as `2027-01-31`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Date {
    year: u16,
    month: u8,
    day: u8,
}

/// The text is not a date.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("`{0}` is not a date: write year, month and day, as in 2027-01-31")]
pub struct DateError(String);

impl Date {
    /// Returns today's date, in universal time.
    pub fn today() -> Self {
        Self::in_days(0)
    }

    /// Returns the date this many days after today, in universal time.
    pub fn in_days(days: u16) -> Self {
        // With a clock before 1970 nothing expires.
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |passed| passed.as_secs());
        Self::of_day(seconds / DAY + u64::from(days))
    }

    /// Returns the date this many days after 1970-01-01.
    pub(crate) fn of_day(mut days: u64) -> Self {
        let mut year = 1970;
        while days >= days_of(year) {
            days -= days_of(year);
            year += 1;
        }
        let mut month = 1;
        while days >= u64::from(days_in(year, month)) {
            days -= u64::from(days_in(year, month));
            month += 1;
        }
        Self { year, month, day: days as u8 + 1 }
    }
}

fn days_of(year: u16) -> u64 {
    (1..=12).map(|month| u64::from(days_in(year, month))).sum()
}

fn days_in(year: u16, month: u8) -> u8 {
    let is_leap = year.is_multiple_of(4) && !year.is_multiple_of(100) || year.is_multiple_of(400);
    match month {
        2 if is_leap => 29,
        2 => 28,
        4 | 6 | 9 | 11 => 30,
        _ => 31,
    }
}

impl FromStr for Date {
    type Err = DateError;

    fn from_str(text: &str) -> Result<Self, DateError> {
        let parse = || {
            let (year, rest) = text.split_once('-')?;
            let (month, day) = rest.split_once('-')?;
            let is_plain = |part: &str, length| part.len() == length && part.bytes().all(|byte| byte.is_ascii_digit());
            if !(is_plain(year, 4) && is_plain(month, 2) && is_plain(day, 2)) {
                return None;
            }
            let date = Self { year: year.parse().ok()?, month: month.parse().ok()?, day: day.parse().ok()? };
            let is_day = (1..=12).contains(&date.month) && (1..=days_in(date.year, date.month)).contains(&date.day);
            is_day.then_some(date)
        };
        parse().ok_or_else(|| DateError(text.to_owned()))
    }
}

impl TryFrom<String> for Date {
    type Error = DateError;

    fn try_from(text: String) -> Result<Self, DateError> {
        text.parse()
    }
}

impl From<Date> for String {
    fn from(date: Date) -> Self {
        date.to_string()
    }
}

impl fmt::Display for Date {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04}-{:02}-{:02}", self.year, self.month, self.day)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::{FindingHead, StoredFinding, testing::stored};
    use playbot_learner::HasExitCode as _;

    #[test]
    fn findings_are_listed_gathered_and_removed() {
        let parent = tempfile::tempdir().expect("a folder");
        let (one, two, all) = (parent.path().join("one"), parent.path().join("two"), parent.path().join("all"));
        for (folder, name) in [(&one, "b.finding"), (&one, "notes.txt"), (&two, "a.finding")] {
            fs::create_dir_all(folder.join(FINDINGS)).expect("writable");
            fs::write(folder.join(FINDINGS).join(name), name).expect("writable");
        }
        gather_findings(&[one.clone(), two, parent.path().join("none")], &all).expect("writable");
        fs::write(all.join("c.finding"), "c").expect("writable");
        let names =
            |folder: &Path| list_findings(folder).map(|found| found.into_iter().map(|(name, _)| name).collect());
        let found: Vec<String> = names(&all).expect("three");
        assert_eq!(found, ["a", "b", "c"]);
        clear_findings(&one).expect("writable");
        let none: Result<Vec<String>, _> = names(&one);
        assert!(matches!(none, Err(FindingError::None(_))));
        assert!(one.join(FINDINGS).join("notes.txt").exists(), "what is no finding stays");
        for no_folder in [parent.path().join("none"), all.join("c.finding")] {
            let error = list_findings(&no_folder).expect_err("no folder");
            assert!(error.is_usage() && error.to_string().contains("is not a folder: name one"), "{error}");
        }
        assert!(list_findings(&one).expect_err("none").to_string().contains("nothing to play again"));
    }

    fn name(head: FindingHead) -> String {
        StoredFinding { head, ..stored() }.file_name()
    }

    #[test]
    fn a_name_says_what_it_is_and_tells_it_from_others() {
        let head = stored().head;
        let first = name(head.clone());
        assert!(first.starts_with("hard-7.panic.random-") && first.ends_with(".finding"), "{first}");
        assert_eq!(name(FindingHead { tick: Some(0), ..head.clone() }), first, "a shorter way is the same finding");
        let others = [
            FindingHead { level: "hard-7".to_owned(), ..head.clone() },
            FindingHead { seed: 6, ..head.clone() },
            FindingHead { message: "it freezes".to_owned(), ..head.clone() },
        ];
        assert!(others.into_iter().all(|other| name(other) != first));
        let long = name(FindingHead { level: "levels/deep/ö/".repeat(40), ..head });
        assert!(long.len() < 110 && long.starts_with("levels-deep--"), "{long}");
    }

    #[test]
    fn days_are_counted_as_the_calendar_has_them() {
        // Checked with `date -u -d @SECONDS`.
        for (days, text) in [(0, "1970-01-01"), (59, "1970-03-01"), (11_016, "2000-02-29"), (20_819, "2027-01-01")] {
            assert_eq!(Date::of_day(days).to_string(), text);
        }
        assert!(Date::today() > "2024-01-01".parse().expect("a day"));
        assert!(Date::today() < Date::in_days(1) && Date::in_days(1) < Date::in_days(400));
    }

    #[test]
    fn only_days_are_days_and_they_have_an_order() {
        let date = |text: &str| text.parse::<Date>();
        for text in ["2027-02-29", "2027-13-01", "2027-00-10", "2027-1-1", "31.1.2027", "", "+027-01-01", "2027-01-31T"]
        {
            assert_eq!(date(text), Err(DateError(text.to_owned())));
        }
        let (one, other) = (date("2027-01-31").expect("a day"), date("2027-02-01").expect("a day"));
        assert!(one < other && date("2028-02-29").is_ok());
    }
}
