//! `playbot level`.

use std::path::{Path, PathBuf};

use playbot_lab::{
    game::Game,
    games::Games,
    inspect::{InspectError, LevelPicture, LevelRequest, LevelView},
};

use crate::{
    defaults::usual_mode,
    error::{CliError, Outcome, print_line},
    output,
    plot::PlotFile,
    view::film::Film,
};

/// Show the layout of a level.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot level GAME --mode MODE --seed 7
  playbot level GAME --seed 0 --json
  playbot level GAME --seed 7 --png level.png
  playbot level GAME --file my-level.json
  playbot level antmaze --map large
  playbot level maze2d --seed 7 --json
  playbot level maze2d --map random+size=21x21+loops=0.2 --seed 7
  playbot level antmaze --map medium+goals=random+random-start --seed 7
  playbot level maze2d --map my-maze.txt --png my-maze.png

A file of rows is a map as this command prints it: # is a wall, S the start, G the goal, a blank, a point or O a free cell;
the rows end at the first empty line.")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game; the one that `train` trains in if none is named.
    #[arg(long)]
    mode: Option<String>,
    /// Map, for games whose levels are maps: its name, with options where it takes any, a whole mode of the game, with the
    /// start and goal that it draws for the seed, or a file of rows; if none is named, the game chooses.
    #[arg(long, value_name = "MAP", conflicts_with = "mode")]
    map: Option<String>,
    /// Level file to show, in the form that --json prints.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["mode", "map", "seed"])]
    file: Option<PathBuf>,
    /// Seed of the level; 0 if none is named.
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
    let file = args.png.as_deref().map(|path| PlotFile::new(path).map(|file| (path, file))).transpose()?;
    let level = show(game, &args, file.is_some()).map_err(|error| explain(game, error))?;
    if let (Some((path, file)), Some(picture)) = (file, &level.picture) {
        write(path, &file, picture, game.tick_hz())?;
        tell!("picture: {}", path.display());
    }
    print_line(if args.json { level.json } else { level.text })?;
    Ok(Outcome::Pass)
}

/// The level that is asked for. Where neither a mode nor a map is named it is one of the usual mode; games whose levels are
/// maps take no mode, and choose a map themselves.
fn show(game: &dyn Game, args: &Args, picture: bool) -> Result<LevelView, InspectError> {
    let (mode, map) = (args.mode.as_deref(), args.map.as_deref());
    let request = LevelRequest { mode, map, file: args.file.as_deref(), seed: args.seed, picture };
    if mode.is_some() || map.is_some() || args.file.is_some() {
        return game.show_level(&request);
    }
    let (mode, seed) = (usual_mode(game), args.seed.unwrap_or(0));
    match game.show_level(&LevelRequest { mode: Some(mode), ..request }) {
        Err(InspectError::Usage(_)) => {
            let level = game.show_level(&request)?;
            tell!("no --map is named: one that the game chooses, level {seed}; it is trained in --map {mode}");
            Ok(level)
        }
        level => {
            if level.is_ok() {
                tell!("no --mode is named: {mode}, which is trained in, level {seed}");
            }
            level
        }
    }
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

fn write(path: &Path, file: &PlotFile, picture: &LevelPicture, tick_hz: f64) -> Result<(), CliError> {
    match picture {
        LevelPicture::Drawing(drawing) => file.write(drawing),
        LevelPicture::Pixels { image, pixels } => {
            output::png(&path.to_string_lossy())
                .map_err(|why| CliError::Usage(format!("{}: {why}", path.display())))?;
            output::write(path, &Film::new(*image, 1, tick_hz)?.still(pixels)?.0)
        }
    }
}
