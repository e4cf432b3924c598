//! `playbot bugs score`.

use crate::{
    arguments::{Compute, at_least_one_step, check_start, default_mode, experiment::quoted},
    error::{CliError, Outcome},
    output,
    output::{print_line, print_table, program},
    progress,
    progress::interrupt,
    verbs::bugs::testers::ContestantArgs,
};
use playbot_harness::{game::Game, games::Games};
use playbot_mutation::{
    bugs::BugSet,
    score::{
        ClockKind, Score, ScoreBudget, ScoreCallbacks, ScoreError, ScoreJournal, ScorePlan, ScoreRun, ScoreTable,
        TestedGame,
    },
};
use playbot_test::{
    detectors::{DetectorChoice, Detectors},
    verdict::Earlier,
};
use std::path::{Path, PathBuf};

/// Detectors that are opt-in here. `tick-time` depends on the clock, so its findings do not repeat.
/// `unreachable-region` runs an explorer of its own beside the measured testers.
const LEFT_OUT: [&str; 2] = ["tick-time", "unreachable-region"];

/// Measure which testers find planted defects: in how many mutants, with how many false findings, and how soon.
///
/// Every tester plays every mutant of this program's games and every unmutated level of the set. Budgets are equal, and
/// all detectors look but tick-time and unreachable-region. A mutant is found if a detector finds something, if the
/// game breaks, or if the level is proved unsolvable. It is also found if a tester fails that solves at least 99 % of
/// the unmutated levels. A tester that solves fewer fails where its reward lies far outside of its rewards on the
/// unmutated levels. On an unmutated level the same signs are a false finding. Results are also compared with those of
/// the same tester on the unmutated level that the mutant was made from.
///
/// All results but the times are the same on any number of threads.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bugs score runs/bugs --out runs/score.json
  playbot bugs score runs/bugs --tester random,chaos,explore --steps 20000 --out runs/score.json
  playbot bugs score runs/bugs --policy ppo=bot.policy --skills skills.safetensors --out runs/score.json --resume")]
pub struct Args {
    /// Folder of the set, as written by `playbot bugs make`.
    #[arg(value_name = "DIR")]
    set: PathBuf,
    /// Games of the set to test, separated by commas (default: all that this program has).
    #[arg(long = "game", value_name = "NAME", value_delimiter = ',')]
    names: Vec<String>,
    #[command(flatten)]
    testers: ContestantArgs,
    /// Episodes of each bot or policy, on each mutant and unmutated level.
    #[arg(long, default_value_t = ScoreBudget::default().episodes, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,
    /// Environment steps of each explorer, on each mutant and unmutated level.
    #[arg(long, default_value_t = ScoreBudget::default().steps, value_parser = at_least_one_step)]
    steps: u64,
    /// Paths of each explorer to play again under the detectors.
    #[arg(long, default_value_t = ScoreBudget::default().routes)]
    routes: u32,
    /// Replays for shortening the first finding of each tester on each mutant (0 for none).
    #[arg(long, default_value_t = ScoreBudget::default().replays)]
    replays: u32,
    /// Random seed.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Detectors to add, separated by commas.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    detect: Vec<String>,
    /// Detectors to leave out, separated by commas.
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    no_detect: Vec<String>,
    /// A setting of a detector (repeatable).
    #[arg(long, value_name = "NAME.KEY=VALUE")]
    detector: Vec<String>,
    /// File for the score.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Go on with a score that was stopped or killed, or begin it if there is none.
    #[arg(long, conflicts_with = "force")]
    resume: bool,
    /// Replace an existing score.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    compute: Compute,
    /// One line of JSON instead of tables.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let set = BugSet::read(&args.set)?;
    let plan = ScorePlan {
        set: &set,
        folder: &args.set,
        games: tested(&args, &set, games)?,
        budget: ScoreBudget {
            episodes: args.episodes,
            steps: args.steps,
            routes: args.routes,
            replays: args.replays,
            seed: args.seed,
        },
        clock: ClockKind::here(),
        threads: args.compute.threads(),
    };
    let score_run = ScoreRun::new(&plan)?;
    output::prepare(&args.out)?;
    if args.resume && args.out.exists() && !ScoreJournal::is_begun(&args.out) {
        let score = done_before(&args.out, &plan)?;
        report!("{} is done already", args.out.display());
        return report_score(&args.out, score, args.json);
    }
    let earlier = match (args.resume, args.force) {
        (true, _) => Earlier::Resume,
        (false, true) => Earlier::Replace,
        (false, false) => Earlier::Keep,
    };
    let opened = ScoreJournal::open(&args.out, &command(), &plan.record(), earlier);
    let (mut journal, cut) = opened?;
    if cut > 0 {
        report!("warning: the last {cut} bytes of the finished part are damaged, and are done again");
    }
    let total = score_run.jobs();
    let finished = journal.finished().len() as u64;
    interrupt::leave(format!("the finished jobs are kept beside {}", args.out.display()));
    interrupt::go_on_with("the same command and --resume".to_owned());
    interrupt::listen();
    let bar = progress::bar("bugs score", total.saturating_sub(finished), "jobs");
    let progress = |jobs: u64| bar.inc(jobs);
    let watch = ScoreCallbacks { progress: &progress, stop: &interrupt::asked };
    let scored = score_run.run(&mut journal, &watch);
    bar.finish_and_clear();
    let Some(score) = scored? else {
        let finished = journal.finished().len();
        report!("stopped; {finished} of {total} jobs are finished: go on with the same command and --resume");
        return Ok(Outcome::Stopped);
    };
    score.write(&args.out)?;
    journal.close()?;
    report_score(&args.out, score, args.json)
}

/// Returns the games of the set that this program has, each with its testers.
fn tested<'a>(args: &Args, set: &BugSet, games: &Games<'a>) -> Result<Vec<TestedGame<'a>>, CliError> {
    let mut chosen: Vec<&'a dyn Game> = Vec::new();
    for name in &args.names {
        let game = games.get(name)?;
        if !chosen.iter().any(|known| known.name() == game.name()) {
            chosen.push(game);
        }
    }
    if chosen.is_empty() {
        let is_in_set = |game: &&dyn Game| set.games.iter().any(|known| known.name == game.name());
        chosen = games.iter().filter(is_in_set).collect();
        if chosen.is_empty() {
            return Err(none_of_the_games(set, games));
        }
        let is_left_out = |name: &&str| !chosen.iter().any(|game| game.name() == *name);
        let left_out: Vec<&str> = set.games.iter().map(|game| game.name.as_str()).filter(is_left_out).collect();
        if !left_out.is_empty() {
            report!("left out, since this program does not have them: {}", left_out.join(", "));
        }
    }
    let contestants = args.testers.load(&chosen, games, args.compute.device())?;
    let choice = DetectorChoice {
        with: [vec!["all".to_owned()], args.detect.clone()].concat(),
        without: [LEFT_OUT.map(str::to_owned).to_vec(), args.no_detect.clone()].concat(),
        settings: args.detector.clone(),
    };
    let mut tested = Vec::new();
    // The game itself: that a mutant does not start is what is looked for.
    chosen.iter().try_for_each(|game| check_start(*game, default_mode(*game), 0))?;
    for (game, contestants) in chosen.into_iter().zip(contestants) {
        if contestants.is_empty() {
            report!("left out, since it has none of the testers: {}", game.name());
            continue;
        }
        let detectors = Detectors::choose(game, &choice).map_err(|error| CliError::Usage(error.to_string()))?;
        tested.push(TestedGame { game, contestants, detectors });
    }
    Ok(tested)
}

/// Returns the error of a set that was made for other games.
fn none_of_the_games(set: &BugSet, games: &Games) -> CliError {
    let of_set: Vec<&str> = set.games.iter().map(|game| game.name.as_str()).collect();
    let known: Vec<&str> = games.iter().map(|game| game.name()).collect();
    CliError::Usage(format!(
        "the set has mutants of {}, and this program has {}: call the program that has the game, or make a set with \
         `{} bugs make`",
        of_set.join(", "),
        known.join(", "),
        program::name()
    ))
}

/// Returns a finished score.
fn done_before(path: &Path, plan: &ScorePlan) -> Result<Score, CliError> {
    let score = Score::read(path)?;
    let differences = score.record.differences(&plan.record());
    if differences.is_empty() {
        Ok(score)
    } else {
        Err(ScoreError::OtherScore { path: path.into(), differences }.into())
    }
}

fn report_score(path: &Path, score: Score, json: bool) -> Result<Outcome, CliError> {
    let table = ScoreTable::join(&[(path.to_owned(), score)])?;
    if json {
        print_line(as_json(&table)?)?;
    } else {
        print_table(&table.class_table())?;
        print_line("")?;
        print_table(&table.tester_table())?;
        print_line("")?;
        ScoreTable::meanings().into_iter().try_for_each(print_line)?;
        print_line("")?;
        table.headlines().into_iter().try_for_each(print_line)?;
    }
    report!("score: {}", path.display());
    Ok(Outcome::Pass)
}

/// Returns a table as a line of JSON.
///
/// # Errors
///
/// It cannot be written so.
pub(crate) fn as_json(table: &ScoreTable) -> Result<String, CliError> {
    serde_json::to_string(table).map_err(|error| CliError::Io(format!("the table cannot be written as JSON: {error}")))
}

/// Returns the command line as it reads for a first call.
fn command() -> String {
    let words = std::env::args().skip(1).filter(|word| !["--resume", "--force", "--json"].contains(&word.as_str()));
    [program::name().to_owned()].into_iter().chain(words.map(|word| quoted(&word))).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command_line::check_usage;

    #[test]
    fn a_score_is_asked_for_in_one_line() {
        let sound =
            ["playbot", "bugs", "score", "set", "--tester", "random,hold", "--policy", "ppo=a", "--out", "a.json"];
        assert_eq!(check_usage(sound), Ok(()));
        let unnamed = ["playbot", "bugs", "score", "set", "--policy", "a.policy", "--out", "a.json"];
        assert!(check_usage(unnamed).expect_err("no name").contains("write a name and a file"));
        assert!(check_usage(["playbot", "bugs", "score", "set"]).is_err(), "it is written somewhere");
    }

    #[test]
    fn what_the_caller_can_mend_is_distinguished_from_what_failed() {
        assert_eq!(CliError::from(ScoreError::Nothing).exit_code(), 3);
        let source = std::io::Error::from(std::io::ErrorKind::StorageFull);
        let failed = ScoreError::Io { action: "write", path: "a".into(), source };
        assert_eq!(CliError::from(failed).exit_code(), 2);
    }
}
