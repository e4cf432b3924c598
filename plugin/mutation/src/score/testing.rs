//! Hand-made scores for tests.

use crate::score::{
    JobResult,
    contestant::{ClockKind, ContestantRecord},
    found::{Found, ScoredJob},
    record::{GameRecord, SCORE_FORMAT, ScoreBudget, ScoreRecord, SetRecord, Subject, SubjectKind},
};

/// A mutant of a game.
pub(super) fn mutant(game: &str, id: &str, class: &str) -> Subject {
    let kind = SubjectKind::Mutant { class: class.to_owned(), original: format!("{game} bed:0") };
    Subject { id: id.to_owned(), game: game.to_owned(), kind }
}

/// An unmutated level of a game.
pub(super) fn sound(game: &str, level: u64) -> Subject {
    let id = Subject::id_of_level(game, "bed", level);
    Subject { id, game: game.to_owned(), kind: SubjectKind::Sound }
}

/// A job of one second, with or without a finding of a detector.
pub(super) fn job(subject: &str, tester: &str, detected: bool) -> ScoredJob {
    let result = JobResult {
        subject: subject.to_owned(),
        tester: tester.to_owned(),
        episodes: 1,
        seconds: 1.0,
        ..JobResult::default()
    };
    ScoredJob { result, found: Found { detected, ..Found::default() }, first: detected.then_some(0.5) }
}

/// The record of a game with these testers; those whose names begin with `skill` have skills.
pub(super) fn record(game: &str, testers: &[&str]) -> ScoreRecord {
    let tester = |name: &&str| ContestantRecord { skilled: name.starts_with("skill"), ..ContestantRecord::bot(*name) };
    let testers = testers.iter().map(tester).collect();
    let (detectors, own_detectors) = (vec!["stuck ticks=9".to_owned()], vec!["weeds".to_owned()]);
    let game = GameRecord { name: game.to_owned(), version: 1, testers, detectors, own_detectors };
    ScoreRecord {
        format: SCORE_FORMAT,
        set: SetRecord { seed: 7, hash: "0f".to_owned() },
        games: vec![game],
        budget: ScoreBudget::default(),
        clock: ClockKind::Wall,
    }
}
