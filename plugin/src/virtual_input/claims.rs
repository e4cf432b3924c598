//! One World, one keyboard, one mouse.

use bevy::prelude::*;

use super::{axis::VirtualAxis, button::VirtualButton, component::VirtualInput, person::PressesForPeople};
use crate::{
    agent::{Agent, AgentOrder},
    control::Control,
    fault::Faults,
};

/// Whether this is played by virtual input: `for_people` says whether people are.
pub(super) fn is_virtual(control: Control, for_people: bool) -> bool {
    match control {
        Control::Bot | Control::Policy | Control::Replay => true,
        Control::Human => for_people,
        Control::Idle => false,
    }
}

/// What only one agent of a World can have.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Claim {
    Button(VirtualButton),
    Axis(VirtualAxis),
}

impl Claim {
    fn name(self) -> String {
        match self {
            Self::Button(button) => button.to_string(),
            Self::Axis(axis) => format!("{axis:?}"),
        }
    }
}

/// Reports agents whose mapping does not fit their actions, and agents that want what another one has, and stops them.
pub(super) fn check_claims(
    order: Res<AgentOrder>,
    mut agents: Query<(&Agent, &VirtualInput, &mut Control, Has<PressesForPeople>)>,
    mut faults: ResMut<Faults>,
    mut claims: Local<Vec<(Claim, u32)>>,
) {
    claims.clear();
    for &entity in order.entities() {
        let Ok((agent, input, mut control, for_people)) = agents.get_mut(entity) else { continue };
        if !is_virtual(*control, for_people) {
            continue;
        }
        if input.space() != agent.actions {
            faults.report(format!(
                "agent {}: its `VirtualInput` is for {:?}, its actions are {:?}; name what every action holds, with an \
                 empty set for those that hold nothing",
                agent.index,
                input.space(),
                agent.actions
            ));
            *control = Control::Idle;
            continue;
        }
        if input.is_mixed() {
            faults.report(format!(
                "agent {}: its `VirtualInput` has sets of buttons for discrete actions, and its actions are {:?}: give \
                 the axis that shall press them `ActionAxis::buttons`",
                agent.index, agent.actions
            ));
            *control = Control::Idle;
            continue;
        }
        let reach = input.reach();
        let buttons = reach.buttons.iter().filter(|button| !matches!(button, VirtualButton::Gamepad(_)));
        let axes = reach.axes.iter().filter(|(axis, _)| !axis.is_gamepad());
        let wants: Vec<Claim> =
            buttons.copied().map(Claim::Button).chain(axes.map(|(axis, _)| Claim::Axis(*axis))).collect();
        let taken = |claim: &Claim| claims.iter().find(|(other, _)| other == claim).map(|(_, index)| (*claim, *index));
        if let Some((claim, other)) = wants.iter().find_map(taken) {
            faults.report(format!(
                "agents {other} and {} both claim {}: a World has one keyboard and one mouse; give each agent keys of its \
                 own, or a World of its own",
                agent.index,
                claim.name()
            ));
            *control = Control::Idle;
            continue;
        }
        claims.extend(wants.into_iter().map(|claim| (claim, agent.index)));
    }
}
