//! `playbot watch`.
//!
//! The folder, in reading order:
//!
//! - `changes`: files that are saved, and when they are whole.
//! - `saves`: what was found after each save, on disk and in words, and the actions that solved each level.
//! - `rebuilt`: levels that only another process of the program can test.
//! - `page`: the page, and the server that shows it.

mod changes;
mod page;
mod rebuilt;
mod saves;

use crate::{
    arguments::{Compute, at_least_one_step, default_tested, named_or_only, report_agents_along},
    error::{CliError, Outcome},
    output::{print_line, program},
    progress::interrupt,
    verbs::{
        test::{DetectorArgs, TesterArgs, list_detectors},
        watch::{
            changes::{Edited, LevelFiles, Stamp},
            page::Page,
            rebuilt::{LevelLine, Rebuilt, Sources, TestEnd, UnchangedLevel, read_layouts},
            saves::{LevelState, Save, Saves, Solutions},
        },
    },
};
use playbot_harness::{
    game::{Game, read_level_designs},
    games::Games,
    level_files::{LevelFileError, is_level_files, level_files_mode},
    split::{LevelSplit, SplitError},
};
use playbot_report::counted;
use playbot_test::{
    quick::{QuickPlan, QuickVerdict, judge_quickly},
    verdict::{LevelOutcome, maps::level_name},
};
use serde::Serialize;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::PathBuf,
    thread,
    time::{Duration, Instant},
};

/// Time between two looks for saved files.
pub(crate) const GLANCE: Duration = Duration::from_millis(40);

/// Time in which a file that is no level may become one: editors write large files in several pieces.
const PATIENCE: Duration = Duration::from_millis(400);

/// The port of the page, unless another is named.
const PORT: u16 = 7788;

/// Watch levels while they are drawn: on each save, test what has changed and show it on a page.
///
/// The quickest testers come first: the actions that solved the level before, bots, and an explorer if none of them solves
/// it. The terminal and a page on this machine show the verdict, the path that solves the level, or the places that no
/// tester reaches, and what is new since the save before. The page is at http://127.0.0.1:7788, brings itself up to date,
/// and goes back to any save.
///
/// Level files are read again when they are saved. Without any, the watch waits for the first one. Other levels are tested
/// again by a new process of the program: when a file of --assets was saved, as a level editor does, and with --rebuild
/// when one of --code was.
///
/// With --once all levels are tested once. Exit code 1 if one of them is unsolved or has a finding.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot watch GAME --levels \"files:levels/**/*.json\"
  playbot watch GAME --levels MODE:0..9 --rebuild \"cargo build --release\"
  playbot watch GAME --levels \"files:levels/*.json\" --bot BOT,random --port 9000
  playbot watch GAME --levels \"files:levels/*.json\" --once --json")]
pub struct Args {
    /// Name of the game.
    game: Option<String>,
    /// Levels, as files:pattern, as mode:first..last, both included, or by their names in a level editor (default: those
    /// that `test` takes).
    #[arg(long, visible_alias = "level", value_parser = watched_levels)]
    levels: Option<LevelSplit>,
    #[command(flatten)]
    testers: TesterArgs,
    #[command(flatten)]
    detectors: DetectorArgs,
    /// Environment steps of the explorer, which plays levels that no other tester solves.
    #[arg(long, default_value_t = 60_000, value_parser = at_least_one_step)]
    steps: u64,
    /// Command that builds the program again when its code was saved. It runs in a shell.
    #[arg(long, value_name = "COMMAND", conflicts_with = "once")]
    rebuild: Option<String>,
    /// Folder or file that --rebuild depends on (repeatable; default: src).
    #[arg(long, value_name = "PATH", conflicts_with = "once", requires = "rebuild")]
    code: Vec<PathBuf>,
    /// Folder or file that the levels of the game depend on (repeatable; default: assets).
    #[arg(long, value_name = "PATH", conflicts_with = "once")]
    assets: Vec<PathBuf>,
    /// Port of the page; 0 takes any.
    #[arg(long, conflicts_with = "once")]
    port: Option<u16>,
    /// Folder that keeps the saves and the solutions.
    #[arg(long, value_name = "DIR", default_value = "runs/watch")]
    out: PathBuf,
    /// Test all levels once, without a page.
    #[arg(long)]
    once: bool,
    /// File with the layouts of levels that were tested already, by their names: only say that these are unchanged.
    #[arg(long, value_name = "FILE", hide = true, requires = "once")]
    known: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) compute: Compute,
    /// Print one line of JSON per level, with its picture, instead of words.
    #[arg(long)]
    json: bool,
}

/// Parses levels to watch. Files of a pattern need not be there yet.
fn watched_levels(text: &str) -> Result<LevelSplit, SplitError> {
    match text.parse() {
        Err(SplitError::Files(LevelFileError::NoFiles { .. })) => Ok(LevelSplit::one(text, 0)),
        levels => levels,
    }
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    let game = named_or_only(games, args.game.as_deref(), "watch", "")?;
    if args.detectors.list_detectors {
        return list_detectors(game, args.json);
    }
    // A part of another watch, which has printed the rest.
    let is_part = args.known.is_some();
    if !is_part {
        report_agents_along(game);
    }
    let split = args.levels.clone().unwrap_or_else(|| {
        let default = default_tested(game);
        if !is_part {
            report!("no --levels are named: {default}");
        }
        default
    });
    let is_files = is_level_files(&split.mode);
    if !is_files {
        split.check(game)?;
    }
    let known = if is_files { default_tested(game) } else { split.clone() };
    let plan = QuickPlan {
        testers: args.testers.load(game, &known, args.compute.device())?,
        detectors: args.detectors.choose(game, &known)?,
        steps: args.steps,
        threads: args.compute.threads(),
    };
    let layouts = args.known.as_deref().map(read_layouts).transpose()?;
    let (saves, message) = Saves::open(&args.out, is_part)?;
    message.iter().filter(|_| !is_part).for_each(|message| report!("warning: {message}"));
    let page = if args.once { None } else { Some(Page::open(args.port, PORT, game.name(), saves.all())?) };
    if let Some(page) = &page {
        report!(
            "{} is at {}",
            if page.is_other() { "the port is taken, so the page" } else { "the page" },
            page.address()
        );
    }
    interrupt::leave(format!("all saves so far are kept in {}", args.out.display()));
    interrupt::listen();
    let solutions = Solutions::new(game, &args.out);
    let asks_stored = !args.once || is_part;
    let mut watch =
        Watch { game, plan, saves, solutions, page, json: args.json, asks_stored, no_picture_is_reported: false };
    match (is_files, args.once) {
        (true, false) => watch.files(&LevelFiles::new(&split)?),
        (true, true) => {
            let (files, problem) = LevelFiles::new(&split)?.look();
            if let Some(problem) = problem {
                return Err(CliError::Usage(problem.to_string()));
            }
            let named = files.into_keys().map(|path| (LevelSplit::one(level_files_mode(&path), 0), path));
            watch.once(named, layouts.as_ref())
        }
        (false, true) => {
            let levels = split.levels().map(|level| LevelSplit::one(split.mode.clone(), level));
            let named = levels.map(|level| (level.clone(), title(game, &level)));
            watch.once(named, layouts.as_ref())
        }
        (false, false) => {
            let sources = Sources::new(&args.code, &args.assets, args.rebuild.clone())?;
            watch.rebuilt(&Rebuilt::new(&args.out), &sources)
        }
    }
}

/// Returns the level as results name it, with its name in an editor.
fn title(game: &dyn Game, level: &LevelSplit) -> String {
    let own = level_name(game, level, level.first);
    match game.tools().levels.level_name(&level.mode, level.first) {
        Some(name) => format!("{own} {name}"),
        None => own,
    }
}

/// A watch that goes on until Ctrl-C.
struct Watch<'a> {
    game: &'a dyn Game,
    plan: QuickPlan,
    saves: Saves,
    solutions: Solutions<'a>,
    page: Option<Page>,
    json: bool,
    /// Whether the actions that solved a level before are played.
    asks_stored: bool,
    no_picture_is_reported: bool,
}

impl Watch<'_> {
    /// Watches level files.
    fn files(&mut self, files: &LevelFiles) -> Result<Outcome, CliError> {
        let mut known: BTreeMap<String, Stamp> = BTreeMap::new();
        // The hash of each level when it was tested last.
        let mut tested: BTreeMap<String, u64> = BTreeMap::new();
        let mut due: BTreeMap<String, Instant> = BTreeMap::new();
        // Those of an earlier watch may be gone.
        let mut shown = self.saves.levels();
        let mut is_gone = false;
        let mut is_begun = false;
        while !interrupt::asked() {
            let (now, problem) = files.look();
            let mut save = Save::new(self.saves.next());
            if problem.is_some() != is_gone {
                is_gone = problem.is_some();
                let until = if is_begun { "until there are some again" } else { "for the first one" };
                save.problem = problem.map(|problem| format!("{problem}: waiting {until}"));
                match &save.problem {
                    Some(problem) => report!("{problem}"),
                    None => report!("there are level files now"),
                }
            }
            is_begun |= !is_gone;
            for (path, stamp) in &now {
                if known.get(path) != Some(stamp) {
                    due.insert(path.clone(), Instant::now());
                }
            }
            save.gone = shown.iter().filter(|path| !now.contains_key(*path)).cloned().collect();
            for path in &save.gone {
                due.remove(path);
                tested.remove(path);
                if !self.json {
                    print_line(format!("{path}: gone"))?;
                }
            }
            shown = now.keys().cloned().collect();
            known = now;
            if !save.is_empty() {
                self.publish(&save);
            }
            let paths: Vec<(String, Instant)> = due.iter().map(|(path, since)| (path.clone(), *since)).collect();
            for (path, since) in paths {
                if interrupt::asked() {
                    break;
                }
                let split = LevelSplit::one(level_files_mode(&path), 0);
                match read_level_designs(self.game, &split.mode) {
                    // It may be half of a level.
                    Err(_) if since.elapsed() < PATIENCE => continue,
                    Err(error) => {
                        due.remove(&path);
                        tested.remove(&path);
                        let state = LevelState::unreadable(&path, error.to_string());
                        self.note(&mut save, state)?;
                    }
                    Ok(designs) => {
                        due.remove(&path);
                        let hash = designs.hash(0);
                        if hash.is_some() && tested.get(&path).copied() == hash {
                            continue;
                        }
                        // A test that is stopped leaves a part of its verdict on the page: the level is due again then,
                        // whatever its layout.
                        tested.remove(&path);
                        let edited = Edited::new(&path, known.get(&path).copied());
                        if self.level(&mut save, &split, &path, &|| interrupt::asked() || edited.is_again())? {
                            tested.extend(hash.map(|hash| (path, hash)));
                        }
                    }
                }
            }
            if !save.is_empty() {
                self.saves.add(save)?;
            }
            if !interrupt::asked() {
                thread::park_timeout(GLANCE);
            }
        }
        self.stopped()
    }

    /// Watches levels that only a new process can test.
    fn rebuilt(&mut self, levels: &Rebuilt, sources: &Sources) -> Result<Outcome, CliError> {
        let mut seen = sources.look();
        // The layout of each level when it was tested last.
        let mut tested = BTreeMap::new();
        let (mut is_due, mut build) = (true, false);
        loop {
            if is_due {
                let mut save = Save::new(self.saves.next());
                if build {
                    tested.clear();
                }
                let is_kept = if let Some(problem) = sources.rebuild(build, &interrupt::asked) {
                    report!("{problem}");
                    save.problem = Some(problem);
                    self.publish(&save);
                    true
                } else {
                    build = false;
                    self.in_process(&mut save, levels, &mut tested)?
                };
                if is_kept {
                    self.saves.add(save)?;
                }
            }
            if interrupt::asked() {
                return self.stopped();
            }
            thread::park_timeout(GLANCE);
            let now = sources.look();
            // Some programs save several files, one after the other.
            is_due = now != seen;
            // A build that failed stays due.
            build |= now.code != seen.code;
            seen = now;
        }
    }

    /// Tests in a process the levels whose layout differs from that of their last test. Returns whether the save is to be
    /// kept.
    fn in_process(
        &mut self,
        save: &mut Save,
        levels: &Rebuilt,
        tested: &mut BTreeMap<String, String>,
    ) -> Result<bool, CliError> {
        let known = tested.clone();
        let mut there = BTreeSet::new();
        let end = levels.test(&known, &interrupt::asked, &mut |line| match line {
            LevelLine::Unchanged(UnchangedLevel { unchanged }) => {
                there.insert(unchanged);
                Ok(())
            }
            LevelLine::Tested(state) => {
                there.insert(state.level.clone());
                match &state.layout {
                    Some(layout) => tested.insert(state.level.clone(), layout.clone()),
                    None => tested.remove(&state.level),
                };
                self.note(save, *state)
            }
        })?;
        match end {
            TestEnd::Done => {}
            TestEnd::Failed(problem) => {
                // The rest is what the process has said itself.
                report!("{}", problem.lines().next().unwrap_or_default());
                save.problem = Some(problem);
                self.publish(save);
                return Ok(true);
            }
            TestEnd::Stopped => return Ok(!save.is_empty()),
        }
        let mut shown = self.saves.levels();
        shown.extend(known.into_keys());
        save.gone = shown.difference(&there).cloned().collect();
        for level in &save.gone {
            tested.remove(level);
            if !self.json {
                print_line(format!("{level}: gone"))?;
            }
        }
        if save.is_empty() {
            report!("all levels are as they were before that save");
        }
        // A save without any change ends the problem of the one before.
        let is_kept = !save.is_empty() || self.saves.all().last().is_some_and(|last| last.problem.is_some());
        if is_kept {
            self.publish(save);
        }
        Ok(is_kept)
    }

    /// Tests levels once. If layouts are given, the process belongs to a watch that goes on: that one keeps the save, and
    /// levels with the layout of their last test are only named.
    fn once(
        &mut self,
        levels: impl Iterator<Item = (LevelSplit, String)>,
        known: Option<&BTreeMap<String, String>>,
    ) -> Result<Outcome, CliError> {
        let mut save = Save::new(self.saves.next());
        for (split, name) in levels {
            if interrupt::asked() {
                return self.stopped();
            }
            let last = known.and_then(|known| known.get(&name));
            if last.is_some() && self.layout(&split).as_ref() == last {
                print_json(&UnchangedLevel { unchanged: name })?;
                continue;
            }
            if is_level_files(&split.mode)
                && let Err(error) = read_level_designs(self.game, &split.mode)
            {
                self.note(&mut save, LevelState::unreadable(&name, error.to_string()))?;
                continue;
            }
            self.level(&mut save, &split, &name, &interrupt::asked)?;
        }
        let is_sound = save.levels.iter().all(LevelState::is_sound);
        if known.is_none() {
            self.saves.add(save)?;
        }
        Ok(if is_sound { Outcome::Pass } else { Outcome::Findings })
    }

    /// Returns the hash of a level's layout, if it has one.
    fn layout(&self, level: &LevelSplit) -> Option<String> {
        self.game.layout(&level.mode, level.first).map(|layout| format!("{layout:016x}"))
    }

    /// Tests a level, and notes what is found. Returns false if it was stopped.
    fn level(
        &mut self,
        save: &mut Save,
        split: &LevelSplit,
        name: &str,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<bool, CliError> {
        let begin = Instant::now();
        let before = self.saves.last(name);
        // In a script the verdict is not to depend on what was found before.
        let solution = if self.asks_stored { self.solutions.of(name) } else { None };
        let layout = self.layout(split);
        let state = |verdict: &QuickVerdict| LevelState {
            level: name.to_owned(),
            seconds: begin.elapsed().as_secs_f64(),
            verdict: verdict.clone(),
            before: before.clone(),
            problem: None,
            layout: layout.clone(),
        };
        let page = self.page.as_ref();
        let mut partial = save.clone();
        let mut progress = |verdict: &QuickVerdict| {
            if let Some(page) = page {
                partial.put(state(verdict));
                page.publish(&partial);
            }
        };
        let judged = judge_quickly(self.game, &self.plan, split, solution.as_deref(), &mut progress, stop)?;
        let Some(judged) = judged else { return Ok(false) };
        let state = state(&judged.verdict);
        if let Some(actions) = &judged.solution {
            self.solutions.keep(name, split, actions)?;
        }
        self.note(save, state)?;
        Ok(true)
    }

    /// Prints what is known of a level, and shows it on the page.
    fn note(&mut self, save: &mut Save, state: LevelState) -> Result<(), CliError> {
        if self.json {
            print_json(&state)?;
        } else {
            print_line(state.to_string())?;
        }
        let is_unseen = state.problem.is_none() && state.verdict.is_final && state.verdict.picture.is_none();
        if is_unseen && self.page.is_some() && !self.no_picture_is_reported {
            self.no_picture_is_reported = true;
            report!("the page shows no pictures of levels: `{}` has no floor plan of them", self.game.name());
        }
        save.put(state);
        self.publish(save);
        Ok(())
    }

    fn publish(&self, save: &Save) {
        if let Some(page) = &self.page {
            page.publish(save);
        }
    }

    fn stopped(&self) -> Result<Outcome, CliError> {
        let saves = counted(self.saves.all().len() as u64, "save");
        report!(
            "stopped; {saves} kept in {}: `{} watch` goes on from there",
            self.saves.folder().display(),
            program::name()
        );
        Ok(Outcome::Stopped)
    }
}

fn print_json(value: &impl Serialize) -> Result<(), CliError> {
    let text = serde_json::to_string(value);
    print_line(text.map_err(|error| CliError::Io(format!("a verdict cannot be written as JSON: {error}")))?)
}

impl LevelState {
    /// Returns whether the level is solved and nothing was found.
    fn is_sound(&self) -> bool {
        self.problem.is_none() && self.verdict.outcome == Some(LevelOutcome::Solved) && self.verdict.findings.is_empty()
    }
}
