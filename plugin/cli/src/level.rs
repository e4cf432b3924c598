//! `playbot level`.

use std::path::PathBuf;

use playbot_lab::{
    game::Game,
    games::Games,
    inspect::{InspectError, LevelRequest, LevelView},
};

use crate::{
    defaults::usual_mode,
    error::{CliError, Outcome, print_line},
    level_picture,
    one_level::LevelsArg,
    plot::PlotFile,
};

/// Show the layout of a level.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot level GAME --mode MODE --seed 7
  playbot level GAME --levels MODE:7
  playbot level GAME --seed 0 --json
  playbot level GAME --seed 7 --png level.png
  playbot level GAME --file my-level.json
  playbot level antmaze --map large
  playbot level maze2d --mode medium --seed 7 --json
  playbot level maze2d --map random+size=21x21+loops=0.2 --seed 7
  playbot level antmaze --mode medium+goals=random+random-start --seed 7
  playbot level maze2d --map my-maze.txt --png my-maze.png

A file of rows is a map as this command prints it: # is a wall, S the start, G the goal, a blank, a point or O a free cell;
the rows end at the first empty line.")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game; the one that `train` trains in if none is named.
    #[arg(long)]
    mode: Option<String>,
    /// Map, for games whose levels are maps: its name, with options where it takes any, or a file of rows. --mode has the
    /// start and goal that the level of the seed has, too.
    #[arg(long, value_name = "MAP", conflicts_with_all = ["mode", "levels"])]
    map: Option<String>,
    /// Level file to show, in the form that --json prints.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["mode", "levels", "map", "seed"])]
    file: Option<PathBuf>,
    #[command(flatten)]
    levels: LevelsArg,
    /// Seed of the level; 0, or the first of the levels, if none is named.
    #[arg(long)]
    seed: Option<u64>,
    /// Print one line of JSON instead of a picture.
    #[arg(long)]
    json: bool,
    /// Also draw the whole level into this .png; maps into a .svg too.
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let file = args.png.as_deref().map(PlotFile::new).transpose()?;
    let level = show(game, &args, file.is_some())?;
    if let (Some(file), Some(picture)) = (file, &level.picture) {
        level_picture::write(&file, picture, game.tick_hz())?;
        tell!("picture: {}", file.path().display());
    }
    print_line(if args.json { level.json } else { level.text })?;
    Ok(Outcome::Pass)
}

/// The level that is asked for. Where neither a mode nor a map is named it is one of the usual mode.
fn show(game: &dyn Game, args: &Args, picture: bool) -> Result<LevelView, CliError> {
    let (map, file) = (args.map.as_deref(), args.file.as_deref());
    let show = |request: &LevelRequest| game.show_level(request).map_err(|error| explain(game, error));
    if map.is_some() || file.is_some() {
        return show(&LevelRequest { mode: None, map, file, seed: args.seed, picture });
    }
    let (named, seed) = args.levels.choose(game, args.mode.as_deref(), args.seed)?;
    let mode = named.unwrap_or_else(|| usual_mode(game));
    let level = show(&LevelRequest { mode: Some(mode), map, file, seed: Some(seed), picture })?;
    if named.is_none() {
        tell!("no --mode is named: {mode}, which is trained in, level {seed}");
    }
    Ok(level)
}

/// Whether a game can show levels: it is asked for the one that it chooses itself.
pub fn shows_levels(game: &dyn Game) -> bool {
    game.show_level(&LevelRequest::default()).is_ok()
}

/// An error of showing a level; of a game that can show none at all, with what can be looked at instead.
fn explain(game: &dyn Game, error: InspectError) -> CliError {
    match error {
        InspectError::Usage(why) if !shows_levels(game) => {
            CliError::Usage(format!("{why}; `playbot view {} --seed N` shows what a bot sees of one", game.name()))
        }
        error => error.into(),
    }
}
