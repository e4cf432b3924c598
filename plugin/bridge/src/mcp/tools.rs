//! The tools of a session as a model reads them: names, descriptions, and the schemas of what they take and answer.

use crate::mcp::{Bounds, words::Words};
use playbot_harness::game::Game;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// The names of all tools.
pub(super) const NAMES: [&str; 6] = ["observe", "act", "level", "reset", "findings", "replay"];

/// A level by its number, or by its name.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(untagged)]
pub(super) enum LevelName {
    Number(u64),
    Name(String),
}

/// What the tool `observe` takes.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Observe {
    pub(super) picture: bool,
    pub(super) names: Vec<String>,
}

/// What the tool `act` takes.
#[derive(Debug, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Act {
    pub(super) action: Option<Value>,
    pub(super) actions: BTreeMap<String, Value>,
    pub(super) ticks: u64,
    pub(super) others: Others,
    pub(super) observation: Option<bool>,
    pub(super) names: Vec<String>,
    pub(super) picture: bool,
}

impl Default for Act {
    fn default() -> Self {
        Self {
            action: None,
            actions: BTreeMap::new(),
            ticks: 1,
            others: Others::default(),
            observation: None,
            names: Vec::new(),
            picture: false,
        }
    }
}

/// What the seats without an action do.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub(super) enum Others {
    /// The action that does nothing.
    #[default]
    Idle,
    /// Their last action.
    Hold,
}

/// What the tool `level` takes.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Level {
    pub(super) level: Option<LevelName>,
}

/// What the tool `reset` takes.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Begin {
    pub(super) level: Option<LevelName>,
    pub(super) picture: bool,
    pub(super) names: Vec<String>,
}

/// What the tool `findings` takes.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Findings {
    pub(super) report: Option<String>,
    pub(super) tick: Option<u32>,
}

/// What the tool `replay` takes.
#[derive(Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct Replay {
    pub(super) episode: Option<usize>,
}

/// Returns the instructions for a model that begins a session.
pub(super) fn instructions(game: &dyn Game, levels: &str) -> String {
    format!(
        "You test the game `{}` by playing it. Call `level` to learn its actions, what you observe and its levels ({levels}), \
         `reset` to begin an episode, `act` to play ticks and `observe` to look. `findings` says what the detectors have \
         found so far, and stores what you report in your own words. `replay` checks that an episode happens again. The game \
         waits for you: nothing moves between two calls. A second of the game has {} ticks.",
        game.name(),
        game.tick_hz()
    )
}

/// Returns all tools, for this game.
pub(super) fn list(game: &dyn Game, words: &Words, bounds: &Bounds, draws: bool) -> Vec<Value> {
    let picture = json!({
        "type": "boolean", "default": false,
        "description": if draws { "Add a picture of the game, as a PNG." } else { "This game has no picture here." },
    });
    let names = json!({
        "type": "array", "items": { "type": "string" },
        "description": "Show the observed values, and sets of things, whose names begin so, and no others.",
    });
    let level = json!({ "type": ["integer", "string"], "description": "The number of a level, or its name." });
    let tool = |name: &str, title: &str, about: String, takes: Value, answers: Value, hints: Value| {
        json!({
            "name": name, "title": title, "description": about,
            "inputSchema": { "type": "object", "properties": takes, "additionalProperties": false },
            "outputSchema": answers,
            "annotations": with_title(hints, title),
        })
    };
    let reads =
        json!({ "readOnlyHint": true, "destructiveHint": false, "idempotentHint": true, "openWorldHint": false });
    let plays =
        json!({ "readOnlyHint": false, "destructiveHint": false, "idempotentHint": false, "openWorldHint": false });
    let notes =
        json!({ "readOnlyHint": false, "destructiveHint": false, "idempotentHint": true, "openWorldHint": false });
    let most = bounds.ticks_per_call;
    vec![
        tool(
            "observe",
            "Look at the game",
            format!(
                "Shows the game `{}` as it is now: level and tick, the observed values by name, sets of things as lists of \
                 those that are there, the legal actions, and the return so far. Changes nothing.",
                game.name()
            ),
            json!({ "picture": picture, "names": names }),
            state_schema(&[]),
            reads.clone(),
        ),
        tool(
            "act",
            "Play some ticks",
            format!(
                "Plays an action for some ticks, {most} at most, and shows what came of it: reward, ends, and the game as it is \
                 then. It stops early at the end of the episode, or as soon as the action is not legal any more. After the \
                 end call `reset`."
            ),
            act_properties(words, most, &picture, &names),
            state_schema(&["reward", "ticks", "stopped"]),
            plays.clone(),
        ),
        tool(
            "level",
            "Read about game and levels",
            "Describes the game: its actions, the names of the observed values, its levels, and one of them as the program \
             shows it, with a plan where there is one. By default the level that is played. Changes nothing."
                .to_owned(),
            json!({ "level": level }),
            object(
                &["game", "mode", "levels", "shown", "seats", "observation"],
                json!({
                    "game": { "type": "string" },
                    "mode": { "type": "string" },
                    "levels": { "type": "object" },
                    "played": { "type": ["integer", "null"] },
                    "shown": { "type": "object" },
                    "seats": { "type": "array", "items": { "type": "object" } },
                    "observation": { "type": "array", "items": { "type": "string" } },
                }),
            ),
            reads,
        ),
        tool(
            "reset",
            "Begin an episode",
            "Begins an episode on a level, or on the next one. An episode that is not over is left, and its recording is kept."
                .to_owned(),
            json!({ "level": level, "picture": picture, "names": names }),
            state_schema(&[]),
            plays,
        ),
        tool(
            "findings",
            "Ask the detectors, or report a finding",
            "Plays the actions of this session's episodes again, and says what the detectors of `playbot test` find in them: \
             positions out of bounds, agents that are stuck, panics, rewards that are no numbers and more. Each finding is \
             stored as a file that replays. With `report` it also stores a finding of your own, with the actions that lead to \
             its tick."
                .to_owned(),
            json!({
                "report": { "type": "string", "description": "What is wrong with the game, in a sentence." },
                "tick": {
                    "type": "integer", "minimum": 0,
                    "description": "The tick of the latest episode after which it shows, from 0. Default: the last one.",
                },
            }),
            object(
                &["findings", "episodes"],
                json!({
                    "findings": { "type": "array", "items": { "type": "object" } },
                    "episodes": { "type": "array", "items": { "type": "object" } },
                    "reported": { "type": ["object", "null"] },
                    "note": { "type": ["string", "null"] },
                }),
            ),
            notes.clone(),
        ),
        tool(
            "replay",
            "Play an episode again",
            "Plays the recorded actions of an episode of this session again, in a new World, and compares state and reward of \
             each tick. A difference means that the game is not deterministic, which is a finding of its own."
                .to_owned(),
            json!({
                "episode": {
                    "type": "integer", "minimum": 0,
                    "description": "The number of the episode, from 0. Default: the latest one.",
                },
            }),
            object(
                &["episode", "level", "ticks", "same"],
                json!({
                    "episode": { "type": "integer" },
                    "level": { "type": "integer" },
                    "ticks": { "type": "integer", "description": "Ticks that were compared." },
                    "same": { "type": "boolean" },
                    "difference": { "type": ["object", "null"] },
                    "end": { "type": "string" },
                }),
            ),
            notes,
        ),
    ]
}

fn with_title(mut hints: Value, title: &str) -> Value {
    hints["title"] = json!(title);
    hints
}

fn object(required: &[&str], properties: Value) -> Value {
    json!({ "type": "object", "properties": properties, "required": required })
}

fn act_properties(words: &Words, most: u64, picture: &Value, names: &Value) -> Value {
    let mut properties = Map::new();
    if words.seats.len() == 1 {
        properties.insert("action".to_owned(), words.schema(0));
    } else {
        let each = words.seats.iter().enumerate();
        let each = each.filter_map(|(at, seat)| Some((seat.name.clone()?, words.schema(at))));
        let each: Map<String, Value> = each.collect();
        properties.insert(
            "actions".to_owned(),
            json!({
                "type": "object", "properties": each, "additionalProperties": false,
                "description": "The action of each seat.",
            }),
        );
        properties.insert(
            "others".to_owned(),
            json!({
                "type": "string", "enum": ["idle", "hold"], "default": "idle",
                "description": "What the seats without an action do: nothing, or what they did last.",
            }),
        );
    }
    let ticks = json!({
        "type": "integer", "minimum": 1, "maximum": most, "default": 1,
        "description": "Ticks to play it for.",
    });
    properties.insert("ticks".to_owned(), ticks);
    let observation = json!({
        "type": "boolean",
        "description": "Show the observed values, too. Default: only if there are few.",
    });
    properties.insert("observation".to_owned(), observation);
    properties.insert("names".to_owned(), names.clone());
    properties.insert("picture".to_owned(), picture.clone());
    Value::Object(properties)
}

/// Returns the schema of a state of the game, with more fields for the tool `act`.
fn state_schema(more: &[&str]) -> Value {
    let agent = object(
        &["reward", "return", "terminated", "truncated", "success"],
        json!({
            "seat": { "type": ["string", "null"] },
            "values": { "type": "object", "additionalProperties": { "type": ["number", "null"] } },
            "things": { "type": "object", "additionalProperties": { "type": "array" } },
            "legal": { "type": ["array", "null"] },
            "reward": { "type": ["number", "null"], "description": "The sum over the ticks of this call." },
            "return": { "type": ["number", "null"], "description": "The sum over the episode." },
            "terminated": { "type": "boolean", "description": "The game is over." },
            "truncated": { "type": "boolean", "description": "Time is up, or another agent has ended the game." },
            "success": { "type": "boolean" },
        }),
    );
    let mut required = vec!["game", "level", "episode", "tick", "over", "agents"];
    required.extend(more.iter().filter(|name| **name != "reward"));
    object(
        &required,
        json!({
            "game": { "type": "string" },
            "level": { "type": "integer" },
            "level_name": { "type": ["string", "null"] },
            "episode": { "type": "integer" },
            "tick": { "type": "integer" },
            "over": { "type": "boolean", "description": "The episode is over: call `reset`." },
            "agents": { "type": "array", "items": agent },
            "ticks": { "type": "integer", "description": "Ticks that this call has played." },
            "stopped": { "type": ["string", "null"], "description": "Why fewer ticks were played than asked for." },
            "ticks_left": { "type": "integer", "description": "Ticks that are left to this session." },
        }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_tool_does_not_take_is_refused_with_what_it_takes() {
        let why = |value: Value| serde_json::from_value::<Act>(value).expect_err("refused").to_string();
        assert!(why(json!({ "tick": 3 })).contains("expected one of `action`, `actions`, `ticks`"));
        assert!(why(json!({ "ticks": -1 })).contains("-1"));
        assert!(why(json!({ "others": "sleep" })).contains("expected `idle` or `hold`"));
        let level: Begin = serde_json::from_value(json!({ "level": "Cave" })).expect("a name");
        assert_eq!(level.level, Some(LevelName::Name("Cave".to_owned())));
        assert_eq!(serde_json::from_value::<Act>(json!({})).expect("nothing is needed").ticks, 1);
    }
}
