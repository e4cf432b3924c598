//! `playbot init`.
//!
//! In the folder:
//!
//! - `folder`: the folder of a game, with its `Cargo.toml` and its sources.
//! - `found`: facts about a game that its sources show.

mod folder;
mod found;

use crate::{
    error::{CliError, Outcome},
    output::{print_line, write},
    verbs::init::{
        folder::{BEVY, GameFolder, SourceLine, SourceText, folder_of, has_member, read_sources, unreadable},
        found::{AssetFolder, GameFacts, NamedItem, RoundState, StepRate},
    },
};
use serde_json::json;
use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

/// Keys that leave games or open tools, more often than they play.
const TOOL_KEYS: [&str; 14] =
    ["Escape", "F1", "F2", "F3", "F4", "F5", "F6", "F7", "F8", "F9", "F10", "F11", "F12", "PrintScreen"];

/// Write the crate of the bots beside a Bevy game: its adapter, its program and its tests.
///
/// The game's Cargo.toml and sources are read as text, and nothing is built. The adapter presses the keys that the
/// sources name, and its comments say what is left to do. Existing files are left alone. The game that ships does not
/// depend on the bots.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot init --dry-run   what is found, and what would be written
  playbot init
  playbot init --edit-workspace   also append `bots` to Cargo.toml as a member
  playbot init my_workspace --package my_game")]
pub struct Args {
    /// Folder of the game, or of its workspace, or the Cargo.toml there.
    #[arg(value_name = "FOLDER", default_value = ".")]
    folder: PathBuf,
    /// Package of the game, if several of a workspace use Bevy.
    #[arg(long, value_name = "NAME")]
    package: Option<String>,
    /// Source of the crate `playbot`: a clone of its repository, or a URL of git (default: the clone from which this
    /// program was built).
    #[arg(long, value_name = "SOURCE")]
    playbot: Option<String>,
    /// Append a table `[workspace]` with the member `bots` to Cargo.toml, if it has no such table.
    #[arg(long)]
    edit_workspace: bool,
    /// Print the files instead of writing them.
    #[arg(long)]
    dry_run: bool,
    /// Print one line of JSON instead of text.
    #[arg(long)]
    json: bool,
}

/// Writes the files that are missing, and reports what was found.
pub(crate) fn run(args: &Args) -> Result<Outcome, CliError> {
    let game = GameFolder::find(folder_of(&args.folder), args.package.as_deref())?;
    let mut sources = read_sources(&game.root.join(&game.package))?;
    // The library of an earlier call, in which nothing has been written since, is none yet.
    let (library, all) = (game.library_file(), sources.len());
    sources.retain(|source| source.path != library || !is_stub(source));
    let has_stub = sources.len() < all;
    let facts = GameFacts::read(&game.manifest, &game.library_file(), &sources);
    let source = PlaybotSource::of(args.playbot.as_deref())?;
    let files = game.files(&facts, &source.dependency);
    let (missing, kept): (Vec<_>, Vec<_>) = files.into_iter().partition(|(path, _)| !game.root.join(path).exists());
    let moves = if facts.has_library { Vec::new() } else { moves(&sources) };
    let should_edit = args.edit_workspace && !game.root_manifest.is_workspace;
    if args.json {
        let names = |files: &[(String, String)]| files.iter().map(|(path, _)| path.clone()).collect::<Vec<_>>();
        print_line(json!({
            "package": game.name(),
            "bevy": game.bevy.version,
            "bevy_features": game.bevy.features,
            "found": facts,
            "to_move": moves,
            "dry_run": args.dry_run,
            "written": names(&missing),
            "kept": names(&kept),
            "edits_workspace": should_edit,
        }))?;
    } else {
        for line in game.description(&facts, has_stub) {
            print_line(line)?;
        }
    }
    if args.dry_run {
        for (path, text) in missing.iter().filter(|_| !args.json) {
            print_line(format!("\n--- {path}\n{}", text.trim_end()))?;
        }
    } else {
        for (path, text) in &missing {
            write(&game.root.join(path), text.as_bytes())?;
            report!("written: {path}");
        }
    }
    for (path, _) in &kept {
        report!("left alone: {path} exists already");
    }
    moves.iter().for_each(|line| report!("{line}"));
    game.report_workspace(should_edit, args.dry_run)?;
    game.report_profile(&source);
    if !args.dry_run {
        report!("next: fill in what bots/src/lib.rs marks with TODO, then run `cargo test --release` in bots");
    }
    Ok(Outcome::Pass)
}

impl GameFolder {
    /// Returns the files of the layout, with their paths below the root.
    fn files(&self, facts: &GameFacts, playbot: &str) -> Vec<(String, String)> {
        let mut files = Vec::new();
        if !facts.has_library {
            let folder = if self.package.is_empty() { String::new() } else { format!("{}/", self.package) };
            files.push((format!("{folder}{}", self.library_file()), LIBRARY.to_owned()));
        }
        files.push(("bots/Cargo.toml".to_owned(), self.bots_manifest(facts, playbot)));
        files.push(("bots/src/lib.rs".to_owned(), adapter(self.name(), &self.library(), &self.package, facts)));
        files.push(("bots/src/main.rs".to_owned(), PROGRAM.to_owned()));
        files.push(("bots/tests/levels.rs".to_owned(), TESTS.to_owned()));
        files
    }

    fn bots_manifest(&self, facts: &GameFacts, playbot: &str) -> String {
        let folder = if self.package.is_empty() { String::new() } else { format!("/{}", self.package) };
        let features = if has_clicks(facts) { r#""ui", "window""# } else { r#""window""# };
        format!(
            "[package]\nname = \"bots\"\nversion = \"0.1.0\"\nedition = \"2024\"\npublish = false\n\n[dependencies]\n\
             bevy = {{ version = \"{}.{}\", default-features = false }}\n{} = {{ path = \"..{folder}\" }}\n\
             playbot = {{ {playbot}, features = [{features}] }}\n",
            BEVY.0,
            BEVY.1,
            self.name()
        )
    }

    /// Returns lines for people about all that was found.
    fn description(&self, facts: &GameFacts, has_stub: bool) -> Vec<String> {
        // Empty where nothing was found.
        let at = |lines: &[SourceLine]| {
            let found = lines.iter().map(|found| format!("{} ({}:{})", found.name, found.file, found.line));
            found.collect::<Vec<_>>().join(", ")
        };
        let items = |items: &[NamedItem]| at(&items.iter().map(|item| item.at.clone()).collect::<Vec<_>>());
        let states = facts.states.iter().map(|state| {
            format!("{} ({}:{}): {}", state.at.name, state.at.file, state.at.line, state.variants.join(" | "))
        });
        let round = facts
            .round
            .as_ref()
            .map(|RoundState { at, state, .. }| format!("{state}::{} ({}:{})", at.name, at.file, at.line));
        let folder = facts.asset_folder.as_ref().map(|folder| {
            format!("{} ({}:{})", folder.path.as_deref().unwrap_or("computed"), folder.at.file, folder.at.line)
        });
        let version = self.bevy.version.as_deref().unwrap_or("without a number");
        let library = match (facts.has_library, has_stub) {
            (true, _) => self.library_file(),
            (false, true) => format!("{}, which is still empty", self.library_file()),
            (false, false) => "none".to_owned(),
        };
        let has_assets = self.root.join(&self.package).join("assets").is_dir();
        let assets = if has_assets { "assets".to_owned() } else { String::new() };
        let mut rows = vec![
            ("game", format!("{}, Bevy {version}", self.name())),
            ("features of Bevy", self.bevy.features.join(", ")),
            ("library", library),
            ("functions of `&mut App`", items(&facts.functions)),
            ("plugins", items(&facts.plugins)),
            ("added by src/main.rs", items(&facts.added)),
            ("states", states.collect::<Vec<_>>().join(", ")),
            ("state of a round", round.unwrap_or_default()),
            ("input", facts.inputs.join(", ")),
            ("keys", facts.keys.join(", ")),
            (
                "keys that mean the same",
                facts.aliases.iter().map(|same| same.join(" = ")).collect::<Vec<_>>().join(", "),
            ),
            ("keys that leave or skip levels", at(&facts.leaving_keys)),
            ("presses that count once", at(&facts.presses)),
            ("fixed steps", fixed_steps(facts).unwrap_or_default()),
            ("mouse buttons", facts.mouse_buttons.join(", ")),
            ("buttons", facts.buttons.join(", ")),
            ("player", items(facts.player.as_slice())),
            ("physics", facts.physics.join(", ")),
            ("loading", facts.loaders.join(", ")),
            ("loads of assets", at(&facts.loads)),
            ("folder of assets", folder.unwrap_or(assets)),
            ("reads of files", at(&facts.files)),
            ("tasks beside the frames", at(&facts.tasks)),
            ("random numbers with a seed", at(&facts.seeded)),
            ("random numbers without a seed", at(&facts.unseeded)),
            ("clocks of the machine", at(&facts.clocks)),
        ];
        let missing: Vec<&str> = rows.iter().filter(|(_, found)| found.is_empty()).map(|(what, _)| *what).collect();
        let missing = missing.join(", ");
        rows.retain(|(_, found)| !found.is_empty());
        if !missing.is_empty() {
            rows.push(("none found", missing));
        }
        if !facts.unseeded.is_empty() || !facts.clocks.is_empty() {
            rows.push(("to do", "make it the same every time: docs/how-to/make-it-deterministic.md".to_owned()));
        }
        if !facts.files.is_empty() {
            let advice = "build the paths of files from env!(\"CARGO_MANIFEST_DIR\"), and sort the names of a folder";
            rows.push(("to do", advice.to_owned()));
        }
        rows.into_iter().map(|(what, found)| format!("{what}: {found}")).collect()
    }

    /// Makes `bots` a member of the workspace, or reports what to write for it.
    fn report_workspace(&self, should_edit: bool, is_dry: bool) -> Result<(), CliError> {
        let file = self.root.join("Cargo.toml");
        if should_edit {
            if !is_dry {
                let text = fs::read_to_string(&file).map_err(|error| unreadable(&file, &error))?;
                write(&file, format!("{}\n\n{WORKSPACE}", text.trim_end()).as_bytes())?;
            }
            let done = if is_dry { "would be appended" } else { "appended" };
            report!("{done} to {}: [workspace] with the member `bots`", file.display());
        } else if !self.root_manifest.is_workspace {
            report!(
                "to build the bots into the same folder as the game, add these lines to {} or call `playbot init \
                 --edit-workspace`:\n{}",
                file.display(),
                WORKSPACE.trim_end()
            );
        } else if !has_member(&self.root_manifest.members, "bots") {
            report!("add \"bots\" to `members` of [workspace] in {}", file.display());
        }
        Ok(())
    }

    /// Reports which settings make builds of the bots faster, unless the workspace has some.
    fn report_profile(&self, source: &PlaybotSource) {
        if !self.root_manifest.tunes_crates {
            report!(
                "to build the bots faster, copy [profile.release] and [profile.release.package] from {} to {}:\n  \
                 Cargo takes no profile from a dependency, and optimises all of Bevy and burn without one\n  \
                 add `{} = {{ opt-level = 3 }}` to the second table, because both hold for the game that ships, too\n  \
                 to leave that game as it is, give them another name: docs/how-to/adapt-your-game.md#build-times",
                source.profile,
                self.root.join("Cargo.toml").display(),
                self.name()
            );
        }
    }
}

/// The lines that make the bots a member.
const WORKSPACE: &str = "[workspace]\nmembers = [\"bots\"]\n";

/// The library of a game that has none yet.
const LIBRARY: &str = "\
//! The game: all but `DefaultPlugins`.

use bevy::prelude::*;

/// Adds the game to an app.
pub fn plugin(app: &mut App) {
    // TODO: move here what `main` adds to the app, but for `DefaultPlugins`.
    let _ = app;
}
";

/// The program of the bots.
const PROGRAM: &str = "\
//! The game with every verb of playbot.

use std::process::ExitCode;

fn main() -> ExitCode {
    playbot::main(&[&bots::adapter()])
}
";

/// The tests of the bots.
const TESTS: &str = "\
//! Assertions about the levels of the game.

use bots::adapter;

#[test]
fn the_game_plays_the_same_again() {
    playbot::test(&adapter()).levels(\"default:0\").assert_deterministic();
}

#[test]
fn nothing_is_found_on_any_level() {
    playbot::test(&adapter()).levels(\"default:0\").assert_no_findings();
}

// TODO: assert that levels can be finished, once the adapter has `.end` and a `.demonstrator`:
//
// #[test]
// fn every_level_can_be_finished() {
//     playbot::test(&adapter()).levels(\"default:0\").assert_levels_solvable();
// }
";

/// Returns true if the adapter clicks on buttons, for which playbot needs its feature `ui`.
fn has_clicks(facts: &GameFacts) -> bool {
    !facts.buttons.is_empty()
}

/// Returns the source of an adapter. `package` is the folder of the game within the workspace, empty if it is the same.
fn adapter(name: &str, library: &str, package: &str, facts: &GameFacts) -> String {
    let path = |items: &[NamedItem]| items.first().and_then(|item| item.path.clone());
    let mut own = String::new();
    let added: Vec<String> = facts.added.iter().filter_map(|item| item.path.clone()).collect();
    let game = match (path(&facts.functions), path(&facts.plugins)) {
        _ if added.len() > 1 || added.len() == 1 && facts.plugins.contains(&facts.added[0]) => {
            let added: Vec<String> = added.iter().map(|path| format!("{library}::{path}")).collect();
            let list = if added.len() > 1 { format!("({})", added.join(", ")) } else { added.join(", ") };
            format!("|app: &mut App| {{\n        app.add_plugins({list});\n    }}")
        }
        _ if added.len() == 1 => format!("{library}::{}", added[0]),
        (Some(path), _) => format!("{library}::{path}"),
        (None, Some(path)) => {
            format!("|app: &mut App| {{\n        app.add_plugins({library}::{path});\n    }}")
        }
        (None, None) if !facts.has_library => format!("{library}::plugin"),
        (None, None) => {
            own = "\n/// Adds the game to an app.\nfn plugin(app: &mut App) {\n    \
                   // TODO: write this function into the game's library, make it public, and name it above.\n    \
                   let _ = app;\n}\n"
                .to_owned();
            "plugin".to_owned()
        }
    };
    let mut text = format!(
        "//! The adapter of `{name}`: what bots press and see, and when an episode ends.\n\n\
         use bevy::prelude::*;\nuse playbot::prelude::*;\n\n\
         /// Returns the game for testers and bots.\npub fn adapter() -> ForeignGame {{\n    \
         ForeignGame::new(\"{name}\", 1, {game})\n"
    );
    add_frames(&mut text, facts);
    add_assets(&mut text, package, facts);
    add_input(&mut text, facts);
    add_sight(&mut text, library, facts);
    text.push_str(
        "        // TODO: the reward, such as the growth of a score:\n        \
         // .reward_delta(|score: Res<Score>| score.0 as f32)\n        \
         // TODO: the end of an episode, without which no level is ever solved:\n        \
         // .end(|score: Res<Score>| (score.0 >= 10).then_some(EpisodeEnd::WON))\n        \
         .time_limit(600)\n",
    );
    add_restart(&mut text, library, facts);
    if let Some((state, variant)) = facts.loading_state() {
        let name = &state.at.name;
        let path = state.path.as_ref().map_or_else(|| name.clone(), |path| format!("{library}::{path}"));
        let _ = write!(
            text,
            "        // TODO: if a level is ready once the game has left `{name}::{variant}`, set that state in `.level`, and wait for\n        \
             // its end:\n        \
             // .ready(|state: Res<State<{path}>>| **state != {path}::{variant})\n"
        );
    } else if !facts.loads.is_empty() || !facts.loaders.is_empty() {
        text.push_str("        // TODO: if a level loads while the game runs, when it is ready: .ready(condition)\n");
    }
    if !facts.tasks.is_empty() {
        text.push_str(
            "        // Each frame waits for the tasks of the game, so that they take as many frames on every machine.\n        \
             .wait_for_tasks()\n",
        );
    }
    if let Some(at) = facts.files.first() {
        let place = at.place(facts.has_library);
        let _ = write!(
            text,
            "        // TODO: the game reads files{place} while it runs. Build their paths in the game from\n        \
             // `env!(\"CARGO_MANIFEST_DIR\")`, because programs and tests of `bots` start in other folders. Sort the\n        \
             // names of a folder, which have no order. If each file is a level, `.levels` takes their number, and\n        \
             // `.level` begins the file of that number.\n"
        );
    }
    text.push_str(
        "        // TODO: the number of levels, and a system that begins level `level.0` or seeds its generator.\n        \
         .levels(1)\n        .level(|_level: Res<LevelSeed>| {})\n}\n",
    );
    text + &own
}

/// Adds the restart: by the state that begins a round, or by the systems of the start. A game that loads in a state of its
/// own may not be played before that, so its restart begins there.
fn add_restart(text: &mut String, library: &str, facts: &GameFacts) {
    let round = facts.round.as_ref().filter(|_| facts.loading_state().is_none());
    if let Some(RoundState { at: SourceLine { name: variant, .. }, state, path }) = round {
        let of = path.as_ref().unwrap_or(state);
        let restart = format!(".restart(Restart::state({library}::{of}::{variant}))");
        let _ = match path {
            Some(_) => writeln!(
                text,
                "        // The game spawns a round whenever it enters `{state}::{variant}`, so each episode enters this state again."
            ),
            None => write!(
                text,
                "        // TODO: the game spawns a round whenever it enters `{state}::{variant}`. Make `{state}` public in the game's\n        \
                 // library, so that each episode can enter this state again, and write instead of `Restart::Startup`:\n        \
                 // {restart}\n"
            ),
        };
        let restart = if path.is_some() { restart.as_str() } else { ".restart(Restart::Startup)" };
        let _ = write!(
            text,
            "        // TODO: reset what stays in resources, such as a score, in `.level`, which runs after that. If the round depends\n        \
             // on the level or on random numbers, `Restart::Startup` is right, and `.level` sets the state by `NextState`.\n        \
             {restart}\n"
        );
        return;
    }
    if let Some(state) = facts.states.first() {
        let (name, variants) = (&state.at.name, state.variants.join(", "));
        let _ = writeln!(
            text,
            "        // TODO: if a state begins the game, set it in `.level`, which runs last: one of {variants} of `{name}`."
        );
    }
    text.push_str("        .restart(Restart::Startup)\n");
}

/// Steps of a second in Bevy, if a game sets none.
const DEFAULT_STEPS: f64 = 64.0;

/// Returns the schedule of fixed steps that a game uses, and how many of them are a second, in words.
fn fixed_steps(facts: &GameFacts) -> Option<String> {
    let SourceLine { name, file, line, .. } = facts.fixed.as_ref()?;
    let of_second = |hz: f64| format!("{hz} a second");
    let rate = facts.step_rate.as_ref().map_or_else(
        || format!("{}, which is Bevy's default", of_second(DEFAULT_STEPS)),
        |StepRate { at, hz }| {
            let count = hz.map_or("a number of them a second that is computed".to_owned(), of_second);
            format!("{count} ({}:{})", at.file, at.line)
        },
    );
    Some(format!("{name} ({file}:{line}), {rate}"))
}

/// Adds the frames of a second, for a game that plays in fixed steps. Where a frame has two steps, a press counts twice.
fn add_frames(text: &mut String, facts: &GameFacts) {
    let Some(SourceLine { name, .. }) = &facts.fixed else { return };
    let _ = match facts.step_rate.as_ref().map_or(Ok(DEFAULT_STEPS), |rate| rate.hz.ok_or(&rate.at)) {
        Ok(hz) => write!(
            text,
            "        // A frame for each fixed step of the game: in a frame of two steps, `{name}` would see a press twice.\n        \
             .hz({hz:?})\n"
        ),
        Err(rate) => write!(
            text,
            "        // TODO: a frame for each fixed step of the game, because in a frame of two steps `{name}` sees a press\n        \
             // twice: .hz(steps of a second), as the game sets them{}.\n",
            rate.place(facts.has_library)
        ),
    };
}

/// Adds the folder of assets. Bevy looks for `assets` in the package of the program, which is that of the bots.
fn add_assets(text: &mut String, package: &str, facts: &GameFacts) {
    let own = facts.asset_folder.as_ref();
    if own.is_none() && facts.loads.is_empty() && facts.loaders.is_empty() {
        return;
    }
    let _ = match own {
        None => writeln!(text, "        // The assets of the game, as the bots find them."),
        Some(AssetFolder { at, path }) => {
            let (todo, place) = (if path.is_some() { "The" } else { "TODO: the" }, at.place(facts.has_library));
            writeln!(text, "        // {todo} folder of assets that the game sets{place}, as the bots find it.")
        }
    };
    let inner = own.and_then(|folder| folder.path.as_deref()).unwrap_or("assets");
    let path = match Path::new(inner).is_absolute() {
        true => format!("{inner:?}"),
        false => {
            let folders: Vec<&str> = ["..", package, inner].into_iter().filter(|part| !part.is_empty()).collect();
            format!("concat!(env!(\"CARGO_MANIFEST_DIR\"), {:?})", format!("/{}", folders.join("/")))
        }
    };
    let _ = write!(
        text,
        "        .default_plugins(|plugins| {{\n            let file_path = {path}.to_owned();\n            \
         plugins.set(bevy::asset::AssetPlugin {{ file_path, ..default() }})\n        }})\n"
    );
}

/// Adds the actions.
fn add_input(text: &mut String, facts: &GameFacts) {
    let (leaving, playing): (Vec<&str>, Vec<&str>) =
        facts.keys.iter().map(String::as_str).partition(|key| facts.only_leaves(key));
    let (tools, keys): (Vec<&str>, Vec<&str>) = playing.into_iter().partition(|key| TOOL_KEYS.contains(key));
    let place = |key: &str| facts.leaving_keys.iter().find(|at| at.name == key);
    let at = |key: &str| place(key).map_or(String::new(), |at| format!("{key}{}", at.place(facts.has_library)));
    if !leaving.is_empty() {
        let places: Vec<String> = leaving.into_iter().map(at).collect();
        let _ = writeln!(text, "        // Left out, because they leave or skip levels: {}.", places.join(", "));
    }
    for key in keys.iter().filter(|key| place(key).is_some()) {
        let _ = writeln!(text, "        // TODO: {} also leaves or skips levels: leave it out if it can.", at(key));
    }
    if !tools.is_empty() {
        let _ = writeln!(text, "        // Left out, because they seldom play: {}.", tools.join(", "));
    }
    let has_only_buttons = !facts.buttons.is_empty() && facts.mouse_buttons.is_empty();
    if keys.is_empty() && !facts.mouse_buttons.is_empty() {
        text.push_str(
            "        // TODO: one position of the mouse cursor for each action, with `.cursor`.\n        \
             .mouse_buttons([vec![]",
        );
        for button in &facts.mouse_buttons {
            let _ = write!(text, ", vec![MouseButton::{button}]");
        }
        text.push_str("])\n");
    } else if keys.is_empty() && has_only_buttons {
        text.push_str("        // An action that does nothing, before the clicks.\n        .keys([Vec::new()])\n");
    } else if keys.is_empty() {
        text.push_str(
            "        // TODO: no key was found in the sources: the keys that the game reads.\n        \
             .keys([vec![], vec![KeyCode::Space]])\n",
        );
    } else {
        if !facts.presses.is_empty() {
            text.push_str(
                "        // The game reads `just_pressed`: an action that is chosen again holds its keys, and counts once.\n",
            );
        }
        text.push_str(
            "        .keys([\n            // One action for each set of keys. TODO: add sets that are held together.\n            \
             vec![],\n",
        );
        for (at, key) in keys.iter().enumerate() {
            let same: Vec<&str> = facts.aliases_of(key).filter(|other| keys.contains(other)).collect();
            if same.iter().any(|other| keys[..at].contains(other)) {
                continue;
            }
            if !same.is_empty() {
                let _ = writeln!(text, "            // The same as {}.", same.join(" and "));
            }
            let _ = writeln!(text, "            vec![KeyCode::{key}],");
        }
        text.push_str("        ])\n");
        if !facts.mouse_buttons.is_empty() {
            text.push_str("        // TODO: mouse buttons, one set for each action above: .mouse_buttons(sets)\n");
        }
    }
    if has_clicks(facts) {
        let names: Vec<_> = facts.buttons.iter().map(|name| format!("\"{name}\"")).collect();
        let _ = writeln!(text, "        .clicks([{}])", names.join(", "));
    }
    if facts.inputs.contains(&"gamepad") {
        text.push_str("        // TODO: if the gamepad can do more than the keys: .gamepad_buttons(sets)\n");
    }
}

/// Adds the observation and the position.
fn add_sight(text: &mut String, library: &str, facts: &GameFacts) {
    let Some(player) = &facts.player else {
        text.push_str("        // TODO: what bots see, and `.position` of the player.\n");
        text.push_str("        .observe([\"time\"], |time: Res<Time>| [time.elapsed_secs()])\n");
        return;
    };
    let Some(path) = &player.path else {
        let name = &player.at.name;
        let _ = write!(
            text,
            "        // TODO: make `{name}` public in the game's library, for `.observe` and:\n        \
             // .position(|player: Single<&Transform, With<{library}::{name}>>| player.translation.truncate())\n        \
             .observe([\"time\"], |time: Res<Time>| [time.elapsed_secs()])\n"
        );
        return;
    };
    let (names, values, at) = if facts.is_in_space {
        ("\"x\", \"y\", \"z\"", "at.x, at.y, at.z", "player.translation")
    } else {
        ("\"x\", \"y\"", "at.x, at.y", "player.translation.truncate()")
    };
    let _ = write!(
        text,
        "        // TODO: what else a player sees, such as the goal and what is dangerous.\n        \
         .observe([{names}], |players: Query<&Transform, With<{library}::{path}>>| {{\n            \
         let at = players.iter().next().map_or(Vec3::ZERO, |player| player.translation);\n            \
         [{values}]\n        }})\n        \
         .position(|player: Single<&Transform, With<{library}::{path}>>| {at})\n"
    );
}

/// Returns what to move from the program into the library, a line each.
fn moves(sources: &[SourceText]) -> Vec<String> {
    let Some(program) = sources.iter().find(|source| source.path == "src/main.rs") else { return Vec::new() };
    let line_of = |word: &str| program.code.lines().position(|line| line.contains(word)).map(|at| at + 1);
    let mut lines = vec!["to do: move the game from src/main.rs to src/lib.rs:".to_owned()];
    if let (Some(first), Some(last)) = (line_of("App::new()"), line_of(".run()")) {
        lines.push(format!("  lines {first} to {last}, all but `DefaultPlugins` and `run`, into `plugin`"));
    }
    for (at, line) in program.code.lines().enumerate() {
        if let Some(module) = line.strip_prefix("mod ").and_then(|rest| rest.trim_end().strip_suffix(';')) {
            lines.push(format!("  line {}, `mod {module};`, as `pub mod {module};`", at + 1));
        }
    }
    lines.push("  all other functions and types but `main`".to_owned());
    lines.push("  `main` then adds `DefaultPlugins` and the function `plugin` of the library".to_owned());
    lines
}

/// Where the crate `playbot` comes from.
struct PlaybotSource {
    /// The text of the dependency, up to its features.
    dependency: String,
    /// The `Cargo.toml` with its profile, for people.
    profile: String,
}

impl PlaybotSource {
    /// Finds the source: a URL of git, a clone, or the clone from which this program was built.
    fn of(wanted: Option<&str>) -> Result<Self, CliError> {
        if let Some(url) = wanted.filter(|wanted| wanted.contains("://") || wanted.starts_with("git@")) {
            return Ok(Self { dependency: format!("git = {url:?}"), profile: format!("Cargo.toml in {url}") });
        }
        let built_from = Path::new(env!("CARGO_MANIFEST_DIR"));
        let clone = wanted.map_or(built_from, Path::new);
        let inner = clone.join("plugin/cli");
        let folder = if inner.join("Cargo.toml").is_file() { inner } else { clone.to_owned() };
        if !folder.join("Cargo.toml").is_file() {
            let advice = "name a clone of the repository of playbot, or its URL, with --playbot";
            return Err(CliError::Usage(format!("{} has no Cargo.toml: {advice}", folder.display())));
        }
        let folder = std::path::absolute(&folder).unwrap_or(folder);
        let root = folder.ancestors().nth(2).unwrap_or(&folder).join("Cargo.toml");
        // The form of a text in Rust is one of TOML for all paths that a keyboard writes.
        let dependency = format!("path = {:?}", folder.display().to_string());
        Ok(Self { dependency, profile: root.display().to_string() })
    }
}

/// Returns true for the library that this verb writes, as long as no code has been added to it.
fn is_stub(source: &SourceText) -> bool {
    let stub = SourceText::new(&source.path, LIBRARY);
    source.code.split_whitespace().eq(stub.code.split_whitespace())
}
