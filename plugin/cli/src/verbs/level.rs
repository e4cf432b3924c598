//! `playbot level`.

use crate::{
    arguments::{LevelsArg, default_mode, experiment::quoted},
    error::{CliError, Outcome},
    output::{prepare_new, print_or_replace, program},
    pictures::{plot, plot::PlotFile},
};
use playbot_harness::{
    game::Game,
    games::Games,
    inspect::{InspectError, LevelRequest, LevelView},
    level_files::is_level_files,
};
use playbot_learner::ActionSpace;
use std::path::PathBuf;

/// Show a level: its layout, or what is known of it without playing it.
///
/// A game that is adapted with `ForeignGame` shows names and cells of its level editor, the plan that it declares, and the
/// content of level files.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot level GAME --mode MODE --level 7
  playbot level GAME --levels MODE:7
  playbot level GAME --levels files:levels/a.json
  playbot level GAME --level 0 --json --out my-level.json
  playbot level GAME --level 7 --png level.png
  playbot level GAME --file my-level.json
  playbot level GAME --file -
  playbot level antmaze --map large
  playbot level maze2d --mode medium --level 7 --json
  playbot level maze2d --map random+size=21x21+loops=0.2 --level 7
  playbot level antmaze --mode medium+goals=random+random-start --level 7
  playbot level maze2d --map my-maze.txt --png my-maze.png

A file of rows is a map as this command prints it. # is a wall, S the start, and G the goal. A blank, a point or O is a
free cell. The rows end at the first empty line.")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game (default: the one that `train` trains in).
    #[arg(long)]
    mode: Option<String>,
    /// Map, for games whose levels are maps. It is a name, with options where it takes any, or a file of rows (- for
    /// standard input). --mode also takes the start and goal of the level.
    #[arg(long, value_name = "MAP", conflicts_with_all = ["mode", "levels"])]
    map: Option<String>,
    /// Level file to show, in the game's own format, or - for standard input. Games that draw levels themselves take what
    /// --json prints.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["mode", "levels", "map", "level", "seed"])]
    file: Option<PathBuf>,
    #[command(flatten)]
    levels: LevelsArg,
    /// Old spelling of --level.
    #[arg(long, hide = true, conflicts_with = "level")]
    seed: Option<u64>,
    /// Print one line of JSON instead of a picture.
    #[arg(long)]
    json: bool,
    /// File to write it to instead of standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite an existing file.
    #[arg(long, requires = "out")]
    force: bool,
    /// Also draw the whole level into this .png (maps also into a .svg).
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    args.out.as_deref().map(|out| prepare_new(out, args.force)).transpose()?;
    let file = args.png.as_deref().map(PlotFile::new).transpose()?;
    let level = show(game, &args, file.is_some())?;
    if let (Some(file), Some(picture)) = (file, &level.picture) {
        plot::write(&file, picture, game.tick_hz())?;
        report!("picture: {}", file.path().display());
    }
    print_or_replace(if args.json { &level.json } else { &level.text }, args.out.as_deref())?;
    if level.lacks_plan {
        instead(game, &args).iter().for_each(|advice| report!("{advice}"));
    }
    Ok(Outcome::Pass)
}

/// Returns the commands that show a level without a plan. A level from standard input cannot be named in them.
fn instead(game: &dyn Game, args: &Args) -> Option<String> {
    let level = match (&args.file, &args.mode) {
        (Some(file), _) if file.as_os_str() == "-" => return None,
        (Some(file), _) => format!("--levels {}", quoted(&format!("files:{}", file.display()))),
        (None, mode) => {
            let (named, level) = args.levels.choose(game, mode.as_deref(), args.seed).ok()?;
            match named {
                Some(mode) if is_level_files(mode) => format!("--levels {} --level {level}", quoted(mode)),
                Some(mode) => format!("--mode {mode} --level {level}"),
                None => format!("--level {level}"),
            }
        }
    };
    let command = |verb: &str| format!("`{} {verb} {} {level}", program::name(), game.name());
    let trace = match game.actions() {
        ActionSpace::Discrete(_) => format!(", {} --actions 0` prints its state in each tick", command("trace")),
        ActionSpace::Continuous(_) | ActionSpace::Mixed(_) => String::new(),
    };
    let (view, play) = (command("view"), command("play"));
    Some(format!("without a plan: {view}` shows what bots observe there{trace}, and {play}` plays it in a window"))
}

/// Shows the requested level. Without a mode and a map it is one of the default mode.
fn show(game: &dyn Game, args: &Args, picture: bool) -> Result<LevelView, CliError> {
    let (map, file) = (args.map.as_deref(), args.file.as_deref());
    let show = |request: &LevelRequest| game.show_level(request).map_err(|error| explain(game, error));
    if map.is_some() || file.is_some() {
        return show(&LevelRequest { mode: None, map, file, level: args.levels.number(args.seed), picture });
    }
    let (named, level) = args.levels.choose(game, args.mode.as_deref(), args.seed)?;
    let mode = named.unwrap_or_else(|| default_mode(game));
    let shown = show(&LevelRequest { mode: Some(mode), map, file, level: Some(level), picture })?;
    if named.is_none() {
        report!("no --mode is named: level {level} of {mode}, the mode that `train` trains in");
    }
    Ok(shown)
}

/// Returns true if a game can show levels: its own default level is tried.
pub(crate) fn shows_levels(game: &dyn Game) -> bool {
    game.show_level(&LevelRequest::default()).is_ok()
}

/// Explains an error of showing a level. For a game that can show none, it names the verbs that can.
fn explain(game: &dyn Game, error: InspectError) -> CliError {
    match error {
        InspectError::Usage(why) if !shows_levels(game) => {
            CliError::Usage(format!("{why}; `playbot view {} --level N` shows the observation in a level", game.name()))
        }
        error => error.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::{
        app::App,
        input::keyboard::KeyCode,
        math::{Rect, Vec2},
    };
    use clap::Parser;
    use playbot_harness::{floor_plan::FloorPlan, foreign::ForeignGame};

    #[derive(Parser)]
    struct Called {
        #[command(flatten)]
        args: Args,
    }

    #[test]
    fn a_level_without_a_plan_is_followed_by_commands_that_show_it() {
        let bare = ForeignGame::new("cards", 1, |_: &mut App| {}).keys([vec![], vec![KeyCode::Space]]).modes(&["calm"]);
        let args = |more: &[&str]| Called::parse_from([&["level", "cards"], more].concat()).args;
        let shown = |game: &ForeignGame, level| {
            let request = LevelRequest { mode: Some("calm"), level: Some(level), ..LevelRequest::default() };
            game.show_level(&request).expect("a level")
        };
        assert!(shown(&bare, 3).lacks_plan);
        let plan = FloorPlan { bounds: Rect::new(0.0, 0.0, 2.0, 1.0), goal: Vec2::X, ..FloorPlan::default() };
        assert!(!shown(&bare.clone().plan(move |_| plan.clone()), 3).lacks_plan);
        let words = instead(&bare, &args(&["--level", "3"])).expect("commands");
        for part in
            ["view cards --level 3` shows", "trace cards --level 3 --actions 0` prints", "play cards --level 3` plays"]
        {
            assert!(words.contains(part), "{words}");
        }
        let words = instead(&bare, &args(&["--level", "3", "--mode", "calm"])).expect("commands");
        assert!(words.contains("view cards --mode calm --level 3`"), "{words}");
        let words = instead(&bare, &args(&["--file", "a b.txt"])).expect("commands");
        assert!(words.contains("view cards --levels 'files:a b.txt'`"), "{words}");
        assert_eq!(instead(&bare, &args(&["--file", "-"])), None);
    }
}
