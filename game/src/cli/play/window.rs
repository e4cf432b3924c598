//! `playbot play` in a program that was built with a window.

use std::path::Path;

use bevy_playbot::{
    demo::{
        file::{DemoHeader, DemoSummary},
        recorder::demo_actions,
    },
    eval::Player,
    game::{Game, check_mode},
    learner::PolicyFile,
    policy::ActionDraw,
    policy_file::{check_policy, policy_sight},
    skill_prior::SkillPrior,
    split::LevelSplit,
    train::{Learner, run_dir::RunDir},
    vision::Sight,
};

use super::Args;
use crate::{
    cli::{
        demo::deciders,
        error::{CliError, Outcome},
        eval::check_fit,
        interrupt, methods,
    },
    registry,
    window::{GameWindow, Partner, Playlist, WindowSetup},
};

/// Levels are numbered with 32 bits where nobody says how many there are.
const LAST_LEVEL: u64 = u32::MAX as u64;

pub fn run(args: Args) -> Result<Outcome, CliError> {
    let game = registry::game(&args.game)?;
    let playlist = playlist(game, &args)?;
    let (partner, sight) = partner(game, &args)?;
    let header = header(game, playlist.mode(), &args);
    let seed = args.seed.unwrap_or(0);
    let mut window = GameWindow::open(WindowSetup { game, playlist, partner, sight, seed, stop: interrupt::asked })?;
    // Not before there is a window: a recording without one would only be in the way.
    if let Some(path) = &args.record {
        window.record(args.existing.open(path, header)?);
    }
    interrupt::listen();
    announce(game, &args);
    window.run()?;
    args.record.as_deref().map_or(Ok(Outcome::Pass), conclude)
}

fn playlist(game: &dyn Game, args: &Args) -> Result<Playlist, CliError> {
    let named = args.mode.as_deref();
    let mode = named.or(game.modes().last().copied()).unwrap_or_default();
    let levels = match args.levels.as_deref() {
        Some(text) if text.contains(':') => text.parse()?,
        Some(text) => format!("{mode}:{text}").parse()?,
        None => LevelSplit { mode: mode.to_owned(), first: 0, last: LAST_LEVEL },
    };
    check_mode(game, &levels.mode)?;
    if named.is_some_and(|mode| mode != levels.mode) {
        return Err(CliError::Usage(format!(
            "--mode and --levels name different modes: leave out --mode, or {levels}"
        )));
    }
    let first = args.seed.unwrap_or(levels.first);
    if !levels.contains(&levels.mode, first) {
        return Err(CliError::Usage(format!("--seed {first} is none of the levels {levels}")));
    }
    Ok(Playlist::new(levels, first))
}

/// Whoever takes over with Tab, and what it sees.
fn partner(game: &dyn Game, args: &Args) -> Result<(Option<Partner>, Sight), CliError> {
    if let Some(name) = &args.bot {
        let partner = Partner { name: name.clone(), player: methods::bot(game, name)? };
        return Ok((Some(partner), Sight::default()));
    }
    let (name, policy, prior, sight) = if let Some(path) = &args.policy {
        let file = PolicyFile::load(path, args.device)?;
        check_policy(game, &file)?;
        let sight = policy_sight(&file)?;
        (file.card.algorithm, file.policy, file.skills, sight)
    } else if let Some(path) = &args.run {
        let (run, experiment, info) = RunDir::open(path)?;
        if experiment.game != game.name() {
            return Err(CliError::Usage(format!("{} is a run of `{}`", path.display(), experiment.game)));
        }
        let learner = Learner::load(info.algorithm, &run.checkpoint(args.checkpoint)?.learner_file(), args.device)?;
        (info.algorithm.name().to_owned(), learner.policy(), learner.skills(), experiment.sight())
    } else {
        return Ok((None, Sight::default()));
    };
    check_fit(game, &name, &sight, &policy)?;
    let draw = if args.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
    let player = Player::Policy { policy, prior: prior.as_ref().map(SkillPrior::from), draw };
    Ok((Some(Partner { name, player }), sight))
}

fn header(game: &dyn Game, mode: &str, args: &Args) -> DemoHeader {
    let actions = demo_actions(&game.actions());
    let header = DemoHeader::new(game.name(), game.version(), mode, game.tick_hz(), actions);
    DemoHeader { demonstrator: args.name.clone(), ..header }
}

fn announce(game: &dyn Game, args: &Args) {
    if let Some(keys) = game.input_map() {
        eprintln!("{}; R again, N next level, P pause, - and = zoom, Escape ends", keys.help());
    }
    if args.policy.is_some() || args.run.is_some() || args.bot.is_some() {
        eprintln!("Tab hands over and takes over again");
    } else {
        eprintln!("there is nobody to hand over to: name a --policy, a --run or a --bot");
    }
}

/// Says where the recording is, what it holds and what can be done with it.
fn conclude(path: &Path) -> Result<Outcome, CliError> {
    let summary = DemoSummary::read(path)?;
    let file = path.display();
    eprintln!(
        "{file}: {} episodes, {} steps, decided by {}",
        summary.episodes,
        summary.steps,
        deciders(&summary.steps_by_decider)
    );
    eprintln!("  playbot demo verify {file}   proves that it replays");
    eprintln!("  playbot learn-skills --set demos={file} --out skills.safetensors   learns from it");
    Ok(Outcome::Pass)
}
