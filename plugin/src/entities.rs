//! Sensors of a changing number of things, such as enemies or coins.
//!
//! An [`EntitySensor`] looks at the entities with a component, keeps the nearest, and writes their numbers behind the
//! values that the game's own systems have put into the [`Observation`]: up to N slots, each with a presence of 1 or 0.
//! Policies read such a set without regard to the order of its slots.
//!
//! ```
//! use bevy::prelude::*;
//! use bevy_playbot::{entities::EntitySensor, prelude::*};
//! use std::sync::Arc;
//!
//! #[derive(Component)]
//! struct Enemy;
//!
//! /// Two enemies at most, each with its distance and numbers; those beyond 10 m are not seen.
//! fn enemies() -> EntitySensor {
//!     EntitySensor::new::<Enemy, 2>("enemy", 2, ["dx", "dy"], |agent, enemy| {
//!         let (agent, enemy) = (agent.get::<Transform>()?, enemy.get::<Transform>()?);
//!         let to = (enemy.translation - agent.translation).truncate();
//!         (to.length() < 10.0).then_some((to.length(), to.to_array()))
//!     })
//! }
//!
//! fn see(mut agents: Query<(&Transform, &mut Observation)>) {
//!     agents.iter_mut().for_each(|(body, mut seen)| seen.set([body.translation.x]));
//! }
//!
//! let mut app = headless_app();
//! app.add_systems(ObserveSchedule, see);
//! let sensors = (VectorSensor::from_space(Arc::new(enemies().space(["x"]))), enemies());
//! let agent = (Agent::new(0, ActionSpace::Discrete(2)), sensors, Control::Human, Transform::from_xyz(1.0, 0.0, 0.0));
//! let agent = app.world_mut().spawn(agent).id();
//! for x in [4.0, -8.0, 3.0, 90.0] {
//!     app.world_mut().spawn((Enemy, Transform::from_xyz(x, 0.0, 0.0)));
//! }
//! app.tick().expect("a value, and the two nearest enemies");
//! let seen = &app.world().get::<Observation>(agent).expect("every agent has one").vector;
//! assert_eq!(seen[..], [1.0, 1.0, 2.0, 0.0, 1.0, 3.0, 0.0]);
//! ```

use crate::{
    agent::{Agent, AgentOrder},
    carry_over::ReflectCarryComponent,
    episode::Episode,
    fault::Faults,
    observation::{Observation, ObservationSpace, VectorSensor},
};
use bevy::{
    ecs::{lifecycle::HookContext, world::DeferredWorld},
    prelude::*,
};
use std::{fmt, sync::Arc};

pub use playbot_learner::EntitySet;

/// A thing as a sensor sees it: its distance, by which the nearest are kept, and its numbers.
pub type SeenThing = (f32, Vec<f32>);

/// The slots of one set of things: its name, the most things that it holds, and the names of a thing's numbers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EntitySlots {
    name: String,
    slots: usize,
    fields: Vec<String>,
}

impl EntitySlots {
    /// Creates the slots of a set.
    pub fn new(name: &str, slots: usize, fields: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self { name: name.to_owned(), slots, fields: fields.into_iter().map(Into::into).collect() }
    }

    /// Returns its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns the number of values of all slots.
    pub fn len(&self) -> usize {
        self.slots * (1 + self.fields.len())
    }

    /// Returns whether it holds nothing.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns the names of the values: `enemy[0].present`, `enemy[0].dx`, and so on.
    pub fn names(&self) -> impl Iterator<Item = String> {
        EntitySet::names(&self.name, self.slots, &self.fields)
    }

    /// Returns why policies could not read the set, if they could not.
    pub fn problem(&self) -> Option<String> {
        let Self { name, slots, fields } = self;
        let twice = fields.iter().enumerate().find(|(at, field)| fields[..*at].contains(field)).map(|(_, field)| field);
        let is_bad = |text: &str| text.is_empty() || text.contains(['[', ']']) || text == playbot_learner::PRESENT;
        match (twice, fields.iter().find(|field| is_bad(field))) {
            _ if name.is_empty() || name.contains(['[', ']']) => {
                Some(format!("the set `{name}` needs a name without brackets"))
            }
            _ if *slots == 0 => {
                Some(format!("the set `{name}` has no slots: give it as many as things matter at once"))
            }
            _ if fields.is_empty() => Some(format!("the set `{name}` names no numbers of a thing")),
            (Some(field), _) => Some(format!("the set `{name}` names two numbers `{field}`")),
            (None, Some(field)) => Some(format!(
                "the set `{name}` names a number `{field}`: use a word without brackets other than `present`"
            )),
            (None, None) => None,
        }
    }

    /// Adds the values of `things` to an observation: the nearest of them, each behind a presence of 1, and zeros for the
    /// slots that are left. Of things at the same distance those with smaller numbers come first, so the order in which
    /// they were found is without effect.
    ///
    /// # Errors
    ///
    /// The thing that is not finite or has another number of numbers, in words.
    pub fn write(&self, things: &mut [SeenThing], to: &mut Vec<f32>) -> Result<(), String> {
        let Self { name, slots, fields } = self;
        for (number, (distance, numbers)) in things.iter().enumerate() {
            if numbers.len() != fields.len() {
                return Err(format!(
                    "thing {number} of the set `{name}` has {} numbers, but the set names {}: {}",
                    numbers.len(),
                    fields.len(),
                    fields.join(", ")
                ));
            }
            let bad = fields.iter().zip(numbers).find(|(_, value)| !value.is_finite());
            if let Some((field, value)) = bad {
                return Err(format!("`{field}` of thing {number} of the set `{name}` is {value}; it must be finite"));
            }
            if !distance.is_finite() {
                return Err(format!(
                    "the distance of thing {number} of the set `{name}` is {distance}; it must be finite"
                ));
            }
        }
        things.sort_by(|(near, one), (far, other)| {
            let numbers = || one.iter().zip(other).map(|(one, other)| one.total_cmp(other)).find(|order| order.is_ne());
            near.total_cmp(far).then_with(|| numbers().unwrap_or(std::cmp::Ordering::Equal))
        });
        let end = to.len() + self.len();
        for (_, numbers) in things.iter().take(*slots) {
            to.push(1.0);
            to.extend_from_slice(numbers);
        }
        to.resize(end, 0.0);
        Ok(())
    }
}

type Look = Arc<dyn Fn(&mut World, Entity) -> Vec<SeenThing> + Send + Sync>;

/// Sets of things that an agent sees, behind the values of the game's own systems.
///
/// The agent's [`VectorSensor`] names the values of both: see [`space`](Self::space). The sensor looks after all systems of
/// [`ObserveSchedule`](crate::systems::ObserveSchedule), at the entities of its own World. If more things are there than
/// slots, the nearest are kept.
#[derive(Component, Clone, Reflect)]
#[component(on_add = note)]
#[reflect(opaque)]
#[reflect(Component, CarryComponent, Clone, Debug)]
pub struct EntitySensor {
    sets: Arc<[(EntitySlots, Look)]>,
}

impl EntitySensor {
    /// Creates a sensor of the entities with the component `Thing`. `look` gets the agent and a thing. It returns a
    /// distance, by which the nearest are kept, and the numbers of the thing, one per name; or `None` for a thing that the
    /// agent does not see, such as one of another arena. Distance and numbers must be finite.
    pub fn new<Thing: Component, const N: usize>(
        name: &str,
        slots: usize,
        fields: [&str; N],
        look: impl Fn(EntityRef<'_>, EntityRef<'_>) -> Option<(f32, [f32; N])> + Send + Sync + 'static,
    ) -> Self {
        Self { sets: Arc::new([]) }.and::<Thing, N>(name, slots, fields, look)
    }

    /// Adds another set.
    #[must_use]
    pub fn and<Thing: Component, const N: usize>(
        self,
        name: &str,
        slots: usize,
        fields: [&str; N],
        look: impl Fn(EntityRef<'_>, EntityRef<'_>) -> Option<(f32, [f32; N])> + Send + Sync + 'static,
    ) -> Self {
        let look: Look = Arc::new(move |world, agent| {
            let mut things = world.query_filtered::<EntityRef<'_>, With<Thing>>();
            let Ok(agent) = world.get_entity(agent) else { return Vec::new() };
            let others = things.iter(world).filter(|thing| thing.id() != agent.id());
            others.filter_map(|thing| look(agent, thing)).map(|(far, numbers)| (far, numbers.to_vec())).collect()
        });
        let added = (EntitySlots::new(name, slots, fields), look);
        Self { sets: self.sets.iter().cloned().chain([added]).collect() }
    }

    /// Returns the names of its values.
    pub fn names(&self) -> impl Iterator<Item = String> {
        self.sets.iter().flat_map(|(slots, _)| slots.names())
    }

    /// Returns the observation space of an agent whose own values have the names `own`: theirs, and those of the sets.
    pub fn space(&self, own: impl IntoIterator<Item = impl Into<String>>) -> ObservationSpace {
        ObservationSpace { names: own.into_iter().map(Into::into).chain(self.names()).collect() }
    }
}

impl fmt::Debug for EntitySensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.sets.iter().map(|(slots, _)| slots)).finish()
    }
}

/// Marks a World in which an agent has had an [`EntitySensor`]. Others are not searched for any.
#[derive(Resource, Default, Debug, Reflect)]
#[reflect(Resource)]
struct HasEntitySensors;

fn note(mut world: DeferredWorld<'_>, _: HookContext) {
    world.commands().init_resource::<HasEntitySensors>();
}

/// Adds the sets of all agents to their observations.
pub(crate) fn look(world: &mut World) {
    if !world.contains_resource::<HasEntitySensors>() {
        return;
    }
    let agents = world.get_resource::<AgentOrder>().map(|order| order.entities().to_vec()).unwrap_or_default();
    for agent in agents {
        let Some(EntitySensor { sets }) = world.get::<EntitySensor>(agent).cloned() else { continue };
        let fault = look_around(world, agent, &sets).err();
        let moment = world.get::<Episode>(agent).zip(world.get::<Agent>(agent));
        if let Some((fault, (episode, agent))) = fault.zip(moment).filter(|(_, (episode, _))| episode.is_running()) {
            let fault = format!("{}: {fault}", episode.moment(agent));
            world.resource_mut::<Faults>().report(fault);
        }
    }
}

/// Adds the sets of one agent.
///
/// # Errors
///
/// The fault of the sensor or of a thing, in words.
fn look_around(world: &mut World, agent: Entity, sets: &[(EntitySlots, Look)]) -> Result<(), String> {
    // Without a sensor of values the agent sees pictures.
    let Some(names) = world.get::<VectorSensor>(agent).map(|sensor| &sensor.space().names) else { return Ok(()) };
    if let Some(problem) = sets.iter().find_map(|(slots, _)| slots.problem()) {
        return Err(problem);
    }
    let width: usize = sets.iter().map(|(slots, _)| slots.len()).sum();
    let own = names.len().saturating_sub(width);
    if !names[own..].iter().cloned().eq(sets.iter().flat_map(|(slots, _)| slots.names())) {
        return Err(
            "the last names of an agent's `VectorSensor` must be those of the sets of its `EntitySensor`: make it \
                    with `VectorSensor::from_space(Arc::new(sensor.space(names)))`"
                .to_owned(),
        );
    }
    let Some(mut vector) = world.get_mut::<Observation>(agent).map(|mut seen| std::mem::take(&mut seen.vector)) else {
        return Ok(());
    };
    // A game may write its own values in place, in front of those of the last tick.
    if vector.len() == own + width {
        vector.truncate(own);
    }
    let written = match vector.len() == own {
        true => sets.iter().try_for_each(|(slots, look)| slots.write(&mut look(world, agent), &mut vector)),
        false => Err(format!(
            "the game's systems gave {} values, and its sensor names {own} beside those of its sets; fill every value each \
             tick",
            vector.len()
        )),
    };
    // A fault of its own has been told; another one about the number of values would only follow from it.
    vector.resize(own + width, 0.0);
    if let Some(mut seen) = world.get_mut::<Observation>(agent) {
        seen.vector = vector;
    }
    written
}

/// Adds the types of this module.
pub(crate) fn plugin(app: &mut App) {
    app.register_type::<EntitySensor>().register_type::<HasEntitySensors>();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{headless::PlaybotAppExt, prelude::*};

    #[derive(Component)]
    struct Coin(f32);

    fn coins() -> EntitySensor {
        EntitySensor::new::<Coin, 1>("coin", 3, ["worth"], |_, coin| {
            let worth = coin.get::<Coin>()?.0;
            (worth != 0.0).then_some((worth.abs(), [worth]))
        })
    }

    fn app(sensor: VectorSensor, coins_around: &[f32]) -> (App, Entity) {
        let mut app = headless_app();
        app.add_systems(ObserveSchedule, |mut seen: Query<&mut Observation>| {
            seen.iter_mut().for_each(|mut seen| seen.set([0.5]));
        });
        let agent = (Agent::new(0, ActionSpace::Discrete(2)), sensor, coins(), Control::Human);
        let agent = app.world_mut().spawn(agent).id();
        coins_around.iter().for_each(|&worth| _ = app.world_mut().spawn(Coin(worth)));
        (app, agent)
    }

    fn whole() -> VectorSensor {
        VectorSensor::from_space(Arc::new(coins().space(["x"])))
    }

    #[test]
    fn the_nearest_are_kept_whatever_the_order_in_which_they_were_spawned() {
        for worths in [[5.0, -1.0, 0.0, 1.0, 2.0], [2.0, 1.0, 5.0, -1.0, 0.0]] {
            let (mut app, agent) = app(whole(), &worths);
            for _ in 0..3 {
                app.tick().expect("sound");
            }
            let seen = app.world().get::<Observation>(agent).expect("every agent has one").vector.clone();
            assert_eq!(seen, [0.5, 1.0, -1.0, 1.0, 1.0, 1.0, 2.0]);
        }
        let (mut app, agent) = app(whole(), &[]);
        app.tick().expect("nothing there is no fault");
        assert_eq!(
            app.world().get::<Observation>(agent).expect("every agent has one").vector,
            [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
        );
    }

    #[test]
    fn values_that_a_game_writes_in_place_stay_in_front() {
        let (mut app, agent) = app(whole(), &[4.0]);
        app.tick().expect("sound");
        look(app.world_mut());
        assert_eq!(app.world().get::<Observation>(agent).expect("every agent has one").vector[..3], [0.5, 1.0, 4.0]);
    }

    #[test]
    fn faults_name_the_set_and_the_thing() {
        let fault =
            |sensor: VectorSensor, worths: &[f32]| app(sensor, worths).0.tick().expect_err("a fault").to_string();
        let text = fault(whole(), &[1.0, f32::NAN]);
        assert!(
            text.starts_with("agent 0, level ") && text.contains("`worth` of thing 1 of the set `coin` is NaN"),
            "{text}"
        );
        assert!(fault(VectorSensor::new(["x"]), &[]).contains("the last names of an agent's `VectorSensor` must be"));
        let more = VectorSensor::from_space(Arc::new(coins().space(["x", "y"])));
        assert!(fault(more, &[]).contains("gave 1 values, and its sensor names 2 beside those of its sets"));
        let slots = EntitySlots::new("coin", 2, ["worth"]);
        let error = slots.write(&mut [(1.0, vec![1.0, 2.0])], &mut Vec::new()).expect_err("two numbers");
        assert!(error.contains("thing 0 of the set `coin` has 2 numbers, but the set names 1: worth"), "{error}");
        assert!(slots.write(&mut [(f32::NAN, vec![1.0])], &mut Vec::new()).expect_err("far").contains("distance"));
    }

    #[test]
    fn sets_that_policies_could_not_read_are_refused() {
        let problem = |name, slots, fields: &[&str]| {
            EntitySlots::new(name, slots, fields.iter().copied()).problem().unwrap_or_default()
        };
        assert_eq!(problem("coin", 3, &["dx", "dy"]), "");
        assert!(problem("coin", 0, &["dx"]).contains("has no slots"));
        assert!(problem("coin", 3, &[]).contains("names no numbers"));
        assert!(problem("coin", 3, &["dx", "dx"]).contains("two numbers `dx`"));
        assert!(problem("co[0]in", 3, &["dx"]).contains("without brackets"));
        assert!(problem("coin", 3, &["present"]).contains("other than `present`"));
    }
}
