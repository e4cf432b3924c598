//! Verdicts for unit tests.

use crate::verdict::{
    EpisodeScore, LevelOutcome, LevelVerdict, MapScope, TestRecord, TesterRecord, TesterVerdict, results::FinishTime,
    statistics::wilson,
};
use playbot_harness::detector::LevelProof;
use std::collections::BTreeMap;

/// Makes a score with so many solved episodes.
pub(super) fn score(solved: u64, episodes: u64) -> EpisodeScore {
    let ticks = FinishTime::of(vec![40; solved as usize]);
    EpisodeScore {
        solved,
        episodes,
        interval: wilson(solved, episodes),
        ticks,
        lost: episodes - solved,
        timed_out: 0,
        broken: 0,
    }
}

/// Makes the record of a test of these levels, with one episode of `random` on each.
pub(super) fn record(range: &str) -> TestRecord {
    TestRecord {
        game: "garden".to_owned(),
        game_version: 1,
        range: range.parse().expect("a split"),
        files: None,
        seed: 0,
        testers: vec![TesterRecord::bot("random")],
        episodes: 1,
        detectors: Vec::new(),
        options: Vec::new(),
        maps: MapScope::default(),
        shard: None,
    }
}

/// Makes the verdict on the level with this index of `hard:0..`, tested by `random` alone.
pub(super) fn verdict(index: u64, solved: u64, episodes: u64) -> LevelVerdict {
    LevelVerdict {
        level: format!("hard:{index}"),
        name: None,
        index,
        outcome: if solved > 0 { LevelOutcome::Solved } else { LevelOutcome::BotFailed },
        proof: if solved > 0 { LevelProof::Solvable } else { LevelProof::Unknown },
        score: score(solved, episodes),
        seconds: None,
        ends: Vec::new(),
        causes: BTreeMap::new(),
        stop: None,
        solved_at_start: false,
        places: None,
        maps: None,
        reached: None,
        testers: vec![tester("random", solved, episodes, false)],
        findings: Vec::new(),
        not_kept: None,
        too_short: Vec::new(),
        recorded: None,
    }
}

/// Makes the verdict of a tester.
pub(super) fn tester(name: &str, solved: u64, episodes: u64, exact: bool) -> TesterVerdict {
    TesterVerdict { tester: name.to_owned(), score: score(solved, episodes), exact, places: None, events: None }
}
