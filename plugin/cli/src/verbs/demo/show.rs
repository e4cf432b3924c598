//! `playbot demo show`: the header, the episodes and the ticks of a recording.

use crate::{
    arguments::open,
    error::{CliError, Outcome},
    output,
    output::print_line,
};
use bevy_playbot::{
    demo::file::{Decider, DemoActions, DemoEnd, DemoEpisode, DemoHeader, DemoReader, EpisodeActions},
    level::LevelFile,
};
use playbot_report::counted;
use serde_json::{Value, json};
use std::{collections::BTreeMap, path::Path};

/// Shows the header and the episodes of a recording, or the ticks of one of them.
///
/// # Errors
///
/// It cannot be read, or has no such episode.
pub(crate) fn show(file: &Path, wanted: Option<usize>, as_json: bool) -> Result<Outcome, CliError> {
    let reader = DemoReader::open(file).map_err(open::missing_recording)?;
    if !as_json {
        show_header(reader.header())?;
    }
    let mut episodes = 0;
    for episode in reader {
        let episode = episode?;
        match wanted {
            None => show_episode(episodes, &episode, as_json)?,
            Some(wanted) if wanted == episodes => {
                show_ticks(&episode, as_json)?;
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
        DemoActions::Discrete(_) => format!("{:.0} % of the actions are random", 100.0 * header.action_noise),
        DemoActions::Continuous(_) => format!("normal, with a standard deviation of {}", header.action_noise),
    }
}

fn observations(header: &DemoHeader) -> String {
    if header.observation_names.is_empty() {
        return "not kept, since replaying brings them back".to_owned();
    }
    let values = counted(header.observation_names.len() as u64, "value");
    output::with_names(&values, &header.observation_names)
}

fn show_episode(index: usize, episode: &DemoEpisode, as_json: bool) -> Result<(), CliError> {
    if as_json {
        return print_line(json!({
            "episode": index, "level": episode.level_seed, "level_file": episode.level_file.as_ref().map(level_file), "steps": episode.len(),
            "return": episode.episode_return(), "end": episode.end, "steps_by_decider": episode.steps_by_decider(),
        }));
    }
    print_line(format!(
        "episode {index:>4}  level {:>6}  {:>4} steps  return {:>6.2}  {:<11}  {}{}",
        episode.level_seed,
        episode.len(),
        episode.episode_return(),
        end(episode.end),
        deciders("by", &episode.steps_by_decider()),
        episode.level_file.as_ref().map_or_else(String::new, |file| format!("  on {}", file.path)),
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

fn show_ticks(episode: &DemoEpisode, as_json: bool) -> Result<(), CliError> {
    for tick in 0..episode.len() {
        let action = match &episode.actions {
            EpisodeActions::Discrete(list) => json!(list[tick]),
            EpisodeActions::Continuous { dim, values } => json!(values[tick * dim..(tick + 1) * dim]),
        };
        let (reward, hash, decider) = (episode.rewards[tick], episode.state_hashes[tick], episode.deciders[tick]);
        if as_json {
            print_line(json!({
                "tick": tick, "action": action, "reward": reward, "state_hash": hash, "decider": decider,
            }))?;
        } else {
            print_line(format!("{tick:>5}  action {action:<4}  reward {reward:<5}  hash {hash:08x}  {decider}"))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_and_observations_are_plain_words() {
        let header = DemoHeader::new("runner", 1, "easy", 60.0, DemoActions::Discrete(3));
        assert_eq!(noise(&header), "none");
        assert!(observations(&header).starts_with("not kept"), "{}", observations(&header));
        let names = vec!["x".to_owned(), "y".to_owned()];
        let header = DemoHeader { action_noise: 0.2, observation_names: names, ..header };
        assert_eq!(
            (noise(&header).as_str(), observations(&header).as_str()),
            ("20 % of the actions are random", "2 values: x, y")
        );
        let header = DemoHeader { actions: DemoActions::Continuous(2), ..header };
        assert_eq!(noise(&header), "normal, with a standard deviation of 0.2");
    }
}
