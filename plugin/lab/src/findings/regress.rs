//! Playing all findings of a folder again.

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

/// What is played again, and how.
pub struct Regress<'a> {
    /// Folder with findings.
    pub folder: &'a Path,
    /// The games of the program.
    pub games: &'a Games<'a>,
    /// Checks of the detectors of a game.
    pub checks: &'a (dyn Fn(&dyn Game) -> Checks + Sync),
    /// The day for which pins are asked.
    pub today: Date,
    /// Threads: not part of the result.
    pub threads: usize,
}

/// A finding that was played again.
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
    /// What found it.
    pub detector: Option<String>,
    /// Who played, if somebody had to.
    pub tester: Option<String>,
    /// What became of it.
    pub status: FindingStatus,
    /// Why, or what is wrong.
    pub message: String,
    /// Where it was seen now.
    pub seen: Option<Sighting>,
    /// Its pin, if it has one.
    pub pin: Option<PinState>,
}

impl RegressRow {
    /// Whether it is a reason to complain: it is still there or cannot be played, and no pin holds.
    pub fn is_alarm(&self) -> bool {
        let is_pinned = self.pin.as_ref().is_some_and(|pin| !pin.expired);
        self.status != FindingStatus::Gone && !is_pinned
    }
}

/// What became of all findings of a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// Each finding, in the order of their names.
    pub rows: Vec<RegressRow>,
    /// Names of pins that no finding has.
    pub unknown_pins: Vec<String>,
    /// Findings that were not played, since somebody asked to stop.
    pub left: u64,
}

impl Regression {
    /// Whether there is something to complain about.
    pub fn has_alarms(&self) -> bool {
        self.rows.iter().any(RegressRow::is_alarm)
    }
}

/// Plays all findings of a folder again, on several threads. `progress` hears each that is done.
///
/// # Errors
///
/// There are none, or the pins cannot be understood. What is wrong with a single finding is told in its row.
pub fn regress(request: &Regress, progress: &(dyn Fn(u64) + Sync)) -> Result<Regression, FindingError> {
    regress_until(request, progress, &|| false)
}

/// [`regress`], until somebody asks to stop: then the rows are those of the findings that were played by then.
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

/// What is not as stored, behind a message.
fn elsewhere(seen: Sighting, finding: &StoredFinding) -> String {
    match (seen.tick, finding.head.tick) {
        (Some(now), Some(stored)) if now != stored => format!(" (at tick {now}, stored was {stored})"),
        _ => " (in another state than stored)".to_owned(),
    }
}
