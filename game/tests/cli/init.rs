//! Tests of `playbot init` on games in temporary folders.

use std::{fs, path::Path};

use bevy::prelude::*;
use playbot::Game;

use crate::program::{done, ended, lines, playbot};

/// The adapter that is written for [`LIBRARY`]. That it is compiled here shows that it compiles for users.
#[path = "../fixtures/init_adapter.rs"]
mod adapter;

/// The adapter that is written for [`FILES`].
#[path = "../fixtures/init_adapter_of_files.rs"]
mod adapter_of_files;

/// The adapter that is written for [`ROUNDS`].
#[path = "../fixtures/init_adapter_of_rounds.rs"]
mod adapter_of_rounds;

/// The component that the adapter observes.
#[derive(Component)]
pub struct Player;

/// The state that the adapter of rounds enters.
#[derive(States, Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Screen {
    /// Waits for a key.
    #[default]
    Menu,
    /// Plays a round.
    Playing,
}

/// The game of the adapter.
pub fn plugin(app: &mut App) {
    app.add_systems(Startup, |mut commands: Commands| {
        commands.spawn((Player, Transform::default()));
    });
}

const MANIFEST: &str = "[package]\nname = \"my-game\"\nedition = \"2024\"\n\n[dependencies]\nbevy = \"0.19\"\n";

const LIBRARY: &str = "\
#[derive(Component)]
pub struct Player;
#[derive(States)]
pub enum Screen { Menu, Playing }
pub fn plugin(app: &mut App) { app.add_systems(Update, walk); }
fn walk(keys: Res<ButtonInput<KeyCode>>) {
    let _ = [KeyCode::ArrowLeft, KeyCode::ArrowRight, KeyCode::Escape].map(|key| keys.pressed(key));
    let _ = rand::rng();
}
";

/// A game with files, tasks, assets in a folder of its own, and keys that leave and skip levels.
const FILES: &str = "\
#[derive(Component)]
pub struct Player;
pub fn plugin(app: &mut App) { app.add_systems(Update, (play, skip_level.run_if(input_just_pressed(KeyCode::KeyN)))); }
fn play(keys: Res<ButtonInput<KeyCode>>, assets: Res<AssetServer>) {
    if keys.just_pressed(KeyCode::ArrowLeft) { let _ = assets.load(\"a.png\"); }
    if keys.just_pressed(KeyCode::Escape) { exit.write(AppExit::Success); }
    if keys.just_pressed(KeyCode::Enter) && won { level.0 += 1; }
    if keys.pressed(KeyCode::Enter) { dash(); }
    if keys.pressed(KeyCode::F3) { show(); }
    for file in std::fs::read_dir(\"levels\") {}
}
pub fn defaults() -> AssetPlugin { AssetPlugin { file_path: \"art\".into(), ..default() } }
fn search() -> Task<Vec2> { AsyncComputeTaskPool::get().spawn(async { Vec2::X }) }
";

/// A game that spawns its player in a state, with two keys for each direction.
const ROUNDS: &str = "\
#[derive(Component)]
pub struct Player;
#[derive(States)]
pub enum Screen { Menu, Playing }
pub fn plugin(app: &mut App) {
    app.init_state::<Screen>()
        .add_systems(OnEnter(Screen::Playing), begin)
        .add_systems(OnExit(Screen::Playing), |mut commands: Commands, player: Single<Entity, With<Player>>| {
            commands.entity(*player).despawn();
        })
        .add_systems(Update, walk.run_if(in_state(Screen::Playing)));
}
fn begin(mut commands: Commands) { commands.spawn((Player, Transform::default())); }
fn walk(keys: Res<ButtonInput<KeyCode>>) {
    if keys.pressed(KeyCode::ArrowUp) || keys.pressed(KeyCode::KeyW) { up(); }
    if keys.any_pressed([KeyCode::KeyS, KeyCode::ArrowDown]) { down(); }
    if keys.pressed(KeyCode::Space) { jump(); }
}
";

const MAIN: &str = "\
use bevy::prelude::*;
mod rules;
fn main() {
    App::new()
        .add_plugins(DefaultPlugins)
        .run();
}
";

/// Writes files, with their folders.
fn write(folder: &Path, files: &[(&str, &str)]) {
    for (name, text) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, text).expect("writable");
    }
}

fn read(folder: &Path, name: &str) -> String {
    fs::read_to_string(folder.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

const WRITTEN: [&str; 4] = ["bots/Cargo.toml", "bots/src/lib.rs", "bots/src/main.rs", "bots/tests/levels.rs"];

#[test]
fn the_adapter_of_a_game_with_a_library_is_one_that_compiles() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("Cargo.toml", MANIFEST), ("src/lib.rs", LIBRARY)]);
    let (found, reported) = done(folder, &["init"]);
    assert_eq!(read(folder, "bots/src/lib.rs"), include_str!("../fixtures/init_adapter.rs"));
    assert_eq!(adapter::adapter().problem(), None);
    for line in [
        "game: my-game, Bevy 0.19",
        "functions of `&mut App`: plugin (src/lib.rs:5)",
        "states: Screen (src/lib.rs:4): Menu | Playing",
        "input: keyboard",
        "player: Player (src/lib.rs:2)",
        "random numbers without a seed: rand::rng() (src/lib.rs:8)",
        "to do: make it the same every time: docs/how-to/make-it-deterministic.md",
    ] {
        assert!(found.lines().any(|found| found == line), "{line}: {found}");
    }
    let manifest = read(folder, "bots/Cargo.toml");
    for line in ["bevy = { version = \"0.19\", default-features = false }", "my-game = { path = \"..\" }"] {
        assert!(manifest.lines().any(|found| found == line), "{line}: {manifest}");
    }
    assert!(
        manifest.contains("playbot = { path = \"") && manifest.ends_with("features = [\"window\"] }\n"),
        "{manifest}"
    );
    assert!(read(folder, "bots/src/main.rs").contains("playbot::main(&[&bots::adapter()])"));
    assert!(read(folder, "bots/tests/levels.rs").contains("playbot::test(&adapter())"));
    assert!(reported.contains("written: bots/tests/levels.rs") && reported.contains("--edit-workspace"), "{reported}");
    assert_eq!((read(folder, "Cargo.toml"), read(folder, "src/lib.rs")), (MANIFEST.to_owned(), LIBRARY.to_owned()));
}

#[test]
fn the_adapter_of_a_game_with_files_says_what_follows_from_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let shared = "[workspace]\nmembers = [\"game\"]\n";
    write(folder, &[("Cargo.toml", shared), ("game/Cargo.toml", MANIFEST), ("game/src/lib.rs", FILES)]);
    let (found, _) = done(folder, &["init"]);
    assert_eq!(read(folder, "bots/src/lib.rs"), include_str!("../fixtures/init_adapter_of_files.rs"));
    assert_eq!(adapter_of_files::adapter().problem(), None);
    for line in [
        "keys that leave or skip levels: KeyN (src/lib.rs:3), Escape (src/lib.rs:6), Enter (src/lib.rs:7)",
        "folder of assets: art (src/lib.rs:12)",
        "reads of files: read_dir( (src/lib.rs:10)",
        "tasks beside the frames: AsyncComputeTaskPool (src/lib.rs:13)",
        "to do: build the paths of files from env!(\"CARGO_MANIFEST_DIR\"), and sort the names of a folder",
    ] {
        assert!(found.lines().any(|found| found == line), "{line}: {found}");
    }
}

#[test]
fn the_adapter_of_a_game_with_rounds_enters_their_state_and_presses_one_key_of_two() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("Cargo.toml", MANIFEST), ("src/lib.rs", ROUNDS)]);
    let (found, _) = done(folder, &["init"]);
    assert_eq!(read(folder, "bots/src/lib.rs"), include_str!("../fixtures/init_adapter_of_rounds.rs"));
    assert_eq!(adapter_of_rounds::adapter().problem(), None);
    for line in [
        "state of a round: Screen::Playing (src/lib.rs:7)",
        "keys that mean the same: ArrowUp = KeyW, KeyS = ArrowDown",
    ] {
        assert!(found.lines().any(|found| found == line), "{line}: {found}");
    }
    // A state that the bots cannot name, and one that loads first.
    for (game, line) in [
        (ROUNDS.replace("pub enum", "enum"), "        // .restart(Restart::state(my_game::Screen::Playing))"),
        (ROUNDS.replace("Menu,", "Loading,"), "        .restart(Restart::Startup)"),
    ] {
        write(folder, &[("src/lib.rs", &game)]);
        let _ = fs::remove_dir_all(folder.join("bots"));
        let (printed, _) = done(folder, &["init", "--dry-run"]);
        let lines: Vec<_> = printed.lines().collect();
        assert!(lines.contains(&line) && lines.contains(&"        .restart(Restart::Startup)"), "{line}: {printed}");
    }
}

#[test]
fn what_is_written_names_no_line_of_the_game() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let loading =
        FILES.replace("pub struct Player;", "struct Player;\n#[derive(States)]\npub enum Screen { Loading, Playing }");
    let fixed = FILES.replace("Update, ", "FixedUpdate, ").replace("\"art\".into()", "folder()");
    for (name, game) in [
        ("src/lib.rs", LIBRARY),
        ("src/lib.rs", loading.as_str()),
        ("src/main.rs", ROUNDS),
        ("src/main.rs", fixed.as_str()),
    ] {
        let _ = fs::remove_dir_all(folder.join("src"));
        let _ = fs::remove_dir_all(folder.join("bots"));
        write(folder, &[("Cargo.toml", MANIFEST), (name, game)]);
        done(folder, &["init"]);
        for written in WRITTEN {
            let text = read(folder, written);
            assert!(!text.contains(".rs:"), "{written} of {game}: {text}");
        }
    }
}

#[test]
fn the_adapter_of_a_game_in_fixed_steps_has_a_frame_for_each() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let game = LIBRARY.replace("app.add_systems(Update, walk);", "app.add_systems(FixedUpdate, walk)CLOCK;");
    for (clock, line, words) in [
        ("", "        .hz(64.0)", "64 a second, which is Bevy's default"),
        (".insert_resource(Time::<Fixed>::from_hz(50.0))", "        .hz(50.0)", "50 a second (src/lib.rs:5)"),
        (
            ".insert_resource(Time::<Fixed>::from_hz(RATE))",
            "        // twice: .hz(steps of a second), as the game sets them in `plugin`.",
            "a number of them a second that is computed (src/lib.rs:5)",
        ),
    ] {
        write(folder, &[("Cargo.toml", MANIFEST), ("src/lib.rs", &game.replace("CLOCK", clock))]);
        let (printed, _) = done(folder, &["init", "--dry-run"]);
        let found = format!("fixed steps: FixedUpdate (src/lib.rs:5), {words}");
        for line in [line, &found] {
            assert!(printed.lines().any(|printed| printed == line), "{line}: {printed}");
        }
    }
    write(folder, &[("src/lib.rs", LIBRARY)]);
    let (printed, _) = done(folder, &["init", "--dry-run"]);
    let missing = printed.lines().find_map(|line| line.strip_prefix("none found: ")).expect("a line of all of them");
    assert!(missing.split(", ").any(|what| what == "fixed steps") && !printed.contains(".hz("), "{printed}");
    assert!(missing.split(", ").any(|what| what == "folder of assets"), "{printed}");
    assert_eq!(printed.matches("none found").count(), 1, "{printed}");
    fs::create_dir(folder.join("assets")).expect("writable");
    let (printed, _) = done(folder, &["init", "--dry-run"]);
    assert!(printed.contains("\nfolder of assets: assets\n"), "{printed}");
}

#[test]
fn the_adapter_adds_what_the_program_adds_and_waits_for_a_state_that_loads() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let hero = "pub struct HeroPlugin;\nimpl Plugin for HeroPlugin { fn build(&self, _: &mut App) {} }\n";
    let library = "pub mod actors;\npub mod menu;\n#[derive(States)]\npub enum Screen { Loading, Playing }\n";
    let menu = "const ITEMS: [&str; 2] = [\"Play\", \"Quit\"];\npub fn plugin(app: &mut App) {}\n\
        fn menu() {\n    for label in ITEMS { spawn(button(label)); }\n}\n\
        fn button(label: &str) -> impl Bundle { (Button, children![Text::new(label)]) }\n\
        fn press(query: Query<&Interaction>) {}\n";
    let program = |added: &str| format!("fn main() {{ App::new().add_plugins((DefaultPlugins, {added})).run(); }}\n");
    write(
        folder,
        &[
            ("Cargo.toml", MANIFEST),
            ("src/lib.rs", library),
            ("src/actors.rs", "pub mod hero;\n"),
            ("src/actors/hero.rs", hero),
            ("src/menu.rs", menu),
        ],
    );
    for (added, game) in [
        ("my_game::menu::plugin", "ForeignGame::new(\"my-game\", 1, my_game::menu::plugin)"),
        ("my_game::actors::hero::HeroPlugin", "        app.add_plugins(my_game::actors::hero::HeroPlugin);"),
        (
            "my_game::actors::hero::HeroPlugin, my_game::menu::plugin",
            "        app.add_plugins((my_game::actors::hero::HeroPlugin, my_game::menu::plugin));",
        ),
    ] {
        write(folder, &[("src/main.rs", &program(added))]);
        let (printed, _) = done(folder, &["init", "--dry-run"]);
        for line in [
            game,
            "        .clicks([\"Play\", \"Quit\"])",
            "        // TODO: if a level is ready once the game has left `Screen::Loading`, set that state in `.level`, and wait for",
            "        // .ready(|state: Res<State<my_game::Screen>>| **state != my_game::Screen::Loading)",
        ] {
            assert!(printed.lines().any(|printed| printed.trim() == line.trim()), "{line}: {printed}");
        }
    }
    let (printed, _) = done(folder, &["init", "--dry-run"]);
    let row = "added by src/main.rs: HeroPlugin (src/actors/hero.rs:2), plugin (src/menu.rs:2)";
    assert!(printed.lines().any(|printed| printed == row), "{printed}");
}

#[test]
fn a_second_run_leaves_all_files_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("Cargo.toml", MANIFEST), ("src/lib.rs", LIBRARY), ("bots/src/lib.rs", "// Mine.\n")]);
    let (_, first) = done(folder, &["init", "--edit-workspace"]);
    assert!(first.contains("left alone: bots/src/lib.rs exists already"), "{first}");
    assert!(first.contains("written: bots/Cargo.toml"), "{first}");
    assert_eq!(read(folder, "bots/src/lib.rs"), "// Mine.\n");
    assert_eq!(read(folder, "Cargo.toml"), format!("{MANIFEST}\n[workspace]\nmembers = [\"bots\"]\n"));
    let before = [&["Cargo.toml"][..], &WRITTEN].concat().into_iter().map(|name| (name, read(folder, name)));
    let before: Vec<_> = before.collect();
    let (_, second) = done(folder, &["init", "--edit-workspace"]);
    assert!(!second.contains("written: ") && !second.contains("[workspace]"), "{second}");
    for (name, text) in before {
        assert_eq!(read(folder, name), text, "{name}");
    }
}

#[test]
fn a_workspace_without_a_profile_of_crates_gets_the_place_of_one_that_builds_faster() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("Cargo.toml", MANIFEST), ("src/lib.rs", LIBRARY)]);
    let (_, reported) = done(folder, &["init", "--dry-run"]);
    let begin = "to build the bots faster, copy [profile.release] and [profile.release.package] from ";
    let named = reported.lines().find_map(|line| line.strip_prefix(begin)?.split(" to ").next());
    let named = named.unwrap_or_else(|| panic!("{reported}"));
    let profile = fs::read_to_string(named).unwrap_or_else(|error| panic!("{named}: {error}"));
    for table in ["\n[profile.release]\n", "\n[profile.release.package]\n"] {
        assert!(profile.contains(table), "{named} has no {table}");
    }
    assert!(reported.contains("  add `my-game = { opt-level = 3 }` to the second table, "), "{reported}");
    let (_, reported) = done(folder, &["init", "--dry-run", "--playbot", "https://example.org/playbot"]);
    assert!(reported.contains(&format!("{begin}Cargo.toml in https://example.org/playbot to ")), "{reported}");
    let tuned = format!("{MANIFEST}\n[profile.release.package]\nbevy_ecs = {{ opt-level = 3 }}\n");
    write(folder, &[("Cargo.toml", &tuned)]);
    assert!(!done(folder, &["init", "--dry-run"]).1.contains("to build the bots faster"));
}

#[test]
fn a_game_in_its_main_alone_gets_a_library_and_the_lines_to_move() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("Cargo.toml", MANIFEST), ("src/main.rs", MAIN)]);
    let (found, reported) = done(folder, &["init"]);
    assert!(found.contains("library: none\n"), "{found}");
    assert!(read(folder, "src/lib.rs").contains("pub fn plugin(app: &mut App) {"));
    assert!(read(folder, "bots/src/lib.rs").contains("ForeignGame::new(\"my-game\", 1, my_game::plugin)\n"));
    let moves = [
        "to do: move the game from src/main.rs to src/lib.rs:",
        "  lines 4 to 6, all but `DefaultPlugins` and `run`, into `plugin`",
        "  line 2, `mod rules;`, as `pub mod rules;`",
    ];
    let names_all = |reported: &str| {
        for line in moves {
            assert!(reported.lines().any(|reported| reported == line), "{line}: {reported}");
        }
    };
    names_all(&reported);
    assert_eq!(read(folder, "src/main.rs"), MAIN);

    // Nothing has been moved yet: the library is still the one that was written.
    let (found, reported) = done(folder, &["init", "--edit-workspace"]);
    assert!(
        found.contains("library: src/lib.rs, which is still empty\n") && !found.contains("App`: plugin"),
        "{found}"
    );
    assert!(reported.contains("left alone: src/lib.rs exists already"), "{reported}");
    names_all(&reported);
    // A comment is no game.
    let stub = read(folder, "src/lib.rs");
    write(folder, &[("src/lib.rs", &stub.replace("// TODO: move", "// I shall move"))]);
    names_all(&done(folder, &["init"]).1);
    write(folder, &[("src/lib.rs", &stub.replace("let _ = app;", "app.add_systems(Update, walk);"))]);
    let (found, reported) = done(folder, &["init"]);
    assert!(found.contains("library: src/lib.rs\n") && found.contains("App`: plugin (src/lib.rs:6)\n"), "{found}");
    assert!(!reported.contains("to do: move"), "{reported}");
}

#[test]
fn the_game_of_a_workspace_gets_the_bots_beside_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let shared = "[workspace]\nmembers = [\"crates/*\"]\n[workspace.dependencies]\nbevy = \"0.19.1\"\n";
    let inherited = MANIFEST.replace("bevy = \"0.19\"", "bevy.workspace = true");
    let tools = "[package]\nname = \"tools\"\n";
    write(
        folder,
        &[("Cargo.toml", shared), ("crates/game/Cargo.toml", &inherited), ("crates/game/src/lib.rs", LIBRARY)],
    );
    write(folder, &[("crates/tools/Cargo.toml", tools)]);
    let (found, reported) = done(folder, &["init"]);
    assert!(found.starts_with("game: my-game, Bevy 0.19.1\n"), "{found}");
    assert!(read(folder, "bots/Cargo.toml").contains("\nmy-game = { path = \"../crates/game\" }\n"));
    assert!(reported.contains("add \"bots\" to `members` of [workspace] in "), "{reported}");
    let (_, refused) = ended(&folder.join("crates/game"), &["init"], 3);
    assert!(refused.contains("is a member of the workspace in ") && refused.contains("--package NAME"), "{refused}");
}

#[test]
fn the_path_of_a_manifest_names_its_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("game/Cargo.toml", MANIFEST), ("game/src/lib.rs", LIBRARY)]);
    let by_folder = done(folder, &["init", "game", "--dry-run"]).0;
    assert_eq!(done(folder, &["init", "game/Cargo.toml", "--dry-run"]).0, by_folder);
    assert_eq!(done(&folder.join("game"), &["init", "Cargo.toml", "--dry-run"]).0, by_folder);
}

#[test]
fn a_dry_run_prints_the_files_and_writes_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("Cargo.toml", MANIFEST), ("src/lib.rs", LIBRARY)]);
    let (printed, _) = done(folder, &["init", "--dry-run", "--edit-workspace"]);
    assert!(printed.contains("\n--- bots/src/lib.rs\n//! The adapter of `my-game`"), "{printed}");
    let (printed, _) = done(folder, &["init", "--dry-run", "--json", "--playbot", "https://example.org/playbot"]);
    assert_eq!(printed.lines().count(), 1, "{printed}");
    let json = &lines(&playbot(folder, &["init", "--dry-run", "--json"]))[0];
    assert_eq!(json["package"], "my-game");
    assert_eq!(json["bevy"], "0.19");
    assert_eq!(json["found"]["keys"], serde_json::json!(["ArrowLeft", "ArrowRight", "Escape"]));
    assert_eq!(json["found"]["unseeded"][0]["line"], 8);
    assert_eq!(json["written"], serde_json::json!(WRITTEN));
    assert!(!folder.join("bots").exists());
    assert_eq!(read(folder, "Cargo.toml"), MANIFEST);
}

#[test]
fn a_folder_without_a_game_for_this_bevy_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let older = MANIFEST.replace("0.19", "0.18");
    write(folder, &[("older/Cargo.toml", &older), ("plain/Cargo.toml", "[package]\nname = \"plain\"\n")]);
    write(folder, &[("two/Cargo.toml", "[workspace]\nmembers = [\"a\", \"b\"]\n")]);
    write(folder, &[("two/a/Cargo.toml", MANIFEST), ("two/b/Cargo.toml", &MANIFEST.replace("my-game", "other"))]);
    for (args, words) in [
        (&["init", "none/Cargo.toml"][..], "none/Cargo.toml does not exist: call"),
        (&["init", "none"], "none/Cargo.toml does not exist: call `playbot init` in the folder of a Bevy game"),
        (&["init", "plain"], "plain/Cargo.toml does not depend on `bevy`: playbot tests games"),
        (
            &["init", "older"],
            "older/Cargo.toml has Bevy 0.18, and this playbot is for Bevy 0.19: update the game first",
        ),
        (&["init", "two"], "use Bevy: name the game with --package; valid: my-game, other"),
        (&["init", "two", "--package", "c"], "has no package `c`; valid: my-game, other"),
        (&["init", "two", "--package", "other", "--playbot", "none"], "with --playbot"),
    ] {
        let (_, refused) = ended(folder, args, 3);
        assert!(refused.contains(words), "{args:?}: {refused}");
    }
    assert!(!folder.join("two/bots").exists() && !folder.join("plain/bots").exists());
}

#[test]
fn a_file_in_the_way_of_the_bots_is_an_error_of_writing() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    write(folder, &[("Cargo.toml", MANIFEST), ("src/lib.rs", LIBRARY), ("bots", "in the way")]);
    let (_, refused) = ended(folder, &["init"], 2);
    assert!(refused.contains("cannot create ") && refused.contains("bots"), "{refused}");
    assert_eq!(read(folder, "bots"), "in the way");
}
