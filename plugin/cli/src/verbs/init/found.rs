//! Facts about a game that its sources show, read as text.

use crate::verbs::init::folder::{GameManifest, SourceLine, SourceText, is_of_name, name};
use playbot_harness::foreign::PLAYER_NAMES;
use serde::Serialize;
use std::{cmp::Reverse, ops::Range};

/// Random numbers that differ from run to run.
const RANDOM: [&str; 9] = [
    "rand::rng()",
    " rng()",
    "thread_rng()",
    "fastrand::",
    "from_os_rng(",
    "from_entropy(",
    "rand::random",
    "OsRng",
    "SysRng",
];

/// Clocks of the machine.
const CLOCKS: [&str; 5] = ["Instant::now", "SystemTime", "Time<Real>", "Utc::now", "Local::now"];

/// Files that are read while the game runs, besides assets.
const FILES: [&str; 5] = ["read_dir(", "fs::read", "read_to_string(", "File::open", "WalkDir::new"];

/// Code that leaves a level, or goes on to another one.
const LEAVES: [&str; 20] = [
    "AppExit",
    "process::exit",
    "next_level",
    "NextLevel",
    "skip_level",
    "SkipLevel",
    "previous_level",
    "PreviousLevel",
    "prev_level",
    "change_level",
    "level += 1",
    "level -= 1",
    "level.0 += 1",
    "level.0 -= 1",
    "level + 1",
    "level.0 + 1",
    "level_index += 1",
    "::Menu)",
    "::MainMenu)",
    "::LevelSelect)",
];

/// Ways in which a game hears of pressed buttons.
const PRESSED: [&str; 3] = ["Interaction", "Pointer<", "Activate>"];

/// Schedules that run in fixed steps.
const FIXED: [&str; 5] = ["FixedUpdate", "FixedPreUpdate", "FixedPostUpdate", "FixedFirst", "FixedLast"];

/// Code that sets the fixed steps, and whether a number behind it counts the steps of a second; else it is the seconds of
/// a step.
const STEPS: [(&str, bool); 7] = [
    ("Time::<Fixed>::from_hz(", true),
    ("Time::from_hz(", true),
    ("set_timestep_hz(", true),
    ("Time::<Fixed>::from_seconds(", false),
    ("set_timestep_seconds(", false),
    ("Time::<Fixed>::from_duration(", false),
    ("set_timestep(", false),
];

/// Words in the names of states in which a round is played.
const PLAYS: [&str; 12] =
    ["Play", "Playing", "Game", "Gameplay", "Running", "Run", "Round", "Level", "Match", "Battle", "Fight", "Race"];

/// Words in the names of states in which none is played.
const RESTS: [&str; 37] = [
    "Menu",
    "Title",
    "Splash",
    "Intro",
    "Load",
    "Loading",
    "Lobby",
    "Select",
    "Selection",
    "Pause",
    "Paused",
    "Over",
    "End",
    "Ended",
    "Ending",
    "Finish",
    "Finished",
    "Complete",
    "Completed",
    "Failed",
    "Won",
    "Win",
    "Victory",
    "Lost",
    "Lose",
    "Defeat",
    "Dead",
    "Death",
    "Died",
    "Score",
    "Scores",
    "Credits",
    "Settings",
    "Options",
    "Editor",
    "Quit",
    "Exit",
];

/// Code that takes down what a state has spawned.
const CLEARS: [&str; 4] = ["despawn", "cleanup", "clean_up", "teardown"];

/// Crates that load levels or assets while the game runs.
const LOADERS: [&str; 3] = ["bevy_ecs_ldtk", "bevy_ecs_tiled", "bevy_asset_loader"];

/// Crates that turn devices into actions.
const MANAGERS: [&str; 2] = ["leafwing-input-manager", "bevy_enhanced_input"];

/// Crates of physics.
const PHYSICS: [&str; 4] = ["avian2d", "avian3d", "bevy_rapier2d", "bevy_rapier3d"];

/// A name that a program beside the game can use.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct NamedItem {
    /// Where it is defined.
    #[serde(flatten)]
    pub at: SourceLine,
    /// Its path behind the name of the crate; `None` if it is not public.
    pub path: Option<String>,
}

/// The enum of a state.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct StateEnum {
    /// Where it is defined.
    #[serde(flatten)]
    pub at: SourceLine,
    /// Its path behind the name of the crate, if it is public.
    pub path: Option<String>,
    /// Its variants.
    pub variants: Vec<String>,
    /// Whether it exists in another state only.
    pub is_sub: bool,
}

/// A state that spawns a round whenever it is entered, and takes it down.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct RoundState {
    /// Where the systems of its start are added. The name is that of the variant.
    #[serde(flatten)]
    pub at: SourceLine,
    /// Name of the enum.
    pub state: String,
    /// Path of the enum behind the name of the crate, if it is public.
    pub path: Option<String>,
}

/// The folder of assets that a game sets.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct AssetFolder {
    /// Where it is set.
    #[serde(flatten)]
    pub at: SourceLine,
    /// Its path from the folder of the package, if it is written there.
    pub path: Option<String>,
}

/// The fixed steps of a game that sets them.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct StepRate {
    /// Where they are set.
    #[serde(flatten)]
    pub at: SourceLine,
    /// Steps of a second, if the number is written there.
    pub hz: Option<f64>,
}

/// All that the sources show.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub(super) struct GameFacts {
    /// Whether there is a library.
    pub has_library: bool,
    /// Public functions of the library that take `&mut App`, the likeliest first.
    pub functions: Vec<NamedItem>,
    /// Public plugins of the library that are unit structs.
    pub plugins: Vec<NamedItem>,
    /// Those of both that the game's program adds, in their order.
    pub added: Vec<NamedItem>,
    /// The states.
    pub states: Vec<StateEnum>,
    /// The state that begins a round.
    pub round: Option<RoundState>,
    /// Keys that are read.
    pub keys: Vec<String>,
    /// Keys that mean the same, in lists of two or more.
    pub aliases: Vec<Vec<String>>,
    /// Keys behind which the code leaves a level or goes on to another one.
    pub leaving_keys: Vec<SourceLine>,
    /// Those of them that are also read elsewhere.
    pub also_playing: Vec<String>,
    /// Lines that ask whether a key was just pressed.
    pub presses: Vec<SourceLine>,
    /// Mouse buttons that are read.
    pub mouse_buttons: Vec<String>,
    /// Devices and managers of input.
    pub inputs: Vec<&'static str>,
    /// Texts of buttons.
    pub buttons: Vec<String>,
    /// Crates of physics.
    pub physics: Vec<&'static str>,
    /// Whether a camera is in space.
    pub is_in_space: bool,
    /// Random numbers that differ from run to run.
    pub unseeded: Vec<SourceLine>,
    /// Random numbers from a seed.
    pub seeded: Vec<SourceLine>,
    /// Clocks of the machine.
    pub clocks: Vec<SourceLine>,
    /// Crates that load while the game runs.
    pub loaders: Vec<&'static str>,
    /// Lines that load assets.
    pub loads: Vec<SourceLine>,
    /// The folder of assets, if it is another one than `assets`.
    pub asset_folder: Option<AssetFolder>,
    /// Lines that read other files.
    pub files: Vec<SourceLine>,
    /// Lines with tasks that run beside the frames.
    pub tasks: Vec<SourceLine>,
    /// The first line with a schedule of fixed steps.
    pub fixed: Option<SourceLine>,
    /// The fixed steps, if the game sets them.
    pub step_rate: Option<StepRate>,
    /// The component that looks like the player.
    pub player: Option<NamedItem>,
}

impl GameFacts {
    /// Reads the sources of a package, of which `library` is the file of the library.
    pub fn read(manifest: &GameManifest, library: &str, sources: &[SourceText]) -> Self {
        let mut facts = Self::default();
        let door = sources.iter().find(|source| source.path == library);
        facts.has_library = door.is_some();
        for source in sources {
            let prefix = door.and_then(|door| prefix(sources, door, source));
            facts.read_source(source, prefix.as_deref());
        }
        facts.round = round(&facts.states, sources);
        facts.aliases = aliases(&facts.keys, sources);
        facts.also_playing.retain(|key| facts.leaving_keys.iter().any(|leaving| leaving.name == *key));
        let rank = |item: &NamedItem| match item.at.name.as_str() {
            "plugin" => 0,
            "game" => 1,
            _ => 2,
        };
        facts.functions.sort_by_key(rank);
        let program = sources.iter().find(|source| source.path == "src/main.rs");
        facts.added = program.map(|program| facts.added_in(&program.code)).unwrap_or_default();
        if sources.iter().any(|source| PRESSED.iter().any(|word| source.code.contains(word))) {
            facts.buttons = button_texts(sources);
        }
        facts.physics.extend(PHYSICS.into_iter().filter(|name| manifest.depends_on(name)));
        facts.loaders.extend(LOADERS.into_iter().filter(|name| manifest.depends_on(name)));
        facts.add_inputs(sources);
        facts.inputs.extend(MANAGERS.into_iter().filter(|name| manifest.depends_on(name)));
        facts
    }

    /// Reads one source. `prefix` is the path of its module, if that is public.
    fn read_source(&mut self, source: &SourceText, prefix: Option<&str>) {
        let code = source.code.as_str();
        if let Some(prefix) = prefix {
            let item = |(name, offset): (&str, usize)| NamedItem {
                at: source.at(name, offset),
                path: Some(format!("{prefix}{name}")),
            };
            self.functions.extend(functions_of_apps(code).into_iter().map(item));
            self.plugins.extend(unit_plugins(code).into_iter().map(item));
        }
        for (item, is_sub) in [("States", false), ("SubStates", true)]
            .into_iter()
            .flat_map(|(derived, is_sub)| deriving(code, derived, "enum ").into_iter().map(move |item| (item, is_sub)))
        {
            let path = prefix.filter(|_| item.is_public).map(|prefix| format!("{prefix}{}", item.name));
            let at = source.at(item.name, item.offset);
            self.states.push(StateEnum { at, path, variants: variants(item.rest), is_sub });
        }
        add_new(&mut self.keys, names_behind(code, "KeyCode::"));
        for (key, offset) in keys_in(code) {
            if LEAVES.iter().any(|word| reaction(code, offset).contains(word)) {
                self.leaving_keys.push(source.at(key, offset));
            } else {
                add_new(&mut self.also_playing, vec![key.to_owned()]);
            }
        }
        self.presses.extend(source.lines_with(&["just_pressed"]));
        add_new(&mut self.mouse_buttons, names_behind(code, "MouseButton::"));
        self.is_in_space |= code.contains("Camera3d");
        let random = source.lines_with(&RANDOM).into_iter().filter(|found| {
            let line = code.lines().nth(found.line - 1).unwrap_or_default();
            !line.contains("with_seed") && !line.contains("fn rng")
        });
        self.unseeded.extend(random);
        self.seeded.extend(source.lines_with(&["seed_from_u64", "from_seed(", "with_seed("]));
        self.clocks.extend(source.lines_with(&CLOCKS));
        if code.contains("AssetServer") {
            self.loads.extend(source.lines_with(&[".load(", ".load_folder("]));
        }
        self.files.extend(source.lines_with(&FILES));
        self.tasks.extend(source.lines_with(&["AsyncComputeTaskPool"]));
        self.fixed = self.fixed.take().or_else(|| source.lines_with(&FIXED).into_iter().next());
        if let (None, Some((offset, hz))) = (&self.step_rate, step_rate(code)) {
            self.step_rate = Some(StepRate { at: source.at("Time<Fixed>", offset), hz });
        }
        if let Some((offset, path)) = asset_folder(code) {
            self.asset_folder = Some(AssetFolder { at: source.at("AssetPlugin", offset), path });
        }
        for item in deriving(code, "Component", "struct ") {
            let Some(rank) = PLAYER_NAMES.iter().position(|name| *name == item.name) else { continue };
            let earlier =
                self.player.as_ref().and_then(|player| PLAYER_NAMES.iter().position(|name| *name == player.at.name));
            if earlier.is_none_or(|earlier| rank < earlier) {
                let path = prefix.filter(|_| item.is_public).map(|prefix| format!("{prefix}{}", item.name));
                self.player = Some(NamedItem { at: source.at(item.name, item.offset), path });
            }
        }
    }

    /// Returns the first state in which the game loads, and its variant.
    pub fn loading_state(&self) -> Option<(&StateEnum, &str)> {
        self.states.iter().find_map(|state| {
            let variant = state.variants.iter().find(|variant| variant.contains("Loading"))?;
            Some((state, variant.as_str()))
        })
    }

    /// Returns the functions and plugins that the code of a program adds to its app.
    fn added_in(&self, code: &str) -> Vec<NamedItem> {
        let calls = code.match_indices("add_plugins(").flat_map(|(at, words)| parts(&code[at + words.len() - 1..]));
        let words = calls.flat_map(|part| part.split(|c| !is_of_name(c) && c != ':'));
        let is_named = |item: &NamedItem, word: &str| {
            let Some(path) = item.path.as_deref() else { return false };
            word == path || word.ends_with(&format!("::{path}")) || path.ends_with(&format!("::{word}"))
        };
        let all = self.functions.iter().chain(&self.plugins);
        words.filter_map(|word| all.clone().find(|item| is_named(item, word)).cloned()).collect()
    }

    /// Returns whether a key leaves or skips levels wherever it is read.
    pub fn only_leaves(&self, key: &str) -> bool {
        self.leaving_keys.iter().any(|leaving| leaving.name == key) && !self.also_playing.iter().any(|also| also == key)
    }

    /// Returns the keys that mean the same as a key, without itself.
    pub fn aliases_of<'a>(&'a self, key: &'a str) -> impl Iterator<Item = &'a str> {
        let same = self.aliases.iter().filter(move |same| same.iter().any(|name| name == key)).flatten();
        same.map(String::as_str).filter(move |name| *name != key)
    }

    fn add_inputs(&mut self, sources: &[SourceText]) {
        let any = |words: &[&str]| sources.iter().any(|source| words.iter().any(|word| source.code.contains(word)));
        let rows: [(&'static str, bool); 6] = [
            ("keyboard", !self.keys.is_empty() || any(&["ButtonInput<KeyCode>", "ButtonInput<Key>", "KeyboardInput"])),
            ("mouse buttons", !self.mouse_buttons.is_empty() || any(&["ButtonInput<MouseButton>"])),
            ("mouse cursor", any(&["cursor_position(", "CursorMoved", "Pointer<"])),
            ("gamepad", any(&["Gamepad"])),
            ("touch", any(&["Touches", "TouchInput"])),
            ("buttons of bevy_ui", any(&["Interaction"]) || !self.buttons.is_empty()),
        ];
        self.inputs.extend(rows.into_iter().filter(|(_, is_read)| *is_read).map(|(name, _)| name));
    }
}

/// Returns the path of a source's module behind the name of the crate, if a program beside it can name the module.
fn prefix(sources: &[SourceText], door: &SourceText, source: &SourceText) -> Option<String> {
    if source.path == door.path {
        return Some(String::new());
    }
    let folder = door.path.rsplit_once('/').map_or("", |(folder, _)| folder);
    let inner = source.path.strip_prefix(folder)?.trim_start_matches('/');
    let module = inner.strip_suffix("/mod.rs").or_else(|| inner.strip_suffix(".rs"))?;
    let (above, name) = match module.rsplit_once('/') {
        None => (door, module),
        Some((above, name)) => {
            let paths = [".rs", "/mod.rs"].map(|end| format!("{folder}/{above}{end}"));
            (sources.iter().find(|source| paths.contains(&source.path))?, name)
        }
    };
    let is_public = above.code.contains(&format!("pub mod {name};"));
    prefix(sources, door, above).filter(|_| is_public).map(|outer| format!("{outer}{name}::"))
}

fn add_new(all: &mut Vec<String>, more: Vec<String>) {
    for name in more {
        if !all.contains(&name) {
            all.push(name);
        }
    }
}

/// Returns the names behind a path such as `KeyCode::`, also those in braces.
fn names_behind(code: &str, path: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (at, _) in code.match_indices(path).filter(|(at, _)| !code[..*at].ends_with(is_of_name)) {
        let rest = &code[at + path.len()..];
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(list) => list.split('}').next().unwrap_or_default().split(',').map(|part| name(part.trim())).collect(),
            None => vec![name(rest)],
        };
        let is_variant = |name: &&str| name.starts_with(|c: char| c.is_uppercase()) && *name != "Unidentified";
        add_new(&mut found, names.into_iter().filter(is_variant).map(str::to_owned).collect());
    }
    found
}

/// Returns the keys that code names one by one, with their offsets, but for imports.
fn keys_in(code: &str) -> Vec<(&str, usize)> {
    let found = code.match_indices("KeyCode::").filter_map(|(at, path)| {
        let line = code[..at].rsplit('\n').next().unwrap_or_default().trim_start();
        let key = name(&code[at + path.len()..]);
        let is_key = key.starts_with(|c: char| c.is_uppercase()) && !code[..at].ends_with(is_of_name);
        (is_key && !line.trim_start_matches("pub ").starts_with("use ")).then_some((key, at))
    });
    found.collect()
}

/// Returns the keys that mean the same: the sources read one nowhere without the others.
fn aliases(keys: &[String], sources: &[SourceText]) -> Vec<Vec<String>> {
    let read: Vec<Vec<&str>> = sources.iter().flat_map(|source| alternatives(&source.code)).collect();
    let places = |key: &str| -> Vec<usize> {
        read.iter().enumerate().filter(|(_, together)| together.contains(&key)).map(|(at, _)| at).collect()
    };
    let mut found: Vec<(Vec<usize>, Vec<String>)> = Vec::new();
    for key in keys {
        let at = places(key);
        match found.iter_mut().find(|(other, _)| !at.is_empty() && *other == at) {
            Some((_, same)) => same.push(key.clone()),
            None => found.push((at, vec![key.clone()])),
        }
    }
    found.into_iter().map(|(_, same)| same).filter(|same| same.len() > 1).collect()
}

/// Returns the keys that code reads at each place: those of which one is enough are together, as in
/// `any_pressed([A, B])`, `pressed(A) || pressed(B)` and the pattern `A | B`.
fn alternatives(code: &str) -> Vec<Vec<&str>> {
    let all: Vec<(&str, Range<usize>)> =
        keys_in(code).into_iter().map(|(key, at)| (key, at..at + "KeyCode::".len() + key.len())).collect();
    let (mut found, mut begin) = (Vec::new(), 0);
    while begin < all.len() {
        let before = code[..all[begin].1.start].trim_end();
        let is_listed = ["any_pressed([", "any_just_pressed(["].iter().any(|call| before.ends_with(call));
        // The call or comparison of the first key, which has to be that of the others.
        let is_same = |call: &str| {
            let is_whole = call.ends_with('(') || call.ends_with("==");
            let head = before.strip_suffix(call).filter(|_| is_whole);
            head.is_some_and(|head| !head.ends_with(is_of_call) && !binds(head))
        };
        let goes_on = |pair: &[(&str, Range<usize>)]| {
            let between = code[pair[0].1.end..pair[1].1.start].trim();
            let rest = between.strip_prefix(')').unwrap_or(between).trim_start();
            let is_next = rest.strip_prefix("||").is_some_and(|call| is_same(call.trim_start()));
            between == "|" || between == "," && is_listed || is_next
        };
        let more = all[begin..].windows(2).take_while(|pair| goes_on(pair)).count();
        let end = begin + more + 1;
        // `A || B && C` does not mean the same for both.
        let behind = code[all[end - 1].1.end..].trim_start();
        let behind = behind.strip_prefix(')').filter(|_| before.ends_with('(')).unwrap_or(behind).trim_start();
        let keys = all[begin..end].iter().map(|(key, _)| *key);
        if behind.starts_with("&&") && !is_listed {
            found.extend(keys.map(|key| vec![key]));
        } else {
            found.push(keys.collect());
        }
        begin = end;
    }
    found
}

/// Returns true if the name of a call may begin before this.
fn is_of_call(c: char) -> bool {
    is_of_name(c) || c == '.'
}

/// Returns true if code ends with an operator that binds what follows more closely than `||`.
fn binds(code: &str) -> bool {
    ["&&", "!"].iter().any(|operator| code.trim_end().ends_with(operator))
}

/// Returns the code that depends on the key that stands there: the block behind it, the arm of a match, or the line of a
/// condition of a system. Behind a guard that returns without the key it is the rest of the function.
fn reaction(code: &str, at: usize) -> &str {
    let begin = code[..at].rfind('\n').map_or(0, |end| end + 1);
    let line = code[begin..].lines().next().unwrap_or_default();
    if ["input_just_pressed(", "input_pressed(", "run_if("].iter().any(|condition| line.contains(condition)) {
        return line;
    }
    let rest = &code[at..];
    let is_guard = |text: &str| text.split_once('{').is_some_and(|(_, block)| block.trim_start().starts_with("return"));
    let (mut depth, mut is_arm, mut before) = (0_i32, false, ' ');
    for (length, c) in rest.char_indices() {
        let behind = &rest[..length];
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            '>' if before == '=' => is_arm = true,
            _ => {}
        }
        let is_over = match c {
            '}' => depth < 0 || depth == 0 && !is_guard(behind),
            ';' => depth == 0 && !is_guard(behind),
            ',' => depth == 0 && is_arm,
            _ => false,
        };
        if is_over {
            return behind;
        }
        before = c;
    }
    rest
}

/// Returns the offset where the code sets the folder of its assets, and the path, if it is a text.
fn asset_folder(code: &str) -> Option<(usize, Option<String>)> {
    code.match_indices("AssetPlugin {").find_map(|(at, words)| {
        let fields = code[at + words.len()..].split('}').next()?;
        let (_, value) = fields.split_once("file_path")?;
        // The first one may be the type that a function returns.
        let at = fields.rfind(words).map_or(at, |inner| at + words.len() + inner);
        let text = value.trim_start().strip_prefix(':').and_then(|value| value.trim_start().strip_prefix('"'));
        Some((at, text.and_then(|text| text.split('"').next()).map(str::to_owned)))
    })
}

/// Returns the offset where the code sets the fixed steps, and the steps of a second, if a number is written there.
fn step_rate(code: &str) -> Option<(usize, Option<f64>)> {
    let number = |text: &str| text.replace('_', "").trim().parse::<f64>().ok();
    STEPS.iter().find_map(|(words, counts_steps)| {
        let at = code.find(words)?;
        let text = code[at + words.len()..].split(')').next()?;
        let (over, under) = text.split_once('/').unwrap_or((text, "1"));
        let value = number(over).zip(number(under)).map(|(over, under)| over / under);
        // A step of 1.0 / 60.0 seconds is one of 60 in a second, in spite of rounding.
        let hz = value.map(|value| if *counts_steps { value } else { (1e6 / value).round() / 1e6 });
        Some((at, hz.filter(|hz| hz.is_finite() && *hz > 0.0)))
    })
}

/// Returns the public functions that take `&mut App` alone, with their offsets.
fn functions_of_apps(code: &str) -> Vec<(&str, usize)> {
    let found = code.match_indices("pub fn ").filter_map(|(at, words)| {
        let offset = at + words.len();
        let name = name(&code[offset..]);
        let (arguments, _) = code[offset + name.len()..].strip_prefix('(')?.split_once(')')?;
        let arguments = arguments.trim().trim_end_matches(',');
        let is_app = arguments.contains("&mut ") && arguments.ends_with("App") && !arguments.contains(',');
        is_app.then_some((name, offset))
    });
    found.collect()
}

/// Returns the public unit structs that are plugins, with their offsets.
fn unit_plugins(code: &str) -> Vec<(&str, usize)> {
    let found = code.match_indices("impl Plugin for ").filter_map(|(at, words)| {
        let offset = at + words.len();
        let name = name(&code[offset..]);
        code.contains(&format!("pub struct {name};")).then_some((name, offset))
    });
    found.collect()
}

/// A struct or an enum that derives something.
struct Deriving<'a> {
    name: &'a str,
    offset: usize,
    is_public: bool,
    rest: &'a str,
}

/// Returns the structs or enums that derive this trait.
fn deriving<'a>(code: &'a str, derived: &str, kind: &str) -> Vec<Deriving<'a>> {
    let found = code.match_indices("#[derive(").filter_map(|(at, words)| {
        let (list, rest) = code[at + words.len()..].split_once(")]")?;
        list.split(',').find(|name| name.trim().rsplit("::").next() == Some(derived))?;
        let mut rest = rest.trim_start();
        while rest.starts_with("#[") {
            rest = rest.split_once(']')?.1.trim_start();
        }
        let is_public = rest.starts_with("pub ");
        if rest.starts_with("pub") {
            rest = rest.split_once(' ')?.1;
        }
        let rest = rest.strip_prefix(kind)?;
        let name = name(rest);
        Some(Deriving { name, offset: code.len() - rest.len(), is_public, rest: &rest[name.len()..] })
    });
    found.collect()
}

/// Returns the variants of an enum, from the text behind its name.
fn variants(rest: &str) -> Vec<String> {
    let body = rest.split_once('{').map_or("", |(_, body)| body.split('}').next().unwrap_or_default());
    let names = body.split(',').map(|part| {
        let mut part = part.trim();
        while let Some((_, behind)) = part.split_once(']').filter(|_| part.starts_with("#[")) {
            part = behind.trim_start();
        }
        name(part).to_owned()
    });
    names.filter(|name| !name.is_empty()).collect()
}

/// Returns the state that spawns a round whenever it is entered, and takes it down: of several, the one with the likeliest
/// name, and then the one in which most systems run. A state within another one cannot be entered from everywhere.
fn round(states: &[StateEnum], sources: &[SourceText]) -> Option<RoundState> {
    let mut found = Vec::new();
    for source in sources {
        for (state, variant, at) in named_in(&source.code, "OnEnter(") {
            let known = states.iter().find(|known| known.at.name == state && !known.is_sub);
            let Some(known) = known.filter(|known| known.variants.iter().any(|known| known == variant)) else {
                continue;
            };
            let words = words_of(variant);
            let start = code_of_systems(sources, &source.code, at);
            let spawns =
                start.iter().any(|code| code.match_indices("spawn").any(|(at, _)| !code[..at].ends_with("de")));
            if !spawns || words.iter().any(|word| RESTS.contains(word)) {
                continue;
            }
            let is_it = |(of, name, _): &(&str, &str, usize)| (*of, *name) == (state, variant);
            let despawns = |code: &str| {
                ["DespawnOnExit(", "StateScoped("].iter().any(|mark| named_in(code, mark).iter().any(is_it))
            };
            let leaves = sources.iter().flat_map(|source| {
                let exits = named_in(&source.code, "OnExit(").into_iter().filter(is_it);
                exits.flat_map(|(_, _, at)| code_of_systems(sources, &source.code, at)).collect::<Vec<_>>()
            });
            let clears = |code: &str| CLEARS.iter().any(|word| code.contains(word));
            if !start.into_iter().chain(leaves).any(clears) && !sources.iter().any(|source| despawns(&source.code)) {
                continue;
            }
            let running =
                |source: &SourceText| named_in(&source.code, "in_state(").iter().filter(|at| is_it(at)).count();
            let rank = (words.iter().any(|word| PLAYS.contains(word)), sources.iter().map(running).sum::<usize>());
            let (state, path) = (state.to_owned(), known.path.clone());
            found.push((Reverse(rank), RoundState { at: source.at(variant, at), state, path }));
        }
    }
    found.sort_by_key(|(rank, _)| *rank);
    found.into_iter().next().map(|(_, state)| state)
}

/// Returns the variants of states that stand behind this call, such as `OnEnter(Screen::Playing)`: enum, variant, and the
/// offset of the call.
fn named_in<'a>(code: &'a str, call: &str) -> Vec<(&'a str, &'a str, usize)> {
    let found = code.match_indices(call).filter_map(|(at, words)| {
        let (path, variant) = code[at + words.len()..].split(')').next()?.trim().rsplit_once("::")?;
        let is_whole = !code[..at].ends_with(is_of_name) && variant.chars().all(is_of_name);
        is_whole.then(|| (path.rsplit("::").next().unwrap_or(path), variant, at))
    });
    found.collect()
}

/// Returns the words of a name such as `GameOver`.
fn words_of(name: &str) -> Vec<&str> {
    let begins = name.char_indices().filter(|(at, c)| *at == 0 || c.is_uppercase()).map(|(at, _)| at);
    let begins: Vec<usize> = begins.chain([name.len()]).collect();
    begins.windows(2).map(|pair| &name[pair[0]..pair[1]]).collect()
}

/// Returns the code behind a schedule up to the end of the call that adds systems to it, and that of the functions that it
/// names.
fn code_of_systems<'a>(sources: &'a [SourceText], code: &'a str, schedule: usize) -> Vec<&'a str> {
    let mut depth = 0_i32;
    let end = code[schedule..].char_indices().find(|(_, c)| {
        depth += i32::from("([{".contains(*c)) - i32::from(")]}".contains(*c));
        depth < 0
    });
    let call = &code[schedule..end.map_or(code.len(), |(at, _)| schedule + at)];
    let names = call.split(|c| !is_of_name(c)).filter(|name| name.starts_with(|c: char| c.is_lowercase() || c == '_'));
    let bodies = names.flat_map(|name| sources.iter().filter_map(move |source| body_of(&source.code, name)));
    std::iter::once(call).chain(bodies).collect()
}

/// Returns the body of a function.
fn body_of<'a>(code: &'a str, function: &str) -> Option<&'a str> {
    code.match_indices(function).find_map(|(at, _)| {
        let behind = &code[at + function.len()..];
        let is_defined = code[..at].ends_with("fn ") && behind.starts_with(['(', '<']);
        let body = behind.find('{').filter(|_| is_defined)?;
        let mut depth = 0_i32;
        let end = behind[body..].char_indices().find(|(_, c)| {
            depth += i32::from(*c == '{') - i32::from(*c == '}');
            depth == 0
        });
        Some(&behind[body..end.map_or(behind.len(), |(at, _)| body + at)])
    })
}

/// Returns the texts that stand within 20 lines behind a `Button`, or that the names there stand for.
fn button_texts(sources: &[SourceText]) -> Vec<String> {
    const REACH: usize = 20;
    let mut found = Vec::new();
    for code in sources.iter().map(|source| source.code.as_str()) {
        let (mut near, mut offset) = (0_usize, 0);
        for line in code.split_inclusive('\n') {
            let is_import = line.trim_start().starts_with("use ");
            let is_button = line.match_indices("Button").any(|(at, word)| {
                !line[..at].ends_with(is_of_name) && !line[at + word.len()..].starts_with(is_of_name)
            });
            near = if is_button && !is_import { REACH } else { near.saturating_sub(1) };
            for (at, words) in line.match_indices("Text::new(").filter(|_| near > 0) {
                add_new(&mut found, labels(sources, code, offset + at, &line[at + words.len()..]));
            }
            offset += line.len();
        }
    }
    found
}

/// Returns the texts that a value in code stands for: the arguments of all calls, if it is a parameter of the function
/// around it, else those of [`texts_of`].
fn labels(sources: &[SourceText], code: &str, at: usize, value: &str) -> Vec<String> {
    let Some(start) = code[..at].rfind("fn ") else { return texts_of(code, value) };
    let of = name(value.trim_start_matches(['*', '&']));
    let is_it = |parameter: &&str| !of.is_empty() && name(parameter.trim_start_matches("mut ")) == of;
    let Some(place) = parts(&code[start..]).iter().position(is_it) else { return texts_of(code, value) };
    let (mut found, call) = (Vec::new(), format!("{}(", name(&code[start + 3..])));
    for code in sources.iter().map(|source| source.code.as_str()) {
        let calls = code.match_indices(&call).filter(|(at, _)| !code[..*at].ends_with(is_of_name));
        for (at, _) in calls.filter(|(at, _)| !code[..*at].ends_with("fn ")) {
            add_new(&mut found, parts(&code[at..]).get(place).map_or_else(Vec::new, |value| texts_of(code, value)));
        }
    }
    found
}

/// Returns the text that a value in code is, or those of the lists that loops and `map` run through with its name.
fn texts_of(code: &str, value: &str) -> Vec<String> {
    let value = value.trim_start_matches(['*', '&']);
    if value.starts_with('"') || value.is_empty() {
        return first_text(value).into_iter().collect();
    }
    let has_it = |pattern: &str| pattern.split(|c| !is_of_name(c)).any(|word| word == name(value));
    let loops = code.match_indices("for ").filter_map(|(at, words)| code[at + words.len()..].split_once(" in "));
    let loops = loops.filter(|(pattern, _)| has_it(pattern) && !pattern.contains(['{', ';'])).map(|(_, list)| list);
    let maps = code.match_indices(".map(").filter_map(|(at, words)| {
        let closure = code[at + words.len()..].trim_start_matches("move ").strip_prefix('|')?;
        closure.split('|').next().is_some_and(has_it).then_some(at)
    });
    let maps = maps.map(|at| {
        let list = code[..at].trim_end().trim_end_matches(".into_iter()").trim_end().trim_end_matches(".iter()");
        let of_constant = list.trim_end_matches(is_of_name).len();
        &code[if list.ends_with(']') { list.rfind('[').unwrap_or(0) } else { of_constant }..]
    });
    let mut found = Vec::new();
    for list in loops.chain(maps).map(|list| list.trim_start_matches('&')) {
        let constant = || code.split_once(&format!("{}:", name(list))).and_then(|(_, rest)| rest.split_once('='));
        let values = if list.starts_with('[') { list } else { constant().map_or("", |(_, values)| values) };
        found.extend(parts(values).into_iter().filter_map(first_text));
    }
    found
}

/// Returns the first text in code, if it can be the label of a button.
fn first_text(code: &str) -> Option<String> {
    let text = code.split('"').nth(1)?;
    (!text.is_empty() && text.len() <= 30 && !text.contains(['{', '\\'])).then(|| text.to_owned())
}

/// Returns the parts of the first list in parentheses or brackets, between its commas.
fn parts(code: &str) -> Vec<&str> {
    let (mut depth, mut begin, mut is_text, mut found) = (0_i32, 0, false, Vec::new());
    for (at, c) in code.char_indices() {
        is_text ^= c == '"';
        let is_one_of = |signs: &str| !is_text && signs.contains(c);
        depth += i32::from(is_one_of("([{")) - i32::from(is_one_of(")]}"));
        let is_over = depth == 0 && is_one_of(")]}");
        if is_over || depth == 1 && is_one_of(",") {
            found.push(code[begin..at].trim());
        }
        if is_over {
            break;
        }
        if depth == 1 && is_one_of("([{,") {
            begin = at + 1;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts(sources: &[(&str, &str)]) -> GameFacts {
        let sources: Vec<_> = sources.iter().map(|(path, text)| SourceText::new(path, text)).collect();
        GameFacts::read(&GameManifest::default(), "src/lib.rs", &sources)
    }

    #[test]
    fn keys_are_those_that_the_code_names() {
        let code = "use bevy::prelude::KeyCode::{self, Space};\n// KeyCode::KeyQ\n\
            keys.pressed(KeyCode::ArrowLeft) || keys.any_pressed([KeyCode::KeyA, KeyCode::ArrowLeft]);\nMyKeyCode::B;";
        let found = facts(&[("src/main.rs", code)]);
        assert_eq!(found.keys, ["Space", "ArrowLeft", "KeyA"]);
        assert_eq!(found.inputs, ["keyboard"]);
    }

    #[test]
    fn keys_mean_the_same_if_one_is_never_read_without_the_other() {
        let aliases = |code: &str| {
            let same = facts(&[("src/main.rs", code)]).aliases;
            same.iter().map(|same| same.join(" ")).collect::<Vec<_>>().join(", ")
        };
        for (code, same) in [
            ("if keys.any_pressed([KeyCode::KeyW, KeyCode::ArrowUp]) { up(); }", "KeyW ArrowUp"),
            ("keys.any_just_pressed([\n    KeyCode::KeyW,\n    KeyCode::ArrowUp,\n])", "KeyW ArrowUp"),
            ("if keys.pressed(KeyCode::KeyW) || keys.pressed(KeyCode::ArrowUp) { up(); }", "KeyW ArrowUp"),
            ("if on && (keys.pressed(KeyCode::KeyW)\n    || keys.pressed(KeyCode::ArrowUp)) { up(); }", "KeyW ArrowUp"),
            ("if (k.pressed(KeyCode::KeyW) || k.pressed(KeyCode::ArrowUp)) && on { up(); }", "KeyW ArrowUp"),
            ("if key == KeyCode::KeyW || key == KeyCode::ArrowUp { up(); }", "KeyW ArrowUp"),
            ("match key { KeyCode::KeyW | KeyCode::ArrowUp => up(), KeyCode::KeyS => down() }", "KeyW ArrowUp"),
            (
                "k.pressed(KeyCode::KeyA) || k.pressed(KeyCode::KeyB) || k.pressed(KeyCode::KeyC);\n\
                 k.any_pressed([KeyCode::KeyX, KeyCode::KeyY]);",
                "KeyA KeyB KeyC, KeyX KeyY",
            ),
            // The first line moves, the others animate: of four keys, two and two mean the same.
            (
                "k.any_pressed([KeyCode::KeyA, KeyCode::ArrowLeft, KeyCode::KeyD, KeyCode::ArrowRight]);\n\
                 k.pressed(KeyCode::KeyA) || k.pressed(KeyCode::ArrowLeft);\n\
                 k.pressed(KeyCode::KeyD) || k.pressed(KeyCode::ArrowRight);",
                "KeyA ArrowLeft, KeyD ArrowRight",
            ),
            // Read alone somewhere else, held together, by two functions, by two devices, or bound by another operator.
            ("k.any_pressed([KeyCode::KeyA, KeyCode::KeyB]); k.pressed(KeyCode::KeyB);", ""),
            ("k.all_pressed([KeyCode::KeyA, KeyCode::KeyB]);", ""),
            ("k.pressed(KeyCode::KeyA) || k.just_pressed(KeyCode::KeyB)", ""),
            ("a.pressed(KeyCode::KeyA) || aa.pressed(KeyCode::KeyB)", ""),
            ("aa.pressed(KeyCode::KeyA) || a.pressed(KeyCode::KeyB)", ""),
            ("k.pressed(KeyCode::KeyA) || k.pressed(KeyCode::KeyB) && on", ""),
            ("key == KeyCode::KeyA || key == KeyCode::KeyB && on", ""),
            ("on && k.pressed(KeyCode::KeyA) || k.pressed(KeyCode::KeyB)", ""),
            ("!k.pressed(KeyCode::KeyA) || k.pressed(KeyCode::KeyB)", ""),
            ("k.pressed(KeyCode::KeyA) && k.pressed(KeyCode::KeyB)", ""),
            ("[KeyCode::KeyA, KeyCode::KeyB].map(|key| k.pressed(key))", ""),
        ] {
            assert_eq!(aliases(code), same, "{code}");
        }
        let both = [
            ("src/a.rs", "k.pressed(KeyCode::KeyA) || k.pressed(KeyCode::KeyB)"),
            ("src/b.rs", "k.pressed(KeyCode::KeyA)"),
        ];
        assert_eq!(facts(&both[..1]).aliases.len(), 1);
        assert_eq!(facts(&both).aliases, Vec::<Vec<String>>::new(), "another file reads it alone");
    }

    #[test]
    fn public_functions_and_plugins_of_the_library_are_found() {
        let library = "pub mod rules;\nmod hidden;\npub fn level(number: u64) {}\npub fn add(app: &mut App) {}\n\
            pub struct All;\nimpl Plugin for All { fn build(&self, app: &mut App) {} }\nfn own(app: &mut App) {}";
        let rules = "pub fn plugin(app: &mut bevy::prelude::App) {}\npub fn two(app: &mut App, other: u32) {}";
        let found = facts(&[("src/lib.rs", library), ("src/rules.rs", rules), ("src/hidden.rs", rules)]);
        let paths =
            |items: &[NamedItem]| items.iter().map(|item| item.path.clone().unwrap_or_default()).collect::<Vec<_>>();
        assert!(found.has_library);
        assert_eq!(paths(&found.functions), ["rules::plugin", "add"]);
        assert_eq!(paths(&found.plugins), ["All"]);
        let at = &found.functions[1].at;
        assert_eq!((at.name.as_str(), at.file.as_str(), at.line), ("add", "src/lib.rs", 4));
    }

    #[test]
    fn states_have_their_variants() {
        let code = "#[derive(Clone, Default, States)]\npub enum Screen {\n    #[default]\n    Menu,\n    Playing,\n}\n\
            #[derive(Debug)]\nenum Other { A }";
        let found = facts(&[("src/main.rs", code)]);
        assert_eq!(found.states.len(), 1);
        assert_eq!((found.states[0].at.name.as_str(), found.states[0].at.line), ("Screen", 2));
        assert_eq!(found.states[0].variants, ["Menu", "Playing"]);
    }

    #[test]
    fn the_likeliest_player_is_found_and_usable_only_if_public() {
        let code = "#[derive(Component)]\npub struct Ship;\n#[derive(Component, Default)]\n#[require(Transform)]\nstruct Hero { speed: f32 }\n\
            #[derive(Resource)]\npub struct Player;";
        let player = facts(&[("src/lib.rs", code)]).player.expect("a hero");
        assert_eq!((player.at.name.as_str(), player.at.line, player.path), ("Hero", 5, None));
        let player = facts(&[("src/lib.rs", &code.replace("struct Hero", "pub struct Hero"))]).player.expect("a hero");
        assert_eq!(player.path.as_deref(), Some("Hero"));
    }

    #[test]
    fn randomness_clocks_and_loads_have_their_lines() {
        let code = "use rand::rng;\nuse std::time::SystemTime;\nlet a = rand::rng();\nlet b = fastrand::Rng::with_seed(7);\n\
            let c = SmallRng::from_os_rng();\nlet d = StdRng::seed_from_u64(7);\nlet e = Instant::now();\n\
            fn load(assets: Res<AssetServer>) { assets.load(\"hero.png\"); }\nlet f = rng();";
        let found = facts(&[("src/main.rs", code)]);
        let lines = |found: &[SourceLine]| found.iter().map(|at| at.line).collect::<Vec<_>>();
        assert_eq!(lines(&found.unseeded), [3, 5, 9], "{:?}", found.unseeded);
        assert_eq!(lines(&found.seeded), [4, 6]);
        assert_eq!((lines(&found.clocks), lines(&found.loads)), (vec![7], vec![8]));
    }

    #[test]
    fn keys_that_leave_or_skip_levels_are_told_from_those_that_play() {
        let code = "use bevy::prelude::KeyCode::KeyQ;\n\
            fn play(keys: Res<ButtonInput<KeyCode>>) {\n    if keys.just_pressed(KeyCode::ArrowLeft) { step(-1); }\n    \
            if keys.just_pressed(KeyCode::Escape) {\n        exit.write(AppExit::Success);\n    }\n    \
            if keys.just_pressed(KeyCode::Space) && won.0 {\n        level.0 += 1;\n    }\n    \
            if keys.pressed(KeyCode::Space) { jump(); }\n}\n\
            fn cheat(keys: Res<ButtonInput<KeyCode>>) {\n    if !keys.just_pressed(KeyCode::KeyN) {\n        return;\n    }\n    \
            level.0 = (level.0 + 1) % 3;\n}\n\
            fn menu(key: KeyCode) { match key { KeyCode::KeyM => next.set(Screen::Menu), KeyCode::KeyX => fire(), _ => {} } }\n\
            fn add(app: &mut App) {\n    app.add_systems(Update, (\n        walk,\n        \
            skip_level.run_if(input_just_pressed(KeyCode::PageDown)),\n        shoot.run_if(input_just_pressed(KeyCode::KeyZ)),\n    ));\n}";
        let found = facts(&[("src/lib.rs", code)]);
        let leaving: Vec<_> = found.leaving_keys.iter().map(|at| (at.name.as_str(), at.line)).collect();
        assert_eq!(leaving, [("Escape", 4), ("Space", 7), ("KeyN", 13), ("KeyM", 18), ("PageDown", 22)]);
        assert_eq!(found.also_playing, ["Space"]);
        let only = |key: &str| found.only_leaves(key);
        assert_eq!(["KeyN", "Space", "KeyX", "KeyZ", "ArrowLeft"].map(only), [true, false, false, false, false]);
    }

    #[test]
    fn files_and_the_folder_of_assets_have_their_lines() {
        let code = "use std::fs;\nfn levels() { fs::read_dir(\"levels\"); }\nfn level() { fs::read_to_string(\"a\"); }\n\
            fn main() { App::new().add_plugins(DefaultPlugins.set(AssetPlugin {\n    file_path: \"data/art\".into(),\n    ..default()\n})); }";
        let found = facts(&[("src/main.rs", code)]);
        let lines: Vec<_> = found.files.iter().map(|at| (at.name.as_str(), at.line)).collect();
        assert_eq!(lines, [("read_dir(", 2), ("fs::read", 3)]);
        let folder = found.asset_folder.expect("it is set");
        assert_eq!((folder.at.line, folder.path.as_deref()), (4, Some("data/art")));
        let computed = code.replace("file_path: \"data/art\".into()", "file_path");
        assert_eq!(facts(&[("src/main.rs", &computed)]).asset_folder.expect("it is set").path, None);
        let plain = code.replace("file_path: \"data/art\".into(),", "");
        assert_eq!(facts(&[("src/main.rs", &plain)]).asset_folder, None);
    }

    #[test]
    fn fixed_steps_are_those_of_the_schedules_and_of_the_clock() {
        let code = "use bevy::app::FixedUpdate;\nfn add(app: &mut App) {\n    app.add_systems(FixedUpdate, walk);\n    CLOCK;\n}";
        let found = facts(&[("src/lib.rs", code)]);
        assert_eq!(found.fixed.map(|at| (at.name, at.line)), Some(("FixedUpdate".to_owned(), 3)));
        assert_eq!(found.step_rate, None);
        for (clock, hz) in [
            ("app.insert_resource(Time::<Fixed>::from_hz(50.0))", Some(50.0)),
            ("time.set_timestep_hz(1_00.5)", Some(100.5)),
            ("app.insert_resource(Time::<Fixed>::from_seconds(0.02))", Some(50.0)),
            ("app.insert_resource(Time::<Fixed>::from_seconds(1.0 / 60.0))", Some(60.0)),
            ("app.insert_resource(Time::<Fixed>::from_hz(RATE))", None),
            ("app.insert_resource(Time::<Fixed>::from_seconds(0.0))", None),
            ("app.insert_resource(Time::<Fixed>::from_duration(Duration::from_millis(20)))", None),
        ] {
            let rate = facts(&[("src/lib.rs", &code.replace("CLOCK", clock))]).step_rate.expect("it is set");
            assert_eq!((rate.at.line, rate.hz), (4, hz), "{clock}");
        }
        let without = code.replace("app.add_systems(FixedUpdate", "app.add_systems(Update");
        assert_eq!(facts(&[("src/lib.rs", &without)]).fixed, None, "an import alone");
    }

    #[test]
    fn modules_within_modules_are_found_and_what_the_program_adds() {
        let plugin = |name: &str| format!("pub struct {name};\nimpl Plugin for {name} {{}}\n");
        let (hero, ghost) = (plugin("HeroPlugin"), plugin("GhostPlugin"));
        let program = "fn main() { App::new().add_plugins((DefaultPlugins.set(x()), game::ui::plugin, \
            game::actors::hero::HeroPlugin)).run(); }";
        let found = facts(&[
            ("src/lib.rs", "pub mod actors;\npub mod ui;"),
            ("src/actors/mod.rs", "pub mod hero;\nmod ghost;"),
            ("src/actors/hero.rs", &hero),
            ("src/actors/ghost.rs", &ghost),
            ("src/ui.rs", "pub fn plugin(app: &mut App) {}\npub fn other(app: &mut App) {}"),
            ("src/main.rs", program),
        ]);
        let paths = |items: &[NamedItem]| items.iter().filter_map(|item| item.path.clone()).collect::<Vec<_>>();
        assert_eq!(paths(&found.plugins), ["actors::hero::HeroPlugin"], "the other module is not public");
        assert_eq!(paths(&found.functions), ["ui::plugin", "ui::other"]);
        assert_eq!(paths(&found.added), ["ui::plugin", "actors::hero::HeroPlugin"]);
    }

    #[test]
    fn a_round_begins_in_the_state_that_spawns_it_and_takes_it_down() {
        let states = "#[derive(States)]\npub enum Screen { Menu, Playing, GameOver, Shop }\n\
            #[derive(SubStates)]\npub enum Phase { Running }\n";
        let round = |code: &str| {
            let found = facts(&[("src/lib.rs", &format!("pub mod play;\n{states}")), ("src/play.rs", code)]).round?;
            assert_eq!(
                (found.state.as_str(), found.path.as_deref(), found.at.file.as_str()),
                ("Screen", Some("Screen"), "src/play.rs")
            );
            Some((found.at.name, found.at.line))
        };
        let found = |variant: &str, line| Some((variant.to_owned(), line));
        let whole = "fn plugin(app: &mut App) {\n    app.add_systems(OnEnter(crate::Screen::Playing), (set_up, other).chain())\n        \
            .add_systems(OnExit(Screen::Playing), take_down);\n}\n\
            fn set_up(mut commands: Commands) {\n    commands.spawn(Ball);\n}\n\
            fn take_down(mut commands: Commands) {\n    commands.entity(ball).despawn();\n}\n";
        assert_eq!(round(whole), found("Playing", 2));
        for (left_out, why) in [
            ("commands.spawn(Ball)", "nothing is spawned"),
            (".despawn()", "nothing is despawned"),
            ("OnExit(Screen::Playing)", "it is despawned somewhere else"),
            ("OnEnter(crate::Screen::Playing)", "no state is entered"),
        ] {
            assert_eq!(round(&whole.replace(left_out, "nothing()")), None, "{why}");
        }
        let scoped = whole.replace(".despawn()", "").replace("Ball", "(Ball, DespawnOnExit(Screen::Playing))");
        assert_eq!(round(&scoped), found("Playing", 2), "Bevy despawns it");
        for variant in ["Menu", "GameOver"] {
            assert_eq!(round(&whole.replace("Playing", variant)), None, "{variant} is no round");
        }
        assert_eq!(round(&whole.replace("Screen::Playing", "Phase::Running")), None, "a state within a state");
        let shop = whole.replace("Playing", "Shop");
        assert_eq!(round(&shop), found("Shop", 2));
        let both = format!("{shop}{whole}");
        assert_eq!(round(&both), found("Playing", shop.lines().count() + 2), "its name says that it is played");
    }

    #[test]
    fn a_state_that_loads_is_found() {
        let screen = "#[derive(States)]\npub enum Screen { Menu, Playing }\n";
        let loading = "#[derive(Default, States)]\nenum Phase { #[default] AssetLoading, Ready }\n";
        assert_eq!(facts(&[("src/lib.rs", screen)]).loading_state(), None);
        let found = facts(&[("src/lib.rs", &format!("{screen}{loading}"))]);
        let (state, variant) = found.loading_state().expect("the second one");
        assert_eq!((state.at.name.as_str(), state.at.line, variant), ("Phase", 4, "AssetLoading"));
        assert_eq!((state.path.as_deref(), found.states[0].path.as_deref()), (None, Some("Screen")));
    }

    #[test]
    fn labels_of_buttons_come_from_lists_and_from_calls_of_helpers() {
        let helper = "pub fn button<T: Component>(parent: &mut ChildSpawner, label: &str, mark: T) {\n    \
            parent.spawn((Button, mark)).with_child(Text::new(label));\n}";
        let menu = "const ITEMS: [(&str, Go); 2] = [(\"Play, now\", Go::Play), (\"Quit\", Go::Quit)];\n\
            fn menu(parent: &mut ChildSpawner) {\n    button(parent, \"Resume\", Mark(\"a\"));\n    \
            for (label, go) in ITEMS { button(parent, label, go); }\n    my_button(parent, \"None\");\n}";
        let levels = "fn levels() {\n    for name in &[\"Cave\", \"Mill\"] {\n        \
            spawn((Button, children![Text::new(*name)]));\n    }\n    \
            [\"Easy\", \"Hard\"]\n        .into_iter()\n        .map(move |label| (Button, children![Text::new(label.to_owned())]));\n    \
            (Button, children![Text::new(title())]);\n}\nfn press(on: On<Pointer<Click>>) {}";
        let all = [("src/levels.rs", levels), ("src/menu.rs", menu), ("src/widgets.rs", helper)];
        assert_eq!(facts(&all).buttons, ["Cave", "Mill", "Easy", "Hard", "Resume", "Play, now", "Quit"]);
        assert_eq!(facts(&all[1..]).buttons, Vec::<String>::new(), "nothing hears of a click");
    }

    #[test]
    fn texts_near_buttons_are_names_of_buttons() {
        let code = "use bevy::ui::Button;\nfn menu() { (Node::default(), Text::new(\"Title\")); }\n\
            fn start() { (Button, children![(Text::new(\"Start\"))]); }\nfn press(query: Query<&Interaction>) {}";
        let found = facts(&[("src/main.rs", code)]);
        assert_eq!(found.buttons, ["Start"]);
        assert_eq!(found.inputs, ["buttons of bevy_ui"]);
        let without = code.replace("Interaction", "Transform");
        assert_eq!(facts(&[("src/main.rs", &without)]).buttons, Vec::<String>::new());
    }
}
