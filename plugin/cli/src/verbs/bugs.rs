//! `playbot bugs make|score|table`.
//!
//! The folder, in reading order:
//!
//! - `testers`: testers of `playbot bugs score`, from the command line.
//! - `score`: `playbot bugs score`.

mod score;
pub(crate) mod testers;

use crate::{
    arguments::{Threads, check_start, default_experiment_of, default_mode},
    error::{CliError, Outcome},
    output,
    output::{print_line, program},
    progress,
    progress::{interrupt, interrupt::NothingToSave},
    verbs::bugs::score::as_json,
};
use playbot_harness::{
    brief::shell_word,
    game::Game,
    games::{Games, is_named},
    split::LevelSplit,
};
use playbot_mutation::{
    bugs::{BugError, BugSet, MakePlan, MissingMutants, PlantedPart, Source, make_bugs},
    score::{Score, ScoreTable},
};
use playbot_report::counted;
use playbot_test::verdict::RESULTS;
use serde_json::json;
use std::{collections::BTreeMap, path::PathBuf, str::FromStr};

/// Plant defects into games and levels, and measure which testers find them.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bugs make --seed 1 --out runs/bugs
  playbot bugs score runs/bugs --out runs/score.json
  playbot bugs table runs/score.json --out table.md")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

// Each is described where its arguments are.
#[derive(clap::Subcommand)]
enum Verb {
    Make(MakeArgs),
    Score(score::Args),
    Table(TableArgs),
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Make(args) => run_make(&args, games),
        Verb::Score(args) => score::run(args, games),
        Verb::Table(args) => run_table(args),
    }
}

// `playbot bugs table`.

/// Join scores of different games or sets, and print them as a page of Markdown.
///
/// Scores with different budgets, or with the same mutants or unmutated levels, are not joined.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bugs table runs/score.json
  playbot bugs table runs/score.json runs/other.json --out table.md
  playbot bugs table runs/score.json --json")]
pub struct TableArgs {
    /// Scores, as written by `playbot bugs score`.
    #[arg(value_name = "SCORE", required = true)]
    scores: Vec<PathBuf>,
    /// File for the page, instead of standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// One line of JSON instead of Markdown.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run_table(args: TableArgs) -> Result<Outcome, CliError> {
    let mut scores = Vec::new();
    for path in args.scores {
        let score = Score::read(&path)?;
        scores.push((path, score));
    }
    let table = ScoreTable::join(&scores)?;
    let text = if args.json { as_json(&table)? } else { table.to_markdown() };
    match &args.out {
        Some(path) => {
            output::write(path, format!("{}\n", text.trim_end()).as_bytes())?;
            report!("table: {}", path.display());
        }
        None => print_line(text.trim_end())?,
    }
    Ok(Outcome::Pass)
}

// `playbot bugs make`.

/// First level of a game for which no levels are given, far from the levels that bots are trained on.
const FIRST: u64 = 1_000_000;

const LAST: u64 = 1_999_999;

/// Plant defects: make a set of broken games and levels, and list unmutated levels beside them.
///
/// Every kind of defect of the games is planted a few times: their own kinds and those that all games have. Each is
/// planted into another level that the game's own bot solves, or with another variant. A defect of a game's rules is
/// planted only where it changes some bot's episode. The same seed makes the same files.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bugs make --seed 1 --out runs/bugs
  playbot bugs make GAME --per-kind 6 --sound 200 --out runs/bugs
  playbot bugs make GAME --levels GAME=MODE:1000..1999 --out runs/bugs --force")]
pub struct MakeArgs {
    /// Names of the games (default: all games of the program).
    #[arg(value_name = "GAME")]
    games: Vec<String>,
    /// Random seed.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Mutants of each kind and game.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=100))]
    per_kind: u32,
    /// Unmutated levels of all games together.
    #[arg(long, default_value_t = 1000, value_parser = clap::value_parser!(u64).range(..=1_000_000))]
    sound: u64,
    /// Levels of a game to plant defects into and to list as unmutated (once for each game). Default: numbers from
    /// 1000000 on, in the mode of the game's held-out levels, or all levels of a game that has no such numbers.
    #[arg(long, value_name = "GAME=MODE:FIRST..LAST")]
    levels: Vec<LevelsOf>,
    #[command(flatten)]
    threads: Threads,
    /// Folder for the set.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Replace an existing set.
    #[arg(long)]
    force: bool,
    /// One line of JSON instead of a table.
    #[arg(long)]
    json: bool,
}

/// The levels of a game.
#[derive(Clone, Debug)]
struct LevelsOf {
    game: String,
    levels: LevelSplit,
}

impl FromStr for LevelsOf {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (game, levels) = text
            .split_once('=')
            .filter(|(game, _)| !game.is_empty() && !game.contains(':'))
            .ok_or("write the name of a game in front, as in GAME=MODE:1000..1999")?;
        let levels = levels.parse::<LevelSplit>().map_err(|error| error.to_string())?;
        Ok(Self { game: game.to_owned(), levels })
    }
}

pub(crate) fn run_make(args: &MakeArgs, games: &Games) -> Result<Outcome, CliError> {
    if !args.force && BugSet::is_in(&args.out) {
        return Err(BugError::Exists(args.out.clone()).into());
    }
    if args.out.join(RESULTS).exists() {
        return Err(BugError::IsTest(args.out.clone()).into());
    }
    let sources = sources(args, games)?;
    interrupt::leave(format!("nothing is written in {}: the same command begins again", args.out.display()));
    let planting = NothingToSave::listen();
    output::make_folder(&args.out)?;
    let plan = MakePlan { seed: args.seed, per_kind: args.per_kind, sound: args.sound, threads: args.threads.count() };
    let bar = progress::bar("bugs make", plan.steps(&sources), "levels and mutants");
    let made = make_bugs(&sources, &plan, &|steps| bar.inc(steps));
    bar.finish_and_clear();
    let made = made?;
    // The set is written as a whole.
    drop(planting);
    made.set.write(&args.out, &made.levels, args.force)?;
    for missing in &made.without_place {
        report!("warning: {}", missing.describe());
    }
    print(&made.set, &made.without_place, args.json)?;
    let folder = shell_word(&args.out.display().to_string());
    report!(
        "planted: {}; measure testers on them: {} bugs score {folder} --out score.json",
        args.out.display(),
        program::name()
    );
    Ok(Outcome::Pass)
}

/// Returns the requested games, each once, with their levels.
fn sources<'a>(args: &MakeArgs, games: &Games<'a>) -> Result<Vec<Source<'a>>, CliError> {
    let mut chosen: Vec<&'a dyn Game> = Vec::new();
    for name in &args.games {
        let game = games.get(name)?;
        if chosen.iter().any(|other| other.name() == game.name()) {
            return Err(CliError::Usage(format!("the game `{name}` is named twice: name it once")));
        }
        chosen.push(game);
    }
    if chosen.is_empty() {
        chosen = games.iter().collect();
    }
    for LevelsOf { game, .. } in &args.levels {
        let named = games.get(game)?;
        let is_chosen = chosen.iter().any(|other| other.name() == named.name());
        if !is_chosen || args.levels.iter().filter(|other| is_named(named, &other.game)).count() > 1 {
            return Err(CliError::Usage(format!(
                "--levels {game}=… must be given once at most, and for a game that defects are planted into"
            )));
        }
    }
    chosen.into_iter().map(|game| source(args, game)).collect()
}

fn source<'a>(args: &MakeArgs, game: &'a dyn Game) -> Result<Source<'a>, CliError> {
    let named = args.levels.iter().find(|levels| is_named(game, &levels.game));
    let default = default_experiment_of(game).map(|default| default.experiment);
    let is_mode = |split: &LevelSplit| game.check_mode(&split.mode).is_ok();
    let levels = match named {
        Some(named) => named.levels.clone(),
        None => {
            let held_out = default.as_ref().map(|default| &default.test).filter(|split| is_mode(split));
            let mode = held_out.map_or_else(|| default_mode(game).to_owned(), |split| split.mode.clone());
            LevelSplit { mode, first: FIRST, last: LAST }.within(game)
        }
    };
    levels.check(game)?;
    check_start(game, &levels.mode, levels.first)?;
    Ok(Source { game, levels, trained: default.map(|default| default.train).filter(is_mode) })
}

/// Prints how many defects of each class were planted.
fn print(set: &BugSet, without_place: &[MissingMutants], json: bool) -> Result<(), CliError> {
    let mut classes: BTreeMap<(&str, &str), (u64, u64)> = BTreeMap::new();
    for bug in &set.mutants {
        let (levels, rules) = classes.entry((bug.game.as_str(), bug.class.as_str())).or_default();
        match bug.planted {
            PlantedPart::Level(_) => *levels += 1,
            PlantedPart::Rules { .. } => *rules += 1,
        }
    }
    let sound: u64 = set.sound.iter().map(|sound| sound.range.len()).sum();
    if json {
        let class = |(&(game, class), &(levels, rules)): (&(&str, &str), &(u64, u64))| json!({ "game": game, "class": class, "levels": levels, "rules": rules });
        let missing = |missing: &MissingMutants| {
            let MissingMutants { game, class, planted, wanted, without_effect } = missing;
            json!({
                "game": game, "class": class, "planted": planted, "wanted": wanted, "without_effect": without_effect,
            })
        };
        return print_line(json!({
            "seed": set.seed,
            "mutants": set.mutants.len(),
            "sound": sound,
            "classes": classes.iter().map(class).collect::<Vec<_>>(),
            "without_place": without_place.iter().map(missing).collect::<Vec<_>>(),
        }));
    }
    let width = classes.keys().map(|(game, _)| game.len()).max().unwrap_or(0).max("game".len());
    print_line(format!("{:<width$}  {:<24}  {:>6}  {:>5}", "game", "defect", "levels", "rules"))?;
    for ((game, class), (levels, rules)) in &classes {
        print_line(format!("{game:<width$}  {class:<24}  {levels:>6}  {rules:>5}"))?;
    }
    let mutants = counted(set.mutants.len() as u64, "mutant");
    print_line(format!("{mutants}, {}", counted(sound, "sound level")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_no_score_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("score.json");
        std::fs::write(&path, "{}").expect("writable");
        let args = TableArgs { scores: vec![path], out: None, json: false };
        let error = run_table(args).map(drop).expect_err("no score");
        assert!(error.to_string().contains("score.json: line 1: "), "{error}");
        assert_eq!(error.exit_code(), 3);
    }

    #[test]
    fn levels_are_named_for_a_game() {
        let levels: LevelsOf = "maze=random+size=9x9:5..9".parse().expect("levels of a game");
        assert_eq!((levels.game.as_str(), levels.levels.to_string().as_str()), ("maze", "random+size=9x9:5..9"));
        for wrong in ["hard:0..9", "=hard:0..9", "runner=hard"] {
            assert!(wrong.parse::<LevelsOf>().is_err(), "{wrong}");
        }
    }
}
