//! A test of one level on this thread, with all episodes in sequence in the same World.

use bevy_playbot::{episode::EpisodeResult, fault::Fault};

use super::{
    error::TestError,
    judge::judge,
    level_verdict::LevelVerdict,
    plan::TestPlan,
    play::play_tasks,
    played::{Played, PlayedEnd, Task, Watch},
    run::TestWatch,
};
use crate::{eval::EvalError, game::Game};

/// Results of a level.
pub struct TestedInTurn {
    /// Verdict of the tester.
    pub verdict: LevelVerdict,
    /// Result of each episode; `None` if the game broke.
    pub ends: Vec<Option<EpisodeResult>>,
}

/// Lets the first tester of the plan play its first level under this name, which determines the seeds of the
/// episodes.
///
/// State that a game keeps from one episode to the next shows here. `progress` is called for each episode in order,
/// on this thread. `None` if `stop` returned true.
///
/// # Errors
///
/// The plan tests nothing, or the game cannot be played.
pub(crate) fn test_in_turn(
    game: &dyn Game,
    plan: &TestPlan,
    name: &str,
    watch: &TestWatch,
) -> Result<Option<TestedInTurn>, TestError> {
    plan.check()?;
    if let Some(problem) = game.problem() {
        return Err(EvalError::from(Fault(problem)).into());
    }
    let tester = plan.testers.first().ok_or(TestError::NoTester)?;
    let (mode, level) = (plan.split.mode.as_str(), plan.split.first);
    let task = |episode| Task { level, seed: plan.episode_seed(&tester.record, name, episode) };
    let tasks: Vec<Task> = (0..plan.episodes.max(1)).map(task).collect();
    let (detectors, tester_name) = (&plan.detectors, tester.record.name.as_str());
    let TestWatch { progress, stop } = *watch;
    let watch = Watch { progress, stop, detectors, mode, tester: tester_name, arenas: 1 };
    let played = play_tasks(game, mode, tester, &tasks, &watch).map_err(EvalError::from)?;
    let Some(played) = played else { return Ok(None) };
    let ends = played.iter().map(ended).collect();
    let verdict = judge(game, plan, (0, name.to_owned()), &[played.as_slice()], stop);
    Ok((!stop()).then_some(TestedInTurn { verdict, ends }))
}

fn ended(episode: &Played) -> Option<EpisodeResult> {
    match &episode.end {
        PlayedEnd::Ended { result, .. } => Some(*result),
        PlayedEnd::Broken { .. } => None,
    }
}
