//! The replay of all findings of a folder.

use crate::findings::{
    FindingError, FindingStatus, StoredFinding,
    checks::Checks,
    folder::{Date, ENDING, FINDINGS, list_findings},
    io_error,
    keep::{Sighting, recheck},
    play::since_edited,
};
use playbot_harness::{game::Game, games::Games, level_files::read::read_text_file, parallel::on_threads};
use playbot_learner::write_atomically;
use serde::{Deserialize, Serialize};
use std::{
    io,
    path::{Path, PathBuf},
};

/// The folder of findings, and the settings of their replay.
pub struct Regress<'a> {
    /// Folder with findings.
    pub folder: &'a Path,
    /// The games of the program.
    pub games: &'a Games<'a>,
    /// Checks of the detectors of a game.
    pub checks: &'a (dyn Fn(&dyn Game) -> Checks + Sync),
    /// The day on which pins must hold.
    pub today: Date,
    /// Threads. They change no result.
    pub threads: usize,
}

/// A replayed finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RegressRow {
    /// Its name: that of its file, without the ending.
    pub finding: String,
    /// Its file.
    pub path: PathBuf,
    /// The game; `None` for a file that cannot be read, here and below.
    pub game: Option<String>,
    /// The level.
    pub level: Option<String>,
    /// Name of the detector.
    pub detector: Option<String>,
    /// The tester, if the finding needs one.
    pub tester: Option<String>,
    /// Its status.
    pub status: FindingStatus,
    /// The reason or the message.
    pub message: String,
    /// The new sighting.
    pub seen: Option<Sighting>,
    /// Its pin, if it has one.
    pub pin: Option<PinState>,
}

impl RegressRow {
    /// Returns whether it is an alarm: it still happens or cannot be played, and no pin holds.
    pub fn is_alarm(&self) -> bool {
        let is_pinned = self.pin.as_ref().is_some_and(|pin| !pin.expired);
        self.status != FindingStatus::Gone && !is_pinned
    }
}

/// The results of all findings of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// Each finding, in the order of their names.
    pub rows: Vec<RegressRow>,
    /// Names of pins that no finding has.
    pub unknown_pins: Vec<String>,
    /// Findings that were not replayed, because the caller stopped.
    pub left: u64,
}

impl Regression {
    /// Returns whether there are alarms.
    pub fn has_alarms(&self) -> bool {
        self.rows.iter().any(RegressRow::is_alarm)
    }
}

/// Replays all findings of a folder, on several threads. `progress` receives each one that is done.
///
/// # Errors
///
/// There are no findings, or the pins cannot be parsed. Errors of a single finding are in its row.
pub fn regress(request: &Regress, progress: &(dyn Fn(u64) + Sync)) -> Result<Regression, FindingError> {
    regress_until(request, progress, &|| false)
}

/// Replays as [`regress`] does, until the caller stops. The rows are then those of the findings that were replayed by
/// then.
///
/// # Errors
///
/// As for [`regress`].
pub fn regress_until(
    request: &Regress,
    progress: &(dyn Fn(u64) + Sync),
    stop: &(dyn Fn() -> bool + Sync),
) -> Result<Regression, FindingError> {
    let pins = Pins::read(request.folder)?;
    let mut found = list_findings(request.folder)?;
    let played = on_threads(&mut found, request.threads, |(name, path)| {
        if stop() {
            return None;
        }
        let row = row(request, name, path);
        progress(1);
        Some(row)
    });
    let mut rows: Vec<RegressRow> = played.into_iter().flatten().collect();
    for row in &mut rows {
        row.pin = pins.of(&row.finding, request.today);
    }
    let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
    let (unknown_pins, left) = (pins.unknown(&names), (found.len() - rows.len()) as u64);
    Ok(Regression { rows, unknown_pins, left })
}

fn row(request: &Regress, name: &str, path: &Path) -> RegressRow {
    let row = RegressRow {
        finding: name.to_owned(),
        path: path.to_owned(),
        game: None,
        level: None,
        detector: None,
        tester: None,
        status: FindingStatus::Unplayable,
        message: String::new(),
        seen: None,
        pin: None,
    };
    let finding = match StoredFinding::read(path) {
        Ok(finding) => finding,
        Err(error) => return RegressRow { message: error.to_string(), ..row },
    };
    let StoredFinding { header, head, .. } = &finding;
    let row = RegressRow {
        game: Some(header.game.clone()),
        level: Some(head.level.clone()),
        detector: Some(head.detector.clone()),
        tester: head.tester.clone(),
        ..row
    };
    let Some(game) = request.games.iter().find(|game| game.name() == header.game) else {
        let names: Vec<&str> = request.games.iter().map(|game| game.name()).collect();
        let message = format!("this program has no game `{}`, only {}", header.game, names.join(", "));
        return RegressRow { message, ..row };
    };
    let finding = finding.seen_from(game, path);
    let head = &finding.head;
    match recheck(game, &finding, &(request.checks)(game)) {
        Err(why) => RegressRow { message: why.to_string(), ..row },
        Ok(again) => {
            let message = match again.sighting {
                None => "it does not happen any more".to_owned(),
                Some(_) if again.is_same(&finding) => head.message.clone(),
                Some(seen) => format!("{}{}", head.message, elsewhere(seen, &finding)),
            };
            let edited = finding.edited_level(game).map_or_else(String::new, |path| since_edited(&path));
            let (status, message) = (again.status(&finding), format!("{message}{edited}"));
            RegressRow { status, message, seen: again.sighting, ..row }
        }
    }
}

/// Returns the difference to the stored finding, as the end of a message.
fn elsewhere(seen: Sighting, finding: &StoredFinding) -> String {
    match (seen.tick, finding.head.tick) {
        (Some(now), Some(stored)) if now != stored => format!(" (at tick {now}, stored was {stored})"),
        _ => " (in another state than stored)".to_owned(),
    }
}

// Pins of known findings.

/// Name of the file with pins, in the folder of a test or beside its findings.
pub const PINS: &str = "pins.ron";

/// A known finding, with a reason and a last day.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pin {
    /// Name of the finding's file, with its ending or without.
    pub finding: String,
    /// Why it is accepted.
    pub reason: String,
    /// The last day on which it is accepted.
    pub until: Date,
}

/// The state of a pin on a day.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PinState {
    /// Why the finding is accepted.
    pub reason: String,
    /// The last day on which it is accepted.
    pub until: Date,
    /// Whether that day has passed.
    pub expired: bool,
}

/// Largest size of a file of pins, bytes.
const MOST_PIN_BYTES: u64 = 1 << 20;

/// Most brackets at which a new pin is tried.
const MOST_PLACES: usize = 1000;

/// The pins of a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pins(Vec<Pin>);

impl Pins {
    /// Reads the pins of a folder of findings: its `pins.ron`, that of its `findings`, and that of the test's folder if
    /// this is the `findings` of a test. So a test and its findings have the same pins. There are none without a file.
    ///
    /// # Errors
    ///
    /// [`FindingError::Pins`] with line and column, or a file cannot be read.
    pub fn read(folder: &Path) -> Result<Self, FindingError> {
        let mut pins = Self::default();
        for file in pin_files(folder) {
            pins.0.extend(Self::read_file(file)?.0);
        }
        Ok(pins)
    }

    /// Pins a finding: adds a pin to the file of a folder of findings, and makes the file if there is none. Other pins and
    /// comments in it stay as they are. Returns the file.
    ///
    /// # Errors
    ///
    /// [`FindingError::Pins`] if the file cannot be parsed, or it cannot be read or written. It is unchanged then.
    pub fn add(folder: &Path, pin: &Pin) -> Result<PathBuf, FindingError> {
        let path = pin_files(folder).into_iter().find(|file| file.exists()).unwrap_or_else(|| folder.join(PINS));
        let text = text_of(&path)?;
        let before = Self::parse(&path, text.as_deref().unwrap_or("[]"))?;
        let fresh = written(pin).map_err(|error| io_error("write", &path)(io::Error::other(error.to_string())))?;
        let after = Self([before.0.clone(), vec![pin.clone()]].concat());
        let added = match &text {
            Some(text) => with_pin(text, &fresh, &|text| Self::parse(&path, text).is_ok_and(|pins| pins == after)),
            None => Some(format!("[\n    {fresh},\n]\n")),
        };
        // No file that parses is without a place for one more.
        let Some(added) = added else {
            let message = format!("there is no place for another pin: write {fresh} into it by hand");
            return Err(FindingError::Pins { path, line: 1, column: 1, message });
        };
        write_atomically(&path, added.as_bytes()).map_err(io_error("write", &path))?;
        Ok(path)
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    fn read_file(path: PathBuf) -> Result<Self, FindingError> {
        text_of(&path)?.map_or_else(|| Ok(Self::default()), |text| Self::parse(&path, &text))
    }

    fn parse(path: &Path, text: &str) -> Result<Self, FindingError> {
        let path = path.to_owned();
        let pins: Vec<Pin> = ron::from_str(text).map_err(|error| FindingError::Pins {
            path: path.clone(),
            line: error.span.start.line,
            column: error.span.start.col,
            message: error.code.to_string(),
        })?;
        if let Some(pin) = pins.iter().find(|pin| pin.reason.trim().is_empty()) {
            let line = 1 + text.lines().position(|line| line.contains(&pin.finding)).unwrap_or(0);
            let message = format!("`{}` is pinned without a reason", pin.finding);
            return Err(FindingError::Pins { path, line, column: 1, message });
        }
        Ok(Self(pins))
    }

    /// Returns the pin of a finding, by its name without ending. Of several it is the one with the last date.
    pub fn of(&self, finding: &str, today: Date) -> Option<PinState> {
        let pin = self.0.iter().filter(|pin| name(pin) == finding).max_by_key(|pin| pin.until)?;
        Some(PinState { reason: pin.reason.clone(), until: pin.until, expired: pin.until < today })
    }

    /// Returns the names of pins without a finding.
    pub fn unknown(&self, findings: &[&str]) -> Vec<String> {
        self.0.iter().map(name).filter(|name| !findings.contains(name)).map(str::to_owned).collect()
    }
}

/// Returns the files that may have the pins of a folder of findings.
fn pin_files(folder: &Path) -> Vec<PathBuf> {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let above = whole.parent().filter(|_| whole.ends_with(FINDINGS)).map(Path::to_owned);
    let folders = [folder.to_owned(), folder.join(FINDINGS)].into_iter().chain(above);
    folders.map(|folder| folder.join(PINS)).collect()
}

/// Reads a file of pins; `None` if there is none.
fn text_of(path: &Path) -> Result<Option<String>, FindingError> {
    match read_text_file(path, MOST_PIN_BYTES).map_err(io::Error::from) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        text => text.map(Some).map_err(io_error("read", path)),
    }
}

/// Returns a pin as RON, in a line.
fn written(pin: &Pin) -> Result<String, ron::Error> {
    let Pin { finding, reason, until } = pin;
    let [finding, reason] = [finding, reason].map(ron::to_string);
    Ok(format!("(finding: {}, reason: {}, until: \"{until}\")", finding?, reason?))
}

/// Adds a pin to the text of a list, so that the result is as wanted. A bracket may stand in a comment or in a reason, and
/// a comma behind the last pin or not, so the places are tried from the end.
fn with_pin(text: &str, pin: &str, is_wanted: &dyn Fn(&str) -> bool) -> Option<String> {
    let places = text.rmatch_indices(']').map(|(place, _)| place);
    places.take(MOST_PLACES).find_map(|place| {
        let (before, after) = text.split_at(place);
        // Not at the end of a line with a comment, which would swallow it.
        let before = before.trim_end();
        let added = ["\n    ", ",\n    ", "\n    ,"].map(|between| format!("{before}{between}{pin},\n{after}"));
        added.into_iter().find(|added| is_wanted(added))
    })
}

fn name(pin: &Pin) -> &str {
    let ending = pin.finding.strip_suffix(ENDING).and_then(|name| name.strip_suffix('.'));
    ending.unwrap_or(&pin.finding)
}

#[cfg(test)]
mod tests {
    use playbot_learner::HasExitCode as _;

    use super::*;
    use std::fs;

    fn read(text: &str) -> Result<Pins, FindingError> {
        let folder = tempfile::tempdir().expect("a folder");
        fs::write(folder.path().join(PINS), text).expect("writable");
        Pins::read(folder.path())
    }

    #[test]
    fn a_pin_holds_up_to_its_last_day() {
        let pins = read(
            r#"[
                // Known since the last release.
                (finding: "a", reason: "the artist is ill", until: "2027-01-31"),
                (finding: "b.finding", reason: "new rules come", until: "2026-12-01"),
            ]"#,
        )
        .expect("pins");
        let expired = |name: &str, day: &str| pins.of(name, day.parse().expect("a day")).map(|pin| pin.expired);
        assert_eq!((expired("a", "2027-01-31"), expired("a", "2027-02-01")), (Some(false), Some(true)));
        assert_eq!((expired("b", "2026-01-01"), expired("c", "2026-01-01")), (Some(false), None));
        assert_eq!(pins.unknown(&["a", "c"]), ["b"]);
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(Pins::read(folder.path()).expect("none"), Pins::default());
    }

    #[test]
    fn a_test_and_its_findings_have_the_same_pins() {
        let folder = tempfile::tempdir().expect("a folder");
        let below = folder.path().join(FINDINGS);
        fs::create_dir(&below).expect("writable");
        let pin = |name: &str| format!("[(finding: \"{name}\", reason: \"known\", until: \"2027-01-31\")]");
        fs::write(folder.path().join(PINS), pin("a")).expect("writable");
        fs::write(below.join(PINS), pin("b")).expect("writable");
        let today = "2027-01-01".parse().expect("a day");
        for place in [folder.path(), &below] {
            let pins = Pins::read(place).expect("pins");
            assert_eq!(["a", "b", "c"].map(|name| pins.of(name, today).is_some()), [true, true, false]);
        }
        // Another folder knows nothing of those above it.
        let other = folder.path().join("other");
        fs::create_dir(&other).expect("writable");
        assert_eq!(Pins::read(&other).expect("none"), Pins::default());
        fs::write(below.join(PINS), "a").expect("writable");
        let error = Pins::read(folder.path()).expect_err("no pins").to_string();
        assert!(error.contains("findings/pins.ron, line 1"), "{error}");
    }

    #[test]
    fn a_pin_is_added_and_what_was_there_stays() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join(PINS);
        let pin = |name: &str| Pin {
            finding: name.to_owned(),
            reason: "a \"quoted\" [reason],\n§ of two lines // no comment".to_owned(),
            until: "2027-01-31".parse().expect("a day"),
        };
        let one = "(finding: \"a\", reason: \"]\", until: \"2027-01-31\")";
        for text in [
            None,
            Some("[]".to_owned()),
            Some("[ // none yet\n]\n".to_owned()),
            Some(format!("[{one}]")),
            Some(format!("[\n    // Known.\n    {one}, // see [1]\n]\n// [1]: the list\n")),
            Some(format!("[{one} // no comma\n]")),
            Some(format!("[{one}, /* ] */ ] /* ] */")),
        ] {
            match &text {
                Some(text) => fs::write(&file, text).expect("writable"),
                None => drop(fs::remove_file(&file)),
            }
            let before = Pins::read(folder.path()).expect("pins").0;
            for name in ["x", "y.finding"] {
                assert_eq!(Pins::add(folder.path(), &pin(name)).expect("writable"), file);
            }
            let after = Pins::read(folder.path()).expect("pins").0;
            assert_eq!(after, [before, vec![pin("x"), pin("y.finding")]].concat(), "{text:?}");
            let now = fs::read_to_string(&file).expect("written");
            for comment in ["// none yet", "// Known.", "// see [1]", "// [1]: the list", "// no comma"] {
                let was_there = text.as_ref().is_some_and(|text| text.contains(comment));
                assert!(!was_there || now.contains(comment), "{comment} is lost: {now}");
            }
        }
        fs::write(&file, "[a]").expect("writable");
        assert!(Pins::add(folder.path(), &pin("x")).is_err_and(|error| error.is_usage()));
        assert_eq!(fs::read_to_string(&file).expect("there"), "[a]", "a file that is not understood is left alone");
        // The pins of the findings are used if the test has none of its own.
        fs::remove_file(&file).expect("it is there");
        let below = folder.path().join(FINDINGS);
        fs::create_dir(&below).expect("writable");
        fs::write(below.join(PINS), format!("[{one}]")).expect("writable");
        assert_eq!(Pins::add(folder.path(), &pin("x")).expect("writable"), below.join(PINS));
        assert!(!file.exists());
    }

    #[test]
    fn what_is_no_pin_is_reported_with_its_line() {
        for (text, parts) in [
            ("[\n(finding: \"a\", reason: \"b\", until: \"soon\")]", ["line 2", "`soon` is not a date"]),
            ("[(finding: \"a\", until: \"2027-01-31\")]", ["line 1", "reason"]),
            ("[(finding: \"a\", reason: \" \", until: \"2027-01-31\")]", ["line 1", "`a` is pinned without a reason"]),
            ("[(finding: \"a\", why: \"b\", until: \"2027-01-31\")]", ["line 1", "why"]),
            ("a", ["pins.ron, line 1", "write [(finding: "]),
        ] {
            let error = read(text).expect_err(text);
            assert!(error.is_usage() && parts.iter().all(|part| error.to_string().contains(part)), "{error}");
        }
    }
}
