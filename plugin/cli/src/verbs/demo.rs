//! `playbot demo ls|show|verify|repair|merge|filter|label`.
//!
//! - `show`: `playbot demo show`: the header, the episodes and the ticks of a recording.
//! - `filter`: `playbot demo filter` and `playbot demo label`.

mod filter;
mod show;

use crate::{
    arguments::{check_start, open},
    error::{CliError, Outcome},
    output,
    output::{prepare, print_line, program},
    progress,
    progress::{interrupt, interrupt::NothingToSave},
    verbs::demo::{
        filter::{FilterArgs, filter, label},
        show::{Form, TickRange, show},
    },
};
use bevy_playbot::{
    demo::file::{DemoSummary, repair},
    engine::{find_demos, merge_demos},
};
use playbot_harness::{
    demo::{VerifyReport, verify_file},
    games::{Artifact, Games},
};
use playbot_report::counted;
use serde_json::json;
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

pub use crate::verbs::demo::show::deciders;

/// Look at, check, repair, join and filter recordings.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot demo ls
  playbot demo show my.demo --episode 0
  playbot demo show my.demo --episode 0 --ticks 100..150
  playbot demo verify demos/GAME
  playbot demo verify a.demo b.demo --json
  playbot demo repair torn.demo --out whole.demo
  playbot demo repair torn.demo --header-from other.demo
  playbot demo merge --out all.demo alice.demo bob.demo
  playbot demo filter all.demo --success --min-return 5 --out good.demo
  playbot demo filter alice.demo --levels MODE:0..63 --without-idle-start --out quick.demo
  playbot demo label mine.demo --player alice --out alice.demo")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// List recordings.
    Ls {
        /// Files or folders.
        #[arg(default_value = "demos")]
        paths: Vec<PathBuf>,
        /// One line of JSON per recording.
        #[arg(long)]
        json: bool,
    },
    /// Show the header and the episodes of a recording, or the ticks of one of them.
    ///
    /// Actions of the program's own games are shown with their names.
    Show {
        /// The file.
        file: PathBuf,
        /// Show every tick of this episode, counted from 0.
        #[arg(long)]
        episode: Option<usize>,
        /// Show these ticks of the episode only, as first..last, both included, or one number.
        #[arg(long, requires = "episode", value_name = "TICKS")]
        ticks: Option<TickRange>,
        /// One line of JSON per episode, or per tick.
        #[arg(long)]
        json: bool,
        /// Each episode has its game, mode, actions and rewards, too, for programs that play it again.
        #[arg(long, requires = "json", conflicts_with = "episode")]
        actions: bool,
    },
    /// Replay recordings. Exit code 1 if one diverges, is damaged or cannot be replayed.
    ///
    /// Each episode is replayed in a new World, and in a World that has played another episode. The message says which
    /// of the two differs. `learn-skills` and `train` accept every recording that this accepts. For `learn-skills`, an
    /// episode must have at least the steps of `skills.window`.
    Verify {
        /// Files or folders.
        #[arg(default_value = "demos")]
        paths: Vec<PathBuf>,
        /// One line of JSON per recording.
        #[arg(long)]
        json: bool,
    },
    /// Recover the whole episodes of a damaged recording.
    Repair {
        /// The damaged file.
        file: PathBuf,
        /// Recording to write, a .demo (default: the damaged file itself, which is then kept beside it as FILE.bak).
        #[arg(long, value_parser = output::demo)]
        out: Option<PathBuf>,
        /// Another recording of the same game, mode and version. Its header is taken if both copies in the damaged file
        /// are damaged.
        #[arg(long, value_name = "FILE")]
        header_from: Option<PathBuf>,
        /// Print the result as a line of JSON.
        #[arg(long)]
        json: bool,
    },
    /// Join recordings of one game, version of its rules, mode and noise into a new one.
    ///
    /// The noise is that of `record --noise`, which `demo show` prints. Recordings also have to agree in the
    /// observations that they keep, if any. `learn-skills` and `train` learn from a folder of recordings that differ in
    /// noise, without a merge: put them there, and name it with `--set demos=FOLDER`.
    Merge {
        /// The recordings, in the order of their episodes in the new one.
        #[arg(required = true, value_name = "FILE")]
        files: Vec<PathBuf>,
        /// Recording to write, a .demo that does not exist.
        #[arg(long, value_parser = output::demo)]
        out: PathBuf,
        /// Print the result as a line of JSON.
        #[arg(long)]
        json: bool,
    },
    /// Keep the episodes that meet all conditions, in a new recording. Exit code 1 if no episode does.
    Filter(FilterArgs),
    /// Change the name of the player, in a new recording.
    Label {
        /// The recording.
        file: PathBuf,
        /// Name of the player.
        #[arg(long, value_name = "NAME")]
        player: String,
        /// Recording to write, a .demo that does not exist.
        #[arg(long, value_parser = output::demo)]
        out: PathBuf,
        /// Print the result as a line of JSON.
        #[arg(long)]
        json: bool,
    },
}

pub(crate) fn run(args: Args, games: &Games) -> Result<Outcome, CliError> {
    match args.verb {
        Verb::Ls { paths, json } => ls(&paths, json),
        Verb::Show { file, episode, ticks, json, actions } => {
            let form = match (json, actions) {
                (false, _) => Form::Words,
                (true, false) => Form::Json,
                (true, true) => Form::JsonWithActions,
            };
            show(&file, episode, ticks, form, games)
        }
        Verb::Verify { paths, json } => verify(&paths, json, games),
        Verb::Repair { file, out, header_from, json } => {
            mend(&file, out.as_deref().unwrap_or(&file), header_from.as_deref(), json)
        }
        Verb::Merge { files, out, json } => merge(&files, &out, json),
        Verb::Filter(args) => filter(args, games),
        Verb::Label { file, player, out, json } => label(&file, &player, &out, json),
    }
}

fn ls(paths: &[PathBuf], as_json: bool) -> Result<Outcome, CliError> {
    let mut outcome = Outcome::Pass;
    for file in all_demos(paths)? {
        let summary = match DemoSummary::read(&file) {
            Ok(summary) => summary,
            Err(error) => {
                report!("{}", program::named(&error.to_string()));
                outcome = Outcome::Findings;
                continue;
            }
        };
        if as_json {
            print_line(json!(summary))?;
        } else {
            print_line(format!(
                "{}: {} {}, {}, {}, {}, {}, {} KiB, by {}, {}",
                file.display(),
                summary.header.game,
                summary.header.mode,
                counted(summary.episodes as u64, "episode"),
                counted(summary.steps as u64, "step"),
                success(&summary),
                counted(summary.levels as u64, "level"),
                summary.bytes / 1024,
                summary.header.demonstrator,
                deciders("decided by", &summary.steps_by_decider),
            ))?;
        }
    }
    Ok(outcome)
}

/// Returns the share of successes in words, empty if there are no successes: many games have no goal. Recordings do not
/// note whether the goal was reached in time. Episodes that were cut off at the end of the recording do not count.
fn success(summary: &DemoSummary) -> String {
    let share = match summary.success_share {
        None => "no episode ended".to_owned(),
        Some(_) if summary.successes == 0 => "no episode ended in a win".to_owned(),
        Some(share) => format!("{:.1} % success", 100.0 * share),
    };
    let notes: Vec<String> = [(summary.truncated, "until time was up"), (summary.aborted, "cut off")]
        .into_iter()
        .filter(|(count, _)| *count > 0)
        .map(|(count, how)| format!("{count} {how}"))
        .collect();
    if notes.is_empty() { share } else { format!("{share} ({})", notes.join(", ")) }
}

/// Returns the recordings of all files and folders.
fn all_demos(paths: &[PathBuf]) -> Result<Vec<PathBuf>, CliError> {
    let mut files = Vec::new();
    for path in paths {
        files.extend(find_demos(path).map_err(open::missing_recording)?);
    }
    Ok(files)
}

fn verify(paths: &[PathBuf], as_json: bool, games: &Games) -> Result<Outcome, CliError> {
    let files = all_demos(paths)?;
    let mut outcome = Outcome::Pass;
    let _replaying = NothingToSave::listen();
    let mut started = BTreeSet::new();
    for (done, file) in files.iter().enumerate() {
        interrupt::leave(format!("{done} of {} checked: name the others", counted(files.len() as u64, "recording")));
        let checked = replay(file, games, &mut started);
        // A verdict is never vacuous: without a replay nothing is proved.
        if !checked.as_ref().is_ok_and(|report| report.divergences.is_empty() && report.episodes > 0) {
            outcome = Outcome::Findings;
        }
        if as_json {
            let error = checked.as_ref().err().map(|error| named(file, error));
            print_line(json!({ "file": file, "report": checked.ok(), "error": error }))?;
        } else {
            print_report(file, checked)?;
        }
    }
    Ok(outcome)
}

/// Replays a file with a progress bar. `started` are the games and modes of earlier files, which start.
fn replay(file: &Path, games: &Games, started: &mut BTreeSet<(String, String)>) -> Result<VerifyReport, CliError> {
    // The whole file is read before any of it is played, so that damage shows at once.
    let summary = DemoSummary::read(file)?;
    let game = games.of_file(Artifact::Recording, file, &summary.header.game)?;
    let mode = (game.name().to_owned(), summary.header.mode);
    if !started.contains(&mode) {
        check_start(game, &mode.1, 0)?;
        started.insert(mode);
    }
    let bar = progress::bar("replay", summary.episodes as u64, "episodes");
    let report = verify_file(game, file, |done| bar.set_position(done));
    bar.finish_and_clear();
    let mut report = report?;
    // They name the doctor.
    report.divergences.iter_mut().for_each(|(_, divergence)| *divergence = program::named(divergence));
    Ok(report)
}

/// Formats an error with its file.
fn named(file: &Path, error: &CliError) -> String {
    let (file, words) = (file.display().to_string(), program::named(&error.to_string()));
    if words.contains(&file) { words } else { format!("{file}: {words}") }
}

fn print_report(file: &Path, checked: Result<VerifyReport, CliError>) -> Result<(), CliError> {
    let report = match checked {
        Ok(report) => report,
        Err(error) => return print_line(named(file, &error)),
    };
    for (episode, divergence) in &report.divergences {
        print_line(format!("{}: episode {episode}: {divergence}", file.display()))?;
    }
    let verdict = match report.divergences.len() {
        0 if report.episodes == 0 => "nothing to replay".to_owned(),
        0 => "all as recorded".to_owned(),
        n => format!("{n} diverge"),
    };
    let replayed = format!("{}, {} replayed", counted(report.episodes, "episode"), counted(report.ticks, "tick"));
    print_line(format!("{}: {replayed}, {verdict}", file.display()))
}

/// Repairs a file. A file without a whole episode is a finding.
fn mend(file: &Path, out: &Path, header_from: Option<&Path>, as_json: bool) -> Result<Outcome, CliError> {
    let report = repair(file, out, header_from).map_err(open::missing_or_taken)?;
    if as_json {
        print_line(json!(report))?;
    } else {
        let kept = match report.kept_episodes {
            0 => "no episode is whole, so nothing is kept and there is nothing to replay or to learn from".to_owned(),
            episodes => {
                let (episodes, steps) = (episodes as u64, report.kept_steps as u64);
                format!("kept {} with {}", counted(episodes, "episode"), counted(steps, "step"))
            }
        };
        let places = counted(report.dropped_regions.len() as u64, "place");
        let bytes = counted(report.dropped_bytes, "byte");
        print_line(format!("{}: {kept}; dropped {bytes} in {places}", out.display()))?;
        if let Some(from) = &report.header_from {
            let from = if from == file { "its second copy".to_owned() } else { from.display().to_string() };
            print_line(format!("its header was damaged, and is taken from {from}"))?;
        }
        if let Some(backup) = &report.backup {
            print_line(format!("the damaged file is kept as {}", backup.display()))?;
        }
    }
    Ok(if report.kept_episodes == 0 { Outcome::Findings } else { Outcome::Pass })
}

/// Writes the episodes of all files into a new one, and reports them. A recording without a single episode is a
/// finding.
///
/// # Errors
///
/// They are of different games or rules, one is damaged, or there is a file at `out` already. Nothing is left at `out`
/// then.
pub(crate) fn merge(files: &[PathBuf], out: &Path, as_json: bool) -> Result<Outcome, CliError> {
    prepare(out)?;
    let report = merge_demos(files, out).map_err(open::missing_or_taken)?;
    if as_json {
        let parts: Vec<_> =
            report.files.iter().map(|(file, episodes)| json!({ "file": file, "episodes": episodes })).collect();
        print_line(json!({
            "file": out, "header": report.header, "episodes": report.episodes(), "steps": report.steps, "files": parts,
            "equal_episodes": report.equal_episodes,
        }))?;
    } else {
        for (file, episodes) in &report.files {
            print_line(format!("{}: {}", file.display(), counted(*episodes as u64, "episode")))?;
        }
        print_line(format!(
            "{}: {} {}, {} with {} from {}, by {}",
            out.display(),
            report.header.game,
            report.header.mode,
            counted(report.episodes() as u64, "episode"),
            counted(report.steps as u64, "step"),
            counted(report.files.len() as u64, "recording"),
            report.header.demonstrator,
        ))?;
    }
    if report.equal_episodes > 0 {
        let are = if report.equal_episodes == 1 { "is" } else { "are" };
        report!(
            "warning: {} {are} equal to ones of other files, as in a copy with another name, and would count twice: leave the \
             copy out",
            counted(report.equal_episodes as u64, "episode")
        );
    }
    Ok(if report.episodes() == 0 { Outcome::Findings } else { Outcome::Pass })
}
