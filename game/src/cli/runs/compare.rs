//! `playbot runs compare`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use bevy_playbot::{
    report::{Chart, Curve, PlainTable, readable, readable_with_spread, statistics::mean_and_sd, whole},
    runs::{GroupStatistics, RunGroup, RunRecord, find_runs, group_runs, mean_and_spread},
    train::metrics_log::SUCCESS_RATE,
};
use serde_json::json;

use super::{
    super::{
        error::{CliError, Outcome, print_line},
        output,
    },
    write_plot,
};

/// Compares runs. Runs of the same experiment and algorithm with different seeds are one group, with mean and sample
/// standard deviation; the label of a group names what sets it apart.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot runs compare runs/quickstart
  playbot runs compare runs/ppo-1 runs/ppo-2 runs/ppo-3 runs/score-1 runs/score-2 runs/score-3 --plot success.svg
  playbot runs compare runs/study --metric charts/episodic_return --threshold 8 --json")]
pub struct Args {
    /// Folders of runs, or folders with runs below them.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// The metric, by its TensorBoard tag.
    #[arg(long, default_value = SUCCESS_RATE)]
    metric: String,
    /// Count the steps until the metric first reaches this value; for the success rate the runs' `study.threshold`
    /// if not given.
    #[arg(long)]
    threshold: Option<f64>,
    /// Draw mean and spread over the seeds into this SVG file.
    #[arg(long, value_name = "FILE.svg", value_parser = output::svg)]
    plot: Option<PathBuf>,
    /// One line of JSON per group.
    #[arg(long)]
    json: bool,
}

pub fn run(args: &Args) -> Result<Outcome, CliError> {
    let mut runs = read(&args.runs)?;
    if runs.iter().any(|run| run.curves.last_step() > 0) {
        // Behaviour cloning trains nothing, and a run that has just begun has nothing to show.
        for run in runs.extract_if(.., |run| run.curves.last_step() == 0) {
            eprintln!("warning: {} is left out: it has no metrics", run.path.display());
        }
    }
    let groups = group_runs(&runs);
    let curves = mean_and_spread(&groups, &args.metric)?;
    groups.iter().flat_map(RunGroup::warnings).for_each(|warning| eprintln!("warning: {warning}"));
    let threshold = args.threshold.or_else(|| if args.metric == SUCCESS_RATE { common_threshold(&runs) } else { None });
    let rows: Vec<_> = groups.iter().map(|group| GroupStatistics::new(group, &args.metric, threshold)).collect();
    if args.json {
        for (group, row) in groups.iter().zip(&rows) {
            let paths: Vec<&Path> = group.runs.iter().map(|run| run.path.as_path()).collect();
            print_line(json!({
                "metric": args.metric, "threshold": threshold, "group": row, "settings": group.differing, "runs": paths,
            }))?;
        }
    } else {
        print_line(table(&args.metric, threshold, &rows).to_text().trim_end())?;
        print_settings(&groups)?;
    }
    if let Some(path) = &args.plot {
        write_plot(path, &chart(&args.metric, &groups, curves).to_svg())?;
    }
    Ok(Outcome::Pass)
}

/// Reads the runs at all paths, each of them once.
fn read(paths: &[PathBuf]) -> Result<Vec<RunRecord>, CliError> {
    let (mut seen, mut runs) = (Vec::new(), Vec::new());
    for folder in paths {
        for path in find_runs(folder)? {
            let same = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
            if seen.contains(&same) {
                continue;
            }
            seen.push(same);
            let run = RunRecord::read(&path)?;
            run.curves.warnings().iter().for_each(|warning| eprintln!("warning: {warning}"));
            runs.push(run);
        }
    }
    Ok(runs)
}

/// The success rate whose first step the experiments of all runs look for.
fn common_threshold(runs: &[RunRecord]) -> Option<f64> {
    let threshold = |run: &RunRecord| run.experiment.study.threshold;
    let first = runs.first().map(threshold)?;
    if runs.iter().all(|run| threshold(run) == first) {
        return Some(first);
    }
    eprintln!("warning: the runs differ in study.threshold, so no steps are counted: choose one with --threshold");
    None
}

fn table(metric: &str, threshold: Option<f64>, groups: &[GroupStatistics]) -> PlainTable {
    let mut columns: Vec<String> =
        ["group", "seeds", "last, mean ± s.d.", "lowest", "highest"].map(str::to_owned).to_vec();
    columns.extend(threshold.map(|threshold| format!("steps to {threshold}")));
    columns.push("steps/s".to_owned());
    let row = |group: &GroupStatistics| {
        let seeds: Vec<String> = group.seeds.iter().map(u64::to_string).collect();
        let last = match group.seeds.len() {
            1 => readable(group.last_mean),
            _ => readable_with_spread(group.last_mean, group.last_sd),
        };
        let mut row = vec![group.label.clone(), seeds.join(" "), last];
        row.extend([readable(group.lowest), readable(group.highest)]);
        row.extend(threshold.map(|_| reached(&group.steps_to_threshold)));
        row.push(whole(group.steps_per_s));
        row
    };
    PlainTable { caption: metric.to_owned(), columns, rows: groups.iter().map(row).collect() }
}

/// Mean and range of the steps to the threshold, and how many runs never got there.
fn reached(steps: &[Option<u64>]) -> String {
    let known: Vec<f64> = steps.iter().flatten().map(|step| *step as f64).collect();
    let never = steps.len() - known.len();
    let (Some(least), Some(most)) = (known.iter().copied().reduce(f64::min), known.iter().copied().reduce(f64::max))
    else {
        return format!("never in {never} of {never}");
    };
    let mut text = whole(mean_and_sd(&known).0);
    if known.len() > 1 {
        text += &format!(" ({} to {})", whole(least), whole(most));
    }
    if never > 0 {
        text += &format!(", never in {never} of {}", steps.len());
    }
    text
}

/// What differs between the groups, where their labels do not say it.
fn print_settings(groups: &[RunGroup]) -> Result<(), CliError> {
    for group in groups {
        let hidden = group.differing.iter().filter(|(key, value)| !group.label.contains(&format!("{key}={value}")));
        let hidden: Vec<String> = hidden.map(|(key, value)| format!("{key}={value}")).collect();
        if !hidden.is_empty() {
            print_line(format!("{}: {}", group.label, hidden.join(", ")))?;
        }
    }
    Ok(())
}

fn chart(metric: &str, groups: &[RunGroup], curves: Vec<Curve>) -> Chart {
    let has = |wanted: fn(usize) -> bool| groups.iter().any(|group| wanted(group.runs.len()));
    let y_label = match (has(|n| n == 2), has(|n| n > 2)) {
        (false, false) => "one seed each",
        (true, false) => "mean over the seeds; shaded: from the lower to the higher one",
        (false, true) => "mean over the seeds; shaded: ± 1 standard deviation",
        (true, true) => "mean over the seeds; shaded: ± 1 standard deviation, the range where there are only two",
    };
    Chart {
        title: metric.to_owned(),
        x_label: "environment steps".to_owned(),
        y_label: y_label.to_owned(),
        curves,
        marks: Vec::new(),
    }
}
