//! Measurement of `playbot diagnose`: plants faults into trainings of several games, trains each briefly, diagnoses it, and
//! counts how often the true cause is among the first two findings, and how many sound trainings get a warning:
//!
//! ```sh
//! cargo run --release -p playbot_tests --example planted -- --seed 1 --count 30 --healthy 30 --out planted
//! ```
//!
//! `--only "each tick pays"` leaves the faults of this name alone, on every game.
#![allow(clippy::print_stdout, reason = "it prints what it does")]

use std::{
    collections::BTreeMap,
    env, fs,
    path::{Path, PathBuf},
    process::ExitCode,
    sync::Arc,
    time::Instant,
};

use bevy_playbot::demo::file::DemoWriter;
use playbot::prelude::*;
use playbot_games::GAMES;
use playbot_harness::{demo::demonstration::DemonstrationPlan, eval::Player, game::idle_action, split::LevelSplit};
use playbot_learner::{DeviceKind, SkillModel, Streams, rng::shuffle};
use playbot_tests::{
    Corridor,
    foreign::catch::catch_game,
    planted::{PLANTED_FAULTS, PlantedFault, PlantedGame, RuleFault, Taken},
};
use playbot_train::{
    Experiment,
    diagnose::{
        Diagnosis, Evidence, Gathering, diagnose, of_game, of_run,
        play::{Played, PlayedEpisode},
    },
    experiment::file::parse_experiment,
    pipeline,
    run_observer::Unobserved,
    train_run::TrainingSetup,
};

type Failure = Box<dyn std::error::Error>;

/// A game with its sound training.
struct Ground {
    name: &'static str,
    game: Arc<dyn Game>,
    /// Levels to train on, to hold out and to record.
    levels: [&'static str; 3],
    noise: f64,
    arenas: u32,
    worlds: u32,
    steps: u64,
    /// Actions that lead to the goal.
    needed: Vec<u32>,
    /// A time limit that is too short.
    cut: u32,
    /// Pay for each tick that makes waiting worth more than winning; `None` where lasting is the goal.
    tick_pay: Option<u16>,
}

/// A game of the program, which lives as long as the program.
struct OfProgram(&'static dyn Game);

impl Game for OfProgram {
    fn name(&self) -> &'static str {
        self.0.name()
    }

    fn version(&self) -> u32 {
        self.0.version()
    }

    fn modes(&self) -> &'static [&'static str] {
        self.0.modes()
    }

    fn tick_hz(&self) -> f64 {
        self.0.tick_hz()
    }

    fn actions(&self) -> ActionSpace {
        self.0.actions()
    }

    fn observation(&self) -> ObservationSpace {
        self.0.observation()
    }

    fn build(&self, app: &mut bevy::prelude::App, mode: &str) {
        self.0.build(app, mode);
    }

    fn spawn_agent(&self, world: &mut bevy::prelude::World, index: u32) -> bevy::prelude::Entity {
        self.0.spawn_agent(world, index)
    }

    fn tools(&self) -> playbot_harness::game::GameTools<'_> {
        self.0.tools()
    }
}

fn grounds() -> Vec<Ground> {
    let own = |number: usize| Arc::new(OfProgram(GAMES[number])) as Arc<dyn Game>;
    vec![
        Ground {
            name: "coinrun",
            game: own(0),
            levels: ["easy:0..63", "easy:64..95", "easy:100..149"],
            noise: 0.1,
            arenas: 16,
            worlds: 2,
            steps: 8192,
            needed: vec![7, 8],
            cut: 8,
            tick_pay: Some(1),
        },
        Ground {
            name: "maze2d",
            game: own(1),
            levels: [
                "umaze+sparse+end-at-goal+limit=300:0..63",
                "umaze+sparse+end-at-goal+limit=300:64..95",
                "umaze+sparse+end-at-goal+limit=300:100..149",
            ],
            noise: 0.3,
            arenas: 16,
            worlds: 2,
            steps: 8192,
            needed: Vec::new(),
            cut: 4,
            tick_pay: Some(1),
        },
        Ground {
            name: "maze2d-rays",
            game: own(2),
            levels: [
                "medium+sparse+end-at-goal+limit=600:0..63",
                "medium+sparse+end-at-goal+limit=600:64..95",
                "medium+sparse+end-at-goal+limit=600:100..129",
            ],
            noise: 0.3,
            arenas: 16,
            worlds: 2,
            steps: 8192,
            needed: Vec::new(),
            cut: 4,
            tick_pay: Some(1),
        },
        Ground {
            name: "antmaze",
            game: own(6),
            levels: ["umaze:0..63", "umaze:64..95", "umaze:100..115"],
            noise: 0.1,
            arenas: 8,
            worlds: 2,
            steps: 3072,
            needed: Vec::new(),
            cut: 5,
            tick_pay: Some(20),
        },
        Ground {
            name: "corridor",
            game: Arc::new(Corridor),
            levels: ["plain:0..31", "plain:32..63", "plain:64..95"],
            noise: 0.0,
            arenas: 16,
            worlds: 1,
            steps: 8192,
            needed: vec![1],
            cut: 2,
            tick_pay: Some(1),
        },
        Ground {
            name: "catch",
            game: Arc::new(catch_game()),
            levels: ["default:1..64", "default:65..96", "default:100..111"],
            noise: 0.1,
            arenas: 4,
            worlds: 4,
            steps: 4096,
            needed: vec![2, 1],
            cut: 20,
            tick_pay: None,
        },
    ]
}

impl Ground {
    fn has_demonstrator(&self) -> bool {
        self.game.tools().bots.demonstrator().is_some()
    }

    fn is_discrete(&self) -> bool {
        matches!(self.game.actions(), ActionSpace::Discrete(_))
    }

    /// Returns whether a fault can be planted here.
    fn takes(&self, fault: &PlantedFault) -> bool {
        let needs_demos = fault.algorithms.contains(&"score-ppo") || fault.needs_demonstrator;
        let swaps = fault.rule == RuleFault::SwappedActions && self.is_discrete() && self.needed.len() < 2;
        let has_all = self.has_demonstrator() || !needs_demos;
        let is_harmless = matches!(fault.rule, RuleFault::TickPay(_)) && self.tick_pay.is_none();
        has_all && (self.is_discrete() || !fault.is_discrete) && !swaps && !is_harmless
    }

    fn experiment(&self, algorithm: &str, demos: &Path, seed: u64) -> Result<Experiment, Failure> {
        let [train, test, _] = self.levels;
        let (game, demos) = (self.game.name(), demos.display());
        let (arenas, worlds, steps) = (self.arenas, self.worlds, self.steps);
        let text = format!(
            r#"(game: "{game}", train: "{train}", test: "{test}", demos: "{demos}", algorithm: "{algorithm}", seed: {seed},
            steps: {steps}, arenas: {arenas}, worlds: {worlds},
            skills: (window: 8, epochs: 3, batch: 64, lr: 0.001, hidden: [64, 64], encoder_hidden: 32, gru_hidden: 32, norm_obs: true),
            ppo: (num_steps: 64, minibatches: 4, epochs: 3, hidden: [64, 64], gamma: 0.995))"#
        );
        Ok(parse_experiment(&text, Path::new("planted.ron"))?)
    }

    /// Records the game, once for each kind of recordings.
    fn record(&self, taken: Taken, out: &Path) -> Result<PathBuf, Failure> {
        let path = out.join(format!("{}-{taken:?}.demo", self.name));
        if path.exists() {
            return Ok(path);
        }
        let levels: LevelSplit = self.levels[2].parse()?;
        let noise = if taken == Taken::Demonstrator { self.noise } else { 0.0 };
        let plan = DemonstrationPlan {
            mode: levels.mode.clone(),
            levels: levels.levels().collect(),
            noise,
            seed: 1,
            steps: Some(6000),
            keep_observations: true,
            randomise: playbot_harness::randomise::Randomise::default(),
        };
        let writer = DemoWriter::create(&path, plan.header(&*self.game))?;
        let player = match taken {
            Taken::Demonstrator => None,
            Taken::Idle => Some(Player::Blind(BlindBot::Constant(idle_action(&*self.game)))),
            Taken::Random => Some(Player::Blind(BlindBot::Uniform)),
        };
        let observation = Default::default();
        let (mut world, agent) = match &player {
            None => plan.build_world(&*self.game, writer),
            Some(player) => plan.build_world_of(&*self.game, player, &observation, writer)?,
        };
        while Control::of(&world, agent).is_active() && world.resource::<Recorder>().steps() < 6000 {
            world.tick()?;
        }
        drop(world);
        Ok(path)
    }
}

/// One training.
struct Case<'a> {
    ground: &'a Ground,
    fault: Option<&'a PlantedFault>,
    algorithm: &'static str,
    seed: u64,
}

struct Bench {
    out: PathBuf,
    skills: BTreeMap<(String, Taken, bool), (PathBuf, SkillModel)>,
}

impl Bench {
    /// Trains and diagnoses. Returns the evidence, the diagnosis and the seconds that it took.
    fn measure(&mut self, number: usize, case: &Case<'_>) -> Result<(Evidence, Diagnosis, f64), Failure> {
        let Case { ground, fault, algorithm, seed } = *case;
        let rule = match fault.map_or(RuleFault::None, |fault| fault.rule) {
            RuleFault::CutOff(_) => RuleFault::CutOff(ground.cut),
            RuleFault::TickPay(_) => RuleFault::TickPay(ground.tick_pay.unwrap_or_default()),
            rule => rule,
        };
        let planted = PlantedGame { game: ground.game.clone(), fault: rule, needed: ground.needed.clone() };
        let taken = fault.map_or(Taken::Demonstrator, |fault| fault.taken);
        let has_demos = ground.has_demonstrator();
        let demos = if has_demos { ground.record(taken, &self.out)? } else { PathBuf::from("none.demo") };
        let sets = fault.map_or(&[][..], |fault| fault.settings);
        let is_score = algorithm == "score-ppo";
        let sets: Vec<&str> = sets.iter().copied().filter(|set| is_score || !set.starts_with("score.")).collect();
        let experiment = ground.experiment(algorithm, &demos, seed)?.with_set(&sets)?;
        let setup = TrainingSetup::new(DeviceKind::Flex, 1);
        let key = (ground.name.to_owned(), taken, experiment.skills.norm_obs);
        if is_score && !self.skills.contains_key(&key) {
            let file = self.out.join(format!("{}-{taken:?}-{}.safetensors", key.0, key.2));
            let model = pipeline::learn_skills(&*ground.game, &experiment, &file, &setup, &mut Unobserved)?;
            self.skills.insert(key.clone(), (file, model));
        }
        let skills = self.skills.get(&key).filter(|_| is_score);
        let run = self.out.join(format!("run-{number}"));
        let named = skills.map(|(file, model)| (file.as_path(), model));
        let trained = pipeline::train(&planted, &experiment, named, &run, &setup, &mut Unobserved);
        let start = Instant::now();
        let recordings = Path::to_path_buf;
        let gathering = Gathering {
            replays: true,
            threads: 2,
            device: DeviceKind::Flex,
            progress: &|_| {},
            recordings: &recordings,
        };
        let model = skills.map(|(_, model)| model);
        let evidence = match trained {
            Ok(_) => of_run(&planted, &run, model, &gathering)?,
            Err(error) => {
                println!("    the training broke off: {error}");
                match run.join("run.json").exists() {
                    true => of_run(&planted, &run, model, &gathering)?,
                    false => of_game(&planted, &experiment, model, &gathering)?,
                }
            }
        };
        let diagnosis = diagnose(&evidence);
        Ok((evidence, diagnosis, start.elapsed().as_secs_f64()))
    }
}

struct Options {
    seed: u64,
    count: usize,
    healthy: usize,
    out: PathBuf,
    /// The only fault to plant.
    only: Option<String>,
}

impl Options {
    fn read() -> Result<Self, String> {
        let mut options = Self { seed: 1, count: 30, healthy: 30, out: "planted".into(), only: None };
        let mut words = env::args().skip(1);
        while let Some(word) = words.next() {
            let value = words.next().ok_or(format!("{word} needs a value"))?;
            let number = || value.parse::<u64>().map_err(|_| format!("`{word} {value}`: write a number"));
            match word.as_str() {
                "--seed" => options.seed = number()?,
                "--count" => options.count = number()? as usize,
                "--healthy" => options.healthy = number()? as usize,
                "--out" => options.out = value.into(),
                "--only" => options.only = Some(value),
                _ => {
                    let known = "--seed, --count, --healthy, --out and --only";
                    return Err(format!("unknown option {word}: there are {known}"));
                }
            }
        }
        Ok(options)
    }
}

fn main() -> ExitCode {
    match Options::read().map_err(Failure::from).and_then(|options| run(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            println!("{error}");
            ExitCode::from(2)
        }
    }
}

/// Draws cases without repetition: set-ups of faults and games, or sound trainings.
fn drawn<T: Copy>(all: &[T], count: usize, seed: u64, name: &str) -> Vec<T> {
    let mut order: Vec<usize> = (0..all.len()).collect();
    shuffle(&mut order, &mut Streams::new(seed).stream(name, 0));
    order.into_iter().take(count).map(|at| all[at]).collect()
}

fn run(options: &Options) -> Result<(), Failure> {
    fs::create_dir_all(&options.out)?;
    let grounds = grounds();
    let mut bench = Bench { out: options.out.clone(), skills: BTreeMap::new() };
    let faults = || PLANTED_FAULTS.iter().filter(|fault| options.only.as_deref().is_none_or(|only| only == fault.name));
    let pairs = grounds
        .iter()
        .flat_map(|ground| faults().filter(|fault| ground.takes(fault)).map(move |fault| (ground, fault)));
    let pairs = drawn(&pairs.collect::<Vec<_>>(), options.count, options.seed, "planted");
    let (mut hits, mut slowest, mut planted) = (0, 0.0_f64, 0);
    for (number, (ground, fault)) in pairs.into_iter().enumerate() {
        let can_score = ground.has_demonstrator() && (number % 2 == 0 || !fault.algorithms.is_empty());
        let algorithm = if can_score { "score-ppo" } else { "ppo" };
        let case = Case { ground, fault: Some(fault), algorithm, seed: options.seed + number as u64 };
        let (evidence, diagnosis, seconds) = bench.measure(number, &case)?;
        let signs: Vec<_> = diagnosis.findings.iter().map(|finding| finding.sign).collect();
        let is_hit = signs.iter().take(2).any(|sign| fault.signs.contains(sign));
        (hits, planted, slowest) = (hits + usize::from(is_hit), planted + 1, slowest.max(seconds));
        let names: Vec<&str> = signs.iter().map(|sign| sign.name()).collect();
        let mark = if is_hit { "hit " } else { "MISS" };
        println!("{mark} | {} | {} | {algorithm} | {} | {seconds:.1} s", ground.name, fault.name, names.join(", "));
        if !is_hit {
            println!("{diagnosis}");
            for Played { seat, episodes, .. } in &evidence.played {
                let of = |episode: &PlayedEpisode| (episode.ticks(), episode.total(), episode.end, episode.success);
                println!("    {}: {:?}", seat.name(), episodes.iter().map(of).collect::<Vec<_>>());
            }
        }
    }
    let sound = grounds.iter().flat_map(|ground| (0..6).map(move |round| (ground, round)));
    let sound = drawn(&sound.collect::<Vec<_>>(), options.healthy, options.seed, "sound");
    let (mut warned, mut healthy) = (0, 0);
    for (number, (ground, round)) in sound.into_iter().enumerate() {
        let algorithm = if ground.has_demonstrator() && round % 2 == 0 { "score-ppo" } else { "ppo" };
        let case = Case { ground, fault: None, algorithm, seed: options.seed + 100 + round };
        let (_, diagnosis, seconds) = bench.measure(1000 + number, &case)?;
        (warned, healthy) = (warned + usize::from(!diagnosis.is_healthy()), healthy + 1);
        slowest = slowest.max(seconds);
        let names: Vec<&str> = diagnosis.findings.iter().map(|finding| finding.sign.name()).collect();
        let mark = if diagnosis.is_healthy() { "quiet  " } else { "WARNING" };
        println!("{mark} | {} | {algorithm} | {} | {seconds:.1} s", ground.name, names.join(", "));
        if !diagnosis.is_healthy() {
            println!("{diagnosis}");
        }
    }
    println!("{hits} of {planted} planted faults have their cause among the first two findings");
    println!("{warned} of {healthy} sound trainings have a warning");
    println!("the slowest diagnosis with replays took {slowest:.1} s");
    Ok(())
}
