//! Failure messages of broken levels.

use std::path::{Path, PathBuf};

use super::{commands::Commands, wanted::Wanted};
use crate::{
    level_files::is_level_files,
    verdict::{Finding, LevelVerdict, TestPlan, TesterVerdict},
};

/// Most broken levels that are listed in full.
pub(super) const MOST_SHOWN: usize = 10;
/// Most further levels that are named.
const MOST_NAMED: usize = 200;
/// Most findings of a level that are listed.
const MOST_FINDINGS: usize = 5;

/// The failure message of an assertion.
pub(super) struct Failure<'a> {
    /// The assertion.
    pub wanted: Wanted,
    /// The test.
    pub plan: &'a TestPlan,
    /// The broken levels, in their order.
    pub broken: &'a [LevelVerdict],
    /// For each of the first of them, an episode that failed.
    pub episodes: &'a [Option<String>],
    /// The folder that paths of files start from.
    pub folder: &'a Path,
    /// The commands.
    pub commands: Commands<'a>,
}

impl Failure<'_> {
    /// Returns the message.
    pub fn text(&self) -> String {
        let mut lines = vec![self.headline()];
        for (level, episode) in self.broken.iter().zip(self.episodes) {
            lines.extend(self.level(level, episode.as_deref()));
        }
        let rest = self.broken.get(self.episodes.len()..).unwrap_or_default();
        if !rest.is_empty() {
            let names: Vec<&str> = rest.iter().take(MOST_NAMED).map(|level| level.level.as_str()).collect();
            let more = rest.len().saturating_sub(MOST_NAMED);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            lines.push(format!("and {}{more}", names.join(", ")));
        }
        if is_level_files(&self.plan.split.mode) {
            let folder = std::env::current_dir().unwrap_or_else(|_| PathBuf::from("."));
            lines.push(format!("files of levels are seen from {}", folder.display()));
        }
        lines.join("\n")
    }

    fn headline(&self) -> String {
        let record = &self.commands.record;
        let testers: Vec<&str> = self.plan.testers.iter().map(|tester| tester.record.name.as_str()).collect();
        let episodes = self.plan.episodes.max(1);
        let episodes = format!("{episodes} episode{} each", if episodes == 1 { "" } else { "s" });
        let complaint = self.wanted.complaint(self.broken.len(), self.plan.split.len());
        let (game, range, seed) = (&record.game, &record.range, record.seed);
        format!("{complaint} (`{game}`, {range}, {}, {episodes}, seed {seed}):", testers.join(" + "))
    }

    fn level(&self, level: &LevelVerdict, episode: Option<&str>) -> Vec<String> {
        let mut lines = vec![format!("{}: {}", level.level, level.outcome.name())];
        lines.extend(level.testers.iter().map(|tester| format!("  {}", of_tester(tester))));
        for finding in level.findings.iter().take(MOST_FINDINGS) {
            lines.push(format!("  {}", of_finding(finding)));
            lines.extend(finding.file.iter().map(|file| self.replay(file)));
        }
        let more = level.findings.len().saturating_sub(MOST_FINDINGS);
        lines.extend((more > 0).then(|| format!("  and {more} more finding{}", if more == 1 { "" } else { "s" })));
        if let Some(file) = episode {
            lines.extend(["  an episode that failed:".to_owned(), self.replay(file)]);
        }
        let again = self.commands.again(level);
        if !again.is_empty() {
            lines.push("  the level again:".to_owned());
            lines.extend(again.into_iter().map(|command| format!("    {command}")));
        }
        lines
    }

    fn replay(&self, file: &str) -> String {
        format!("    {}", self.commands.replay(&self.folder.join(file)))
    }
}

fn of_tester(TesterVerdict { tester, score, .. }: &TesterVerdict) -> String {
    let mut words = format!("{tester}: solved {} of {}", score.solved, score.episodes);
    for (count, what) in [(score.lost, "lost"), (score.timed_out, "out of time"), (score.broken, "broken")] {
        if count > 0 {
            words += &format!(", {count} {what}");
        }
    }
    words
}

fn of_finding(finding: &Finding) -> String {
    let place = [
        finding.tester.clone(),
        finding.episode.map(|episode| format!("episode {episode}")),
        finding.tick.map(|tick| format!("tick {tick}")),
    ];
    let place: Vec<String> = place.into_iter().flatten().collect();
    let place = if place.is_empty() { String::new() } else { format!(" ({})", place.join(", ")) };
    format!("{}{place}: {}", finding.detector, finding.message)
}
