//! Actions of `leafwing-input-manager`, driven without any key.
//!
//! A [`VirtualInput`](super::VirtualInput) drives them through their keys, without this module. Use it where actions
//! have no keys, or where fixed ticks need an action in the tick that decides it. An `ActionState` reads its keys
//! before the first fixed tick of a frame.

use crate::{
    action::{Action, ActionValue},
    agent::{Agent, Control},
    episode::{Episode, EpisodeEnded, StartEpisode},
    fault::Faults,
    placement::is_tick,
    systems::PlaybotSystems,
    virtual_input::{
        InputRoute,
        claims::{check_claims, is_virtual},
    },
};
use bevy::prelude::*;
use leafwing_input_manager::{
    Actionlike, InputControlKind, action_state::ActionState, buttonlike::ButtonState, plugin::InputManagerSystem,
};

/// On an agent: the actions of the game that its own actions press and push.
///
/// They belong to the `ActionState` on the agent itself, on the entity that [`on_entity`](Self::on_entity) names, or
/// else to the only one in the World. People keep their keys: under `Human` and `Idle` nothing is changed.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_playbot::virtual_input::leafwing::LeafwingActions;
/// use leafwing_input_manager::prelude::*;
///
/// #[derive(Actionlike, Clone, Copy, Debug, PartialEq, Eq, Hash, Reflect)]
/// enum Move {
///     Left,
///     Right,
///     Jump,
/// }
///
/// // Actions 0 to 3: stand, left, right, jump to the right.
/// let actions = LeafwingActions::default().press(Move::Left, [1]).press(Move::Right, [2, 3]).press(Move::Jump, [3]);
/// # let _ = actions;
/// ```
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub struct LeafwingActions<A: Actionlike> {
    drives: Vec<(A, Drive)>,
    target: Option<Entity>,
    held: Vec<A>,
}

#[derive(Clone, Debug)]
enum Drive {
    /// Pressed while the discrete action is one of these.
    On(Vec<u32>),
    /// Pressed while this value of the continuous action is above the threshold.
    Above(usize, f32),
    /// Set to this value of the continuous action.
    Value(usize),
    /// Set to these two values of the continuous action.
    Pair(usize, usize),
}

impl<A: Actionlike> Default for LeafwingActions<A> {
    fn default() -> Self {
        Self { drives: Vec::new(), target: None, held: Vec::new() }
    }
}

impl<A: Actionlike> LeafwingActions<A> {
    /// Presses a button while the agent's discrete action is one of these.
    pub fn press(self, action: A, on: impl Into<Vec<u32>>) -> Self {
        self.with(action, Drive::On(on.into()))
    }

    /// Presses a button while value `index` of the agent's continuous action is above `threshold`.
    pub fn press_above(self, action: A, index: usize, threshold: f32) -> Self {
        self.with(action, Drive::Above(index, threshold))
    }

    /// Sets an axis to value `index` of the agent's continuous action.
    pub fn value(self, action: A, index: usize) -> Self {
        self.with(action, Drive::Value(index))
    }

    /// Sets a dual axis to values `x` and `y` of the agent's continuous action.
    pub fn pair(self, action: A, x: usize, y: usize) -> Self {
        self.with(action, Drive::Pair(x, y))
    }

    /// Names the entity with the `ActionState`.
    pub fn on_entity(mut self, entity: Entity) -> Self {
        self.target = Some(entity);
        self
    }

    fn with(mut self, action: A, drive: Drive) -> Self {
        self.drives.push((action, drive));
        self
    }
}

/// Drives the actions `A` of agents with [`LeafwingActions`], in ticks that are frames or fixed, as the route says.
#[derive(Clone, Copy, Debug)]
pub struct LeafwingActionsPlugin<A> {
    /// The route, as for [`VirtualInputPlugin`](crate::virtual_input::VirtualInputPlugin).
    pub route: InputRoute,
    marker: std::marker::PhantomData<fn() -> A>,
}

impl<A> LeafwingActionsPlugin<A> {
    /// Returns the plugin for this route.
    pub fn new(route: InputRoute) -> Self {
        Self { route, marker: std::marker::PhantomData }
    }
}

impl<A> Default for LeafwingActionsPlugin<A> {
    fn default() -> Self {
        Self::new(InputRoute::default())
    }
}

impl<A: Actionlike> Plugin for LeafwingActionsPlugin<A> {
    fn build(&self, app: &mut App) {
        match self.route {
            InputRoute::Messages => {
                let system = drive::<A>.in_set(InputManagerSystem::ManualControl).after(PlaybotSystems::Act);
                // A takeover after this tick's decisions takes effect in the next one.
                app.add_systems(PreUpdate, system.run_if(is_tick).ambiguous_with_all())
            }
            // Other managers have actions of their own.
            InputRoute::Direct => app.add_systems(
                FixedPreUpdate,
                drive::<A>.in_set(PlaybotSystems::Act).after(check_claims).ambiguous_with(PlaybotSystems::Act),
            ),
        };
        app.register_type::<LeafwingActions<A>>();
        app.add_observer(|event: On<StartEpisode>, agents: Agents<A>, states: States<A>| {
            let_go(event.entity, agents, states);
        })
        .add_observer(|event: On<EpisodeEnded>, agents: Agents<A>, states: States<A>| {
            let_go(event.entity, agents, states);
        });
    }
}

type Agents<'w, 's, A> = Query<
    'w,
    's,
    (Entity, &'static Agent, &'static Action, &'static Control, &'static Episode, &'static mut LeafwingActions<A>),
>;

type States<'w, 's, A> = Query<'w, 's, (Entity, &'static mut ActionState<A>)>;

/// Returns the entity whose `ActionState` an agent drives.
fn state_of<A: Actionlike>(agent: Entity, target: Option<Entity>, states: &States<A>) -> Option<Entity> {
    let named = target.unwrap_or(agent);
    if states.contains(named) {
        return Some(named);
    }
    states.single().ok().filter(|_| target.is_none()).map(|(entity, _)| entity)
}

fn drive<A: Actionlike>(mut agents: Agents<A>, mut states: States<A>, mut faults: ResMut<Faults>) {
    for (entity, agent, action, control, episode, mut actions) in &mut agents {
        let is_played = is_virtual(*control, false) && episode.is_running();
        if !is_played && actions.held.is_empty() {
            continue;
        }
        let found = state_of(entity, actions.target, &states);
        let Some((_, mut state)) = found.and_then(|entity| states.get_mut(entity).ok()) else {
            faults.report(format!(
                "agent {}: there is no `ActionState<{}>` on it, and not exactly one in the World: name its entity with \
                 `LeafwingActions::on_entity`",
                agent.index,
                A::short_type_path()
            ));
            continue;
        };
        let LeafwingActions { drives, held, .. } = &mut *actions;
        let mut pressed = Vec::new();
        if is_played {
            apply(drives, &action.0, &mut state, &mut pressed);
        }
        for action in pressed.iter().filter(|action| !held.contains(action)) {
            set_button(&mut state, action, ButtonState::JustPressed);
        }
        // Without their keys the manager has released them at the start of this frame.
        for action in held.iter() {
            let is_pressed = pressed.contains(action);
            set_button(&mut state, action, if is_pressed { ButtonState::Pressed } else { ButtonState::JustReleased });
        }
        *held = pressed;
    }
}

/// Sets the axes, and returns the buttons that are to be down.
fn apply<A: Actionlike>(drives: &[(A, Drive)], value: &ActionValue, state: &mut ActionState<A>, pressed: &mut Vec<A>) {
    let number = |index: &usize| match value {
        ActionValue::Continuous(values) | ActionValue::Mixed { numbers: values, .. } => {
            values.get(*index).copied().unwrap_or(0.0)
        }
        ActionValue::Discrete(_) => 0.0,
    };
    let mut press_if = |is_on: bool, action: &A| {
        if is_on && !pressed.contains(action) {
            pressed.push(action.clone());
        }
    };
    for (action, drive) in drives {
        match (drive, action.input_control_kind()) {
            (Drive::On(on), InputControlKind::Button) => {
                press_if(matches!(value, ActionValue::Discrete(index) if on.contains(index)), action);
            }
            (Drive::Above(index, threshold), InputControlKind::Button) => press_if(number(index) > *threshold, action),
            (Drive::Value(index), InputControlKind::Axis) => state.set_value(action, number(index)),
            (Drive::Pair(x, y), InputControlKind::DualAxis) => {
                state.set_axis_pair(action, Vec2::new(number(x), number(y)));
            }
            // An action of another kind than the drive has no value to set.
            _ => {}
        }
    }
}

fn set_button<A: Actionlike>(state: &mut ActionState<A>, action: &A, button: ButtonState) {
    let data = state.button_data_mut_or_default(action);
    data.state = button;
    data.value = if button.pressed() { 1.0 } else { 0.0 };
}

/// Releases the actions, so that an episode begins with nothing held.
fn let_go<A: Actionlike>(agent: Entity, mut agents: Agents<A>, mut states: States<A>) {
    let Ok((.., mut actions)) = agents.get_mut(agent) else { return };
    let held = std::mem::take(&mut actions.held);
    let found = state_of(agent, actions.target, &states);
    if let Some((_, mut state)) = found.and_then(|entity| states.get_mut(entity).ok()) {
        for action in &held {
            set_button(&mut state, action, ButtonState::Released);
        }
    }
}
