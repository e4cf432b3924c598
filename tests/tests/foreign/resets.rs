//! Tests of the table in `docs/explanation/restarts.md`: a test for each of its rows, in the same order. Each plays two
//! episodes of a game with the parts of its row, and looks at them after the restart.

use std::{
    future::pending,
    mem,
    sync::{
        Arc, Mutex, Weak,
        atomic::{AtomicU32, Ordering},
    },
    time::Duration,
};

use bevy::{
    ecs::system::RunSystemOnce,
    input::gamepad::Gamepad,
    prelude::*,
    tasks::{AsyncComputeTaskPool, Task},
    window::{Monitor, PrimaryWindow},
};
use playbot::prelude::*;
use playbot_harness::{
    foreign::{ForeignGame, Restart},
    worlds::build_world,
};

/// Ticks of an episode.
const TICKS: u32 = 5;

/// The frame of a World's first restart, behind the one that starts the program.
const FIRST: u32 = 2;

/// The frame of the last tick of a World's first episode. Between the restart and the first tick no other frame passes.
const LAST: u32 = FIRST + TICKS;

/// The frame of a World's second restart.
const SECOND: u32 = LAST + 1;

/// Frames of this World.
#[derive(Resource, Default)]
struct Frames(u32);

#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
enum Room {
    #[default]
    Open,
    Closed,
}

/// A message that the adapter forgets at a restart.
#[derive(Message)]
struct Forgotten;

/// What happened, in order.
#[derive(Resource, Default)]
struct Log(Vec<&'static str>);

fn log(word: &'static str) -> impl Command<Out = ()> {
    move |world: &mut World| world.resource_mut::<Log>().0.push(word)
}

/// A run condition: this frame is the last tick of the first episode.
fn last_tick(frames: Res<Frames>) -> bool {
    frames.0 == LAST
}

/// What was seen of an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Look<T> {
    /// In `.level`, right after the restart.
    restarted: T,
    /// In `.loaded`, at the end of the restart's frame.
    loaded: T,
}

/// The looks at the first and the second episode, for each kind of restart.
struct Looks<T> {
    startup: [Look<T>; 2],
    /// By `Restart::state(Room::Open)`.
    state: [Look<T>; 2],
    /// By a system that only logs that it runs.
    system: [Look<T>; 2],
    rebuild: [Look<T>; 2],
}

/// Looks at a game with these parts.
fn looks<T: Send + 'static>(parts: fn(&mut App), look: fn(&mut World) -> T) -> Looks<T> {
    let by_hand = Restart::system(|mut commands: Commands| commands.queue(log("restarted")));
    Looks {
        startup: episodes(Restart::Startup, parts, look),
        state: episodes(Restart::state(Room::Open), parts, look),
        system: episodes(by_hand, parts, look),
        rebuild: episodes(Restart::Rebuild, parts, look),
    }
}

/// Plays two episodes in which the agent holds a key, a mouse button and a button of its gamepad.
fn episodes<T: Send + 'static>(restart: Restart, parts: fn(&mut App), look: fn(&mut World) -> T) -> [Look<T>; 2] {
    let seen = Arc::new(Mutex::new(Vec::new()));
    let [restarted, loaded] = [seen.clone(), seen.clone()];
    let game = ForeignGame::new("parts", 1, move |app: &mut App| {
        app.init_resource::<Frames>()
            .init_resource::<Log>()
            .init_state::<Room>()
            .add_systems(First, |mut frames: ResMut<Frames>| frames.0 += 1);
        parts(app);
    });
    let game = game
        .keys([vec![], vec![KeyCode::Space]])
        .mouse_buttons([vec![], vec![MouseButton::Left]])
        .gamepad_buttons([vec![], vec![GamepadButton::South]])
        .observe(["nothing"], || [0.0])
        .time_limit(TICKS)
        .forget_messages::<Forgotten>()
        .restart(restart)
        .level(move |world: &mut World| {
            let found = look(world);
            restarted.lock().expect("no look panics").push(found);
        })
        .loaded(move |world: &mut World| {
            let found = look(world);
            loaded.lock().expect("no look panics").push(found);
        });
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    let holding = BlindBot::Constant(ActionValue::Discrete(1));
    world.entity_mut(agents[0]).insert((Control::Bot, holding, LevelQueue::list([3, 4])));
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("sound");
    }
    drop(world);
    let mut seen = mem::take(&mut *seen.lock().expect("no look panics")).into_iter();
    let mut next = || seen.next().expect("there are two episodes");
    [(); 2].map(|()| Look { restarted: next(), loaded: next() })
}

/// Returns the time of so many frames.
fn frames(number: u32) -> Duration {
    number * Duration::from_secs_f64(1.0 / 60.0)
}

/// The parts of the page, each with its test.
const ROWS: [(&str, &str); 18] = [
    ("entities", "entities"),
    ("`PreStartup`, `Startup`, `PostStartup`", "schedules_of_the_start"),
    ("states", "states"),
    ("resources", "resources"),
    ("`Local`s of systems", "locals_of_systems"),
    ("`static`s", "statics"),
    ("observers", "observers"),
    ("`Time` and `Time<Virtual>`", "the_clock_of_the_game"),
    ("`Time<Fixed>`", "the_clock_of_fixed_steps"),
    ("`Time<Real>`", "the_clock_of_the_machine"),
    ("timers", "timers"),
    ("messages", "messages"),
    ("removed components", "removed_components"),
    ("commands", "commands"),
    ("tasks", "tasks"),
    ("assets", "assets"),
    ("keys, buttons and sticks that a bot holds", "keys_and_buttons"),
    ("windows, monitors and gamepads", "windows_monitors_and_gamepads"),
];

#[test]
fn each_row_of_the_page_has_a_test() {
    let page = include_str!("../../../docs/explanation/restarts.md");
    let rows = page.lines().filter_map(|line| line.strip_prefix("| ")?.split(" | ").next());
    assert_eq!(rows.skip(1).collect::<Vec<_>>(), ROWS.map(|(part, _)| part), "the first line is the heading");
    let tests = include_str!("resets.rs");
    for (part, test) in ROWS {
        assert!(tests.contains(&format!("#[test]\nfn {test}() {{")), "{part}");
    }
}

#[test]
fn the_looks_are_where_they_should_be() {
    let looks = looks(|_| {}, |world| world.resource::<Frames>().0);
    let [first, second] = [FIRST, SECOND].map(|frame| Look { restarted: frame, loaded: frame + 1 });
    for same_world in [looks.startup, looks.state, looks.system] {
        assert_eq!(same_world, [first, second]);
    }
    assert_eq!(looks.rebuild, [first; 2]);
}

#[test]
fn entities() {
    #[derive(Component)]
    struct Hero;
    #[derive(Component)]
    struct Spark;
    /// Removed sparks, by a hook and by an observer.
    #[derive(Resource, Default)]
    struct Removed([u32; 2]);

    let looks = looks(
        |app| {
            app.init_resource::<Removed>()
                .add_systems(Startup, |mut commands: Commands| _ = commands.spawn(Hero))
                .add_systems(
                    Update,
                    (|mut commands: Commands| _ = commands.spawn((Spark, DespawnOnExit(Room::Open)))).run_if(last_tick),
                )
                .add_observer(|_: On<Remove, Spark>, mut removed: ResMut<Removed>| removed.0[1] += 1);
            app.world_mut()
                .register_component_hooks::<Spark>()
                .on_remove(|mut world, _| world.resource_mut::<Removed>().0[0] += 1);
        },
        |world| {
            let heroes: Vec<Entity> = world.query_filtered::<Entity, With<Hero>>().iter(world).collect();
            let sparks = world.query::<&Spark>().iter(world).count();
            (heroes, sparks, world.resource::<Removed>().0)
        },
    );
    let hero = |episode: &Look<(Vec<Entity>, usize, [u32; 2])>| {
        let [hero] = episode.restarted.0[..] else { panic!("heroes: {:?}", episode.restarted.0) };
        hero
    };
    let rest = |episode: &Look<(Vec<Entity>, usize, [u32; 2])>| (episode.restarted.1, episode.restarted.2);
    assert_ne!(hero(&looks.startup[0]), hero(&looks.startup[1]), "another one");
    assert_eq!(rest(&looks.startup[1]), (0, [1, 1]));
    assert_eq!(hero(&looks.state[0]), hero(&looks.state[1]));
    assert_eq!(rest(&looks.state[1]), (0, [1, 1]), "the game despawns it when it leaves the state");
    assert_eq!(hero(&looks.system[0]), hero(&looks.system[1]));
    assert_eq!(rest(&looks.system[1]), (1, [0, 0]));
    hero(&looks.rebuild[1]);
    assert_eq!(rest(&looks.rebuild[1]), (0, [0, 0]));
}

#[test]
fn schedules_of_the_start() {
    #[derive(Resource, Default)]
    struct Runs([u32; 3]);

    let looks = looks(
        |app| {
            app.init_resource::<Runs>()
                .add_systems(PreStartup, |mut runs: ResMut<Runs>| runs.0[0] += 1)
                .add_systems(Startup, |mut runs: ResMut<Runs>| runs.0[1] += 1)
                .add_systems(PostStartup, |mut runs: ResMut<Runs>| runs.0[2] += 1);
        },
        |world| world.resource::<Runs>().0,
    );
    assert_eq!(looks.startup.map(|episode| episode.restarted), [[2; 3], [3; 3]]);
    for other in [looks.state, looks.system, looks.rebuild] {
        assert_eq!(other.map(|episode| episode.restarted), [[1; 3]; 2]);
    }
}

#[test]
fn states() {
    /// Transitions that have left a room, and entered the open one.
    #[derive(Resource, Default)]
    struct Passed([u32; 2]);

    let looks = looks(
        |app| {
            app.init_resource::<Passed>()
                .add_systems(OnExit(Room::Open), |mut passed: ResMut<Passed>| passed.0[0] += 1)
                .add_systems(OnExit(Room::Closed), |mut passed: ResMut<Passed>| passed.0[0] += 1)
                .add_systems(OnEnter(Room::Open), |mut passed: ResMut<Passed>| passed.0[1] += 1)
                .add_systems(Update, |frames: Res<Frames>, mut next: ResMut<NextState<Room>>| {
                    if frames.0 == LAST - 1 {
                        next.set(Room::Closed);
                    }
                });
        },
        |world| (*world.resource::<State<Room>>().get(), world.resource::<Passed>().0),
    );
    let begun = (Room::Open, [0, 1]);
    for other in [looks.startup, looks.system] {
        assert_eq!(other.map(|episode| episode.restarted), [begun, (Room::Closed, [1, 1])]);
    }
    let entered = [(Room::Open, [1, 2]), (Room::Open, [3, 3])];
    assert_eq!(looks.state.map(|episode| episode.restarted), entered, "it is left even if the game is in it");
    assert_eq!(looks.rebuild.map(|episode| episode.restarted), [begun; 2]);
}

#[test]
fn resources() {
    #[derive(Resource)]
    struct OfTheApp(u32);
    #[derive(Resource)]
    struct OfStartup(u32);

    let looks = looks(
        |app| {
            app.insert_resource(OfTheApp(0))
                .add_systems(Startup, |mut commands: Commands| commands.insert_resource(OfStartup(0)))
                .add_systems(
                    Update,
                    (|mut app: ResMut<OfTheApp>, mut start: ResMut<OfStartup>| (app.0, start.0) = (7, 7))
                        .run_if(last_tick),
                );
        },
        |world| [world.resource::<OfTheApp>().0, world.resource::<OfStartup>().0],
    );
    assert_eq!(looks.startup[1].restarted, [7, 0]);
    assert_eq!([looks.state[1].restarted, looks.system[1].restarted], [[7, 7]; 2]);
    assert_eq!(looks.rebuild[1].restarted, [0, 0]);
}

#[test]
fn locals_of_systems() {
    #[derive(Resource, Default)]
    struct Counted(u32);

    let looks = looks(
        |app| {
            app.init_resource::<Counted>().add_systems(Update, |mut runs: Local<u32>, mut counted: ResMut<Counted>| {
                *runs += 1;
                counted.0 = *runs;
            });
        },
        |world| mem::take(&mut world.resource_mut::<Counted>().0),
    );
    // The look before has set the resource to 0, so the local counts on in the restart's frame.
    for other in [looks.startup, looks.state, looks.system] {
        assert_eq!(other.map(|episode| episode.loaded), [FIRST, SECOND]);
    }
    assert_eq!(looks.rebuild.map(|episode| episode.loaded), [FIRST; 2]);
}

#[test]
fn statics() {
    static UPDATES: AtomicU32 = AtomicU32::new(0);

    let looks = looks(
        |app| _ = app.add_systems(Update, || _ = UPDATES.fetch_add(1, Ordering::Relaxed)),
        |_| UPDATES.load(Ordering::Relaxed),
    );
    for other in [looks.startup, looks.state, looks.system, looks.rebuild] {
        assert!(other[1].restarted > other[0].restarted, "{other:?}");
    }
}

#[test]
fn observers() {
    #[derive(Event)]
    struct Rung;
    /// Calls of an observer of the app, of one that `Startup` adds, and of one that an episode adds.
    #[derive(Resource, Default)]
    struct Heard([u32; 3]);

    let looks = looks(
        |app| {
            app.init_resource::<Heard>()
                .add_observer(|_: On<Rung>, mut heard: ResMut<Heard>| heard.0[0] += 1)
                .add_systems(Startup, |mut commands: Commands| {
                    commands.add_observer(|_: On<Rung>, mut heard: ResMut<Heard>| heard.0[1] += 1);
                })
                .add_systems(
                    Update,
                    (|mut commands: Commands| {
                        commands.add_observer(|_: On<Rung>, mut heard: ResMut<Heard>| heard.0[2] += 1);
                    })
                    .run_if(last_tick),
                );
        },
        |world| {
            world.trigger(Rung);
            mem::take(&mut world.resource_mut::<Heard>().0)
        },
    );
    assert_eq!(looks.startup.map(|episode| episode.restarted), [[1, 1, 0]; 2]);
    for other in [looks.state, looks.system] {
        assert_eq!(other.map(|episode| episode.restarted), [[1, 1, 0], [1, 1, 1]]);
    }
    assert_eq!(looks.rebuild.map(|episode| episode.restarted), [[1, 1, 0]; 2]);
}

/// Sets the speed of the game's clock, whether it is paused, and its longest step in seconds.
fn set(clock: &mut Time<Virtual>, speed: f32, is_paused: bool, longest: u64) {
    clock.set_relative_speed(speed);
    clock.set_max_delta(Duration::from_secs(longest));
    if is_paused {
        clock.pause();
    } else {
        clock.unpause();
    }
}

#[test]
fn the_clock_of_the_game() {
    let looks = looks(
        |app| {
            set(&mut app.world_mut().resource_mut::<Time<Virtual>>(), 2.0, true, 3);
            app.add_systems(Startup, |mut clock: ResMut<Time<Virtual>>, mut has_started: Local<bool>| {
                if !mem::replace(&mut *has_started, true) {
                    set(&mut clock, 4.0, false, 5);
                }
            })
            .add_systems(Update, (|mut clock: ResMut<Time<Virtual>>| set(&mut clock, 0.5, true, 7)).run_if(last_tick));
        },
        |world| {
            let (clock, game) = (world.resource::<Time<Virtual>>(), world.resource::<Time>());
            ([clock.elapsed(), game.elapsed()], clock.relative_speed(), clock.is_paused(), clock.max_delta().as_secs())
        },
    );
    let start = [Duration::ZERO; 2];
    assert_eq!(looks.startup.map(|episode| episode.restarted), [(start, 2.0, true, 3); 2]);
    for other in [looks.state, looks.system, looks.rebuild] {
        assert_eq!(other.map(|episode| episode.restarted), [(start, 4.0, false, 5); 2]);
    }
}

#[test]
fn the_clock_of_fixed_steps() {
    let looks = looks(
        |app| {
            app.insert_resource(Time::<Fixed>::from_hz(50.0))
                .add_systems(Startup, |mut clock: ResMut<Time<Fixed>>, mut has_started: Local<bool>| {
                    if !mem::replace(&mut *has_started, true) {
                        clock.set_timestep_hz(25.0);
                    }
                })
                .add_systems(
                    Update,
                    (|mut clock: ResMut<Time<Fixed>>| {
                        assert!(!clock.overstep().is_zero(), "there is a remainder");
                        clock.set_timestep_hz(10.0);
                    })
                    .run_if(last_tick),
                );
        },
        |world| {
            let clock = world.resource::<Time<Fixed>>();
            [clock.elapsed(), clock.overstep(), clock.timestep()]
        },
    );
    let start = |step| [Duration::ZERO, Duration::ZERO, Duration::from_millis(step)];
    assert_eq!(looks.startup.map(|episode| episode.restarted), [start(20); 2]);
    for other in [looks.state, looks.system, looks.rebuild] {
        assert_eq!(other.map(|episode| episode.restarted), [start(40); 2]);
    }
}

#[test]
fn the_clock_of_the_machine() {
    let looks = looks(|_| {}, |world| world.resource::<Time<Real>>().elapsed());
    // The first frame of a World has no length.
    for other in [looks.startup, looks.state, looks.system] {
        assert_eq!(other.map(|episode| episode.restarted), [frames(FIRST - 1), frames(SECOND - 1)]);
    }
    assert_eq!(looks.rebuild.map(|episode| episode.restarted), [frames(FIRST - 1); 2]);
}

#[test]
fn timers() {
    #[derive(Component)]
    struct Fuse(Timer);
    #[derive(Resource)]
    struct Alarm(Timer);

    let looks = looks(
        |app| {
            app.insert_resource(Alarm(Timer::from_seconds(9.0, TimerMode::Once)))
                .add_systems(Startup, |mut commands: Commands| {
                    commands.spawn(Fuse(Timer::from_seconds(9.0, TimerMode::Once)));
                })
                .add_systems(Update, |mut fuses: Query<&mut Fuse>, mut alarm: ResMut<Alarm>| {
                    for mut fuse in &mut fuses {
                        fuse.0.tick(Duration::from_secs(1));
                    }
                    alarm.0.tick(Duration::from_secs(1));
                });
        },
        |world| {
            let fuse = world.query::<&Fuse>().single(world).expect("one fuse").0.elapsed().as_secs();
            [fuse, world.resource::<Alarm>().0.elapsed().as_secs()]
        },
    );
    let [first, second] = [FIRST, SECOND].map(|frame| u64::from(frame - 1));
    assert_eq!(looks.startup.map(|episode| episode.restarted), [[0, first], [0, second]]);
    for other in [looks.state, looks.system] {
        assert_eq!(other.map(|episode| episode.restarted), [[first; 2], [second; 2]]);
    }
    assert_eq!(looks.rebuild.map(|episode| episode.restarted), [[first; 2]; 2]);
}

#[test]
fn messages() {
    #[derive(Message)]
    struct Kept;

    let looks = looks(
        |app| {
            app.add_message::<Kept>().add_message::<Forgotten>().add_systems(
                Update,
                (|mut kept: MessageWriter<Kept>, mut forgotten: MessageWriter<Forgotten>| {
                    kept.write(Kept);
                    forgotten.write(Forgotten);
                })
                .run_if(last_tick),
            );
        },
        |world| [world.resource::<Messages<Kept>>().len(), world.resource::<Messages<Forgotten>>().len()],
    );
    for other in [looks.startup, looks.state, looks.system] {
        assert_eq!(other.map(|episode| episode.restarted), [[0, 0], [1, 0]]);
    }
    assert_eq!(looks.rebuild.map(|episode| episode.restarted), [[0, 0]; 2]);
}

#[test]
fn removed_components() {
    #[derive(Component)]
    struct Tag;

    let looks = looks(
        |app| {
            // An entity from before the game's start, which no restart despawns.
            app.world_mut().spawn(Tag);
            app.add_systems(
                Update,
                (|tagged: Single<Entity, With<Tag>>, mut commands: Commands| {
                    commands.entity(*tagged).remove::<Tag>();
                })
                .run_if(last_tick),
            );
        },
        |world| {
            let removed = world.run_system_once(|mut removed: RemovedComponents<Tag>| removed.read().count());
            removed.expect("it needs nothing")
        },
    );
    let none = Look { restarted: 0, loaded: 0 };
    for other in [looks.startup, looks.state, looks.system] {
        assert_eq!(other, [none, Look { restarted: 1, loaded: 0 }]);
    }
    assert_eq!(looks.rebuild, [none; 2]);
}

#[test]
fn commands() {
    #[derive(Component)]
    struct Hero;

    let looks = looks(
        |app| {
            app.add_systems(Startup, |mut commands: Commands, mut log: ResMut<Log>| {
                commands.spawn(Hero);
                log.0.push("startup");
            })
            .add_systems(OnEnter(Room::Open), |mut commands: Commands| commands.queue(log("entered")))
            .add_observer(|_: On<Remove, Hero>, mut commands: Commands| commands.queue(log("despawned")));
        },
        |world| mem::take(&mut world.resource_mut::<Log>().0),
    );
    assert_eq!(looks.startup[1].restarted, ["despawned", "startup"]);
    assert_eq!(looks.state[1].restarted, ["entered"]);
    assert_eq!(looks.system[1].restarted, ["restarted"]);
    // Those of the program's start.
    assert_eq!(looks.rebuild[1].restarted, ["entered", "startup"]);
}

#[test]
fn tasks() {
    #[derive(Component)]
    struct OfEntity(#[allow(dead_code, reason = "it is held")] Task<()>);
    #[derive(Resource)]
    struct OfResource(#[allow(dead_code, reason = "it is held")] Task<()>);
    /// What the task of an entity, that of a resource and a detached one hold. They may outlive their World.
    static HELD: Mutex<[Weak<()>; 3]> = Mutex::new([const { Weak::new() }; 3]);

    /// Spawns a task without end.
    fn spawn(held: &mut Weak<()>) -> Task<()> {
        let holds = Arc::new(());
        *held = Arc::downgrade(&holds);
        AsyncComputeTaskPool::get().spawn(async move {
            pending::<()>().await;
            drop(holds);
        })
    }

    let looks = looks(
        |app| {
            app.add_systems(
                Update,
                (|mut commands: Commands| {
                    let mut held = HELD.lock().expect("no system panics");
                    let [of_entity, of_resource, detached] = &mut *held;
                    commands.spawn(OfEntity(spawn(of_entity)));
                    commands.insert_resource(OfResource(spawn(of_resource)));
                    spawn(detached).detach();
                })
                .run_if(last_tick),
            );
        },
        |_| HELD.lock().expect("no system panics").each_ref().map(|held| held.strong_count() > 0),
    );
    assert_eq!(looks.startup[1].loaded, [false, true, true]);
    assert_eq!([looks.state[1].loaded, looks.system[1].loaded], [[true; 3]; 2]);
    assert_eq!(looks.rebuild[1].loaded, [false, false, true]);
}

#[test]
fn assets() {
    #[derive(Asset, TypePath)]
    struct Picture;
    #[derive(Resource)]
    struct Frame(#[allow(dead_code, reason = "it is held")] Handle<Picture>);
    #[derive(Component)]
    struct Poster(Handle<Picture>);
    /// The picture of the resource, and that of the entity in the first episode.
    #[derive(Resource)]
    struct Known([AssetId<Picture>; 2]);

    let looks = looks(
        |app| {
            app.init_asset::<Picture>();
            let framed = app.world_mut().resource_mut::<Assets<Picture>>().add(Picture);
            let id = framed.id();
            app.insert_resource(Frame(framed))
                .add_systems(Startup, |mut pictures: ResMut<Assets<Picture>>, mut commands: Commands| {
                    commands.spawn(Poster(pictures.add(Picture)));
                })
                .add_systems(
                    Update,
                    (move |poster: Single<&Poster>, mut commands: Commands| {
                        commands.insert_resource(Known([id, poster.0.id()]));
                    })
                    .run_if(last_tick),
                );
        },
        |world| {
            // It otherwise runs in `PreUpdate`, before or after the look.
            world.run_system_once(Assets::<Picture>::track_assets).expect("it needs assets alone");
            let pictures = world.resource::<Assets<Picture>>();
            let known = world.get_resource::<Known>();
            (known.map(|known| known.0.map(|id| pictures.contains(id))), pictures.len())
        },
    );
    // A second poster each time.
    assert_eq!(looks.startup.map(|episode| episode.restarted), [(None, 2), (Some([true, false]), 2)]);
    for other in [looks.state, looks.system] {
        assert_eq!(other.map(|episode| episode.restarted), [(None, 2), (Some([true, true]), 2)]);
    }
    assert_eq!(looks.rebuild.map(|episode| episode.restarted), [(None, 2); 2]);
}

#[test]
fn keys_and_buttons() {
    /// Whether key, mouse button and button of the gamepad were pressed in the last tick of the first episode.
    #[derive(Resource, Default)]
    struct Held([bool; 3]);

    fn pressed(world: &mut World) -> [bool; 3] {
        let mut pads = world.query::<&Gamepad>();
        let is_pad_pressed = pads.iter(world).any(|pad| pad.pressed(GamepadButton::South));
        let key = world.resource::<ButtonInput<KeyCode>>().pressed(KeyCode::Space);
        [key, world.resource::<ButtonInput<MouseButton>>().pressed(MouseButton::Left), is_pad_pressed]
    }

    let looks = looks(
        |app| {
            app.init_resource::<Held>().add_systems(
                Update,
                (|world: &mut World| world.resource_mut::<Held>().0 = pressed(world)).run_if(last_tick),
            );
        },
        |world| (world.resource::<Held>().0, pressed(world)),
    );
    for other in [looks.startup, looks.state, looks.system] {
        assert_eq!(other[1].loaded, ([true; 3], [false; 3]));
    }
    assert_eq!(looks.rebuild[1].loaded, ([false; 3], [false; 3]));
}

#[test]
fn windows_monitors_and_gamepads() {
    /// Plugs in a gamepad and a monitor, and names the window.
    fn plug_in(mut window: Single<&mut Window, With<PrimaryWindow>>, mut commands: Commands) {
        window.title = "named".to_owned();
        commands.spawn(Gamepad::default());
        commands.spawn(Monitor {
            name: None,
            physical_height: 720,
            physical_width: 1280,
            physical_position: IVec2::ZERO,
            refresh_rate_millihertz: None,
            scale_factor: 1.0,
            video_modes: Vec::new(),
        });
    }

    let looks = looks(
        |app| _ = app.add_systems(Update, plug_in.run_if(last_tick)),
        |world| {
            let window = world.query::<&Window>().single(world).expect("one window");
            let is_named = window.title == "named";
            let pads = world.query::<&Gamepad>().iter(world).count();
            (is_named, pads, world.query::<&Monitor>().iter(world).count())
        },
    );
    // The gamepad of the agent is plugged in before.
    let begun = (false, 1, 0);
    for other in [looks.startup, looks.state, looks.system] {
        assert_eq!(other.map(|episode| episode.loaded), [begun, (true, 2, 1)]);
    }
    assert_eq!(looks.rebuild.map(|episode| episode.loaded), [begun; 2]);
}
