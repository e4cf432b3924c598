//! Files of the findings of a level.

use super::{
    error::TestError,
    level_verdict::{Finding, LevelOutcome, LevelVerdict},
    plan::TestPlan,
    tester::Tester,
};
use crate::{
    findings::{FindingFiles, Played, SeenFinding, SeenLevel},
    game::Game,
};

/// Writes the findings of a level to files, and notes the files' names in it.
pub(super) fn keep_findings(
    game: &dyn Game,
    plan: &TestPlan,
    files: &FindingFiles,
    verdict: &mut LevelVerdict,
) -> Result<(), TestError> {
    let LevelVerdict { level: name, index, outcome, testers, findings, .. } = verdict;
    let level = SeenLevel { mode: &plan.split.mode, level: plan.split.first + *index, name };
    let played = |tester: &str, episode: u32| {
        let tester = plan.testers.iter().find(|known| known.record.name == tester)?;
        Some(played_by(tester, plan.episode_seed(&tester.record, level.name, episode)))
    };
    for finding in findings {
        let who = finding.tester.as_deref().zip(finding.episode);
        let played = who.and_then(|(tester, episode)| played(tester, episode));
        let Finding { detector, message, settings, .. } = finding;
        let seen = SeenFinding { detector, message, settings, played };
        finding.file = files.keep(game, level, &seen)?;
    }
    if files.keep_failures && *outcome == LevelOutcome::BotFailed {
        let failed = testers.iter().find(|tester| tester.exact && tester.score.lost + tester.score.timed_out > 0);
        if let Some(played) = failed.and_then(|tester| played(&tester.tester, 0)) {
            files.keep_failure(game, level, played)?;
        }
    }
    Ok(())
}

fn played_by(tester: &Tester, seed: u64) -> Played<'_> {
    let Tester { record, player, observation_config } = tester;
    Played { tester: &record.name, player, observation_config, seed }
}
