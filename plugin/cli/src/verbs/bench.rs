//! `playbot bench`: steps per second of the whole and microseconds of its parts.

use crate::{
    arguments::{Device, MOST_THREADS, check_start, experiment::ExperimentArgs, finite_number},
    error::{CliError, Outcome},
    output::print_line,
};
use bevy::prelude::World;
use bevy_playbot::{
    placement::TickPlacement,
    vision::{ObservationConfig, ObservationKind, VisionError},
};
use playbot_harness::{
    benchmark::{Benchmark, StageClock},
    game::{Game, idle_action},
    games::Games,
    parallel::{default_threads, on_threads},
    prelude::*,
    split::LevelSplit,
    worlds::{Arrangement, build_bare_world, build_observing_world, is_bound_to_its_thread, run_bare},
};
use playbot_learner::waited;
use playbot_report::counted;
use playbot_train::{Timing, Trainer};
use serde_json::{Value, json};
use std::time::Instant;

/// Measure speed.
///
/// Numbers hold for this machine and this moment. Nothing is tested. The parts of a step are measured by the clock, for
/// all threads together. Idle is the share of the threads' time in which this program did not compute: it waited, or
/// other programs had the cores. The phases of an update follow one another: Worlds play, their parts are joined,
/// minibatches are gathered, networks compute products, and the optimiser steps. `sim/` cases play random actions, `train/`
/// cases learn. `bare/` cases run frames of a game with an adapter alone, and `still/` cases with agents that do nothing: the
/// difference is what playbot adds.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot bench --list
  playbot bench GAME
  playbot bench --json
  playbot bench --case sim/GAME --threads 1
  playbot bench --case train/GAME/raster --seconds 20 --set 'ppo.cnn=Impala()' --set ppo.num_steps=256")]
pub struct Args {
    /// Name of the game whose cases are measured (default: all games of the program).
    game: Option<String>,
    /// Measure only cases whose name contains this.
    #[arg(long, default_value = "")]
    case: String,
    /// Arenas.
    #[arg(long, default_value_t = 64)]
    arenas: u32,
    /// Threads. Each has a World of its own, and all learn together.
    #[arg(long, default_value_t = threads_of_cases())]
    pub(crate) threads: usize,
    /// Least seconds to measure each case for.
    #[arg(long, default_value_t = 5.0, value_parser = finite_number)]
    seconds: f64,
    /// Change a setting of the training cases, such as ppo.cnn=Impala() (repeatable).
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    device: Device,
    /// One line of JSON per case.
    #[arg(long)]
    json: bool,
    /// List the cases and measure nothing.
    #[arg(long)]
    list: bool,
}

/// Ticks of each World between two looks at the clock.
const TICKS: u64 = 100;

/// Returns the largest power of two that the cores and the default 64 arenas allow.
fn threads_of_cases() -> usize {
    1 << default_threads().min(64).ilog2()
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    if args.seconds <= 0.0 {
        return Err(CliError::Usage("--seconds must be more than 0".to_owned()));
    }
    let (arenas, threads) = (args.arenas, args.threads);
    if arenas == 0 || threads == 0 {
        let which = if arenas == 0 { "--arenas" } else { "--threads" };
        return Err(CliError::Usage(format!("{which} must be at least 1")));
    }
    if threads > MOST_THREADS {
        return Err(CliError::Usage(format!("--threads must be at most {MOST_THREADS}")));
    }
    if !(arenas as usize).is_multiple_of(threads) {
        return Err(CliError::Usage(format!(
            "each thread has a World with as many arenas: {arenas} arenas cannot be shared by {threads} threads; try \
             `--arenas {}`",
            (arenas as usize).next_multiple_of(threads)
        )));
    }
    let all = cases_of(&args, games)?;
    let wanted: Vec<_> = all.iter().filter(|case| case.name.contains(&args.case)).collect();
    if wanted.is_empty() {
        let names: Vec<_> = all.iter().map(|case| case.name.as_str()).collect();
        return Err(CliError::Usage(match &args.game {
            Some(game) if names.is_empty() => format!("`{game}` has no cases: name another game"),
            _ => format!("no case has `{}` in its name; cases: {}", args.case, names.join(", ")),
        }));
    }
    if args.list {
        let line = |case: &&&Case| if args.json { json!({ "case": case.name }).to_string() } else { case.name.clone() };
        return wanted.iter().try_for_each(|case| print_line(line(&case))).map(|()| Outcome::Pass);
    }
    for (number, Case { name, game, benchmark, measure }) in wanted.iter().enumerate() {
        check_start(*game, benchmark.mode, 0)?;
        report!("{name}: case {} of {}, {} s at least", number + 1, wanted.len(), args.seconds);
        let measured = match measure(*game, benchmark.mode, benchmark.observation, &args, games) {
            Err(error) if args.case.is_empty() && error.is::<VisionError>() => {
                report!("{name}: {error}");
                continue;
            }
            measured => measured?,
        };
        if args.json {
            print_line(measured.to_json(name, &args))?;
        } else {
            print_line(format!(
                "{name}: {:.0} steps/s with {} on {}{}; peak memory {:.0} MiB; in a step {}",
                measured.steps_per_s,
                counted(u64::from(args.arenas), "arena"),
                counted(args.threads as u64, "thread"),
                measured.idle.map_or(String::new(), |idle| format!(", {:.0} % idle", 100.0 * idle)),
                peak_rss_mib(),
                measured.parts_in_words()
            ))?;
        }
    }
    Ok(Outcome::Pass)
}

/// One measurement.
struct Case<'a> {
    name: String,
    /// Game to play.
    game: &'a dyn Game,
    /// Mode and observation to play it with.
    benchmark: Benchmark,
    measure: Measuring,
}

/// Measures a case: the game, the mode, what agents see, the command line and the program's games.
type Measuring = fn(&dyn Game, &str, ObservationKind, &Args, &Games) -> Result<Measure, CliError>;

/// Returns the measurements of the named game, or of all.
fn cases_of<'a>(args: &Args, games: &'a Games) -> Result<Vec<Case<'a>>, CliError> {
    let all = || games.iter().flat_map(cases);
    let Some(name) = &args.game else { return Ok(all().collect()) };
    games.get(name).map(cases).map_err(|error| {
        let is_case = all().any(|case| case.name.contains(name.as_str()));
        let advice =
            if is_case { format!("`playbot bench --case {name}`") } else { "`playbot bench --list`".to_owned() };
        let what = if is_case { "measures the cases with it in their names" } else { "lists the cases of all games" };
        CliError::Usage(format!("{error}; {advice} {what}"))
    })
}

/// Returns the measurements of a game.
fn cases(game: &dyn Game) -> Vec<Case<'_>> {
    let tools = game.tools().benchmarks;
    let of = |benchmark: Benchmark| Case {
        name: benchmark.name(game.name()),
        game: tools.benchmarked(&benchmark).unwrap_or(game),
        measure: if benchmark.train { train } else { simulate },
        benchmark,
    };
    let vector = |mode| vec![Benchmark::simulate("vector", mode), Benchmark::train("vector", mode)];
    let default = || game.modes().first().copied().map_or_else(Vec::new, vector);
    let mut cases: Vec<_> = tools.benchmarks().unwrap_or_else(default).into_iter().map(of).collect();
    if let (Some(mode), TickPlacement::Frame) = (game.modes().first(), game.tools().host.placement()) {
        let benchmark = Benchmark::simulate("bare", mode);
        let case = |kind, measure| Case { name: format!("{kind}/{}", game.name()), game, benchmark, measure };
        cases.splice(..0, [case("bare", bare as Measuring), case("still", still)]);
    }
    cases
}

struct Measure {
    steps_per_s: f64,
    /// Microseconds per step of the parts, over all threads together.
    parts: Value,
    /// Share of the threads' time in which they did nothing. `None` where the system does not report it.
    idle: Option<f64>,
    /// An update of training.
    update: Option<Update>,
}

/// The mean of updates, by the clock.
struct Update {
    /// Milliseconds of each phase, one after the other.
    phases: serde_json::Map<String, Value>,
    /// Share of an update in which one thread worked, at most.
    alone: f64,
}

impl Measure {
    fn to_json(&self, case: &str, args: &Args) -> Value {
        json!({
            "case": case, "arenas": args.arenas, "threads": args.threads, "steps_per_s": self.steps_per_s.round(),
            "peak_rss_mib": peak_rss_mib(), "us_per_step": self.parts, "idle_share": self.idle,
            "ms_per_update": self.update.as_ref().map(|update| &update.phases),
            "alone_share": self.update.as_ref().map(|update| update.alone),
            "seconds": args.seconds, "device": args.device.device.to_string(), "set": args.set,
            "version": env!("CARGO_PKG_VERSION"),
        })
    }

    /// Returns the parts in the order in which they happen.
    fn parts_in_words(&self) -> String {
        let part = |name: &&str| Some(format!("{name} {} µs", self.parts.get(*name)?.as_f64()?));
        let mut parts = ["simulate", "observe", "infer", "record", "gather", "learn"]
            .iter()
            .filter_map(part)
            .collect::<Vec<_>>()
            .join(", ");
        if let Some(Update { phases, alone }) = &self.update {
            let phase = |name: &&str| Some(format!("{name} {} ms", phases.get(*name)?.as_f64()?));
            let phases: Vec<_> =
                ["play", "join", "gather", "products", "optimise", "rest"].iter().filter_map(phase).collect();
            parts += &format!("; in an update {}, {:.1} % on one thread", phases.join(", "), 100.0 * alone);
        }
        parts
    }
}

/// Measures frames of the game alone, without agents and without playbot, in as many Worlds as there are arenas.
fn bare(game: &dyn Game, _: &str, _: ObservationKind, args: &Args, _: &Games) -> Result<Measure, CliError> {
    let mut worlds: Vec<_> = (0..args.arenas).filter_map(|_| build_bare_world(game)).collect();
    let threads = if worlds.iter().any(is_bound_to_its_thread) { 1 } else { args.threads };
    let mut advance = || {
        on_threads(&mut worlds, threads, |world| run_bare(world, TICKS));
        Ok(())
    };
    // The game starts.
    advance()?;
    let Advanced { ticks, seconds, idle } = advance_for(args, advance)?;
    let steps = (ticks * u64::from(args.arenas)) as f64;
    let parts = json!({ "simulate": microseconds(seconds * threads as f64, steps) });
    Ok(Measure { steps_per_s: steps / seconds, parts, idle, update: None })
}

/// Measures agents that do nothing on the first level. The game's frames are those of [`bare`] until an episode ends: what
/// they take more is playbot's.
fn still(game: &dyn Game, mode: &str, kind: ObservationKind, args: &Args, _: &Games) -> Result<Measure, CliError> {
    play(game, mode, kind, args, BlindBot::Constant(idle_action(game)), 0)
}

/// Measures random actions on up to 64 levels, with observations filled every tick.
fn simulate(game: &dyn Game, mode: &str, kind: ObservationKind, args: &Args, _: &Games) -> Result<Measure, CliError> {
    play(game, mode, kind, args, BlindBot::Uniform, 63)
}

/// Measures a bot on the levels up to `last`.
fn play(
    game: &dyn Game,
    mode: &str,
    kind: ObservationKind,
    args: &Args,
    bot: BlindBot,
    last: u64,
) -> Result<Measure, CliError> {
    let observation_config = ObservationConfig { kind, ..ObservationConfig::default() };
    let arrangement = Arrangement::new(game, args.arenas, args.threads as u32);
    let levels = LevelSplit { mode: mode.to_owned(), first: 0, last }.within(game);
    let mut worlds = Vec::new();
    for first in arrangement.first_agents() {
        let (mut world, agents) = build_observing_world(game, mode, &observation_config, 1, first, arrangement.arenas)?;
        for agent in agents {
            let queue = LevelQueue::Uniform { first: levels.first, last: levels.last };
            world.entity_mut(agent).insert((Control::Bot, bot.clone(), queue));
        }
        worlds.push(world);
    }
    if observation_config.is_image() {
        // The first pictures are late: shaders and textures are prepared.
        worlds.iter_mut().try_for_each(|world| world.ticks(10))?;
    }
    // Agents that do nothing are there to be compared with frames in which no clock is read, either.
    let has_stages = matches!(bot, BlindBot::Uniform);
    if has_stages {
        worlds.iter_mut().for_each(|world| world.insert_resource(StageClock::default()));
    }
    let threads = if worlds.iter().any(is_bound_to_its_thread) { 1 } else { args.threads };
    let Advanced { ticks, seconds, idle } = advance_for(args, || {
        on_threads(&mut worlds, threads, |world| world.ticks(TICKS)).into_iter().collect::<Result<(), _>>()?;
        Ok(())
    })?;
    let steps = (ticks * u64::from(arrangement.total())) as f64;
    let parts = match has_stages {
        true => stages(worlds.iter_mut(), steps),
        false => json!({ "simulate": microseconds(seconds * threads as f64, steps) }),
    };
    Ok(Measure { steps_per_s: steps / seconds, parts, idle, update: None })
}

/// Ticks of each World, and what they took.
struct Advanced {
    ticks: u64,
    seconds: f64,
    /// Share of the threads' time in which they did nothing.
    idle: Option<f64>,
}

/// Advances Worlds by [`TICKS`] again and again, until the time of a case is over. At least once, so that a busy machine has
/// a figure as well.
fn advance_for(args: &Args, mut advance: impl FnMut() -> Result<(), CliError>) -> Result<Advanced, CliError> {
    let (start, mut ticks, busy) = (Instant::now(), 0, busy_s());
    while ticks == 0 || start.elapsed().as_secs_f64() < args.seconds {
        advance()?;
        ticks += TICKS;
    }
    let seconds = start.elapsed().as_secs_f64();
    Ok(Advanced { ticks, seconds, idle: idle_share(busy_s() - busy, seconds, args.threads) })
}

/// Measures PPO with 3 epochs and 8 minibatches. State vectors take 256 steps a rollout, pictures 32 and the
/// Nature-CNN, unless `--set` changes that.
fn train(game: &dyn Game, mode: &str, kind: ObservationKind, args: &Args, games: &Games) -> Result<Measure, CliError> {
    let experiment = training(game, mode, kind, args).load(games, [])?;
    let mut trainer = Trainer::new(game, &experiment, None, args.device.device, args.threads)?;
    trainer.update()?;
    trainer.worlds_mut().for_each(|world| world.insert_resource(StageClock::default()));
    let (start, before, busy) = (Instant::now(), trainer.steps(), busy_s());
    let mut timings = Vec::new();
    while trainer.steps() == before || start.elapsed().as_secs_f64() < args.seconds {
        timings.push(trainer.update()?.timing);
    }
    let steps = (trainer.steps() - before) as f64;
    let seconds = start.elapsed().as_secs_f64();
    let sum = |of: fn(&Timing) -> f64| timings.iter().map(of).sum::<f64>();
    let (gather_s, learn_s) = (sum(|timing| timing.gather_s), sum(|timing| timing.learn_s));
    let mut parts = stages(trainer.worlds_mut(), steps);
    parts["gather"] = json!(microseconds(gather_s * args.threads as f64, steps));
    parts["learn"] = json!(microseconds((learn_s - gather_s) * args.threads as f64, steps));
    let seconds_of = |(tag, _): (&'static str, f64)| {
        let of_tag = |timing: &Timing| timing.scalars().into_iter().find(|(of, _)| *of == tag).map_or(0.0, |(_, s)| s);
        let name = tag.trim_start_matches("time/").trim_end_matches("_s").to_owned();
        (name, json!(milliseconds(timings.iter().map(of_tag).sum::<f64>() / timings.len() as f64)))
    };
    let phases = Timing::default().scalars().into_iter().filter(|(tag, _)| tag.ends_with("_s")).map(seconds_of);
    let (phases, alone) = (phases.collect(), sum(|timing| timing.alone_s) / sum(Timing::whole_s));
    let idle = idle_share(busy_s() - busy, seconds, args.threads);
    Ok(Measure {
        steps_per_s: steps / seconds,
        parts,
        idle,
        update: Some(Update { phases, alone: thousandths(alone) }),
    })
}

/// Returns the experiment of a training case: the settings of the case, overridden by the command line.
fn training(game: &dyn Game, mode: &str, kind: ObservationKind, args: &Args) -> ExperimentArgs {
    let config = ObservationConfig { kind, ..ObservationConfig::default() };
    let known = [
        format!("game={}", game.name()),
        format!("train={mode}:0..63"),
        format!("test={mode}:64..127"),
        format!("observation={kind:?}"),
        format!("arenas={}", args.arenas),
        format!("worlds={}", args.threads),
        "algorithm=ppo".to_owned(),
        format!("ppo.num_steps={}", if config.is_image() { 32 } else { 256 }),
        "ppo.cnn=Nature(feature:256)".to_owned(),
        "ppo.epochs=3".to_owned(),
        "ppo.minibatches=8".to_owned(),
    ];
    ExperimentArgs { set: args.set.clone(), ..Default::default() }.over(known)
}

/// Returns the microseconds per step that the Worlds' threads spent in each part of their ticks.
fn stages<'a>(worlds: impl Iterator<Item = &'a mut World>, steps: f64) -> Value {
    let mut sum = StageClock::default();
    for world in worlds {
        let clock = world.resource::<StageClock>();
        sum.simulate_s += clock.simulate_s;
        sum.observe_s += clock.observe_s;
        sum.infer_s += clock.infer_s;
        sum.record_s += clock.record_s;
    }
    json!({
        "simulate": microseconds(sum.simulate_s, steps), "observe": microseconds(sum.observe_s, steps),
        "infer": microseconds(sum.infer_s, steps), "record": microseconds(sum.record_s, steps),
    })
}

fn microseconds(seconds: f64, steps: f64) -> f64 {
    (1e8 * seconds / steps).round() / 100.0
}

fn milliseconds(seconds: f64) -> f64 {
    (1e5 * seconds).round() / 100.0
}

fn thousandths(share: f64) -> f64 {
    (1000.0 * share).round() / 1000.0
}

/// Returns the largest resident memory of this process so far, MiB; 0 where the system does not report it.
fn peak_rss_mib() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kib = line.and_then(|rest| rest.split_whitespace().next()?.parse::<f64>().ok());
    (kib.unwrap_or(0.0) / 1024.0).round()
}

/// Returns the seconds of processor time used so far, all threads together; 0 where the system does not report it.
/// Workers that wait awake use it for nothing.
fn busy_s() -> f64 {
    // A hundredth of a second on every Linux.
    const TICKS_PER_S: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // The name of the program, in brackets, may hold anything.
    let numbers = stat.rsplit(')').next().unwrap_or_default();
    let ticks: f64 = numbers.split_whitespace().skip(11).take(2).filter_map(|word| word.parse::<f64>().ok()).sum();
    (ticks / TICKS_PER_S - waited().as_secs_f64()).max(0.0)
}

fn idle_share(busy_s: f64, seconds: f64, threads: usize) -> Option<f64> {
    let share = 1.0 - busy_s / (seconds * threads as f64);
    (busy_s > 0.0).then_some(thousandths(share.max(0.0)))
}
