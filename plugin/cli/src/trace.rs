//! `playbot trace`.

use std::path::PathBuf;

use playbot_lab::{
    games::Games,
    inspect::{InspectError, TraceRequest},
    trace::trace_actions,
};

use crate::error::{CliError, Outcome, print_line};

/// Plays given actions and prints the state after each.
///
/// coinrun: `[x, y, vx, vy, reward, done]`, in tiles and tiles per step; stops at the end of the episode or of the actions.
/// maze2d: `[x, y, vx, vy]`, in metres and metres per second; stops at the end of the actions.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot trace coinrun --mode hard --seed 2 --actions 7,7,7,7,8,7 --json
  playbot trace coinrun --mode hard --seed 2 --actions-file actions.txt
  playbot trace maze2d --map medium --start 1,1,0,0 --actions-file pushes.txt --json
  playbot trace maze2d --map large+contact=rapier --seed 3 --actions-file pushes.txt")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game; of a maze its map, with options. Without it hard, or medium.
    #[arg(long, visible_alias = "map")]
    mode: Option<String>,
    /// Seed of the level.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// coinrun: actions, separated by commas.
    #[arg(long, value_delimiter = ',', conflicts_with = "actions_file")]
    actions: Vec<u32>,
    /// coinrun: file of actions, separated by commas, spaces or line ends. maze2d: one push `ux uy` a line.
    #[arg(long, value_name = "FILE", required_unless_present = "actions")]
    actions_file: Option<PathBuf>,
    /// maze2d: where the ball starts and how fast, instead of where the level says.
    #[arg(long, value_name = "X,Y,VX,VY", value_delimiter = ',', allow_hyphen_values = true)]
    start: Vec<f64>,
    /// One line of JSON per step; without it a table.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let request = TraceRequest {
        mode: args.mode.as_deref(),
        seed: args.seed,
        start: &args.start,
        actions: &args.actions,
        file: args.actions_file.as_deref(),
        json: args.json,
    };
    let mut failed = None;
    let mut print = |line: String| {
        print_line(line).map_err(|error| {
            failed = Some(error);
            InspectError::Closed
        })
    };
    let traced = match game.trace(&request, &mut print) {
        Some(traced) => traced,
        None => trace_actions(game, &request, &mut print).map(|()| None),
    };
    match (failed, traced) {
        (Some(error), _) => Err(error),
        (None, Err(error)) => Err(error.into()),
        (None, Ok(note)) => {
            if let Some(note) = note {
                tell!("{note}");
            }
            Ok(Outcome::Pass)
        }
    }
}
