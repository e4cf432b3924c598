//! `playbot doctor`.

use crate::{
    arguments::{check_start, default_mode, level_number},
    error::{CliError, Outcome},
    output::print_line,
    progress::{interrupt, interrupt::NothingToSave},
};
use playbot_harness::{
    doctor::{DoctorOptions, examine},
    game::Game,
    games::Games,
    prelude::*,
    split::check_level,
    worlds::build_world,
};
use std::time::Instant;

/// Check that a game plays the same when it is given the same actions, and find the first difference.
///
/// Recording, replay, resume and training in many arenas depend on it. Copies of the game play the same random actions
/// twice in one thread. They play them with another wall clock, with more archetypes in the World, and on two threads.
/// They play two arenas in one World against each alone, and the same level again after a restart. If the game
/// saves snapshots, one copy plays on, and another one returns to the same tick by a snapshot. All of this is done on
/// level 0. Level 1 is played twice, too, if the game has one, and each of the two levels after the other: nothing of a
/// level may survive into the next. The first difference is printed with its tick and with advice. A clean result holds
/// for the ticks and the levels that were played, so try more ticks and other levels too. State that differs is only a
/// note if agents never notice it: not in observations, rewards, ends of episodes or the state hash. Exit code 1 if
/// something was found; notes are no findings.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot doctor GAME
  playbot doctor GAME --ticks 10000 --level 1
  playbot doctor GAME --level 0 --level 7 --level 12
  playbot doctor maze2d --mode medium --ticks 1000 --json
  playbot doctor GAME --ignore HighScore")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game (default: the one that `train` trains in).
    #[arg(long)]
    mode: Option<String>,
    /// Ticks of each comparison. More of them find rare and late differences.
    #[arg(long, default_value_t = 300, value_parser = clap::value_parser!(u32).range(1..))]
    ticks: u32,
    /// Number of the level to examine, also as mode:number, or its name in a level editor (repeatable; default: 0 and 1).
    /// Further ones are played twice, and after the level before them.
    #[arg(long, value_name = "N")]
    level: Vec<u64>,
    /// Random seed of the actions (default: 0).
    #[arg(long)]
    seed: Option<u64>,
    /// Leave out components and resources whose type path contains this, such as a high score that is meant to last
    /// (repeatable).
    #[arg(long, value_name = "TYPE")]
    ignore: Vec<String>,
    /// Compare diagnostics, counters and clocks of known engines, too. By default those of avian, bevy_rapier and Bevy
    /// are left out, and the report names them.
    #[arg(long)]
    no_default_ignores: bool,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
}

/// Seconds of the speed measurement.
const SPEED_SECONDS: f64 = 0.5;

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let mode = args.mode.unwrap_or_else(|| default_mode(game).to_owned());
    let named = level_number(args.level.first().copied(), args.seed);
    game.check_mode(&mode)?;
    let (level, further_levels) = match named {
        Some(level) => (level, args.level.get(1..).unwrap_or_default().to_vec()),
        None => (0, has_second_level(game, &mode).then_some(1).into_iter().collect()),
    };
    further_levels.iter().chain([&level]).try_for_each(|level| check_level(game, &mode, *level))?;
    check_start(game, &mode, level)?;
    let options = DoctorOptions {
        ticks: args.ticks,
        level,
        further_levels,
        seed: args.seed.unwrap_or(0),
        ignored: args.ignore,
        default_ignores: !args.no_default_ignores,
        ..DoctorOptions::new(mode)
    };
    interrupt::leave("no comparison is kept: call it again, or with fewer --ticks".to_owned());
    let examining = NothingToSave::listen();
    let mut report = examine(game, &options, |comparison| report!("comparing: {comparison}"))?;
    let has_fault = report.comparisons.iter().any(|report| report.fault.is_some());
    if !has_fault {
        report.ticks_per_second = Some(speed(game, &options)?);
    }
    drop(examining);
    for part in options.ignored.iter().filter(|part| !report.types.compared.iter().any(|path| path.contains(*part))) {
        report!(
            "warning: --ignore {part} leaves nothing out: no component or resource that is compared has it in its path"
        );
    }
    if args.json {
        let line = serde_json::to_string(&report)
            .map_err(|error| CliError::Io(format!("the report cannot be written as JSON: {error}")))?;
        print_line(line)?;
    } else {
        print_line(&report)?;
    }
    Ok(if report.is_healthy() { Outcome::Pass } else { Outcome::Findings })
}

/// Returns whether a mode has a level 1.
fn has_second_level(game: &dyn Game, mode: &str) -> bool {
    check_level(game, mode, 1).is_ok()
}

/// Returns the ticks per second of one arena under random actions, by the clock.
fn speed(game: &dyn Game, options: &DoctorOptions) -> Result<f64, CliError> {
    let (mut world, agents) = build_world(game, &options.mode, options.seed, 0, 1);
    for agent in agents {
        let queue = LevelQueue::Always(options.level);
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, queue));
    }
    world.tick()?;
    let (start, mut ticks) = (Instant::now(), 0_u32);
    while start.elapsed().as_secs_f64() < SPEED_SECONDS {
        world.tick()?;
        ticks += 1;
    }
    Ok(f64::from(ticks) / start.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::prelude::App;
    use playbot_harness::foreign::ForeignGame;

    #[test]
    fn a_game_of_one_level_has_no_second_one() {
        let game = || ForeignGame::new("walk", 1, |_: &mut App| {});
        assert!(has_second_level(&game(), "default"), "endless levels");
        assert!(has_second_level(&game().levels(2), "default"));
        assert!(!has_second_level(&game().levels(1), "default"));
        assert!(!has_second_level(&game(), "files:no/such/*.json"), "there are no files");
    }
}
