//! Comparison with earlier results, separating changes from noise.

#[cfg(test)]
mod tests;

use crate::{
    findings::{RecordedCourse, course_of_recording},
    verdict::{
        LevelVerdict, Shard, TesterVerdict,
        error::TestError,
        maps::{LevelMaps, MapScope},
        plan::{TestPlan, TestRecord, TesterRecord},
        played::ReachedCells,
        results::ResultLines,
        statistics::{Trials, benjamini_hochberg, fisher_exact},
    },
};
use bevy::math::Vec2;
use bevy_playbot::demo::file::{DemoEpisode, DemoReader};
use playbot_harness::{
    game::{Game, level_designs},
    level_files::is_level_files,
    parallel::on_threads,
};
use playbot_report::counted;
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::{Path, PathBuf},
};

/// Expected share of false alarms among the levels reported as easier or harder.
pub const FALSE_DISCOVERY_RATE: f64 = 0.05;

/// Most levels that are named in a list on one line.
const MOST_NAMES: usize = 5;

/// Comparison of two results, level by level.
///
/// A tester that drew no random number on a level, before and now, would repeat its episode exactly. So if it newly
/// solves the level, or no longer does, the level has changed, even with a single episode.
///
/// The episodes of all other testers are pooled and compared by Fisher's exact test. Over all levels, at most one
/// alarm in twenty is false on average (Benjamini and Hochberg). A new proof that a level cannot be solved is always
/// reported.
///
/// Testers of one of the tests alone are left out. A level that only they solved cannot be compared, and is named.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Comparison {
    /// Levels in both.
    pub levels: u64,
    /// Levels that were not tested before.
    pub only_now: u64,
    /// Levels that are no longer tested.
    pub only_before: u64,
    /// Testers and detectors that are left out, with reasons.
    pub left_out: Vec<String>,
    /// Levels that were solved in one of the tests alone, by testers that take no part in the other.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub other_testers: Vec<SolvedByOthers>,
    /// Levels that became unsolvable, or newly proved so.
    pub unsolvable: Vec<Change>,
    /// Levels that are solved less often.
    pub harder: Vec<Change>,
    /// Levels that are solved more often.
    pub easier: Vec<Change>,
    /// Findings that are new.
    pub new_findings: Vec<FindingChange>,
    /// Findings that are gone.
    pub gone_findings: Vec<FindingChange>,
    /// Squares of levels that are not solved now, where no tester comes any more.
    pub unreached: Vec<UnreachedSquares>,
    /// Reasons why the squares of other levels that are not solved now are not compared, with the number of levels.
    pub places_left_out: Vec<String>,
    /// The earlier test, if its squares can be compared with those of another test now: with its testers, its number of
    /// episodes and its seed.
    #[serde(skip)]
    pub earlier: Option<EarlierTest>,
}

/// The test of earlier results.
#[derive(Clone, Debug, PartialEq)]
pub struct EarlierTest {
    /// Folder of the results.
    pub folder: PathBuf,
    /// Description of the test.
    pub record: TestRecord,
}

impl Comparison {
    /// Compares the results in a folder with earlier ones.
    ///
    /// # Errors
    ///
    /// [`TestError::Incomparable`] for results of another game or version, or without a common level or tester;
    /// another [`TestError`] if they cannot be read.
    pub fn read(before: &Path, now: &Path) -> Result<Self, TestError> {
        let mut lines = ResultLines::open_whole(now)?;
        let Comparable { mut earlier, common, other_detectors, left_out } = comparable(before, lines.record())?;
        let draws = |record: &TestRecord| (record.seed, record.episodes);
        let (drawn, draws) = (draws(earlier.record()), draws(lines.record()));
        let mut known = BTreeMap::new();
        while let Some(level) = earlier.next_level()? {
            known.insert(level.level.clone(), Known::of(level, &common, &other_detectors, drawn));
        }
        let (mut comparison, mut open) = (Self { left_out, ..Self::default() }, Open::default());
        while let Some(level) = lines.next_level()? {
            match known.remove(&level.level) {
                Some(known) => {
                    let name = level.level.clone();
                    let level = Known::of(level, &common, &other_detectors, draws);
                    comparison.compare(&known, &name, &level, &mut open)
                }
                None => comparison.only_now += 1,
            }
        }
        if comparison.levels == 0 {
            let differences = vec![no_common_level(earlier.record(), lines.record())];
            return Err(TestError::Incomparable { folder: before.into(), differences });
        }
        comparison.only_before = known.len() as u64;
        comparison.judge(open.doubtful);
        let [was, is] = [earlier.record(), lines.record()];
        let left_out = open.places.iter().map(|(why, levels)| why.words(levels, was, is));
        comparison.places_left_out = left_out.collect();
        if open.places.keys().any(|why| matches!(why, PlacesLeftOut::Testers | PlacesLeftOut::Draws)) {
            comparison.earlier = Some(EarlierTest { folder: before.into(), record: was.clone() });
        }
        Ok(comparison)
    }

    /// Checks before a test that its results can be compared with those in a folder.
    ///
    /// # Errors
    ///
    /// As for [`read`](Self::read), as far as known in advance.
    pub fn check(before: &Path, record: &TestRecord) -> Result<(), TestError> {
        comparable(before, record).map(drop)
    }

    /// Returns what is said if no level and no finding has changed.
    pub fn no_change(&self) -> &'static str {
        match self.other_testers.is_empty() {
            true => "nothing has changed by more than chance",
            false => "the testers of both tests show no change by more than chance",
        }
    }

    /// Returns the same as a sentence.
    pub(crate) fn no_change_sentence(&self) -> String {
        let mut words = format!("{}.", self.no_change());
        words.get_mut(..1).into_iter().for_each(str::make_ascii_uppercase);
        words
    }

    /// Returns how many levels cannot be compared because the testers differ, and the first few of them; `None` if all can.
    pub fn not_comparable(&self) -> Option<String> {
        let count = self.other_testers.len();
        let names: Vec<&str> = self.other_testers.iter().take(MOST_NAMES).map(|level| level.level.as_str()).collect();
        let more = count.saturating_sub(names.len());
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        (count > 0).then(|| {
            format!(
                "{} cannot be compared, since the testers differ and only those of one test solved {}: {}{more}",
                counted(count as u64, "level"),
                if count == 1 { "it" } else { "them" },
                names.join(", ")
            )
        })
    }

    /// Returns whether something has become worse.
    pub fn has_alarms(&self) -> bool {
        !(self.unsolvable.is_empty() && self.harder.is_empty() && self.new_findings.is_empty())
    }

    fn compare(&mut self, known: &Known, level: &str, now: &Known, open: &mut Open) {
        self.levels += 1;
        let changes = |these: &Known, those: &Known| {
            let added = these.findings.difference(&those.findings);
            let change = |(detector, tester): &(String, Option<String>)| FindingChange {
                level: level.to_owned(),
                detector: detector.clone(),
                tester: tester.clone(),
            };
            added.map(change).collect::<Vec<_>>()
        };
        match UnreachedSquares::between(level, known, now) {
            Ok(unreached) => self.unreached.extend(unreached),
            Err(why) => open.places.entry(why).or_default().push(level.to_owned()),
        }
        self.new_findings.extend(changes(now, known));
        self.gone_findings.extend(changes(known, now));
        let change = |before: Trials, now: Trials| Change {
            level: level.to_owned(),
            tester: None,
            before,
            now,
            probability: None,
            proof: None,
        };
        if known.is_unsolvable != now.is_unsolvable {
            let words = if now.is_unsolvable { "proved unsolvable" } else { "no longer proved unsolvable" };
            let change = Change { proof: Some(words.to_owned()), ..change(known.total, now.total) };
            if now.is_unsolvable {
                self.unsolvable.push(change)
            } else {
                self.easier.push(change)
            }
            return;
        }
        self.other_testers.extend(SolvedByOthers::between(level, known, now));
        let (mut pooled_before, mut pooled_now) = (Trials::default(), Trials::default());
        for (before, now) in known.testers.iter().zip(&now.testers) {
            let (was, is) = (before.score.trials(), now.score.trials());
            if !(before.exact && now.exact) {
                add(&mut pooled_before, was);
                add(&mut pooled_now, is);
                continue;
            }
            // All its episodes are equal.
            let (solved, solves) = (was.successes > 0, is.successes > 0);
            if solved != solves {
                let change = Change { tester: Some(before.tester.clone()), ..change(was, is) };
                if solves {
                    self.easier.push(change)
                } else {
                    self.harder.push(change)
                }
                return;
            }
        }
        if pooled_before.trials > 0 && pooled_now.trials > 0 {
            let probability = fisher_exact(pooled_before, pooled_now);
            let change = Change { probability: Some(probability), ..change(pooled_before, pooled_now) };
            open.doubtful.push(Doubtful { change, probability });
        }
    }

    /// Keeps the changes of those levels that differ by more than chance.
    fn judge(&mut self, doubtful: Vec<Doubtful>) {
        let probabilities: Vec<f64> = doubtful.iter().map(|level| level.probability).collect();
        let alarms = benjamini_hochberg(&probabilities, FALSE_DISCOVERY_RATE);
        for (Doubtful { change, .. }, _) in doubtful.into_iter().zip(alarms).filter(|(_, is_alarm)| *is_alarm) {
            let Change { before, now, .. } = &change;
            let times = |one: u64, other: u64| u128::from(one) * u128::from(other);
            let (was, is) = (times(before.successes, now.trials), times(now.successes, before.trials));
            match is.cmp(&was) {
                std::cmp::Ordering::Greater => self.easier.push(change),
                std::cmp::Ordering::Less => self.harder.push(change),
                // Equal shares have probability 1.
                std::cmp::Ordering::Equal => {}
            }
        }
    }
}

/// A level that has changed.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Change {
    /// The level.
    pub level: String,
    /// The tester that shows the change; `None` for several together.
    pub tester: Option<String>,
    /// Solved episodes before.
    pub before: Trials,
    /// Solved episodes now.
    pub now: Trials,
    /// Probability of such a difference by chance, by Fisher's exact test; `None` without randomness.
    pub probability: Option<f64>,
    /// Change of the level's proof, described.
    pub proof: Option<String>,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { level, before, now, .. } = self;
        let (was, is) = (before.successes, now.successes);
        write!(f, "{level}: solved {was} of {}, now {is} of {}", before.trials, now.trials)?;
        match (&self.proof, self.probability, &self.tester) {
            (Some(proof), ..) => write!(f, " ({proof})"),
            (None, Some(probability), _) => write!(f, " (p = {probability:.1e})"),
            (None, None, Some(tester)) => write!(f, " ({tester}, which draws no random numbers)"),
            (None, None, None) => Ok(()),
        }
    }
}

/// A level that was solved in one of two tests alone, by testers that take no part in the other: the testers differ, and
/// nothing is known of the level.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SolvedByOthers {
    /// The level.
    pub level: String,
    /// True if it was solved before, false if it is now.
    pub before: bool,
    /// The testers that solved it.
    pub by: Vec<String>,
}

impl SolvedByOthers {
    /// Compares a level; `None` if it was solved in both tests or in none, or by a tester of both.
    fn between(level: &str, before: &Known, now: &Known) -> Option<Self> {
        let was_solved = !before.solved_by.is_empty();
        if was_solved != now.solved_by.is_empty() {
            return None;
        }
        let solved = if was_solved { before } else { now };
        let by = solved.solved_by.clone();
        (solved.total.successes == 0).then(|| Self { level: level.to_owned(), before: was_solved, by })
    }
}

impl fmt::Display for SolvedByOthers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let when = if self.before { "before" } else { "now" };
        write!(f, "{}: solved {when} by {} alone, and the testers differ", self.level, self.by.join(", "))
    }
}

/// A finding that is new or gone.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct FindingChange {
    /// The level.
    pub level: String,
    /// Its detector.
    pub detector: String,
    /// The tester that played.
    pub tester: Option<String>,
}

impl fmt::Display for FindingChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.level, self.detector)?;
        self.tester.iter().try_for_each(|tester| write!(f, " ({tester})"))
    }
}

/// Squares of a level that is not solved now: testers visited them before, and none does now.
///
/// It needs maps or reached cells of both results, of the same squares and the same testers. On a level that was not
/// solved before either, the episodes must be those that an unchanged level repeats: with the same seed, or without
/// draws. A large part of the squares must be missing then, because the path of a random tester changes with everything.
/// It explains a change and is no alarm of its own.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnreachedSquares {
    /// The level.
    pub level: String,
    /// Number of these squares.
    pub squares: u64,
    /// Middle of the one that is closest to a square that is still visited.
    pub at: [f32; 2],
    /// Middle of that square.
    pub nearest: [f32; 2],
}

/// Part of the squares that must be missing on a level that is unsolved in both results: one of so many.
const LARGE_PART: usize = 4;

impl UnreachedSquares {
    /// Compares the squares of a level. `None` if it is solved now, if no square is missing, or if the game has no
    /// positions.
    ///
    /// # Errors
    ///
    /// The reason why the squares are not comparable.
    fn between(level: &str, before: &Known, now: &Known) -> Result<Option<Self>, PlacesLeftOut> {
        // Also by a tester of this test alone.
        if !now.solved_by.is_empty() || !(before.has_places || now.has_places) {
            return Ok(None);
        }
        if !(before.is_theirs && now.is_theirs) {
            return Err(PlacesLeftOut::Testers);
        }
        let was = before.visited.as_ref().ok_or(PlacesLeftOut::NoneBefore)?;
        let is = now.visited.as_ref().ok_or(PlacesLeftOut::NoneNow)?;
        let (was, is) = was.alike(is).ok_or(PlacesLeftOut::Squares)?;
        let was_solved = before.total.successes > 0;
        if !was_solved && !before.repeats(now) {
            return Err(PlacesLeftOut::Draws);
        }
        let lost: Vec<Square> = was.squares.difference(&is.squares).copied().collect();
        let is_chance = !was_solved && lost.len() * LARGE_PART < was.squares.len();
        Ok(if is_chance { None } else { Self::closest(level, &lost, &was, &is) })
    }

    /// Names the lost square that is closest to one that is still visited.
    fn closest(level: &str, lost: &[Square], was: &VisitedSquares, is: &VisitedSquares) -> Option<Self> {
        let mut closest: Option<(f32, [Square; 2])> = None;
        for square in lost {
            for reached in &is.squares {
                let distance = was.middle(*square).distance_squared(was.middle(*reached));
                // Of equal ones the first.
                if closest.is_none_or(|(least, _)| distance < least) {
                    closest = Some((distance, [*square, *reached]));
                }
            }
        }
        let (_, pair) = closest?;
        let [at, nearest] = pair.map(|square| was.middle(square).to_array());
        Some(Self { level: level.to_owned(), squares: lost.len() as u64, at, nearest })
    }
}

impl fmt::Display for UnreachedSquares {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { level, squares, at: [x, y], nearest: [left, below] } = self;
        let squares = counted(*squares, "square");
        write!(f, "{level}: {squares} visited before, such as ({x:.1}, {y:.1}); now no tester comes further than ")?;
        write!(f, "({left:.1}, {below:.1}) there")
    }
}

/// The reason why the squares of a level that is not solved now are not compared.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum PlacesLeftOut {
    /// Other testers played.
    Testers,
    /// The level was not solved before either, and random testers play other episodes.
    Draws,
    /// The earlier results have no squares of it.
    NoneBefore,
    /// These results have no squares of it.
    NoneNow,
    /// The squares are others.
    Squares,
}

impl PlacesLeftOut {
    /// Describes the reason, with the levels that it applies to.
    fn words(self, levels: &[String], before: &TestRecord, now: &TestRecord) -> String {
        let why = match self {
            Self::Testers => {
                let [was, is] = [before, now]
                    .map(|record| record.testers.iter().map(TesterRecord::describe).collect::<Vec<_>>().join(", "));
                format!("the testers differ ({is}; before: {was})")
            }
            Self::Draws => {
                let seeds = ("random seeds", before.seed, now.seed);
                let episodes = ("numbers of episodes", u64::from(before.episodes), u64::from(now.episodes));
                let differ = |(what, was, is): (&str, u64, u64)| {
                    (was != is).then(|| format!("the {what} differ ({is}; before: {was})"))
                };
                let differ: Vec<String> = [seeds, episodes].into_iter().filter_map(differ).collect();
                format!(
                    "{}, so random testers went elsewhere on a level that no tester has solved",
                    differ.join(" and ")
                )
            }
            Self::NoneBefore => format!("the earlier results have no visited squares{}", few_maps(before)),
            Self::NoneNow => format!("these results have no visited squares{}", few_maps(now)),
            Self::Squares => {
                "the squares are others: the floor plan has changed, or the entity whose position counts".to_owned()
            }
        };
        let first = levels.first().map_or_else(String::new, |level| format!(", such as {level}"));
        format!("{why}: {}{first}", counted(levels.len() as u64, "unsolved level"))
    }
}

/// Explains levels without maps in a test of many levels.
fn few_maps(record: &TestRecord) -> &'static str {
    match record.maps {
        MapScope::Failed => " (of so many levels, only failed ones have maps: test fewer)",
        MapScope::None | MapScope::All => "",
    }
}

/// Row and column of a square, whose order is that of maps.
type Square = [i32; 2];

/// Squares that testers visited.
#[derive(Clone, Debug)]
struct VisitedSquares {
    corner: Vec2,
    side: f32,
    /// Where they come from: squares of different origins are not comparable.
    origin: SquareOrigin,
    squares: BTreeSet<Square>,
}

/// Origin of visited squares.
#[derive(Clone, Debug, PartialEq)]
enum SquareOrigin {
    /// Maps with so many columns.
    Maps(u64),
    /// Positions, of this entity if the game does not declare them.
    Cells(Option<String>),
}

impl VisitedSquares {
    fn of(level: &LevelVerdict) -> Option<Self> {
        level.maps.as_ref().map(Self::of_maps).or_else(|| level.reached.as_ref().map(Self::of_cells))
    }

    fn of_maps(maps: &LevelMaps) -> Self {
        let columns = maps.columns.max(1);
        let place = |square: &[u64; 2]| [square[0] / columns, square[0] % columns].map(|number| number as i32);
        let squares = maps.visits.iter().map(place).collect();
        Self { corner: Vec2::new(maps.x, maps.y), side: maps.side, origin: SquareOrigin::Maps(columns), squares }
    }

    fn of_cells(cells: &ReachedCells) -> Self {
        let origin = SquareOrigin::Cells(cells.entity.clone());
        let squares = cells.cells.iter().map(|[column, row]| [*row, *column]).collect();
        Self { corner: Vec2::ZERO, side: cells.side, origin, squares }
    }

    /// Returns both in squares of one size; `None` if that is impossible.
    fn alike(&self, other: &Self) -> Option<(Self, Self)> {
        let side = match self.origin {
            _ if self.corner != other.corner || self.origin != other.origin => return None,
            SquareOrigin::Maps(_) if self.side != other.side => return None,
            SquareOrigin::Maps(_) => return Some((self.clone(), other.clone())),
            SquareOrigin::Cells(_) => self.side.max(other.side),
        };
        let enlarged = |it: &Self| {
            let cells = ReachedCells { side: it.side, cells: it.squares.clone(), entity: None }.of_side(side);
            Self { side: cells.side, squares: cells.cells, ..it.clone() }
        };
        let (one, another) = (enlarged(self), enlarged(other));
        (one.side == another.side).then_some((one, another))
    }

    /// Returns the middle of a square.
    fn middle(&self, [row, column]: Square) -> Vec2 {
        self.corner + (Vec2::new(column as f32, row as f32) + 0.5) * self.side
    }
}

/// Results of an earlier level that are kept in memory.
struct Known {
    /// Whether these testers alone played the level.
    is_theirs: bool,
    /// Whether the results have squares or cells of the level.
    has_places: bool,
    /// Squares that the testers visited, if the level was played by these testers alone.
    visited: Option<VisitedSquares>,
    /// Random seed of the test, and episodes of each tester.
    draws: (u64, u32),
    /// The testers of both tests.
    testers: Vec<TesterVerdict>,
    /// Their episodes.
    total: Trials,
    /// The testers that solved it, also those of one test alone.
    solved_by: Vec<String>,
    is_unsolvable: bool,
    findings: BTreeSet<(String, Option<String>)>,
}

impl Known {
    /// Keeps the results of the testers with these names, and of all detectors except these.
    fn of(level: LevelVerdict, testers: &[String], other_detectors: &[String], draws: (u64, u32)) -> Self {
        let is_unsolvable = level.proof.why_unsolvable().is_some();
        let is_common = |name: &Option<String>| name.as_ref().is_none_or(|name| testers.contains(name));
        let is_theirs = level.testers.len() == testers.len();
        let has_places = level.maps.is_some() || level.reached.is_some();
        let visited = if is_theirs { VisitedSquares::of(&level) } else { None };
        let findings = level
            .findings
            .into_iter()
            .filter(|finding| is_common(&finding.tester) && !other_detectors.contains(&finding.detector));
        let findings = findings.map(|finding| (finding.detector, finding.tester)).collect();
        let mut verdicts = level.testers;
        let solvers = verdicts.iter().filter(|verdict| verdict.score.solved > 0);
        let solved_by = solvers.map(|verdict| verdict.tester.clone()).collect();
        let own: Vec<TesterVerdict> = testers
            .iter()
            .filter_map(|name| {
                let place = verdicts.iter().position(|verdict| verdict.tester == *name)?;
                Some(verdicts.swap_remove(place))
            })
            .collect();
        let mut total = Trials::default();
        own.iter().for_each(|tester| add(&mut total, tester.score.trials()));
        Self { is_theirs, has_places, visited, draws, testers: own, total, solved_by, is_unsolvable, findings }
    }

    /// Returns whether the other episodes are these once more if the level is the same.
    fn repeats(&self, other: &Self) -> bool {
        self.draws == other.draws || self.testers.iter().chain(&other.testers).all(|tester| tester.exact)
    }
}

// Comparison with the recordings of an earlier build.

/// Episodes of a recording that were won on the levels of a test: the first one of each level.
pub struct RecordedWins {
    mode: String,
    /// By the level's index in the range.
    episodes: BTreeMap<u64, DemoEpisode>,
}

impl RecordedWins {
    /// Reads the episodes on the levels of a test, or on those of its shard.
    ///
    /// # Errors
    ///
    /// The recording cannot be read, or has no such episode on the whole range.
    pub fn read(game: &dyn Game, plan: &TestPlan, recording: &Path) -> Result<Self, TestError> {
        let range = &plan.split;
        let mut episodes = BTreeMap::new();
        // The numbers of level files change with the files that a pattern matches.
        let designs = is_level_files(&range.mode).then(|| level_designs(game, &range.mode).ok()).flatten();
        let files = designs.map(|designs| designs.files());
        for episode in DemoReader::open_for_game(recording, game.name(), game.version(), Some(&range.mode))? {
            let episode = episode?;
            let level = match (&episode.level_file, &files) {
                (Some(file), Some(files)) => files.number_of(file),
                _ => Some(episode.level_seed),
            };
            if let Some(level) = level.filter(|&level| episode.is_success() && range.contains(&range.mode, level)) {
                episodes.entry(level - range.first).or_insert(episode);
            }
        }
        if episodes.is_empty() {
            return Err(TestError::NothingRecorded { path: recording.into(), range: range.to_string() });
        }
        if plan.shard.is_some() {
            let places: BTreeSet<u64> = plan.places().into_iter().collect();
            episodes.retain(|index, _| places.contains(index));
        }
        Ok(Self { mode: range.mode.clone(), episodes })
    }

    /// Returns the number of levels.
    pub fn len(&self) -> usize {
        self.episodes.len()
    }

    /// Returns whether no level of the shard has been won.
    pub fn is_empty(&self) -> bool {
        self.episodes.is_empty()
    }

    /// Plays the recorded actions in the present game, and returns their courses by the index of the level in the range.
    /// `progress` receives each one that is done. Returns `None` if `stop` returned true. Threads change no result.
    pub fn courses(
        self,
        game: &dyn Game,
        threads: usize,
        progress: &(dyn Fn(u64) + Sync),
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Option<BTreeMap<u64, RecordedCourse>> {
        let Self { mode, episodes } = self;
        let mut episodes: Vec<(u64, DemoEpisode)> = episodes.into_iter().collect();
        let played = on_threads(&mut episodes, threads, |(index, episode)| {
            if stop() {
                return None;
            }
            let course = course_of_recording(game, &mode, episode);
            progress(1);
            Some((*index, course))
        });
        played.into_iter().collect()
    }
}

/// What is open until all levels are compared.
#[derive(Default)]
struct Open {
    doubtful: Vec<Doubtful>,
    /// Levels whose squares are not compared, by the reason.
    places: BTreeMap<PlacesLeftOut, Vec<String>>,
}

/// A level whose difference may be chance.
struct Doubtful {
    change: Change,
    probability: f64,
}

fn add(sum: &mut Trials, more: Trials) {
    sum.successes = sum.successes.saturating_add(more.successes);
    sum.trials = sum.trials.saturating_add(more.trials);
}

/// Earlier results, and the names in common with others.
struct Comparable {
    earlier: ResultLines,
    common: Vec<String>,
    /// Detectors that looked only before or only now, or with other settings.
    other_detectors: Vec<String>,
    left_out: Vec<String>,
}

fn comparable(before: &Path, record: &TestRecord) -> Result<Comparable, TestError> {
    let earlier = ResultLines::open_whole(before)?;
    let mut differences = earlier.record().differences_of_game(record);
    if differences.is_empty() && !may_have_common_levels(earlier.record(), record) {
        differences.push(no_common_level(earlier.record(), record));
    }
    let (common, mut left_out) = common_testers(earlier.record(), record);
    let other_detectors = other_detectors(earlier.record(), record);
    left_out.extend(other_detectors.iter().map(|name| format!("the detector `{name}` is not the same in both tests")));
    let differences = match (differences.is_empty(), common.is_empty()) {
        (true, false) => return Ok(Comparable { earlier, common, other_detectors, left_out }),
        (true, true) => left_out,
        (false, _) => differences,
    };
    Err(TestError::Incomparable { folder: before.into(), differences })
}

/// Returns whether they may have common levels, judged by their ranges: the files of other patterns are known from
/// results only.
fn may_have_common_levels(before: &TestRecord, now: &TestRecord) -> bool {
    if is_level_files(&before.range.mode) && is_level_files(&now.range.mode) {
        return true;
    }
    let shard = now.shard.unwrap_or(Shard { index: 0, count: 1 });
    let mut levels = shard.places(now.range.len()).map(|place| now.range.first + place);
    before.range.mode == now.range.mode && levels.any(|level| has(before, level))
}

/// Returns whether a level of the mode is tested.
fn has(record: &TestRecord, level: u64) -> bool {
    let is_mine = |shard: Shard| (level - record.range.first) % shard.count == shard.index;
    (record.range.first..=record.range.last).contains(&level) && record.shard.is_none_or(is_mine)
}

/// Describes the lack of a common level.
fn no_common_level(before: &TestRecord, now: &TestRecord) -> String {
    let levels = |record: &TestRecord| match record.shard {
        Some(shard) => format!("shard {shard} of {}", record.range),
        None => record.range.to_string(),
    };
    format!("no level is in {} and in {}", levels(before), levels(now))
}

/// Returns the names of the detectors that differ between both.
fn other_detectors(before: &TestRecord, now: &TestRecord) -> Vec<String> {
    let only = |these: &TestRecord, those: &TestRecord| {
        let alone = these.detectors.iter().filter(|detector| !those.detectors.contains(*detector));
        alone.filter_map(|detector| detector.split(' ').next().map(str::to_owned)).collect::<BTreeSet<_>>()
    };
    only(before, now).union(&only(now, before)).cloned().collect()
}

/// Returns the names of the testers that are equal in both, and the reasons for leaving others out.
fn common_testers(before: &TestRecord, now: &TestRecord) -> (Vec<String>, Vec<String>) {
    let (mut common, mut left_out) = (Vec::new(), Vec::new());
    for tester in &now.testers {
        match before.testers.iter().find(|known| known.name == tester.name) {
            Some(known) if known == tester => common.push(tester.name.clone()),
            Some(known) => left_out.push(format!("another tester `{}` and `{}`", known.describe(), tester.describe())),
            None => left_out.push(format!("the tester `{}` was not there before", tester.name)),
        }
    }
    let gone = before.testers.iter().filter(|known| now.testers.iter().all(|tester| tester.name != known.name));
    left_out.extend(gone.map(|known| format!("the tester `{}` is not there now", known.name)));
    (common, left_out)
}
