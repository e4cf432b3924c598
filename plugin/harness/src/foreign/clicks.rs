//! Clicks on buttons of Bevy's UI.

use crate::foreign::{
    ForeignGame,
    input::{Input, mask, rests_now},
    runtime::{ForeignCell, playing_agents},
};
use bevy::{
    camera::{NormalizedRenderTarget, RenderTarget},
    ecs::{component::ComponentId, observer::ObservedBy},
    input::InputSystems,
    picking::{
        backend::HitData,
        events::{Cancel, Click, Pointer, Press, Release},
        pointer::{Location, PointerButton, PointerId},
    },
    prelude::*,
    ui::{
        ComputedNode, ComputedStackIndex, ComputedUiRenderTargetInfo, ComputedUiTargetCamera, InteractionDisabled,
        UiGlobalTransform, UiSystems,
    },
    window::{PrimaryWindow, WindowRef},
};
use bevy_playbot::{
    action::Action,
    agent::Control,
    engine::{Renewal, TickSchedules, check_actions},
    episode::EpisodeEnded,
    systems::{ObserveSchedule, PlaybotSystems},
    unknown_name::{nearest, question},
    virtual_input::{ClickAreas, HeldInput, PointerPosition, PressSystems, PressesForPeople, VirtualInput},
};
use std::{fmt::Debug, time::Duration};

/// The clicks of an agent's actions on buttons of Bevy's UI, counted from its first episode on.
#[derive(Component, Clone, Debug, Default, PartialEq, Reflect)]
#[reflect(Component, Clone, Debug, Default, PartialEq)]
pub struct ButtonClicks {
    game: String,
    clicked: u32,
    missed: u32,
    warnings: Vec<String>,
    /// Buttons that were clicked on in this episode, and never existed then.
    absent: Vec<String>,
    /// Buttons that were clicked on in this episode, and existed.
    present: Vec<String>,
    /// Names of the buttons that existed at the last click that missed.
    others: Vec<String>,
    /// The button that is pressed in this frame without the mouse.
    next: Option<Entity>,
    /// The button that was pressed so in the last frame.
    down: Option<Entity>,
}

impl ButtonClicks {
    /// Returns the number of clicks on a button that was there.
    pub fn clicked(&self) -> u32 {
        self.clicked
    }

    /// Returns the number of clicks without effect: the button did not exist, was hidden or disabled, or shared its
    /// name with another one.
    pub fn missed(&self) -> u32 {
        self.missed
    }

    /// Returns the warnings about names, each once.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn warn(&mut self, warning: String) {
        if !self.warnings.contains(&warning) {
            tracing::warn!("{warning}");
            self.warnings.push(warning);
        }
    }

    /// Counts a click on the button of this name.
    fn note(&mut self, name: &str, found: &Found) {
        match found {
            Found::One(..) => self.clicked += 1,
            Found::Unreachable | Found::Missing(_) | Found::Several(_) => self.missed += 1,
        }
        match found {
            Found::Missing(others) => {
                self.others.clone_from(others);
                if !self.present.iter().chain(&self.absent).any(|known| known == name) {
                    self.absent.push(name.to_owned());
                }
            }
            Found::One(..) | Found::Unreachable | Found::Several(_) => {
                self.absent.retain(|absent| absent != name);
                if !self.present.iter().any(|present| present == name) {
                    self.present.push(name.to_owned());
                }
            }
        }
        if let Found::Several(paths) = found {
            let paths: Vec<String> = paths.iter().map(|path| format!("`{path}`")).collect();
            self.warn(format!(
                "the game `{}`: {} buttons are called `{name}`, so a click on it has no effect: name one of them in \
                 `.clicks` by a path of `Name`s. There are {}",
                self.game,
                paths.len(),
                paths.join(", ")
            ));
        }
    }

    /// Warns about buttons that never existed in the episode that ends.
    fn end_episode(&mut self) {
        self.present.clear();
        let others = std::mem::take(&mut self.others);
        for name in std::mem::take(&mut self.absent) {
            let known: Vec<&str> = others.iter().map(String::as_str).collect();
            let near = question(nearest(&name, &known));
            let there = match known.as_slice() {
                [] => "There was no button".to_owned(),
                known => format!("There was `{}`", known.join("`, `")),
            };
            self.warn(format!(
                "the game `{}`: in a whole episode there was no button `{name}` whenever an action of `.clicks` clicked \
                 on it{near}. {there}",
                self.game
            ));
        }
    }
}

/// Gives the agent its counts, if the game has clicks.
pub(super) fn equip(agent: &mut EntityWorldMut, game: &ForeignGame) {
    if game.description.input.clicks.is_empty() {
        return;
    }
    agent.insert(ButtonClicks { game: game.description.name.to_owned(), ..ButtonClicks::default() });
}

/// Adds the systems that click, if the game has clicks.
pub(super) fn add_clicks(app: &mut App, input: &Input) {
    if input.clicks.is_empty() {
        return;
    }
    let decide = TickSchedules::of(app).decide;
    app.add_systems(
        decide,
        // No other system changes the inputs of the agent's actions.
        aim.in_set(PlaybotSystems::Act).after(check_actions).before(PressSystems).ambiguous_with(PlaybotSystems::Act),
    )
    .add_systems(PreUpdate, press_without_mouse.after(InputSystems).after(UiSystems::Focus))
    .add_systems(ObserveSchedule, note_areas.after(mask))
    .add_observer(end_episode);
}

fn end_episode(event: On<EpisodeEnded>, mut agents: Query<&mut ButtonClicks>, mut commands: Commands) {
    let Ok(mut clicks) = agents.get_mut(event.entity) else { return };
    clicks.end_episode();
    // In the next episode it may be another entity, in a World that is built anew.
    if let Some(button) = clicks.down.take() {
        commands.queue(move |world: &mut World| end_press(world, button, PressEnd::Cancelled));
    }
}

/// Aims the click of this tick's action at its button.
fn aim(world: &mut World) {
    // A game with several agents has no clicks.
    let Some(&agent) = playing_agents(world).first() else { return };
    if world.get(agent) == Some(&Control::Human) && world.get::<PressesForPeople>(agent).is_none() {
        return;
    }
    // The counts of this agent outlive a World that is built anew.
    Renewal::carry_component::<ButtonClicks>(world);
    let Some(game) = world.get_resource::<ForeignCell>().map(|cell| cell.lock().game.clone()) else { return };
    let (first, names) = game.description.input.clicked();
    let is_resting = rests_now(world, agent, &game.description.input);
    let action = world.get::<Action>(agent).and_then(Action::discrete).filter(|_| !is_resting);
    let chosen = action.and_then(|action| (action as usize).checked_sub(first)).filter(|&number| number < names.len());
    let mut held = HeldInput::default();
    if let Some(number) = chosen {
        let found = find(world, &names[number]);
        if let Some(mut clicks) = world.get_mut::<ButtonClicks>(agent) {
            clicks.note(&names[number], &found);
            match found {
                Found::One(_, Target::At(position)) => held = held.click(position, MouseButton::Left),
                Found::One(button, Target::WithoutMouse) => clicks.next = Some(button),
                Found::Unreachable | Found::Missing(_) | Found::Several(_) => {}
            }
        }
    }
    if let Some(mut input) = world.get_mut::<VirtualInput>(agent) {
        for number in 0..names.len() {
            let held = if chosen == Some(number) { held.clone() } else { HeldInput::default() };
            input.set_action(first + number, held);
        }
    }
}

/// Notes the areas of the buttons for a person whose clicks become actions.
fn note_areas(world: &mut World) {
    let Some(&agent) = playing_agents(world).first() else { return };
    if world.get(agent) != Some(&Control::Human) || world.get::<PressesForPeople>(agent).is_none() {
        return;
    }
    let Some(game) = world.get_resource::<ForeignCell>().map(|cell| cell.lock().game.clone()) else { return };
    let mut windows = world.query_filtered::<&Window, With<PrimaryWindow>>();
    let Ok(scale) = windows.single(world).map(Window::scale_factor) else { return };
    let (first, names) = game.description.input.clicked();
    let mut buttons: Vec<(u32, u32, Rect)> = Vec::new();
    for (number, name) in names.iter().enumerate() {
        if let Found::One(button, Target::At(_)) = find(world, name)
            && let Some((depth, area)) = area(world, button, scale)
        {
            buttons.push((depth, (first + number) as u32, area));
        }
    }
    buttons.sort_by_key(|(depth, ..)| std::cmp::Reverse(*depth));
    let areas = buttons.into_iter().map(|(_, action, area)| (action, area)).collect();
    world.entity_mut(agent).insert(ClickAreas { first: first as u32, areas });
}

/// Presses the button of this frame, and lets go of that of the last one, where no mouse reaches them: by
/// `Interaction` and by the events of Bevy's picking. With a mouse, Bevy's own systems do both.
fn press_without_mouse(world: &mut World) {
    let mut agents = world.query::<&mut ButtonClicks>();
    let mut pressed = Vec::new();
    for mut clicks in agents.iter_mut(world) {
        if clicks.down.is_some() || clicks.next.is_some() {
            let (last, next) = (clicks.down.take(), clicks.next.take());
            clicks.down = next;
            pressed.push((last, next));
        }
    }
    for (last, next) in pressed {
        if let Some(button) = last {
            end_press(world, button, PressEnd::Released);
        }
        if let Some(button) = next {
            set_interaction(world, button, Interaction::Pressed);
            let press = |hit| Press { button: PointerButton::Primary, hit, count: 1 };
            trigger(world, button, press);
        }
    }
}

/// The end of a press without the mouse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PressEnd {
    /// The button was let go of, and is clicked on.
    Released,
    /// The episode is over.
    Cancelled,
}

fn end_press(world: &mut World, button: Entity, end: PressEnd) {
    set_interaction(world, button, Interaction::None);
    match end {
        PressEnd::Released => {
            // A duration by the clock would differ from run to run.
            let duration = Duration::ZERO;
            trigger(world, button, |hit| Click { button: PointerButton::Primary, hit, duration, count: 1 });
            trigger(world, button, |hit| Release { button: PointerButton::Primary, hit });
        }
        PressEnd::Cancelled => trigger(world, button, |hit| Cancel { hit }),
    }
}

fn set_interaction(world: &mut World, button: Entity, wanted: Interaction) {
    if let Some(mut interaction) = world.get_mut::<Interaction>(button) {
        *interaction = wanted;
    }
}

/// Triggers an event of the mouse at a button, and sends its message, as Bevy's picking does.
fn trigger<E: Clone + Debug + Reflect>(world: &mut World, button: Entity, event: impl FnOnce(HitData) -> E) {
    // An observer of the event before may have despawned it.
    if world.get_entity(button).is_err() {
        return;
    }
    let camera = world.get::<ComputedUiTargetCamera>(button).and_then(ComputedUiTargetCamera::get);
    let mut windows = world.query_filtered::<Entity, With<PrimaryWindow>>();
    let window = windows.single(world).ok();
    let target = camera.and_then(|camera| world.get::<RenderTarget>(camera)?.normalize(window));
    let target = target.or_else(|| RenderTarget::default().normalize(window));
    let target = target.unwrap_or(NormalizedRenderTarget::None { width: 0, height: 0 });
    let scale = camera.and_then(|camera| world.get::<Camera>(camera)?.target_scaling_factor()).unwrap_or(1.0);
    let position = camera.and_then(|camera| middle(world, button, camera)).unwrap_or(Vec2::ZERO) / scale;
    let hit = HitData::new(camera.unwrap_or(Entity::PLACEHOLDER), 0.0, None, None);
    let event = Pointer::new(PointerId::Mouse, Location { target, position }, event(hit), button);
    if let Some(mut messages) = world.get_resource_mut::<Messages<Pointer<E>>>() {
        messages.write(event.clone());
    }
    world.trigger(event);
    // Observers of the next event see what the commands of this one's do.
    world.flush();
}

/// The result of a search for a button.
#[derive(Debug, PartialEq)]
enum Found {
    One(Entity, Target),
    /// Hidden, disabled, outside of the window, or in another one.
    Unreachable,
    /// The paths of all buttons.
    Missing(Vec<String>),
    /// The paths of those that share the name.
    Several(Vec<String>),
}

/// The way in which a button is clicked on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Target {
    /// The mouse, at this position.
    At(PointerPosition),
    /// `Interaction` and events of Bevy's picking, where there is no layout, or no window that shows it.
    WithoutMouse,
}

/// Type paths of the widgets of `bevy_ui_widgets` that do something when they are clicked on. They have no `Interaction`,
/// and a game may have them while this crate is built without them.
const WIDGETS: [&str; 6] = [
    "bevy_ui_widgets::button::Button",
    "bevy_ui_widgets::checkbox::Checkbox",
    "bevy_ui_widgets::list::ListItem",
    "bevy_ui_widgets::menu::MenuItem",
    "bevy_ui_widgets::radio::RadioButton",
    "bevy_ui_widgets::slider::Slider",
];

/// Returns the widgets among the components of a World.
fn widgets(world: &World) -> Vec<ComponentId> {
    let Some(registry) = world.get_resource::<AppTypeRegistry>().map(|registry| registry.read()) else {
        return Vec::new();
    };
    let known = WIDGETS.iter().filter_map(|path| registry.get_with_type_path(path));
    known.filter_map(|known| world.components().get_id(known.type_id())).collect()
}

/// Finds the button of this name. Buttons that cannot be clicked on do not make a name ambiguous.
fn find(world: &mut World, name: &str) -> Found {
    let mut nodes = world.query_filtered::<EntityRef, With<Node>>();
    let mut windows = world.query_filtered::<(Entity, &Window), With<PrimaryWindow>>();
    let windows = windows.single(world).ok().map(|(entity, window)| (entity, window.size(), window.scale_factor()));
    let world: &World = world;
    let nodes: Vec<EntityRef> = nodes.iter(world).collect();
    let widgets = widgets(world);
    let is_button = |node: EntityRef| node.contains::<Interaction>() || widgets.iter().any(|id| node.contains_id(*id));
    let is_observed = |node: EntityRef| is_observed(world, node);
    // The texts of other nodes may be any text.
    let kinds: [&dyn Fn(EntityRef) -> bool; 3] = [&is_button, &is_observed, &|node| node.contains::<Name>()];
    let meant = |is_of_kind: &dyn Fn(EntityRef) -> bool| -> Vec<Entity> {
        let meant = nodes.iter().filter(|node| is_of_kind(**node) && is_called(world, node.id(), name));
        meant.map(EntityRef::id).collect()
    };
    let meant = kinds.into_iter().map(meant).find(|meant| !meant.is_empty());
    let paths = |entities: &mut dyn Iterator<Item = Entity>| {
        let mut paths: Vec<String> = entities.map(|entity| path(world, entity)).collect();
        paths.sort();
        paths
    };
    let Some(meant) = meant else {
        // A name finds no node that has none, such as a screen that a click closes.
        let has_name = |node: EntityRef| node.contains::<Name>() || !text(world, node.id()).is_empty();
        let is_known = |node: EntityRef| is_button(node) || (is_observed(node) && has_name(node));
        return Found::Missing(paths(&mut nodes.iter().filter(|node| is_known(**node)).map(EntityRef::id)));
    };
    let reachable = meant.iter().filter_map(|&button| Some((button, target(world, button, windows)?)));
    let reachable: Vec<(Entity, Target)> = reachable.collect();
    match reachable.as_slice() {
        [] => Found::Unreachable,
        [(button, target)] => Found::One(*button, *target),
        several => Found::Several(paths(&mut several.iter().map(|(button, _)| *button))),
    }
}

/// Returns whether an observer of its own hears of clicks on a node.
fn is_observed(world: &World, node: EntityRef) -> bool {
    let clicks = [
        world.event_key::<Pointer<Press>>(),
        world.event_key::<Pointer<Release>>(),
        world.event_key::<Pointer<Click>>(),
    ];
    let hears = |observer: &Observer| observer.descriptor().event_keys().iter().any(|key| clicks.contains(&Some(*key)));
    let observers = node.get::<ObservedBy>().map_or(&[][..], ObservedBy::get);
    observers.iter().any(|observer| world.get::<Observer>(*observer).is_some_and(hears))
}

/// Returns whether a name means this button: its text, its `Name`, or a path of `Name`s above it.
fn is_called(world: &World, button: Entity, name: &str) -> bool {
    if is_labelled(world, button, name) {
        return true;
    }
    let Some((above, own)) = name.rsplit_once('/') else { return false };
    if !is_labelled(world, button, own) {
        return false;
    }
    let mut above = above.rsplit('/').peekable();
    for ancestor in ancestors(world, button) {
        let Some(wanted) = above.peek() else { break };
        if world.get::<Name>(ancestor).is_some_and(|name| name.as_str() == *wanted) {
            above.next();
        }
    }
    above.peek().is_none()
}

fn is_labelled(world: &World, button: Entity, label: &str) -> bool {
    world.get::<Name>(button).is_some_and(|name| name.as_str() == label) || text(world, button) == label.trim()
}

/// Returns the path of a button, for messages: the `Name`s above it and its own, or its text.
fn path(world: &World, button: Entity) -> String {
    let name = |entity: Entity| world.get::<Name>(entity).map(|name| name.as_str().to_owned());
    let mut parts: Vec<String> = ancestors(world, button).filter_map(name).collect();
    parts.reverse();
    let text = text(world, button);
    let own = if text.is_empty() { name(button) } else { Some(text) };
    parts.push(own.unwrap_or_else(|| button.to_string()));
    parts.join("/")
}

fn ancestors(world: &World, entity: Entity) -> impl Iterator<Item = Entity> + '_ {
    std::iter::successors(Some(entity), move |&entity| world.get::<ChildOf>(entity).map(ChildOf::parent)).skip(1)
}

/// Returns the texts in a button, from first to last.
fn text(world: &World, entity: Entity) -> String {
    let mut all = String::new();
    add_text(world, entity, &mut all);
    all.trim().to_owned()
}

fn add_text(world: &World, entity: Entity, all: &mut String) {
    if let Some(text) = world.get::<Text>(entity) {
        all.push(' ');
        all.push_str(text.0.trim());
    } else if let Some(span) = world.get::<TextSpan>(entity) {
        all.push_str(&span.0);
    }
    for &child in world.get::<Children>(entity).into_iter().flatten() {
        add_text(world, child, all);
    }
}

/// Returns the way to click on a button, if a person could; `window` is the primary one, with its logical size and its
/// scale.
fn target(world: &World, button: Entity, window: Option<(Entity, Vec2, f32)>) -> Option<Target> {
    let is_hidden = world.get::<InheritedVisibility>(button).is_some_and(|visibility| !visibility.get());
    let is_folded = |entity: Entity| world.get::<Node>(entity).is_some_and(|node| node.display == Display::None);
    let is_gone = is_hidden || is_folded(button) || ancestors(world, button).any(is_folded);
    if is_gone || world.get::<InteractionDisabled>(button).is_some() {
        return None;
    }
    let info = world.get::<ComputedUiRenderTargetInfo>(button).copied().unwrap_or_default();
    let camera = world.get::<ComputedUiTargetCamera>(button).and_then(ComputedUiTargetCamera::get);
    let (true, Some(camera)) = (info.physical_size().min_element() > 0, camera) else {
        return Some(Target::WithoutMouse);
    };
    let (entity, size, scale) = window?;
    let is_shown = match world.get::<RenderTarget>(camera) {
        Some(RenderTarget::Window(WindowRef::Primary)) => true,
        Some(RenderTarget::Window(WindowRef::Entity(other))) => *other == entity,
        // Bevy finds no cursor on what is drawn into an image.
        _ => return Some(Target::WithoutMouse),
    };
    let is_empty = world.get::<ComputedNode>(button).is_none_or(ComputedNode::is_empty);
    if !is_shown || is_empty {
        return None;
    }
    let position = PointerPosition::Pixels(middle(world, button, camera)? / scale);
    position.within(size).map(|_| Target::At(position))
}

/// Returns the middle of a button in physical pixels of the window.
fn middle(world: &World, button: Entity, camera: Entity) -> Option<Vec2> {
    let corner = world.get::<Camera>(camera).and_then(Camera::physical_viewport_rect).map_or(UVec2::ZERO, |it| it.min);
    Some(world.get::<UiGlobalTransform>(button)?.translation + corner.as_vec2())
}

/// Returns the depth of a button, where a larger number is nearer to the front, and its area in logical pixels.
fn area(world: &World, button: Entity, scale: f32) -> Option<(u32, Rect)> {
    let camera = world.get::<ComputedUiTargetCamera>(button).and_then(ComputedUiTargetCamera::get)?;
    let node = world.get::<ComputedNode>(button)?;
    let depth = world.get::<ComputedStackIndex>(button)?.0;
    let middle = middle(world, button, camera)?;
    Some((depth, Rect::from_center_size(middle / scale, node.size / scale)))
}
