//! Assertions about recordings and findings.

use crate::{
    assertions::{LevelTest, examine::replay},
    findings::{
        Checks, Date, FindingError, Recheck, Regress, RegressRow, Regression, StoredFinding, list_findings, recheck,
        regress, since_edited,
    },
};
use bevy_playbot::{demo::file::DemoFault, engine::find_demos};
use playbot_harness::{brief::shell_word, demo::verify_file, games::Games};
use playbot_report::counted;
use std::path::{Path, PathBuf};

/// Most episodes of a recording that a failure lists.
const MOST_EPISODES: usize = 10;

impl LevelTest<'_> {
    /// Checks that recordings and findings play again, and returns the message of a failure.
    pub(super) fn check_replays(&self, path: &Path) -> Result<(), String> {
        if let Some(problem) = self.game.problem() {
            return Err(problem);
        }
        let files = files(path)?;
        let check = |file: &PathBuf| {
            if is_finding(file) { self.check_finding(file) } else { self.check_recording(file) }
        };
        let wrong: Vec<String> = files.iter().filter_map(|file| check(file).err()).collect();
        if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
    }

    fn check_recording(&self, path: &Path) -> Result<(), String> {
        // Errors of files already name the file.
        let report = verify_file(self.game, path, |_| {}).map_err(|error| match error.to_string() {
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
        let play = if wrong == 1 { "does not play" } else { "do not play" };
        let mut lines = vec![format!("{}: {wrong} of {all} episodes {play} the same game again:", path.display())];
        let reported = report.divergences.iter().take(MOST_EPISODES);
        lines.extend(reported.map(|(episode, what)| format!("  episode {episode}: {what}")));
        let more = wrong.saturating_sub(MOST_EPISODES);
        lines.extend((more > 0).then(|| format!("  and {more} more")));
        lines.push(format!("    {} demo verify {}", self.program, shell_word(&path.display().to_string())));
        Err(lines.join("\n"))
    }

    fn check_finding(&self, path: &Path) -> Result<(), String> {
        let finding = StoredFinding::read(path).map_err(|error| error.to_string())?;
        let again = recheck(self.game, &finding, &Checks::of_game(self.game));
        let again = again.map_err(|error| format!("{}: {error}", path.display()))?;
        let Some(what) = difference(&finding, &again) else { return Ok(()) };
        let head = &finding.head;
        let edited = finding.edited_level(self.game).map_or_else(String::new, |path| since_edited(&path));
        let found = format!("{}: {}: {}", head.level, head.detector, head.message);
        Err(format!("{}: {what}{edited} ({found})\n    {}", path.display(), replay(&self.program, path)))
    }

    /// Checks that no finding happens any more, and returns the message of a failure.
    pub(super) fn check_gone(&self, folder: &Path) -> Result<(), String> {
        let all = [self.game];
        let games = Games::new(&all).map_err(|error| error.to_string())?;
        let (today, threads) = (Date::today(), self.threads);
        let request = Regress { folder, games: &games, checks: &Checks::of_game, today, threads };
        let Regression { rows, .. } = regress(&request, &|_| {}).map_err(|error| error.to_string())?;
        let wrong: Vec<&RegressRow> = rows.iter().filter(|row| row.is_alarm()).collect();
        if wrong.is_empty() {
            return Ok(());
        }
        let all = counted(rows.len() as u64, "finding");
        let are = if wrong.len() == 1 { "is" } else { "are" };
        let headline = format!("{}: {} of {all} {are} not gone:", folder.display(), wrong.len());
        let lines = wrong.into_iter().flat_map(|row| {
            let what = [row.level.as_deref(), row.detector.as_deref(), Some(row.message.as_str())];
            let what: Vec<&str> = what.into_iter().flatten().collect();
            let expired = row.pin.as_ref().map_or_else(String::new, |pin| format!(", pinned until {}", pin.until));
            let line = format!("  {} ({}{expired}): {}", row.finding, row.status.name(), what.join(": "));
            [line, format!("    {}", replay(&self.program, &row.path))]
        });
        Err(std::iter::once(headline).chain(lines).collect::<Vec<_>>().join("\n"))
    }
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
