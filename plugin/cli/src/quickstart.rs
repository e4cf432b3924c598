//! `playbot quickstart`: learn, train, test and report in one command.

mod first_success;
mod folder;
mod report;

use std::{path::PathBuf, time::Instant};

use bevy_playbot::policy::ActionDraw;
use playbot_lab::games::Games;
use playbot_lab::{
    eval::Player,
    game::Game,
    report::{statistics::steps_to_reach, to_text_table},
    runs::RunCurves,
    sealed_file::write_atomically,
    train::{
        Algorithm, Experiment,
        learn_skills::{cloning, learn},
        metrics_log::SUCCESS_RATE,
        recordings::read_dataset,
        train_run::{NewRun, Training, TrainingSetup},
    },
};
use playbot_learner::{Dataset, DeviceKind, SkillModel};
use serde_json::json;

use first_success::{FirstSuccess, headline, steps_of_seed};
use folder::{check_folder, take_folder};
use report::write_report;

use super::{
    compute::{Threads, revision},
    console::Console,
    error::{CliError, Outcome, print_line},
    experiment::{ExperimentArgs, option},
    interrupt, learn_skills, methods, open, program,
    train::tell_length,
};

/// Seeds for the steps to success.
const SEEDS: u64 = 3;

/// The file of the skill model.
const SKILLS: &str = "skills.safetensors";

/// Learn skills, train SCORE-PPO and PPO, test both on unseen levels, write a report.
///
/// Both train for the same number of steps on the experiment's training levels, with its recordings. Behaviour cloning
/// and the blind baselines are measured beside them, on levels that none of them has seen. The steps to success, at
/// which a method mostly succeeds, are measured with further seeds, which train only that long.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot
  playbot quickstart --json --run runs/another --seed 2

Needs recordings at the experiment's `demos` (default: demos/ and the name of the game). The verbs record and play make
them.")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// Folder for all output. The output of an earlier quickstart there is replaced.
    #[arg(long, default_value = "runs/quickstart")]
    run: PathBuf,
    /// Random seed, instead of the experiment's.
    #[arg(long)]
    seed: Option<u64>,
    /// Number of random seeds for the steps to success: that seed and those after it.
    #[arg(long, default_value_t = SEEDS, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Environment steps for each learner, instead of the experiment's.
    #[arg(long)]
    steps: Option<u64>,
    /// Passes over the recordings, instead of the experiment's.
    #[arg(long)]
    epochs: Option<usize>,
    #[command(flatten)]
    threads: Threads,
    /// One line of JSON per method instead of a table.
    #[arg(long)]
    json: bool,
}

impl Default for Args {
    fn default() -> Self {
        Self {
            from: ExperimentArgs::default(),
            run: "runs/quickstart".into(),
            seed: None,
            seeds: SEEDS,
            steps: None,
            epochs: None,
            threads: Threads::default(),
            json: false,
        }
    }
}

/// A training in the report.
struct Trained {
    algorithm: Algorithm,
    player: Player,
    curve: Vec<CurvePoint>,
    /// Steps until its success rate first reached the experiment's threshold.
    steps_to_threshold: Option<u64>,
    steps_per_s: f64,
    finished: bool,
}

struct CurvePoint {
    step: u64,
    episodic_return: f64,
    success_rate: f64,
}

pub fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let start = Instant::now();
    let experiment = read_experiment(&args, games)?;
    let game = open::game(games, &args.from, &experiment)?;
    let trained = Experiment { algorithm: Algorithm::ScorePpo, ..experiment.clone() };
    trained.check_levels(game)?;
    trained.check_memory(game)?;
    check_folder(&args.run)?;
    // Not later: without recordings no folder is made.
    let demos = args.from.recordings(&experiment, games)?;
    interrupt::leave(format!("nothing is saved yet: start again with `{} quickstart`", program::name()));
    let dataset = read_dataset(game, &experiment, &demos, args.threads.count(), &mut Console::default())?;
    let _lock = take_folder(&args.run)?;
    tell_length(&trained);
    let Some(skills) = skills(&experiment, dataset.clone(), &args)? else {
        tell!("stopped while learning skills; nothing was saved, start again with `{} quickstart`", program::name());
        return Ok(Outcome::Stopped);
    };
    let draw = if experiment.eval.greedy { ActionDraw::Greedy } else { ActionDraw::Sample };
    let mut trained = Vec::new();
    for algorithm in [Algorithm::ScorePpo, Algorithm::Ppo] {
        let one = train_one(game, &experiment, algorithm, &skills, &args, draw)?;
        let finished = one.finished;
        trained.push(one);
        if !finished {
            return Ok(stopped(&args, algorithm));
        }
    }
    let Some((seeds, first)) = first_success(game, &experiment, &trained, &dataset, &args)? else {
        tell!("stopped; {}", interrupt::remains());
        return Ok(Outcome::Stopped);
    };
    let mut players: Vec<_> = trained.iter().map(|one| (one.algorithm.name().to_owned(), one.player.clone())).collect();
    players.push(("bc".to_owned(), cloning(&skills, &experiment, draw)));
    players.extend(game.tools().bots.blind_bots().into_iter().map(|(name, bot)| (name.to_owned(), Player::Blind(bot))));
    let mut rows = Vec::new();
    for (name, player) in &players {
        let plan = experiment.eval_plan(&experiment.test, args.threads.count());
        let measured = methods::measure(game, name, player, &plan)?;
        if args.json {
            let mut line = json!(measured.summary);
            if let Some(one) = first.iter().find(|one| one.algorithm.name() == name) {
                line["steps_to_success"] = json!(one.steps);
            }
            print_line(line)?;
        }
        let mut row = measured.into_row();
        if let Some(one) = trained.iter().find(|one| one.algorithm.name() == name) {
            row.steps_per_s = Some(one.steps_per_s);
        }
        rows.push(row);
    }
    if !args.json {
        print_line(to_text_table(&rows))?;
    }
    let comparison = format!("{}; {}", headline(&first, &seeds, experiment.study.threshold), compare(&trained));
    tell!("{comparison}");
    let report = args.run.join("report.html");
    write_report(&report, &experiment, &trained, &rows, &comparison, start.elapsed().as_secs_f64())?;
    tell!("report: {} ({:.0} s in all)", report.display(), start.elapsed().as_secs_f64());
    Ok(Outcome::Pass)
}

fn read_experiment(args: &Args, games: &Games) -> Result<Experiment, CliError> {
    Ok(args.from.load(
        games,
        [option("seed", &args.seed), option("steps", &args.steps), option("skills.epochs", &args.epochs)],
    )?)
}

/// Learns the skill model and saves it; `None` after Ctrl-C.
fn skills(experiment: &Experiment, dataset: Dataset, args: &Args) -> Result<Option<SkillModel>, CliError> {
    let mut log = String::new();
    let mut console = Console::default().on_epoch(|epoch, metrics| {
        log.push_str(&format!("{}\n", learn_skills::epoch_json(epoch, metrics)));
        Ok(())
    });
    let model = learn(experiment, dataset, DeviceKind::default(), None, &mut console)?;
    drop(console);
    let Some(model) = model else { return Ok(None) };
    write_atomically(&args.run.join("skills.jsonl"), log.as_bytes())?;
    model.save(&args.run.join(SKILLS))?;
    Ok(Some(model))
}

/// Returns the setup of all trainings.
fn setup(args: &Args) -> TrainingSetup<'static> {
    TrainingSetup { revision: revision(), ..TrainingSetup::new(DeviceKind::default(), args.threads.count()) }
}

fn train_one(
    game: &dyn Game,
    experiment: &Experiment,
    algorithm: Algorithm,
    skills: &SkillModel,
    args: &Args,
    draw: ActionDraw,
) -> Result<Trained, CliError> {
    let experiment = Experiment { algorithm, ..experiment.clone() };
    let skills = algorithm.needs_skills().then_some(skills);
    let (folder, skill_file) = (args.run.join(algorithm.name()), args.run.join(SKILLS));
    let new = NewRun { path: &folder, experiment: &experiment, skills, skill_file: Some(&skill_file), force: true };
    let mut curve = Vec::new();
    let mut console = Console::new(format!("train {algorithm}")).on_update(|report| {
        if let Some(kl) = report.initial_kl {
            tell!("{algorithm}: the first policy is the decoder, KL {kl}");
        }
        if let (Some(episodic_return), Some(success_rate)) = (report.episodic_return, report.success_rate) {
            curve.push(CurvePoint { step: report.step, episodic_return, success_rate });
        }
    });
    let mut training = Training::begin(game, &new, &setup(args), &mut console)?;
    interrupt::go_on_with(format!(
        "this training alone, `{} train --run {} --resume`",
        program::name(),
        folder.display()
    ));
    let start = Instant::now();
    let finished = training.drive(&mut console)?;
    drop(console);
    let Training { run, trainer } = training;
    let steps_per_s = trainer.steps() as f64 / start.elapsed().as_secs_f64();
    let player = Player::Policy { policy: trainer.policy(), prior: trainer.skill_prior(), draw };
    let settled = RunCurves::read(run.path())?;
    let steps_to_threshold = steps_to_reach(settled.settled(SUCCESS_RATE), experiment.study.threshold);
    Ok(Trained { algorithm, player, curve, steps_to_threshold, steps_per_s, finished })
}

fn stopped(args: &Args, algorithm: Algorithm) -> Outcome {
    let run = args.run.join(algorithm.name());
    tell!(
        "stopped and saved; there is no report yet: go on with this training alone, `{program} train --run {} --resume`, \
         or start again with `{program} quickstart`",
        run.display(),
        program = program::name()
    );
    Outcome::Stopped
}

/// Returns the steps to success of each method, for the fully trained seed and for the others of `--seeds`. `None`
/// after Ctrl-C.
fn first_success(
    game: &dyn Game,
    experiment: &Experiment,
    trained: &[Trained],
    dataset: &Dataset,
    args: &Args,
) -> Result<Option<(Vec<u64>, Vec<FirstSuccess>)>, CliError> {
    interrupt::leave(format!("both trainings are saved in {}, without a report", args.run.display()));
    interrupt::go_on_with(format!("`{} eval --run {}`", program::name(), args.run.join("score-ppo").display()));
    let of = |one: &Trained| FirstSuccess { algorithm: one.algorithm, steps: vec![one.steps_to_threshold] };
    let (mut seeds, mut first) = (vec![experiment.seed], trained.iter().map(of).collect::<Vec<_>>());
    let algorithms: Vec<_> = trained.iter().map(|one| one.algorithm).collect();
    for seed in (1..args.seeds).map(|more| experiment.seed.wrapping_add(more)) {
        let experiment = Experiment { seed, ..experiment.clone() };
        let steps = steps_of_seed(game, &experiment, &algorithms, dataset, &setup(args))?;
        let Some(steps) = steps else { return Ok(None) };
        seeds.push(seed);
        first.iter_mut().zip(steps).for_each(|(one, steps)| one.steps.push(steps));
    }
    Ok(Some((seeds, first)))
}

/// Describes how many steps SCORE needed for PPO's final success rate.
fn compare(trained: &[Trained]) -> String {
    let [score, ppo] = trained else { return String::new() };
    let (Some(target), Some(total)) = (ppo.curve.last().map(|point| point.episodic_return), ppo.curve.last()) else {
        return "no episode ended during training: train for longer".to_owned();
    };
    match score.curve.iter().find(|point| point.episodic_return >= target) {
        Some(point) => format!(
            "SCORE-PPO reached PPO's final training return of {target:.2} after {} of {} steps ({:.0} %)",
            point.step,
            total.step,
            100.0 * point.step as f64 / total.step as f64
        ),
        None => format!("SCORE-PPO did not reach PPO's final training return of {target:.2}"),
    }
}
