//! `playbot runs compare`.

use crate::{
    arguments::finite_number,
    error::{CliError, Outcome},
    output,
    output::{print_line, print_table},
    verbs::runs::write_plot,
};
use playbot_report::{Chart, Curve, PlainTable, readable, readable_with_spread, statistics::mean_and_sd, whole};
use playbot_train::{
    metrics_log::{EPISODE_MEANS, SUCCESS_RATE, range_of},
    runs::{GroupStatistics, RunGroup, RunRecord, find_runs, group_runs, mean_and_spread},
};
use serde_json::json;
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Compare runs. Runs of the same experiment and algorithm with different seeds are one group, with mean and sample
/// standard deviation. The label of a group names its differences from the others.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot runs compare runs/quickstart
  playbot runs compare runs/ppo-1 runs/ppo-2 runs/ppo-3 runs/score-1 runs/score-2 runs/score-3 --plot success.svg
  playbot runs compare runs/study --metric charts/episodic_return --threshold 8 --json")]
pub struct Args {
    /// Folders of runs, or folders with runs below them.
    #[arg(required = true)]
    runs: Vec<PathBuf>,
    /// The metric, by its TensorBoard tag (default: charts/success_rate).
    #[arg(long)]
    metric: Option<String>,
    /// Count the steps until the metric first reaches this value (default for the success rate: the runs'
    /// `study.threshold`). Means over the last 100 episodes count from the 100th episode on.
    #[arg(long, value_parser = finite_number)]
    threshold: Option<f64>,
    /// Draw mean and spread over the seeds into this SVG file.
    #[arg(long, value_name = "FILE.svg", value_parser = output::svg)]
    plot: Option<PathBuf>,
    /// One line of JSON per group.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args) -> Result<Outcome, CliError> {
    let mut runs = read(&args.runs)?;
    if runs.iter().any(|run| run.curves.last_step() > 0) {
        // Behaviour cloning trains nothing, and a run that has just begun has nothing to show.
        for run in runs.extract_if(.., |run| run.curves.last_step() == 0) {
            report!("warning: {} is left out: it has no metrics", run.path.display());
        }
    }
    let metric = args.metric.as_deref().unwrap_or(SUCCESS_RATE);
    let has_metric = |run: &RunRecord| !run.curves.curve(metric).is_empty();
    if runs.iter().all(|run| run.curves.last_step() > 0) && (args.metric.is_none() || runs.iter().any(has_metric)) {
        for run in runs.extract_if(.., |run| !has_metric(run)) {
            report!("warning: {} is left out: it has no {metric}{}", run.path.display(), why_not(metric));
        }
        if runs.is_empty() {
            report!("nothing to compare yet: train for longer, or name another --metric");
            return Ok(Outcome::Pass);
        }
    }
    let groups = group_runs(&runs);
    let curves = mean_and_spread(&groups, metric)?;
    groups.iter().flat_map(RunGroup::warnings).for_each(|warning| report!("warning: {warning}"));
    let threshold = args.threshold.or_else(|| if metric == SUCCESS_RATE { common_threshold(&runs) } else { None });
    let rows: Vec<_> = groups.iter().map(|group| GroupStatistics::new(group, metric, threshold)).collect();
    if args.json {
        for (group, row) in groups.iter().zip(&rows) {
            let paths: Vec<&Path> = group.runs.iter().map(|run| run.path.as_path()).collect();
            print_line(json!({
                "metric": metric, "threshold": threshold, "group": row, "settings": group.differing, "runs": paths,
            }))?;
        }
    } else {
        print_table(&table(metric, threshold, &rows))?;
        print_settings(&groups)?;
    }
    if let Some(path) = &args.plot {
        write_plot(path, &chart(metric, &groups, curves).to_svg())?;
    }
    Ok(Outcome::Pass)
}

/// Explains why a run may lack a metric, where known.
fn why_not(metric: &str) -> &'static str {
    if EPISODE_MEANS.contains(&metric) { ", since no episode has ended" } else { "" }
}

/// Reads the runs at all paths, each of them once. Damaged runs are left out, unless they were named themselves or
/// there is no other.
fn read(paths: &[PathBuf]) -> Result<Vec<RunRecord>, CliError> {
    let (mut seen, mut runs, mut damaged) = (Vec::new(), Vec::new(), None);
    for folder in paths {
        // A missing path counts as a run, so that the error is about a run.
        let found = if folder.is_dir() { find_runs(folder)? } else { vec![folder.clone()] };
        for path in found {
            let same = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
            if seen.contains(&same) {
                continue;
            }
            seen.push(same);
            match RunRecord::read(&path) {
                Ok(run) => {
                    run.curves.warnings().iter().for_each(|warning| report!("warning: {warning}"));
                    runs.push(run);
                }
                Err(error) if path != *folder => {
                    report!("warning: {} is left out: {error}", path.display());
                    damaged.get_or_insert(error);
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
    match damaged {
        Some(error) if runs.is_empty() => Err(error.into()),
        _ => Ok(runs),
    }
}

/// Returns the threshold of the success rate, if the experiments of all runs have the same.
fn common_threshold(runs: &[RunRecord]) -> Option<f64> {
    let threshold = |run: &RunRecord| run.experiment.study.threshold;
    let first = runs.first().map(threshold)?;
    if runs.iter().all(|run| threshold(run) == first) {
        return Some(first);
    }
    report!("warning: the runs differ in study.threshold, so no steps are counted: choose one with --threshold");
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
        row.extend(threshold.map(|_| reached(&group.steps_to_threshold, group.too_few_episodes)));
        row.push(whole(group.steps_per_s));
        row
    };
    PlainTable { caption: metric.to_owned(), columns, rows: groups.iter().map(row).collect() }
}

/// Describes mean and range of the steps to the threshold. Adds the number of runs that did not reach it, and of those
/// with too few episodes.
fn reached(steps: &[Option<u64>], early: usize) -> String {
    let known: Vec<f64> = steps.iter().flatten().map(|step| *step as f64).collect();
    let (all, never) = (steps.len(), steps.len() - known.len() - early);
    let mut parts = Vec::new();
    if let (Some(least), Some(most)) = (known.iter().copied().reduce(f64::min), known.iter().copied().reduce(f64::max))
    {
        let range = if known.len() > 1 { format!(" ({} to {})", whole(least), whole(most)) } else { String::new() };
        parts.push(whole(mean_and_sd(&known).0) + &range);
    }
    for (count, words) in [(never, "never"), (early, "too few episodes")] {
        if count > 0 {
            parts.push(format!("{words} in {count} of {all}"));
        }
    }
    parts.join(", ")
}

/// Prints the differences between the groups, where their labels do not show them.
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
        y_range: range_of(metric),
        ..Chart::default()
    }
}
