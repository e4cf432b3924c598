//! `playbot test`.
//!
//! The folder, in reading order:
//!
//! - `on_cluster`: tests whose shards other machines play.
//! - `testers`: testers on the command line.
//! - `results`: report of results, and the files that go with them.
//! - `scenes`: findings as the game shows them.
//! - `regress`: replay of stored findings, and detectors on the command line.

mod on_cluster;
mod regress;
mod results;
mod scenes;
mod testers;

use crate::{
    arguments::{
        Compute, check_start_and_steps, cluster::ClusterArgs, default_tested, experiment::quoted, named_or_only,
        report_agents_along,
    },
    error::{CliError, Outcome},
    output::check_folder,
    progress,
    progress::interrupt,
    verbs::{
        history::{add_results, check_history},
        test::regress::{RegressArgs, forget_slow_ticks, report_slow_ticks},
    },
};
use playbot_harness::{game::Game, games::Games, level_audit::EqualLevels, split::LevelSplit};
use playbot_report::counted;
use playbot_test::{
    detectors::Detectors,
    findings::{Budget, Checks, FindingFiles, RecordedCourse},
    verdict::{
        Comparison, Earlier, LevelVerdict, RecordedWins, Shard, TestEnd, TestFolder, TestObserver, TestPlan,
        results_folder, run_tests_keeping,
    },
};
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

pub(crate) use crate::verbs::test::{
    regress::{DetectorArgs, list_detectors},
    testers::TesterArgs,
};

pub use crate::verbs::test::results::{Results, report_results};
pub(crate) use crate::verbs::test::results::{join_shards, write_page};

/// Test levels: report which of them bots and policies solve, and which are unsolvable.
///
/// Each level is solved, or no tester solved it, or it is proved unsolvable. A game that panics or breaks its contract
/// on a level is a finding of that level, and the other levels go on. DIR/results.json has every level, with 95 %
/// intervals, and is the same on any number of threads. DIR/report.html shows it with pictures of the worst,
/// DIR/junit.xml is for build servers and DIR/summary.md for a pull request.
///
/// Each finding of an episode is a file in DIR/findings, which `playbot replay` shows. With --regress, such files are
/// played again instead.
///
/// Exit code 1 if a level was not solved or something was found. With --against DIR, exit code 1 if a level is solved less
/// often than before, can no longer be solved, or has a new finding. With --against FILE.demo, also if the actions of the
/// recording no longer end as they were recorded to.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot test GAME --levels MODE:0..99 --out runs/test
  playbot test GAME --levels MODE:0..99 --bot BOT,random --episodes 5 --out runs/test
  playbot test GAME --levels MODE:0..99 --policy bot.policy --out runs/test --resume
  playbot test GAME --levels MODE:0..99 --policy ppo=old/bot.policy --against runs/before --out runs/after
  playbot test GAME --levels MODE:0..99 --against runs/before --out runs/after
  playbot test GAME --levels MODE:0..99 --detect reward-loop --detector stuck.ticks=200 --out runs/test
  playbot test GAME --levels MODE:0..99 --par pars.json --out runs/test
  playbot test GAME --levels MODE:0..99 --history history.jsonl --build monday --out runs/test
  playbot test GAME --levels MODE:0..99999 --shard 0/4 --out runs/shard-0   one of four machines
  playbot test GAME --levels MODE:0..99999 --cluster ray://head:10001 --out runs/test   on a cluster of Ray")]
pub struct Args {
    /// Name of the game (not with --regress).
    game: Option<String>,
    /// Levels, as mode:first..last, both included, as files:pattern, such as "files:levels/*.json", or by their names in a
    /// level editor (default: the held-out levels of the game's experiment, or all of a game that has no experiment and at
    /// most 64 levels).
    #[arg(long, visible_alias = "level")]
    levels: Option<LevelSplit>,
    #[command(flatten)]
    testers: TesterArgs,
    /// Episodes of each tester on each level.
    #[arg(long, visible_alias = "episodes-per-level", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,
    /// Random seed of the testers' draws.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Test only one part of the levels, as index/count, counted from 0. `playbot report merge` joins the results.
    #[arg(long, value_name = "INDEX/COUNT")]
    shard: Option<Shard>,
    #[command(flatten)]
    cluster: ClusterArgs,
    /// Shards of a test on a cluster, at most as many as levels; with more of them less is lost with a worker.
    #[arg(long, value_name = "N", requires = "cluster", conflicts_with = "shard", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    shards: u32,
    /// Folder of earlier results of the same version of the game, to report changes. Or a .demo recording of an earlier
    /// build, to report on which of the levels that it solves its actions lead elsewhere or end otherwise now.
    #[arg(long, value_name = "PATH")]
    against: Option<PathBuf>,
    /// Add the results to this file of a history, which `playbot history` shows (not with --regress).
    #[arg(long, value_name = "FILE")]
    history: Option<PathBuf>,
    /// Name of this build in the history (default: the revision that a build server names, or a number).
    #[arg(long, value_name = "NAME", requires = "history")]
    build: Option<String>,
    /// Folder for the results (not with --regress).
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the game's pictures and the clips of the page into DIR/report-files instead of into the page (not with --regress).
    #[arg(long)]
    split: bool,
    /// Go on with a test that was stopped or killed, or begin it if there is none.
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Replace existing results.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    detectors: DetectorArgs,
    #[command(flatten)]
    findings: FindingArgs,
    #[command(flatten)]
    regress: RegressArgs,
    #[command(flatten)]
    pub(crate) compute: Compute,
    /// Print one line of JSON per level instead of a table.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    if args.detectors.list_detectors {
        let game = args.game.as_ref().map_or_else(|| Ok(games.first()), |name| games.get(name))?;
        return list_detectors(game, args.json);
    }
    if let Some(outcome) = args.regress.run(games, &args.detectors, args.compute.threads(), args.json) {
        return outcome;
    }
    let game = named_or_only(games, args.game.as_deref(), "test", ", or a folder of findings with --regress")?;
    let Some(out) = &args.out else {
        let name = game.name();
        return Err(CliError::Usage(format!("name a folder for the results with --out, such as --out runs/{name}")));
    };
    check_folder(out)?;
    report_agents_along(game);
    let plan = plan(args, game)?;
    let record = plan.record(game);
    let (recording, against) = match args.against.as_deref() {
        Some(path) if path.extension().is_some_and(|ending| ending == "demo") => (Some(path), None),
        path => (None, path.map(results_folder)),
    };
    let keeps_failures = args.findings.keep_failures;
    let (json, split, threads) = (args.json, args.split, args.compute.threads());
    let results = Results { folder: out, against, game: Some(game), json, keeps_failures, split, threads };
    results.check()?;
    if args.cluster.cluster.is_some() {
        if recording.is_some() {
            let words =
                "the actions of a recording are played on one machine: leave out --cluster or --against FILE.demo";
            return Err(CliError::Usage(words.to_owned()));
        }
        return on_cluster::run(args, &plan, &results);
    }
    args.history.as_deref().map(|file| check_history(file, game)).transpose()?;
    let recorded = recording.map(|recording| RecordedWins::read(game, &plan, recording)).transpose()?;
    if let Some(before) = results.against {
        Comparison::check(before, &record)?;
    }
    let earlier = match (args.resume, args.force) {
        (true, _) => Earlier::Resume,
        (false, true) => Earlier::Replace,
        (false, false) => Earlier::Keep,
    };
    let (mut folder, message) = TestFolder::open(out, &record, earlier)?;
    message.iter().for_each(|message| report!("warning: {message}"));
    interrupt::leave(format!("the finished levels are kept in {}", out.display()));
    interrupt::go_on_with("the same command and --resume".to_owned());
    interrupt::listen();
    if !args.resume {
        forget_slow_ticks(out)?;
    }
    let end = test(game, &plan, &mut folder, &args.findings.files(out, &plan.detectors))?;
    report_slow_ticks(&plan.detectors, out)?;
    let courses = match end {
        TestEnd::Stopped => None,
        TestEnd::Done => {
            recorded.map_or_else(|| Some(BTreeMap::new()), |recorded| play_recorded(game, &plan, recorded))
        }
    };
    let Some(courses) = courses else {
        report!(
            "stopped; {} of {} levels are finished: go on with the same command and --resume",
            folder.finished().len(),
            plan.places().len()
        );
        return Ok(Outcome::Stopped);
    };
    folder.finish_against(&courses)?;
    let outcome = report_results(&results)?;
    args.history.as_deref().map(|file| add_results(file, out, game, args.build.as_deref())).transpose()?;
    report_off(game, &plan.detectors);
    Ok(outcome)
}

/// Reports the opt-in detectors that have not looked.
fn report_off(game: &dyn Game, detectors: &Detectors) {
    let off = detectors.off(game);
    if let Some(name) = off.iter().find(|name| **name == "fading-action").or(off.first()) {
        let (are, count) = (if off.len() == 1 { "is" } else { "are" }, counted(off.len() as u64, "opt-in detector"));
        report!("{count} {are} off: {}; `--detect {name}` adds one, and `--detectors` describes all", off.join(", "));
    }
}

/// Plays recorded actions again, with a progress bar. Returns `None` if it was stopped.
fn play_recorded(game: &dyn Game, plan: &TestPlan, recorded: RecordedWins) -> Option<BTreeMap<u64, RecordedCourse>> {
    let bar = progress::bar(&format!("replay {}", game.name()), recorded.len() as u64, "episodes");
    let courses = recorded.courses(game, plan.threads, &|episodes| bar.inc(episodes), &interrupt::asked);
    bar.finish_and_clear();
    courses
}

fn plan(args: &Args, game: &dyn Game) -> Result<TestPlan, CliError> {
    let split = match &args.levels {
        Some(split) => split.clone(),
        None => {
            let default = default_tested(game);
            report!("no --levels are named: {default}");
            default
        }
    };
    split.check(game)?;
    check_start_and_steps(game, &split.mode, split.first)?;
    report_equal_levels(game, &split);
    let detectors = args.detectors.choose(game, &split)?;
    let testers = args.testers.load(game, &split, args.compute.device())?;
    let plan = TestPlan {
        split,
        testers,
        episodes: args.episodes,
        seed: args.seed,
        detectors,
        shard: args.shard,
        threads: args.compute.threads(),
    };
    plan.check()?;
    Ok(plan)
}

/// Largest number of levels whose layouts are compared before a test, so that it begins at once.
const MOST_COMPARED: u64 = 10_000;

/// Reports it if some levels are equal: they would be tested again and again.
fn report_equal_levels(game: &dyn Game, split: &LevelSplit) {
    if split.len() > MOST_COMPARED {
        return;
    }
    let Some(equal) = EqualLevels::of(game, split).filter(|equal| !equal.groups.is_empty()) else { return };
    report!(
        "{} have {}: `playbot levels {} --levels {}` lists the equal ones",
        counted(split.len(), "level"),
        counted(equal.layouts, "layout"),
        game.name(),
        quoted(&split.to_string())
    );
}

/// Tests the unfinished levels, with a progress bar.
fn test(game: &dyn Game, plan: &TestPlan, folder: &mut TestFolder, files: &FindingFiles) -> Result<TestEnd, CliError> {
    let finished = folder.finished();
    let levels = plan.places().len().saturating_sub(finished.len()) as u64;
    let total = levels * plan.testers.len() as u64 * u64::from(plan.episodes);
    let bar = progress::bar(&format!("test {}", game.name()), total, "episodes");
    let progress = |episodes: u64| bar.inc(episodes);
    let watch = TestObserver { progress: &progress, stop: &interrupt::asked };
    let mut keep = |verdict: LevelVerdict| folder.keep(&verdict);
    let end = run_tests_keeping(game, plan, &finished, &mut keep, &watch, Some(files));
    bar.finish_and_clear();
    Ok(end?)
}

/// Findings as files.
#[derive(clap::Args, Clone, Debug)]
pub struct FindingArgs {
    /// Leave out actions that findings do not need, with up to 500 replays each. `playbot replay` does it for a single
    /// one.
    #[arg(long)]
    minimise: bool,
    /// Also write a failed episode of each level that no tester solved, of a deterministic tester if one failed there.
    #[arg(long)]
    keep_failures: bool,
}

impl FindingArgs {
    /// Returns the folder of findings and the options for them.
    pub fn files(&self, folder: &Path, detectors: &Detectors) -> FindingFiles {
        FindingFiles {
            folder: folder.to_owned(),
            minimise: self.minimise.then(Budget::default),
            keep_failures: self.keep_failures,
            checks: Checks::default().with_detectors(detectors),
        }
    }
}
