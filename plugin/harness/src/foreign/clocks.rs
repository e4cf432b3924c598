//! The clocks of a foreign game at the start of an episode, and the clock of changes.

use bevy::{
    ecs::{change_detection::Tick, schedule::InternedScheduleLabel},
    platform::collections::HashMap,
    prelude::*,
};
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

/// A system of a World: its schedule, and its place in it. Worlds of one game agree about it.
type SystemPlace = (InternedScheduleLabel, usize);

/// The systems that ran in the last frame of a World, and the length of that frame, by Bevy's clock of changes.
///
/// A system sees a change if it is newer than its own last run. Systems that only some frames run, such as those of a new
/// state, make a frame longer, so the age of a change does not tell which systems have seen it.
pub(super) struct LastFrame {
    length: u32,
    /// Systems and the ages of their last runs, the latest first.
    runs: Vec<(SystemPlace, u32)>,
}

impl LastFrame {
    /// Returns the frame that began at a tick of the World. Call it while no schedule runs.
    pub(super) fn since(frame: Tick, world: &World) -> Self {
        let now = world.read_change_tick();
        let length = now.get().wrapping_sub(frame.get());
        let mut runs = Vec::new();
        for (_, schedule) in world.get_resource::<Schedules>().into_iter().flat_map(Schedules::iter) {
            // One that was never initialised has run no system.
            let Ok(systems) = schedule.systems() else { continue };
            let label = schedule.label();
            let ages = systems.map(|(_, system)| now.get().wrapping_sub(system.get_last_run().get()));
            runs.extend(ages.enumerate().filter(|(_, age)| *age < length).map(|(index, age)| ((label, index), age)));
        }
        // Two systems never run at the same tick.
        runs.sort_unstable_by_key(|(_, age)| *age);
        Self { length, runs }
    }

    /// Returns for each age of a change before the end of this frame the one that it has before the end of another
    /// World's last frame, so that the same systems have seen it.
    pub(super) fn ages_in(&self, other: Self) -> impl Fn(u32) -> u32 {
        let theirs: HashMap<SystemPlace, u32> = other.runs.into_iter().collect();
        move |age| {
            if age >= self.length {
                return age - self.length + other.length;
            }
            // The system that has made the change, or the last one before it.
            let earlier = &self.runs[self.runs.partition_point(|(_, run)| *run < age)..];
            earlier.iter().find_map(|(place, _)| theirs.get(place).copied()).unwrap_or(other.length)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How often the reader and the writer have seen a change.
    #[derive(Resource, Default, Debug, PartialEq)]
    struct Seen([u32; 2]);

    #[derive(Resource, Default)]
    struct Value(u32);

    #[derive(Resource, Default)]
    struct Extra(bool);

    /// A World of a reader, systems that only some frames run, a writer and another reader.
    fn world() -> World {
        let mut world = World::new();
        world.init_resource::<Seen>();
        world.init_resource::<Value>();
        world.init_resource::<Extra>();
        let note = |place: usize| {
            move |value: Res<Value>, mut seen: ResMut<Seen>| seen.0[place] += u32::from(value.is_changed())
        };
        let mut schedule = Schedule::new(Update);
        let extra = (|| (), || (), || (), || ()).chain().run_if(|extra: Res<Extra>| extra.0);
        schedule.add_systems((extra, note(0), |mut value: ResMut<Value>| value.0 += 1, note(1)).chain());
        world.add_schedule(schedule);
        world
    }

    fn frame(world: &mut World, is_long: bool) -> LastFrame {
        let begun = world.increment_change_tick();
        world.resource_mut::<Extra>().0 = is_long;
        world.run_schedule(Update);
        LastFrame::since(begun, world)
    }

    #[test]
    fn systems_see_a_loaded_change_if_they_had_not_seen_it_whatever_ran_in_the_frame() {
        for (is_long, other_is_long) in [(false, false), (true, false), (false, true), (true, true)] {
            let (mut world, mut other) = (world(), world());
            let saved = frame(&mut world, is_long);
            let age = |world: &World| {
                let changed = world.get_resource_ref::<Value>().expect("it is there").last_changed();
                world.read_change_tick().get().wrapping_sub(changed.get())
            };
            let (written, length) = (age(&world), saved.length);
            frame(&mut other, other_is_long);
            let live = frame(&mut other, other_is_long);
            let now = other.read_change_tick().get();
            let live_length = live.length;
            let age = saved.ages_in(live);
            assert_eq!(age(length + 7), live_length + 7, "older changes are older than the frame");
            other.resource_mut::<Value>().set_last_changed(Tick::new(now.wrapping_sub(age(written))));
            other.insert_resource(Seen::default());
            other.run_schedule(Update);
            let seen = other.resource::<Seen>();
            assert_eq!(seen.0, [1, 1], "by the one before the writer, and by the other for its new change");
        }
    }

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
