//! Verdicts from episodes.

use bevy_playbot::episode::EpisodeEnd;

use super::{
    defects::{inspect, seen},
    ends::{FailedEnd, causes, end_places},
    finish_time::FinishTime,
    interval::wilson,
    level_verdict::{Finding, LevelOutcome, LevelVerdict, Score, TesterVerdict},
    plan::TestPlan,
    played::{Played, PlayedEnd},
    walked::Walked,
};
use crate::{game::Game, proof::LevelProof};

/// Returns the verdict on the level with this index in the range and this name in results. `played` has the episodes
/// of each tester, in the order of the plan. Incomplete if `stop` returned true.
pub(super) fn judge(
    game: &dyn Game,
    plan: &TestPlan,
    (index, name): (u64, String),
    played: &[&[Played]],
    stop: &dyn Fn() -> bool,
) -> LevelVerdict {
    let level = plan.split.first + index;
    let mode = &plan.split.mode;
    let testers = plan.testers.iter().zip(played).map(|(tester, episodes)| TesterVerdict {
        tester: tester.record.name.clone(),
        score: score(episodes.iter()),
        exact: episodes.iter().all(|episode| episode.exact),
        places: None,
    });
    let all = || played.iter().flat_map(|episodes| episodes.iter());
    let score = score(all());
    // Reaching the goal proves that it can be reached.
    let proof = if score.solved > 0 { LevelProof::Solvable } else { game.tools().levels.prove(mode, level) };
    let mut findings = broken(plan, played);
    findings.extend(seen(plan, played));
    findings.extend(inspect(game, plan, (index, &name), played, stop));
    let outcome = match proof.why_unsolvable() {
        _ if score.solved > 0 => LevelOutcome::Solved,
        None => LevelOutcome::BotFailed,
        Some(why) => {
            let detector = "unreachable-goal".to_owned();
            let message = why.to_owned();
            findings.insert(
                0,
                Finding {
                    detector,
                    tester: None,
                    episode: None,
                    tick: None,
                    message,
                    file: None,
                    settings: Vec::new(),
                },
            );
            LevelOutcome::ProvedUnsolvable
        }
    };
    let failed: Vec<FailedEnd> = all().filter_map(failed_end).collect();
    let mut verdict = LevelVerdict {
        level: name,
        index,
        outcome,
        proof,
        score,
        ends: Vec::new(),
        causes: causes(&failed),
        places: None,
        maps: None,
        testers: testers.collect(),
        findings,
    };
    let has_maps = plan.maps().wants(verdict.is_perfect());
    let has_places = failed.iter().any(|end| end.place.is_some());
    let Some(floor) = (has_maps || has_places).then(|| game.tools().levels.floor_plan(mode, level)).flatten() else {
        return verdict;
    };
    verdict.ends = end_places(floor.bounds, &failed);
    if has_maps {
        let names: Vec<&str> = plan.testers.iter().map(|tester| tester.record.name.as_str()).collect();
        if let Some(walked) = Walked::of(&floor, &names, played, &verdict.findings) {
            verdict.places = walked.places;
            verdict.maps = Some(walked.maps);
            for (tester, places) in verdict.testers.iter_mut().zip(walked.testers) {
                tester.places = places;
            }
        }
    }
    verdict
}

fn score<'a>(episodes: impl Iterator<Item = &'a Played>) -> Score {
    let (mut count, mut solved, mut ticks, mut lost, mut timed_out, mut broken) = (0, 0, Vec::new(), 0, 0, 0);
    for episode in episodes {
        count += 1;
        match &episode.end {
            PlayedEnd::Broken { .. } => broken += 1,
            PlayedEnd::Ended { result, .. } if result.success => {
                solved += 1;
                ticks.push(result.ticks);
            }
            PlayedEnd::Ended { result, .. } if result.end == EpisodeEnd::Truncated => timed_out += 1,
            PlayedEnd::Ended { .. } => lost += 1,
        }
    }
    let interval = wilson(solved, count);
    Score { solved, episodes: count, interval, ticks: FinishTime::of(ticks), lost, timed_out, broken }
}

/// Returns the end of an episode without the goal.
fn failed_end(episode: &Played) -> Option<FailedEnd> {
    match &episode.end {
        PlayedEnd::Ended { result, place, cause } if !result.success => {
            let is_timed_out = result.end == EpisodeEnd::Truncated;
            Some(FailedEnd { place: *place, is_timed_out, cause: *cause })
        }
        _ => None,
    }
}

/// Returns the findings of episodes in which the game broke. Equal messages of several episodes of a tester are
/// reported once.
fn broken(plan: &TestPlan, played: &[&[Played]]) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for (tester, episodes) in plan.testers.iter().zip(played) {
        for (number, episode) in (0..).zip(episodes.iter()) {
            let PlayedEnd::Broken { detector, tick, message } = &episode.end else { continue };
            let name = Some(tester.record.name.clone());
            let is_known = |known: &Finding| known.tester == name && known.message == *message;
            if !findings.iter().any(is_known) {
                let (detector, message) = ((*detector).to_owned(), message.clone());
                let (episode, tick) = (Some(number), *tick);
                findings.push(Finding {
                    detector,
                    tester: name,
                    episode,
                    tick,
                    message,
                    file: None,
                    settings: Vec::new(),
                });
            }
        }
    }
    findings
}
