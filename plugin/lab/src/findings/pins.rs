//! Pins: known findings that are accepted for a while.

use std::{fs, io, path::Path};

use serde::{Deserialize, Serialize};

use super::{
    date::Date,
    error::{FindingError, io_error},
    file_name::ENDING,
};

/// Name of the file with pins, beside the findings.
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

/// The pins of a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pins(Vec<Pin>);

impl Pins {
    /// Reads a folder's `pins.ron`; there are no pins if there is no such file.
    ///
    /// # Errors
    ///
    /// [`FindingError::Pins`] with line and column, or the file cannot be read.
    pub fn read(folder: &Path) -> Result<Self, FindingError> {
        let path = folder.join(PINS);
        let text = match fs::read_to_string(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            text => text.map_err(io_error("read", &path))?,
        };
        let pins: Vec<Pin> = ron::from_str(&text).map_err(|error| FindingError::Pins {
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

fn name(pin: &Pin) -> &str {
    let ending = pin.finding.strip_suffix(ENDING).and_then(|name| name.strip_suffix('.'));
    ending.unwrap_or(&pin.finding)
}

#[cfg(test)]
mod tests {
    use playbot_learner::HasExitCode as _;

    use super::*;

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
    fn what_is_no_pin_is_told_with_its_line() {
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
