//! `playbot doctor`.

use std::time::Instant;

use playbot_lab::games::Games;
use playbot_lab::prelude::*;
use playbot_lab::{
    doctor::{DoctorOptions, examine},
    game::Game,
    split::check_level,
    worlds::build_world,
};

use super::{
    defaults::usual_mode,
    error::{CliError, Outcome, print_line},
    interrupt::{self, NothingToSave},
    number::at_least_one,
};

/// Check that a game plays the same when it is given the same actions, and find what differs.
///
/// Recording, replay, resume and training in many arenas rest on it. Copies of the game play the same random actions:
/// twice in one thread, with another wall clock, with more archetypes in the World, on two threads, two arenas in one
/// World against each alone, and the same level again after a restart. What differs first is named, with the tick and
/// what to do. That nothing was found holds for the ticks and the level that were played: more ticks and other levels say
/// more. Exit code 1 if something was found.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot doctor GAME
  playbot doctor GAME --ticks 10000 --seed 1
  playbot doctor maze2d --mode medium --ticks 1000 --json
  playbot doctor GAME --ignore HighScore")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Mode of the game; the one that `train` trains in if none is named.
    #[arg(long)]
    mode: Option<String>,
    /// Ticks that each comparison plays. More of them find what happens seldom or late.
    #[arg(long, default_value = "300", value_parser = at_least_one)]
    ticks: usize,
    /// Level to play, and seed of the actions.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Leave out components and resources whose type path contains this, such as a high score that is meant to last; may be
    /// given several times.
    #[arg(long, value_name = "TYPE")]
    ignore: Vec<String>,
    /// One line of JSON.
    #[arg(long)]
    json: bool,
}

/// Seconds for which the speed is measured.
const SPEED_SECONDS: f64 = 0.5;

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let game = games.get(&args.game)?;
    let mode = args.mode.unwrap_or_else(|| usual_mode(game).to_owned());
    check_level(game, &mode, args.seed)?;
    let options = DoctorOptions {
        ticks: u32::try_from(args.ticks).map_err(|_| CliError::Usage("--ticks has too many digits".to_owned()))?,
        seed: args.seed,
        ignored: args.ignore,
        ..DoctorOptions::new(mode)
    };
    interrupt::leave("nothing is kept of what was compared: call it again, or with fewer --ticks".to_owned());
    let examining = NothingToSave::listen();
    let mut report = examine(game, &options, |comparison| tell!("comparing: {}", comparison.describe()))?;
    let has_fault = report.comparisons.iter().any(|report| report.fault.is_some());
    if !has_fault {
        report.ticks_per_second = Some(speed(game, &options)?);
    }
    drop(examining);
    if args.json {
        let line = serde_json::to_string(&report)
            .map_err(|error| CliError::Io(format!("the report cannot be written as JSON: {error}")))?;
        print_line(line)?;
    } else {
        print_line(&report)?;
    }
    Ok(if report.is_healthy() { Outcome::Pass } else { Outcome::Findings })
}

/// Ticks per second of one arena under random actions, by the clock.
fn speed(game: &dyn Game, options: &DoctorOptions) -> Result<f64, CliError> {
    let (mut world, agents) = build_world(game, &options.mode, options.seed, 0, 1);
    for agent in agents {
        let queue = LevelQueue::Always(options.seed);
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
