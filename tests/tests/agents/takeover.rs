//! Tests of taking over a shipped build: testers record, policies and recordings play, and control is given back.

use std::{path::Path, time::Duration};

use bevy::{
    input::{
        ButtonState, InputPlugin,
        keyboard::{Key, KeyboardInput, NativeKey},
    },
    prelude::*,
    time::{TimePlugin, TimeUpdateStrategy},
};
use bevy_playbot::{
    demo::file::{Decider, DemoEnd, DemoReader},
    engine::merge_demos,
    episode::Tick,
    fault::FaultOccurred,
    headless::set_fixed_step,
    prelude::*,
    takeover::{GameIdentity, Takeover, TakeoverPlugin, TakeoverRequest, TeachOptions, Teaching},
};
use playbot_learner::{
    DeviceKind, Learner as _, ObsKind, PolicyFile, PolicyMetadata, PolicySpec, PpoConfig, PpoLearner,
};
use playbot_tests::{Cell, Drift, corridor_plugin, spawn_walker};

#[derive(Resource, Default)]
struct Heard(Vec<String>);

/// Returns a build of the corridor in which the key that goes right is held.
fn build(plugin: TakeoverPlugin) -> (App, Entity) {
    let mut app = App::new();
    app.add_plugins((TimePlugin, InputPlugin, PlaybotPlugin::default(), plugin))
        .add_plugins(corridor_plugin)
        .init_resource::<Heard>()
        .add_observer(|event: On<FaultOccurred>, mut heard: ResMut<Heard>| heard.0.push(event.fault.to_string()));
    let step = set_fixed_step(&mut app, 10.0);
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    let agent = spawn_walker(app.world_mut(), 0);
    let held = (Control::Human, Action(ActionValue::Discrete(1)), LevelQueue::rounds([1, 2, 3]));
    app.world_mut().entity_mut(agent).insert(held);
    (app, agent)
}

fn corridor() -> GameIdentity {
    GameIdentity::new("corridor", 3).with_mode("plain")
}

fn plugin(request: Option<TakeoverRequest>) -> TakeoverPlugin {
    TakeoverPlugin {
        game: corridor(),
        key: Some(KeyCode::F9),
        request: request.map(Ok),
        teach: TeachOptions { program: Vec::new(), ..TeachOptions::default() },
    }
}

fn frames(app: &mut App, n: u32) {
    (0..n).for_each(|_| app.update());
}

fn press_key(app: &mut App) {
    press(app, KeyCode::F9);
}

fn press(app: &mut App, key_code: KeyCode) {
    for state in [ButtonState::Pressed, ButtonState::Released] {
        let (logical_key, window) = (Key::Unidentified(NativeKey::Unidentified), Entity::PLACEHOLDER);
        app.world_mut().write_message(KeyboardInput {
            key_code,
            logical_key,
            state,
            text: None,
            repeat: false,
            window,
        });
    }
    app.update();
}

fn heard(app: &App) -> &[String] {
    &app.world().resource::<Heard>().0
}

/// Returns the levels and ends of a recording.
fn recorded(path: &Path) -> Vec<(u64, usize, DemoEnd)> {
    let episodes = DemoReader::open(path).and_then(DemoReader::read_all).expect("whole");
    assert!(episodes.iter().flat_map(|episode| &episode.deciders).all(|who| *who == Decider::Human));
    episodes.iter().map(|episode| (episode.level_seed, episode.len(), episode.end)).collect()
}

const WON: DemoEnd = DemoEnd::Terminated { success: true };

#[test]
fn a_tester_records_and_what_was_begun_is_kept_when_the_game_ends() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ada.demo");
    let (mut app, _) = build(plugin(Some(TakeoverRequest::Record(path.clone()))));
    // The first episode, 3 ticks, began before the recording could begin; the next ones take 2 and 3.
    frames(&mut app, 1 + 3 + 2 + 3 + 1);
    assert!(app.world().resource::<Takeover>().is_running());
    assert_eq!(recorded(&path), [(2, 2, WON), (3, 3, WON)]);
    app.world_mut().write_message(AppExit::Success);
    app.update();
    assert_eq!(recorded(&path)[2..], [(1, 2, DemoEnd::Aborted)]);
    let header = DemoReader::open(&path).expect("readable").header().clone();
    assert_eq!((header.game.as_str(), header.game_version, header.mode.as_str()), ("corridor", 3, "plain"));
    assert_eq!(header.tick_hz, 10.0);
    assert!(heard(&app).is_empty(), "{:?}", heard(&app));
}

#[test]
fn the_same_file_is_continued_and_the_key_stops_and_starts() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ada.demo");
    for round in 1..=2 {
        let (mut app, _) = build(plugin(Some(TakeoverRequest::Record(path.clone()))));
        frames(&mut app, 1 + 3 + 2);
        press_key(&mut app);
        assert!(!app.world().resource::<Takeover>().is_running());
        assert_eq!(recorded(&path).len(), round, "the key comes before the tick of its frame");
        frames(&mut app, 20);
        assert_eq!(recorded(&path).len(), round, "no recording is on");
    }
    let (mut app, _) = build(plugin(Some(TakeoverRequest::Record(path.clone()))));
    frames(&mut app, 2);
    press_key(&mut app);
    press_key(&mut app);
    frames(&mut app, 20);
    assert!(recorded(&path).len() > 3, "it goes on after the second press");
    assert!(heard(&app).is_empty(), "{:?}", heard(&app));
}

#[test]
fn recordings_of_two_testers_merge() {
    let folder = tempfile::tempdir().expect("a folder");
    let paths = ["ada.demo", "bob.demo"].map(|name| folder.path().join(name));
    // Equal recordings would pass for copies.
    for (path, length) in paths.iter().zip([10, 11]) {
        let (mut app, _) = build(plugin(Some(TakeoverRequest::Record(path.clone()))));
        frames(&mut app, length);
        app.world_mut().write_message(AppExit::Success);
        app.update();
    }
    let out = folder.path().join("all.demo");
    let report = merge_demos(&paths, &out).expect("of one game");
    assert_eq!(report.episodes(), recorded(&out).len());
    assert_eq!(recorded(&out).len(), paths.iter().map(|path| recorded(path).len()).sum::<usize>());
}

#[test]
fn a_recording_plays_and_the_seat_is_given_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ada.demo");
    let (mut app, _) = build(plugin(Some(TakeoverRequest::Record(path.clone()))));
    frames(&mut app, 1 + 3 + 2 + 3);
    drop(app);
    for drifts in [false, true] {
        let (mut app, agent) = build(plugin(Some(TakeoverRequest::Replay(path.clone()))));
        if drifts {
            app.insert_resource(Drift(1));
        }
        app.world_mut().entity_mut(agent).insert(Action(ActionValue::Discrete(2)));
        frames(&mut app, 3);
        assert_eq!(app.world().get::<Control>(agent), Some(&Control::Replay));
        frames(&mut app, 20);
        assert_eq!(app.world().get::<Control>(agent), Some(&Control::Human), "it is over");
        assert!(!app.world().resource::<Takeover>().is_running());
        match drifts {
            false => assert!(heard(&app).is_empty(), "{:?}", heard(&app)),
            true => assert!(heard(&app)[0].contains("ada.demo: episode 0 does not replay"), "{:?}", heard(&app)),
        }
    }
}

/// Writes an untrained policy.
fn policy(folder: &Path, metadata: PolicyMetadata, values: usize) -> std::path::PathBuf {
    let spec = PolicySpec { obs: ObsKind::Vector(values), latent: 0, action_space: ActionSpace::Discrete(3) };
    let learner = PpoLearner::new(PpoConfig::default(), spec, 1, DeviceKind::Flex).expect("good settings");
    let path = folder.join("bot.policy");
    let file = PolicyFile { metadata, policy: learner.policy(), skills: None };
    file.save(&path, &vec![0.5; values], &[], 1).expect("written");
    path
}

fn metadata() -> PolicyMetadata {
    let observations = vec!["x".into(), "time".into()];
    PolicyMetadata { game: "corridor".into(), game_version: 3, observations, ..PolicyMetadata::default() }
}

#[test]
fn a_policy_plays_until_the_key_gives_the_seat_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = policy(folder.path(), metadata(), 2);
    let (mut app, agent) = build(plugin(Some(TakeoverRequest::Policy(path))));
    frames(&mut app, 4);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Policy), "{:?}", heard(&app));
    press_key(&mut app);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Human));
    press_key(&mut app);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Policy));
    assert!(app.world().resource::<Tick>().0 > 3 && app.world().get::<Cell>(agent).is_some());
    assert!(heard(&app).is_empty(), "{:?}", heard(&app));
}

#[test]
fn what_cannot_be_done_is_said_and_the_game_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = policy(folder.path(), metadata(), 2);
    let foreign = folder.path().join("foreign");
    std::fs::create_dir_all(&foreign).expect("writable");
    let of = |metadata: PolicyMetadata| TakeoverRequest::Policy(policy(&foreign, metadata, 2));
    let missing = folder.path().join("missing");
    for (request, words) in [
        (of(PolicyMetadata { game: "maze".into(), ..metadata() }), "for the game `maze`, not for `corridor`"),
        (TakeoverRequest::Replay(path.clone()), "not a recording"),
        (TakeoverRequest::Policy(missing.clone()), "missing"),
        (TakeoverRequest::Record(missing.join("ada.demo")), "cannot create the file"),
    ] {
        let (mut app, agent) = build(plugin(Some(request.clone())));
        frames(&mut app, 6);
        let [said] = heard(&app) else { panic!("{request}: {:?}", heard(&app)) };
        assert!(said.contains(words) && said.contains(&request.to_string()), "{said}");
        assert_eq!(app.world().get::<Control>(agent), Some(&Control::Human));
        assert!(!app.world().resource::<Takeover>().is_running());
    }
    let names = PolicyMetadata { observations: vec!["x".into(), "heat".into()], ..metadata() };
    let (mut app, _) = build(plugin(Some(of(names))));
    frames(&mut app, 6);
    assert!(heard(&app)[0].contains("number 1: `heat` there, `time` here"), "{:?}", heard(&app));
    let (mut app, _) = build(plugin(Some(of(PolicyMetadata { observations: vec!["x".into()], ..metadata() }))));
    frames(&mut app, 6);
    assert!(heard(&app)[0].contains("reads 2 observation values, but 1 are named"), "{:?}", heard(&app));
    let wrong = TakeoverPlugin { request: Some("rekord:x".parse()), ..plugin(None) };
    let (mut app, _) = build(wrong);
    frames(&mut app, 6);
    assert!(heard(&app)[0].contains("did you mean `record`?"), "{:?}", heard(&app));
}

/// A program that learns at once what lies in a file, and goes on until it is asked to stop.
#[cfg(unix)]
#[test]
fn what_was_learned_from_a_recording_takes_over_and_gives_back() {
    let folder = tempfile::tempdir().expect("a folder");
    let (recording, learned) = (folder.path().join("ada.demo"), policy(folder.path(), metadata(), 2));
    let news = format!(
        r#"{{"event":"policy","file":"{}","stage":"imitation","steps":0,"mean_return":null}}"#,
        learned.display()
    );
    let asked = folder.path().join("asked");
    let script = format!(
        "echo \"$*\" > '{}'; echo '{news}'; cat > /dev/null; echo '{{\"event\":\"stopped\"}}'",
        asked.display()
    );
    let program = ["sh", "-c", &script, "sh"].map(str::to_owned).to_vec();
    let teach = TeachOptions { program, ..TeachOptions::default() };
    let (mut app, agent) = build(TakeoverPlugin { teach, ..plugin(Some(TakeoverRequest::Record(recording.clone()))) });
    let words = |app: &App| app.world().resource::<Teaching>().words().unwrap_or_default().to_owned();
    press(&mut app, KeyCode::F10);
    assert!(words(&app).contains("nothing is recorded yet"), "{}", words(&app));
    press(&mut app, KeyCode::Tab);
    frames(&mut app, 8);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Human), "there is no policy yet");
    press(&mut app, KeyCode::F10);
    while app.world().resource::<Teaching>().learned().is_none() {
        app.update();
    }
    assert_eq!(words(&app), "learned by imitation");
    let asked = std::fs::read_to_string(&asked).expect("the program was asked");
    assert!(asked.starts_with("teach corridor ") && asked.contains(" --set train=plain:0..63"), "{asked}");
    press(&mut app, KeyCode::Tab);
    frames(&mut app, 3);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Policy));
    press(&mut app, KeyCode::Tab);
    frames(&mut app, 3);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Human));
    // The key records again, whatever took over in between.
    press_key(&mut app);
    frames(&mut app, 3);
    let takeover = app.world().resource::<Takeover>();
    assert_eq!((takeover.is_running(), takeover.request()), (true, &TakeoverRequest::Record(recording.clone())));
    press(&mut app, KeyCode::F10);
    while words(&app) != "stopped and saved" {
        app.update();
    }
    assert!(recorded(&recording).len() > 2);
    assert!(heard(&app).is_empty(), "{:?}", heard(&app));
}

/// Without a program nothing is learned, and the game goes on.
#[test]
fn a_game_without_a_program_says_what_is_missing() {
    let (mut app, agent) = build(plugin(None));
    frames(&mut app, 3);
    press(&mut app, KeyCode::F10);
    let words = app.world().resource::<Teaching>().words().map(str::to_owned);
    assert!(words.as_deref().is_some_and(|words| words.contains("PLAYBOT_TEACH")), "{words:?}");
    frames(&mut app, 3);
    assert_eq!(app.world().get::<Control>(agent), Some(&Control::Human));
    assert!(heard(&app).is_empty(), "{:?}", heard(&app));
}

/// Set for the child of the test below.
const FILE: &str = "PLAYBOT_TEST_FILE";

#[test]
fn the_environment_says_what_is_done() {
    if let Some(path) = std::env::var_os(FILE) {
        let (mut app, _) = build(TakeoverPlugin::new(corridor()));
        frames(&mut app, 10);
        assert_eq!(app.world().resource::<Takeover>().request(), &TakeoverRequest::Record(path.into()));
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ada.demo");
    let status = std::process::Command::new(std::env::current_exe().expect("a test program"))
        .args(["--exact", "takeover::the_environment_says_what_is_done"])
        .env("PLAYBOT", format!("record:{}", path.display()))
        .env("PLAYBOT_NAME", "ada")
        .env(FILE, &path)
        .output()
        .expect("starts");
    assert!(status.status.success(), "{}", String::from_utf8_lossy(&status.stdout));
    let reader = DemoReader::open(&path).expect("recorded");
    assert_eq!(reader.header().demonstrator, "ada");
    assert!(reader.count() > 1);
}

#[test]
fn no_takeover_where_a_caller_ticks_the_world() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("ada.demo");
    let (mut app, _) = build(plugin(Some(TakeoverRequest::Record(path.clone()))));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_millis(100)));
    app.ticks(20).expect("sound");
    assert!(!path.exists());
}
