//! Verdicts of bots and policies on each level of a range.
//!
//! - A [`TestPlan`] names levels, [`Tester`]s, episodes and a seed. [`run_tests`] plays them on all cores, and makes
//!   a [`LevelVerdict`] of each level: solved, bot failed, or proved unsolvable.
//! - [`LevelMaps`] show where agents went in a level: visits, lost time, skills, and the path of a failure. A
//!   [`MapScope`] names the levels with maps.
//! - A [`TestFolder`] keeps verdicts as they come in, so a killed test can be resumed. [`TestFolder::finish`] writes
//!   `results.json`, which is the same on any number of threads, and reports for people and other programs.
//! - [`merge()`] joins the results of shards to those of the whole range, byte for byte.
//! - [`Comparison`] reports changes since earlier results, apart from noise.
//!
//! The files of the folder, in reading order:
//!
//! - `plan`, `run`: the plan of a test, and the test.
//! - `test_world`, `played`, `walk`: the World in which testers play, the result of an episode with the progress of its
//!   agent, and the walk of that agent.
//! - `walked`, [`maps`]: the walks of a level, as maps.
//! - `folder`, `results`, [`mod@merge`], `shard`: the folder of a test and its `results.json`, and parts of a test.
//! - `compare`, `statistics`: the comparison with earlier results.
//! - `pinned`: findings that do not count for a while.
//! - `reports`, `error`: reports, and errors.

mod compare;
mod error;
mod folder;
pub mod maps;
pub mod merge;
mod pinned;
mod plan;
mod played;
mod reports;
mod results;
mod run;
mod shard;
mod statistics;
mod test_world;
#[cfg(test)]
mod testing;
mod walk;
mod walked;

use crate::{
    findings::RecordedCourse,
    verdict::{
        played::{Played, PlayedEnd, common_stop, reached},
        run::{inspect, seen},
        walked::LevelVisits,
    },
};
use bevy::math::{Rect, Vec2};
use bevy_playbot::{episode::EpisodeEnd, skill_prior::NamedSkill};
use playbot_harness::{
    detector::LevelProof,
    game::{Game, prove_level},
};
use playbot_report::counted;
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fmt,
    fmt::{Display, Formatter},
    time::Duration,
};

pub use crate::verdict::{
    compare::{
        Change, Comparison, EarlierTest, FALSE_DISCOVERY_RATE, FindingChange, RecordedWins, SolvedByOthers,
        UnreachedSquares,
    },
    error::TestError,
    folder::{Earlier, TestFolder},
    maps::{
        EpisodePath, LevelMaps, LevelPars, MapScope, PlanRows, SkillTicks, TesterEvents, hash_of_files, level_name,
    },
    merge::merge,
    pinned::PinnedFindings,
    plan::{TestPlan, TestRecord, TestedRun, Tester, TesterRecord},
    played::{CommonStop, ReachedCells, StopKind},
    reports::{
        AGAINST, JUNIT, SUMMARY, action_search, comparable_command,
        issues::{IssueForm, issues},
        missing_failure, report_date, rerun_commands, write_reports,
    },
    results::{FinishTime, MOST_WORST, Overview, RESULTS, RecordedTotal, ResultLines, TesterTotal, results_folder},
    run::{TestEnd, TestObserver, run_tests, run_tests_keeping, test_in_turn},
    shard::{Shard, ShardError},
    statistics::{Trials, benjamini_hochberg, fisher_exact, wilson},
};

/// Squares along the longer side of a floor plan to which [`SquareEnds`]s are rounded.
pub const END_SQUARES: f32 = 32.0;

/// All results of one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelVerdict {
    /// Its mode and number, such as `hard:7`, or the path of its file.
    pub level: String,
    /// Its name in a level editor, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Its index in the range, from 0.
    pub index: u64,
    /// Its outcome.
    pub outcome: LevelOutcome,
    /// Proof about the level. A level that was solved is solvable.
    pub proof: LevelProof,
    /// All episodes of all testers.
    #[serde(flatten)]
    pub score: EpisodeScore,
    /// Game time of all episodes of all testers: ticks by ticks per second. Older results lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seconds: Option<f64>,
    /// Positions of episodes that ended without the goal, if the game reports them.
    pub ends: Vec<SquareEnds>,
    /// How often each cause ended an episode without the goal, if the game reports causes.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub causes: BTreeMap<String, u64>,
    /// The position at which the episodes stopped, of a level that no tester solved.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<CommonStop>,
    /// True if every episode reached the goal in its first tick.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub solved_at_start: bool,
    /// Open squares that all testers together visited, for levels with maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub places: Option<Places>,
    /// Maps of where agents went, for levels with maps: see [`MapScope`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maps: Option<LevelMaps>,
    /// Cells that agents reached, for a level that could have maps and has none: without a floor plan, or without
    /// declared positions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reached: Option<ReachedCells>,
    /// Each tester, in the order of the plan.
    pub testers: Vec<TesterVerdict>,
    /// Findings.
    pub findings: Vec<Finding>,
    /// The reason why no failed episode is in a file, for a level that no tester solved, in a test that
    /// [keeps them](crate::findings::FindingFiles::keep_failures): tester, episode, and what happened when it was
    /// played again.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub not_kept: Option<String>,
    /// Detectors that could find nothing, because the episodes were too short. Older results lack them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub too_short: Vec<TooShort>,
    /// Course of the actions that a recording of an earlier build solves it with, in a test against a recording that
    /// does. It is the last field: [`TestFolder::finish_against`] adds it to a line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub recorded: Option<RecordedCourse>,
}

impl LevelVerdict {
    /// Returns the level as reports name it: `hard:7`, with its name behind that if it has one.
    pub fn title(&self) -> String {
        self.name.as_ref().map_or_else(|| self.level.clone(), |name| format!("{} {name}", self.level))
    }

    /// Returns the time in the game. Results of older versions have none, and a file may hold any number.
    pub(crate) fn time(&self) -> Option<Duration> {
        self.seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
    }

    /// Returns whether it was solved, has no finding, and ends as recorded if it was recorded.
    pub fn is_sound(&self) -> bool {
        self.outcome == LevelOutcome::Solved && self.findings.is_empty() && !self.is_regression()
    }

    /// Returns whether the actions of a recording no longer end as they were recorded to.
    pub fn is_regression(&self) -> bool {
        self.recorded.as_ref().is_some_and(|course| !course.ends_as_recorded())
    }

    /// Describes what the actions of a recording do otherwise, or better than all testers. `None` if there is nothing to
    /// say.
    pub fn recorded_news(&self) -> Option<String> {
        let course = self.recorded.as_ref()?;
        match (course.differs, self.outcome) {
            (None, LevelOutcome::Solved) => None,
            (None, LevelOutcome::BotFailed) => Some(format!("{course}, so the testers are too weak")),
            (None, LevelOutcome::ProvedUnsolvable) => Some(format!("{course}, so the proof is wrong")),
            (Some(_), _) => Some(course.to_string()),
        }
    }

    /// Returns whether it is [sound](Self::is_sound) and was solved in every episode.
    pub fn is_perfect(&self) -> bool {
        self.is_sound() && self.score.solved == self.score.episodes
    }
}

/// Outcome of a level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LevelOutcome {
    /// The goal cannot be reached, which is proved.
    ProvedUnsolvable,
    /// No tester reached the goal, which proves nothing.
    BotFailed,
    /// A tester reached the goal at least once.
    Solved,
}

impl LevelOutcome {
    /// Returns the name in files and in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::ProvedUnsolvable => "proved-unsolvable",
            Self::BotFailed => "bot-failed",
            Self::Solved => "solved",
        }
    }
}

/// Results of a tester on a level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TesterVerdict {
    /// Name of the tester.
    pub tester: String,
    /// Its episodes.
    #[serde(flatten)]
    pub score: EpisodeScore,
    /// True if it drew no random number in any of them: it repeats itself under any seed.
    pub exact: bool,
    /// Open squares that it visited in all its episodes, for levels with maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub places: Option<Places>,
    /// Events in its episodes, for levels with maps. Older results lack them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub events: Option<TesterEvents>,
}

/// Ends of episodes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EpisodeScore {
    /// Episodes that reached the goal.
    pub solved: u64,
    /// All episodes.
    pub episodes: u64,
    /// 95 % Wilson interval of the share of solved episodes.
    pub interval: [f64; 2],
    /// Ticks of the solved episodes, if there are any.
    pub ticks: Option<FinishTime>,
    /// Episodes that the game ended without the goal.
    pub lost: u64,
    /// Episodes that ended because time was up.
    pub timed_out: u64,
    /// Episodes in which the game broke, each of which is a finding.
    pub broken: u64,
}

impl EpisodeScore {
    /// Returns the solved episodes among all.
    pub fn trials(&self) -> Trials {
        Trials { successes: self.solved, trials: self.episodes }
    }
}

/// Ends of episodes without the goal in one square of the level's floor plan.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SquareEnds {
    /// Middle of the square, in the units of the floor plan.
    pub x: f32,
    /// Middle of the square.
    pub y: f32,
    /// Episodes that were lost there.
    pub lost: u64,
    /// Episodes whose time was up there.
    pub timed_out: u64,
    /// How often each cause ended an episode there, if the game reports it.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub causes: BTreeMap<String, u64>,
}

/// A defect of a level, or of the game in it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// Its detector: `panic`, `fault`, `endless`, `unreachable-goal`, or the name of a [detector](crate::detectors).
    pub detector: String,
    /// The tester that played; `None` if it was found without play.
    pub tester: Option<String>,
    /// Episode of that tester on the level, from 0.
    pub episode: Option<u32>,
    /// Tick of the episode, from 0.
    pub tick: Option<u32>,
    /// The message.
    pub message: String,
    /// Its file, relative to the folder of the results: see [`findings`](crate::findings).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Settings, as `name.key=value`, for the search of its file beside those of the test: see
    /// [`LevelDefect::settings`](crate::detectors::LevelDefect::settings). Results have none.
    #[serde(skip)]
    pub settings: Vec<String>,
}

/// A detector that could find nothing on a level, because no episode was long enough for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TooShort {
    /// The detector.
    pub detector: String,
    /// Ticks that an episode must have at least.
    pub needs: u32,
    /// Ticks of the longest episode that it looks at.
    pub had: u32,
    /// Setting, as `name.key=value`, with which it can find something in such an episode, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub setting: Option<String>,
}

impl Display for TooShort {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self { detector, needs, had, setting } = self;
        write!(f, "{detector} (needs episodes of {}, and had at most {had}", counted(u64::from(*needs), "tick"))?;
        setting.iter().try_for_each(|setting| write!(f, ": `--detector {setting}`"))?;
        f.write_str(")")
    }
}

/// Visited squares, among all that walls do not cut off from the start: see
/// [`open_cells`](crate::explore::round). Under gravity, some of these may be unreachable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Places {
    /// Open squares that were visited, or passed between two ticks.
    pub visited: u64,
    /// All open squares.
    pub open: u64,
}

impl Places {
    /// Returns the visited share in percent; `None` without open squares.
    pub fn percent(self) -> Option<f64> {
        (self.open > 0).then(|| 100.0 * self.visited as f64 / self.open as f64)
    }

    /// Formats the share.
    pub fn describe(self) -> String {
        self.percent().map_or_else(|| "–".to_owned(), |percent| format!("{percent:.1} %"))
    }

    /// Adds the squares of another level.
    fn add(&mut self, other: Option<Self>) {
        let other = other.unwrap_or_default();
        self.visited = self.visited.saturating_add(other.visited);
        self.open = self.open.saturating_add(other.open);
    }
}

/// Returns the verdict on the level with this index in the range and this name in results. `played` has the episodes
/// of each tester, in the order of the plan. Incomplete if `stop` returned true.
fn judge(
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
        events: None,
    });
    let all = || played.iter().flat_map(|episodes| episodes.iter());
    let score = score(all());
    // Reaching the goal proves that it can be reached.
    let proof = if score.solved > 0 { LevelProof::Solvable } else { prove_level(game, mode, level) };
    let mut findings = broken(plan, played);
    findings.extend(seen(plan, played));
    let (inspected, too_short) = inspect(game, plan, (index, &name), played, stop);
    findings.extend(inspected);
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
    let stops = (outcome == LevelOutcome::BotFailed).then(|| common_stop(all().map(|episode| &episode.track)));
    let mut verdict = LevelVerdict {
        level: name,
        name: game.tools().levels.level_name(mode, level),
        index,
        outcome,
        proof,
        score,
        seconds: seconds(all(), game.tick_hz()),
        ends: Vec::new(),
        causes: causes(&failed),
        stop: stops.flatten(),
        solved_at_start: is_solved_at_start(all()),
        places: None,
        maps: None,
        reached: None,
        testers: testers.collect(),
        findings,
        not_kept: None,
        too_short,
        recorded: None,
    };
    let has_maps = plan.maps().wants(verdict.is_perfect());
    let has_positions = failed.iter().any(|end| end.position.is_some());
    let floor = (has_maps || has_positions).then(|| game.tools().levels.floor_plan(mode, level)).flatten();
    if let Some(floor) = floor {
        verdict.ends = end_places(floor.bounds, &failed);
        let names: Vec<&str> = plan.testers.iter().map(|tester| tester.record.name.as_str()).collect();
        let regions: Vec<&[NamedSkill]> = plan.testers.iter().map(|tester| tester.record.regions()).collect();
        let walked = has_maps.then(|| LevelVisits::of(&floor, &names, &regions, played, &verdict.findings)).flatten();
        if let Some(walked) = walked {
            verdict.places = walked.places;
            verdict.maps = Some(walked.maps);
            for (tester, (places, events)) in
                verdict.testers.iter_mut().zip(walked.testers.into_iter().zip(walked.events))
            {
                (tester.places, tester.events) = (places, Some(events));
            }
        }
    }
    if has_maps && verdict.maps.is_none() {
        verdict.reached = reached(all().map(|episode| &episode.track));
    }
    verdict
}

fn score<'a>(episodes: impl Iterator<Item = &'a Played>) -> EpisodeScore {
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
    EpisodeScore { solved, episodes: count, interval, ticks: FinishTime::of(ticks), lost, timed_out, broken }
}

/// Returns whether every episode that did not break the game reached the goal in its first tick.
fn is_solved_at_start<'a>(episodes: impl Iterator<Item = &'a Played>) -> bool {
    let mut ended = episodes.filter(|episode| matches!(episode.end, PlayedEnd::Ended { .. })).peekable();
    ended.peek().is_some() && ended.all(|episode| episode.track.is_solved_at_start)
}

/// Returns the game time of episodes in seconds; `None` if the game has no ticks per second.
fn seconds<'a>(episodes: impl Iterator<Item = &'a Played>, tick_hz: f64) -> Option<f64> {
    let seconds = episodes.map(|episode| u64::from(episode.end.ticks())).sum::<u64>() as f64 / tick_hz;
    seconds.is_finite().then_some(seconds)
}

/// Returns the end of an episode without the goal.
fn failed_end(episode: &Played) -> Option<FailedEnd> {
    match &episode.end {
        PlayedEnd::Ended { result, position, cause } if !result.success => {
            let is_timed_out = result.end == EpisodeEnd::Truncated;
            Some(FailedEnd { position: *position, is_timed_out, cause: *cause })
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

/// The end of an episode without the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FailedEnd {
    /// Position, if the game reports it.
    pub position: Option<Vec2>,
    /// True if time was up.
    pub is_timed_out: bool,
    /// Cause, if the game reports it.
    pub cause: Option<&'static str>,
}

/// Returns the squares of a floor plan in which episodes ended, row by row from below. Positions outside the plan
/// belong to squares outside; positions that are not finite are left out.
fn end_places(bounds: Rect, ended: &[FailedEnd]) -> Vec<SquareEnds> {
    let side = bounds.width().max(bounds.height()) / END_SQUARES;
    if !(side.is_finite() && side > 0.0) {
        return Vec::new();
    }
    let mut counts: BTreeMap<(i32, i32), SquareEnds> = BTreeMap::new();
    for end in ended {
        let Some(position) = end.position.filter(|position| position.is_finite()) else { continue };
        let square = ((position - bounds.min) / side).floor();
        let (column, row) = (square.x as i32, square.y as i32);
        let counted = counts.entry((row, column)).or_insert_with(|| SquareEnds {
            x: bounds.min.x + (column as f32 + 0.5) * side,
            y: bounds.min.y + (row as f32 + 0.5) * side,
            ..SquareEnds::default()
        });
        *(if end.is_timed_out { &mut counted.timed_out } else { &mut counted.lost }) += 1;
        add_cause(&mut counted.causes, end.cause);
    }
    counts.into_values().collect()
}

/// Returns how often each cause ended an episode, anywhere.
fn causes(ended: &[FailedEnd]) -> BTreeMap<String, u64> {
    let mut causes = BTreeMap::new();
    ended.iter().for_each(|end| add_cause(&mut causes, end.cause));
    causes
}

fn add_cause(causes: &mut BTreeMap<String, u64>, cause: Option<&'static str>) {
    if let Some(cause) = cause {
        *causes.entry(cause.to_owned()).or_default() += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        findings::CourseEnd,
        verdict::{maps::LevelMaps, played::Track, testing::verdict},
    };
    use bevy_playbot::episode::EpisodeResult;

    #[test]
    fn older_results_are_read_and_newer_ones_read_back() {
        let old = serde_json::to_string(&verdict(3, 1, 2)).expect("serialises");
        let newer = [
            "maps",
            "places",
            "causes",
            "seconds",
            "stop",
            "solved_at_start",
            "reached",
            "not_kept",
            "too_short",
            "recorded",
            "events",
        ];
        for name in newer {
            assert!(!old.contains(name), "{old}");
        }
        assert_eq!(serde_json::from_str::<LevelVerdict>(&old).expect("whole"), verdict(3, 1, 2));
        let places = Some(Places { visited: 3, open: 9 });
        let maps = Some(LevelMaps { x: -0.1, side: 0.3, visits: vec![[4, 70]], ..LevelMaps::default() });
        let causes = [("saw".to_owned(), 1)].into();
        let stop = CommonStop { kind: StopKind::End, x: 0.1, y: 0.7, within: 0.3, episodes: 2, of: 3, entity: None };
        let new = LevelVerdict { places, maps, causes, stop: Some(stop), solved_at_start: true, ..verdict(3, 1, 2) };
        let reached = ReachedCells { side: 0.25, cells: [[-3, 0], [7, 4]].into(), entity: Some("the one".to_owned()) };
        let recorded = RecordedCourse {
            recorded_ticks: 120,
            ticks: 46,
            end: CourseEnd::TimedOut,
            differs: Some(45),
            action: Some("jump".to_owned()),
            position: Some([0.1, -0.7]),
            furthest: None,
        };
        let recorded = Some(recorded);
        let not_kept = Some("`a`, episode 0: it does not fail".to_owned());
        let setting = Some("stuck.ticks=60".to_owned());
        let too_short = vec![TooShort { detector: "stuck".to_owned(), needs: 301, had: 120, setting }];
        let seconds = Some(0.1 + 0.2);
        let mut new = LevelVerdict { seconds, reached: Some(reached), not_kept, too_short, recorded, ..new };
        let events = TesterEvents { ends: vec![[3, 1, 0]], lost: vec![[3, 9]], visited: vec![[2, 2]] };
        new.testers[0].events = Some(events);
        let text = serde_json::to_string(&new).expect("serialises");
        assert_eq!(serde_json::from_str::<LevelVerdict>(&text).expect("whole"), new);
    }

    #[test]
    fn ends_are_counted_by_square_kind_and_cause() {
        let bounds = Rect::new(-1.0, 0.0, 63.0, 10.0);
        let at =
            |x: f32, y: f32, is_timed_out, cause| FailedEnd { position: Some(Vec2::new(x, y)), is_timed_out, cause };
        let nowhere = FailedEnd { position: None, is_timed_out: false, cause: Some("saw") };
        let ended = [
            at(-0.5, 3.0, false, Some("saw")),
            at(0.9, 2.5, true, None),
            at(5.0, 0.0, false, Some("lava")),
            at(f32::NAN, 0.0, false, None),
            nowhere,
        ];
        let place = |x, y, lost, timed_out, cause: &str| SquareEnds {
            x,
            y,
            lost,
            timed_out,
            causes: BTreeMap::from([(cause.to_owned(), 1)]),
        };
        assert_eq!(end_places(bounds, &ended), [place(6.0, 1.0, 1, 0, "lava"), place(0.0, 3.0, 1, 1, "saw")]);
        assert!(end_places(Rect::new(0.0, 0.0, 0.0, 0.0), &ended).is_empty());
        assert_eq!(causes(&ended), BTreeMap::from([("lava".to_owned(), 1), ("saw".to_owned(), 2)]));
    }

    #[test]
    fn the_time_of_a_level_is_that_of_all_its_ticks() {
        let end = EpisodeEnd::WON;
        let result = EpisodeResult { level: 0, end, success: true, ticks: 40, clipped: 0, total_reward: 0.0 };
        let ends = [
            PlayedEnd::Ended { result, position: None, cause: None },
            PlayedEnd::Broken { detector: "panic", tick: Some(5), message: String::new() },
            PlayedEnd::Broken { detector: "panic", tick: None, message: String::new() },
        ];
        let played =
            ends.map(|end| Played { end, exact: true, found: Vec::new(), walk: None, track: Track::default() });
        assert_eq!(seconds(played.iter(), 15.0), Some(3.0));
        assert_eq!(seconds(played.iter(), 0.0), None, "it has no ticks per second");
    }

    #[test]
    fn a_level_is_solved_at_its_start_if_every_sound_episode_is() {
        let end = EpisodeEnd::WON;
        let result = EpisodeResult { level: 0, end, success: true, ticks: 1, clipped: 0, total_reward: 0.0 };
        let episode = |is_solved_at_start: bool| Played {
            end: PlayedEnd::Ended { result, position: None, cause: None },
            exact: true,
            found: Vec::new(),
            walk: None,
            track: Track { is_solved_at_start, ..Track::default() },
        };
        let end = PlayedEnd::Broken { detector: "panic", tick: Some(5), message: String::new() };
        let broken = Played { end, ..episode(false) };
        assert!(is_solved_at_start([episode(true), broken.clone(), episode(true)].iter()));
        assert!(!is_solved_at_start([episode(true), episode(false)].iter()), "some actions do not solve it");
        assert!(!is_solved_at_start([broken].iter()), "it was not played");
    }

    #[test]
    fn shares_are_of_all_levels_together() {
        let mut places = Places::default();
        assert_eq!((places.percent(), places.describe().as_str()), (None, "–"));
        places.add(Some(Places { visited: 1, open: 10 }));
        places.add(None);
        places.add(Some(Places { visited: 9, open: 30 }));
        assert_eq!((places.percent(), places.describe().as_str()), (Some(25.0), "25.0 %"));
    }
}
