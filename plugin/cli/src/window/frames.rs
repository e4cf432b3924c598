//! Windows of games whose ticks are frames: each frame of the window is one, or it shows the state as it is.
//!
//! While the game stands still, none of its systems may run. A frame without a tick would still move it, and a
//! recording would lack that.

use crate::window::{
    devices,
    devices::Devices,
    ending, keys,
    session::{Deciders, OwnDevices, OwnKeys},
    title,
    title::Pace,
};
use bevy::{
    ecs::schedule::{ScheduleLabel, SingleThreadedExecutor},
    prelude::*,
    time::TimeReceiver,
    window::PrimaryWindow,
};
use bevy_playbot::{
    action::Action,
    agent::Control,
    demo::{file::DemoEpisode, recorder::Recorder},
    engine::{
        PressesForPeople, TickSchedules, deliver_assets, deliver_between_frames, run_on_one_thread, system_errors,
        wait_for_assets, wait_for_tasks,
    },
    episode::Episode,
    fault::Faults,
    key_bindings::{KeyBindings, MissingSet},
    virtual_input::{ClickAreas, VirtualInput},
};
use playbot_harness::prelude::*;
use std::sync::Arc;

/// The schedule of a frame of the window.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct WindowFrame;

/// Before the game's frame: the window's own keys.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct WindowStart;

/// After the game's frame, or in its place.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct WindowEnd;

/// The systems that must run in a frame in which the game stands still.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct StandStill;

/// Frames of the game per second of its time.
#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct FrameRate(f64);

/// Runs the game of an app, with `hz` frames a second, one in each frame of the window.
pub(super) fn build(app: &mut App, game: &'static str, hz: f64) {
    devices::build(app);
    devices::build_gamepads(app);
    app.insert_resource(FrameRate(hz))
        .insert_resource(Devices::Open)
        .init_resource::<Pace>()
        .add_observer(rest)
        .init_schedule(WindowStart)
        .init_schedule(WindowEnd)
        .init_schedule(StandStill)
        .add_systems(WindowStart, keys::systems())
        .add_systems(StandStill, title::show)
        .add_systems(WindowFrame, run_frame);
    ending::listen_in(app, StandStill);
    title::build(app, game, WindowEnd);
    let decide = TickSchedules::of(app).decide;
    app.add_systems(decide, (decide_by_hand, decide_by_devices).chain().in_set(PlaybotSystems::Decide));
    // Virtual input and title need the window's thread.
    app.edit_schedule(WindowFrame, |schedule| {
        schedule.set_executor(SingleThreadedExecutor::new());
    });
    app.main_mut().update_schedule = Some(WindowFrame.intern());
}

/// Shows the end of an episode for a moment.
fn rest(_: On<EpisodeEnded>, rate: Res<FrameRate>, mut pace: ResMut<Pace>) {
    pace.rest_in_frames(rate.0);
}

fn run_frame(world: &mut World, mut has_begun: Local<bool>) {
    if !*has_begun {
        *has_begun = true;
        // In the order that systems have headless, and with assets in the frames in which they arrive there.
        run_on_one_thread(world);
        deliver_between_frames(world);
    }
    choose_devices(world);
    devices::take(world);
    world.run_schedule(WindowStart);
    // Tab may just have been pressed.
    choose_devices(world);
    if world.resource_mut::<Pace>().is_still_frame() {
        // The renderer sends one message a frame, and holds at most two unread ones.
        if let Some(times) = world.get_resource::<TimeReceiver>() {
            let _ = times.0.try_recv();
        }
        world.run_schedule(WindowEnd);
        world.run_schedule(StandStill);
    } else {
        world.run_schedule(Main);
        if is_repeatable(world) {
            wait_for_tasks(world);
            wait_for_assets(world);
        } else {
            // A person sees the game's own loading screen, and may leave it. Tasks take the time that they need.
            deliver_assets(world);
        }
        if let Some(failure) = system_errors::take() {
            world.resource_mut::<Faults>().report(failure);
            world.run_schedule(StandStill);
        }
        world.run_schedule(WindowEnd);
    }
    devices::give_back(world);
}

/// Returns whether each asset has to arrive, and each task to end, in the frame in which it does so headless: for a
/// recording, or because the agent is not played by a person.
fn is_repeatable(world: &World) -> bool {
    let agent = world.resource::<Deciders>().agent;
    world.contains_resource::<Recorder>() || world.get::<Control>(agent) != Some(&Control::Human)
}

/// Opens the devices to the game where what a person does is no action, and keeps them otherwise.
fn choose_devices(world: &mut World) {
    let agent = world.resource::<Deciders>().agent;
    let is_person = world.get::<Control>(agent) == Some(&Control::Human);
    let is_open = is_person && world.get::<PressesForPeople>(agent).is_none();
    devices::set(world, if is_open { Devices::Open } else { Devices::Kept });
}

/// Turns the keys of this frame into the action, which then presses the game's keys in the same frame. A short tap
/// counts for one tick.
fn decide_by_hand(
    keys: Res<OwnKeys>,
    mut agents: Query<(&Control, &KeyBindings, &Episode, &mut Action, &mut MissingSet)>,
) {
    for (control, bindings, episode, mut action, mut missing) in &mut agents {
        if *control == Control::Human && episode.is_running() {
            let is_held = |key| keys.pressed(key) || keys.just_pressed(key);
            action.0 = bindings.action(is_held);
            missing.set_keys(bindings.missing_set(is_held));
        }
    }
}

/// The agents that a person plays with other devices than keys alone.
type Played<'w, 's> = Query<
    'w,
    's,
    (
        &'static Control,
        &'static VirtualInput,
        Option<&'static ClickAreas>,
        &'static Episode,
        &'static mut Action,
        &'static mut MissingSet,
    ),
    (With<PressesForPeople>, Without<KeyBindings>),
>;

/// Turns what a person does in this frame into the action, which then presses the game's inputs in the same frame.
fn decide_by_devices(devices: Res<OwnDevices>, windows: Query<&Window, With<PrimaryWindow>>, mut agents: Played) {
    let size = windows.single().map_or(Vec2::ZERO, Window::size);
    for (control, input, clicks, episode, mut action, mut missing) in &mut agents {
        if *control == Control::Human && episode.is_running() {
            (action.0, missing.0) = input.meant_by(&devices.input, size, clicks);
        }
    }
}

/// Hands the agent over to a recorded episode.
pub(super) fn build_replayed(app: &mut App, agent: Entity, episode: DemoEpisode) {
    let judge = TickSchedules::of(app).judge;
    Replay::begin(Arc::new(episode), &mut app.world_mut().entity_mut(agent));
    app.add_systems(judge, hand_over.in_set(PlaybotSystems::Reset));
}

/// Gives the person control after the last recorded tick.
fn hand_over(mut agents: Query<(&mut Control, &Replay)>) {
    for (mut control, replay) in &mut agents {
        if *control == Control::Replay && replay.is_finished() {
            *control = Control::Human;
        }
    }
}

#[cfg(test)]
mod tests {
    use bevy_playbot::action::{ActionSpace, Actions};
    use bevy_playbot::demo::file::Decider;

    use super::*;

    #[test]
    fn buttons_of_the_mouse_become_the_action_and_those_without_one_are_noted() {
        let mut app = headless_app();
        app.init_resource::<OwnDevices>().add_systems(FixedPreUpdate, decide_by_devices.in_set(PlaybotSystems::Decide));
        let sets = [vec![], vec![MouseButton::Left], vec![MouseButton::Right]];
        let input = VirtualInput::keys([[]; 3]).mouse_buttons(sets);
        let agent = (Agent::new(0, input.space()), input, Control::Human, PressesForPeople, MissingSet::default());
        let agent = app.world_mut().spawn(agent).id();
        let mut decided = |button: MouseButton| {
            app.world_mut().resource_mut::<OwnDevices>().input.press(button);
            app.tick().expect("no agent broke its contract");
            let action = app.world().get::<Action>(agent).and_then(Action::discrete);
            (action, app.world().get::<MissingSet>(agent).cloned())
        };
        assert_eq!(decided(MouseButton::Right), (Some(2), Some(MissingSet(None))));
        let both = vec![MouseButton::Left.into(), MouseButton::Right.into()];
        assert_eq!(decided(MouseButton::Left), (Some(1), Some(MissingSet(Some(both)))));
    }

    #[test]
    fn the_person_goes_on_behind_the_last_tick() {
        let mut episode = DemoEpisode::new(7, ActionSpace::Discrete(2));
        episode.actions = Actions::Discrete(vec![1, 0, 1]);
        (episode.rewards, episode.state_hashes) = (vec![0.0; 3], vec![0; 3]);
        episode.deciders = vec![Decider::Bot; 3];
        let mut app = headless_app();
        let agent = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
        build_replayed(&mut app, agent, episode);
        app.ticks(2).expect("no agent broke its contract");
        assert_eq!(Control::of(app.world(), agent), Control::Replay);
        app.tick().expect("no agent broke its contract");
        assert_eq!(Control::of(app.world(), agent), Control::Human);
        assert_eq!(app.world().get::<Episode>(agent).map(|episode| (episode.level, episode.tick)), Some((7, 3)));
    }
}
