//! Traces: play of given actions, printed tick by tick.

use crate::{
    game::Game,
    inspect::{InspectError, Print, TraceRequest, plain, read_text},
    level_files::read::shown_path,
    worlds::build_world,
};
use bevy_playbot::{engine::misfit, prelude::*};

/// Plays given discrete actions and prints the columns of [`TraceTools::row`](crate::game::TraceTools::row), the
/// reward and whether the episode ended.
///
/// # Errors
///
/// The actions are not the game's, or it broke its contract.
pub fn trace_actions(game: &dyn Game, request: &TraceRequest, print: Print) -> Result<(), InspectError> {
    let mode = request.mode.or(game.modes().last().copied()).unwrap_or_default();
    game.check_mode(mode)?;
    if !request.start.is_empty() {
        return Err(InspectError::Usage(format!(
            "--start does not apply to {}: its levels have fixed starts",
            game.name()
        )));
    }
    let actions = read_actions(game, request)?;
    let (mut world, agents) = build_world(game, mode, 0, 0, 1);
    let agent = agents[0];
    world.entity_mut(agent).insert((Control::Replay, LevelQueue::Always(request.level)));
    let columns = game.tools().trace.columns().unwrap_or_else(|| game.observation().names);
    if !request.json {
        let names: String = columns.iter().map(|name| format!(" {name:>12}")).collect();
        print(format!("{:>5}{names} {:>6} done", "step", "reward"))?;
    }
    for (step, action) in actions.into_iter().enumerate() {
        world.entity_mut(agent).insert(Action(ActionValue::Discrete(action)));
        world.tick()?;
        let row: Vec<_> = game.tools().trace.row(&world, agent).into_iter().map(plain).collect();
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
        return Err(InspectError::Usage(format!(
            "`{0}` has continuous actions, which cannot be traced: watch a level with `playbot view {0} --episode`",
            game.name()
        )));
    }
    let actions = match request.file {
        None => request.actions.to_vec(),
        Some(path) => {
            let text = read_text(path).map_err(|error| InspectError::Usage(format!("{error}; {HOW}")))?;
            let words = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
            let parsed: Result<Vec<u32>, _> = words.map(|word| action_number(game, word)).collect();
            let parsed = parsed.map_err(|why| InspectError::Usage(format!("{}: {why}", shown_path(path))))?;
            if parsed.is_empty() {
                return Err(InspectError::Usage(format!("{} has no actions; {HOW}", shown_path(path))));
            }
            parsed
        }
    };
    let from = request.file.map_or("--actions".to_owned(), shown_path);
    match actions.iter().find_map(|&action| misfit(&ActionValue::Discrete(action), &space)) {
        Some(why) => Err(InspectError::Usage(format!("{from}: {why}, the actions of `{}`", game.name()))),
        None => Ok(actions),
    }
}

/// Hint for the form of actions.
const HOW: &str = "give actions with --actions 0,1,2, or with --actions-file and a file of such numbers";

/// Returns the number of a discrete action that is given by its number or by its name, in small or capital letters.
///
/// # Errors
///
/// It is neither: the message names the actions.
pub fn action_number(game: &dyn Game, word: &str) -> Result<u32, String> {
    if let Ok(number) = word.parse() {
        return Ok(number);
    }
    let names = game.tools().input.action_names();
    if let Some(number) = names.iter().position(|name| name.eq_ignore_ascii_case(word)) {
        return Ok(number as u32);
    }
    let known = if names.is_empty() { String::new() } else { format!(", or the names {}", names.join(", ")) };
    let last = match game.actions() {
        ActionSpace::Discrete(actions) if actions > 0 => format!(" to {}", actions - 1),
        _ => String::new(),
    };
    Err(format!("`{word}` is not an action of `{}`: write numbers from 0{last}{known}", game.name()))
}
