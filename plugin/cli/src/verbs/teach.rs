//! `playbot teach`.

use crate::{
    arguments::{
        Compute, check_start_and_steps,
        experiment::{ExperimentArgs, option, quoted},
        number_of_steps, revision,
    },
    error::{CliError, Outcome},
    output::{make_folder, print_line, program},
    progress::{console::Console, interrupt},
};
use bevy_playbot::{
    demo::file::{DemoReader, find_demos},
    lesson::{LessonNews, LessonStage},
};
use playbot_harness::{games::Games, split::LevelSplit};
use playbot_train::{
    Experiment,
    lesson::{LEARNED, Learned, LessonPlan, OF_NUMBERS, SETTINGS, teach},
    run_observer::{CountedWork, Counter, RunEvent, RunObserver},
    train_run::TrainingSetup,
};
use serde_json::json;
use std::{
    cell::RefCell,
    io,
    path::{Path, PathBuf},
    thread,
};

/// Learn from a recording of yours: a first policy within seconds, and better ones while you watch.
///
/// Behaviour cloning comes first. SCORE-PPO on copies of the game goes on from it. The best policy so far is always in
/// FOLDER/learned.policy, which `play --policy` and games load. Other recordings or settings begin a lesson of their own,
/// whose policy is in a folder of FOLDER until it returns as much as the best one.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot teach GAME --demos my.demo --out lessons
  playbot play GAME --policy lessons/learned.policy
  playbot teach GAME --demos my.demo --out lessons --steps 500000 --json

A game without an experiment of its own gets settings that suit short recordings; --set changes them. Recordings of another
mode than the experiment's train on the recorded levels, at most 64. The same command
goes on where it was stopped, with more --steps too. In the window of `play`, F10 runs this verb.")]
pub struct Args {
    #[command(flatten)]
    from: ExperimentArgs,
    /// File or folder of recordings.
    #[arg(long, value_name = "PATH")]
    demos: PathBuf,
    /// Folder for the policy, the skill model and the training.
    #[arg(long, value_name = "FOLDER")]
    out: PathBuf,
    /// Environment steps of the training, instead of the experiment's.
    #[arg(long, value_parser = number_of_steps)]
    steps: Option<u64>,
    #[command(flatten)]
    pub(crate) compute: Compute,
    /// Print the progress and each new policy as a line of JSON.
    #[arg(long)]
    json: bool,
    /// Save and stop when the standard input ends: for programs that start this one.
    #[arg(long)]
    until_input_ends: bool,
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    let experiment = experiment(&args, games)?;
    let game = args.from.find_game(games, &experiment)?;
    experiment.check_levels(game)?;
    experiment.check_memory(game)?;
    check_start_and_steps(game, &experiment.train.mode, experiment.train.first)?;
    make_folder(&args.out)?;
    interrupt::listen();
    interrupt::go_on_with("the same command".to_owned());
    if args.until_input_ends {
        stop_with_input();
    }
    let locate = |path: &Path| path.to_owned();
    let (device, threads) = (args.compute.device(), args.compute.threads());
    let setup = TrainingSetup { device, threads, revision: revision(), recordings: &locate };
    let plan = LessonPlan { game, experiment: &experiment, recordings: &args.demos, folder: &args.out, setup: &setup };
    let printer = Printer { as_json: args.json, failed: RefCell::new(None) };
    let mut reporter = Reporter::new(&printer);
    // The last policy, and whether it is the best of all lessons.
    let mut last = None;
    let is_done = teach(&plan, &mut reporter, &mut |learned| {
        let Learned { file, is_best, stage, steps, mean_return } = learned;
        last = Some((file.to_owned(), is_best));
        let news = LessonNews::Policy { file: file.to_owned(), stage, steps, mean_return };
        match printer.as_json {
            true => printer.print(&news),
            false => report!("{news}: {}", file.display()),
        }
    })?;
    printer.print(if is_done { &LessonNews::Finished } else { &LessonNews::Stopped });
    printer.failed.into_inner().map_or(Ok(()), Err)?;
    let best = args.out.join(LEARNED);
    let (file, is_best) =
        last.map_or((best.clone(), true), |(file, is_best)| (if is_best { best.clone() } else { file }, is_best));
    if !is_best {
        report!("{} stays as it is: an earlier lesson's policy returned more", best.display());
    }
    if !is_done {
        report!("stopped and saved; the same command goes on");
        return Ok(Outcome::Stopped);
    }
    let file = quoted(&file.to_string_lossy());
    report!("done: watch it with `{} play {} --policy {file}`", program::name(), game.name());
    Ok(Outcome::Pass)
}

/// Returns the experiment: the one that is named, the game's own, or else the settings for short recordings.
fn experiment(args: &Args, games: &Games) -> Result<Experiment, CliError> {
    let options = || [option("steps", &args.steps)];
    let plain = args.from.load(games, options())?;
    let game = args.from.find_game(games, &plain)?;
    if args.from.experiment.is_some() {
        return Ok(plain);
    }
    let is_known = game.tools().training.experiment().is_some();
    let of_numbers = (!is_known && !plain.observation_config().is_image()).then_some(OF_NUMBERS);
    let settings = if is_known { &[][..] } else { &SETTINGS[..] };
    let played = played_levels(&args.demos, &plain.train)?.map(|levels| format!("train={levels}"));
    let known = settings.iter().copied().chain(of_numbers).map(str::to_owned).chain(played);
    Ok(args.from.over(known).load(games, options())?)
}

/// Returns the recorded levels, at most 64 of them, if they are of another mode than those that would be trained on.
fn played_levels(demos: &Path, trained: &LevelSplit) -> Result<Option<LevelSplit>, CliError> {
    let mut played: Option<LevelSplit> = None;
    for file in find_demos(demos)? {
        let reader = DemoReader::open(&file)?;
        let mode = reader.header().mode.clone();
        if mode == trained.mode || played.as_ref().is_some_and(|played| played.mode != mode) {
            return Ok(None);
        }
        for episode in reader {
            let level = episode?.level_seed;
            let all = played.get_or_insert_with(|| LevelSplit::one(mode.clone(), level));
            (all.first, all.last) = (all.first.min(level), all.last.max(level));
        }
    }
    Ok(played.map(|all| LevelSplit { last: all.last.min(all.first.saturating_add(63)), ..all }))
}

/// Asks the work to stop when the program that started this one closes our input, or ends.
fn stop_with_input() {
    thread::spawn(|| {
        // An error ends the input as well.
        let _ = io::copy(&mut io::stdin().lock(), &mut io::sink());
        interrupt::ask();
    });
}

/// Prints news as JSON. Nothing is printed any more once a line could not be.
struct Printer {
    as_json: bool,
    failed: RefCell<Option<CliError>>,
}

impl Printer {
    fn print(&self, news: &LessonNews) {
        if !self.as_json || self.failed.borrow().is_some() {
            return;
        }
        if let Err(error) = print_line(json!(news)) {
            *self.failed.borrow_mut() = Some(error);
        }
    }
}

/// Prints the progress, for programs or for people.
struct Reporter<'a> {
    printer: &'a Printer,
    console: Console<'static>,
    /// Batches of imitation: done, and of all epochs.
    batches: (u64, u64),
    /// Steps of the whole training.
    steps: u64,
}

impl<'a> Reporter<'a> {
    fn new(printer: &'a Printer) -> Self {
        Self { printer, console: Console::new("teach"), batches: (0, 1), steps: 1 }
    }

    fn progress(&self, stage: LessonStage, done: u64, of: u64, mean_return: Option<f64>) {
        self.printer.print(&LessonNews::Progress { stage, done, of, mean_return });
    }
}

impl RunObserver for Reporter<'_> {
    fn stopped(&self) -> bool {
        // A reader that is gone wants nothing more.
        self.console.stopped() || self.printer.failed.borrow().is_some()
    }

    fn observe(&mut self, event: RunEvent<'_>) {
        match &event {
            RunEvent::RecordingsOpened(summary) => self.progress(LessonStage::Replay, 0, summary.steps, None),
            RunEvent::SkillsBegun { done, batches } => self.batches = (*done, *batches),
            RunEvent::SkillBatch => {
                let (done, of) = &mut self.batches;
                *done += 1;
                let (done, of) = (*done, *of);
                // Each percent once.
                if done * 100 / of.max(1) != (done - 1) * 100 / of.max(1) {
                    self.progress(LessonStage::Imitation, done, of, None);
                }
            }
            RunEvent::TrainingBegun { experiment } => self.steps = experiment.whole_steps(),
            RunEvent::Updated { report, .. } => {
                self.progress(LessonStage::Training, report.step, self.steps, report.episodic_return);
            }
            _ => {}
        }
        self.console.observe(event);
    }

    fn counter(&mut self, work: CountedWork<'_>) -> Counter {
        self.console.counter(work)
    }
}
