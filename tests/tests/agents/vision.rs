//! Tests of the path from frames to observations.

use bevy::{
    ecs::schedule::{LogLevel, ScheduleBuildSettings},
    prelude::*,
};
use bevy_playbot::{
    engine::{BlankEpisodes, into_world},
    episode::Tick,
    vision::{
        Frame, ImageOptions, ImageSensor, ObservationConfig, ObservationKind, PaintedVelocity, VisionPlugin,
        VisionSystems,
    },
};
use playbot::prelude::*;
use playbot_games::coinrun::CoinRun;
use playbot_harness::{parallel::on_threads, worlds::build_observing_world};
use playbot_tests::{Cell, corridor_plugin, spawn_walker};

/// The fault of the test's sensor.
#[derive(Resource, Clone, Copy, Default, PartialEq)]
enum Wrong {
    #[default]
    Nothing,
    Blind,
    Late,
    Small,
    Away,
}

/// Fills pictures of two pixels with the tick of the episode, the cell and the level.
fn sense(mut sensors: Query<(&Cell, &Episode, &mut Frame)>, tick: Res<Tick>, wrong: Res<Wrong>) {
    for (cell, episode, mut frame) in &mut sensors {
        let seen = [episode.tick as u8, cell.0 as u8, episode.level as u8, 255];
        frame.pixels = match *wrong {
            Wrong::Blind => vec![seen; 2],
            Wrong::Small => vec![seen],
            _ => vec![seen, [0, 0, 255, 255]],
        };
        let fails = episode.tick == 2;
        match *wrong {
            Wrong::Away => {}
            Wrong::Late if fails => frame.tick = Some(tick.0 - 1),
            _ => frame.tick = Some(tick.0),
        }
    }
}

/// Returns a corridor in which one agent does `action` and sees pictures.
fn seeing(options: ImageOptions, action: u32, wrong: Wrong) -> (World, Entity) {
    let mut app = headless_app();
    app.edit_schedule(ObserveSchedule, |schedule| {
        schedule.set_build_settings(ScheduleBuildSettings { ambiguity_detection: LogLevel::Error, ..default() });
    });
    corridor_plugin(&mut app);
    app.add_plugins(VisionPlugin)
        .insert_resource(wrong)
        .add_systems(ObserveSchedule, sense.in_set(VisionSystems::Render));
    let agent = spawn_walker(app.world_mut(), 0);
    let bot = (Control::Bot, BlindBot::Constant(ActionValue::Discrete(action)), LevelQueue::Always(7));
    app.world_mut().entity_mut(agent).insert((bot, ImageSensor(ImageOptions { width: 2, height: 1, ..options })));
    (into_world(app), agent)
}

fn image(world: &World, agent: Entity) -> Vec<u8> {
    world.get::<Observation>(agent).expect("an agent").image.clone()
}

fn stacked(stack: u32) -> ImageOptions {
    ImageOptions { stack, ..default() }
}

#[test]
fn pictures_are_planes_and_stacks_start_with_the_first() {
    let (mut world, agent) = seeing(stacked(3), 2, Wrong::Nothing);
    // The planes of a picture: tick, 0, cell, 0, level, 255. The walker stays in cell 3.
    let picture = |tick| [tick, 0, 3, 0, 7, 255];
    for expected in [[0, 0, 0], [0, 0, 1], [0, 1, 2], [1, 2, 3]] {
        world.tick().expect("sound");
        assert_eq!(image(&world, agent), expected.map(picture).concat());
    }
    world.ticks(16).expect("sound");
    assert_eq!(image(&world, agent), [17, 18, 19].map(picture).concat(), "time is up after this tick");
    world.tick().expect("sound");
    assert_eq!(image(&world, agent), [0; 3].map(picture).concat(), "another episode");
}

#[test]
fn grey_pictures_are_the_brightness() {
    let (mut world, agent) = seeing(ImageOptions { grayscale: true, ..stacked(2) }, 2, Wrong::Nothing);
    world.ticks(13).expect("sound");
    // 0.299 t + 0.587 * 3 + 0.114 * 7 at ticks 11 and 12, and blue.
    assert_eq!(image(&world, agent), [6, 29, 6, 29]);
}

#[test]
fn looking_again_changes_nothing_that_follows() {
    let traces = [false, true].map(|again| {
        let (mut world, agent) = seeing(stacked(4), 2, Wrong::Nothing);
        let mut trace = Vec::new();
        for _ in 0..45 {
            world.tick().expect("sound");
            trace.push(image(&world, agent));
            if again {
                // As the collector does for the value of the state after a tick.
                let before = world.get::<Observation>(agent).expect("an agent").clone();
                world.run_schedule(ObserveSchedule);
                world.run_schedule(ObserveSchedule);
                world.entity_mut(agent).insert(before);
            }
        }
        trace
    });
    assert_eq!(traces[0], traces[1]);
}

#[test]
fn the_state_after_the_tick_is_seen_when_asked_for() {
    let (mut world, agent) = seeing(stacked(2), 2, Wrong::Nothing);
    world.ticks(5).expect("sound");
    world.run_schedule(ObserveSchedule);
    assert_eq!(image(&world, agent), [[4, 0, 3, 0, 7, 255], [5, 0, 3, 0, 7, 255]].concat());
}

#[test]
fn an_episode_that_is_left_and_begun_again_has_a_stack_of_its_own() {
    let (mut world, agent) = seeing(stacked(2), 1, Wrong::Nothing);
    world.ticks(2).expect("sound");
    world.get_mut::<Episode>(agent).expect("an agent").abandon();
    world.tick().expect("sound");
    assert_eq!(image(&world, agent), [[0, 0, 3, 0, 7, 255]; 2].concat());
}

#[test]
fn velocity_is_painted_over_the_picture() {
    let options = ImageOptions { paint_velocity: true, ..default() };
    let (mut world, agent) = seeing(options, 2, Wrong::Nothing);
    let fault = world.tick().expect_err("no velocity").to_string();
    assert!(fault.contains("PaintedVelocity") && fault.contains("agent 0, level 7, tick 0"), "{fault}");
    // Wide enough for two squares of two pixels.
    world
        .entity_mut(agent)
        .insert((PaintedVelocity(Vec2::new(1.0, -0.5)), ImageSensor(ImageOptions { width: 10, height: 1, ..options })));
    world.insert_resource(Wrong::Away);
    let mut frame = world.get_mut::<Frame>(agent).expect("a sensor");
    frame.pixels = vec![[1, 2, 3, 255]; 10];
    frame.pixels[9] = [9; 4];
    world.resource_scope(|world, tick: Mut<Tick>| {
        world.get_mut::<Frame>(agent).expect("a sensor").tick = Some(tick.0);
    });
    world.insert_resource(Wrong::Nothing);
    world.entity_mut(agent).remove::<Cell>();
    world.run_schedule(ObserveSchedule);
    assert_eq!(image(&world, agent)[..10], [255, 255, 63, 63, 1, 1, 1, 1, 1, 9]);
    world.entity_mut(agent).insert(PaintedVelocity(Vec2::new(f32::NAN, 0.0)));
    world.run_schedule(ObserveSchedule);
    let fault = world.resource_mut::<bevy_playbot::fault::Faults>().take().expect_err("NaN").to_string();
    assert!(fault.contains("NaN"), "{fault}");
}

#[test]
fn a_late_frame_is_reported_with_both_ticks() {
    let (mut world, _) = seeing(stacked(1), 2, Wrong::Late);
    world.ticks(2).expect("sound so far");
    let fault = world.tick().expect_err("late").to_string();
    for part in ["agent 0, level 7, tick 2", "no frame of tick 3", "is of tick 2"] {
        assert!(fault.contains(part), "`{part}` is missing in: {fault}");
    }
}

#[test]
fn missing_and_wrong_frames_are_reported() {
    for (wrong, part) in [(Wrong::Away, "no sensor has looked"), (Wrong::Small, "1 pixels, but the agent sees 2x1")] {
        let (mut world, _) = seeing(stacked(1), 2, wrong);
        let fault = world.tick().expect_err("no frame").to_string();
        assert!(fault.contains(part) && fault.contains("agent 0, level 7, tick 0"), "{fault}");
    }
    let (mut world, agent) = seeing(stacked(1), 2, Wrong::Nothing);
    world.entity_mut(agent).insert(ImageSensor(ImageOptions { width: 2, height: 1, stack: 0, ..default() }));
    let fault = world.tick().expect_err("no stack").to_string();
    assert!(fault.contains("stack is 0"), "{fault}");
}

#[test]
fn images_that_somebody_spoils_are_reported() {
    let (mut world, _) = seeing(stacked(1), 2, Wrong::Nothing);
    world.schedule_scope(ObserveSchedule, |_, schedule| {
        let spoil = |mut agents: Query<&mut Observation>| agents.iter_mut().for_each(|mut seen| seen.image.truncate(5));
        schedule.add_systems(spoil.after(VisionSystems::Compose).ambiguous_with_all());
    });
    let fault = world.tick().expect_err("spoiled").to_string();
    assert!(fault.contains("5 bytes, its sensor makes 6") && fault.contains("agent 0, level 7, tick 0"), "{fault}");
}

#[test]
fn an_agent_that_sees_nothing_is_reported_once() {
    let (mut world, agent) = seeing(stacked(1), 1, Wrong::Blind);
    world.ticks(2).expect("the episode goes on");
    let fault = world.tick().expect_err("its first episode ended").to_string();
    assert!(fault.contains("agent 0, level 7") && fault.contains("3 ticks"), "{fault}");
    world.insert_resource(Wrong::Nothing);
    world.ticks(3).expect("it sees");
    world.insert_resource(Wrong::Blind);
    world.ticks(2).expect("sound");
    world.insert_resource(Wrong::Nothing);
    world.tick().expect("it saw something at last");
    world.insert_resource(Wrong::Blind);
    world.ticks(3).expect("it is known to see, so this is the level's fault");
    assert_eq!(world.get::<BlankEpisodes>(agent).expect("a sensor").episodes, 2);
}

const RASTER: ObservationConfig = ObservationConfig {
    kind: ObservationKind::Raster,
    image: ImageOptions { width: 64, height: 64, stack: 2, grayscale: false, paint_velocity: true },
};

/// Worlds of CoinRun with these agents.
fn coinrun(agents: &[(u32, u32)]) -> Vec<(World, Vec<Entity>)> {
    let mut worlds = Vec::new();
    for &(first, count) in agents {
        let built = build_observing_world(&CoinRun::default(), "hard", &RASTER, 3, first, count);
        let (mut world, agents) = built.expect("it can be drawn");
        for agent in &agents {
            let queue = LevelQueue::Uniform { first: 0, last: 63 };
            world.entity_mut(*agent).insert((Control::Bot, BlindBot::Uniform, queue));
        }
        worlds.push((world, agents));
    }
    worlds
}

/// Returns all pictures of all agents over some ticks, `[agent, tick]`.
fn watch(mut worlds: Vec<(World, Vec<Entity>)>, threads: usize) -> Vec<Vec<Vec<u8>>> {
    let parts = on_threads(&mut worlds, threads, |(world, agents)| {
        let mut seen = vec![Vec::new(); agents.len()];
        for _ in 0..150 {
            world.tick().expect("sound");
            for (agent, seen) in agents.iter().zip(&mut seen) {
                seen.push(image(world, *agent));
            }
        }
        seen
    });
    parts.into_iter().flatten().collect()
}

#[test]
fn pictures_depend_neither_on_threads_nor_on_other_arenas() {
    let one = watch(coinrun(&[(0, 3), (3, 3)]), 1);
    let two = watch(coinrun(&[(0, 3), (3, 3)]), 2);
    assert!(one == two, "threads");
    assert!(one[4][100].iter().any(|byte| *byte != one[4][100][0]));
    let alone = watch(coinrun(&[(4, 1)]), 1);
    assert!(alone[0] == one[4], "the same arena among others");
}
