//! Claims of agents to the one keyboard and the one mouse of a World.

use crate::{
    agent::{Agent, AgentOrder, Control},
    fault::Faults,
    virtual_input::{
        PressesForPeople, VirtualInput,
        button::{VirtualAxis, VirtualButton},
    },
};
use bevy::{prelude::*, window::PrimaryWindow};

/// Returns whether virtual input plays under this control; `for_people` includes people.
pub(super) fn is_virtual(control: Control, for_people: bool) -> bool {
    match control {
        Control::Bot | Control::Policy | Control::Replay => true,
        Control::Human => for_people,
        Control::Idle => false,
    }
}

/// An input that only one agent of a World can have.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Claim {
    Button(VirtualButton),
    Axis(VirtualAxis),
    Cursor,
    TouchScreen,
}

impl Claim {
    fn name(self) -> String {
        match self {
            Self::Button(button) => button.to_string(),
            Self::Axis(axis) => format!("{axis:?}"),
            Self::Cursor => "the mouse cursor".to_owned(),
            Self::TouchScreen => "the touch screen".to_owned(),
        }
    }
}

/// Reports agents whose mapping does not fit their actions, and agents that claim the inputs of another one, and
/// stops them.
pub(super) fn check_claims(
    order: Res<AgentOrder>,
    mut agents: Query<(&Agent, &VirtualInput, &mut Control, Has<PressesForPeople>)>,
    windows: Query<&Window, With<PrimaryWindow>>,
    mut faults: ResMut<Faults>,
    mut claims: Local<Vec<(Claim, u32)>>,
) {
    claims.clear();
    let window = windows.single().ok().map(Window::size);
    for &entity in order.entities() {
        let Ok((agent, input, mut control, for_people)) = agents.get_mut(entity) else { continue };
        if !is_virtual(*control, for_people) {
            continue;
        }
        let wanted = claims_of(input);
        if let Some(fault) =
            misfit(agent, input).or_else(|| outside(agent, input, window)).or_else(|| conflict(agent, &wanted, &claims))
        {
            faults.report(fault);
            *control = Control::Idle;
            continue;
        }
        claims.extend(wanted.into_iter().map(|claim| (claim, agent.index)));
    }
}

impl VirtualInput {
    /// Returns the name of an input of keyboard, mouse or touch screen that both mappings may press or move. Two agents of
    /// one World cannot have such mappings. Each of them has a gamepad of its own.
    pub fn shared_with(&self, other: &Self) -> Option<String> {
        let others = claims_of(other);
        claims_of(self).into_iter().find(|claim| others.contains(claim)).map(Claim::name)
    }
}

/// Returns all inputs that a mapping may press or move, except the agent's own gamepad.
fn claims_of(input: &VirtualInput) -> Vec<Claim> {
    let reach = input.reach();
    let buttons = reach.buttons.iter().filter(|button| !matches!(button, VirtualButton::Gamepad(_)));
    let axes = reach.axes.iter().filter(|(axis, _)| !axis.is_gamepad());
    let pointers = [reach.cursor.map(|_| Claim::Cursor), reach.tap.map(|_| Claim::TouchScreen)];
    let axes = axes.map(|(axis, _)| Claim::Axis(*axis));
    buttons.copied().map(Claim::Button).chain(axes).chain(pointers.into_iter().flatten()).collect()
}

/// Returns why a mapping does not fit the actions of its agent.
fn misfit(agent: &Agent, input: &VirtualInput) -> Option<String> {
    let Agent { index, actions } = agent;
    if input.space() != *actions {
        return Some(format!(
            "agent {index}: its `VirtualInput` is for {}, and it has {actions}; name what every action holds, with \
             an empty set for those that hold nothing",
            input.space()
        ));
    }
    input.has_stray_sets().then(|| {
        format!(
            "agent {index}: its `VirtualInput` has sets of buttons for discrete actions, and it has {actions}: \
             press buttons with an axis made by `ActionAxis::buttons`"
        )
    })
}

/// Returns why a position of a mapping cannot be pointed at in a window of this size, if there is one.
fn outside(agent: &Agent, input: &VirtualInput, window: Option<Vec2>) -> Option<String> {
    let index = agent.index;
    for (action, position) in input.positions() {
        let Some(size) = window else {
            return Some(format!(
                "agent {index}: action {action} of its `VirtualInput` points at {position}, and the app has no primary \
                 window: add Bevy's `WindowPlugin`, which is part of `DefaultPlugins`"
            ));
        };
        // A minimised window may have no size, until it is restored.
        if size.min_element() > 0.0 && position.within(size).is_none() {
            return Some(format!(
                "agent {index}: action {action} of its `VirtualInput` points at {position}, outside of the window of {} \
                 by {}: give a position inside, or a fraction of the window, `PointerPosition::fraction`",
                size.x, size.y
            ));
        }
    }
    None
}

/// Returns why an agent cannot have its inputs: an earlier agent has claimed them.
fn conflict(agent: &Agent, wanted: &[Claim], claims: &[(Claim, u32)]) -> Option<String> {
    let (claim, other) = wanted.iter().find_map(|claim| claims.iter().find(|(taken, _)| taken == claim))?;
    Some(format!(
        "agents {other} and {} both claim {}: a World has one keyboard and one mouse; give each agent keys of its own, or a \
         World of its own",
        agent.index,
        claim.name()
    ))
}
