//! The numbers of a tester, or of several together.

use std::collections::BTreeSet;

use serde::Serialize;

use super::{found::ScoredJob, mix::Catch, numbers::Share, rows::Rows};
use crate::report::statistics::median;

/// Recall, precision and costs of a tester, or of several together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TesterRow {
    /// Names of the testers.
    pub testers: Vec<String>,
    /// The games that they test.
    pub games: Vec<String>,
    /// Whether all of them act with learned skills.
    pub skilled: bool,
    /// Share of the mutants that they test and find; for several testers, of all mutants.
    pub recall: Share,
    /// The same with a comparison with the unmutated game.
    pub beside: Share,
    /// Recall without the detectors that games add.
    pub without_own: Share,
    /// Share of true findings among all in mutants and on unmutated levels.
    pub precision: Share,
    /// Unmutated levels with a finding.
    pub false_findings: Share,
    /// Unmutated levels that are called unsolvable.
    pub called_unsolvable: u64,
    /// Seconds on the mutants.
    pub seconds: f64,
    /// Distinct defects that are found in an hour.
    pub found_per_hour: Option<f64>,
    /// Median of the seconds until a defect is first found, among those that are found.
    pub first_seconds: Option<f64>,
    /// Median length of the minimised replays, in actions with an effect.
    pub minimised: Option<f64>,
    /// Median of their share of the actions up to the finding.
    pub minimised_share: Option<f64>,
    /// Median of their share of the actions of the whole episode.
    pub episode_share: Option<f64>,
    /// Number of minimised replays.
    pub replays: u64,
}

/// Seconds of an hour.
const HOUR: f64 = 3600.0;

/// Returns the row of these testers, by their indices. A defect counts as found when the fastest of them finds it.
pub(super) fn tester_row(rows: &Rows, testers: &[usize]) -> TesterRow {
    let catch = Catch::of(&rows.catches, testers);
    // A single tester is not judged by mutants that it does not test.
    let is_tested = |mutant: &usize| match testers {
        [tester] => rows.played[*tester].contains_key(mutant),
        _ => true,
    };
    let mutants: Vec<usize> = (0..rows.mutants.len()).filter(is_tested).collect();
    let is_tested = |level: &usize| testers.iter().any(|&tester| rows.played_sound[tester].contains_key(level));
    let sound: Vec<usize> = (0..rows.sound.len()).filter(is_tested).collect();
    let found: Vec<usize> = mutants.iter().copied().filter(|&mutant| catch.found[mutant]).collect();
    let jobs = |mutant: usize| testers.iter().filter_map(move |&tester| rows.played[tester].get(&mutant));
    let wrong = Share::of(sound.iter().map(|&level| catch.false_findings[level]));
    let seconds: f64 = mutants.iter().flat_map(|&mutant| jobs(mutant)).map(|job| job.result.seconds).sum();
    let first = |&mutant: &usize| jobs(mutant).filter_map(|job| job.first).min_by(f64::total_cmp);
    let shortest = |&mutant: &usize| {
        let lengths = |job: &&ScoredJob| Some([job.result.minimised?, job.result.original?, job.result.played?]);
        jobs(mutant).filter_map(lengths).min().map(|lengths| lengths.map(f64::from))
    };
    let replays: Vec<[f64; 3]> = found.iter().filter_map(shortest).collect();
    let share_of = |whole: usize| {
        let shares = replays.iter().filter(|lengths| lengths[whole] > 0.0).map(|lengths| lengths[0] / lengths[whole]);
        median(shares.collect())
    };
    let own = || testers.iter().map(move |&tester| &rows.testers[tester]);
    let games: BTreeSet<&String> = own().flat_map(|tester| &tester.games).collect();
    let count = found.len() as u64;
    TesterRow {
        testers: own().map(|tester| tester.name.clone()).collect(),
        games: games.into_iter().cloned().collect(),
        skilled: !testers.is_empty() && own().all(|tester| tester.skilled),
        recall: Share::new(count, mutants.len() as u64),
        beside: Share::of(mutants.iter().map(|&mutant| testers.iter().any(|&tester| rows.beside(tester, mutant)))),
        without_own: Share::of(
            mutants.iter().map(|&mutant| testers.iter().any(|&tester| rows.without_own(tester, mutant))),
        ),
        precision: Share::new(count, count + wrong.count),
        false_findings: wrong,
        called_unsolvable: sound.iter().filter(|&&level| catch.unsolvable[level]).count() as u64,
        seconds,
        found_per_hour: (seconds > 0.0).then(|| count as f64 * HOUR / seconds),
        first_seconds: median(found.iter().filter_map(first).collect()),
        minimised: median(replays.iter().map(|lengths| lengths[0]).collect()),
        minimised_share: share_of(1),
        episode_share: share_of(2),
        replays: replays.len() as u64,
    }
}
