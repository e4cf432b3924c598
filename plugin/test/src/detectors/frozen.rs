//! Detectors of broken Worlds: games that stand still, cameras that see nothing, and numbers that run away.

use crate::detectors::{Efforts, positions::half};
use bevy::{
    ecs::world::WorldId,
    prelude::*,
    reflect::{Reflect, TypeRegistry},
};
use bevy_playbot::{
    action::{ActionSpace, ActionValue},
    agent::{Agent, AgentOrder},
    engine::BlankEpisodes,
    episode::{EpisodeEnd, EpisodeResult},
    legal::{IdleAction, LegalActions},
};
use playbot_harness::detector::{
    Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LeastEpisode, LevelAhead, WorldTick, WorldWatcher,
};
use std::collections::{BTreeMap, BTreeSet};

/// A finding for games in which nothing changes for any action: not the state and not the observations. A menu that no
/// action leaves is such a game, so the message names the game's states and buttons. Every action must have been taken
/// a while ago, or the action must have changed in a tenth of the ticks.
///
/// In an episode that is too short for that, the half of it before time was up counts. An agent may rest or wait for
/// so long, so every action must have been pressed, and released, without an effect.
pub struct FrozenWorld {
    ticks: f64,
}

impl Default for FrozenWorld {
    fn default() -> Self {
        Self { ticks: 300.0 }
    }
}

#[derive(Default)]
struct Still {
    ticks: u32,
    state: Option<u64>,
    same: u32,
    efforts: Efforts,
    /// The choices that were taken since the last change.
    tried: BTreeSet<u32>,
    /// Ticks since every legal choice was taken.
    since_all: u32,
    presses: Presses,
}

/// Ticks in which an action shows its effect: a button is pressed when it is released.
const LATE: u32 = 100;

/// Fewest ticks without any change before time is up.
const LEAST: u32 = 30;

/// Ticks in which a press shows its effect once it is released.
const RELEASED: u32 = 15;

/// Returns the legal choices of a moment; `None` if actions are no choices.
fn legal_choices<'a>(moment: &DetectorTick<'a>) -> Option<impl Iterator<Item = u32> + Clone + use<'a>> {
    let Some(&Agent { actions: ActionSpace::Discrete(count), .. }) = moment.world.get(moment.agent) else {
        return None;
    };
    let legal = moment.world.get::<LegalActions>(moment.agent);
    let is_legal = move |choice: &u32| legal.is_none_or(|legal| legal.allows(&ActionValue::Discrete(*choice)));
    Some((0..count as u32).filter(is_legal))
}

impl Still {
    fn note(&mut self, moment: &DetectorTick<'_>) {
        self.efforts.note(moment.action);
        let &ActionValue::Discrete(choice) = moment.action else { return };
        self.tried.insert(choice);
        let Some(legal) = legal_choices(moment) else { return };
        // Bots that hold each action for a while seldom change it.
        let has_tried_all = legal.clone().all(|choice| self.tried.contains(&choice));
        self.since_all = if has_tried_all { self.since_all + 1 } else { 0 };
        let idle = moment.world.get_resource::<IdleAction>().map_or(0, |idle| idle.0);
        self.presses.note(choice, idle, legal);
    }

    fn restart(&mut self) {
        self.efforts.restart();
        self.tried.clear();
        self.since_all = 0;
        self.presses.restart();
    }

    fn reported(&self, moment: &DetectorTick<'_>) -> String {
        let since = if self.same == moment.tick { "since the start of the episode, " } else { "" };
        let screen = screen(moment.world).map_or_else(String::new, |screen| format!(": {screen}"));
        format!("nothing has changed {since}for {} ticks, whatever the agent did{screen}", self.same)
    }
}

/// Choices that were pressed after the idle action and then released. A mouse button that goes on from one position to
/// another is not pressed there, so a choice right after another one shows nothing.
#[derive(Default)]
struct Presses {
    last: Option<u32>,
    /// True if the last choice began after the idle action.
    is_new: bool,
    done: BTreeSet<u32>,
    /// Ticks since this is so for every legal choice.
    since_all: u32,
}

impl Presses {
    fn note(&mut self, choice: u32, idle: u32, mut legal: impl Iterator<Item = u32> + Clone) {
        if !legal.clone().any(|choice| choice == idle) {
            // There is no rest between two presses.
            self.done.insert(choice);
        }
        if let Some(last) = self.last.filter(|last| *last != choice) {
            if self.is_new {
                self.done.insert(last);
            }
            self.is_new = last == idle;
        }
        self.last = Some(choice);
        let is_all = legal.all(|choice| choice == idle || self.done.contains(&choice));
        self.since_all = if is_all && !self.done.is_empty() { self.since_all + 1 } else { 0 };
    }

    fn restart(&mut self) {
        self.done.clear();
        (self.is_new, self.since_all) = (false, 0);
    }
}

impl Detector for FrozenWorld {
    fn name(&self) -> &'static str {
        "frozen-world"
    }

    fn describe(&self) -> &'static str {
        "nothing changes any more, whatever the agent does"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new("ticks", &mut self.ticks, "ticks in a row without any change").at_least(1.0)]
    }

    fn least_episode(&self) -> LeastEpisode {
        LeastEpisode::of_ticks((self.ticks as u32).min(LEAST).saturating_add(1))
    }

    fn setting_for(&self, ticks: u32) -> Option<String> {
        half(ticks)
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let ticks = self.ticks as u32;
        Some(Box::new(Still { ticks, ..Still::default() }))
    }
}

impl EpisodeWatcher for Still {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let state = moment.fingerprint();
        self.note(moment);
        if self.state == Some(state) {
            self.same += 1;
        } else {
            (self.state, self.same) = (Some(state), 0);
            self.restart();
        }
        let has_tried = || self.efforts.are_many(self.same) || self.since_all > LATE;
        (self.same >= self.ticks && has_tried()).then(|| self.reported(moment))
    }

    /// Time was up before the ticks of the setting could pass.
    fn end(&mut self, moment: &DetectorTick<'_>, result: &EpisodeResult) -> Option<String> {
        let is_cut = result.end == EpisodeEnd::Truncated && !result.success && result.ticks <= self.ticks;
        let is_long = self.same >= LEAST && self.same.saturating_mul(2) >= result.ticks;
        let has_tried = || match moment.action {
            ActionValue::Discrete(_) => self.presses.since_all > RELEASED,
            ActionValue::Continuous(_) | ActionValue::Mixed { .. } => self.efforts.are_many(self.same),
        };
        (is_cut && is_long && has_tried()).then(|| self.reported(moment))
    }
}

// The screen of a game, by reflection: the game may have parts of Bevy that this crate is built without.

/// Beginning of the type paths of Bevy's states.
const STATE: &str = "bevy_state::state::resources::State<";

/// Type paths of texts, whose first field is the string.
const TEXTS: [&str; 2] = ["bevy_ui::widget::text::Text", "bevy_text::text::TextSpan"];

/// Describes the screen by the states whose types are registered, and by the buttons of Bevy's UI. Returns `None` if
/// there are neither.
fn screen(world: &World) -> Option<String> {
    let registry = world.get_resource::<AppTypeRegistry>()?.read();
    let states = values(world, &registry, |path| path.starts_with(STATE)).into_iter().map(|(_, state)| {
        let (name, value) = (state.reflect_short_type_path(), format!("{state:?}"));
        format!("the state `{}` is `{}`", inside(name, '<', '>'), inside(&value, '(', ')'))
    });
    let mut parts: Vec<String> = states.collect();
    // The registry has no order.
    parts.sort();
    let texts = values(world, &registry, |path| TEXTS.contains(&path)).into_iter();
    let texts = texts.filter_map(|(entity, text)| {
        let text = text.reflect_path(".0").ok()?.try_downcast_ref::<String>()?;
        Some((entity, text.trim().to_owned()))
    });
    let texts: BTreeMap<Entity, String> = texts.collect();
    let buttons = values(world, &registry, |path| path.starts_with("bevy_ui") && path.ends_with("::Button"));
    let is_shown = |entity: Entity| world.get::<InheritedVisibility>(entity).is_none_or(|shown| shown.get());
    let buttons = buttons.into_iter().map(|(entity, _)| entity).filter(|entity| is_shown(*entity));
    let mut buttons: Vec<String> = buttons.map(|entity| format!("`{}`", label(world, &texts, entity))).collect();
    buttons.sort();
    buttons.dedup();
    if !buttons.is_empty() {
        let noun = if buttons.len() == 1 { "button is" } else { "buttons are" };
        parts.push(format!("the {noun} {}", buttons.join(", ")));
    }
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// Returns the values of the registered components and resources whose type path is wanted, with their entities.
fn values<'w>(
    world: &'w World,
    registry: &TypeRegistry,
    is_wanted: impl Fn(&str) -> bool,
) -> Vec<(Entity, &'w dyn Reflect)> {
    let mut found = Vec::new();
    for known in registry.iter().filter(|known| is_wanted(known.type_info().type_path())) {
        let Some(reflect) = known.data::<ReflectComponent>() else { continue };
        let Some(component) = world.components().get_id(known.type_id()) else { continue };
        let archetypes = world.archetypes().iter().filter(|archetype| archetype.contains(component));
        let entities = archetypes.flat_map(|archetype| archetype.entities().iter().map(|entity| entity.id()));
        found.extend(entities.filter_map(|entity| Some((entity, reflect.reflect(world.entity(entity))?))));
    }
    found
}

/// Returns the part of a text between its first `open` and a `close` at its end, or else the text.
fn inside(text: &str, open: char, close: char) -> &str {
    text.split_once(open).and_then(|(_, rest)| rest.strip_suffix(close)).unwrap_or(text)
}

/// Returns the texts in a button, or else its name.
fn label(world: &World, texts: &BTreeMap<Entity, String>, button: Entity) -> String {
    let (mut words, mut waiting) = (Vec::new(), vec![button]);
    while let Some(entity) = waiting.pop() {
        words.extend(texts.get(&entity).filter(|text| !text.is_empty()).cloned());
        waiting.extend(world.get::<Children>(entity).into_iter().flatten().rev().copied());
    }
    if !words.is_empty() {
        return words.join(" ");
    }
    world.get::<Name>(button).map_or_else(|| button.to_string(), Name::to_string)
}

/// A finding for episodes in which every picture was of one colour. Only testers with pictures have any. An agent that
/// never gets an observation is a fault of the game, which is a finding of its own.
#[derive(Default)]
pub struct BlankPicture;

/// The blank episodes so far.
#[derive(Default)]
struct Counted(u64);

impl Detector for BlankPicture {
    fn name(&self) -> &'static str {
        "blank-picture"
    }

    fn describe(&self) -> &'static str {
        "every picture that the agent sees in an episode is of a single colour"
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatcher>> {
        Some(Box::<Counted>::default())
    }
}

impl WorldWatcher for Counted {
    fn tick(&mut self, moment: &WorldTick<'_>) -> Option<String> {
        let agents = moment.world.get_resource::<AgentOrder>()?.entities();
        let count = agents.iter().filter_map(|agent| moment.world.get::<BlankEpisodes>(*agent));
        let count = count.map(|blank| blank.episodes).sum();
        let before = std::mem::replace(&mut self.0, count);
        (count > before).then(|| "each picture of the episode was of a single colour".to_owned())
    }
}

/// A finding for a transform, an agent's position or an observation that is not a number, and for positions too far
/// from the origin.
pub struct Runaway {
    distance: f64,
}

impl Default for Runaway {
    fn default() -> Self {
        // Farther out, neighbouring f32 are more than a sixteenth apart.
        Self { distance: 1e6 }
    }
}

struct Numbers {
    most: f32,
}

/// A query that is reused for its World.
struct Transforms {
    most: f32,
    query: Option<(WorldId, QueryState<(Entity, &'static Transform)>)>,
}

impl Detector for Runaway {
    fn name(&self) -> &'static str {
        "runaway"
    }

    fn describe(&self) -> &'static str {
        "a transform, a position or an observation is not a number, or a position is too far from the origin"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new("distance", &mut self.distance, "distance from the origin that is too far")]
    }

    fn watch(&self, _level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        Some(Box::new(Numbers { most: self.distance as f32 }))
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatcher>> {
        Some(Box::new(Transforms { most: self.distance as f32, query: None }))
    }
}

impl EpisodeWatcher for Numbers {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        if let Some(index) = moment.observation.iter().position(|number| !number.is_finite()) {
            return Some(format!("value {index} of the observation is {}", moment.observation[index]));
        }
        let position = moment.position?;
        (!position.is_finite() || position.abs().max_element() > self.most)
            .then(|| format!("the agent is at {}, {}", position.x, position.y))
    }
}

impl Transforms {
    fn is_wrong(&self, transform: &Transform) -> bool {
        !transform.is_finite() || transform.translation.abs().max_element() > self.most
    }
}

impl WorldWatcher for Transforms {
    fn tick(&mut self, moment: &WorldTick<'_>) -> Option<String> {
        let world = moment.world;
        let (id, mut query) = match self.query.take() {
            Some((id, query)) if id == world.id() => (id, query),
            // Without such a query, the World has no transform yet.
            _ => (world.id(), world.try_query::<(Entity, &Transform)>()?),
        };
        let wrong = query.iter(world).find(|(_, transform)| self.is_wrong(transform));
        let message = wrong.map(|(entity, transform)| {
            let name = world.get::<Name>(entity).map_or_else(|| format!("entity {entity}"), |name| format!("`{name}`"));
            let Transform { translation, rotation, scale } = transform;
            format!("the transform of {name} is at {translation}, turned by {rotation:?} and scaled by {scale}")
        });
        self.query = Some((id, query));
        message
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, found_in, room};
    use bevy::prelude::Entity;
    use bevy_playbot::{headless::headless_app, prelude::*};

    #[test]
    fn a_world_that_stands_still_is_found() {
        let steps: Vec<Step> = (0..400).map(|tick| Step::at(tick, 5.0, 5.0)).collect();
        assert_eq!(found(&FrozenWorld::default(), &room(), &steps).map(|(tick, _)| tick), Some(300));
        assert_eq!(found(&FrozenWorld { ticks: 50.0 }, &room(), &steps).map(|(tick, _)| tick), Some(50));
    }

    #[test]
    fn a_held_key_and_a_world_that_moves_by_itself_are_sound() {
        let held: Vec<Step> = (0..400).map(|_| Step::at(0, 5.0, 5.0)).collect();
        assert_eq!(found(&FrozenWorld::default(), &room(), &held), None);
        let clock = |tick: usize| Step { seen: (tick / 200) as f32, ..Step::at(tick, 5.0, 5.0) };
        let steps: Vec<Step> = (0..600).map(clock).collect();
        assert_eq!(found(&FrozenWorld::default(), &room(), &steps), None);
    }

    #[test]
    fn a_world_that_stands_still_for_every_action_is_found_and_one_in_which_one_is_left_is_not() {
        let mut world = World::new();
        let agent = world.spawn(Agent::new(0, ActionSpace::Discrete(4))).id();
        let tick_of_finding = |world: &World, actions: [u32; 4]| {
            let mut watch = FrozenWorld::default().watch(&room()).expect("it looks at each level");
            (0..800u32).find(|tick| {
                // Each action is held for 100 ticks.
                let action = ActionValue::Discrete(actions[*tick as usize / 100 % 4]);
                let moment = DetectorTick { agent, tick: *tick, ..DetectorTick::of(world, &action) };
                watch.tick(&moment).is_some()
            })
        };
        assert_eq!(tick_of_finding(&world, [0, 1, 2, 3]), Some(300 + LATE), "the last one needs its time");
        assert_eq!(tick_of_finding(&world, [0, 1, 2, 1]), None, "the last one may have an effect");
        world.entity_mut(agent).insert(LegalActions::new([true, true, true, false]));
        assert_eq!(tick_of_finding(&world, [0, 1, 2, 1]), Some(300), "it is illegal");
    }

    /// Plays these choices up to the time limit, in a World that stands still after a number of ticks, and returns the tick
    /// of the finding.
    fn cut(world: &World, agent: Entity, actions: &[u32], moving: u32, success: bool) -> Option<u32> {
        let mut watch = FrozenWorld::default().watch(&room()).expect("it looks at each level");
        let ticks = actions.len() as u32;
        (0..).zip(actions).find_map(|(tick, action)| {
            let (action, observation) = (ActionValue::Discrete(*action), [tick.min(moving) as f32]);
            let moment = DetectorTick { agent, tick, observation: &observation, ..DetectorTick::of(world, &action) };
            let end = EpisodeEnd::Truncated;
            let result = EpisodeResult { level: 0, end, success, ticks, clipped: 0, total_reward: 0.0 };
            let now = watch.tick(&moment);
            let found = now.or_else(|| if tick + 1 == ticks { watch.end(&moment, &result) } else { None });
            found.map(|_| tick)
        })
    }

    /// Adds ticks without an action, up to this number in all.
    fn resting(actions: &[u32], ticks: usize) -> Vec<u32> {
        let mut all = actions.to_vec();
        all.resize(ticks, 0);
        all
    }

    #[test]
    fn a_short_episode_is_frozen_if_each_action_was_pressed_and_released() {
        let mut world = World::new();
        let agent = world.spawn(Agent::new(0, ActionSpace::Discrete(3))).id();
        let pressed = [[0; 4], [1; 4], [0; 4], [2; 4]].concat();
        let found = |actions: &[u32]| cut(&world, agent, actions, 0, false);
        assert_eq!(found(&resting(&pressed, 120)), Some(119), "when time is up");
        assert_eq!(found(&resting(&pressed, 31)), None, "the last press may still show its effect");
        assert_eq!(found(&resting(&pressed, 32)), Some(31), "16 ticks after it");
        assert_eq!(found(&resting(&pressed, 400)), Some(300), "a long one is found earlier");
        assert_eq!(found(&resting(&[0, 0, 1, 1, 2, 2], 120)), None, "the first button may be held on");
        assert_eq!(found(&resting(&[1, 1, 0, 0, 2, 2], 120)), None, "the first press may be that of the change before");
        assert_eq!(found(&[pressed.as_slice(), &[0, 1], &[2; 60]].concat()), Some(77), "each was released once");
        assert_eq!(found(&[&pressed[..12], &[2; 60]].concat()), None, "the last one is not released");
        assert_eq!(cut(&world, agent, &resting(&pressed, 120), 0, true), None, "it has won");
    }

    #[test]
    fn illegal_actions_need_no_press_and_who_may_only_wait_has_tried_nothing() {
        let mut world = World::new();
        let agent = world.spawn(Agent::new(0, ActionSpace::Discrete(3))).id();
        let mut found = |legal: [bool; 3], actions: &[u32]| {
            world.entity_mut(agent).insert(LegalActions::new(legal));
            cut(&world, agent, &resting(actions, 120), 0, false)
        };
        assert_eq!(found([true, true, false], &[0, 0, 1, 1]), Some(119));
        assert_eq!(found([true, true, true], &[0, 0, 1, 1]), None, "the third one was not tried");
        assert_eq!(found([true, false, false], &[]), None);
        assert_eq!(found([false, false, true], &[2; 120]), Some(119), "there is no rest between two presses");
    }

    #[test]
    fn what_changes_in_the_second_half_of_a_short_episode_is_sound() {
        let mut world = World::new();
        let agent = world.spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
        let actions = resting(&[vec![0; 70], vec![1; 4]].concat(), 120);
        assert_eq!(cut(&world, agent, &actions, 59, false), Some(119), "half of the 120 ticks");
        assert_eq!(cut(&world, agent, &actions, 60, false), None);
    }

    #[test]
    fn a_short_window_needs_shorter_episodes() {
        let least = |ticks: f64| FrozenWorld { ticks }.least_episode().ticks;
        assert_eq!((least(300.0), least(9.0)), (31, 10));
        assert_eq!(FrozenWorld::default().setting_for(20).as_deref(), Some("ticks=10"));
    }

    #[test]
    fn a_world_that_never_changed_says_so_and_one_that_stopped_does_not() {
        let message = |moving: usize| {
            let at = |tick: usize| Step { seen: tick.min(moving) as f32, ..Step::at(tick, 5.0, 5.0) };
            let steps: Vec<Step> = (0..400).map(at).collect();
            found(&FrozenWorld::default(), &room(), &steps)
        };
        let start = "nothing has changed since the start of the episode, for 300 ticks, whatever the agent did";
        assert_eq!(message(0), Some((300, start.to_owned())));
        let later = "nothing has changed for 300 ticks, whatever the agent did";
        assert_eq!(message(9), Some((309, later.to_owned())));
    }

    #[test]
    fn a_screen_is_described_by_the_registered_states() {
        #[derive(States, Clone, Debug, PartialEq, Eq, Hash, Reflect)]
        enum Stage {
            Title { page: u8 },
        }
        let mut world = World::new();
        assert_eq!(screen(&world), None, "nothing is registered");
        world.init_resource::<AppTypeRegistry>();
        world.insert_resource(State::new(Stage::Title { page: 2 }));
        assert_eq!(screen(&world), None, "the type of the state is not registered");
        world.resource::<AppTypeRegistry>().write().register::<State<Stage>>();
        assert_eq!(screen(&world).as_deref(), Some("the state `Stage` is `Title { page: 2 }`"));
    }

    #[test]
    fn an_episode_without_a_picture_of_anything_is_found_once() {
        let mut app = headless_app();
        let agent: Entity = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
        app.tick().expect("one agent");
        let mut watch = BlankPicture.watch_world().expect("it looks at Worlds");
        let mut reported = |app: &bevy::app::App| watch.tick(&WorldTick { world: app.world(), errors: &[] });
        assert_eq!(reported(&app), None, "an agent without a sensor is not blind");
        app.world_mut().entity_mut(agent).insert(BlankEpisodes::default());
        assert_eq!(reported(&app), None);
        if let Some(mut blank) = app.world_mut().get_mut::<BlankEpisodes>(agent) {
            blank.episodes = 1;
        }
        assert!(reported(&app).is_some_and(|message| message.contains("single colour")));
        assert_eq!(reported(&app), None);
    }

    #[test]
    fn transforms_that_are_no_numbers_or_too_far_are_found() {
        for (x, scale) in [(f32::NAN, 1.0), (2e6, 1.0), (0.0, f32::INFINITY)] {
            let mut world = World::new();
            world.spawn(Transform::from_xyz(1.0, 2.0, 3.0));
            world.spawn((Name::new("Ball"), Transform::from_xyz(x, 0.0, 0.0).with_scale(Vec3::splat(scale))));
            let message = found_in(&Runaway::default(), &world).expect("the ball is wrong");
            assert!(message.contains("`Ball`"), "{message}");
        }
    }

    #[test]
    fn a_sound_world_and_one_without_transforms_have_no_finding() {
        let mut world = World::new();
        assert_eq!(found_in(&Runaway::default(), &world), None);
        world.spawn(Transform::from_xyz(9e5, -9e5, 0.0));
        assert_eq!(found_in(&Runaway::default(), &world), None);
    }

    #[test]
    fn places_and_observations_are_looked_at_too() {
        let good = Step::at(0, 1.0, 1.0);
        assert_eq!(found(&Runaway::default(), &room(), std::slice::from_ref(&good)), None);
        let lost = Step::at(0, f32::INFINITY, 1.0);
        let blind = Step { seen: f32::NAN, ..good.clone() };
        for bad in [lost, blind] {
            assert_eq!(found(&Runaway::default(), &room(), &[good.clone(), bad]).map(|(tick, _)| tick), Some(1));
        }
    }
}
