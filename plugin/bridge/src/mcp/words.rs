//! Actions, observations and pictures of a game as a language model reads and writes them, and the seats that it plays.

use crate::{
    arrays::{Layout, Number},
    server::by_pixels,
};
use bevy::prelude::*;
use bevy_playbot::{
    action::{ActionSpace, ActionValue, MixedSpace},
    engine::misfit,
    unknown_name::UnknownName,
    vision::ImageOptions,
};
use playbot_harness::{
    game::{Game, idle_action},
    worlds::build_world,
};
use playbot_learner::EntitySet;
use png::{BitDepth, ColorType, Encoder, EncodingError};
use serde_json::{Map, Value, json};

/// The names of actions and of observed values.
#[derive(Debug)]
pub(super) struct Words {
    pub(super) space: ActionSpace,
    /// The action that does nothing.
    pub(super) idle: ActionValue,
    /// The agents that the model plays, in the order of their rows.
    pub(super) seats: Vec<Seat>,
    observed: Vec<String>,
    /// The sets of things among the observed values.
    sets: Vec<EntitySet>,
}

/// An agent that the model plays.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Seat {
    /// Its name; `None` in a game of one agent.
    pub(super) name: Option<String>,
    /// The names of its actions, or of the numbers of an action; may be empty.
    pub(super) actions: Vec<String>,
}

impl Words {
    pub(super) fn of(game: &dyn Game, seats: Vec<Seat>) -> Self {
        let observed = game.observation().names;
        let sets = EntitySet::all_in(&observed);
        Self { space: game.actions(), idle: idle_action(game), seats, observed, sets }
    }

    /// Returns the names of the seats, if there are several.
    pub(super) fn seat_names(&self) -> Vec<&str> {
        self.seats.iter().filter_map(|seat| seat.name.as_deref()).collect()
    }

    /// Returns the names of the options of all choices, choice after choice.
    fn options(&self, seat: usize) -> Vec<String> {
        let names = self.seats.get(seat).map(|seat| seat.actions.as_slice()).unwrap_or_default();
        let name = |option: usize| names.get(option).cloned().unwrap_or_else(|| option.to_string());
        (0..self.space.options()).map(name).collect()
    }

    /// Returns the names of the numbers of an action.
    fn numbers(&self, seat: usize) -> Vec<String> {
        let names = self.seats.get(seat).map(|seat| seat.actions.as_slice()).unwrap_or_default();
        // Where there are choices, too, their options come first.
        let first = self.space.options();
        let name = |number: usize| names.get(first + number).cloned().unwrap_or_else(|| number.to_string());
        (0..self.space.numbers()).map(name).collect()
    }

    /// Returns the actions of a seat, for a model that has to choose.
    pub(super) fn describe_actions(&self, seat: usize) -> Value {
        match self.space {
            ActionSpace::Discrete(count) => {
                json!({ "kind": "discrete", "count": count, "names": self.options(seat) })
            }
            ActionSpace::Continuous(count) => {
                json!({ "kind": "continuous", "count": count, "numbers": self.numbers(seat), "low": -1.0, "high": 1.0 })
            }
            ActionSpace::Mixed(MixedSpace { choices, .. }) => {
                let options = self.options(seat);
                let each: Vec<&[String]> = choices.ranges().map(|at| &options[at]).collect();
                json!({ "kind": "mixed", "choices": each, "numbers": self.numbers(seat), "low": -1.0, "high": 1.0 })
            }
        }
    }

    /// Returns the JSON schema of an action of a seat.
    pub(super) fn schema(&self, seat: usize) -> Value {
        let number = json!({ "type": "number" });
        let vector = |names: Vec<String>| {
            let each: Map<String, Value> = names.iter().map(|name| (name.clone(), number.clone())).collect();
            json!([
                { "type": "object", "properties": each, "additionalProperties": false },
                { "type": "array", "items": number, "minItems": names.len(), "maxItems": names.len() },
            ])
        };
        match self.space {
            ActionSpace::Discrete(count) => json!({
                "anyOf": [
                    { "type": "string", "enum": self.options(seat) },
                    { "type": "integer", "minimum": 0, "maximum": count.saturating_sub(1) },
                ],
                "description": "The name of an action, or its number, from 0.",
            }),
            ActionSpace::Continuous(_) => json!({
                "anyOf": vector(self.numbers(seat)),
                "description": "Numbers by name, -1 to 1 each; those that are left out are 0. Or all of them in order.",
            }),
            ActionSpace::Mixed(_) => json!({
                "type": "object",
                "properties": {
                    "choices": {
                        "type": "array",
                        "items": { "type": ["string", "integer"] },
                        "description": "An option of each choice, by name or number. Left out: the idle ones.",
                    },
                    "numbers": { "anyOf": vector(self.numbers(seat)), "description": "As for continuous actions." },
                },
                "additionalProperties": false,
            }),
        }
    }

    /// Reads an action of a seat.
    ///
    /// # Errors
    ///
    /// It is none of the game's: with the nearest name, or with all of them.
    pub(super) fn read(&self, seat: usize, value: &Value) -> Result<ActionValue, String> {
        let action = match self.space {
            ActionSpace::Discrete(_) => ActionValue::Discrete(option(&self.options(seat), value, "action")?),
            ActionSpace::Continuous(_) => ActionValue::Continuous(numbers(&self.numbers(seat), value)?),
            ActionSpace::Mixed(space) => self.mixed(seat, &space, value)?,
        };
        misfit(&action, &self.space).map_or(Ok(action), Err)
    }

    fn mixed(&self, seat: usize, space: &MixedSpace, value: &Value) -> Result<ActionValue, String> {
        let known = ["choices", "numbers"];
        let Value::Object(parts) = value else {
            return Err(format!("an action is an object with `choices` and `numbers`, not {value}"));
        };
        if let Some(other) = parts.keys().find(|key| !known.contains(&key.as_str())) {
            return Err(UnknownName::new("part of an action", other, &known).to_string());
        }
        let names = self.options(seat);
        let choices = match parts.get("choices") {
            None => self.idle.options().to_vec(),
            Some(Value::Array(chosen)) if chosen.len() == space.choices.sizes().len() => {
                let each = space.choices.ranges().zip(chosen);
                each.map(|(at, value)| option(&names[at], value, "option")).collect::<Result<Vec<u32>, String>>()?
            }
            Some(other) => {
                let wanted = space.choices.sizes().len();
                return Err(format!("`choices` has an option for each of {wanted} choices, and this is {other}"));
            }
        };
        let numbers = match parts.get("numbers") {
            None => vec![0.0; space.numbers],
            Some(value) => numbers(&self.numbers(seat), value)?,
        };
        Ok(ActionValue::Mixed { choices, numbers })
    }

    /// Writes an action as [`read`](Self::read) takes it.
    pub(super) fn write(&self, seat: usize, action: &ActionValue) -> Value {
        let (options, numbers) = (self.options(seat), self.numbers(seat));
        let by_name = |values: &[f32]| {
            let each = numbers.iter().zip(values).map(|(name, value)| (name.clone(), json!(short(*value))));
            Value::Object(each.collect())
        };
        match action {
            ActionValue::Discrete(option) => json!(options.get(*option as usize)),
            ActionValue::Continuous(values) => by_name(values),
            ActionValue::Mixed { choices, numbers } => {
                let all = self.space.choices();
                let named = all.ranges().zip(choices).map(|(at, &option)| options.get(at.start + option as usize));
                json!({ "choices": named.collect::<Vec<_>>(), "numbers": by_name(numbers) })
            }
        }
    }

    /// Returns the legal options of a seat by name, from the entries of its mask; `None` if nothing is masked in this game.
    pub(super) fn legal(&self, seat: usize, mask: &[u8]) -> Option<Value> {
        let options = self.options(seat);
        let legal = |at: std::ops::Range<usize>| -> Vec<&String> {
            let each = at.filter(|&option| mask.get(option).is_some_and(|entry| *entry != 0));
            each.filter_map(|option| options.get(option)).collect()
        };
        match self.space {
            ActionSpace::Discrete(count) => Some(json!(legal(0..count))),
            ActionSpace::Continuous(_) => None,
            ActionSpace::Mixed(space) => Some(json!(space.choices.ranges().map(legal).collect::<Vec<Vec<&String>>>())),
        }
    }

    /// Returns whether the options of an action are legal, by the entries of the mask.
    pub(super) fn is_legal(&self, action: &ActionValue, mask: &[u8]) -> bool {
        let entry = |at: usize| mask.get(at).is_none_or(|entry| *entry != 0);
        match action {
            ActionValue::Discrete(option) => entry(*option as usize),
            ActionValue::Continuous(_) => true,
            ActionValue::Mixed { choices, .. } => {
                self.space.choices().ranges().zip(choices).all(|(at, &option)| entry(at.start + option as usize))
            }
        }
    }

    /// Returns the observed values whose names are shown, and the sets of things as lists of those that are present.
    pub(super) fn observation(
        &self,
        values: &[f32],
        is_shown: &dyn Fn(&str) -> bool,
    ) -> (Map<String, Value>, Map<String, Value>) {
        let mut sets = Map::new();
        for EntitySet { name, fields, block } in self.sets.iter().filter(|set| is_shown(&set.name)) {
            let width = block.width + 1;
            let thing = |slot: usize| {
                let at = block.start + slot * width;
                let numbers = values.get(at..at + width)?;
                let named =
                    fields.iter().zip(&numbers[1..]).map(|(field, number)| (field.clone(), json!(short(*number))));
                (numbers[0] > 0.5).then(|| Value::Object(named.collect()))
            };
            sets.insert(name.clone(), (0..block.slots).filter_map(thing).collect());
        }
        let in_set = |at: &usize| self.sets.iter().any(|set| set.block.range().contains(at));
        let named =
            self.observed.iter().zip(values).enumerate().filter(|(at, (name, _))| !in_set(at) && is_shown(name));
        let named = named.map(|(_, (name, value))| (name.clone(), json!(short(*value))));
        (named.collect(), sets)
    }

    /// Returns the names of the observed values.
    pub(super) fn observed(&self) -> &[String] {
        &self.observed
    }
}

/// Reads an option by its name or number.
fn option(names: &[String], value: &Value, what: &'static str) -> Result<u32, String> {
    let number = match value {
        Value::String(name) => match names.iter().position(|known| known == name) {
            Some(at) => at as u64,
            None => {
                let names: Vec<&str> = names.iter().map(String::as_str).collect();
                return Err(UnknownName::new(what, name, &names).to_string());
            }
        },
        value => value.as_u64().ok_or_else(|| format!("{what} {value} is neither a name nor a whole number from 0"))?,
    };
    u32::try_from(number).ok().filter(|number| (*number as usize) < names.len()).ok_or_else(|| {
        format!(
            "there is no {what} {number}: they are numbered from 0 to {}, {}",
            names.len().saturating_sub(1),
            names.join(", ")
        )
    })
}

/// Reads numbers: all of them in order, or some by name.
fn numbers(names: &[String], value: &Value) -> Result<Vec<f32>, String> {
    let number = |value: &Value| {
        let number = value.as_f64().map(|number| number as f32).filter(|number| number.is_finite());
        number.ok_or_else(|| format!("{value} is no number"))
    };
    match value {
        Value::Array(all) if all.len() == names.len() => all.iter().map(number).collect(),
        Value::Object(some) => {
            let mut numbers = vec![0.0; names.len()];
            for (name, value) in some {
                let known: Vec<&str> = names.iter().map(String::as_str).collect();
                let at = known.iter().position(|known| known == name);
                let at = at.ok_or_else(|| UnknownName::new("number", name, &known).to_string())?;
                numbers[at] = number(value)?;
            }
            Ok(numbers)
        }
        other => Err(format!(
            "numbers are an object with some of {}, or a list of {} numbers, and this is {other}",
            names.join(", "),
            names.len()
        )),
    }
}

/// Returns a number with as few digits as tell it from its neighbours.
pub(super) fn short(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}

/// Returns the actions of all agents as the arrays of a step have them.
pub(super) fn action_bytes(layout: &Layout, actions: &[ActionValue]) -> Vec<u8> {
    let mut bytes = vec![0; layout.action_bytes];
    for array in &layout.actions {
        let row = array.row();
        for (at, action) in actions.iter().enumerate() {
            let words: Vec<[u8; 4]> = match array.dtype {
                Number::I32 => action.options().iter().map(|option| option.to_le_bytes()).collect(),
                _ => action.numbers().iter().map(|number| number.to_le_bytes()).collect(),
            };
            let from = array.offset + at * row;
            for (to, word) in bytes[from..from + row].chunks_exact_mut(4).zip(words) {
                to.copy_from_slice(&word);
            }
        }
    }
    bytes
}

/// Returns the newest picture of an observation as a PNG.
///
/// # Errors
///
/// There is no room for it.
pub(super) fn png(image: &ImageOptions, planes: &[u8]) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, image.width, image.height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&by_pixels(image, planes))?;
    writer.finish()?;
    Ok(bytes)
}

// Seats of a game of several agents.

/// Returns the seats of the `count` agents of an arena that a model plays, in the order in which a World has them.
pub(super) fn seats(game: &dyn Game, mode: &str, count: u32) -> Vec<Seat> {
    let tools = game.tools();
    let (host, names) = (tools.host, tools.host.seats());
    if count == 1 || names.is_empty() {
        let actions = tools.input.action_names();
        let name = |number: u32| (count > 1).then(|| number.to_string());
        return (0..count).map(|number| Seat { name: name(number), actions: actions.clone() }).collect();
    }
    // A game may give its seats away in another order.
    let (world, agents) = build_world(game, mode, 0, 0, count);
    let seat = |(at, agent): (usize, &Entity)| {
        let seat = host.seat_of(&world, *agent);
        let own = host.seated(seat).map(|game| game.tools().input.action_names());
        let actions = own.unwrap_or_else(|| tools.input.action_names());
        Seat { name: Some(names.get(seat).cloned().unwrap_or_else(|| at.to_string())), actions }
    };
    agents.iter().enumerate().map(seat).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_playbot::action::Choices;
    use playbot_learner::ObsKind;

    fn words(space: ActionSpace, names: &[&str], observed: &[&str]) -> Words {
        let owned = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
        let observed = owned(observed);
        let sets = EntitySet::all_in(&observed);
        let seats = vec![Seat { name: None, actions: owned(names) }];
        Words { space, idle: ActionValue::Discrete(0), seats, observed, sets }
    }

    #[test]
    fn a_discrete_action_is_read_by_name_and_by_number() {
        let words = words(ActionSpace::Discrete(3), &["nothing", "left", "right"], &[]);
        assert_eq!(words.read(0, &json!("left")), Ok(ActionValue::Discrete(1)));
        assert_eq!(words.read(0, &json!(2)), Ok(ActionValue::Discrete(2)));
        assert_eq!(words.write(0, &ActionValue::Discrete(2)), json!("right"));
        let why = |value: Value| words.read(0, &value).expect_err("no action");
        assert_eq!(why(json!("lefd")), "unknown action `lefd` (did you mean `left`?); valid: nothing, left, right");
        assert_eq!(why(json!(3)), "there is no action 3: they are numbered from 0 to 2, nothing, left, right");
        for wrong in [json!(-1), json!(0.5), json!(null), json!(["left"]), json!(u64::MAX)] {
            assert!(words.read(0, &wrong).is_err(), "{wrong}");
        }
        assert_eq!(words.legal(0, &[1, 0, 1]), Some(json!(["nothing", "right"])));
        assert!(!words.is_legal(&ActionValue::Discrete(1), &[1, 0, 1]));
    }

    #[test]
    fn numbers_are_read_by_name_and_in_order() {
        let words = words(ActionSpace::Continuous(2), &["x", "y"], &[]);
        assert_eq!(words.read(0, &json!({ "y": -0.5 })), Ok(ActionValue::Continuous(vec![0.0, -0.5])));
        assert_eq!(words.read(0, &json!([1, 0.25])), Ok(ActionValue::Continuous(vec![1.0, 0.25])));
        let why = |value: Value| words.read(0, &value).expect_err("no action");
        assert!(why(json!({ "z": 1 })).contains("valid: x, y"));
        assert!(why(json!([1])).contains("a list of 2 numbers"));
        assert!(why(json!({ "x": "far" })).contains("is no number"));
        assert!(words.read(0, &json!({ "x": 1e300 })).is_err(), "it is infinite in 32 bits");
    }

    #[test]
    fn choices_and_numbers_are_read_together() {
        let choices = Choices::new(&[2, 3]).expect("choices");
        let space = ActionSpace::Mixed(MixedSpace { choices, numbers: 1 });
        let names = ["still", "walk", "nothing", "duck", "jump", "turn"];
        let idle = ActionValue::Mixed { choices: vec![0, 0], numbers: vec![0.0] };
        let words = Words { idle, ..words(space, &names, &[]) };
        let action = json!({ "choices": ["walk", 2], "numbers": { "turn": 0.5 } });
        let read = ActionValue::Mixed { choices: vec![1, 2], numbers: vec![0.5] };
        assert_eq!(words.read(0, &action), Ok(read.clone()));
        assert_eq!(words.write(0, &read), json!({ "choices": ["walk", "jump"], "numbers": { "turn": 0.5 } }));
        assert_eq!(words.read(0, &json!({})), Ok(words.idle.clone()));
        assert!(words.read(0, &json!({ "choices": ["jump", 2] })).expect_err("of the other").contains("still, walk"));
        assert!(words.read(0, &json!({ "choice": [] })).expect_err("none").contains("did you mean `choices`?"));
        assert_eq!(words.legal(0, &[1, 0, 0, 1, 1, 1]), Some(json!([["still"], ["duck", "jump"]])));
        assert!(!words.is_legal(&read, &[1, 0, 1, 1, 1, 1]));
    }

    #[test]
    fn sets_are_lists_of_the_things_that_are_there() {
        let names = ["x", "foe[0].present", "foe[0].dx", "foe[1].present", "foe[1].dx", "time"];
        let words = words(ActionSpace::Discrete(1), &[], &names);
        let (named, sets) = words.observation(&[0.1, 1.0, 2.5, 0.0, 0.0, 3.0], &|_| true);
        assert_eq!(Value::Object(named), json!({ "x": 0.1, "time": 3.0 }));
        assert_eq!(Value::Object(sets), json!({ "foe": [{ "dx": 2.5 }] }));
        let (named, sets) = words.observation(&[0.1, 1.0, 2.5, 0.0, 0.0, 3.0], &|name| name.starts_with('t'));
        assert_eq!((Value::Object(named), sets.len()), (json!({ "time": 3.0 }), 0));
    }

    #[test]
    fn actions_lie_in_the_arrays_of_a_step() {
        let choices = Choices::new(&[2, 3]).expect("choices");
        let space = ActionSpace::Mixed(MixedSpace { choices, numbers: 1 });
        let layout = Layout::new(2, &space, &ObsKind::Vector(1), false);
        let action = |option, number| ActionValue::Mixed { choices: vec![1, option], numbers: vec![number] };
        let bytes = action_bytes(&layout, &[action(2, 0.5), action(0, -1.0)]);
        assert_eq!(bytes[..16], [1, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0]);
        assert_eq!(bytes[64..72], [0.5_f32.to_le_bytes(), (-1.0_f32).to_le_bytes()].concat());
    }
}
