//! Replay of stored findings.

use std::path::{Path, PathBuf};

use playbot_lab::{
    findings::{Date, FindingStatus, Regress, RegressRow, Regression, list_findings, regress_until},
    game::Game,
    games::Games,
    report::PlainTable,
};

use super::detectors::DetectorArgs;
use crate::{
    error::{CliError, Outcome, print_line},
    interrupt,
    number::counted,
    progress,
};

/// Options for stored findings.
#[derive(clap::Args, Clone, Debug)]
pub struct RegressArgs {
    /// Play the findings in this folder again instead, as a test or `playbot replay --minimise` has written them, and
    /// print those that still happen. Exit code 1 if one does, or cannot be played. Findings that are pinned in
    /// DIR/pins.ron do not count until the day after their last. Detectors have the settings with which they found it,
    /// or those of --detector. Ctrl-C ends it with the results so far.
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = [
            "game", "levels", "bot", "policy", "run", "out", "against", "shard", "resume", "force", "minimise",
            "keep_failures", "detect", "no_detect", "par",
        ]
    )]
    regress: Option<PathBuf>,
    /// Date of pins, instead of today.
    #[arg(long, value_name = "YYYY-MM-DD", requires = "regress")]
    today: Option<Date>,
}

impl RegressArgs {
    /// Plays the findings again; `None` without `--regress`.
    pub fn run(
        &self,
        games: &Games,
        detectors: &DetectorArgs,
        threads: usize,
        json: bool,
    ) -> Option<Result<Outcome, CliError>> {
        let today = self.today.unwrap_or_else(Date::today);
        self.regress.as_deref().map(|folder| play(folder, games, detectors, today, threads, json))
    }
}

fn play(
    folder: &Path,
    games: &Games,
    detectors: &DetectorArgs,
    today: Date,
    threads: usize,
    json: bool,
) -> Result<Outcome, CliError> {
    detectors.check_settings(games)?;
    let total = list_findings(folder)?.len() as u64;
    interrupt::listen();
    let bar = progress::bar("replay findings", total, "findings");
    let checks = |game: &dyn Game| detectors.checks(game);
    let request = Regress { folder, games, checks: &checks, today, threads };
    let played = regress_until(&request, &|count| bar.inc(count), &interrupt::asked);
    bar.finish_and_clear();
    let regression = played?;
    if json {
        for row in &regression.rows {
            let line = serde_json::to_string(row)
                .map_err(|error| CliError::Io(format!("the findings cannot be written as JSON: {error}")))?;
            print_line(line)?;
        }
    } else {
        print_line(table(folder, &regression).to_text().trim_end())?;
    }
    tell_all(&regression);
    if regression.left > 0 {
        tell!(
            "stopped; {} of {total} were not played: the same command plays all of them",
            counted(regression.left, "finding")
        );
        return Ok(Outcome::Stopped);
    }
    Ok(if regression.has_alarms() { Outcome::Findings } else { Outcome::Pass })
}

fn table(folder: &Path, regression: &Regression) -> PlainTable {
    let row = |row: &RegressRow| {
        let pin = row.pin.as_ref().map_or_else(String::new, |pin| {
            format!("{} {}: {}", if pin.expired { "expired" } else { "until" }, pin.until, pin.reason)
        });
        let level = row.level.clone().unwrap_or_default();
        let detector = row.detector.clone().unwrap_or_default();
        vec![row.finding.clone(), level, detector, row.status.name().to_owned(), pin, row.message.clone()]
    };
    PlainTable {
        caption: format!("findings in {}", folder.display()),
        columns: ["finding", "level", "detector", "now", "pinned", "message"].map(str::to_owned).to_vec(),
        rows: regression.rows.iter().map(row).collect(),
    }
}

fn tell_all(regression: &Regression) {
    let count = |status| regression.rows.iter().filter(|row| row.status == status).count();
    let pinned = regression.rows.iter().filter(|row| row.pin.as_ref().is_some_and(|pin| !pin.expired)).count();
    let pinned = if pinned > 0 { format!("; {pinned} pinned") } else { String::new() };
    tell!(
        "{}: {} still there, {} there in another way, {} gone, {} unplayable{pinned}",
        counted(regression.rows.len() as u64, "finding"),
        count(FindingStatus::StillThere),
        count(FindingStatus::Changed),
        count(FindingStatus::Gone),
        count(FindingStatus::Unplayable)
    );
    for row in &regression.rows {
        match &row.pin {
            Some(pin) if pin.expired => {
                tell!(
                    "the pin of {} has expired on {} ({}): mend it, or pin it anew",
                    row.finding,
                    pin.until,
                    pin.reason
                );
            }
            Some(_) if row.status == FindingStatus::Gone => {
                tell!("the pin of {} is no longer needed, since it is gone", row.finding);
            }
            _ => {}
        }
    }
    for name in &regression.unknown_pins {
        tell!("there is no finding {name}, though it is pinned: take the pin out, or correct its name");
    }
}
