//! `playbot report`.

use crate::{
    arguments::open,
    error::{CliError, Outcome},
    output,
    output::{print_line, print_table},
    pictures::plot::PlotFile,
    verbs::test::{Results, join_shards, write_page},
};
use playbot_harness::{games::Games, parallel::default_threads};
use playbot_mutation::calibration::{Calibration, CalibrationError};
use playbot_test::{
    verdict::{Comparison, IssueForm, RESULTS, ResultLines, TestRecord, issues, results_folder},
    verdict_report::{REPORT, without_pictures},
};
use std::{fs, path::PathBuf};

/// Work with the results of tests.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report merge runs/shard-0 runs/shard-1 --out runs/test
  playbot report html runs/test
  playbot report issues runs/test --form sarif --out levels.sarif
  playbot report calibrate runs/test people.demo --out people.html")]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(clap::Subcommand)]
enum Verb {
    /// Join the results of all shards of a test.
    Merge(MergeArgs),
    /// Write the page of results again.
    Html(HtmlArgs),
    /// List what is wrong, in a form that build servers and editors read.
    Issues(IssuesArgs),
    /// Compare the results with recordings of people.
    Calibrate(CalibrateArgs),
}

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    match &args.verb {
        Verb::Merge(args) => run_merge(args, games),
        Verb::Html(args) => run_html(args, games),
        Verb::Issues(args) => run_issues(args),
        Verb::Calibrate(args) => run_calibrate(args, games),
    }
}

// `playbot report merge`.

/// Join the results of all shards of a test into the same bytes as those of the whole test.
///
/// All shards must be there once, of the same test. The exit code is that of `playbot test`.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report merge runs/shard-0 runs/shard-1 --out runs/test
  playbot report merge runs/shard-0 runs/shard-1 --against runs/before --out runs/test --json")]
pub struct MergeArgs {
    /// Folders of the shards, in any order.
    #[arg(required = true, value_name = "DIR")]
    shards: Vec<PathBuf>,
    /// Folder for the joined results.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Folder of earlier results of the same version of the game, to report changes.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// Write the game's pictures and the clips of the page into DIR/report-files instead of into the page.
    #[arg(long)]
    split: bool,
    /// Replace existing results.
    #[arg(long)]
    force: bool,
    /// Print one line of JSON per level instead of a table.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run_merge(args: &MergeArgs, games: &Games) -> Result<Outcome, CliError> {
    let shards: Vec<PathBuf> = args.shards.iter().map(|shard| results_folder(shard).to_owned()).collect();
    check_out(args, &shards)?;
    let Some(first) = shards.first() else {
        return Err(CliError::Usage("name the folders of the shards".to_owned()));
    };
    let record = TestRecord { shard: None, ..ResultLines::open_whole(first)?.record().clone() };
    // Without the game there are no pictures, and all else is the same.
    let game = games.get(&record.game).ok();
    let against = args.against.as_deref().map(results_folder);
    let (folder, json, split, threads) = (args.out.as_path(), args.json, args.split, default_threads());
    let results = Results { folder, against, game, json, keeps_failures: false, split, threads };
    results.check()?;
    // Nothing is written if the comparison fails.
    if let Some(before) = results.against {
        Comparison::check(before, &record)?;
    }
    join_shards(&shards, &results)
}

/// Checks that the joined results do not replace needed files.
fn check_out(args: &MergeArgs, shards: &[PathBuf]) -> Result<(), CliError> {
    let out = args.out.display();
    if args.out.is_file() {
        return Err(CliError::Usage(format!("{out} is a file: name a folder to write into")));
    }
    // A missing path is no folder of a shard.
    if let Ok(folder) = fs::canonicalize(&args.out)
        && shards.iter().any(|shard| fs::canonicalize(shard).is_ok_and(|shard| shard == folder))
    {
        return Err(CliError::Usage(format!("--out {out} is the folder of a shard: choose another --out")));
    }
    if !args.force && args.out.join(RESULTS).exists() {
        return Err(CliError::Usage(format!(
            "{out} has results already: choose another --out, or replace them with --force"
        )));
    }
    Ok(())
}

// `playbot report html`.

/// Write the page of results again: one file that opens without network, with a gallery of the levels, the findings as the
/// game shows them, and a table to sort and filter.
///
/// `playbot test` and `playbot report merge` write it too. Pictures need the game, in the version that was tested.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report html runs/test
  playbot report html runs/test --against runs/before --out levels.html
  playbot report html runs/test --split")]
pub struct HtmlArgs {
    /// Folder of the results.
    #[arg(value_name = "DIR")]
    results: PathBuf,
    /// Folder of earlier results of the same version of the game, to report changes.
    #[arg(long, value_name = "DIR")]
    against: Option<PathBuf>,
    /// File to write, an .html (default: report.html in the folder of the results). An existing page is replaced.
    #[arg(long, value_name = "FILE", value_parser = output::html)]
    out: Option<PathBuf>,
    /// Write the game's pictures and the clips into a folder beside the page, such as report-files, instead of into the page.
    #[arg(long)]
    split: bool,
}

pub(crate) fn run_html(args: &HtmlArgs, games: &Games) -> Result<Outcome, CliError> {
    let folder = results_folder(&args.results);
    let lines = ResultLines::open(folder)?;
    let file = args.out.clone().unwrap_or_else(|| folder.join(REPORT));
    output::prepare(&file)?;
    let before = args.against.as_deref().map(results_folder);
    let comparison = before.map(|before| Comparison::read(before, folder)).transpose()?;
    let game = games.get(&lines.record().game).ok();
    if let Some(why) = without_pictures(game, lines.record()) {
        if args.out.is_none() && file.exists() {
            return Err(CliError::Usage(format!(
                "{} is kept, since a new page would have no pictures: {why}; write the new page beside it, with --out FILE",
                file.display()
            )));
        }
        report!("warning: the page has no pictures: {why}");
    }
    let (split, threads) = (args.split, default_threads());
    let results = Results { folder, against: before, game, json: false, keeps_failures: false, split, threads };
    write_page(&results, comparison.as_ref(), &file).map_err(|error| {
        output::with_advice(
            error,
            "the results are unchanged: make room or rights there, or name another file with --out",
        )
    })?;
    report!("{}", file.display());
    Ok(Outcome::Pass)
}

// `playbot report issues`.

/// List what is wrong with the levels of results, in a form that build servers and editors read.
///
/// Each finding is an issue, and each level that no tester solved and that has none. Levels of files are annotated at their
/// file. `github` prints commands of a workflow, which annotate the files of a pull request. A pinned finding has the lowest
/// severity, with the reason of its pin.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report issues runs/test --form github
  playbot report issues runs/test --form sarif --out levels.sarif
  playbot report issues runs/test --form code-quality --out gl-code-quality-report.json")]
pub struct IssuesArgs {
    /// Folder of the results.
    #[arg(value_name = "DIR")]
    results: PathBuf,
    /// The form: sarif (GitHub's code scanning, editors), code-quality (GitLab), warnings (Jenkins), or github (annotations).
    #[arg(long, value_parser = form)]
    form: IssueForm,
    /// File to write instead of standard output. An existing one is replaced.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

fn form(text: &str) -> Result<IssueForm, String> {
    let names: Vec<&str> = IssueForm::ALL.iter().map(|form| form.name()).collect();
    IssueForm::ALL
        .into_iter()
        .find(|form| form.name() == text)
        .ok_or_else(|| format!("it must be one of {}", names.join(", ")))
}

pub(crate) fn run_issues(args: &IssuesArgs) -> Result<Outcome, CliError> {
    args.out.as_deref().map(output::prepare).transpose()?;
    let text = issues(results_folder(&args.results), args.form)?;
    match &args.out {
        Some(file) => {
            output::write(file, text.as_bytes())?;
            report!("{}", file.display());
        }
        None if text.is_empty() => {}
        None => print_line(text.trim_end())?,
    }
    Ok(Outcome::Pass)
}

// `playbot report calibrate`.

/// Most levels to print; files have all.
const MOST_PRINTED: usize = 40;

/// Compare the results of a test with recordings of people on the same levels: time, deaths and completion of each
/// level, and how well each tester agrees with people on which levels are easy.
///
/// Agreement is a rank correlation over the levels, Spearman's and Kendall's, with 95 % intervals. It needs some ten
/// levels or more to be informative. Only episodes that people played to their end count. Each person counts once on a
/// level, under the name in the recording (`playbot play GAME --record my.demo --name alice`). Level files are matched
/// by their contents, whatever their names.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot report calibrate runs/test people.demo
  playbot report calibrate runs/test alice.demo bob.demo --out people.html
  playbot report calibrate runs/test people.demo --plot people.png
  playbot report calibrate runs/test recordings --json")]
pub struct CalibrateArgs {
    /// Folder of the results.
    #[arg(value_name = "DIR")]
    results: PathBuf,
    /// Recordings of people, or folders of them.
    #[arg(required = true, value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// File to write: a page with scatter plots (.html), or Markdown (.md).
    #[arg(long, value_name = "FILE", value_parser = page)]
    out: Option<PathBuf>,
    /// Draw the scatter plots into this file, a .png or .svg.
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    /// Print one line of JSON instead of tables.
    #[arg(long)]
    json: bool,
}

/// Parses the path of a page.
fn page(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("html" | "md") => Ok(path),
        _ => Err("it is written as .html or .md: choose one of them".to_owned()),
    }
}

pub(crate) fn run_calibrate(args: &CalibrateArgs, games: &Games) -> Result<Outcome, CliError> {
    let results = results_folder(&args.results);
    let lines = ResultLines::open(results)?;
    if let Some(out) = &args.out {
        output::prepare(out)?;
    }
    let plot = args.plot.as_deref().map(PlotFile::new).transpose()?;
    let game = games.get(&lines.record().game).ok();
    let found = Calibration::read(results, &args.recordings, game).map_err(explain)?;
    if args.json {
        let line = serde_json::to_string(&found)
            .map_err(|error| CliError::Io(format!("the comparison cannot be written as JSON: {error}")))?;
        print_line(line)?;
    } else {
        print_table(&found.agreement_table())?;
        print_line("")?;
        print_table(&found.level_table(MOST_PRINTED))?;
    }
    found.words().iter().for_each(|words| report!("{words}"));
    if let Some(out) = &args.out {
        let is_page = out.extension().is_some_and(|ending| ending == "html");
        let text = if is_page { found.to_html() } else { found.to_markdown() };
        output::write(out, text.as_bytes())?;
        report!("{}", out.display());
    }
    if let Some(plot) = plot {
        plot.write(&found.to_drawing())?;
        report!("plot: {}", plot.path().display());
    }
    Ok(Outcome::Pass)
}

fn explain(error: CalibrationError) -> CliError {
    match error {
        CalibrationError::Results(error) => error.into(),
        CalibrationError::Recording(error) => open::missing_recording_of_people(error),
        other => CliError::Usage(other.to_string()),
    }
}
