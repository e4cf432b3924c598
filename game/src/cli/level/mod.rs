//! `playbot level`.

mod coinrun;
mod maze;

use std::path::PathBuf;

use super::error::{CliError, Outcome};
use crate::registry;
use maze::MazeGame;

/// Shows the layout of a level.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot level coinrun --mode hard --seed 7
  playbot level coinrun --mode easy --seed 0 --json
  playbot level coinrun --seed 7 --png level.png
  playbot level antmaze --map large
  playbot level maze2d --seed 7 --json
  playbot level maze2d --map random+size=21x21+loops=0.2 --seed 7
  playbot level antmaze --map medium+goals=random+random-start --seed 7
  playbot level maze2d --map my-maze.txt --png my-maze.png

A file of rows is a maze as this command prints it: # is a wall, S the start, G the goal, a blank, a point or O a free cell;
the rows end at the first empty line.")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of CoinRun; hard if none is named.
    #[arg(long)]
    mode: Option<String>,
    /// Map of a maze: umaze, medium, large, xl, random with its options, a whole mode of the game such as medium+sparse,
    /// with the start and goal that it draws for the seed, or a file of rows; random if none is named.
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
    let name = registry::game(&args.game)?.name();
    match (name, MazeGame::named(name)) {
        ("coinrun", _) => coinrun::show(&args),
        (_, Some(mazes)) => maze::show(&args, &mazes),
        _ => Err(CliError::Usage(format!("`{name}` has no levels to show"))),
    }
}
