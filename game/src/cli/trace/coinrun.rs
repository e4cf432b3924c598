//! Tracing CoinRun.

use bevy::prelude::*;
use bevy_playbot::{action::misfit, game::build_world, prelude::*};

use super::{Args, plain, read};
use crate::{
    cli::error::{CliError, Outcome, print_line},
    coinrun::components::PlayerBody,
    registry,
};

pub(super) fn run(args: Args) -> Result<Outcome, CliError> {
    let game = registry::game(&args.game)?;
    let mode = args.mode.as_deref().unwrap_or("hard");
    game.check_mode(mode)?;
    if !args.start.is_empty() {
        return Err(CliError::Usage(
            "--start is for maze2d: a level of coinrun says where the player starts".to_owned(),
        ));
    }
    let actions = read_actions(&args)?;
    let space = game.actions();
    if let Some(why) = actions.iter().find_map(|&action| misfit(&ActionValue::Discrete(action), &space)) {
        return Err(CliError::Usage(why));
    }
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Human, LevelQueue::Always(args.seed)));
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

fn read_actions(args: &Args) -> Result<Vec<u32>, CliError> {
    let Some(path) = &args.actions_file else { return Ok(args.actions.clone()) };
    let text = read(path)?;
    let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
    words
        .map(|word| {
            word.parse().map_err(|_| {
                CliError::Usage(format!("{}: `{word}` is not an action; write numbers from 0", path.display()))
            })
        })
        .collect()
}
