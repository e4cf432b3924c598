//! Lengths of frames and of fixed steps, in games whose ticks are frames.

use bevy::{prelude::*, time::TimeUpdateStrategy};
use bevy_playbot::{
    action::{ActionSpace, ActionValue},
    agent::Agent,
    engine::TickSchedules,
    placement::TickPlacement,
    virtual_input::VirtualInput,
};
use serde::Serialize;
use std::{
    fmt,
    fmt::{Display, Formatter},
    time::Duration,
};

/// Frames and fixed steps of different lengths, in a game with systems in `FixedPreUpdate` or `FixedUpdate`. It is no
/// finding: many games ship so. But such a system sees one press of a key in each step of a frame, or in none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct UnequalSteps {
    /// Length of a frame, in game time.
    pub frame: Duration,
    /// Length of a fixed step.
    pub step: Duration,
}

impl UnequalSteps {
    /// Returns the lengths in a World, if they differ and that matters.
    pub(super) fn of(world: &World) -> Option<Self> {
        let placement = world.get_resource::<TickSchedules>()?.placement;
        let TimeUpdateStrategy::ManualDuration(frame) = *world.get_resource()? else { return None };
        let step = world.get_resource::<Time<Fixed>>()?.timestep();
        let schedules = world.get_resource::<Schedules>()?;
        let fixed = [schedules.get(FixedPreUpdate), schedules.get(FixedUpdate)];
        let has_systems = fixed.into_iter().flatten().any(|schedule| schedule.systems_len() > 0);
        let matters = placement == TickPlacement::Frame && has_systems && frame != step;
        matters.then_some(Self { frame, step })
    }

    /// Returns the lengths in a World whose agent presses keys or buttons, if they differ and that matters.
    pub fn of_presses(world: &World, agent: Entity) -> Option<Self> {
        Self::of(world).filter(|_| holds_keys(world, agent))
    }

    /// Describes the lengths and what to set in one line.
    pub fn line(&self) -> String {
        let Words { lengths, times, remedy } = self.words();
        format!(
            "{lengths}: systems in fixed steps see a key that was just pressed {times}, and once if you set {remedy}"
        )
    }

    fn words(self) -> Words {
        let Self { frame, step } = self;
        let milliseconds = |length: Duration| rounded(length.as_secs_f64() * 1000.0);
        let hz = |length: Duration| rounded(1.0 / length.as_secs_f64());
        let times = if frame < step { "once or not at all" } else { "once or more often" };
        Words {
            lengths: format!("a frame is {} ms, a fixed step {} ms", milliseconds(frame), milliseconds(step)),
            times,
            remedy: format!(
                "`.hz({:?})` in the adapter, or `Time::<Fixed>::from_hz({:?})` in the game",
                hz(step),
                hz(frame)
            ),
        }
    }
}

/// Lengths of frames and steps in words, with their effect and what makes them equal.
struct Words {
    lengths: String,
    times: &'static str,
    remedy: String,
}

/// Returns whether actions of an agent hold keys or buttons.
pub(super) fn holds_keys(world: &World, agent: Entity) -> bool {
    let (Some(input), Some(agent)) = (world.get::<VirtualInput>(agent), world.get::<Agent>(agent)) else {
        return false;
    };
    let ActionSpace::Discrete(actions) = agent.actions else { return false };
    let mut held = (0..actions as u32).map(|action| input.held(&ActionValue::Discrete(action)));
    held.any(|held| !held.buttons.is_empty() && !held.clicks)
}

impl Display for UnequalSteps {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Words { lengths, times, remedy } = self.words();
        writeln!(f, "Clocks: {lengths}")?;
        writeln!(f, "  Systems in fixed steps see a key that was just pressed {times}. They see it once if you set")?;
        writeln!(f, "  {remedy}.")
    }
}

/// Rounds to three decimals: the lengths have whole nanoseconds.
fn rounded(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_named_with_the_rates_that_make_them_equal() {
        let [frame, step] = [60.0, 64.0].map(|hz: f64| Duration::from_secs_f64(1.0 / hz));
        let text = UnequalSteps { frame, step }.to_string();
        for words in
            ["a frame is 16.667 ms, a fixed step 15.625 ms", "once or more often", "`.hz(64.0)`", "from_hz(60.0)`"]
        {
            assert!(text.contains(words), "`{words}` is missing in: {text}");
        }
        assert!(UnequalSteps { frame: step, step: frame }.to_string().contains("once or not at all"));
    }
}
