//! Levels and findings over the builds of a game: since when a level is broken, and which only change by themselves.
//!
//! A [`History`] is made of folders of results, one for each build, or kept in a file that each test adds a [`Build`] to.
//! [`Course`]s say of each level how it went.
//!
//! - `file`: the file.
//! - `page`: the page.

mod file;
mod page;

use crate::verdict::{LevelOutcome, LevelVerdict, ResultLines, TestError};
use playbot_harness::game::Game;
use serde::{Deserialize, Serialize};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::Path,
};

pub use crate::history::{
    file::{HistoryError, add, check_game, check_one_game, read},
    page::page,
};

/// Changes between good and bad after which a level of unknown programs counts as flaky: a repair and its undoing are two.
const MANY_CHANGES: usize = 3;

/// The results of one build.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Build {
    /// Its name, such as a revision.
    pub build: String,
    /// The game.
    pub game: String,
    /// Version of the game.
    pub version: u32,
    /// Checksum of the program, if it is known: the same bytes of a game play the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub program: Option<String>,
    /// Testers, episodes, seed and the checksum of level files: with the same ones the same program plays the same level
    /// the same.
    pub plan: String,
    /// Its testers, described as in the plan. Older lines lack them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub testers: Vec<String>,
    /// Each level by its name.
    pub levels: BTreeMap<String, Seen>,
}

/// A level in one build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
    /// Hash of its layout, if the game computes one: levels of an editor change without the program. Older lines lack it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layout: Option<String>,
    /// Its outcome.
    pub outcome: LevelOutcome,
    /// Episodes that solved it, and all.
    pub solved: [u64; 2],
    /// Median ticks of the solved ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ticks: Option<f64>,
    /// Share of the open squares that were visited, in percent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub visited: Option<f64>,
    /// The testers that solved it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub by: Vec<String>,
    /// Its findings: the detector, and the tester if one played.
    #[serde(default, skip_serializing_if = "BTreeSet::is_empty")]
    pub findings: BTreeSet<String>,
}

impl Seen {
    fn of(level: &LevelVerdict, layout: Option<u64>) -> Self {
        let finding = |finding: &crate::verdict::Finding| match &finding.tester {
            Some(tester) => format!("{} ({tester})", finding.detector),
            None => finding.detector.clone(),
        };
        let solved = level.testers.iter().filter(|tester| tester.score.solved > 0);
        Self {
            layout: layout.map(|hash| format!("{hash:016x}")),
            outcome: level.outcome,
            solved: [level.score.solved, level.score.episodes],
            ticks: level.score.ticks.map(|ticks| ticks.median),
            visited: level.places.and_then(|places| places.percent()),
            by: solved.map(|tester| tester.tester.clone()).collect(),
            findings: level.findings.iter().map(finding).collect(),
        }
    }

    /// Returns whether it was solved and nothing was found.
    pub fn is_sound(&self) -> bool {
        self.outcome == LevelOutcome::Solved && self.findings.is_empty()
    }
}

impl Build {
    /// Reads the results in a folder. `name` is that of the build, and `program` the checksum of the program. `game` is the
    /// one that was just tested; of results of an earlier day it is `None`, because its levels may have changed since.
    ///
    /// # Errors
    ///
    /// The folder has no results, or they are damaged.
    pub fn of_results(
        folder: &Path,
        name: impl Into<String>,
        program: Option<String>,
        game: Option<&dyn Game>,
    ) -> Result<Self, TestError> {
        let mut lines = ResultLines::open(folder)?;
        let record = lines.record();
        let testers: Vec<String> = record.testers.iter().map(|tester| tester.describe()).collect();
        let files = record.files.as_deref().unwrap_or("none");
        let (episodes, mode, seed) = (record.episodes, &record.range.mode, record.seed);
        let plan = format!("{}, {episodes} of {mode}, seed {seed}, files {files}", testers.join(" + "));
        let (mode, first) = (mode.clone(), record.range.first);
        let layout = |level: &LevelVerdict| game?.layout(&mode, first.checked_add(level.index)?);
        let (game, version) = (record.game.clone(), record.game_version);
        let mut build = Self { build: name.into(), game, version, program, plan, testers, levels: BTreeMap::new() };
        while let Some(level) = lines.next_level()? {
            build.levels.insert(level.title(), Seen::of(&level, layout(&level)));
        }
        Ok(build)
    }
}

impl Build {
    /// Returns the testers, of an older line those that its plan begins with.
    fn testers(&self) -> BTreeSet<&str> {
        if !self.testers.is_empty() {
            return self.testers.iter().map(String::as_str).collect();
        }
        let is_count = |rest: &str| rest.split_once(" of ").is_some_and(|(count, _)| count.parse::<u32>().is_ok());
        let end = self.plan.match_indices(", ").find(|(place, comma)| is_count(&self.plan[place + comma.len()..]));
        end.map(|(place, _)| self.plan[..place].split(" + ").collect()).unwrap_or_default()
    }
}

/// Returns whether two results of a level, of which one alone is sound, differ by more than their testers: something was
/// found without a tester or by one of both, the level was proved unsolvable, or a tester that solved it took part in the
/// other test. Where testers are unknown, they count as the same.
fn is_comparable(one: &(&Build, &Seen), other: &(&Build, &Seen)) -> bool {
    let ((build, sound), (later, unsound)) = if one.1.is_sound() { (one, other) } else { (other, one) };
    let (testers, others) = (build.testers(), later.testers());
    if testers == others || testers.is_empty() || others.is_empty() || sound.by.is_empty() {
        return true;
    }
    let common: Vec<&str> = testers.intersection(&others).copied().collect();
    // The description goes on after the name.
    let is_named = |tester: &str, name: &str| {
        tester
            .strip_prefix(name)
            .is_some_and(|rest| rest.is_empty() || rest.starts_with(" (file ") || rest.starts_with(", greedy"))
    };
    let is_common = |name: &str| common.iter().any(|tester| is_named(tester, name));
    let tester_of = |finding: &String| {
        finding.strip_suffix(')').and_then(|rest| rest.split_once(" (")).map(|(_, tester)| tester.to_owned())
    };
    let mut findings = unsound.findings.iter().map(tester_of);
    match unsound.outcome {
        LevelOutcome::ProvedUnsolvable => true,
        LevelOutcome::BotFailed if sound.by.iter().any(|name| is_common(name)) => true,
        _ => findings.any(|tester| tester.is_none_or(|tester| is_common(&tester))),
    }
}

/// All builds, in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct History {
    /// The builds, the oldest first.
    pub builds: Vec<Build>,
}

/// How a level went over the builds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LevelCourse {
    /// The level.
    pub level: String,
    /// What became of it.
    #[serde(flatten)]
    pub course: Course,
    /// Each finding, with the first and the last build that had it.
    pub findings: Vec<FindingCourse>,
    /// The median ticks in each build; null where it was not solved or not tested.
    pub ticks: Vec<Option<f64>>,
    /// The share of visited squares in each build, in percent.
    pub visited: Vec<Option<f64>>,
    /// The outcome in each build; null where it was not tested.
    pub outcomes: Vec<Option<LevelOutcome>>,
    /// Who solved it in the last build that tested it.
    pub solved_by: Vec<String>,
}

/// What became of a level.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "course", rename_all = "kebab-case")]
pub enum Course {
    /// It was sound until a build, and has not been since another.
    Broken {
        /// The last build in which it was sound.
        sound_in: String,
        /// The first since which it is not.
        since: String,
    },
    /// Both outcomes for the same bytes of game and level; or, where the bytes of the game are unknown, it changed to and
    /// fro many times.
    Flaky {
        /// Builds that show it.
        builds: Vec<String>,
        /// Whether they are of the same bytes.
        same_bytes: bool,
    },
    /// It was sound until a build, and other testers have tested it since another: it is not known to be broken.
    OtherTesters {
        /// The last build in which it was sound.
        sound_in: String,
        /// The first since which it is not.
        since: String,
        /// Testers of the first that take no part in the second.
        went: Vec<String>,
        /// Testers of the second that took no part in the first.
        came: Vec<String>,
    },
    /// It was never sound.
    NeverSound,
    /// It was not sound, and has been since a build.
    Mended {
        /// The first build since which it is sound.
        since: String,
    },
    /// It was always sound.
    Sound,
}

impl Course {
    /// Orders courses, the worst first.
    fn rank(&self) -> u8 {
        match self {
            Self::Broken { .. } => 0,
            Self::Flaky { .. } => 1,
            Self::OtherTesters { .. } => 2,
            Self::NeverSound => 3,
            Self::Mended { .. } => 4,
            Self::Sound => 5,
        }
    }

    /// Returns its name, as in JSON.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Broken { .. } => "broken",
            Self::Flaky { .. } => "flaky",
            Self::OtherTesters { .. } => "other-testers",
            Self::NeverSound => "never-sound",
            Self::Mended { .. } => "mended",
            Self::Sound => "sound",
        }
    }
}

impl fmt::Display for Course {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Broken { sound_in, since } => write!(f, "broken since {since} (sound in {sound_in})"),
            Self::Flaky { builds, same_bytes: true } => {
                write!(f, "flaky: both outcomes for the same bytes, in {}", builds.join(", "))
            }
            Self::Flaky { builds, .. } => write!(f, "flaky: changes to and fro, last in {}", builds.join(", ")),
            Self::OtherTesters { sound_in, since, went, came } => {
                write!(f, "not comparable since {since} (sound in {sound_in}): {}", testers_in_words(went, came))
            }
            Self::NeverSound => f.write_str("never sound"),
            Self::Mended { since } => write!(f, "sound since {since}"),
            Self::Sound => f.write_str("sound"),
        }
    }
}

/// Says which testers take part in one of two builds only.
fn testers_in_words(went: &[String], came: &[String]) -> String {
    let words = [(went, "no longer tested by"), (came, "newly tested by")];
    let words = words.iter().filter(|(testers, _)| !testers.is_empty());
    words.map(|(testers, what)| format!("{what} {}", testers.join(" and "))).collect::<Vec<_>>().join(", ")
}

/// Returns the testers of one build that take no part in another.
fn testers_only_in(one: &Build, other: &Build) -> Vec<String> {
    one.testers().difference(&other.testers()).map(|tester| (*tester).to_owned()).collect()
}

/// A finding over the builds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FindingCourse {
    /// The detector, and the tester if one played.
    pub finding: String,
    /// The first build that has it.
    pub first: String,
    /// The last build that has it.
    pub last: String,
    /// Whether the last build that tested the level has it.
    pub is_there: bool,
}

impl History {
    /// Returns the changes of testers from each build to the next, in words.
    pub fn changes_of_testers(&self) -> Vec<String> {
        let known = self.builds.windows(2).filter(|pair| pair.iter().all(|build| !build.testers().is_empty()));
        let changes = known.filter_map(|pair| {
            let words = testers_in_words(&testers_only_in(&pair[0], &pair[1]), &testers_only_in(&pair[1], &pair[0]));
            (!words.is_empty()).then(|| format!("{}: {words}", pair[1].build))
        });
        changes.collect()
    }

    /// Returns how each level went: the broken ones first, then the flaky ones, then the others, each by name.
    pub fn courses(&self) -> Vec<LevelCourse> {
        let names: BTreeSet<&str> =
            self.builds.iter().flat_map(|build| build.levels.keys()).map(String::as_str).collect();
        let mut courses: Vec<LevelCourse> = names.into_iter().map(|level| self.course_of(level)).collect();
        courses.sort_by_key(|level| level.course.rank());
        courses
    }

    fn course_of(&self, level: &str) -> LevelCourse {
        let all: Vec<(&Build, Option<&Seen>)> =
            self.builds.iter().map(|build| (build, build.levels.get(level))).collect();
        let tested: Vec<(&Build, &Seen)> = all.iter().filter_map(|(build, seen)| Some((*build, (*seen)?))).collect();
        let mut findings: BTreeMap<&str, FindingCourse> = BTreeMap::new();
        for (build, seen) in &tested {
            for finding in &seen.findings {
                let name = build.build.clone();
                let new = || FindingCourse {
                    finding: finding.clone(),
                    first: name.clone(),
                    last: name.clone(),
                    is_there: false,
                };
                findings.entry(finding).or_insert_with(new).last.clone_from(&name);
            }
        }
        let last = tested.last().map(|(_, seen)| *seen);
        for (finding, course) in &mut findings {
            course.is_there = last.is_some_and(|seen| seen.findings.contains(*finding));
        }
        LevelCourse {
            level: level.to_owned(),
            course: course(&tested),
            findings: findings.into_values().collect(),
            ticks: all.iter().map(|(_, seen)| seen.and_then(|seen| seen.ticks)).collect(),
            visited: all.iter().map(|(_, seen)| seen.and_then(|seen| seen.visited)).collect(),
            outcomes: all.iter().map(|(_, seen)| seen.map(|seen| seen.outcome)).collect(),
            solved_by: last.map(|seen| seen.by.clone()).unwrap_or_default(),
        }
    }
}

/// A level in the builds that tested it, the oldest first.
type Tested<'a> = [(&'a Build, &'a Seen)];

fn course(tested: &Tested) -> Course {
    let Some((_, last)) = tested.last() else { return Course::Sound };
    let flakes = Flakes::of(tested);
    let after = flakes.as_ref().map_or(0, |flakes| flakes.end);
    if let Some(flakes) = flakes
        && !is_broken_since(tested, after)
    {
        return flakes.course;
    }
    let is_now = last.is_sound();
    let other = tested.iter().rposition(|(_, seen)| seen.is_sound() != is_now);
    let name = |place: usize| tested[place].0.build.clone();
    match (is_now, other) {
        (true, None) => Course::Sound,
        (true, Some(place)) => Course::Mended { since: name(place + 1) },
        (false, None) => Course::NeverSound,
        // A build that was flaky is not the one that broke it.
        (false, Some(place)) => course_of_break(tested, place, after.max(place + 1)),
    }
}

/// Returns the course of a level that was sound up to a build and is not from another on.
fn course_of_break(tested: &Tested, last_sound: usize, first_unsound: usize) -> Course {
    let name = |place: usize| tested[place].0.build.clone();
    let sound = tested[..=last_sound].iter().rev().take_while(|(_, seen)| seen.is_sound()).count();
    let sound = || (last_sound + 1 - sound..=last_sound).rev();
    for since in first_unsound..tested.len() {
        if let Some(place) = sound().find(|place| is_comparable(&tested[*place], &tested[since])) {
            return Course::Broken { sound_in: name(place), since: name(since) };
        }
    }
    let (before, now) = (tested[last_sound].0, tested[first_unsound].0);
    let (went, came) = (testers_only_in(before, now), testers_only_in(now, before));
    Course::OtherTesters { sound_in: name(last_sound), since: name(first_unsound), went, came }
}

/// Returns whether a level that was flaky has broken for good since, with `after` builds up to its last flake. Then it is
/// unsound in more builds in a row than ever before: since that flake, or at all if it was never sound since.
fn is_broken_since(tested: &Tested, after: usize) -> bool {
    let (before, since) = tested.split_at(after);
    let run = since.iter().rev().take_while(|(_, seen)| !seen.is_sound()).count();
    let earlier = &since[..since.len() - run];
    let earlier = if earlier.is_empty() { before } else { earlier };
    let runs = earlier.split(|(_, seen)| seen.is_sound());
    run > runs.map(<[_]>::len).max().unwrap_or(0)
}

/// The flakes of a level.
struct Flakes {
    course: Course,
    /// Number of builds up to the last flake. It is 0 where flakes are only assumed.
    end: usize,
}

impl Flakes {
    /// Finds them; `None` if the level is not flaky.
    fn of(tested: &Tested) -> Option<Self> {
        // Tests that play the same.
        let mut same: BTreeMap<(&str, u32, &str, Option<&str>), Vec<usize>> = BTreeMap::new();
        for (place, (build, seen)) in tested.iter().enumerate() {
            if let Some(program) = &build.program {
                let key = (program.as_str(), build.version, build.plan.as_str(), seen.layout.as_deref());
                same.entry(key).or_default().push(place);
            }
        }
        let is_sound = |place: usize| tested[place].1.is_sound();
        let differs = |group: &&Vec<usize>| group.iter().any(|place| is_sound(*place) != is_sound(group[0]));
        let last = same.values().filter(differs).max_by_key(|group| group.last().copied());
        if let Some(group) = last {
            let builds = group.iter().map(|place| tested[*place].0.build.clone()).collect();
            let end = group.last().map_or(0, |last| last + 1);
            return Some(Self { course: Course::Flaky { builds, same_bytes: true }, end });
        }
        // Of two programs that differ, one may have broken the level and the other mended it.
        let unknown: Vec<_> = tested.iter().filter(|(build, _)| build.program.is_none()).collect();
        let is_change = |pair: &&[&(&Build, &Seen)]| {
            pair[0].1.is_sound() != pair[1].1.is_sound() && is_comparable(pair[0], pair[1])
        };
        let changes: Vec<String> = unknown.windows(2).filter(is_change).map(|pair| pair[1].0.build.clone()).collect();
        let first = changes.len().checked_sub(MANY_CHANGES)?;
        Some(Self { course: Course::Flaky { builds: changes[first..].to_vec(), same_bytes: false }, end: 0 })
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Makes what was seen of a level.
    pub fn seen(is_sound: bool, ticks: f64) -> Seen {
        let outcome = if is_sound { LevelOutcome::Solved } else { LevelOutcome::BotFailed };
        let findings = if is_sound { BTreeSet::new() } else { BTreeSet::from(["stuck (random)".to_owned()]) };
        let by = if is_sound { vec!["search".to_owned()] } else { Vec::new() };
        let solved = [u64::from(is_sound), 1];
        Seen { layout: None, outcome, solved, ticks: is_sound.then_some(ticks), visited: Some(40.0), by, findings }
    }

    /// Thirty builds of forty levels. Every build is tested twice; three levels are flaky, five break for good.
    pub fn thirty_builds() -> (History, Vec<(String, String)>, Vec<String>) {
        let broken: Vec<(usize, usize)> = vec![(3, 4), (8, 11), (17, 12), (25, 20), (31, 29)];
        let flaky = [5, 19, 37];
        let mut builds = Vec::new();
        for number in 0..30 {
            // A fast one is tested once more.
            for again in 0..if number % 4 == 0 { 2 } else { 1 } {
                let mut build = Build {
                    build: format!("b{number:02}{}", ["", "-again"][again]),
                    game: "garden".to_owned(),
                    version: 1,
                    program: Some(format!("{number:08x}")),
                    plan: "search, 1 of hard, seed 0".to_owned(),
                    testers: Vec::new(),
                    levels: BTreeMap::new(),
                };
                for level in 0..40 {
                    let is_broken = broken.iter().any(|(broken, since)| *broken == level && number >= *since);
                    let is_unlucky = flaky.contains(&level) && (number * 7 + again * 5 + level) % 3 == 0;
                    let is_repaired = level == 12 && number < 9;
                    let is_hopeless = level == 39;
                    let is_sound = !(is_broken || is_unlucky || is_repaired || is_hopeless);
                    build.levels.insert(format!("hard:{level}"), seen(is_sound, 100.0 + level as f64));
                }
                builds.push(build);
            }
        }
        let broken =
            broken.into_iter().map(|(level, since)| (format!("hard:{level}"), format!("b{since:02}"))).collect();
        (History { builds }, broken, flaky.map(|level| format!("hard:{level}")).to_vec())
    }

    #[test]
    fn regressions_are_dated_to_their_build_and_flaky_levels_told_apart() {
        let (history, broken, flaky) = thirty_builds();
        let courses = history.courses();
        let mut dated: Vec<(String, String)> = Vec::new();
        let mut unsteady = Vec::new();
        for LevelCourse { level, course, .. } in &courses {
            match course {
                Course::Broken { since, .. } => dated.push((level.clone(), since.clone())),
                Course::Flaky { same_bytes, .. } => {
                    assert!(same_bytes, "{level}");
                    unsteady.push(level.clone());
                }
                Course::Mended { since } => assert_eq!((level.as_str(), since.as_str()), ("hard:12", "b09")),
                Course::NeverSound => assert_eq!(level, "hard:39"),
                Course::OtherTesters { .. } => panic!("{level}: {course}"),
                Course::Sound => {}
            }
        }
        dated.sort();
        let mut wanted = broken;
        wanted.sort();
        unsteady.sort();
        let mut wanted_unsteady = flaky.clone();
        wanted_unsteady.sort();
        assert_eq!((dated, unsteady), (wanted, wanted_unsteady));
        let order: Vec<u8> = courses.iter().map(|level| level.course.rank()).collect();
        assert!(order.is_sorted(), "{order:?}");
        let first = &courses[0];
        assert_eq!(first.findings[0].last, "b29", "{first:?}");
        assert!(first.findings[0].is_there);

        // Without checksums of programs, to and fro is all that is known.
        let mut unknown = history;
        unknown.builds.iter_mut().for_each(|build| build.program = None);
        let found = unknown.courses();
        for level in &flaky {
            let course = &found.iter().find(|found| found.level == *level).expect("it is there").course;
            assert!(matches!(course, Course::Flaky { same_bytes: false, .. }), "{level}: {course}");
        }
        assert_eq!(found.iter().filter(|found| matches!(found.course, Course::Broken { .. })).count(), 5);
    }

    #[test]
    fn a_level_that_is_not_in_every_build_is_judged_by_those_that_have_it() {
        let build = |name: &str, levels: &[(&str, bool)]| Build {
            build: name.to_owned(),
            levels: levels.iter().map(|(level, sound)| ((*level).to_owned(), seen(*sound, 9.0))).collect(),
            ..Build::default()
        };
        let history = History {
            builds: vec![
                build("1", &[("a", true)]),
                build("2", &[("a", true), ("b", false)]),
                build("3", &[("b", true)]),
                build("4", &[("a", false), ("b", true)]),
            ],
        };
        let courses = history.courses();
        let broken = Course::Broken { sound_in: "2".to_owned(), since: "4".to_owned() };
        assert_eq!((courses[0].level.as_str(), &courses[0].course), ("a", &broken));
        assert_eq!(courses[0].outcomes[2], None);
        assert_eq!(courses[1].course, Course::Mended { since: "3".to_owned() });
        assert_eq!(broken.to_string(), "broken since 4 (sound in 2)");
    }

    /// Makes the history of a level: for each build its program, if it is known, the layout of the level, and whether it
    /// is sound.
    fn history_of(builds: &[(&str, &str, bool)]) -> History {
        let known = |text: &str| (!text.is_empty()).then(|| text.to_owned());
        let build = |(number, (program, layout, is_sound)): (usize, &(&str, &str, bool))| {
            let level = Seen { layout: known(layout), ..seen(*is_sound, 9.0) };
            let levels = BTreeMap::from([("a".to_owned(), level)]);
            Build { build: number.to_string(), program: known(program), levels, ..Build::default() }
        };
        History { builds: builds.iter().enumerate().map(build).collect() }
    }

    fn course_of(builds: &[(&str, &str, bool)]) -> Course {
        history_of(builds).courses().remove(0).course
    }

    /// Returns the course of builds whose outcomes are letters: `s` is sound. Programs are numbered from 0, and an
    /// upper-case letter has the program of the build before it.
    fn course_of_letters(letters: &str) -> Course {
        let mut programs = 0;
        let programs: Vec<String> = letters
            .chars()
            .map(|letter| {
                programs += usize::from(letter.is_lowercase());
                programs.to_string()
            })
            .collect();
        let outcomes = letters.chars().map(|letter| letter.eq_ignore_ascii_case(&'s'));
        let builds: Vec<(&str, &str, bool)> =
            programs.iter().zip(outcomes).map(|(program, is_sound)| (program.as_str(), "", is_sound)).collect();
        course_of(&builds)
    }

    fn broken(sound_in: &str, since: &str) -> Course {
        Course::Broken { sound_in: sound_in.to_owned(), since: since.to_owned() }
    }

    #[test]
    fn a_level_that_is_drawn_anew_for_the_same_program_is_not_flaky() {
        assert_eq!(course_of(&[("p", "1", true), ("p", "2", false)]), broken("0", "1"));
        let mended = course_of(&[("p", "1", false), ("p", "2", true)]);
        assert_eq!(mended, Course::Mended { since: "1".to_owned() });
        for layout in ["1", ""] {
            let flaky = course_of(&[("p", layout, true), ("p", layout, false)]);
            let builds = ["0", "1"].map(str::to_owned).to_vec();
            assert_eq!(flaky, Course::Flaky { builds, same_bytes: true }, "{layout}");
        }
    }

    /// Makes the history of a level: for each build its testers, those that solved it, and its findings.
    fn tested_by(builds: &[(&[&str], &[&str], &[&str])]) -> History {
        let build = |(number, (testers, by, findings)): (usize, &(&[&str], &[&str], &[&str]))| {
            let words = |all: &[&str]| all.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>();
            let findings = words(findings).into_iter().collect();
            let level = Seen { by: words(by), findings, ..seen(!by.is_empty(), 9.0) };
            let levels = BTreeMap::from([("a".to_owned(), level)]);
            Build { build: number.to_string(), testers: words(testers), levels, ..Build::default() }
        };
        History { builds: builds.iter().enumerate().map(build).collect() }
    }

    #[test]
    fn a_level_whose_only_solver_takes_no_part_later_is_not_known_to_be_broken() {
        let of = |builds: &[(&[&str], &[&str], &[&str])]| tested_by(builds).courses().remove(0).course;
        let (search, jump, both) = (["search"], ["jump"], ["jump", "search"]);
        let history = tested_by(&[(&search, &search, &[]), (&jump, &[], &[])]);
        let course = history.courses().remove(0).course;
        let words = "not comparable since 1 (sound in 0): no longer tested by search, newly tested by jump";
        assert_eq!((course.to_string().as_str(), course.name()), (words, "other-testers"));
        assert_eq!(history.changes_of_testers(), ["1: no longer tested by search, newly tested by jump"]);
        // A solver that takes part and fails shows it, in the first build with it.
        assert_eq!(of(&[(&search, &search, &[]), (&both, &[], &[])]), broken("0", "1"));
        assert_eq!(of(&[(&search, &search, &[]), (&jump, &[], &[]), (&both, &[], &[])]), broken("0", "2"));
        // So does one of an earlier build that was sound, too.
        assert_eq!(of(&[(&search, &search, &[]), (&jump, &jump, &[]), (&search, &[], &[])]), broken("0", "2"));
        // What a tester of both builds finds is new, and so is what is found without one.
        let found = |testers: &[&str], finding: &str| of(&[(&search, &search, &[]), (testers, &search, &[finding])]);
        assert_eq!(found(&both, "stuck (search)"), broken("0", "1"));
        assert_eq!(found(&both, "unreachable-goal"), broken("0", "1"));
        assert_eq!(found(&both, "stuck (jump)").name(), "other-testers");
        // Another policy of the same name is another tester.
        let policies = [["bot (file 0a)"], ["bot (file 0b)"]];
        let trained = of(&[(&policies[0], &["bot"], &[]), (&policies[1], &[], &[])]);
        assert_eq!(trained.name(), "other-testers");
        assert_eq!(of(&[(&policies[0], &["bot"], &[]), (&policies[0], &[], &[])]), broken("0", "1"));
        // Testers that take turns make no level flaky.
        let turns: Vec<(&[&str], &[&str], &[&str])> = (0..6)
            .map(
                |build| {
                    if build % 2 == 0 { (&search[..], &search[..], &[][..]) } else { (&jump[..], &[][..], &[][..]) }
                },
            )
            .collect();
        assert_eq!(of(&turns).name(), "other-testers");
    }

    #[test]
    fn the_testers_of_older_lines_are_those_of_their_plans() {
        let of = |plan: &str| {
            let build = Build { plan: plan.to_owned(), ..Build::default() };
            build.testers().into_iter().map(str::to_owned).collect::<Vec<_>>()
        };
        assert_eq!(
            of("search + bot (file 0a), greedy, 3 of hard, seed 0, files none"),
            ["bot (file 0a), greedy", "search"]
        );
        assert_eq!(of(""), [""; 0]);
    }

    #[test]
    fn lines_without_layouts_load() {
        let old = serde_json::json!({"outcome": "solved", "solved": [1, 1]});
        let read: Seen = serde_json::from_value(old.clone()).expect("an old line");
        assert_eq!((read.layout.as_deref(), serde_json::json!(read)), (None, old));
    }

    #[test]
    fn changes_between_known_programs_are_no_flakes() {
        let outcomes = [true, false, true, false, true, false];
        let with =
            |programs: [&'static str; 6]| programs.iter().zip(outcomes).map(|(name, is)| (*name, "", is)).collect();
        let builds: Vec<_> = with(["a", "b", "c", "d", "e", "f"]);
        assert_eq!(course_of(&builds), broken("4", "5"));
        let builds: Vec<_> = with([""; 6]);
        let last = ["3", "4", "5"].map(str::to_owned).to_vec();
        assert_eq!(course_of(&builds), Course::Flaky { builds: last, same_bytes: false });
        // Two changes are between builds that are unknown, the others are not.
        let builds: Vec<_> = with(["", "", "", "d", "e", "f"]);
        assert_eq!(course_of(&builds), broken("4", "5"));
    }

    #[test]
    fn a_flake_does_not_hide_that_a_level_breaks_later() {
        assert_eq!(course_of_letters("sUssu"), broken("3", "4"));
        assert_eq!(course_of_letters("sUssuuuuu"), broken("3", "4"));
        // One more build of the kind that was there before proves nothing.
        for letters in ["sU", "sUu", "sUs", "sUsusu"] {
            assert!(matches!(course_of_letters(letters), Course::Flaky { same_bytes: true, .. }), "{letters}");
        }
        assert_eq!(course_of_letters("sUuu"), broken("0", "2"), "the flaky build is not the one that broke it");
        assert_eq!(course_of_letters("sUsusuu"), broken("4", "5"));
        // The last of several flakes counts.
        assert!(matches!(course_of_letters("sUssuS"), Course::Flaky { builds, .. } if builds == ["4", "5"]));
        // Where programs are unknown, too.
        let unknown: Vec<_> = [true, false, true, false, false].map(|is_sound| ("", "", is_sound)).to_vec();
        assert_eq!(course_of(&unknown), broken("2", "3"));
    }
}
