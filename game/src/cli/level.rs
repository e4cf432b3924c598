//! `playbot level`.

use bevy_playbot::game::check_mode;
use serde_json::json;

use super::error::{CliError, Outcome, print_line};
use crate::{
    coinrun::{Mode, generate},
    registry,
};

/// Shows the layout of a level.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  playbot level coinrun --mode hard --seed 7\n  playbot level coinrun --mode easy --seed 0 --json"
)]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game.
    #[arg(long, default_value = "hard")]
    mode: String,
    /// Seed of the level.
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Print one line of JSON instead of a picture.
    #[arg(long)]
    json: bool,
}

const LEGEND: &str =
    "A start  C coin  # = ground  ~ ^ lava  S saw  < > enemy and where it goes  x crate  | enemies turn here";

pub fn run(args: Args) -> Result<Outcome, CliError> {
    let game = registry::game(&args.game)?;
    check_mode(game, &args.mode)?;
    let mode: Mode = args.mode.parse().map_err(|error| CliError::Usage(format!("{error}")))?;
    let level = generate(mode, args.seed);
    if args.json {
        print_line(json!(level.to_golden_json()))?;
    } else {
        print_line(level.to_text())?;
        print_line(LEGEND)?;
    }
    Ok(Outcome::Pass)
}
