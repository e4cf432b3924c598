//! Files that show why a level is broken.

use std::path::Path;

use super::wanted::Wanted;
use crate::{
    findings::{Budget, Checks, FindingError, FindingFiles, Played, SeenFinding, SeenLevel},
    game::Game,
    verdict::{LevelVerdict, TestPlan, Tester},
};

/// Most episodes of a tester that are replayed to find a failed one.
const MOST_TRIES: u32 = 16;

/// The files that are kept of broken levels.
pub(super) struct Evidence<'a> {
    game: &'a dyn Game,
    plan: &'a TestPlan,
    wanted: Wanted,
    files: FindingFiles,
}

impl<'a> Evidence<'a> {
    /// Creates the writer for this folder, with or without minimisation of the findings.
    pub fn new(game: &'a dyn Game, plan: &'a TestPlan, wanted: Wanted, folder: &Path, minimise: bool) -> Self {
        let files = FindingFiles {
            folder: folder.to_owned(),
            minimise: minimise.then(Budget::default),
            keep_failures: true,
            checks: Checks::default().with_detectors(&plan.detectors),
        };
        Self { game, plan, wanted, files }
    }

    /// Writes the findings of a level, and names the files in it. Also returns the file of a failed episode, if the
    /// assertion is about solving and no finding shows it.
    pub fn keep(&self, verdict: &mut LevelVerdict) -> Result<Option<String>, FindingError> {
        let LevelVerdict { level: name, index, testers, findings, .. } = verdict;
        let level = SeenLevel { mode: &self.plan.split.mode, level: self.plan.split.first + *index, name };
        let played = |tester: &str, episode| self.played(level.name, tester, episode);
        for finding in findings.iter_mut() {
            let who = finding.tester.as_deref().zip(finding.episode);
            let played = who.and_then(|(tester, episode)| played(tester, episode));
            let seen = SeenFinding {
                detector: &finding.detector,
                message: &finding.message,
                settings: &finding.settings,
                played,
            };
            finding.file = self.files.keep(self.game, level, &seen)?;
        }
        let is_shown = findings.iter().any(|finding| finding.file.is_some() && finding.tester.is_some());
        if is_shown || !self.wanted.is_about_solving() {
            return Ok(None);
        }
        for tester in testers.iter().filter(|tester| tester.score.lost + tester.score.timed_out > 0) {
            for played in
                (0..self.plan.episodes.clamp(1, MOST_TRIES)).filter_map(|number| played(&tester.tester, number))
            {
                let file = self.files.keep_failure(self.game, level, played)?;
                if file.is_some() {
                    return Ok(file);
                }
            }
        }
        Ok(None)
    }

    /// Returns an episode of a tester on a level.
    fn played(&self, level: &str, tester: &str, episode: u32) -> Option<Played<'a>> {
        let tester = self.plan.testers.iter().find(|known| known.record.name == tester)?;
        let Tester { record, player, observation_config } = tester;
        let seed = self.plan.episode_seed(record, level, episode);
        Some(Played { tester: &record.name, player, observation_config, seed })
    }
}
