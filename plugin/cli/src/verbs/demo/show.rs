//! `playbot demo show`: the header, the episodes and the ticks of a recording.

use crate::{
    arguments::open,
    error::{CliError, Outcome},
    output,
    output::print_line,
};
use bevy_playbot::{
    action::{ActionSpace, Actions},
    demo::file::{Decider, DemoEnd, DemoEpisode, DemoHeader, DemoReader},
    level::LevelFile,
};
use playbot_harness::{game::Game, games::Games};
use playbot_report::counted;
use serde_json::{Value, json};
use std::{collections::BTreeMap, path::Path, str::FromStr};

/// What is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Form {
    Words,
    Json,
    /// JSON of whole episodes, for programs that play them again.
    JsonWithActions,
}

/// Ticks of an episode, both included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TickRange {
    first: usize,
    last: usize,
}

impl FromStr for TickRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (first, last) = text.split_once("..").unwrap_or((text, text));
        match (first.parse(), last.parse()) {
            (Ok(first), Ok(last)) if first <= last => Ok(Self { first, last }),
            (Ok(_), Ok(_)) => Err("the first tick is behind the last one".to_owned()),
            _ => Err("write first..last, such as 100..150, or one number".to_owned()),
        }
    }
}

/// Shows the header and the episodes of a recording, or the ticks of one of them.
///
/// # Errors
///
/// It cannot be read, or has no such episode, or the episode has no such ticks.
pub(super) fn show(
    file: &Path,
    wanted: Option<usize>,
    ticks: Option<TickRange>,
    form: Form,
    games: &Games,
) -> Result<Outcome, CliError> {
    let reader = DemoReader::open(file).map_err(open::missing_recording)?;
    let (header, names) = (reader.header().clone(), action_names(reader.header(), games));
    if form == Form::Words {
        show_header(&header)?;
    }
    let mut episodes = 0;
    for episode in reader {
        let episode = episode?;
        match wanted {
            None => show_episode(&header, episodes, &episode, form)?,
            Some(wanted) if wanted == episodes => {
                let ticks = ticks.unwrap_or(TickRange { first: 0, last: usize::MAX });
                if ticks.first >= episode.len() && !episode.is_empty() {
                    return Err(CliError::Usage(format!(
                        "--ticks begins with {}, but episode {wanted} of {} has {}, counted from 0",
                        ticks.first,
                        file.display(),
                        counted(episode.len() as u64, "tick")
                    )));
                }
                show_ticks(&episode, ticks, &names, form != Form::Words)?;
                return Ok(Outcome::Pass);
            }
            Some(_) => {}
        }
        episodes += 1;
    }
    match wanted {
        Some(wanted) => Err(CliError::Usage(format!(
            "{} has no episode {wanted}; it has {}, counted from 0",
            file.display(),
            counted(episodes as u64, "episode")
        ))),
        None => Ok(Outcome::Pass),
    }
}

/// Returns the action of a tick as JSON.
fn action(actions: &Actions, tick: usize) -> Value {
    match actions {
        Actions::Discrete(list) => json!(list[tick]),
        Actions::Continuous { .. } => json!(actions.vector(tick)),
        Actions::Mixed { .. } => json!({ "choices": actions.chosen(tick), "numbers": actions.vector(tick) }),
    }
}

/// Returns the names of the actions, if the program has the recorded game in the same version; empty otherwise.
fn action_names(header: &DemoHeader, games: &Games) -> Vec<String> {
    let is_same = |game: &&dyn Game| game.version() == header.game_version;
    let Some(game) = games.get(&header.game).ok().filter(is_same) else { return Vec::new() };
    game.tools().input.action_names()
}

fn show_header(header: &DemoHeader) -> Result<(), CliError> {
    let lines = [
        ("mode", header.mode.clone()),
        ("played by", header.demonstrator.clone()),
        ("noise", noise(header)),
        ("ticks", format!("{} in a second", header.tick_hz)),
        ("actions", header.actions.to_string()),
        ("observations", observations(header)),
        ("note", header.note.clone()),
        ("format", header.format.to_string()),
    ];
    print_line(format!("{}, version {} of its rules", header.game, header.game_version))?;
    lines
        .iter()
        .filter(|(_, value)| !value.is_empty())
        .try_for_each(|(key, value)| print_line(format!("{key:<14}{value}")))
}

/// Describes the noise that was added to the player's actions.
fn noise(header: &DemoHeader) -> String {
    match header.actions {
        _ if header.action_noise == 0.0 => "none".to_owned(),
        ActionSpace::Discrete(_) => format!("{:.0} % of the actions are random", 100.0 * header.action_noise),
        ActionSpace::Continuous(_) => format!("normal, with a standard deviation of {}", header.action_noise),
        ActionSpace::Mixed(_) => {
            let noise = header.action_noise;
            format!("{:.0} % of the choices are random, numbers have a standard deviation of {noise}", 100.0 * noise)
        }
    }
}

fn observations(header: &DemoHeader) -> String {
    if header.observation_names.is_empty() {
        return "not kept, since replaying brings them back".to_owned();
    }
    let values = counted(header.observation_names.len() as u64, "value");
    output::with_names(&values, &header.observation_names)
}

fn show_episode(header: &DemoHeader, index: usize, episode: &DemoEpisode, form: Form) -> Result<(), CliError> {
    if form != Form::Words {
        let mut line = json!({
            "episode": index, "level": episode.level_seed, "level_file": episode.level_file.as_ref().map(level_file), "steps": episode.len(),
            "return": episode.episode_return(), "end": episode.end, "steps_by_decider": episode.steps_by_decider(),
        });
        if !episode.randomised.is_empty() {
            line["randomised"] = json!(episode.randomised);
        }
        if form == Form::JsonWithActions {
            line["game"] = json!(header.game);
            line["mode"] = json!(header.mode);
            line["actions"] = (0..episode.len()).map(|tick| action(&episode.actions, tick)).collect();
            line["rewards"] = json!(episode.rewards);
        }
        return print_line(line);
    }
    let drawn: Vec<String> = episode.randomised.iter().map(ToString::to_string).collect();
    print_line(format!(
        "episode {index:>4}  level {:>6}  {:>4} steps  return {:>6.2}  {:<11}  {}{}{}",
        episode.level_seed,
        episode.len(),
        episode.episode_return(),
        end(episode.end),
        deciders("by", &episode.steps_by_decider()),
        episode.level_file.as_ref().map_or_else(String::new, |file| format!("  on {}", file.path)),
        if drawn.is_empty() { String::new() } else { format!("  with {}", drawn.join(", ")) },
    ))
}

/// Returns a level file as JSON, with the hash as text: few programs read numbers that large without loss.
fn level_file(file: &LevelFile) -> Value {
    json!({ "path": file.path, "hash": format!("{:016x}", file.hash) })
}

fn end(end: DemoEnd) -> &'static str {
    match end {
        DemoEnd::Terminated { success: true } => "won",
        DemoEnd::Terminated { success: false } => "lost",
        DemoEnd::Truncated => "out of time",
        DemoEnd::Aborted => "cut off",
    }
}

/// Describes the share of the ticks of each decider, after these words.
pub fn deciders(words: &str, steps_by_decider: &BTreeMap<Decider, usize>) -> String {
    let total: usize = steps_by_decider.values().sum();
    if total == 0 {
        return "no ticks".to_owned();
    }
    let share = |(decider, &steps)| format!("{decider} {:.0} %", 100.0 * steps as f64 / total as f64);
    format!("{words} {}", steps_by_decider.iter().map(share).collect::<Vec<_>>().join(", "))
}

fn show_ticks(episode: &DemoEpisode, ticks: TickRange, names: &[String], as_json: bool) -> Result<(), CliError> {
    let shown = ticks.first..episode.len().min(ticks.last.saturating_add(1));
    let words: Vec<String> = shown.clone().map(|tick| action_in_words(&episode.actions, tick, names)).collect();
    let width = words.iter().map(|words| words.chars().count()).max().unwrap_or(0).max(4);
    for (tick, words) in shown.zip(words) {
        let (reward, hash, decider) = (episode.rewards[tick], episode.state_hashes[tick], episode.deciders[tick]);
        if as_json {
            let name = match &episode.actions {
                Actions::Discrete(list) => names.get(list[tick] as usize),
                Actions::Continuous { .. } | Actions::Mixed { .. } => None,
            };
            let mut row = json!({
                "tick": tick, "action": action(&episode.actions, tick), "reward": reward, "state_hash": hash, "decider": decider,
            });
            if let Some(name) = name {
                row["action_name"] = json!(name);
            }
            print_line(row)?;
        } else {
            print_line(format!("{tick:>5}  action {words:<width$}  reward {reward:<5}  hash {hash:08x}  {decider}"))?;
        }
    }
    Ok(())
}

/// Describes the action of a tick by its number or numbers, with their names where they are known.
fn action_in_words(actions: &Actions, tick: usize, names: &[String]) -> String {
    let named = |index: usize| names.get(index).filter(|name| !name.is_empty());
    match actions {
        Actions::Discrete(list) => {
            let number = list[tick];
            named(number as usize).map_or_else(|| number.to_string(), |name| format!("{number} {name}"))
        }
        Actions::Continuous { .. } => {
            let row = actions.vector(tick).iter().enumerate();
            let words =
                row.map(|(at, value)| named(at).map_or_else(|| value.to_string(), |name| format!("{name} {value}")));
            format!("[{}]", words.collect::<Vec<_>>().join(", "))
        }
        Actions::Mixed { .. } => {
            let options = actions.chosen(tick).iter().map(u32::to_string);
            let words: Vec<_> = options.chain(actions.vector(tick).iter().map(f32::to_string)).collect();
            format!("[{}]", words.join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_of_ticks_include_both_ends() {
        for (text, first, last) in [("100..150", 100, 150), ("7", 7, 7), ("0..0", 0, 0)] {
            assert_eq!(text.parse::<TickRange>(), Ok(TickRange { first, last }), "{text}");
        }
        assert!("5..4".parse::<TickRange>().is_err_and(|error| error.contains("behind the last")));
        for wrong in ["", "..", "5..", "a..9", "1...2", "-1..3"] {
            assert!(wrong.parse::<TickRange>().is_err_and(|error| error.contains("first..last")), "{wrong}");
        }
    }

    #[test]
    fn actions_have_the_names_that_are_known() {
        let names = ["left", "", "jump"].map(str::to_owned);
        let discrete = Actions::Discrete(vec![0, 1, 2, 3]);
        let words = [0, 1, 2, 3].map(|tick| action_in_words(&discrete, tick, &names));
        assert_eq!(words, ["0 left", "1", "2 jump", "3"]);
        let values = Actions::Continuous { dim: 2, values: vec![0.5, -1.0, 0.0, 1.0] };
        assert_eq!(action_in_words(&values, 1, &names[..1]), "[left 0, 1]");
    }

    #[test]
    fn noise_and_observations_are_plain_words() {
        let header = DemoHeader::new("runner", 1, "easy", 60.0, ActionSpace::Discrete(3));
        assert_eq!(noise(&header), "none");
        assert!(observations(&header).starts_with("not kept"), "{}", observations(&header));
        let names = vec!["x".to_owned(), "y".to_owned()];
        let header = DemoHeader { action_noise: 0.2, observation_names: names, ..header };
        assert_eq!(
            (noise(&header).as_str(), observations(&header).as_str()),
            ("20 % of the actions are random", "2 values: x, y")
        );
        let header = DemoHeader { actions: ActionSpace::Continuous(2), ..header };
        assert_eq!(noise(&header), "normal, with a standard deviation of 0.2");
    }
}
