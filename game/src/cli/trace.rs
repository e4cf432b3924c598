//! `playbot trace`.

use std::path::PathBuf;

use bevy::prelude::*;
use bevy_playbot::{action::misfit, game::build_world, prelude::*};

use super::error::{CliError, Outcome, print_line};
use crate::{coinrun::components::PlayerBody, registry};

/// Plays given actions and prints the state after each: `[x, y, vx, vy, reward, done]`, in tiles and tiles per step.
///
/// Stops at the end of the episode or of the actions.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot trace coinrun --mode hard --seed 2 --actions 7,7,7,7,8,7 --json
  playbot trace coinrun --mode hard --seed 2 --actions-file actions.txt")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game.
    #[arg(long, default_value = "hard")]
    mode: String,
    /// Seed of the level.
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Actions, separated by commas.
    #[arg(long, value_delimiter = ',', required_unless_present = "actions_file", conflicts_with = "actions_file")]
    actions: Vec<u32>,
    /// File of actions, separated by commas, spaces or line ends.
    #[arg(long)]
    actions_file: Option<PathBuf>,
    /// One line of JSON per step; without it a table.
    #[arg(long)]
    json: bool,
}

pub fn run(args: Args) -> Result<Outcome, CliError> {
    let game = registry::game(&args.game)?;
    game.check_mode(&args.mode)?;
    let actions = read_actions(&args)?;
    let space = game.actions();
    if let Some(why) = actions.iter().find_map(|&action| misfit(&ActionValue::Discrete(action), &space)) {
        return Err(CliError::Usage(why));
    }
    let (mut world, agents) = build_world(game, &args.mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Human, LevelQueue::Always(args.seed.into())));
    if !args.json {
        print_line(format!("{:>5} {:>12} {:>12} {:>12} {:>12} {:>6} done", "step", "x", "y", "vx", "vy", "reward"))?;
    }
    for (step, action) in actions.into_iter().enumerate() {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(action)));
        world.tick()?;
        let body = world.get::<PlayerBody>(agent).map(|body| body.0).unwrap_or_default();
        let reward = world.get::<Reward>(agent).map_or(0.0, Reward::get);
        let done = world.get::<Episode>(agent).is_none_or(|episode| !episode.is_running());
        let state = [body.x, body.y, body.vx, body.vy, reward].map(plain);
        if args.json {
            print_line(format!("[{},{}]", state.join(","), u8::from(done)))?;
        } else {
            let [x, y, vx, vy, reward] = state;
            print_line(format!("{:>5} {x:>12} {y:>12} {vx:>12} {vy:>12} {reward:>6} {done}", step + 1))?;
        }
        if done {
            break;
        }
    }
    Ok(Outcome::Pass)
}

/// The shortest decimal that reads back as the same number; whole numbers without a point, and no negative zero.
fn plain(value: f32) -> String {
    format!("{}", value + 0.0)
}

fn read_actions(args: &Args) -> Result<Vec<u32>, CliError> {
    let Some(path) = &args.actions_file else { return Ok(args.actions.clone()) };
    let text = std::fs::read_to_string(path)
        .map_err(|error| CliError::Usage(format!("cannot read {}: {error}", path.display())))?;
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    words
        .map(|word| {
            word.parse().map_err(|_| {
                CliError::Usage(format!("{}: `{word}` is not an action; write numbers from 0", path.display()))
            })
        })
        .collect()
}
