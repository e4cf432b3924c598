//! Looking at single levels and at single steps: what a game can show of itself.

use std::path::Path;

use bevy::prelude::*;
use bevy_playbot::{
    action::misfit,
    fault::Fault,
    prelude::*,
    unknown_name::UnknownName,
    vision::{ImageOptions, VisionError},
};
use thiserror::Error;

use crate::{game::Game, mode::ModeError, report::Drawing, worlds::build_world};

/// The game cannot show that.
#[derive(Debug, Error)]
pub enum InspectError {
    /// What was asked for does not exist, in words that say what to do.
    #[error("{0}")]
    Usage(String),
    /// There is no such name.
    #[error(transparent)]
    Name(#[from] UnknownName),
    /// There is no such mode.
    #[error(transparent)]
    Mode(#[from] ModeError),
    /// The game broke its contract.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The picture cannot be made.
    #[error(transparent)]
    Vision(#[from] VisionError),
    /// Nobody takes the lines any more.
    #[error("nobody reads the output")]
    Closed,
}

/// Which level is to be shown.
#[derive(Clone, Copy, Debug, Default)]
pub struct LevelRequest<'a> {
    /// Mode, if one is named.
    pub mode: Option<&'a str>,
    /// Map, for games whose levels are maps: a name, a whole mode, or a file.
    pub map: Option<&'a str>,
    /// Seed, if one is named.
    pub seed: Option<u64>,
    /// Whether a picture is wanted too.
    pub picture: bool,
}

/// A level for people and programs.
#[derive(Clone, Debug)]
pub struct LevelView {
    /// Lines for people.
    pub text: String,
    /// One line of JSON.
    pub json: String,
    /// The whole level, if it was asked for.
    pub picture: Option<LevelPicture>,
}

/// A whole level as a picture.
#[derive(Clone, Debug)]
pub enum LevelPicture {
    /// Pixels, as an agent would see them that sees all of it:
    /// [`Observation::image`](bevy_playbot::observation::Observation::image).
    Pixels {
        /// Form of the image.
        image: ImageOptions,
        /// Its values.
        pixels: Vec<u8>,
    },
    /// Lines and areas.
    Drawing(Drawing),
}

/// Which actions are to be played, and where.
#[derive(Clone, Copy, Debug, Default)]
pub struct TraceRequest<'a> {
    /// Mode; the game's last one if none is named.
    pub mode: Option<&'a str>,
    /// Seed of the level.
    pub seed: u64,
    /// Where to start instead of where the level says; empty for there.
    pub start: &'a [f64],
    /// Discrete actions.
    pub actions: &'a [u32],
    /// File of actions, instead.
    pub file: Option<&'a Path>,
    /// One line of JSON per step; else a table.
    pub json: bool,
}

/// Takes one line of output.
pub type Print<'a> = &'a mut dyn FnMut(String) -> Result<(), InspectError>;

/// Plays given discrete actions and prints the columns of [`Game::trace_row`], the reward and whether the episode ended.
///
/// # Errors
///
/// The actions are not the game's, or it broke its contract.
pub fn trace_actions(game: &dyn Game, request: &TraceRequest, print: Print) -> Result<(), InspectError> {
    let mode = request.mode.or(game.modes().last().copied()).unwrap_or_default();
    game.check_mode(mode)?;
    if !request.start.is_empty() {
        return Err(InspectError::Usage(format!("--start is not for {}: its levels say where to start", game.name())));
    }
    let actions = read_actions(game, request)?;
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Replay, LevelQueue::Always(request.seed)));
    let columns = game.trace_columns();
    if !request.json {
        let names: String = columns.iter().map(|name| format!(" {name:>12}")).collect();
        print(format!("{:>5}{names} {:>6} done", "step", "reward"))?;
    }
    for (step, action) in actions.into_iter().enumerate() {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(action)));
        world.tick()?;
        let row: Vec<_> = game.trace_row(&world, agent).into_iter().map(plain).collect();
        let reward = plain(world.get::<Reward>(agent).map_or(0.0, Reward::get));
        let done = world.get::<Episode>(agent).is_none_or(|episode| !episode.is_running());
        if request.json {
            print(format!("[{},{reward},{}]", row.join(","), u8::from(done)))?;
        } else {
            let values: String = row.iter().map(|value| format!(" {value:>12}")).collect();
            print(format!("{:>5}{values} {reward:>6} {done}", step + 1))?;
        }
        if done {
            break;
        }
    }
    Ok(())
}

fn read_actions(game: &dyn Game, request: &TraceRequest) -> Result<Vec<u32>, InspectError> {
    let space = game.actions();
    if matches!(space, ActionSpace::Continuous(_)) {
        return Err(InspectError::Usage(format!("`{}` has continuous actions, which cannot be traced", game.name())));
    }
    let actions = match request.file {
        None => request.actions.to_vec(),
        Some(path) => {
            let text = read_text(path)?;
            let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
            let parsed: Result<Vec<u32>, _> =
                words.map(|word| word.parse().map_err(|_| no_action(path, word))).collect();
            parsed?
        }
    };
    match actions.iter().find_map(|&action| misfit(&ActionValue::Discrete(action), &space)) {
        Some(why) => Err(InspectError::Usage(why)),
        None => Ok(actions),
    }
}

fn no_action(path: &Path, word: &str) -> InspectError {
    InspectError::Usage(format!("{}: `{word}` is not an action; write numbers from 0", path.display()))
}

/// The text of a file.
///
/// # Errors
///
/// It cannot be read.
pub fn read_text(path: &Path) -> Result<String, InspectError> {
    let read = std::fs::read_to_string(path);
    read.map_err(|error| InspectError::Usage(format!("cannot read {}: {error}", path.display())))
}

/// The shortest decimal that reads back as the same number; whole numbers without a point, and no negative zero.
pub fn plain<T: std::fmt::Display + std::ops::Add<Output = T> + Default>(value: T) -> String {
    format!("{}", value + T::default())
}
