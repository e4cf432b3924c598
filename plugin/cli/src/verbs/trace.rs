//! `playbot trace`.

use crate::{
    arguments::{LevelsArg, check_start},
    error::{CliError, Outcome},
    output::print_line,
};
use clap::ArgGroup;
use playbot_harness::{
    game::Game,
    games::Games,
    inspect::{InspectError, TraceRequest},
    trace::{action_number, trace_actions},
};
use playbot_learner::ActionSpace;
use std::path::PathBuf;

/// Play given actions and print the state after each.
///
/// A line holds the numbers by which the game describes its state, which the head of the table names. Most games add
/// the reward and whether the episode is over. It stops at the end of the episode or of the actions.
#[derive(clap::Args)]
#[command(group(ArgGroup::new("given").args(["actions", "actions_file"]).required(true)))]
#[command(after_help = "Examples:
  playbot trace GAME --level 2 --actions 0,0,0,0 --json
  playbot trace GAME --mode MODE --level 2 --actions-file actions.txt
  playbot trace GAME --levels files:my-level.json --actions-file actions.txt
  playbot trace maze2d --map medium --start 1,1,0,0 --actions-file pushes.txt --json
  playbot trace maze2d --map large+contact=rapier --level 3 --actions-file pushes.txt")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game, or its map where levels are maps (default: the game's last mode or its own choice).
    #[arg(long, visible_alias = "map")]
    mode: Option<String>,
    #[command(flatten)]
    levels: LevelsArg,
    /// Old spelling of --level.
    #[arg(long, hide = true, conflicts_with = "level")]
    seed: Option<u64>,
    /// Discrete actions: their numbers, from 0, or their names, separated by commas.
    #[arg(long, value_delimiter = ',')]
    actions: Vec<String>,
    /// File of actions, or - for standard input. Discrete ones are numbers or names, separated by commas, spaces or line
    /// ends. Continuous ones, in games that can trace them, are one action per line, with values separated by spaces.
    #[arg(long, value_name = "FILE")]
    actions_file: Option<PathBuf>,
    /// Position and velocity to start with instead of the level's, in games that can start anywhere.
    #[arg(long, value_name = "X,Y,VX,VY", value_delimiter = ',', allow_hyphen_values = true)]
    start: Vec<f64>,
    /// One line of JSON per step instead of a table.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let (mode, level) = args.levels.choose(game, args.mode.as_deref(), args.seed)?;
    let actions = read_actions(game, &args.actions)?;
    let request = TraceRequest {
        mode,
        level,
        start: &args.start,
        actions: &actions,
        file: args.actions_file.as_deref(),
        json: args.json,
    };
    check_start(game, mode.or(game.modes().last().copied()).unwrap_or_default(), level)?;
    let mut failed = None;
    let mut print = |line: String| {
        print_line(line).map_err(|error| {
            failed = Some(error);
            InspectError::Closed
        })
    };
    let traced = match game.tools().trace.run(&request, &mut print) {
        Some(traced) => traced,
        None => trace_actions(game, &request, &mut print).map(|()| None),
    };
    match (failed, traced) {
        (Some(error), _) => Err(error),
        (None, Err(error)) => Err(error.into()),
        (None, Ok(note)) => {
            if let Some(note) = note {
                report!("{note}");
            }
            Ok(Outcome::Pass)
        }
    }
}

/// Returns the numbers of discrete actions. A game with other ones refuses them itself.
fn read_actions(game: &dyn Game, words: &[String]) -> Result<Vec<u32>, CliError> {
    if !matches!(game.actions(), ActionSpace::Discrete(_)) {
        return Ok(Vec::new());
    }
    let numbers: Result<Vec<u32>, String> = words.iter().map(|word| action_number(game, word.trim())).collect();
    numbers.map_err(|why| CliError::Usage(format!("--actions: {why}")))
}
