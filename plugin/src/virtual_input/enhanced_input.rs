//! Actions of `bevy_enhanced_input`, driven without any key.
//!
//! A [`VirtualInput`](super::VirtualInput) drives them through their bindings, without this module. Use it where
//! actions have no bindings that a bot can press, or to skip conditions such as `Hold`.

use crate::{
    action::{Action, ActionValue},
    agent::{Agent, Control},
    episode::{Episode, EpisodeEnded, StartEpisode},
    fault::Faults,
    systems::PlaybotSystems,
    virtual_input::{
        InputRoute,
        claims::{check_claims, is_virtual},
    },
};
use bevy::{prelude::*, reflect::utility::GenericTypePathCell};
use bevy_enhanced_input::prelude::{
    Action as InputActionOf, ActionMock, ActionValue as InputValue, EnhancedInputSystems, InputAction, MockSpan,
    TriggerState,
};
use std::{any::type_name, marker::PhantomData, sync::Arc};

/// On an agent: the value that its action gives to the input action `A` of the game.
///
/// The input action is the entity that [`on_entity`](Self::on_entity) names, or else the only one in the World. A
/// value of zero, or `false`, does not fire. People keep their bindings: under `Human` and `Idle` nothing is changed.
///
/// ```
/// use bevy::prelude::*;
/// use bevy_enhanced_input::prelude::*;
/// use bevy_playbot::virtual_input::enhanced_input::EnhancedAction;
///
/// #[derive(InputAction)]
/// #[action_output(Vec2)]
/// struct Walk;
///
/// // Actions 0 to 2: stand, left, right.
/// let walk = EnhancedAction::<Walk>::per_action([Vec2::ZERO, Vec2::NEG_X, Vec2::X]);
/// # let _ = walk;
/// ```
#[derive(Component, Reflect)]
#[reflect(from_reflect = false, type_path = false)]
#[reflect(Component)]
pub struct EnhancedAction<A: InputAction> {
    #[reflect(ignore)]
    value: Arc<dyn Fn(&ActionValue) -> InputValue + Send + Sync>,
    target: Option<Entity>,
    is_mocked: bool,
    #[reflect(ignore)]
    marker: PhantomData<fn() -> A>,
}

/// The path of the input action's type is left out, because games need not derive reflection for it.
impl<A: InputAction> TypePath for EnhancedAction<A> {
    fn type_path() -> &'static str {
        static PATHS: GenericTypePathCell = GenericTypePathCell::new();
        PATHS.get_or_insert::<Self, _>(|| format!("{}::EnhancedAction<{}>", module_path!(), type_name::<A>()))
    }

    fn short_type_path() -> &'static str {
        static PATHS: GenericTypePathCell = GenericTypePathCell::new();
        PATHS.get_or_insert::<Self, _>(|| {
            format!("EnhancedAction<{}>", type_name::<A>().rsplit("::").next().unwrap_or("?"))
        })
    }
}

impl<A: InputAction> EnhancedAction<A> {
    /// Creates a rule from the agent's action to the value of the input action.
    pub fn new<V: Into<InputValue>>(value: impl Fn(&ActionValue) -> V + Send + Sync + 'static) -> Self {
        let value = Arc::new(move |action: &ActionValue| value(action).into());
        Self { value, target: None, is_mocked: false, marker: PhantomData }
    }

    /// Creates a rule with one value for each discrete action.
    ///
    /// The first value stands in for actions without one. Without any value the action never fires.
    pub fn per_action<V: Into<InputValue>>(values: impl IntoIterator<Item = V>) -> Self {
        let values: Vec<InputValue> = values.into_iter().map(Into::into).collect();
        Self::new(move |action| {
            let index = match action {
                ActionValue::Discrete(index) => *index as usize,
                ActionValue::Continuous(_) | ActionValue::Mixed { .. } => 0,
            };
            values.get(index).or(values.first()).copied().unwrap_or(InputValue::Bool(false))
        })
    }

    /// Names the entity of the input action.
    pub fn on_entity(mut self, entity: Entity) -> Self {
        self.target = Some(entity);
        self
    }
}

/// Drives the input action `A` of agents with an [`EnhancedAction`], in ticks that are frames or fixed, as the route
/// says.
///
/// The game's context must be evaluated in the same schedule as the tick. For frames that is `PreUpdate`, the
/// default; for fixed ticks use `add_input_context_to::<FixedPreUpdate, _>()`.
#[derive(Clone, Copy, Debug)]
pub struct EnhancedActionPlugin<A> {
    /// The route, as for [`VirtualInputPlugin`](crate::virtual_input::VirtualInputPlugin).
    pub route: InputRoute,
    marker: PhantomData<fn() -> A>,
}

impl<A> EnhancedActionPlugin<A> {
    /// Returns the plugin for this route.
    pub fn new(route: InputRoute) -> Self {
        Self { route, marker: PhantomData }
    }
}

impl<A> Default for EnhancedActionPlugin<A> {
    fn default() -> Self {
        Self::new(InputRoute::default())
    }
}

impl<A: InputAction> Plugin for EnhancedActionPlugin<A> {
    fn build(&self, app: &mut App) {
        let system = drive::<A>
            .in_set(PlaybotSystems::Act)
            .after(check_claims)
            // Other managers have actions of their own.
            .ambiguous_with(PlaybotSystems::Act)
            .before(EnhancedInputSystems::Update);
        match self.route {
            InputRoute::Messages => app.add_systems(PreUpdate, system),
            InputRoute::Direct => app.add_systems(FixedPreUpdate, system),
        };
        app.register_type::<EnhancedAction<A>>();
        app.add_observer(|event: On<StartEpisode>, agents: Agents<A>, mocks: Mocks<A>| {
            let_go(event.entity, agents, mocks);
        })
        .add_observer(|event: On<EpisodeEnded>, agents: Agents<A>, mocks: Mocks<A>| {
            let_go(event.entity, agents, mocks);
        });
    }
}

type Agents<'w, 's, A> = Query<
    'w,
    's,
    (&'static Agent, &'static Action, &'static Control, &'static Episode, &'static mut EnhancedAction<A>),
>;

type Mocks<'w, 's, A> =
    Query<'w, 's, (Entity, &'static mut ActionMock, &'static mut TriggerState), With<InputActionOf<A>>>;

/// Returns the entity of the input action that an agent drives.
fn action_of<A: InputAction>(target: Option<Entity>, mocks: &Mocks<A>) -> Option<Entity> {
    match target {
        Some(entity) => Some(entity).filter(|entity| mocks.contains(*entity)),
        None => mocks.single().ok().map(|(entity, ..)| entity),
    }
}

fn drive<A: InputAction>(mut agents: Agents<A>, mut mocks: Mocks<A>, mut faults: ResMut<Faults>) {
    for (agent, action, control, episode, mut driven) in &mut agents {
        let is_played = is_virtual(*control, false) && episode.is_running();
        if !is_played && !driven.is_mocked {
            continue;
        }
        let found = action_of(driven.target, &mocks);
        let Some((_, mut mock, _)) = found.and_then(|entity| mocks.get_mut(entity).ok()) else {
            faults.report(format!(
                "agent {}: there is not exactly one `Action<{}>` in the World: name its entity with \
                 `EnhancedAction::on_entity`",
                agent.index,
                ShortName::of::<A>()
            ));
            continue;
        };
        driven.is_mocked = is_played;
        if !is_played {
            mock.enabled = false;
            continue;
        }
        let value = (driven.value)(&action.0);
        let state = if value.as_bool() { TriggerState::Fired } else { TriggerState::None };
        *mock = ActionMock::new(state, value, MockSpan::Manual);
    }
}

/// Releases the action, so that an episode begins with nothing fired.
fn let_go<A: InputAction>(agent: Entity, mut agents: Agents<A>, mut mocks: Mocks<A>) {
    let Ok((.., mut driven)) = agents.get_mut(agent) else { return };
    if !std::mem::take(&mut driven.is_mocked) {
        return;
    }
    let found = action_of(driven.target, &mocks);
    if let Some((_, mut mock, mut state)) = found.and_then(|entity| mocks.get_mut(entity).ok()) {
        mock.enabled = false;
        *state = TriggerState::None;
    }
}
