//! Traces: play of given actions, printed tick by tick.

use crate::{
    game::Game,
    inspect::{InspectError, Print, TraceRequest, plain, read_text},
    level_files::read::shown_path,
    worlds::build_world,
};
use bevy_playbot::{
    engine::misfit,
    prelude::*,
    unknown_name::{nearest, question},
};

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
    if !matches!(space, ActionSpace::Discrete(_)) {
        return Err(InspectError::Usage(format!(
            "`{0}` has {space}, which cannot be traced: watch a level with `playbot view {0} --episode`",
            game.name()
        )));
    }
    let actions = match request.file {
        None => request.actions.to_vec(),
        Some(path) => {
            let text = read_text(path).map_err(|error| InspectError::Usage(format!("{error}; {HOW}")))?;
            let parsed = actions_in(game, &text);
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

/// Returns the numbers of the actions in a text, separated by commas, line ends or blanks. The name of an action may have
/// blanks in it, as `click Start` does.
fn actions_in(game: &dyn Game, text: &str) -> Result<Vec<u32>, String> {
    let parts = text.split([',', '\n']).map(str::trim).filter(|part| !part.is_empty());
    let names = game.tools().input.action_names();
    let numbers = |part: &str| {
        let of_words = |whole: String| {
            let mut words = part.split_whitespace().map(|word| action_number(game, word)).peekable();
            let is_one_name = words.peek().is_some_and(Result::is_err) && !meant(part, &names).is_empty();
            if is_one_name { Err(whole) } else { words.collect::<Result<Vec<u32>, _>>() }
        };
        action_number(game, part).map(|number| vec![number]).or_else(of_words)
    };
    Ok(parts.map(numbers).collect::<Result<Vec<_>, _>>()?.concat())
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
    Err(format!(
        "`{word}` is not an action of `{}`{}: write numbers from 0{last}{known}",
        game.name(),
        meant(word, &names)
    ))
}

/// Returns a question for the actions that were probably meant: those with this word in their names, as `click Start` for
/// `Start`, or else the most similar one.
fn meant(word: &str, names: &[String]) -> String {
    let has_word = |name: &&str| name.split_whitespace().any(|part| part.eq_ignore_ascii_case(word));
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let of_word: Vec<&str> = names.iter().copied().filter(has_word).collect();
    let meant = if of_word.is_empty() { nearest(word, &names).into_iter().collect() } else { of_word };
    question(meant.into_iter().take(MOST_MEANT))
}

/// Most actions that are proposed for an unknown one.
const MOST_MEANT: usize = 3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::foreign::ForeignGame;
    use bevy::{app::App, input::keyboard::KeyCode};

    #[test]
    fn an_unknown_action_is_reported_with_the_ones_that_were_probably_meant() {
        let names: Vec<String> =
            ["nothing", "ArrowLeft", "ArrowRight", "click Start", "click Quit", "tap Quit"].map(str::to_owned).to_vec();
        for (word, question) in [
            ("Start", " (did you mean `click Start`?)"),
            ("start", " (did you mean `click Start`?)"),
            ("Quit", " (did you mean `click Quit` or `tap Quit`?)"),
            ("ArowLeft", " (did you mean `ArrowLeft`?)"),
            ("clickStart", " (did you mean `click Start`?)"),
            ("x", ""),
        ] {
            assert_eq!(meant(word, &names), question, "{word}");
        }
    }

    #[test]
    fn names_with_blanks_are_read_from_a_text() {
        let game = ForeignGame::new("menu", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .clicks(["Start", "Quit"]);
        let names = game.tools().input.action_names();
        let number = |wanted: &str| names.iter().position(|name| name == wanted).expect("an action") as u32;
        let (idle, space, start) = (number("nothing"), number("Space"), number("click Start"));
        let text = "click Start, Space nothing\nclick start\r\n\n0 1,0";
        assert_eq!(actions_in(&game, text), Ok(vec![start, space, idle, start, 0, 1, 0]));
        for (text, wanted) in [
            ("click Stop", "`click Stop` is not an action of `menu` (did you mean `click Start`?)"),
            ("0 nothing Spade", "`Spade` is not an action of `menu` (did you mean `Space`?)"),
        ] {
            let words = actions_in(&game, text).expect_err("no such action");
            assert!(words.starts_with(wanted), "{words}");
        }
        assert!(actions_in(&game, "Start").is_err_and(|words| words.contains("did you mean `click Start`?")));
    }
}
