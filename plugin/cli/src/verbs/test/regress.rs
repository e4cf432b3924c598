//! Replay of stored findings, and detectors on the command line.

use crate::{
    arguments::check_start,
    error::{CliError, Outcome},
    output::{print_line, print_table},
    progress,
    progress::interrupt,
};
use playbot_harness::{game::Game, games::Games, split::LevelSplit};
use playbot_report::{PlainTable, counted};
use playbot_test::{
    detectors::{ALWAYS, DetectorChoice, DetectorError, DetectorInfo, Detectors, Pars, TIMING, forget_timing, list},
    findings::{
        Checks, Date, FindingStatus, PinState, Pins, Regress, RegressRow, Regression, StoredFinding, list_findings,
        regress_until,
    },
    verdict::{LevelPars, PinnedFindings, ResultLines, maps::level_name},
};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

/// Options for stored findings.
#[derive(clap::Args, Clone, Debug)]
pub struct RegressArgs {
    /// Play the findings in this folder again instead, as a test or `playbot replay FINDING --minimise --out FILE.finding`
    /// has written them, and print those that still happen. Exit code 1 if one does, or cannot be played. Findings that are
    /// pinned in a pins.ron, in the folder of the test or beside the findings, do not count until the day after their
    /// last. Detectors have the settings with which they found it, or those of --detector. Ctrl-C ends it with the results
    /// so far.
    #[arg(
        long,
        value_name = "DIR",
        conflicts_with_all = [
            "game", "levels", "bot", "policy", "run", "checkpoint", "greedy", "episodes", "seed", "out", "history", "against", "shard",
            "resume", "force", "minimise", "keep_failures", "detect", "no_detect", "par",
        ]
    )]
    regress: Option<PathBuf>,
    /// Date of pins, instead of today.
    // That it needs --regress is not said of a test, which that option conflicts with.
    #[arg(long, value_name = "YYYY-MM-DD", requires = "regress", conflicts_with = "game")]
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
    let found = list_findings(folder)?;
    check_starts(&found, games)?;
    let total = found.len() as u64;
    interrupt::leave("nothing is kept: the same command plays all of them".to_owned());
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
        print_table(&table(folder, &regression))?;
    }
    report_all(&regression);
    if regression.left > 0 {
        report!(
            "stopped; {} of {total} were not played: the same command plays all of them",
            counted(regression.left, "finding")
        );
        return Ok(Outcome::Stopped);
    }
    Ok(if regression.has_alarms() { Outcome::Findings } else { Outcome::Pass })
}

/// Checks that the games of the findings start. Otherwise each of them would be gone.
fn check_starts(findings: &[(String, PathBuf)], games: &Games) -> Result<(), CliError> {
    let mut started = BTreeSet::new();
    // Those that cannot be read or played are reported with the others.
    for finding in findings.iter().filter_map(|(_, path)| StoredFinding::read(path).ok()) {
        let (mode, level) = (&finding.header.mode, finding.episode.level_seed);
        if let Ok(game) = games.get(&finding.header.game)
            && started.insert((game.name(), mode.clone()))
        {
            check_start(game, mode, level)?;
        }
    }
    Ok(())
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

fn report_all(regression: &Regression) {
    let count = |status| regression.rows.iter().filter(|row| row.status == status).count();
    let pinned = regression.rows.iter().filter(|row| row.pin.as_ref().is_some_and(|pin| !pin.expired)).count();
    let pinned = if pinned > 0 { format!("; {pinned} pinned") } else { String::new() };
    report!(
        "{}: {} still there, {} there in another way, {} gone, {} unplayable{pinned}",
        counted(regression.rows.len() as u64, "finding"),
        count(FindingStatus::StillThere),
        count(FindingStatus::Changed),
        count(FindingStatus::Gone),
        count(FindingStatus::Unplayable)
    );
    for row in &regression.rows {
        match &row.pin {
            Some(pin) if pin.expired => report!("{}", expired(&row.finding, pin)),
            Some(_) if row.status == FindingStatus::Gone => {
                report!("the pin of {} is no longer needed, since it is gone", row.finding);
            }
            _ => {}
        }
    }
    regression.unknown_pins.iter().for_each(|name| report!("{}", unknown(name)));
}

/// Describes a pin that has expired.
fn expired(name: &str, pin: &PinState) -> String {
    format!("the pin of {name} has expired on {} ({}): mend it, or pin it anew", pin.until, pin.reason)
}

/// Describes a pin without a finding.
fn unknown(name: &str) -> String {
    format!("there is no finding {name}, though it is pinned: take the pin out, or correct its name")
}

// Pins in a test.

/// The levels that do not count because all that is wrong with them is pinned.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct PinnedLevels {
    /// Their number.
    pub excused: u64,
    /// What is to be said of the pins.
    pub words: Vec<String>,
}

impl PinnedLevels {
    /// Finds them in the results of a folder, by its pins.
    ///
    /// # Errors
    ///
    /// The results or the pins cannot be read.
    pub fn of(folder: &Path) -> Result<Self, CliError> {
        let (pins, today) = (Pins::read(folder)?, Date::today());
        if pins.is_empty() {
            return Ok(Self::default());
        }
        let files = list_findings(folder).unwrap_or_default();
        let states = files.iter().filter_map(|(name, _)| Some((name, pins.of(name, today)?)));
        let mut words: Vec<String> =
            states.filter(|(_, pin)| pin.expired).map(|(name, pin)| expired(name, &pin)).collect();
        let pinned = PinnedFindings::of(&pins, &files, today);
        let excused = pinned.excused(folder)?;
        if !pinned.is_empty() {
            let findings = counted(pinned.len() as u64, "pinned finding");
            words.push(format!("{findings}; levels with nothing else wrong, which do not count: {excused}"));
        }
        // A shard has only some of the findings.
        if ResultLines::open(folder)?.record().shard.is_none() {
            let names: Vec<&str> = files.iter().map(|(name, _)| name.as_str()).collect();
            words.extend(pins.unknown(&names).iter().map(|name| unknown(name)));
        }
        Ok(Self { excused, words })
    }
}

// Detectors on the command line.

/// Options for detectors and their settings.
#[derive(clap::Args, Clone, Debug)]
pub struct DetectorArgs {
    /// Opt-in detectors to add to the default ones, separated by commas (all for all of them).
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    detect: Vec<String>,
    /// Default detectors to leave out, separated by commas (all for all but those of --detect).
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    no_detect: Vec<String>,
    /// A setting of a detector (repeatable).
    #[arg(long, value_name = "NAME.KEY=VALUE")]
    detector: Vec<String>,
    /// Ticks that levels should take, for the detectors shortcut and too-long, which it also switches on. It is a .json
    /// file with the ticks of each level by its name, or recordings, whose fastest won episodes count.
    #[arg(long, value_name = "FILE")]
    par: Option<PathBuf>,
    /// List all detectors with their settings, and test nothing.
    #[arg(long = "detectors")]
    pub list_detectors: bool,
}

/// Detectors that need par times.
const OF_PARS: [&str; 2] = ["shortcut", "too-long"];

impl DetectorArgs {
    /// Returns the detectors for a test of these levels. Reports which of them have par times.
    ///
    /// # Errors
    ///
    /// There is no such detector or setting, a number makes no sense, or the pars cannot be read or are for other
    /// levels.
    pub fn choose(&self, game: &dyn Game, split: &LevelSplit) -> Result<Detectors, CliError> {
        let mut with = self.detect.clone();
        if self.par.is_some() {
            let is_wanted = |name: &&str| !self.no_detect.iter().any(|other| other == name);
            with.extend(OF_PARS.into_iter().filter(is_wanted).map(str::to_owned));
        }
        let choice = DetectorChoice { with, without: self.no_detect.clone(), settings: self.detector.clone() };
        let detectors = Detectors::choose(game, &choice).map_err(|error| usage(&error))?;
        let Some(path) = &self.par else { return Ok(detectors) };
        let pars = Pars::read(path, game).map_err(|error| usage(&error))?;
        let found = LevelPars::of(&pars, game, split);
        if found.with == 0 {
            return Err(CliError::Usage(format!(
                "{}: {found}; name levels of {split} as results do, such as {}",
                path.display(),
                level_name(game, split, split.first)
            )));
        }
        report!("{found}");
        Ok(detectors.with_pars(pars))
    }

    /// Returns all detectors of a game, with these settings, to replay findings.
    ///
    /// # Errors
    ///
    /// The game has no such detector or setting, or a number makes no sense.
    pub fn all(&self, game: &dyn Game) -> Result<Detectors, DetectorError> {
        let (with, settings) = (vec!["all".to_owned()], self.detector.clone());
        Detectors::choose(game, &DetectorChoice { with, without: Vec::new(), settings })
    }

    /// Returns the checks of findings of a game. A game without a detector that is set has its default ones.
    pub fn checks(&self, game: &dyn Game) -> Checks {
        self.all(game).map_or_else(|_| Checks::of_game(game), |all| Checks::default().with_detectors(&all))
    }

    /// Checks that some game has the detectors that are set.
    ///
    /// # Errors
    ///
    /// No game has them: the error of the first game.
    pub fn check_settings(&self, games: &Games) -> Result<(), CliError> {
        if games.iter().any(|game| self.all(game).is_ok()) {
            return Ok(());
        }
        self.all(games.first()).map(drop).map_err(|error| usage(&error))
    }
}

fn usage(error: &impl ToString) -> CliError {
    CliError::Usage(error.to_string())
}

/// Lists the detectors of a game, one per line, with its settings below it.
pub(crate) fn list_detectors(game: &dyn Game, json: bool) -> Result<Outcome, CliError> {
    for (name, about) in ALWAYS {
        if json {
            print_line(serde_json::json!({"name": name, "finds": about, "looks": "always", "settings": {}}))?;
        } else {
            print_line(line(name, "always", about))?;
        }
    }
    for detector in list(game) {
        let looks = if detector.is_default { "default" } else { "opt-in" };
        if json {
            print_line(as_json(&detector, looks))?;
            continue;
        }
        print_line(line(detector.name, looks, detector.about))?;
        for (key, value, what) in &detector.settings {
            print_line(format!("{:29}{key}={value}  {what}", ""))?;
        }
    }
    Ok(Outcome::Pass)
}

/// Deletes the slow ticks of an earlier test in a folder.
pub(crate) fn forget_slow_ticks(folder: &Path) -> Result<(), CliError> {
    forget_timing(folder).map_err(|error| no_timing(folder, "remove", &error))
}

/// Writes the slow ticks of a test to their file, and reports their number.
pub(crate) fn report_slow_ticks(detectors: &Detectors, folder: &Path) -> Result<(), CliError> {
    let Some(clock) = detectors.clock() else { return Ok(()) };
    let count = clock.write(folder).map_err(|error| no_timing(folder, "write", &error))?;
    report!("{} in {}", counted(count as u64, "slow tick"), folder.join(TIMING).display());
    Ok(())
}

fn no_timing(folder: &Path, action: &str, error: &std::io::Error) -> CliError {
    CliError::Io(format!("cannot {action} {}: {error}", folder.join(TIMING).display()))
}

fn line(name: &str, looks: &str, about: &str) -> String {
    format!("{name:20} {looks:7} {about}")
}

fn as_json(detector: &DetectorInfo, looks: &str) -> serde_json::Value {
    let settings = detector.settings.iter().map(|(key, value, _)| ((*key).to_owned(), serde_json::json!(value)));
    let settings: serde_json::Map<String, serde_json::Value> = settings.collect();
    serde_json::json!({"name": detector.name, "finds": detector.about, "looks": looks, "settings": settings})
}
