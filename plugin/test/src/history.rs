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
use serde::{Deserialize, Serialize};
use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    path::Path,
};

pub use crate::history::{
    file::{HistoryError, add, check_game, read},
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
    /// Testers, episodes, seed and the checksum of level files: with the same ones the same program plays the same.
    pub plan: String,
    /// Each level by its name.
    pub levels: BTreeMap<String, Seen>,
}

/// A level in one build.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Seen {
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
    fn of(level: &LevelVerdict) -> Self {
        let finding = |finding: &crate::verdict::Finding| match &finding.tester {
            Some(tester) => format!("{} ({tester})", finding.detector),
            None => finding.detector.clone(),
        };
        let solved = level.testers.iter().filter(|tester| tester.score.solved > 0);
        Self {
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
    /// Reads the results in a folder. `name` is that of the build, and `program` the checksum of the program.
    ///
    /// # Errors
    ///
    /// The folder has no results, or they are damaged.
    pub fn of_results(folder: &Path, name: impl Into<String>, program: Option<String>) -> Result<Self, TestError> {
        let mut lines = ResultLines::open(folder)?;
        let record = lines.record();
        let testers: Vec<String> = record.testers.iter().map(|tester| tester.describe()).collect();
        let files = record.files.as_deref().unwrap_or("none");
        let (episodes, mode, seed) = (record.episodes, &record.range.mode, record.seed);
        let plan = format!("{}, {episodes} of {mode}, seed {seed}, files {files}", testers.join(" + "));
        let (game, version) = (record.game.clone(), record.game_version);
        let mut build = Self { build: name.into(), game, version, program, plan, levels: BTreeMap::new() };
        while let Some(level) = lines.next_level()? {
            build.levels.insert(level.title(), Seen::of(&level));
        }
        Ok(build)
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
    /// Both outcomes for the same bytes of game and levels; or, where the bytes of the game are unknown, it changed to and
    /// fro many times.
    Flaky {
        /// Builds that show it.
        builds: Vec<String>,
        /// Whether they are of the same bytes.
        same_bytes: bool,
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
            Self::NeverSound => 2,
            Self::Mended { .. } => 3,
            Self::Sound => 4,
        }
    }

    /// Returns its name, as in JSON.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Broken { .. } => "broken",
            Self::Flaky { .. } => "flaky",
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
            Self::NeverSound => f.write_str("never sound"),
            Self::Mended { since } => write!(f, "sound since {since}"),
            Self::Sound => f.write_str("sound"),
        }
    }
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

fn course(tested: &[(&Build, &Seen)]) -> Course {
    if let Some(flaky) = flaky(tested) {
        return flaky;
    }
    let Some((_, last)) = tested.last() else { return Course::Sound };
    let is_now = last.is_sound();
    let other = tested.iter().rposition(|(_, seen)| seen.is_sound() != is_now);
    let name = |place: usize| tested[place].0.build.clone();
    match (is_now, other) {
        (true, None) => Course::Sound,
        (true, Some(place)) => Course::Mended { since: name(place + 1) },
        (false, None) => Course::NeverSound,
        (false, Some(place)) => Course::Broken { sound_in: name(place), since: name(place + 1) },
    }
}

/// Returns that a level is flaky, if it is.
fn flaky(tested: &[(&Build, &Seen)]) -> Option<Course> {
    // Tests that play the same: program, version and plan.
    let mut same: BTreeMap<(&str, u32, &str), Vec<(&Build, bool)>> = BTreeMap::new();
    for (build, seen) in tested {
        if let Some(program) = &build.program {
            same.entry((program, build.version, &build.plan)).or_default().push((build, seen.is_sound()));
        }
    }
    let differs = |group: &&Vec<(&Build, bool)>| group.iter().any(|(_, sound)| *sound != group[0].1);
    if let Some(group) = same.values().find(differs) {
        let builds = group.iter().map(|(build, _)| build.build.clone()).collect();
        return Some(Course::Flaky { builds, same_bytes: true });
    }
    let is_change = |pair: &&[(&Build, &Seen)]| pair[0].1.is_sound() != pair[1].1.is_sound();
    let changes: Vec<String> = tested.windows(2).filter(is_change).map(|pair| pair[1].0.build.clone()).collect();
    let last = changes.len().saturating_sub(MANY_CHANGES);
    (changes.len() >= MANY_CHANGES).then(|| Course::Flaky { builds: changes[last..].to_vec(), same_bytes: false })
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
        Seen { outcome, solved, ticks: is_sound.then_some(ticks), visited: Some(40.0), by, findings }
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
}
