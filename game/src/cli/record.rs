//! `playbot record`.

use std::path::PathBuf;

use bevy_playbot::{
    demo::{
        file::{DemoHeader, DemoWriter},
        recorder::{Recorder, Recording, demo_actions, flush_unfinished},
    },
    game::{Game, build_world},
    prelude::*,
};

use super::{
    error::{CliError, Outcome},
    interrupt, progress,
    recording::Existing,
};
use crate::registry;

/// Records the game's demonstrator: a bot that plans, with some of its actions replaced by random ones.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot record coinrun --levels hard:0..9 --out my.demo
  playbot record coinrun --levels easy:0..499 --noise 0.2 --steps 100000 --out demos/coinrun/easy.demo")]
pub struct Args {
    /// Name of the game.
    game: String,
    /// Levels, as mode:first..last, both included; played in order, again and again until --steps is reached.
    #[arg(long, default_value = "easy:0..499")]
    levels: LevelSplit,
    /// File to write.
    #[arg(long)]
    out: PathBuf,
    /// Probability with which an action is replaced by a uniformly random one.
    #[arg(long, default_value_t = 0.0)]
    noise: f64,
    /// Stop after exactly this many steps; without it, after one round of the levels.
    #[arg(long)]
    steps: Option<u64>,
    /// Seed of the noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Keep the observation vectors too (larger; not needed, since replaying brings them back).
    #[arg(long)]
    observations: bool,
    #[command(flatten)]
    existing: Existing,
}

pub fn run(args: Args) -> Result<Outcome, CliError> {
    let game = registry::game(&args.game)?;
    game.check_mode(&args.levels.mode)?;
    if !(0.0..=1.0).contains(&args.noise) {
        return Err(CliError::Usage(format!("--noise is {}; a probability lies between 0 and 1", args.noise)));
    }
    if args.steps == Some(0) {
        return Err(CliError::Usage("--steps is 0: a recording has at least one step".to_owned()));
    }
    let writer = open_writer(game, &args)?;
    let (mut world, agents) = build_world(game, &args.levels.mode, args.seed, 0, 1);
    let agent = agents[0];
    game.arm_demonstrator(&mut world, agent, args.noise);
    let mut recorder = Recorder::new(writer);
    if let Some(steps) = args.steps {
        recorder = recorder.with_step_limit(steps);
    }
    world.insert_resource(recorder);
    world.entity_mut(agent).insert((Control::Bot, Recording::default(), queue(&args)));
    play(&mut world, agent, &args)?;
    let (episodes, steps) = (world.resource::<Recorder>().episodes(), world.resource::<Recorder>().steps());
    let count = *world.get::<EpisodeCount>(agent).expect("required by Agent");
    let share = 100.0 * count.successes as f64 / count.finished.max(1) as f64;
    eprintln!("{}: {episodes} episodes, {steps} steps, {share:.1} % reached the goal", args.out.display());
    Ok(Outcome::Pass)
}

fn open_writer(game: &dyn Game, args: &Args) -> Result<DemoWriter, CliError> {
    let mut header =
        DemoHeader::new(game.name(), game.version(), &args.levels.mode, game.tick_hz(), demo_actions(&game.actions()));
    header.demonstrator = game.demonstrator().unwrap_or("none").to_owned();
    header.action_noise = args.noise;
    if args.observations {
        header.observation_names = game.observation().names;
    }
    args.existing.open(&args.out, header)
}

/// One round of the levels, or as many rounds as the steps can need: every level takes at least one step.
fn queue(args: &Args) -> LevelQueue {
    let rounds = args.steps.map_or(1, |steps| steps.div_ceil(args.levels.len()));
    LevelQueue::list((0..rounds).flat_map(|_| args.levels.levels()).collect::<Vec<_>>())
}

fn play(world: &mut bevy::prelude::World, agent: bevy::prelude::Entity, args: &Args) -> Result<(), CliError> {
    interrupt::listen();
    let (length, unit) = args.steps.map_or((args.levels.len(), "levels"), |steps| (steps, "steps"));
    let bar = progress::bar("record", length, unit);
    loop {
        world.tick()?;
        let recorder = world.resource::<Recorder>();
        let done = if args.steps.is_some() { recorder.steps() } else { recorder.episodes() };
        bar.set_position(done);
        let idle = !world.get::<Control>(agent).is_some_and(|control| control.is_active());
        if idle || args.steps.is_some_and(|steps| done >= steps) || interrupt::asked() {
            break;
        }
    }
    bar.finish_and_clear();
    flush_unfinished(world)?;
    Ok(())
}
