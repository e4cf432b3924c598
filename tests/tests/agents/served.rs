//! Other programs play: Worlds in lockstep, and the protocol over sockets.

use std::{
    io::Read,
    os::unix::net::UnixStream,
    path::Path,
    sync::{Arc, Mutex},
    thread,
};

use bevy_playbot::vision::{ImageOptions, ObservationConfig, ObservationKind};
use playbot::harness::prelude::*;
use playbot_bridge::{
    arrays::{Layout, Memory},
    lockstep::{Autoreset, Awaited, LevelOrder, Lockstep, SavedEpisode, Settings, StepError, with_worlds},
    messages::{Kind, Refusal, Reset, read, write, write_json},
    server::{Address, Listener, Server},
};
use playbot_tests::{Corridor, Drift};
use serde_json::{Value, json};

fn settings(arenas: u32, threads: usize, autoreset: Autoreset) -> Settings<'static> {
    Settings {
        game: &Corridor,
        levels: "default:0..9".parse().expect("levels"),
        order: LevelOrder::Uniform,
        observation: ObservationConfig::default(),
        picture: None,
        arenas,
        threads,
        seed: 1,
        autoreset,
        first_seat: false,
    }
}

/// The Worlds of a conversation, and the bytes of their arrays.
struct Played<'a> {
    worlds: &'a mut Lockstep,
    memory: Arc<Memory>,
}

fn with_played<T>(settings: &Settings<'_>, work: impl FnOnce(&mut Played<'_>) -> T) -> T {
    let memory = Arc::new(Memory::of_messages(settings.layout()));
    with_worlds(settings, &memory, |worlds| work(&mut Played { worlds, memory: memory.clone() }))
        .expect("it can be built")
}

impl Played<'_> {
    fn reset(&mut self, levels: &[u64]) {
        let reset = Reset { levels: Some(levels.to_vec()), ..Reset::default() };
        self.worlds.reset(&reset).expect("there are such levels");
    }

    fn act(&mut self, actions: &[i32]) -> Result<usize, StepError> {
        let mut bytes: Vec<u8> = actions.iter().flat_map(|action| action.to_le_bytes()).collect();
        bytes.resize(self.memory.layout().action_bytes, 0);
        self.memory.take_actions(&bytes);
        self.worlds.step()
    }

    fn step(&mut self, actions: &[i32]) {
        self.act(actions).expect("actions of the game");
    }

    /// Keeps the episode of an arena, if it is not over.
    fn save(&mut self, arena: usize) -> Option<Vec<SavedEpisode>> {
        self.worlds.begin_save(arena).and_then(Awaited::answer).expect("there is such an arena")
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        let array = self.memory.layout().result(name).expect("an array of this name").clone();
        self.memory.with_results(|results| results[array.offset..array.offset + array.len()].to_vec())
    }

    fn numbers(&self, name: &str) -> Vec<f32> {
        self.bytes(name).chunks(4).map(|word| f32::from_le_bytes(word.try_into().expect("four bytes"))).collect()
    }

    fn levels(&self) -> Vec<u64> {
        self.bytes("level").chunks(8).map(|word| u64::from_le_bytes(word.try_into().expect("eight bytes"))).collect()
    }

    /// Reward, ends, success, cell and tick of the first agent.
    fn first(&self) -> (f32, [u8; 3], i32, u32) {
        let ends = ["terminated", "truncated", "success"].map(|name| self.bytes(name)[0]);
        let seen = self.numbers("observations");
        let cell = ((seen[0] + 1.0) * 3.0).round() as i32;
        (self.numbers("rewards")[0], ends, cell, (seen[1] * 20.0).round() as u32)
    }
}

const RUNS: [u8; 3] = [0; 3];
const WON: [u8; 3] = [1, 0, 1];

#[test]
fn the_next_step_after_an_end_begins_an_episode() {
    with_played(&settings(1, 1, Autoreset::NextStep), |played| {
        played.reset(&[1]);
        assert_eq!(played.first(), (0.0, RUNS, 3, 0));
        played.step(&[1]);
        assert_eq!(played.first(), (0.0, RUNS, 4, 1));
        played.step(&[1]);
        played.step(&[1]);
        assert_eq!((played.first(), played.levels()), ((1.0, WON, 6, 3), vec![1]));
        played.step(&[0]);
        let (reward, ends, cell, tick) = played.first();
        assert_eq!((reward, ends, tick), (0.0, RUNS, 0));
        // The level that a reset has named was for one episode.
        assert_eq!(cell, 3 + i32::from(played.levels()[0].is_multiple_of(2)));
        played.step(&[2]);
        assert_eq!(played.first(), (0.0, RUNS, cell, 1));
    });
}

#[test]
fn the_same_step_shows_the_next_episode_and_the_last_observation() {
    with_played(&settings(1, 1, Autoreset::SameStep), |played| {
        played.reset(&[1]);
        [1, 1, 1].iter().for_each(|&action| played.step(&[action]));
        let (reward, ends, _, tick) = played.first();
        assert_eq!((reward, ends, tick), (1.0, WON, 0));
        assert_eq!(played.numbers("final_observations"), [1.0, 0.15]);
        played.step(&[2]);
        assert_eq!((played.first().1, played.first().3), (RUNS, 1));
    });
}

#[test]
fn an_arena_that_is_not_begun_again_waits_while_others_play_on() {
    with_played(&settings(2, 1, Autoreset::Disabled), |played| {
        played.reset(&[1, 1]);
        (0..3).for_each(|_| played.step(&[1, 2]));
        assert_eq!(played.first(), (1.0, WON, 6, 3));
        played.step(&[0, 0]);
        assert_eq!(played.first(), (0.0, WON, 6, 3));
        assert_eq!(played.numbers("observations")[2..], [2.0 / 3.0 - 1.0, 0.2]);
        let reset = Reset { arenas: Some(vec![0]), levels: Some(vec![2]), seed: None };
        played.worlds.reset(&reset).expect("there is such an arena");
        assert_eq!(played.first(), (0.0, RUNS, 4, 0));
        assert_eq!(played.numbers("observations")[2..], [2.0 / 3.0 - 1.0, 0.2], "the other arena stands still");
    });
}

#[test]
fn time_that_is_up_is_no_end_of_the_game() {
    with_played(&settings(1, 1, Autoreset::NextStep), |played| {
        played.reset(&[1]);
        (0..20).for_each(|_| played.step(&[2]));
        assert_eq!(played.first(), (0.0, [0, 1, 0], 3, 20));
    });
}

/// Returns all results of some steps, byte for byte.
fn results(arenas: u32, threads: usize, autoreset: Autoreset, order: LevelOrder) -> Vec<Vec<u8>> {
    let settings = Settings { order, ..settings(arenas, threads, autoreset) };
    with_played(&settings, |played| {
        played.worlds.reset(&Reset { seed: Some(7), ..Reset::default() }).expect("sound");
        let mut all = Vec::new();
        for step in 0..60 {
            let actions: Vec<i32> = (0..arenas as i32).map(|arena| (arena * 7 + step * step) % 3).collect();
            played.step(&actions);
            all.push(played.memory.with_results(<[u8]>::to_vec));
        }
        all
    })
}

#[test]
fn results_do_not_depend_on_threads() {
    for autoreset in [Autoreset::NextStep, Autoreset::SameStep, Autoreset::Disabled] {
        let alone = results(6, 1, autoreset, LevelOrder::Uniform);
        for threads in [2, 3, 4, 6] {
            assert_eq!(results(6, threads, autoreset, LevelOrder::Uniform), alone, "{threads} {autoreset:?}");
        }
    }
}

#[test]
fn levels_in_turn_are_shared_out_over_the_arenas() {
    let settings = Settings { order: LevelOrder::Rounds, ..settings(3, 1, Autoreset::SameStep) };
    with_played(&settings, |played| {
        played.worlds.reset(&Reset::default()).expect("sound");
        let mut seen = vec![played.levels()];
        while seen.len() < 5 {
            played.step(&[0; 3]);
            if played.bytes("terminated").contains(&1) && seen.last() != Some(&played.levels()) {
                seen.push(played.levels());
            }
        }
        let of_first: Vec<u64> = seen.iter().map(|levels| levels[0]).collect();
        assert_eq!(seen[0], [0, 1, 2]);
        let mut different = of_first.clone();
        different.dedup();
        assert!(different.starts_with(&[0, 3, 6]), "{of_first:?}");
    });
}

#[test]
fn actions_are_those_of_a_world_that_is_played_directly() {
    let (mut world, agents) = playbot::harness::worlds::build_world(&Corridor, "default", 0, 0, 1);
    world.entity_mut(agents[0]).insert((Control::Bot, LevelQueue::Always(4)));
    with_played(&settings(1, 1, Autoreset::Disabled), |played| {
        played.reset(&[4]);
        for action in [2, 0, 1, 0, 0, 2] {
            world.entity_mut(agents[0]).insert(Action(ActionValue::Discrete(action)));
            world.tick().expect("sound");
            // What the agent sees before it acts.
            let seen = &world.get::<Observation>(agents[0]).expect("an observation").vector;
            assert_eq!(&played.numbers("observations"), seen);
            played.step(&[action as i32]);
            assert_eq!(played.numbers("rewards")[0], world.get::<Reward>(agents[0]).expect("a reward").get());
        }
    });
}

#[test]
fn a_wrong_action_names_its_arena_and_changes_nothing() {
    with_played(&settings(3, 2, Autoreset::NextStep), |played| {
        let refused = |result| match result {
            Err(StepError::Refused(Refusal { error, arena, .. })) => (error, arena),
            other => panic!("{other:?}"),
        };
        assert!(refused(played.act(&[0; 3])).0.contains("send a reset first"));
        played.reset(&[1, 1, 1]);
        let before = played.memory.with_results(<[u8]>::to_vec);
        let (error, arena) = refused(played.act(&[1, 1, 3]));
        assert!(error.contains("discrete action 3 is outside") && arena == Some(2), "{error}");
        let (error, arena) = refused(played.act(&[1, -1, 0]));
        assert!(error.contains("-1 is negative") && arena == Some(1), "{error}");
        assert_eq!(played.memory.with_results(<[u8]>::to_vec), before);
        played.step(&[1, 1, 1]);
        assert_eq!(played.first(), (0.0, RUNS, 4, 1), "no action was lost");
    });
}

#[test]
fn resets_of_what_is_not_there_are_refused() {
    with_played(&settings(2, 1, Autoreset::NextStep), |played| {
        let mut words = |reset: Reset| played.worlds.reset(&reset).expect_err("refused").to_string();
        let one = |arena| Reset { arenas: Some(vec![arena]), ..Reset::default() };
        assert!(words(one(0)).contains("the first reset begins episodes in all arenas"));
        assert_eq!(words(one(2)), "there is no arena 2: they are numbered from 0 to 1");
        let levels = |levels: Vec<u64>| Reset { levels: Some(levels), ..Reset::default() };
        assert_eq!(words(levels(vec![1])), "1 levels for 2 arenas: name one for each");
    });
}

#[test]
fn an_arena_goes_on_from_a_kept_episode_and_so_does_another() {
    with_played(&settings(2, 2, Autoreset::NextStep), |played| {
        played.reset(&[1, 2]);
        played.step(&[0, 2]);
        played.step(&[2, 2]);
        let kept = played.save(0).expect("it plays");
        let then = played.first();
        played.step(&[0, 2]);
        played.step(&[0, 2]);
        assert_eq!(played.first().1, [1, 0, 0], "it falls into the pit");
        assert!(played.save(0).is_none(), "it is over");
        played.worlds.load(0, kept.clone()).expect("the same actions");
        assert_eq!((played.first(), played.levels()), (then, vec![1, 2]));
        assert_eq!(played.numbers("observations")[3], 0.2, "the other arena stands still");
        played.worlds.load(1, kept).expect("the same actions");
        let seen = played.numbers("observations");
        assert_eq!(seen[..2], seen[2..]);
        played.step(&[1, 1]);
        assert_eq!((played.first().2, played.first().3), (3, 3));
    });
}

#[test]
fn a_kept_episode_that_leads_elsewhere_is_noticed() {
    with_played(&settings(1, 1, Autoreset::NextStep), |played| {
        played.reset(&[1]);
        played.step(&[0]);
        let kept = played.save(0).expect("it plays");
        let drift = played.worlds.begin_calls(|_, world, _| world.insert_resource(Drift(5))).expect("it plays");
        drift.into_iter().try_for_each(Awaited::answer).expect("it plays");
        match played.worlds.load(0, kept) {
            Err(StepError::Failed(why)) => {
                assert!(why.contains("agent 0, level 1") && why.contains("`doctor`"), "{why}")
            }
            other => panic!("{other:?}"),
        }
    });
}

// Over a socket.

/// Serves to one client, which gets a stream, until it leaves. Returns what was reported.
fn served(shared: bool, client: impl FnOnce(&Path, &mut UnixStream)) -> Vec<String> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("socket");
    let listener = Listener::open(&Address::Unix(path.clone())).expect("a socket");
    let settings = settings(2, 2, Autoreset::NextStep);
    let said = Mutex::new(Vec::new());
    let report = |line: &str| said.lock().expect("no thread panics").push(line.to_owned());
    let stops = || false;
    thread::scope(|scope| {
        let server = Server { settings: &settings, shared, once: true, stops: &stops, report: &report };
        scope.spawn(move || server.run(&listener).expect("clients are heard"));
        let mut stream = UnixStream::connect(&path).expect("it listens");
        client(&path, &mut stream);
        drop(stream);
    });
    assert!(!path.exists(), "the socket is left behind");
    said.into_inner().expect("no thread panics")
}

fn answer(stream: &mut UnixStream) -> (Kind, Vec<u8>) {
    read(stream, 1 << 20).expect("a message").expect("the program is there")
}

fn json_of(stream: &mut UnixStream, kind: Kind) -> Value {
    let (answered, content) = answer(stream);
    assert_eq!(answered, kind, "{}", String::from_utf8_lossy(&content));
    serde_json::from_slice(&content).expect("JSON")
}

fn greet(stream: &mut UnixStream) -> Value {
    write_json(stream, Kind::Hello, &json!({ "protocol": 1, "client": "test" })).expect("it is there");
    json_of(stream, Kind::Hello)
}

#[test]
fn a_conversation_over_a_socket() {
    let said = served(false, |_, stream| {
        let described = greet(stream);
        assert_eq!((&described["game"], &described["agents"]), (&json!("corridor"), &json!(2)));
        assert_eq!(described["memory"], Value::Null);
        let layout = Layout::new(2, &Corridor.actions(), &ObservationConfig::default().obs_kind(&Corridor), false);
        assert_eq!((&described["layout"], &described["checksum"]), (&json!(layout), &json!(layout.checksum())));
        write_json(stream, Kind::Reset, &json!({ "levels": [1, 2] })).expect("it is there");
        assert_eq!(answer(stream).1.len(), 1 + layout.result_bytes);
        let step = [1_u8, 0, 0, 0, 0, 0, 0, 0];
        let refusal = |stream: &mut UnixStream| json_of(stream, Kind::Error);
        write(stream, Kind::Step, &[&step]).expect("it is there");
        assert!(refusal(stream)["error"].as_str().is_some_and(|error| error.contains("64 are expected")));
        write(stream, Kind::Step, &[&step, &[0; 56]]).expect("it is there");
        let (kind, content) = answer(stream);
        let cell = layout.result("observations").expect("there").offset + 1;
        assert_eq!((kind, &content[cell..cell + 4]), (Kind::State, &(4.0_f32 / 3.0 - 1.0).to_le_bytes()[..]));
        for (call, words) in [
            (json!({ "call": "fly" }), "unknown variant `fly`"),
            (json!({ "call": "hash", "arena": 2 }), "there is no arena 2"),
            (json!({ "call": "load", "arena": 0, "saved": 9 }), "nothing is kept under the number 9"),
            (json!({ "call": "forget", "saved": 9 }), "nothing is kept under the number 9"),
            (json!({ "call": "render", "arena": 0 }), "--render"),
        ] {
            write_json(stream, Kind::Call, &call).expect("it is there");
            let refused = refusal(stream);
            assert!(refused["error"].as_str().is_some_and(|error| error.contains(words)), "{refused}");
            assert_eq!(refused["fatal"], false);
        }
        let folder = tempfile::tempdir().expect("a folder");
        write_json(stream, Kind::Call, &json!({ "call": "record", "folder": folder.path().join("a/b") }))
            .expect("it is there");
        let files = json_of(stream, Kind::Answer)["files"].as_array().map_or(0, Vec::len);
        assert_eq!(files, 2, "one for each World");
        write(stream, Kind::State, &[]).expect("it is there");
        assert!(refusal(stream)["error"].as_str().is_some_and(|error| error.contains("of kind 10")));
        write_json(stream, Kind::Call, &json!({ "call": "hash", "arena": 0 })).expect("it is there");
        assert_eq!(json_of(stream, Kind::Answer), json!({ "hash": "0000000000000004" }));
        write(stream, Kind::Close, &[]).expect("it is there");
    });
    assert_eq!(said, ["test is connected", "test has left: after 1 steps"]);
}

#[test]
fn shared_memory_is_gone_once_the_client_has_it() {
    served(true, |_, stream| {
        let described = greet(stream);
        let path = Path::new(described["memory"]["path"].as_str().expect("a path")).to_owned();
        assert_eq!(
            std::fs::metadata(&path).expect("there").len(),
            described["memory"]["bytes"].as_u64().expect("a number")
        );
        write_json(stream, Kind::Call, &json!({ "call": "mapped" })).expect("it is there");
        assert_eq!(json_of(stream, Kind::Answer), json!({}));
        assert!(left_in_memory().is_empty());
    });
    served(true, |_, stream| {
        // It leaves before it has opened the memory.
        greet(stream);
    });
    assert!(left_in_memory().is_empty());
}

/// Returns the names of shared memory of this process.
fn left_in_memory() -> Vec<String> {
    let own = format!("playbot-{}-", std::process::id());
    let names = std::fs::read_dir("/dev/shm").into_iter().flatten().flatten();
    names.map(|entry| entry.file_name().to_string_lossy().into_owned()).filter(|name| name.starts_with(&own)).collect()
}

#[test]
fn more_than_fits_into_memory_is_refused_before_anything_is_written() {
    let image = ImageOptions { width: 1024, height: 1024, stack: 16, ..ImageOptions::default() };
    let observation = ObservationConfig { kind: ObservationKind::Raster, image };
    let many = Settings { observation, ..settings(65_536, 1, Autoreset::NextStep) };
    let words = many.check_memory().expect_err("terabytes").to_string();
    assert!(words.contains("65536 agents that see 1024×1024") && words.contains("lower `--arenas`"), "{words}");
    settings(64, 2, Autoreset::NextStep).check_memory().expect("a few kilobytes");
}

#[test]
fn other_clients_and_other_versions_are_refused() {
    served(false, |path, stream| {
        greet(stream);
        let mut second = UnixStream::connect(path).expect("it listens");
        let refused = json_of(&mut second, Kind::Error);
        assert!(refused["error"].as_str().is_some_and(|error| error.contains("one at a time")), "{refused}");
        assert_eq!((&refused["fatal"], second.read(&mut [0]).ok()), (&json!(true), Some(0)));
    });
    let said = served(false, |_, stream| {
        write_json(stream, Kind::Hello, &json!({ "protocol": 2, "client": "later" })).expect("it is there");
        let refused = json_of(stream, Kind::Error);
        assert!(refused["error"].as_str().is_some_and(|error| error.contains("later speaks version 2")), "{refused}");
    });
    assert!(said[0].contains("version 2"), "{said:?}");
    served(false, |_, stream| {
        write(stream, Kind::Close, &[]).expect("it is there");
        let refused = json_of(stream, Kind::Error);
        assert!(refused["error"].as_str().is_some_and(|error| error.contains("says hello first")), "{refused}");
    });
}

#[test]
fn a_socket_that_others_could_reach_is_not_opened() {
    let open = Listener::open(&Address::Tcp("0.0.0.0:0".parse().expect("an address"))).expect_err("it is refused");
    assert!(open.to_string().contains("take 127.0.0.1"), "{open}");
    let own = Listener::open(&Address::Tcp("127.0.0.1:0".parse().expect("an address"))).expect("a free port");
    assert!(own.address().starts_with("127.0.0.1:") && !own.address().ends_with(":0"));
}
