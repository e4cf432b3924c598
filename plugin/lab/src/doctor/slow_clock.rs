//! A slower real-time clock, to reveal games that read it.

use bevy::{
    prelude::*,
    time::{Real, TimeSystems},
};

use bevy_playbot::renewal::Renewal;

/// `Time<Real>` before this frame, and whether it runs slower in this World.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct WallClock {
    before: Time<Real>,
    is_slow: bool,
}

/// Makes `Time<Real>` of a World run slower than its ticks say if `is_slow`, by a little more in some frames than in
/// others.
///
/// Without a window a frame lasts exactly a tick, so reading the real-time clock changes nothing there. In a window it
/// changes everything.
///
/// A World with the normal clock gets the same resource and systems, so that two Worlds differ only in the clock, and
/// have the same number of archetypes.
pub(super) fn add_wall_clock(world: &mut World, is_slow: bool) {
    Renewal::set_up(world, move |world| add_one(world, is_slow));
}

fn add_one(world: &mut World, is_slow: bool) {
    let Some(now) = world.get_resource::<Time<Real>>() else { return };
    let clock = WallClock { before: *now, is_slow };
    world.insert_resource(clock);
    let mut schedules = world.resource_mut::<Schedules>();
    schedules.add_systems(First, (keep.before(TimeSystems), slow.after(TimeSystems)));
}

fn keep(real: Res<Time<Real>>, mut clock: ResMut<WallClock>) {
    clock.before = *real;
}

fn slow(mut real: ResMut<Time<Real>>, clock: Res<WallClock>, mut frame: Local<u32>) {
    *frame += 1;
    if !clock.is_slow {
        return;
    }
    let delta = real.delta();
    let mut slower = clock.before;
    slower.advance_by(delta + delta / 8 * (1 + *frame % 3));
    // The next frame's reference stays unchanged, so game time is unaffected.
    *slower.context_mut() = *real.context();
    *real = slower;
}

#[cfg(test)]
mod tests {
    use bevy_playbot::headless::{headless_app, into_world, tick_world};

    use super::*;

    /// A World with the normal clock and one with the slow one, after five ticks.
    fn ticked() -> [World; 2] {
        [false, true].map(|is_slow| {
            let mut world = into_world(headless_app());
            add_wall_clock(&mut world, is_slow);
            (0..5).for_each(|_| tick_world(&mut world).expect("there is no agent"));
            world
        })
    }

    #[test]
    fn only_the_wall_clock_is_slower() {
        let worlds = ticked();
        let [usual, slower] = worlds.each_ref().map(|world| world.resource::<Time<Real>>().elapsed());
        assert!(slower > usual, "{slower:?} against {usual:?}");
        let [usual, same] = worlds.each_ref().map(|world| world.resource::<Time<Virtual>>().elapsed());
        assert_eq!(usual, same);
    }

    #[test]
    fn the_usual_clock_is_as_it_is_without_this() {
        let mut bare = into_world(headless_app());
        (0..5).for_each(|_| tick_world(&mut bare).expect("there is no agent"));
        let [usual, _] = ticked();
        assert_eq!(usual.resource::<Time<Real>>().elapsed(), bare.resource::<Time<Real>>().elapsed());
    }

    #[test]
    fn both_worlds_have_the_same_archetypes() {
        let [usual, slower] = ticked().map(|world| world.archetypes().len());
        assert_eq!(usual, slower);
    }
}
