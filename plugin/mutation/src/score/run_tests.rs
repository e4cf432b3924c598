//! Tests of the scoring of testers.

use crate::{
    bugs::BugSet,
    score::{ClockKind, Found, ScoreBudget, ScoredJob, TestedGame, *},
};
use playbot_corridor::Corridor;
use playbot_harness::game::Game;
use playbot_test::{
    detectors::{DetectorChoice, Detectors, LevelDefect, LevelDetector, TestedLevel},
    verdict::Earlier,
};
use std::{
    fs,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::Duration,
};

/// Three mutants and three unmutated levels, as a file has them.
const SET: &str = r#"{"format":1,"seed":7,"games":[{"name":"corridor","version":1}],"mutants":[
{"id":"corridor-burns-01","game":"corridor","class":"burns","about":"it burns","base":"plain:1","variant":0},
{"id":"corridor-no-exit-01","game":"corridor","class":"no-exit","about":"it has none","base":"plain:7","variant":0},
{"id":"corridor-walled-01","game":"corridor","class":"walled","about":"walled","base":"plain:2",
"level":{"file":"levels/corridor-walled-01.json","hash":"HASH"}}],
"sound":[{"game":"corridor","range":"plain:0..2"}]}"#;

fn made(folder: &Path) -> BugSet {
    fs::create_dir_all(folder.join("levels")).expect("writable");
    fs::write(folder.join("levels/corridor-walled-01.json"), "9\n").expect("writable");
    let hash = Corridor::default().parse_level("9").expect("a level").hash();
    fs::write(folder.join("mutants.json"), SET.replace("HASH", &format!("{hash:016x}"))).expect("writable");
    BugSet::read(folder).expect("a set")
}

fn plan<'a>(set: &'a BugSet, folder: &'a Path, game: &'a Corridor, threads: usize) -> ScorePlan<'a> {
    let without = ["tick-time", "unreachable-region"].map(str::to_owned).to_vec();
    let choice = DetectorChoice { with: vec!["all".to_owned()], without, ..DetectorChoice::default() };
    let detectors = Detectors::choose(game, &choice).expect("there are such");
    let contestants = Contestant::defaults(game);
    ScorePlan {
        set,
        folder,
        games: vec![TestedGame { game, contestants, detectors }],
        budget: ScoreBudget { episodes: 3, steps: 2000, replays: 20, ..ScoreBudget::default() },
        clock: ClockKind::here(),
        threads,
    }
}

fn without_times(score: &Score) -> Vec<(JobResult, Found)> {
    score.jobs.iter().map(|job| (job.result.without_times(), job.found)).collect()
}

/// Scores from the start, or resumes; stops after `most` jobs.
fn scored(plan: &ScorePlan, file: &Path, earlier: Earlier, most: u64) -> (Option<Score>, u64) {
    let run = ScoreRun::new(plan).expect("it can be played");
    let (mut journal, _) = ScoreJournal::open(file, "the command", &plan.record(), earlier).expect("writable");
    let done = AtomicU64::new(0);
    let progress = |jobs: u64| {
        done.fetch_add(jobs, Ordering::SeqCst);
    };
    let watch = ScoreCallbacks { progress: &progress, stop: &|| done.load(Ordering::SeqCst) >= most };
    let score = run.run(&mut journal, &watch).expect("it can be scored");
    (score, journal.finished().len() as u64)
}

#[test]
fn defects_are_found_by_the_detectors_for_them_and_sound_levels_are_left_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let (set, game) = (made(folder.path()), Corridor::default());
    let plan = plan(&set, folder.path(), &game, 2);
    let (score, _) = scored(&plan, &folder.path().join("score.json"), Earlier::Keep, u64::MAX);
    let score = score.expect("not stopped");
    // Seven subjects, with the original that is not among the unmutated levels, and five testers.
    assert_eq!((score.subjects.len(), score.jobs.len()), (7, 35));
    let job = |subject: &str, tester: &str| {
        let is = |job: &&ScoredJob| job.result.subject == subject && job.result.tester == tester;
        score.jobs.iter().find(is).expect("it was done")
    };
    for tester in ["guide", "explore"] {
        let burnt = job("corridor-burns-01", tester);
        assert_eq!(burnt.result.findings[0].detector, "panic", "{tester}");
        assert!(burnt.found.detected && burnt.first.is_some());
        let no_exit = job("corridor-no-exit-01", tester);
        assert!(no_exit.found.failed, "{tester} solves all sound levels: {no_exit:?}");
        assert!(job("corridor-walled-01", tester).found.unsolvable);
        for level in 0..3 {
            let sound = job(&format!("corridor plain:{level}"), tester);
            assert!(!sound.found.at_all() && sound.result.is_solved(), "{sound:?}");
        }
    }
    let guide = &job("corridor-burns-01", "guide").result;
    assert_eq!((guide.exact, guide.original, guide.minimised), (true, Some(2), Some(2)));
    assert!(job("corridor-no-exit-01", "guide").found.differs, "beside the sound level");
    // The last action is to stay.
    assert!(!job("corridor-no-exit-01", "hold").found.failed);
}

#[test]
fn a_score_is_the_same_on_any_number_of_threads_and_after_a_stop() {
    let folder = tempfile::tempdir().expect("a folder");
    let (set, game) = (made(folder.path()), Corridor::default());
    let [one, two] = [1, 2].map(|threads| plan(&set, folder.path(), &game, threads));
    let whole = scored(&one, &folder.path().join("one.json"), Earlier::Keep, u64::MAX).0.expect("done");
    let file = folder.path().join("two.json");
    let (stopped, finished) = scored(&two, &file, Earlier::Keep, 5);
    assert!(stopped.is_none() && (1..35).contains(&finished), "{finished}");
    let resumed = scored(&two, &file, Earlier::Resume, u64::MAX).0.expect("done");
    assert_eq!(without_times(&resumed), without_times(&whole));
    resumed.write(&file).expect("writable");
    assert_eq!(Score::read(&file).expect("readable"), resumed);
}

/// A slow detector that finds something in each level, and counts the levels that it has inspected.
#[derive(Default)]
struct Slow(AtomicU64);

/// The milliseconds that it takes.
const SLOW: u64 = 20;

impl LevelDetector for Slow {
    fn name(&self) -> &'static str {
        "slow"
    }

    fn describe(&self) -> &'static str {
        "a level was inspected"
    }

    fn depends_on_testers(&self) -> bool {
        false
    }

    #[allow(clippy::disallowed_methods, reason = "it takes time, which the score reports")]
    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        self.0.fetch_add(1, Ordering::SeqCst);
        thread::sleep(Duration::from_millis(SLOW));
        vec![LevelDefect { message: format!("level {}", level.level), ..LevelDefect::default() }]
    }
}

#[test]
fn findings_that_do_not_depend_on_the_tester_are_computed_once_and_charged_to_each() {
    let (folder, game, slow) = (tempfile::tempdir().expect("a folder"), Corridor::default(), Arc::<Slow>::default());
    let set = made(folder.path());
    let mut plan = ScorePlan { clock: ClockKind::Wall, ..plan(&set, folder.path(), &game, 2) };
    plan.games[0].detectors.levels = vec![Arc::<Slow>::clone(&slow)];
    plan.games[0].contestants.retain(|contestant| contestant.record.name != "explore");
    let (score, _) = scored(&plan, &folder.path().join("score.json"), Earlier::Keep, u64::MAX);
    let score = score.expect("not stopped");
    assert_eq!((slow.0.load(Ordering::SeqCst), score.jobs.len()), (7, 28));
    for ScoredJob { result, .. } in score.jobs {
        assert!(result.findings.iter().any(|finding| finding.detector == "slow"), "{result:?}");
        assert!(result.seconds >= SLOW as f64 / 1e3, "{result:?}");
    }
}

/// A game that panics in the second episode of a World, after ten ticks.
const LATER: &str = r#"{"format":1,"seed":7,"games":[{"name":"corridor","version":1}],"mutants":[
{"id":"corridor-panic-01","game":"corridor","class":"panic","about":"it panics","base":"plain:0","variant":2}],
"sound":[{"game":"corridor","range":"plain:0..0"}]}"#;

#[test]
fn a_break_after_other_episodes_is_found_by_testers_that_play_several() {
    let (folder, game) = (tempfile::tempdir().expect("a folder"), Corridor::default());
    fs::write(folder.path().join("mutants.json"), LATER).expect("writable");
    let set = BugSet::read(folder.path()).expect("a set");
    let plan = plan(&set, folder.path(), &game, 1);
    let (score, _) = scored(&plan, &folder.path().join("score.json"), Earlier::Keep, u64::MAX);
    // `hold` holds the last action and stays for the whole time.
    let is_hold = |job: &&ScoredJob| job.result.tester == "hold" && job.result.subject == "corridor-panic-01";
    let score = score.expect("not stopped");
    let JobResult { findings, ends, .. } = &score.jobs.iter().find(is_hold).expect("it was done").result;
    assert_eq!(findings[0].detector, "panic");
    assert!(findings[0].message.contains("other episodes in the same World may have left state"), "{findings:?}");
    assert_eq!(ends.as_slice(), ["time up 30"; 3], "each episode is sound when it is played alone");
}
