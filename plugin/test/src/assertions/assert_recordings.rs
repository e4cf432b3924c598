//! Assertions about recordings and findings.

use crate::{
    assertions::examine::replay,
    findings::{
        Checks, Date, FindingError, Recheck, Regress, RegressRow, Regression, StoredFinding, keep::recheck,
        list_findings, regress,
    },
};
use bevy_playbot::{demo::file::DemoFault, engine::find_demos};
use playbot_harness::{brief::shell_word, demo::verify_file, game::Game, games::Games, parallel::default_threads};
use std::path::{Path, PathBuf};

/// Name of the program with the game.
const PROGRAM: &str = "playbot";

/// Most episodes of a recording that a failure lists.
const MOST_EPISODES: usize = 10;

/// Asserts that a recording replays bit for bit, or that a finding (a `.finding`) happens again in the same tick and
/// with the same state. For a folder, this is asserted of all recordings and findings in it.
///
/// # Panics
///
/// A replay differs: the message has the first tick that differs, and the command that shows it. Or the path has no
/// recording or finding, holds no episode, is damaged, or is of another game or version.
#[track_caller]
pub fn assert_replays(game: &dyn Game, path: impl AsRef<Path>) {
    if let Err(message) = check_all(game, path.as_ref()) {
        panic!("{message}");
    }
}

/// Asserts that no finding in this folder happens any more, so that repaired defects stay repaired:
/// `playbot test --regress` for `cargo test`. Findings that are pinned in the folder's `pins.ron` do not count up to
/// their last day.
///
/// # Panics
///
/// A finding still happens or cannot be played: the message has the commands that show it. Or the folder has no
/// findings.
#[track_caller]
pub fn assert_findings_gone(game: &dyn Game, folder: impl AsRef<Path>) {
    if let Err(message) = check_gone(game, folder.as_ref()) {
        panic!("{message}");
    }
}

fn check_all(game: &dyn Game, path: &Path) -> Result<(), String> {
    if let Some(problem) = game.problem() {
        return Err(problem);
    }
    let files = files(path)?;
    let check = |file: &PathBuf| if is_finding(file) { check_finding(game, file) } else { check_recording(game, file) };
    let wrong: Vec<String> = files.iter().filter_map(|file| check(file).err()).collect();
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
}

fn is_finding(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "finding")
}

/// Returns the file itself, or the files in the folder.
fn files(path: &Path) -> Result<Vec<PathBuf>, String> {
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = match find_demos(path) {
        Ok(found) => found,
        Err(error) if matches!(error.fault, DemoFault::NoDemos) => Vec::new(),
        Err(error) => return Err(error.to_string()),
    };
    match list_findings(path) {
        Ok(findings) => found.extend(findings.into_iter().map(|(_, file)| file)),
        Err(FindingError::None(_)) => {}
        Err(error) => return Err(error.to_string()),
    }
    if found.is_empty() {
        return Err(format!("{} has neither recordings nor findings: nothing was replayed", path.display()));
    }
    Ok(found)
}

fn check_recording(game: &dyn Game, path: &Path) -> Result<(), String> {
    // Errors of files already name the file.
    let report = verify_file(game, path, |_| {}).map_err(|error| match error.to_string() {
        words if words.contains(&path.display().to_string()) => words,
        words => format!("{}: {words}", path.display()),
    })?;
    if report.episodes == 0 {
        return Err(format!("{} holds no episode: nothing was replayed", path.display()));
    }
    if report.divergences.is_empty() {
        return Ok(());
    }
    let (wrong, all) = (report.divergences.len(), report.episodes);
    let mut lines = vec![format!("{}: {wrong} of {all} episodes do not play the same game again:", path.display())];
    let reported = report.divergences.iter().take(MOST_EPISODES);
    lines.extend(reported.map(|(episode, what)| format!("  episode {episode}: {what}")));
    let more = wrong.saturating_sub(MOST_EPISODES);
    lines.extend((more > 0).then(|| format!("  and {more} more")));
    lines.push(format!("    {PROGRAM} demo verify {}", shell_word(&path.display().to_string())));
    Err(lines.join("\n"))
}

fn check_finding(game: &dyn Game, path: &Path) -> Result<(), String> {
    let finding = StoredFinding::read(path).map_err(|error| error.to_string())?;
    let again = recheck(game, &finding, &Checks::of_game(game));
    let again = again.map_err(|error| format!("{}: {error}", path.display()))?;
    let Some(what) = difference(&finding, &again) else { return Ok(()) };
    let head = &finding.head;
    let found = format!("{}: {}: {}", head.level, head.detector, head.message);
    Err(format!("{}: {what} ({found})\n    {}", path.display(), replay(PROGRAM, path)))
}

/// Returns the difference between a finding and its replay, if there is one.
fn difference(finding: &StoredFinding, again: &Recheck) -> Option<String> {
    if again.is_same(finding) {
        return None;
    }
    Some(match (again.sighting.map(|seen| seen.tick), finding.head.tick) {
        (None, _) => "it does not happen again".to_owned(),
        (Some(Some(now)), Some(stored)) if now != stored => {
            format!("it happens again at tick {now}, stored is {stored}")
        }
        _ => "it happens again in another state than stored".to_owned(),
    })
}

fn check_gone(game: &dyn Game, folder: &Path) -> Result<(), String> {
    let all = [game];
    let games = Games::new(&all).map_err(|error| error.to_string())?;
    let (today, threads) = (Date::today(), default_threads());
    let request = Regress { folder, games: &games, checks: &Checks::of_game, today, threads };
    let Regression { rows, .. } = regress(&request, &|_| {}).map_err(|error| error.to_string())?;
    let wrong: Vec<&RegressRow> = rows.iter().filter(|row| row.is_alarm()).collect();
    if wrong.is_empty() {
        return Ok(());
    }
    let headline = format!("{}: {} of {} findings are not gone:", folder.display(), wrong.len(), rows.len());
    let lines = wrong.into_iter().flat_map(|row| {
        let what = [row.level.as_deref(), row.detector.as_deref(), Some(row.message.as_str())];
        let what: Vec<&str> = what.into_iter().flatten().collect();
        let expired = row.pin.as_ref().map_or_else(String::new, |pin| format!(", pinned until {}", pin.until));
        let line = format!("  {} ({}{expired}): {}", row.finding, row.status.name(), what.join(": "));
        [line, format!("    {}", replay(PROGRAM, &row.path))]
    });
    Err(std::iter::once(headline).chain(lines).collect::<Vec<_>>().join("\n"))
}
