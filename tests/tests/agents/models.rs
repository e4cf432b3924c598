//! Language models that play games of several agents, with illegal actions and with pictures, in this process.

use std::{fs, io::Cursor, path::Path, sync::Mutex};

use bevy_playbot::vision::{ImageOptions, ObservationConfig, ObservationKind};
use playbot::harness::{demo::verify_file, foreign::ForeignGame, prelude::*};
use playbot_bridge::{
    lockstep::{Autoreset, LevelOrder, Settings},
    mcp::{Bounds, Examiner, FoundInEpisode, NoExaminer, PlayedEpisode, Server, SessionEnd},
};
use playbot_tests::{Corridor, PaintedCorridor};
use serde_json::{Value, json};

fn settings<'a>(game: &'a dyn Game, levels: &str) -> Settings<'a> {
    Settings {
        game,
        levels: levels.parse().expect("levels"),
        order: LevelOrder::Rounds,
        observation: ObservationConfig::default(),
        picture: None,
        arenas: 1,
        threads: 1,
        seed: 1,
        autoreset: Autoreset::Disabled,
        first_seat: false,
    }
}

/// Calls tools, one after the other, and returns the results and the end of the session.
fn played(
    settings: &Settings<'_>,
    folder: &Path,
    first_seat: bool,
    examiner: &dyn Examiner,
    calls: &[(&str, Value)],
) -> (Vec<Value>, SessionEnd) {
    let (settings, bounds) = (&Settings { first_seat, ..settings.clone() }, Bounds::default());
    let server = Server { settings, bounds, folder, examiner, stops: &|| false, report: &|_| {} };
    let greeting =
        json!({ "jsonrpc": "2.0", "id": 0, "method": "initialize", "params": { "protocolVersion": "2025-06-18" } });
    let call = |(at, (name, arguments)): (usize, &(&str, Value))| {
        let params = json!({ "name": name, "arguments": arguments });
        json!({ "jsonrpc": "2.0", "id": at + 1, "method": "tools/call", "params": params })
    };
    let all = std::iter::once(greeting).chain(calls.iter().enumerate().map(call));
    let said: String = all.map(|message| format!("{message}\n")).collect();
    let mut heard = Vec::new();
    let ended = server.run(Cursor::new(said), &mut heard).expect("a thread");
    let lines = String::from_utf8(heard).expect("text");
    let answers = lines.lines().skip(1).map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    (answers.map(|mut answer| answer["result"].take()).collect(), ended)
}

/// Calls tools in a session that examines nothing, and returns their results.
fn called(settings: &Settings<'_>, first_seat: bool, calls: &[(&str, Value)]) -> (tempfile::TempDir, Vec<Value>) {
    let folder = tempfile::tempdir().expect("a folder");
    let (results, _) = played(settings, folder.path(), first_seat, &NoExaminer, calls);
    (folder, results)
}

fn data(result: &Value) -> &Value {
    assert_eq!(result["isError"], false, "{result}");
    &result["structuredContent"]
}

fn why(result: &Value) -> &str {
    assert_eq!(result["isError"], true, "{result}");
    result["content"][0]["text"].as_str().expect("text")
}

#[test]
fn each_seat_has_an_action_and_the_others_rest_or_go_on() {
    let game = foreign_pong::pong();
    let (folder, results) = called(
        &settings(&game, "default:0..9"),
        false,
        &[
            ("reset", json!({})),
            ("level", json!({})),
            ("act", json!({ "actions": { "left": 1, "right": 2 }, "ticks": 5 })),
            ("act", json!({ "actions": { "left": 0 }, "others": "hold", "ticks": 3 })),
            ("act", json!({ "actions": { "left": 2 }, "ticks": 2 })),
            ("act", json!({ "actions": { "middle": 1 } })),
            ("act", json!({ "actions": { "right": "KeyX" } })),
            ("act", json!({ "action": 1 })),
            ("replay", json!({})),
            ("findings", json!({ "report": "the ball is square" })),
        ],
    );
    let own = |result: &Value, seat: usize| data(result)["agents"][seat]["values"]["own"].as_f64().expect("a number");
    let seats: Vec<&Value> =
        data(&results[0])["agents"].as_array().expect("two").iter().map(|it| &it["seat"]).collect();
    assert_eq!(seats, ["left", "right"]);
    let actions = &data(&results[1])["seats"];
    assert_ne!(actions[0]["actions"]["names"], actions[1]["actions"]["names"], "each has keys of its own");
    assert!(own(&results[2], 0) > 0.0 && own(&results[2], 1) < 0.0, "{}", results[2]);
    assert!(own(&results[3], 0) == own(&results[2], 0) && own(&results[3], 1) < own(&results[2], 1), "right goes on");
    assert!(own(&results[4], 0) < own(&results[3], 0) && own(&results[4], 1) == own(&results[3], 1), "right rests");
    assert!(why(&results[5]).contains("unknown seat `middle`") && why(&results[5]).contains("left, right"));
    assert!(why(&results[6]).contains("`right`: unknown action `KeyX`"), "{}", results[6]);
    assert!(why(&results[7]).contains("several agents: name `actions` by seat"));
    assert_eq!((&data(&results[8])["same"], &data(&results[8])["ticks"]), (&json!(true), &json!(10)));
    assert!(data(&results[9])["note"].as_str().is_some_and(|note| note.contains("--first-seat")));
    let lines = fs::read_to_string(folder.path().join("episodes.jsonl")).expect("written");
    let lines: Vec<Value> = lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert_eq!(lines[0]["report"], "the ball is square");
    assert_eq!(lines[1]["seats"][1]["actions"].as_array().map(Vec::len), Some(10));
    assert!(!folder.path().join("session.demo").exists(), "it would hold one seat alone, and not replay");
}

#[test]
fn the_first_seat_alone_is_recorded_as_tests_play_it() {
    let game = foreign_pong::pong();
    let calls = [("reset", json!({ "level": 4 })), ("act", json!({ "action": 1, "ticks": 40 })), ("replay", json!({}))];
    let (folder, results) = called(&settings(&game, "default:0..9"), true, &calls);
    assert_eq!(data(&results[1])["agents"].as_array().map(Vec::len), Some(1));
    assert_eq!(data(&results[2])["same"], true);
    let verified = verify_file(&game, &folder.path().join("session.demo"), |_| {}).expect("readable");
    assert_eq!((verified.ticks, verified.divergences.len()), (40, 0), "{verified:?}");
}

/// A game whose second action is legal in the first three ticks alone.
fn tired() -> ForeignGame {
    use bevy::prelude::*;
    #[derive(Resource, Default)]
    struct Steps(u32);
    let game = |app: &mut App| {
        app.init_resource::<Steps>().add_systems(Update, |mut steps: ResMut<Steps>| steps.0 += 1);
    };
    ForeignGame::new("tired", 1, game)
        .keys([vec![], vec![KeyCode::Space]])
        .legal(|steps: Res<Steps>| [true, steps.0 < 3])
        .observe(["steps"], |steps: Res<Steps>| [steps.0 as f32])
        .time_limit(20)
        .restart(playbot_harness::foreign::Restart::system(|mut steps: ResMut<Steps>| steps.0 = 0))
}

#[test]
fn an_action_that_is_not_legal_is_refused_and_ends_a_call() {
    let game = tired();
    let calls = [
        ("reset", json!({})),
        ("act", json!({ "action": "Space", "ticks": 9 })),
        ("act", json!({ "action": "Space" })),
        ("act", json!({ "action": "nothing", "ticks": 100 })),
    ];
    let (_, results) = called(&settings(&game, "default:0..9"), false, &calls);
    let stopped = data(&results[1]);
    assert!(stopped["ticks"].as_u64().is_some_and(|ticks| ticks < 9), "{stopped}");
    assert!(stopped["stopped"].as_str().is_some_and(|words| words.contains("not legal now; legal: [\"nothing\"]")));
    assert_eq!(stopped["agents"][0]["legal"], json!(["nothing"]));
    assert!(why(&results[2]).contains("the action \"Space\" is not legal now"));
    let over = data(&results[3]);
    assert_eq!((&over["over"], &over["agents"][0]["truncated"]), (&json!(true), &json!(true)));
    assert_eq!(over["agents"][0]["terminated"], false);
}

#[test]
fn a_game_that_is_seen_as_pictures_shows_them() {
    let image = ImageOptions { width: 24, height: 16, ..ImageOptions::default() };
    let observation = ObservationConfig { kind: ObservationKind::Raster, image };
    let settings = Settings { observation, ..settings(&PaintedCorridor, "plain:0..9") };
    let (_, results) = called(&settings, false, &[("reset", json!({ "picture": true })), ("level", json!({}))]);
    assert_eq!(results[0]["content"][1]["mimeType"], "image/png");
    assert_eq!(data(&results[0])["agents"][0]["values"], json!({}));
    assert_eq!(data(&results[1])["picture"], json!([24, 16]));
    let settings = self::settings(&Corridor, "plain:0..9");
    let (_, results) = called(&settings, false, &[("reset", json!({ "picture": true }))]);
    assert!(why(&results[0]).contains("cannot be drawn here"));
}

/// Notes what it is asked to look at.
#[derive(Default)]
struct Noting(Mutex<Vec<(usize, usize)>>);

impl Examiner for Noting {
    fn examine(&self, episode: &PlayedEpisode, _: &str) -> Result<Vec<FoundInEpisode>, String> {
        self.0.lock().expect("no thread panics").push((episode.number, episode.ticks()));
        Ok(Vec::new())
    }

    fn store(&self, _: &PlayedEpisode, _: u32, _: &str, _: &str) -> Result<FoundInEpisode, String> {
        Err("the disk is full".to_owned())
    }
}

#[test]
fn detectors_look_once_at_each_episode_and_again_where_it_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let noting = Noting::default();
    let calls = [
        ("reset", json!({})),
        ("act", json!({ "action": 1, "ticks": 10 })),
        ("reset", json!({})),
        ("act", json!({ "action": 2, "ticks": 4 })),
        ("findings", json!({})),
        ("findings", json!({ "report": "it is dull" })),
        ("act", json!({ "action": 2, "ticks": 2 })),
    ];
    let (results, ended) = played(&settings(&Corridor, "plain:1..9"), folder.path(), false, &noting, &calls);
    assert_eq!(data(&results[1])["agents"][0]["success"], true);
    assert_eq!(why(&results[5]), "the disk is full");
    assert_eq!(*noting.0.lock().expect("no thread panics"), [(0, 3), (1, 4), (1, 6)], "the last look is at the end");
    assert_eq!((ended.episodes, ended.ticks, ended.findings), (2, 9, 0));
}
