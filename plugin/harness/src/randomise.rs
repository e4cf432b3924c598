//! Values of the game that each level draws anew: domain randomisation.
//!
//! A [`Randomise`] names numbers of the game by their paths, each with the factors by which it is multiplied. A World in
//! which it is [installed](Randomise::install) sets them when an episode begins: after the game has restarted, and before
//! the first tick. They are set back before the next restart. The factor of a path is drawn from a stream of the level's
//! own, so a level has the same values in each World and for each player.
//!
//! The agent has the values of its episode as [`RandomisedValues`], which recordings keep. A replay of a recording sets
//! the recorded values in any World.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::level::RandomisedValues;
//! use playbot_harness::{foreign::ForeignGame, prelude::*, randomise::Randomise, worlds::build_world};
//!
//! #[derive(Resource, Reflect)]
//! #[reflect(Resource)]
//! struct Gravity(f32);
//!
//! let game = ForeignGame::new("fall", 1, |app: &mut App| {
//!     app.insert_resource(Gravity(10.0)).register_type::<Gravity>();
//! })
//! .keys([vec![], vec![KeyCode::Space]])
//! .observe(["gravity"], |gravity: Res<Gravity>| [gravity.0])
//! .time_limit(3);
//! let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
//! Randomise::default().with("Gravity.0".to_owned(), "0.8..1.2".parse()?).install(&mut world);
//! world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list([7])));
//! world.tick().expect("the path leads to a number");
//! let drawn = world.get::<RandomisedValues>(agents[0]).expect("level 7 has one").0[0].value;
//! assert!((8.0..12.0).contains(&drawn) && world.resource::<Gravity>().0 == drawn as f32);
//! # Ok::<(), playbot_harness::randomise::FactorsError>(())
//! ```

use crate::reflected_path::ReflectedPath;
use bevy::prelude::*;
use bevy_playbot::{
    agent::{Agent, AgentOrder, Control},
    demo::replay::Replay,
    engine::{Renewal, TickSchedules},
    episode::{Episode, StartEpisode},
    fault::Faults,
    level::{RandomisedValue, RandomisedValues},
    placement::TickPlacement,
    systems::PlaybotSystems,
};
use playbot_learner::{HasExitCode, Streams, rng::unit};
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, fmt, str::FromStr};
use thiserror::Error;

/// Largest factor, which no game needs.
const MOST: f64 = 1e6;

/// Numbers of a game that each level multiplies by a factor of its own, by their paths: `Resource.field`, or
/// `Marker.Component.field`, as in [`observe_paths`](crate::foreign::ForeignGame::observe_paths).
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Randomise(BTreeMap<String, Factors>);

/// The factors of one number, each of them as likely as any other. Written `0.8..1.2`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Factors {
    least: f64,
    most: f64,
}

/// A text that is not a range of factors.
#[derive(Debug, Error, PartialEq, Eq)]
#[error("`{0}` is not a range of factors: write least..most, such as 0.8..1.2, of numbers from -1e6 to 1e6")]
pub struct FactorsError(String);

impl HasExitCode for FactorsError {}

impl FromStr for Factors {
    type Err = FactorsError;

    fn from_str(text: &str) -> Result<Self, FactorsError> {
        let refuse = || FactorsError(text.to_owned());
        let (least, most) = text.split_once("..").ok_or_else(refuse)?;
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|number| number.abs() <= MOST);
        match number(least).zip(number(most)) {
            Some((least, most)) if least <= most => Ok(Self { least, most }),
            _ => Err(refuse()),
        }
    }
}

impl fmt::Display for Factors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.least, self.most)
    }
}

impl TryFrom<String> for Factors {
    type Error = FactorsError;

    fn try_from(text: String) -> Result<Self, FactorsError> {
        text.parse()
    }
}

impl From<Factors> for String {
    fn from(factors: Factors) -> Self {
        factors.to_string()
    }
}

impl fmt::Display for Randomise {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> = self.0.iter().map(|(path, factors)| format!("{path}={factors}")).collect();
        f.write_str(&parts.join(", "))
    }
}

impl Randomise {
    /// Adds a path with its factors.
    #[must_use]
    pub fn with(mut self, path: String, factors: Factors) -> Self {
        self.0.insert(path, factors);
        self
    }

    /// Returns whether levels draw nothing.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns the factor of each path in a level.
    pub fn factors(&self, level: u64) -> impl Iterator<Item = (&str, f64)> {
        let streams = Streams::new(level);
        self.0.iter().map(move |(path, Factors { least, most })| {
            // A path has a stream of its own, so that further paths change nothing.
            let share = unit(&mut streams.stream(&format!("randomise.{path}"), 0));
            (path.as_str(), least + (most - least) * share)
        })
    }

    /// Makes a World that [`build_world`](crate::worlds::build_world) has built draw the values of its levels. It has one
    /// arena: the values are those of the World. Without paths it does nothing.
    pub fn install(&self, world: &mut World) {
        if !self.is_empty() {
            Renewal::carry_resource::<RandomisedWorld>(world);
            world.insert_resource(RandomisedWorld(self.clone()));
            follow_levels(world);
        }
    }
}

/// The values that levels of this World draw.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
struct RandomisedWorld(Randomise);

/// Agents whose episodes have just begun, with their levels.
#[derive(Resource, Clone, Debug, Default, Reflect)]
#[reflect(opaque)]
#[reflect(Resource, Clone, Debug)]
struct BegunLevels(Vec<(Entity, u64)>);

/// The values that the current level has set.
#[derive(Resource, Default, Reflect)]
#[reflect(from_reflect = false)]
#[reflect(Component)]
struct SetValues(#[reflect(ignore)] Vec<SetValue>);

struct SetValue {
    path: ReflectedPath,
    /// The game's own value.
    before: f64,
    /// The value that it has now.
    now: f64,
}

/// Present in Worlds that have the systems of [`follow_levels`].
#[derive(Resource, Clone, Copy, Debug, Default, Reflect)]
#[reflect(Resource)]
struct FollowsLevels;

/// Makes a World set the values of recordings that are replayed in it. Worlds of a
/// [`ForeignGame`](crate::foreign::ForeignGame) do it anyway.
pub fn follow_recordings(world: &mut World) {
    follow_levels(world);
}

/// Adds the systems that set the values of levels to a World, and to each World that takes its place. Games that are not
/// written for the plugin set them at their restart, and need no systems.
fn follow_levels(world: &mut World) {
    let TickSchedules { placement, decide, .. } = *world.resource::<TickSchedules>();
    if placement == TickPlacement::Frame || world.contains_resource::<FollowsLevels>() {
        return;
    }
    Renewal::set_up(world, move |world| {
        world.init_resource::<FollowsLevels>();
        world.add_observer(note_begun);
        world.schedule_scope(decide, |_, schedule| {
            schedule.add_systems((
                set_back.before(PlaybotSystems::Begin).run_if(resource_exists::<SetValues>),
                set_begun_values
                    .after(PlaybotSystems::Begin)
                    .before(PlaybotSystems::Load)
                    .run_if(resource_exists::<BegunLevels>),
            ));
        });
    });
}

fn note_begun(event: On<StartEpisode>, mut commands: Commands) {
    let StartEpisode { entity, level } = *event;
    commands.queue(move |world: &mut World| world.get_resource_or_init::<BegunLevels>().0.push((entity, level)));
}

/// Returns the values of the recording that an agent replays; `None` if it replays none.
fn recorded(control: Control, replay: Option<&Replay>) -> Option<&[RandomisedValue]> {
    replay.filter(|_| control == Control::Replay).map(|replay| replay.episode().randomised.as_slice())
}

/// Gives the game its own values back once no episode is played, so that its restart finds them.
fn set_back(world: &mut World) {
    let order = world.get_resource::<AgentOrder>().map_or_else(Vec::new, |order| order.entities().to_vec());
    let is_played = |agent: &Entity| {
        world.get::<Episode>(*agent).is_some_and(|episode| episode.is_running() || episode.is_loading())
    };
    if !order.iter().any(is_played) {
        own_values(world);
    }
}

/// Gives the game its own values back.
pub(crate) fn own_values(world: &mut World) {
    for mut value in world.remove_resource::<SetValues>().unwrap_or_default().0 {
        // A value that the game has set anew meanwhile is its own. What is gone needs no value.
        let _ = value.path.change(world, |found| if found == value.now { value.before } else { found });
    }
}

/// Sets the values of the levels that have begun.
fn set_begun_values(world: &mut World) {
    let begun = world.remove_resource::<BegunLevels>().unwrap_or_default().0;
    let Some(&(_, level)) = begun.first() else { return };
    let agents: Vec<Entity> = begun.into_iter().map(|(agent, _)| agent).collect();
    if let Err(why) = set_values(world, level, &agents)
        && let Some(mut faults) = world.get_resource_mut::<Faults>()
    {
        faults.report(why);
    }
}

/// Sets the values of a level that has begun for these agents, which have them from then on. Does nothing in a World whose
/// levels draw nothing, unless the first agent replays a recording with values.
///
/// # Errors
///
/// In words: a path leads to no number, or the World plays another level too.
pub(crate) fn set_values(world: &mut World, level: u64, agents: &[Entity]) -> Result<(), String> {
    let Some(&first) = agents.first() else { return Ok(()) };
    let control = Control::of(world, first);
    let recorded = recorded(control, world.get::<Replay>(first));
    let had_values = world.get::<RandomisedValues>(first).is_some();
    if recorded.is_none_or(<[_]>::is_empty) && !had_values && !world.contains_resource::<RandomisedWorld>() {
        return Ok(());
    }
    let index = world.get::<Agent>(first).map_or(0, |agent| agent.index);
    let others = world.get_resource::<AgentOrder>().map_or(&[][..], AgentOrder::entities).iter();
    let plays_another = |agent: &&Entity| {
        world.get::<Episode>(**agent).is_some_and(|episode| episode.is_running() && episode.level != level)
    };
    if others.clone().any(|agent| plays_another(&agent)) {
        return Err(format!(
            "agent {index}, level {level}: its World plays another level too, and `randomise` sets values of the whole World: \
             build Worlds of one arena each"
        ));
    }
    let recorded: Option<Vec<_>> =
        recorded.map(|values| values.iter().map(|drawn| (drawn.path.clone(), drawn.value)).collect());
    let is_recorded = recorded.is_some();
    let wanted: Vec<(String, f64)> = match (recorded, world.get_resource::<RandomisedWorld>()) {
        (Some(values), _) => values,
        (None, Some(randomised)) => {
            randomised.0.factors(level).map(|(path, factor)| (path.to_owned(), factor)).collect()
        }
        (None, None) => Vec::new(),
    };
    // Episodes may begin one after the other in a World whose agents share a level.
    let mut set = world.remove_resource::<SetValues>().unwrap_or_default();
    let mut values = Vec::new();
    for (path, number) in wanted {
        let known = set.0.iter().find(|value| value.path.text() == path).map(|value| (value.before, value.now));
        let mut at = ReflectedPath::new(&path);
        let own = |found: f64| known.filter(|(_, now)| *now == found).map_or(found, |(before, _)| before);
        let mut before = 0.0;
        let changed = at.change(world, |found| {
            before = own(found);
            if is_recorded { number } else { before * number }
        });
        let (_, now) =
            changed.map_err(|why| format!("agent {index}, level {level}: the path `{path}` of `randomise` {why}"))?;
        set.0.retain(|value| value.path.text() != path);
        set.0.push(SetValue { path: at, before, now });
        values.push(RandomisedValue { path, value: now });
    }
    if !set.0.is_empty() {
        world.insert_resource(set);
    }
    for &agent in agents {
        if let Ok(mut agent) = world.get_entity_mut(agent) {
            if values.is_empty() {
                agent.remove::<RandomisedValues>();
            } else {
                agent.insert(RandomisedValues(values.clone()));
            }
        }
    }
    Ok(())
}
