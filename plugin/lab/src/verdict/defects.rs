//! Defects reported by detectors, as findings of a level.

use bevy::math::Vec2;
use bevy_playbot::episode::EpisodeResult;

use super::{
    level_verdict::Finding,
    plan::TestPlan,
    played::{Played, PlayedEnd},
};
use crate::{
    detectors::{TestedBy, TestedLevel},
    game::Game,
};

/// Returns the defects seen while testers played. A repeated defect in several episodes of a tester is reported once,
/// for the first.
pub(super) fn seen(plan: &TestPlan, played: &[&[Played]]) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    for (tester, episodes) in plan.testers.iter().zip(played) {
        for (number, episode) in (0..).zip(episodes.iter()) {
            for found in &episode.found {
                let name = Some(tester.record.name.clone());
                let is_known = |known: &Finding| known.tester == name && known.detector == found.detector;
                if !findings.iter().any(is_known) {
                    findings.push(Finding {
                        detector: found.detector.to_owned(),
                        tester: name,
                        episode: Some(number),
                        tick: Some(found.tick),
                        message: found.message.clone(),
                        file: None,
                        settings: Vec::new(),
                    });
                }
            }
        }
    }
    findings
}

/// Returns the findings of detectors that look at a level after its test. Incomplete if `stop` returned true.
pub(super) fn inspect(
    game: &dyn Game,
    plan: &TestPlan,
    (index, name): (u64, &str),
    played: &[&[Played]],
    stop: &dyn Fn() -> bool,
) -> Vec<Finding> {
    if plan.detectors.levels.is_empty() {
        return Vec::new();
    }
    let level = plan.split.first + index;
    let testers = plan.testers.iter().zip(played).map(|(tester, episodes)| TestedBy {
        name: &tester.record.name,
        player: &tester.player,
        observation_config: tester.observation_config,
        seed: plan.episode_seed(&tester.record, name, 0),
        episodes: (0..).zip(episodes.iter()).filter_map(ended).collect(),
        places: (0..).zip(episodes.iter()).filter_map(ended_at).collect(),
    });
    let (mode, par) = (plan.split.mode.as_str(), plan.detectors.par(name));
    let tested = TestedLevel { game, mode, level, place: index, par, testers: testers.collect(), stop };
    let mut findings = Vec::new();
    for detector in plan.detectors.levels.iter().take_while(|_| !stop()) {
        findings.extend(detector.inspect(&tested).into_iter().map(|defect| Finding {
            detector: detector.name().to_owned(),
            tester: defect.tester,
            episode: defect.episode,
            tick: defect.tick,
            message: defect.message,
            file: None,
            settings: defect.settings,
        }));
    }
    findings
}

fn ended((number, episode): (u32, &Played)) -> Option<(u32, EpisodeResult)> {
    match &episode.end {
        PlayedEnd::Ended { result, .. } => Some((number, *result)),
        PlayedEnd::Broken { .. } => None,
    }
}

fn ended_at((number, episode): (u32, &Played)) -> Option<(u32, Vec2)> {
    match &episode.end {
        PlayedEnd::Ended { place, .. } => place.map(|place| (number, place)),
        PlayedEnd::Broken { .. } => None,
    }
}
