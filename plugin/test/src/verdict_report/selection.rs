//! The levels of the page, the worst ones first.

use crate::{
    findings::{Date, FINDINGS, LOST, NOT_SOLVED, StoredFinding, list_findings},
    verdict::{LevelOutcome, LevelVerdict, PinnedFindings, ResultLines, TestError},
};
use std::{
    cmp::Ordering,
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

/// Largest number of levels in the table: a longer page would open slowly. All levels are in `results.json`.
const MOST_LEVELS: usize = 2_000;

/// Largest number of levels in the gallery.
const MOST_THUMBS: usize = 10_000;

/// Levels of a test, the worst ones first.
#[derive(Default)]
pub struct Selection {
    /// The levels of the table.
    pub levels: Vec<LevelVerdict>,
    /// Number of the other levels, which are not worse.
    pub left_out: u64,
    /// The levels of the gallery.
    pub gallery: Vec<SmallLevel>,
    /// Number of all levels.
    pub all: u64,
    /// Findings that do not count for a while.
    pub pinned: PinnedFindings,
    /// The failed episodes that were kept, by the levels of the table.
    pub failures: BTreeMap<String, FailedEpisode>,
}

/// A failed episode in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FailedEpisode {
    /// Its file, relative to the folder of the results.
    pub file: String,
    /// The tester, if it is known.
    pub tester: Option<String>,
    /// Its end in words.
    pub end: String,
}

impl Selection {
    /// Reads the results in a folder, and calls `each` for each level. Memory does not grow with their number.
    pub fn read(folder: &Path, each: &mut dyn FnMut(&LevelVerdict)) -> Result<Self, TestError> {
        let mut lines = ResultLines::open(folder)?;
        let pinned = PinnedFindings::read(folder, Date::today())?;
        let (mut levels, mut gallery, mut all) = (Vec::new(), Vec::new(), 0_u64);
        while let Some(level) = lines.next_level()? {
            all += 1;
            each(&level);
            gallery.push((Standing::of(&level), SmallLevel::of(&level, &pinned)));
            if gallery.len() >= 2 * MOST_THUMBS {
                keep_worst_small(&mut gallery);
            }
            levels.push(level);
            if levels.len() >= 2 * MOST_LEVELS {
                keep_worst(&mut levels);
            }
        }
        keep_worst(&mut levels);
        keep_worst_small(&mut gallery);
        let left_out = all - levels.len() as u64;
        let gallery = gallery.into_iter().map(|(_, level)| level).collect();
        let failures = failures(folder, &levels);
        Ok(Self { levels, left_out, gallery, all, pinned, failures })
    }

    /// Orders levels that are otherwise equally bad by their share of reached squares, the smallest first. Levels without a
    /// share come after those with one.
    pub fn order_by_reach(&mut self, share: &dyn Fn(&LevelVerdict) -> Option<f64>) {
        let shares: BTreeMap<u64, f64> =
            self.levels.iter().filter_map(|level| Some((level.index, share(level)?))).collect();
        let share_of = |level: &LevelVerdict| shares.get(&level.index).copied().unwrap_or(f64::INFINITY);
        self.levels.sort_by(|one, other| {
            let [first, second] = [one, other].map(Standing::of);
            first
                .worse_apart_from_number(&second)
                .then_with(|| share_of(one).total_cmp(&share_of(other)))
                .then_with(|| one.index.cmp(&other.index))
        });
        // The gallery begins with the levels of the table, in the same order.
        let places: BTreeMap<u64, usize> =
            self.levels.iter().enumerate().map(|(place, level)| (level.index, place)).collect();
        self.gallery.sort_by_key(|small| places.get(&small.index).copied().unwrap_or(usize::MAX));
    }
}

/// Returns the failed episodes in the folder of a test that were kept of these levels. A file that cannot be read is left
/// out: `playbot review` names it.
fn failures(folder: &Path, levels: &[LevelVerdict]) -> BTreeMap<String, FailedEpisode> {
    let failed = levels.iter().filter(|level| level.outcome == LevelOutcome::BotFailed);
    let failed: BTreeSet<&str> = failed.map(|level| level.level.as_str()).collect();
    if failed.is_empty() {
        return BTreeMap::new();
    }
    let found = levels.iter().flat_map(|level| &level.findings).filter_map(|finding| finding.file.as_ref());
    let found: BTreeSet<&str> = found.map(String::as_str).collect();
    let mut failures = BTreeMap::new();
    for (name, path) in list_findings(folder).unwrap_or_default() {
        let file = format!("{FINDINGS}/{name}.finding");
        // A recording is read only where it may be a failed episode. Files beside the results are not of the test.
        if found.contains(file.as_str()) || path != folder.join(&file) {
            continue;
        }
        let Ok(StoredFinding { head, .. }) = StoredFinding::read(&path) else { continue };
        if [LOST, NOT_SOLVED].contains(&head.detector.as_str()) && failed.contains(head.level.as_str()) {
            let (tester, end) = (head.tester, head.message);
            failures.entry(head.level).or_insert(FailedEpisode { file, tester, end });
        }
    }
    failures
}

fn keep_worst(levels: &mut Vec<LevelVerdict>) {
    levels.sort_by(|one, other| Standing::of(one).worst_first(&Standing::of(other)));
    levels.truncate(MOST_LEVELS);
}

fn keep_worst_small(levels: &mut Vec<(Standing, SmallLevel)>) {
    levels.sort_by(|(one, _), (other, _)| one.worst_first(other));
    levels.truncate(MOST_THUMBS);
}

/// What the order of levels depends on.
struct Standing {
    problems: usize,
    outcome: LevelOutcome,
    solved: u64,
    episodes: u64,
    ticks: f64,
    index: u64,
}

impl Standing {
    fn of(level: &LevelVerdict) -> Self {
        let LevelVerdict { score, outcome, index, .. } = level;
        let ticks = score.ticks.map_or(0.0, |ticks| ticks.median);
        let (solved, episodes) = (score.solved, score.episodes);
        Self { problems: problems(level), outcome: *outcome, solved, episodes, ticks, index: *index }
    }

    /// Orders by the outcome, from proved unsolvable to solved, then by more findings, fewer solved episodes, slower ones,
    /// and the order in the range. So no two levels are equal, and shards joined in any order give the same page.
    fn worst_first(&self, other: &Self) -> Ordering {
        self.worse_apart_from_number(other).then_with(|| self.index.cmp(&other.index))
    }

    fn worse_apart_from_number(&self, other: &Self) -> Ordering {
        let share = |a: &Self, b: &Self| u128::from(a.solved) * u128::from(b.episodes);
        let outcomes = self.outcome.cmp(&other.outcome);
        outcomes
            .then_with(|| other.problems.cmp(&self.problems))
            .then_with(|| share(self, other).cmp(&share(other, self)))
            .then_with(|| other.ticks.total_cmp(&self.ticks))
    }
}

/// Returns the number of findings, with one for a recording that no longer ends as it did.
pub(crate) fn problems(level: &LevelVerdict) -> usize {
    level.findings.len() + usize::from(level.is_regression())
}

/// What the gallery shows of a level.
#[derive(Clone, Debug, PartialEq)]
pub struct SmallLevel {
    /// Its index in the range.
    pub index: u64,
    /// Its name.
    pub title: String,
    /// The rank of its outcome.
    pub outcome: u8,
    /// Findings, with one for a recording that no longer ends as it did.
    pub findings: usize,
    /// A few words about it.
    pub words: String,
    /// Its pins in words, if it has some.
    pub pin: Option<String>,
}

impl SmallLevel {
    /// Takes what is shown of a level.
    pub fn of(level: &LevelVerdict, pinned: &PinnedFindings) -> Self {
        let findings = problems(level);
        let (solved, episodes) = (level.score.solved, level.score.episodes);
        let share = || format!("{solved} of {episodes}");
        let words = match (level.findings.first(), level.score.ticks) {
            (Some(finding), _) => finding.detector.clone(),
            (None, _) if findings > 0 => "recording".to_owned(),
            (None, Some(ticks)) if solved == episodes => format!("{} ticks", playbot_report::ticks(ticks.median)),
            (None, _) => share(),
        };
        let (title, outcome, pin) = (level.title(), level.outcome as u8, pinned.describe_level(level));
        Self { index: level.index, title, outcome, findings, words, pin }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        findings::FindingHead,
        verdict::Finding,
        verdict_report::testing::{finding, keep, level, record, tested},
    };
    use std::fs;

    #[test]
    fn the_outcome_comes_first_then_findings_then_failures_then_slow_levels_then_the_number() {
        let found = LevelVerdict { findings: vec![finding("panic", "index out of bounds")], ..level(4, 2, 2, 10) };
        let proved = |index| LevelVerdict {
            outcome: LevelOutcome::ProvedUnsolvable,
            findings: vec![finding("unreachable-goal", "a wall")],
            ..level(index, 0, 2, 0)
        };
        let twice = LevelVerdict { findings: [0; 2].map(|_| finding("stuck", "")).to_vec(), ..level(8, 0, 2, 0) };
        let levels = [
            level(0, 2, 2, 30),
            level(1, 2, 2, 90),
            level(2, 0, 2, 0),
            level(3, 1, 2, 10),
            found,
            level(5, 2, 2, 30),
            proved(6),
            proved(7),
            twice,
            level(9, 0, 2, 0),
        ];
        let parent = tempfile::tempdir().expect("a folder");
        let folder = tested(parent.path(), "whole", &record("hard:0..9", None), &levels);
        let selection = Selection::read(&folder, &mut |_| {}).expect("results");
        let order: Vec<u64> = selection.levels.iter().map(|level| level.index).collect();
        assert_eq!((order, selection.left_out), (vec![6, 7, 8, 2, 9, 4, 3, 1, 0, 5], 0));
    }

    #[test]
    fn equally_bad_levels_are_ordered_by_what_was_reached() {
        let parent = tempfile::tempdir().expect("a folder");
        let levels: Vec<LevelVerdict> = (0..5).map(|index| level(index, u64::from(index == 4), 2, 10)).collect();
        let folder = tested(parent.path(), "whole", &record("hard:0..4", None), &levels);
        let mut selection = Selection::read(&folder, &mut |_| {}).expect("results");
        // The second one is unknown, and the solved one stays the last.
        selection.order_by_reach(&|level| [Some(0.7), None, Some(0.2), Some(0.7), Some(0.0)][level.index as usize]);
        let order: Vec<u64> = selection.levels.iter().map(|level| level.index).collect();
        let gallery: Vec<u64> = selection.gallery.iter().map(|small| small.index).collect();
        assert_eq!((&order[..], gallery), (&[2, 0, 3, 1, 4][..], order.clone()));
    }

    #[test]
    fn kept_failed_episodes_are_those_of_the_levels_that_no_tester_solved() {
        let parent = tempfile::tempdir().expect("a folder");
        let folder = parent.path();
        let keep = |name: &str, level: &str, detector: &str| {
            let tester = Some("random".to_owned());
            keep(
                folder,
                name,
                FindingHead { tester, ..FindingHead::new(level, detector, "time was up after 30 ticks") },
            );
        };
        keep("a", "hard:0", NOT_SOLVED);
        keep("b", "hard:1", LOST);
        keep("c", "hard:2", "stuck");
        keep("d", "hard:2", LOST);
        keep("e", "hard:9", LOST);
        fs::write(folder.join(FINDINGS).join("f.finding"), "damaged").expect("writable");
        let found = Finding { file: Some(format!("{FINDINGS}/d.finding")), ..finding(LOST, "a finding") };
        let levels =
            [level(0, 0, 2, 0), level(1, 1, 2, 10), LevelVerdict { findings: vec![found], ..level(2, 0, 2, 0) }];
        let kept = failures(folder, &levels);
        let episode = FailedEpisode {
            file: "findings/a.finding".to_owned(),
            tester: Some("random".to_owned()),
            end: "time was up after 30 ticks".to_owned(),
        };
        assert_eq!(kept, BTreeMap::from([("hard:0".to_owned(), episode)]));
        assert!(failures(&folder.join("none"), &levels).is_empty() && failures(folder, &levels[1..2]).is_empty());
    }

    #[test]
    fn of_many_levels_the_worst_are_kept() {
        let (mut levels, most) = (Vec::new(), MOST_LEVELS as u64);
        for index in 0..4 * most + 7 {
            // Every 100th is not solved.
            levels.push(level(index, u64::from(index % 100 != 99), 1, 20));
            if levels.len() >= 2 * MOST_LEVELS {
                keep_worst(&mut levels);
            }
        }
        keep_worst(&mut levels);
        let order: Vec<u64> = levels.iter().map(|level| level.index).collect();
        let failed = (0..80).map(|number| 100 * number + 99);
        let solved = (0..).filter(|index| index % 100 != 99);
        assert_eq!(order, failed.chain(solved).take(MOST_LEVELS).collect::<Vec<u64>>());
    }
}
