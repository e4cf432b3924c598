//! The clocks of a foreign game at the start of an episode.

use bevy::prelude::*;
use std::time::Duration;

/// Settings of a World's clocks: speed, pause, longest step, and the length of fixed steps.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClockSettings {
    virtual_clock: Option<Virtual>,
    step: Option<Duration>,
}

impl ClockSettings {
    /// Returns the current settings.
    pub(super) fn of(world: &World) -> Self {
        Self {
            virtual_clock: world.get_resource::<Time<Virtual>>().map(|clock| *clock.context()),
            step: world.get_resource::<Time<Fixed>>().map(|clock| clock.timestep()),
        }
    }

    /// Returns these settings for a clock that is not paused.
    pub(super) fn running(mut self) -> Self {
        if let Some(settings) = &mut self.virtual_clock {
            let mut clock = Time::new_with(*settings);
            clock.unpause();
            *settings = *clock.context();
        }
        self
    }

    /// Resets the clocks to the start of a program, with these settings: this frame has no length, and the next one is
    /// the first that has. Fixed steps are reset as well, for any remainder of the last episode.
    pub(super) fn start(self, world: &mut World) {
        if let (Some(mut clock), Some(settings)) = (world.get_resource_mut::<Time<Virtual>>(), self.virtual_clock) {
            *clock = Time::new_with(settings);
        }
        if let (Some(mut clock), Some(step)) = (world.get_resource_mut::<Time<Fixed>>(), self.step) {
            *clock = Time::<Fixed>::from_duration(step);
        }
        if let Some(mut clock) = world.get_resource_mut::<Time>() {
            *clock = Time::default();
        }
    }
}

/// Lets the game's clocks stand in this frame, at the time of the last one, as if it had no length. Timers and fixed
/// steps do not advance.
pub(super) fn stand_still(world: &mut World) {
    let Some(clock) = world.get_resource::<Time<Virtual>>() else { return };
    let mut standing = Time::new_with(*clock.context());
    standing.advance_by(clock.elapsed().saturating_sub(clock.delta()));
    standing.advance_by(Duration::ZERO);
    if let Some(mut clock) = world.get_resource_mut::<Time>() {
        *clock = standing.as_generic();
    }
    world.insert_resource(standing);
}

/// Sets the clock of the first tick after loading, for any number of frames. The game entered the level in the frame
/// before, and that counts as the first with a length. The clock keeps its speed.
pub(super) fn leave_loading_out(world: &mut World) {
    let Some(clock) = world.get_resource::<Time<Virtual>>() else { return };
    let (frame, mut fresh) = (clock.delta(), Time::new_with(*clock.context()));
    fresh.advance_by(frame);
    fresh.advance_by(frame);
    ClockSettings::of(world).start(world);
    if let Some(mut clock) = world.get_resource_mut::<Time<Fixed>>() {
        let step = clock.timestep();
        clock.accumulate_overstep(frame);
        while clock.overstep() >= step {
            clock.discard_overstep(step);
            clock.advance_by(step);
        }
    }
    if let Some(mut clock) = world.get_resource_mut::<Time<Virtual>>() {
        *clock = fresh;
    }
    if let Some(mut clock) = world.get_resource_mut::<Time>() {
        *clock = fresh.as_generic();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_start_brings_back_speed_pause_and_fixed_steps() {
        let mut world = World::new();
        world.init_resource::<Time>();
        world.init_resource::<Time<Virtual>>();
        world.insert_resource(Time::<Fixed>::from_hz(50.0));
        let begun = ClockSettings::of(&world);
        let mut clock = world.resource_mut::<Time<Virtual>>();
        clock.set_relative_speed(0.25);
        clock.pause();
        clock.set_max_delta(Duration::from_secs(3));
        clock.advance_by(Duration::from_secs(9));
        world.resource_mut::<Time<Fixed>>().set_timestep_hz(10.0);
        begun.start(&mut world);
        let clock = world.resource::<Time<Virtual>>();
        assert_eq!((clock.relative_speed(), clock.is_paused(), clock.elapsed()), (1.0, false, Duration::ZERO));
        assert_eq!(clock.max_delta(), Duration::from_millis(250));
        assert_eq!(world.resource::<Time<Fixed>>().timestep(), Duration::from_millis(20));
    }

    #[test]
    fn a_standing_clock_is_at_the_time_of_the_last_frame_and_goes_on_from_there() {
        let mut world = World::new();
        world.init_resource::<Time>();
        let mut clock = Time::<Virtual>::default();
        clock.set_relative_speed(2.0);
        clock.advance_by(Duration::from_millis(30));
        clock.advance_by(Duration::from_millis(20));
        world.insert_resource(clock);
        for _ in 0..2 {
            stand_still(&mut world);
            let (clock, game) = (world.resource::<Time<Virtual>>(), world.resource::<Time>());
            assert_eq!((clock.elapsed(), clock.delta()), (Duration::from_millis(30), Duration::ZERO));
            assert_eq!((game.elapsed(), game.delta()), (Duration::from_millis(30), Duration::ZERO));
            assert_eq!(clock.relative_speed(), 2.0);
        }
        world.resource_mut::<Time<Virtual>>().advance_by(Duration::from_millis(20));
        assert_eq!(world.resource::<Time<Virtual>>().elapsed(), Duration::from_millis(50));
    }

    #[test]
    fn a_running_clock_keeps_its_speed() {
        let mut world = World::new();
        world.init_resource::<Time<Virtual>>();
        let mut clock = world.resource_mut::<Time<Virtual>>();
        clock.set_relative_speed(2.0);
        clock.pause();
        ClockSettings::of(&world).running().start(&mut world);
        let clock = world.resource::<Time<Virtual>>();
        assert_eq!((clock.relative_speed(), clock.is_paused()), (2.0, false));
    }
}
