//! Another clock on the wall, so that a game that reads it shows.

use bevy::{
    prelude::*,
    time::{Real, TimeSystems},
};

use bevy_playbot::renewal::Renewal;

/// `Time<Real>` as it was before this frame.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct Before(Time<Real>);

/// Lets `Time<Real>` of a World run slower than its ticks say, by a little more in some frames than in others.
///
/// A World without a window takes the length of a tick for that of a frame, so that reading the wall clock changes
/// nothing in it, and everything in a window.
pub(super) fn slow_down(world: &mut World) {
    Renewal::set_up(world, slow_down_one);
}

fn slow_down_one(world: &mut World) {
    let Some(now) = world.get_resource::<Time<Real>>() else { return };
    let before = Before(*now);
    world.insert_resource(before);
    let mut schedules = world.resource_mut::<Schedules>();
    schedules.add_systems(First, (keep.before(TimeSystems), slow.after(TimeSystems)));
}

fn keep(real: Res<Time<Real>>, mut before: ResMut<Before>) {
    before.0 = *real;
}

fn slow(mut real: ResMut<Time<Real>>, before: Res<Before>, mut frame: Local<u32>) {
    let delta = real.delta();
    *frame += 1;
    let mut slower = before.0;
    slower.advance_by(delta + delta / 8 * (1 + *frame % 3));
    // What the next frame counts from stays as it was: game time goes on as ever.
    *slower.context_mut() = *real.context();
    *real = slower;
}

#[cfg(test)]
mod tests {
    use bevy_playbot::headless::{headless_app, into_world, tick_world};

    use super::*;

    #[test]
    fn only_the_wall_clock_is_slower() {
        let mut worlds = [into_world(headless_app()), into_world(headless_app())];
        slow_down(&mut worlds[1]);
        for world in &mut worlds {
            (0..5).for_each(|_| tick_world(world).expect("there is no agent"));
        }
        let [usual, slower] = worlds.each_ref().map(|world| world.resource::<Time<Real>>().elapsed());
        assert!(slower > usual, "{slower:?} against {usual:?}");
        let [usual, same] = worlds.each_ref().map(|world| world.resource::<Time<Virtual>>().elapsed());
        assert_eq!(usual, same);
    }
}
