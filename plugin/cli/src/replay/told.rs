//! Report of a finding that was played again.

use std::path::Path;

use playbot_lab::findings::{FindingStatus, Minimised, Recheck, StoredFinding};
use serde_json::{Value, json};

use crate::{
    error::{CliError, print_line},
    number::counted,
};

/// A finding and the result of its replay.
pub struct Told<'a> {
    /// Its file.
    pub path: &'a Path,
    /// The finding as stored.
    pub finding: &'a StoredFinding,
    /// The result of playing it again.
    pub again: &'a Recheck,
    /// The shorter one, and its file.
    pub shorter: Option<(&'a Minimised, &'a Path)>,
}

impl Told<'_> {
    /// Prints it: as a line of JSON, or as text.
    ///
    /// # Errors
    ///
    /// Standard output is closed.
    pub fn tell(&self, as_json: bool) -> Result<(), CliError> {
        if as_json {
            return print_line(self.json());
        }
        print_line(self.sentence())?;
        self.shorter_sentence().map_or(Ok(()), print_line)
    }

    fn json(&self) -> Value {
        let StoredFinding { header, head, episode } = self.finding;
        let shorter = self.shorter.map(|(shorter, path)| {
            json!({
                "path": path.display().to_string(), "ticks": shorter.finding.episode.len(), "replays": shorter.replays,
                "is_minimal": shorter.is_minimal,
            })
        });
        json!({
            "finding": self.path.display().to_string(), "game": header.game, "mode": header.mode, "level": head.level,
            "detector": head.detector, "tester": head.tester, "message": head.message, "tick": head.tick,
            "state_hash": head.state_hash, "ticks": episode.len(), "original_ticks": head.original_ticks,
            "status": self.again.status(self.finding), "seen": self.again.sighting, "minimised": shorter,
        })
    }

    fn sentence(&self) -> String {
        let StoredFinding { header, head, episode } = self.finding;
        let who = head.tester.as_ref().map_or_else(String::new, |tester| format!(", played by {tester}"));
        let at = |tick: Option<u32>| tick.map_or_else(String::new, |tick| format!(" at tick {tick}"));
        let now = match self.again.status(self.finding) {
            FindingStatus::StillThere => format!("it happens again{}, with the same state", at(head.tick)),
            FindingStatus::Changed => {
                let seen = self.again.sighting.and_then(|seen| seen.tick);
                format!(
                    "it happens again, but not as stored:{} instead of{}, or in another state",
                    at(seen),
                    at(head.tick)
                )
            }
            FindingStatus::Gone | FindingStatus::Unplayable => "it does not happen any more".to_owned(),
        };
        let ticks =
            if episode.is_empty() { String::new() } else { format!(" ({})", counted(episode.len() as u64, "tick")) };
        format!("{} {}{who}{ticks}: {}: {}\n{now}", header.game, head.level, head.detector, head.message)
    }

    fn shorter_sentence(&self) -> Option<String> {
        let (shorter, path) = self.shorter?;
        let (now, original) = (shorter.finding.episode.len(), self.finding.head.original_ticks);
        let [before, after] = shorter.efforts;
        let percent = 100.0 * now as f64 / f64::from(original.max(1));
        let end =
            if shorter.is_minimal { "" } else { "; the budget was used up before nothing more could be left out" };
        Some(format!(
            "{}: {} of {original} ({percent:.0} %), {} of {before} that do something, after {}{end}",
            path.display(),
            counted(now as u64, "tick"),
            counted(after.into(), "action"),
            counted(shorter.replays.into(), "replay")
        ))
    }
}
