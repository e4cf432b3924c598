//! The replay of all findings of a folder.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{
    checks::Checks,
    date::Date,
    error::FindingError,
    folder::list_findings,
    pins::{PinState, Pins},
    recheck::{Sighting, recheck},
    status::FindingStatus,
    stored::StoredFinding,
};
use crate::{game::Game, games::Games, parallel::on_threads};

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
            let status = again.status(&finding);
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
