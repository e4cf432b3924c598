//! From episodes to what they say of a level.

use bevy::math::Vec2;
use bevy_playbot::episode::EpisodeEnd;

use super::{
    defects::{inspect, seen},
    ends::end_places,
    finish_time::FinishTime,
    interval::wilson,
    level_name::level_name,
    level_verdict::{Finding, LevelOutcome, LevelVerdict, Score, TesterVerdict},
    plan::TestPlan,
    played::{Played, PlayedEnd},
};
use crate::{game::Game, proof::LevelProof};

/// What the testers say of the level at this place in the range. `played` has the episodes of each tester, in the order of
/// the plan.
pub(super) fn judge(game: &dyn Game, plan: &TestPlan, index: u64, played: &[&[Played]]) -> LevelVerdict {
    let level = plan.split.first + index;
    let mode = &plan.split.mode;
    let testers = plan.testers.iter().zip(played).map(|(tester, episodes)| TesterVerdict {
        tester: tester.record.name.clone(),
        score: score(episodes),
        exact: episodes.iter().all(|episode| episode.exact),
    });
    let all: Vec<Played> = played.iter().flat_map(|episodes| episodes.iter().cloned()).collect();
    let score = score(&all);
    // Whoever reached the aim has proved that it can be reached.
    let proof = if score.solved > 0 { LevelProof::Solvable } else { game.prove(mode, level) };
    let mut findings = broken(plan, played);
    findings.extend(seen(plan, played));
    findings.extend(inspect(game, plan, index, played));
    let outcome = match proof.why_unsolvable() {
        _ if score.solved > 0 => LevelOutcome::Solved,
        None => LevelOutcome::BotFailed,
        Some(why) => {
            let detector = "unreachable-goal".to_owned();
            let message = why.to_owned();
            findings.insert(0, Finding { detector, tester: None, episode: None, tick: None, message, file: None });
            LevelOutcome::ProvedUnsolvable
        }
    };
    let places = all.iter().filter_map(failed_at).collect::<Vec<_>>();
    let bounds = (!places.is_empty()).then(|| game.floor_plan(mode, level)).flatten().map(|plan| plan.bounds);
    LevelVerdict {
        level: level_name(game, &plan.split, level),
        index,
        outcome,
        proof,
        score,
        ends: bounds.map_or_else(Vec::new, |bounds| end_places(bounds, &places)),
        testers: testers.collect(),
        findings,
    }
}

fn score(episodes: &[Played]) -> Score {
    let (mut solved, mut ticks, mut lost, mut timed_out, mut broken) = (0, Vec::new(), 0, 0, 0);
    for episode in episodes {
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
    let count = episodes.len() as u64;
    let interval = wilson(solved, count);
    Score { solved, episodes: count, interval, ticks: FinishTime::of(ticks), lost, timed_out, broken }
}

/// Where an episode ended without the aim, and whether its time was up.
fn failed_at(episode: &Played) -> Option<(Vec2, bool)> {
    match &episode.end {
        PlayedEnd::Ended { result, place } if !result.success => {
            place.map(|place| (place, result.end == EpisodeEnd::Truncated))
        }
        _ => None,
    }
}

/// Episodes in which the game broke. What several episodes of a tester say in the same words is told once.
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
                findings.push(Finding { detector, tester: name, episode, tick, message, file: None });
            }
        }
    }
    findings
}
