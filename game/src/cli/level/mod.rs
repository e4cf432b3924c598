//! `playbot level`.

mod coinrun;
mod maze;

use std::path::PathBuf;

use super::error::{CliError, Outcome};
use crate::registry;

/// Shows the layout of a level.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot level coinrun --mode hard --seed 7
  playbot level coinrun --mode easy --seed 0 --json
  playbot level coinrun --seed 7 --png level.png
  playbot level antmaze --map large
  playbot level maze2d --seed 7 --json
  playbot level maze2d --map random+size=21x21+loops=0.2 --seed 7
  playbot level maze2d --map my-maze.txt --png my-maze.png")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of CoinRun; hard if none is named.
    #[arg(long)]
    mode: Option<String>,
    /// Map of a maze: umaze, medium, large, xl, random with its options, or a file of rows; random if none is named.
    #[arg(long, value_name = "MAP", conflicts_with = "mode")]
    map: Option<String>,
    /// Seed of the level; 0 if none is named.
    #[arg(long)]
    seed: Option<u64>,
    /// Print one line of JSON instead of a picture.
    #[arg(long)]
    json: bool,
    /// Also draw the whole level into this .png; mazes into a .svg too.
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
}

pub fn run(args: Args) -> Result<Outcome, CliError> {
    match args.game.as_str() {
        "coinrun" => coinrun::show(&args),
        "maze2d" | "maze2d-sighted" | "antmaze" | "antmaze-sighted" => maze::show(&args),
        other => {
            let game = registry::game(other)?;
            Err(CliError::Usage(format!("`{}` has no levels to show", game.name())))
        }
    }
}
