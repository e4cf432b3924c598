//! `playbot report calibrate`.

use std::path::PathBuf;

use playbot_lab::{
    calibration::{Calibration, CalibrationError},
    games::Games,
    verdict::{ResultLines, results_folder},
};

use crate::{
    error::{CliError, Outcome, print_line},
    open, output,
    plot::PlotFile,
};

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
pub struct Args {
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

pub fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
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
        print_line(found.agreement_table().to_text())?;
        print_line(found.level_table(MOST_PRINTED).to_text().trim_end())?;
    }
    found.words().iter().for_each(|words| tell!("{words}"));
    if let Some(out) = &args.out {
        let is_page = out.extension().is_some_and(|ending| ending == "html");
        let text = if is_page { found.to_html() } else { found.to_markdown() };
        output::write(out, text.as_bytes())?;
        tell!("{}", out.display());
    }
    if let Some(plot) = plot {
        plot.write(&found.to_drawing())?;
        tell!("plot: {}", plot.path().display());
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
