//! `playbot play` in a program that was built with a window.

use crate::{
    arguments::{default_mode, level_number, player::LoadedPlayer, report_agents_along},
    error::{CliError, Outcome},
    output::program,
    progress::interrupt,
    verbs::{demo::deciders, play::Args, skills::SkillNames},
    window::{Autopilot, GameWindow, Playlist, TeachingSetup, UnboundKeys, WindowSetup},
};
use bevy_playbot::{
    demo::file::{DemoHeader, DemoSummary},
    placement::TickPlacement,
    vision::ObservationConfig,
};
use playbot_harness::{
    game::{Game, without_idle_action},
    games::Games,
    level_files::is_level_files,
    split::LevelSplit,
};
use playbot_report::counted;
use std::path::Path;

/// The last level where the game does not limit them: levels have 32 bits.
const LAST_LEVEL: u64 = u32::MAX as u64;

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    report_agents_along(game);
    let playlist = playlist(game, &args)?;
    let (autopilot, observation_config) = autopilot(game, &args)?;
    check_time_limit(game, &args)?;
    let header = header(game, playlist.mode(), &args);
    let recording = args.record.clone().unwrap_or_else(|| format!("{}.demo", game.name()).into());
    let has_pictures = observation_config.is_image();
    let program =
        program::file().map_err(|error| CliError::Io(format!("this program's own path is unknown: {error}")))?;
    let options = lesson_options(&args, &playlist);
    let teaching =
        TeachingSetup { recording: recording.clone(), header: header.clone(), program, options, has_pictures };
    let recorded_before = length(&recording);
    let seed = args.seed.unwrap_or(0);
    let mut window =
        GameWindow::open(WindowSetup { game, playlist, autopilot, observation_config, seed, stop: interrupt::asked })?;
    // Only once there is a window: a recording without one would only be in the way.
    if let Some(path) = &args.record {
        window.check_recording()?;
        window.record(args.overwrite.open(path, header)?);
    }
    window.teach(teaching);
    window.name_skills(SkillNames::of_player(&args.autopilot)?.regions);
    if args.no_time_limit {
        window.lift_time_limit();
    }
    interrupt::listen();
    window.announce(announcement(game, &args));
    let unbound = window.unbound_keys();
    window.run()?;
    if args.record.is_some() || length(&recording) != recorded_before {
        conclude(&recording, &unbound)?;
    }
    // A signal ends the program as it ends any other verb. A person who is done presses Escape.
    Ok(if interrupt::asked() { Outcome::Stopped } else { Outcome::Pass })
}

/// Checks that there is a time limit to lift.
fn check_time_limit(game: &dyn Game, args: &Args) -> Result<(), CliError> {
    if !args.no_time_limit || game.tools().host.time_limit().is_some() {
        return Ok(());
    }
    Err(CliError::Usage(format!(
        "`{}` has no time limit that could be lifted: no adapter sets one with `.time_limit`, and a limit that is a rule \
         of the game stays; leave out --no-time-limit",
        game.name()
    )))
}

fn playlist(game: &dyn Game, args: &Args) -> Result<Playlist, CliError> {
    let named = args.mode.as_deref();
    let mode = named.unwrap_or_else(|| default_mode(game));
    let levels = match args.levels.as_deref() {
        Some(text) if text.contains(':') => text.parse()?,
        Some(text) => format!("{mode}:{text}").parse()?,
        None if is_level_files(mode) => mode.parse()?,
        None => LevelSplit { mode: mode.to_owned(), first: 0, last: LAST_LEVEL }.within(game),
    };
    levels.check(game)?;
    if named.is_some_and(|mode| mode != levels.mode) {
        return Err(CliError::Usage(format!(
            "--mode and --levels name different modes: leave out --mode, or {levels}"
        )));
    }
    let first = level_number(args.level, args.seed).unwrap_or(levels.first);
    if !levels.contains(&levels.mode, first) {
        return Err(CliError::Usage(format!("--level {first} is none of the levels {levels}")));
    }
    Ok(Playlist::new(levels, first))
}

/// Returns the autopilot and its observation.
fn autopilot(game: &dyn Game, args: &Args) -> Result<(Option<Autopilot>, ObservationConfig), CliError> {
    Ok(match args.autopilot.load(game)? {
        Some(LoadedPlayer { name, player, observation_config, .. }) => {
            (Some(Autopilot { name, player }), observation_config)
        }
        None => (None, ObservationConfig::default()),
    })
}

/// Returns the options of the lesson in the background.
fn lesson_options(args: &Args, playlist: &Playlist) -> Vec<String> {
    let mut options = Vec::new();
    if args.levels.is_some() || args.mode.is_some() {
        options.push(format!("--set=train={}", playlist.trained()));
    }
    options
}

/// Returns the length of a file in bytes; `None` if there is none.
fn length(path: &Path) -> Option<u64> {
    std::fs::metadata(path).ok().map(|file| file.len())
}

fn header(game: &dyn Game, mode: &str, args: &Args) -> DemoHeader {
    let header = game.demo_header(mode);
    DemoHeader { demonstrator: args.name.clone(), ..header }
}

/// Returns the lines about keys and players that are printed once the game has started.
fn announcement(game: &dyn Game, args: &Args) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(keys) = game.tools().input.key_bindings() {
        let zoom = if game.tools().host.placement() == TickPlacement::Fixed { ", - and = zoom" } else { "" };
        lines.push(format!("{}; R again, N next level, P pause{zoom}, Escape ends", keys.help()));
    } else if args.record.is_some() {
        lines.push(
            "the game gets the actions that your keys, mouse and gamepad mean, and nothing else; R again, N next level, P \
             pause, Escape ends"
                .to_owned(),
        );
    } else {
        lines.push("the game's own keys and mouse; R again, N next level, P pause, Escape ends".to_owned());
    }
    let is_by_actions = game.tools().input.key_bindings().is_some() || args.record.is_some();
    if let Some(problem) = without_idle_action(game).filter(|_| is_by_actions) {
        lines.push(format!("warning: {problem}"));
    }
    if let Some(limit) = game.tools().host.time_limit() {
        let limit = counted(u64::from(limit), "tick");
        lines.push(match args.no_time_limit {
            true => format!("there is no time limit; bots have {limit} for a level"),
            false => format!("time limit, as for bots: {limit} for a level; --no-time-limit lifts it"),
        });
    }
    if args.autopilot.is_named() {
        lines.push("Tab hands over and takes over again".to_owned());
    } else {
        lines.push("there is no autopilot yet: F9 records, F10 learns from it, and Tab hands over".to_owned());
    }
    lines
}

/// Prints the path of the recording, its contents, the keys that are not in it, and the next commands.
fn conclude(path: &Path, unbound: &UnboundKeys) -> Result<(), CliError> {
    let summary = DemoSummary::read(path)?;
    let file = path.display();
    report!(
        "{file}: {}, {}, {}",
        counted(summary.episodes as u64, "episode"),
        counted(summary.steps as u64, "step"),
        deciders("decided by", &summary.steps_by_decider)
    );
    unbound.notes().iter().for_each(|note| report!("  {note}"));
    let program = program::name();
    report!("  {program} demo verify {file}   proves that it replays");
    report!("  {program} learn-skills --set demos={file} --out skills.safetensors   learns from it");
    Ok(())
}
