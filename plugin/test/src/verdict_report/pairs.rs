//! Changed levels as pictures side by side: before, and now.

use crate::{
    verdict::{Comparison, EpisodePath, LevelMaps, LevelOutcome, LevelVerdict, ResultLines, TestError, TestRecord},
    verdict_report::{
        drawn::Drawings,
        ends,
        heat::{Grid, floor, shape, start_and_goal},
        reach::Reached,
        text,
    },
};
use bevy::math::Vec2;
use playbot_harness::floor_plan::FloorPlan;
use playbot_report::{counted, escape::escape};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt::{Display, Write},
    path::Path,
};

/// Most levels with pictures, those that have become worse first.
const MOST_PAIRS: usize = 40;

/// Largest size of a picture, bytes.
const MOST_BYTES: usize = 16_000;

/// Largest size of the squares that were reached or not, bytes.
const MOST_REACH: usize = 4_000;

/// Most squares of a path, as in results.
const MOST_STEPS: usize = 200;

/// Share of the plan by which a picture may be larger, for paths that leave it.
const BEYOND: f32 = 0.25;

/// The way in which a level has changed, the worst first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum ChangeKind {
    Unsolvable,
    Harder,
    NewFinding,
    Easier,
    GoneFinding,
    Unreached,
    Outcome,
    Path,
}

/// Part of a level's results that is compared.
struct Side {
    outcome: LevelOutcome,
    /// Ends of the episodes, in words.
    words: String,
    maps: Option<LevelMaps>,
    /// Testers that drew no random number.
    exact: BTreeSet<String>,
}

impl Side {
    fn of(level: &LevelVerdict) -> Self {
        let (solved, episodes) = (level.score.solved, level.score.episodes);
        let words = match level.outcome {
            LevelOutcome::ProvedUnsolvable => "proved unsolvable".to_owned(),
            _ => format!("solved {solved} of {episodes}, {}", ends(&level.score)),
        };
        let words = if solved == episodes { ends(&level.score) } else { words };
        let exact = level.testers.iter().filter(|tester| tester.exact).map(|tester| tester.tester.clone());
        Self { outcome: level.outcome, words, maps: level.maps.clone(), exact: exact.collect() }
    }

    /// Returns the path that solves the level, or else that of a failure.
    fn path(&self) -> Option<&EpisodePath> {
        let maps = self.maps.as_ref()?;
        if self.outcome == LevelOutcome::Solved { maps.best.as_ref() } else { maps.failure.as_ref() }
    }

    /// Returns the columns and rows of the squares of its path.
    fn squares(&self) -> Vec<[u64; 2]> {
        let Some((maps, known)) = self.maps.as_ref().zip(self.path()) else { return Vec::new() };
        let columns = maps.columns.max(1);
        let last = &known.path[known.path.len().saturating_sub(MOST_STEPS)..];
        last.iter().map(|[square, _]| [square % columns, square / columns]).collect()
    }
}

/// A changed level.
struct Pair {
    kind: ChangeKind,
    /// Changes in words.
    words: Vec<String>,
    before: Side,
    now: LevelVerdict,
}

/// Writes the section of the page about the levels whose verdict or path has changed; empty without any that can be drawn.
///
/// A path has changed if an unchanged level would have repeated it: the tester is the same, and it drew no random number, or
/// the seed and the number of episodes are the same.
///
/// # Errors
///
/// One of the results cannot be read.
pub(crate) fn pairs(
    before: &Path,
    now: &Path,
    comparison: &Comparison,
    drawings: &Drawings,
) -> Result<String, TestError> {
    let mut earlier = ResultLines::open(before)?;
    let was = earlier.record().clone();
    let mut known = BTreeMap::new();
    while let Some(level) = earlier.next_level()? {
        known.insert(level.level.clone(), Side::of(&level));
    }
    let verdicts = changed_verdicts(comparison);
    let mut lines = ResultLines::open(now)?;
    let is = lines.record().clone();
    let (mut changed, mut count) = (Vec::new(), 0_u64);
    while let Some(level) = lines.next_level()? {
        let Some(before) = known.remove(&level.level) else { continue };
        let now = Side::of(&level);
        let mut words = verdicts.get(level.level.as_str()).cloned().unwrap_or_default();
        if words.is_empty() && before.outcome != now.outcome {
            let [was, is] = [before.outcome, now.outcome].map(LevelOutcome::name);
            let outcomes = format!("{was} before, {is} now, which may be chance");
            words.push((ChangeKind::Outcome, outcomes));
        }
        if words.is_empty() && repeats(&before, &now, [&was, &is]) && before.squares() != now.squares() {
            words.push((ChangeKind::Path, "another path".to_owned()));
        }
        let Some(kind) = words.iter().map(|(kind, _)| *kind).min() else { continue };
        count += 1;
        let words = words.into_iter().map(|(_, words)| words).collect();
        changed.push(Pair { kind, words, before, now: level });
        if changed.len() >= 8 * MOST_PAIRS {
            keep_worst(&mut changed);
        }
    }
    keep_worst(&mut changed);
    let drawn: Vec<String> = changed.iter().filter_map(|pair| pair.html(drawings)).collect();
    if drawn.is_empty() {
        return Ok(String::new());
    }
    let mut out = String::from(
        "<section>\n<h2>Before and now</h2>\n<p>Levels whose verdict or path has changed, the worst first. ",
    );
    out += "Each picture has the path of the shortest solution, or of a failure, which is dashed and ends with a cross. \
            The thick part of a path is not in the other one.";
    let more = count.saturating_sub(drawn.len() as u64);
    if more > 0 {
        let _ = write!(
            out,
            " {} changed, too, and {} not drawn.",
            counted(more, "other level"),
            if more == 1 { "is" } else { "are" }
        );
    }
    Ok(out + "</p>\n" + &drawn.concat() + "</section>\n")
}

fn keep_worst(changed: &mut Vec<Pair>) {
    changed.sort_by_key(|pair| (pair.kind, pair.now.index));
    changed.truncate(MOST_PAIRS);
}

/// Returns the changes of a comparison by level.
fn changed_verdicts(comparison: &Comparison) -> BTreeMap<&str, Vec<(ChangeKind, String)>> {
    let mut changes: BTreeMap<&str, Vec<(ChangeKind, String)>> = BTreeMap::new();
    let Comparison { unsolvable, harder, easier, new_findings, gone_findings, unreached, other_testers, .. } =
        comparison;
    for (kind, list) in
        [(ChangeKind::Unsolvable, unsolvable), (ChangeKind::Harder, harder), (ChangeKind::Easier, easier)]
    {
        for change in list {
            changes.entry(&change.level).or_default().push((kind, without_level(&change.level, change)));
        }
    }
    for (kind, list, what) in [
        (ChangeKind::NewFinding, new_findings, "new finding"),
        (ChangeKind::GoneFinding, gone_findings, "gone finding"),
    ] {
        for change in list {
            let words = format!("{what}: {}", without_level(&change.level, change));
            changes.entry(&change.level).or_default().push((kind, words));
        }
    }
    for change in other_testers {
        let words = without_level(&change.level, change);
        changes.entry(&change.level).or_default().push((ChangeKind::Outcome, words));
    }
    for change in unreached {
        let words = without_level(&change.level, change);
        changes.entry(&change.level).or_default().push((ChangeKind::Unreached, words));
    }
    changes
}

/// Describes a change without the level at its beginning.
fn without_level(level: &str, change: &dyn Display) -> String {
    let words = change.to_string();
    words.strip_prefix(level).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(&words).to_owned()
}

/// Returns whether an unchanged level would have the same path in both results.
fn repeats(before: &Side, now: &Side, [was, is]: [&TestRecord; 2]) -> bool {
    let (Some(one), Some(other)) = (before.path(), now.path()) else { return false };
    let tester = |record: &TestRecord, path: &EpisodePath| {
        record.testers.iter().find(|tester| tester.name == path.tester).cloned()
    };
    let is_same = tester(was, one).zip(tester(is, other)).is_some_and(|(one, other)| one == other);
    let has_same_draws = (was.seed, was.episodes, &was.testers) == (is.seed, is.episodes, &is.testers);
    let is_exact = before.exact.contains(&one.tester) && now.exact.contains(&other.tester);
    is_same && (has_same_draws || is_exact)
}

impl Pair {
    /// Writes both pictures; `None` if the level has no plan.
    fn html(&self, drawings: &Drawings) -> Option<String> {
        let now = Side::of(&self.now);
        let of_rows = |maps: &LevelMaps| maps.plan.as_ref()?.plan(Vec2::new(maps.x, maps.y));
        let rows = |side: &Side| side.maps.as_ref().and_then(of_rows);
        let present = drawings.plans.get(&self.now).or_else(|| rows(&now))?;
        let earlier = rows(&self.before);
        let note = if earlier.is_none() { ", on the plan of now" } else { "" };
        let earlier = earlier.unwrap_or_else(|| present.clone());
        let same = common(&self.before, &now);
        let reached = drawings.reached(&self.now, &present);
        let before_reached = self.before.maps.as_ref().filter(|_| self.before.outcome != LevelOutcome::Solved);
        let before_reached = before_reached.and_then(|maps| Reached::by_testers(maps, &earlier));
        let title = self.now.title();
        let [one, other] = [
            (&self.before, &earlier, before_reached.as_ref(), &same[0], "before", note),
            (&now, &present, reached.as_deref(), &same[1], "now", ""),
        ]
        .map(|(side, plan, reached, same, when, note)| {
            let by = side.path().map_or_else(String::new, |path| format!("; path of {}", text(&path.tester)));
            let picture = side.picture(plan, reached, same, &format!("{title} {when}"))?;
            Some(format!(
                "<figure>{picture}<figcaption class=\"key\"><b>{when}</b>: {}{by}{note}</figcaption></figure>\n",
                text(&side.words)
            ))
        });
        let words: Vec<String> = self.words.iter().map(|words| text(words)).collect();
        Some(format!(
            "<article class=\"pair\">\n<h3>{}</h3>\n<p class=\"key\">{}</p>\n<div class=\"sides\">\n{}{}</div>\n</article>\n",
            text(&title),
            words.join("; "),
            one?,
            other?
        ))
    }
}

impl Side {
    /// Draws the level with its path. `same` says of each square whether it is in the other path, too.
    fn picture(&self, plan: &FloorPlan, reached: Option<&Reached>, same: &[bool], label: &str) -> Option<String> {
        let positions = self.positions();
        let most = plan.bounds.inflate(BEYOND * plan.bounds.size().max_element());
        let finite = positions.iter().filter(|position| position.is_finite());
        let extent =
            finite.fold(plan.bounds, |extent, position| extent.union_point(position.clamp(most.min, most.max)));
        let grid = Grid::new(extent)?;
        let [width, height] = grid.size();
        let label = escape(label);
        let mut svg =
            format!("<svg class=\"level\" viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{label}\">");
        svg += &reached.map_or_else(String::new, |reached| reached.svg(&grid, MOST_REACH));
        floor(plan, &grid, &mut svg);
        let is_solved = self.outcome == LevelOutcome::Solved;
        let class = if is_solved { "way" } else { "way lost-way" };
        let places: Vec<Option<[i32; 2]>> = positions.iter().map(|position| grid.place(*position)).collect();
        shape(class, None, &line(&places, |_| true), &mut svg);
        shape("differs", None, &line(&places, |end| !same.get(end).copied().unwrap_or(false)), &mut svg);
        if let Some([x, y]) = places.last().copied().flatten().filter(|_| !is_solved) {
            shape("mark", None, &format!("M{} {}l14 14m0-14l-14 14", x - 7, y - 7), &mut svg);
        }
        start_and_goal(plan, &grid, &mut svg);
        svg += "</svg>";
        (svg.len() <= MOST_BYTES).then_some(svg)
    }

    /// Returns the middles of the squares of its path.
    fn positions(&self) -> Vec<Vec2> {
        let Some(maps) = &self.maps else { return Vec::new() };
        let middle = |[column, row]: [u64; 2]| {
            Vec2::new(maps.x, maps.y) + (Vec2::new(column as f32, row as f32) + 0.5) * maps.side
        };
        self.squares().into_iter().map(middle).collect()
    }
}

/// Returns the path through places: each step that ends in one of the wanted places.
fn line(places: &[Option<[i32; 2]>], is_wanted: impl Fn(usize) -> bool) -> String {
    let (mut path, mut last) = (String::new(), None);
    for (end, pair) in places.windows(2).enumerate() {
        let [Some(from), Some(to)] = pair else { continue };
        if !(is_wanted(end + 1) || is_wanted(end)) {
            continue;
        }
        if last != Some(end) {
            let _ = write!(path, "M{} {}", from[0], from[1]);
        }
        let _ = write!(path, "L{} {}", to[0], to[1]);
        last = Some(end + 1);
    }
    path
}

/// Returns for each square of both paths whether it belongs to their longest common sequence of squares. Paths in squares
/// of other sizes have nothing in common.
fn common(before: &Side, now: &Side) -> [Vec<bool>; 2] {
    let (one, other) = (before.squares(), now.squares());
    let mut same = [vec![false; one.len()], vec![false; other.len()]];
    let geometry = |side: &Side| side.maps.as_ref().map(|maps| [maps.x, maps.y, maps.side]);
    if geometry(before) != geometry(now) {
        return same;
    }
    // Length of the longest common sequence from a square on.
    let mut longest = vec![vec![0_u16; other.len() + 1]; one.len() + 1];
    for (row, square) in one.iter().enumerate().rev() {
        for (column, also) in other.iter().enumerate().rev() {
            longest[row][column] = match square == also {
                true => longest[row + 1][column + 1] + 1,
                false => longest[row + 1][column].max(longest[row][column + 1]),
            };
        }
    }
    let (mut row, mut column) = (0, 0);
    while row < one.len() && column < other.len() {
        if one[row] == other[column] {
            (same[0][row], same[1][column]) = (true, true);
            (row, column) = (row + 1, column + 1);
        } else if longest[row + 1][column] >= longest[row][column + 1] {
            row += 1;
        } else {
            column += 1;
        }
    }
    same
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::{FindingChange, PlanRows, SolvedByOthers},
        verdict_report::{
            drawn::Plans,
            files::PictureFiles,
            testing::{Garden, level, record, tested},
        },
    };

    fn on_path(squares: &[u64]) -> Option<EpisodePath> {
        let path = squares.iter().map(|square| [*square, 2]).collect();
        Some(EpisodePath { tester: "random".to_owned(), episode: 0, path })
    }

    /// Makes a level of the garden that was solved or not, along these squares.
    fn along(index: u64, is_solved: bool, squares: &[u64]) -> LevelVerdict {
        let (best, failure) = if is_solved { (on_path(squares), None) } else { (None, on_path(squares)) };
        let visits = squares.iter().map(|square| [*square, 2]).collect();
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, visits, best, failure, ..LevelMaps::default() };
        LevelVerdict { maps: Some(maps), ..level(index, u64::from(is_solved), 1, 9) }
    }

    fn compared(
        records: [&TestRecord; 2],
        before: &[LevelVerdict],
        now: &[LevelVerdict],
        changes: &Comparison,
    ) -> String {
        let parent = tempfile::tempdir().expect("a folder");
        let [was, is] = [("before", records[0], before), ("now", records[1], now)]
            .map(|(name, record, levels)| tested(parent.path(), name, record, levels));
        let drawings = Drawings::new(Plans::of(Some(&Garden), records[1]), PictureFiles::default(), None, 0);
        pairs(&was, &is, changes, &drawings).expect("results")
    }

    #[test]
    fn the_part_of_a_path_that_differs_is_marked_in_both() {
        let tested = record("hard:0..1", None);
        let path = |square: u64| [65, 66, square, 67, 68];
        let [before, now] =
            [66 + 64, 66 + 128].map(|middle| [along(0, true, &path(middle)), along(1, true, &path(130))]);
        let html = compared([&tested, &tested], &before, &now, &Comparison::default());
        assert_eq!(html.matches("<article").count(), 1, "the second level is as it was: {html}");
        for part in [
            "<h3>hard:0</h3>\n<p class=\"key\">another path</p>",
            "<path class=\"way\" d=\"M15 145L25 145L25 135L35 145L45 145\"/><path class=\"differs\" d=\"M25 145L25 135L35 145\"/>",
            "<path class=\"way\" d=\"M15 145L25 145L25 125L35 145L45 145\"/><path class=\"differs\" d=\"M25 145L25 125L35 145\"/>",
            "<b>before</b>: solved each time; path of random, on the plan of now</figcaption>",
            "<b>now</b>: solved each time; path of random</figcaption>",
        ] {
            assert!(html.contains(part), "{part} in {html}");
        }
    }

    #[test]
    fn a_level_that_is_lost_now_shows_both_plans_and_what_was_reached() {
        let tested = record("hard:0..0", None);
        let mut before = along(0, true, &[65, 66, 67]);
        let rows = PlanRows { side: 1.0, rows: "64./8^56./S62.G/64#".to_owned() };
        before.maps.iter_mut().for_each(|maps| maps.plan = Some(rows.clone()));
        let now = along(0, false, &[65, 66]);
        let change = FindingChange { level: "hard:0".to_owned(), detector: "<stuck>".to_owned(), tester: None };
        let changes = Comparison { new_findings: vec![change], ..Comparison::default() };
        let html = compared([&tested, &tested], &[before], &[now], &changes);
        let (was, is) = html.split_once("<b>before</b>").expect("both");
        assert!(
            was.contains("class=\"hazard\" d=\"M0 10h80v10h-80z\"") && was.contains("viewBox=\"0 0 640 40\""),
            "{was}"
        );
        assert!(was.contains("<p class=\"key\">new finding: &lt;stuck&gt;</p>") && !was.contains("hatched"), "{was}");
        assert!(is.contains("class=\"way lost-way\" d=\"M15 145L25 145\"") && is.contains("class=\"hatched\""), "{is}");
        assert!(
            is.contains("<b>now</b>: solved 0 of 1, lost 1; path of random<") && !is.contains("on the plan"),
            "{is}"
        );
    }

    #[test]
    fn the_paths_of_other_draws_and_other_testers_are_no_change() {
        let tested = record("hard:0..0", None);
        let (before, now) = ([along(0, true, &[65, 66])], [along(0, true, &[65, 67])]);
        let none = Comparison::default();
        assert!(!compared([&tested, &tested], &before, &now, &none).is_empty());
        let seeded = TestRecord { seed: 4, ..tested.clone() };
        assert_eq!(compared([&tested, &seeded], &before, &now, &none), "");
        let mut exact = [before.clone(), now.clone()];
        exact.iter_mut().flatten().for_each(|level| level.testers[0].exact = true);
        assert!(!compared([&tested, &seeded], &exact[0], &exact[1], &none).is_empty(), "it draws nothing");
        let mut others = tested.clone();
        others.testers[0].checksum = Some("0f".to_owned());
        assert_eq!(compared([&tested, &others], &before, &now, &none), "");
        let lost = [along(0, false, &[65, 66])];
        let html = compared([&tested, &seeded], &before, &lost, &none);
        assert!(html.contains("solved before, bot-failed now, which may be chance"), "{html}");
        let gone = SolvedByOthers { level: "hard:0".to_owned(), before: true, by: vec!["search".to_owned()] };
        let gone = Comparison { other_testers: vec![gone], ..none };
        let html = compared([&tested, &others], &before, &lost, &gone);
        assert!(html.contains("solved before by search alone, and the testers differ<"), "{html}");
        assert!(!html.contains("may be chance"), "{html}");
    }

    #[test]
    fn of_many_changes_the_worst_are_drawn() {
        let tested = record("hard:0..399", None);
        let before: Vec<LevelVerdict> = (0..400).map(|index| along(index, true, &[65, 66])).collect();
        let now: Vec<LevelVerdict> = (0..400).map(|index| along(index, index != 399, &[65, 67])).collect();
        let html = compared([&tested, &tested], &before, &now, &Comparison::default());
        assert_eq!(html.matches("<article").count(), MOST_PAIRS);
        let first = html.find("<h3>hard:399</h3>").expect("the lost one");
        assert!(
            first < html.find("<h3>hard:0</h3>").expect("the next one") && html.contains(" 360 other levels changed")
        );
        assert!(!html.contains("<h3>hard:39</h3>"), "{html}");
    }

    #[test]
    fn levels_without_paths_or_plans_are_left_out_and_missing_results_are_an_error() {
        let tested = record("hard:0..0", None);
        let none = Comparison::default();
        assert_eq!(compared([&tested, &tested], &[level(0, 1, 1, 9)], &[level(0, 1, 1, 9)], &none), "");
        assert_eq!(compared([&tested, &tested], &[along(0, true, &[])], &[along(0, true, &[])], &none), "");
        let odd = along(0, true, &[u64::MAX, 65, u64::MAX / 2]);
        let html = compared([&tested, &tested], &[odd], &[along(0, true, &[65])], &none);
        assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
        let drawings = Drawings::new(Plans::of(Some(&Garden), &tested), PictureFiles::default(), None, 0);
        let missing = pairs(Path::new("no-such-folder"), Path::new("no-such-folder"), &none, &drawings);
        assert!(matches!(missing, Err(TestError::NoResults { .. })));
    }

    #[test]
    fn common_squares_are_those_of_the_longest_sequence() {
        let side = |squares: &[u64]| Side::of(&along(0, true, squares));
        let same = common(&side(&[1, 2, 3, 2, 1, 9]), &side(&[1, 3, 2, 9]));
        assert_eq!(same, [vec![true, false, true, true, false, true], vec![true; 4]]);
        let mut wide = along(0, true, &[1, 2]);
        wide.maps.iter_mut().for_each(|maps| maps.side = 2.0);
        assert_eq!(common(&side(&[1, 2]), &Side::of(&wide)), [vec![false; 2], vec![false; 2]]);
    }
}
