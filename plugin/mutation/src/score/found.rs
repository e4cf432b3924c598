//! The rules that decide which defects were found.

use crate::score::{
    JobResult,
    contestant::{Contestant, JobClock},
    record::{ScoreBudget, Subject, SubjectKind},
};
use playbot_harness::game::Game;
use playbot_test::{
    detectors::Detectors,
    findings::Budget,
    verdict::{FALSE_DISCOVERY_RATE, Trials, benjamini_hochberg, fisher_exact},
};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Least share of a game's unmutated levels that a tester must solve before its failure counts. Below it, only an
/// unusual reward counts.
pub const RELIABLE: f64 = 0.99;

/// The means by which a defect was found. On an unmutated level they are false.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Found {
    /// A detector reported something, or the game panicked.
    pub detected: bool,
    /// The level is proved to be unsolvable.
    pub unsolvable: bool,
    /// A tester failed. Either it solves nearly all unmutated levels of the game: see [`RELIABLE`]. Or it collected far
    /// more or far less reward than on any of them: see [`FEWEST_SOUND`].
    pub failed: bool,
    /// The tester's episodes differ from those in the unmutated game.
    pub differs: bool,
}

impl Found {
    /// Returns whether the defect was found without a comparison with the unmutated game.
    pub fn alone(self) -> bool {
        self.detected || self.unsolvable || self.failed
    }

    /// Returns whether the defect was found by any means.
    pub fn at_all(self) -> bool {
        self.alone() || self.differs
    }
}

/// The result of a tester on a subject, judged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ScoredJob {
    /// The result.
    #[serde(flatten)]
    pub result: JobResult,
    /// The means by which the defect was found.
    pub found: Found,
    /// Seconds until the defect was found, without a comparison with the unmutated game.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<f64>,
}

/// Judges all jobs. `results` may have any order, and keep it.
pub fn judge(subjects: &[Subject], results: Vec<JobResult>) -> Vec<ScoredJob> {
    let subjects: BTreeMap<&str, &Subject> = subjects.iter().map(|subject| (subject.id.as_str(), subject)).collect();
    let failures = failures(&subjects, &results);
    let differing = differing(&subjects, &results);
    let scored = |((index, result), failure): ((usize, JobResult), Option<Failure>)| {
        let found = Found {
            detected: !result.findings.is_empty(),
            unsolvable: result.unsolvable.is_some(),
            failed: failure.is_some(),
            differs: differing.contains(&index),
        };
        let failed_after = failure.and_then(|failure| match failure {
            Failure::Unsolved => result.failed_after,
            // A mean reward needs all episodes.
            Failure::Reward => Some(result.seconds),
        });
        let first = [result.found_after, failed_after].into_iter().flatten().min_by(f64::total_cmp);
        ScoredJob { result, found, first }
    };
    results.into_iter().enumerate().zip(failures).map(scored).collect()
}

/// The kinds of failures that do not occur on unmutated levels.
#[derive(Clone, Copy)]
enum Failure {
    /// The level was not solved.
    Unsolved,
    /// The reward was far higher or far lower.
    Reward,
}

/// Returns for each result how the tester failed, if it does not fail in this way on unmutated levels.
fn failures(subjects: &BTreeMap<&str, &Subject>, results: &[JobResult]) -> Vec<Option<Failure>> {
    let reliable = reliable(subjects, results);
    let typical = TypicalRewards::new(subjects, results);
    let failure = |result: &JobResult| {
        let game = subjects.get(result.subject.as_str()).map_or("", |subject| subject.game.as_str());
        if reliable.contains(&(game.to_owned(), result.tester.clone())) {
            (!result.is_solved()).then_some(Failure::Unsolved)
        } else {
            typical.is_unusual(game, result).then_some(Failure::Reward)
        }
    };
    results.iter().map(failure).collect()
}

/// Returns games and the testers that solve nearly all of their unmutated levels.
fn reliable(subjects: &BTreeMap<&str, &Subject>, results: &[JobResult]) -> BTreeSet<(String, String)> {
    let mut counts: BTreeMap<(String, String), Trials> = BTreeMap::new();
    for result in results {
        let Some(subject) = subjects.get(result.subject.as_str()) else { continue };
        if subject.kind == SubjectKind::Sound {
            let count = counts.entry((subject.game.clone(), result.tester.clone())).or_default();
            count.trials += 1;
            count.successes += u64::from(result.is_solved());
        }
    }
    let is_reliable = |count: &Trials| count.successes as f64 >= RELIABLE * count.trials as f64;
    counts.into_iter().filter(|(_, count)| is_reliable(count)).map(|(names, _)| names).collect()
}

/// Returns the indices of results on mutants that differ from those of the same tester on the original. Without random
/// numbers on either side, any difference counts. Otherwise Fisher's exact test decides, with at most one in twenty
/// false on average over all mutants (Benjamini and Hochberg).
fn differing(subjects: &BTreeMap<&str, &Subject>, results: &[JobResult]) -> BTreeSet<usize> {
    let key = |result: &JobResult| (result.subject.clone(), result.tester.clone());
    let known: BTreeMap<(String, String), &JobResult> = results.iter().map(|result| (key(result), result)).collect();
    let (mut certain, mut doubtful, mut probabilities) = (BTreeSet::new(), Vec::new(), Vec::new());
    for (index, result) in results.iter().enumerate() {
        let Some(SubjectKind::Mutant { original, .. }) =
            subjects.get(result.subject.as_str()).map(|subject| &subject.kind)
        else {
            continue;
        };
        let Some(before) = known.get(&(original.clone(), result.tester.clone())) else { continue };
        if result.exact && before.exact {
            if result.ends != before.ends {
                certain.insert(index);
            }
        } else {
            let trials = |of: &JobResult| Trials { successes: of.solved, trials: of.episodes };
            doubtful.push(index);
            probabilities.push(fisher_exact(trials(result), trials(before)));
        }
    }
    let alarms = benjamini_hochberg(&probabilities, FALSE_DISCOVERY_RATE);
    certain.extend(doubtful.into_iter().zip(alarms).filter(|(_, is_alarm)| *is_alarm).map(|(index, _)| index));
    certain
}

// The trial of one tester on one subject.

/// The inputs of a job.
pub(super) struct Trial<'a> {
    /// The game, with a defect in its rules if there is one.
    pub game: &'a dyn Game,
    /// Mode of the level.
    pub mode: &'a str,
    /// Number of the level.
    pub level: u64,
    /// Name of the unmutated level, from which all seeds are derived, so that a mutant is tested as its original is.
    pub name: &'a str,
    /// The tester.
    pub contestant: &'a Contestant,
    /// The detectors.
    pub detectors: &'a Detectors,
    /// The budget.
    pub budget: ScoreBudget,
    /// True if findings are minimised.
    pub shortens: bool,
    /// Runs from the start of the job.
    pub clock: JobClock,
    /// Returns true to stop.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

/// Most ticks of all replays that minimise a finding, for each replay that is allowed.
const TICKS_PER_REPLAY: u64 = 2000;

impl Trial<'_> {
    /// Returns the budget of minimisation; `None` for no minimisation.
    pub fn shortening(&self) -> Option<Budget> {
        let replays = self.budget.replays;
        let is_wanted = self.shortens && replays > 0;
        is_wanted.then(|| Budget { replays, ticks: u64::from(replays) * TICKS_PER_REPLAY })
    }
}

// The rewards that testers collect on unmutated levels.

/// Fewest unmutated levels, beside the one that is judged, from which a tester's typical reward is known.
pub const FEWEST_SOUND: usize = 8;

/// Standard deviations from the mean that count as unusual. With 20 unmutated levels and normal rewards, one in a
/// thousand lies there (Student's t with 19 degrees of freedom).
pub const FAR: f64 = 4.0;

/// The rewards of each tester on the unmutated levels of each game.
///
/// In a game that cannot be won, no tester fails by missing the goal. It may still collect far more or far less reward
/// than elsewhere.
pub(super) struct TypicalRewards<'a> {
    /// By game and tester: the mean reward of the tester's episodes on each unmutated level.
    known: BTreeMap<(&'a str, &'a str), Vec<(&'a str, f64)>>,
}

impl<'a> TypicalRewards<'a> {
    /// Collects the rewards of these results.
    pub fn new(subjects: &BTreeMap<&'a str, &'a Subject>, results: &'a [JobResult]) -> Self {
        let mut known: BTreeMap<_, Vec<_>> = BTreeMap::new();
        for result in results {
            let subject = subjects.get(result.subject.as_str()).filter(|subject| subject.kind == SubjectKind::Sound);
            if let (Some(subject), Some(reward)) = (subject, result.reward) {
                let key = (subject.game.as_str(), result.tester.as_str());
                known.entry(key).or_default().push((subject.id.as_str(), reward));
            }
        }
        Self { known }
    }

    /// Returns whether a tester's reward is unusual. It must lie outside of all its rewards on the other unmutated
    /// levels of the game, and more than [`FAR`] standard deviations from their mean. Only testers with similar rewards
    /// on all of them count: the range must be smaller than the distance of its middle from 0.
    pub fn is_unusual(&self, game: &str, result: &JobResult) -> bool {
        let Some(reward) = result.reward else { return false };
        let Some(known) = self.known.get(&(game, result.tester.as_str())) else { return false };
        let others: Vec<f64> =
            known.iter().filter(|(subject, _)| *subject != result.subject).map(|(_, reward)| *reward).collect();
        let [least, most] = [(f64::INFINITY, f64::min as fn(f64, f64) -> f64), (f64::NEG_INFINITY, f64::max)]
            .map(|(none, of)| others.iter().copied().fold(none, of));
        let is_steady = others.len() >= FEWEST_SOUND && most - least < least.midpoint(most).abs();
        is_steady && !(least..=most).contains(&reward) && is_far(reward, &others)
    }
}

/// Returns whether a number is more than [`FAR`] standard deviations from the mean of these, of which there are two or
/// more.
fn is_far(number: f64, others: &[f64]) -> bool {
    let count = others.len() as f64;
    let mean = others.iter().sum::<f64>() / count;
    let variance = others.iter().map(|other| (other - mean).powi(2)).sum::<f64>() / (count - 1.0);
    (number - mean).abs() > FAR * variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::{
        JobFinding,
        testing::{mutant, sound},
    };

    fn result(subject: &str, tester: &str, solved: u64, episodes: u64) -> JobResult {
        JobResult {
            subject: subject.to_owned(),
            tester: tester.to_owned(),
            solved,
            episodes,
            failed_after: (solved < episodes).then_some(2.0),
            ..JobResult::default()
        }
    }

    fn sound_levels(count: u64) -> Vec<Subject> {
        (0..count).map(|level| sound("garden", level)).collect()
    }

    #[test]
    fn only_a_tester_that_solves_nearly_all_sound_levels_finds_by_failing() {
        let subjects = [sound_levels(100), vec![mutant("garden", "m", "panic")]].concat();
        let mut results = Vec::new();
        for (level, subject) in (0_u64..).zip(&subjects[..100]) {
            results.push(result(&subject.id, "good", u64::from(level != 7), 1));
            results.push(result(&subject.id, "fair", u64::from(level % 50 != 7), 1));
        }
        results.extend([result("m", "good", 4, 5), result("m", "fair", 0, 5)]);
        let scored = judge(&subjects, results);
        let found = |subject: &str, tester: &str| {
            let is = |job: &&ScoredJob| job.result.subject == subject && job.result.tester == tester;
            scored.iter().find(is).map(|job| (job.found.failed, job.first)).expect("it was played")
        };
        assert_eq!(found("m", "good"), (true, Some(2.0)));
        assert_eq!(found("m", "fair"), (false, None));
        assert_eq!(found("garden bed:7", "good"), (true, Some(2.0)), "a false finding");
        assert_eq!(found("garden bed:8", "good"), (false, None));
    }

    #[test]
    fn who_never_wins_finds_by_its_reward() {
        let subjects =
            [sound_levels(9), vec![mutant("garden", "poor", "panic"), mutant("garden", "typical", "panic")]].concat();
        let collected = |subject: &str, reward: f64| JobResult {
            reward: Some(reward),
            seconds: 8.0,
            ..result(subject, "glutton", 0, 4)
        };
        let mut results: Vec<JobResult> =
            (0_u32..).zip(&subjects[..9]).map(|(level, it)| collected(&it.id, f64::from(20 + level % 3))).collect();
        results.extend([collected("poor", 3.0), collected("typical", 19.0)]);
        let scored = judge(&subjects, results);
        let found: Vec<bool> = scored.iter().map(|job| job.found.failed).collect();
        assert_eq!(found, [[false; 9].as_slice(), &[true, false]].concat());
        assert_eq!(scored[9].first, Some(8.0), "after all episodes");
    }

    #[test]
    fn what_was_found_first_counts() {
        let subjects = [sound_levels(1), vec![mutant("garden", "m", "panic")]].concat();
        let finding = JobFinding { detector: "stuck".to_owned(), tick: None, message: String::new() };
        let found = JobResult { findings: vec![finding], found_after: Some(0.5), ..result("m", "good", 0, 1) };
        let scored = judge(&subjects, vec![result("garden bed:0", "good", 1, 1), found]);
        assert_eq!((scored[1].first, scored[1].found.alone()), (Some(0.5), true));
        assert!(scored[1].found.detected && scored[1].found.failed && !scored[1].found.unsolvable);
        let proved = JobResult { unsolvable: Some("walled in".to_owned()), ..result("m", "bad", 0, 1) };
        assert!(judge(&subjects, vec![proved])[0].found.unsolvable);
    }

    #[test]
    fn beside_a_sound_build_what_is_exact_shows_any_difference_and_chance_only_large_ones() {
        let subjects = [sound_levels(1), vec![mutant("garden", "a", "panic"), mutant("garden", "b", "panic")]].concat();
        let exact = |subject: &str, end: &str| JobResult {
            exact: true,
            ends: vec![end.to_owned()],
            ..result(subject, "exact", 1, 1)
        };
        let results = vec![
            exact("garden bed:0", "won 9"),
            exact("a", "won 9"),
            exact("b", "won 10"),
            result("garden bed:0", "random", 20, 20),
            result("a", "random", 17, 20),
            result("b", "random", 2, 20),
        ];
        let scored = judge(&subjects, results);
        let differs: Vec<bool> = scored.iter().map(|job| job.found.differs).collect();
        assert_eq!(differs, [false, false, true, false, false, true]);
    }

    fn played(subject: &Subject, reward: f64) -> JobResult {
        let (subject, tester) = (subject.id.clone(), "glutton".to_owned());
        JobResult { subject, tester, episodes: 1, reward: Some(reward), ..JobResult::default() }
    }

    /// The indices of unusual rewards: on a mutant, after these on unmutated levels, and on the unmutated levels
    /// themselves.
    fn unusual(sound_rewards: &[f64], rewards: &[f64]) -> (Vec<bool>, Vec<usize>) {
        let levels: Vec<Subject> = (0..sound_rewards.len() as u64).map(|level| sound("garden", level)).collect();
        let results: Vec<JobResult> =
            levels.iter().zip(sound_rewards).map(|(level, reward)| played(level, *reward)).collect();
        let subjects = levels.iter().map(|level| (level.id.as_str(), level)).collect();
        let typical = TypicalRewards::new(&subjects, &results);
        let broken = mutant("garden", "m", "panic");
        let of_mutant = rewards.iter().map(|reward| typical.is_unusual("garden", &played(&broken, *reward))).collect();
        let of_sound = (0..results.len()).filter(|place| typical.is_unusual("garden", &results[*place])).collect();
        (of_mutant, of_sound)
    }

    #[test]
    fn a_reward_is_unusual_far_outside_of_those_of_sound_levels() {
        let sound_rewards = [10.0, 11.0, 12.0, 10.5, 11.5, 10.0, 12.0, 11.0, 11.0];
        // Mean 11, standard deviation 0.75.
        let rewards = [11.0, 8.1, 7.9, 13.9, 14.1, -3.0];
        assert_eq!(unusual(&sound_rewards, &rewards).0, [false, false, true, false, true, true]);
        let skewed = [10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 10.0, 14.9];
        let skewed = [skewed.as_slice(), &[10.0; 15]].concat();
        assert_eq!(unusual(&skewed, &[14.8]).0, [false], "no more than another one");
        assert!(unusual(&sound_rewards, &rewards).1.is_empty());
    }

    #[test]
    fn a_sound_level_is_held_against_the_others() {
        let sound_rewards = [10.0, 11.0, 12.0, 10.5, 30.0, 10.0, 12.0, 11.0, 11.0, 11.0];
        assert_eq!(unusual(&sound_rewards, &[]).1, [4]);
    }

    #[test]
    fn few_levels_luck_and_other_games_say_nothing() {
        assert_eq!(unusual(&[9.0, 8.0, 9.0, 8.0, 9.0, 8.0, 9.0], &[99.0]).0, [false], "one too few");
        let lucky = [0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.0];
        assert_eq!(unusual(&lucky, &[1.0]), (vec![false], vec![]), "now and then it finds something by chance");
        assert_eq!(unusual(&[0.0; 20], &[1.0]).0, [false], "it may have had no luck yet");
        assert_eq!(unusual(&[5.0; 20], &[5.0, 4.0]).0, [false, true], "it always collects the same");
        let levels: Vec<Subject> = (0..20).map(|level| sound("garden", level)).collect();
        let results: Vec<JobResult> =
            (0_u32..).zip(&levels).map(|(place, level)| played(level, f64::from(20 + place % 5))).collect();
        let subjects = levels.iter().map(|level| (level.id.as_str(), level)).collect();
        let typical = TypicalRewards::new(&subjects, &results);
        let far = played(&mutant("garden", "m", "panic"), 99.0);
        assert!(typical.is_unusual("garden", &far) && !typical.is_unusual("forest", &far));
        assert!(!typical.is_unusual("garden", &JobResult { reward: None, ..far.clone() }));
        assert!(!typical.is_unusual("garden", &JobResult { tester: "random".to_owned(), ..far }));
    }
}
