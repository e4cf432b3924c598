//! `playbot runs show`.

use crate::{
    arguments::default_experiment_of,
    error::{CliError, Outcome},
    output,
    output::{print_line, print_table, program},
    verbs::runs::{UNKNOWN, age_s, duration, to_json, write_plot},
};
use playbot_harness::games::Games;
use playbot_learner::EntitySet;
use playbot_report::{Chart, Curve, PlainTable, counted, readable, sparkline, to_svg, whole};
use playbot_train::{
    Experiment,
    checkpoint::{Checkpoint, CheckpointSummary},
    diagnose::of_metrics,
    metrics_log::{EPISODIC_RETURN, SUCCESS_RATE, range_of},
    run_dir::Ancestor,
    runs::{RunCurves, RunRecord, changed_settings, with_defaults},
    self_play::ladder::Ladder,
};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Characters of a curve drawn as text.
const SPARKS: usize = 60;

/// Show the settings in which a run differs from the defaults, its curves and all its metrics.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  playbot runs show runs/first
  playbot runs show runs/first --plot first.svg --metric charts/episodic_return --metric losses/entropy
  playbot runs show runs/first --json")]
pub struct Args {
    /// Folder of the run.
    run: PathBuf,
    /// Metric to draw (default: return and success rate, repeatable).
    #[arg(long)]
    metric: Vec<String>,
    /// Draw the curves into this SVG file.
    #[arg(long, value_name = "FILE.svg", value_parser = output::svg)]
    plot: Option<PathBuf>,
    /// Print everything as one line of JSON.
    #[arg(long)]
    json: bool,
}

pub(crate) fn run(args: &Args, games: &Games) -> Result<Outcome, CliError> {
    let run = RunRecord::read(&args.run)?;
    run.curves.warnings().iter().for_each(|warning| report!("warning: {warning}"));
    let curves = curves(&run, &args.metric)?;
    if args.plot.is_some() && curves.is_empty() {
        return Err(CliError::Usage(format!(
            "{}: no episode has ended yet, so there is no curve to draw: train for longer, or name a --metric",
            run.path.display()
        )));
    }
    let ladder = Ladder::read(&run.path)?;
    if args.json {
        let mut all = full_json(&run);
        if let Some(ladder) = &ladder {
            all["ladder"] = json!(ladder);
        }
        print_line(all)?;
    } else {
        print_findings(&run)?;
        print_head(&run, games)?;
        print_curves(&curves)?;
        print_table(&metrics(&run))?;
        if let Some(ladder) = &ladder {
            print_line("")?;
            print_table(&ladder.to_table())?;
        }
    }
    if let Some(path) = &args.plot {
        let mut charts: Vec<Chart> = curves.into_iter().map(|(tag, curve)| chart(&run, tag, curve)).collect();
        charts.extend(ladder.map(|ladder| ladder.to_chart()));
        write_plot(path, &to_svg(&charts))?;
    }
    Ok(Outcome::Pass)
}

type TaggedCurve<'a> = (&'a str, &'a [(u64, f64)]);

/// Returns the requested curves, or return and success rate as far as they exist: perhaps no episode has ended yet.
fn curves<'a>(run: &'a RunRecord, wanted: &'a [String]) -> Result<Vec<TaggedCurve<'a>>, CliError> {
    if !wanted.is_empty() {
        return wanted.iter().map(|tag| Ok((tag.as_str(), run.curve(tag)?))).collect();
    }
    let default = [EPISODIC_RETURN, SUCCESS_RATE];
    Ok(default.into_iter().map(|tag| (tag, run.curves.curve(tag))).filter(|(_, curve)| !curve.is_empty()).collect())
}

/// Prints what settings and metrics show of why it does not learn, if they show anything.
fn print_findings(run: &RunRecord) -> Result<(), CliError> {
    let diagnosis = of_metrics(&run.experiment, &run.path)?;
    diagnosis.findings.iter().try_for_each(|finding| {
        let words = finding.warning(&diagnosis.context);
        print_line(format!("why it may not learn: {}", program::named(&words)))
    })
}

fn print_head(run: &RunRecord, games: &Games) -> Result<(), CliError> {
    let (info, experiment) = (&run.info, &run.experiment);
    print_line(format!(
        "{}: {} on {} with version {} of its rules, seed {}, by playbot {} ({}) on {}{}",
        run.path.display(),
        info.algorithm,
        experiment.game,
        info.game_version,
        info.seed,
        info.version,
        info.revision,
        info.device,
        info.skills.as_ref().map_or(String::new(), |skills| format!(", skill model {skills}"))
    ))?;
    for (place, ancestor) in info.begun_from.iter().flat_map(Ancestor::chain).enumerate() {
        print_line(describe_ancestor(ancestor, place == 0))?;
    }
    let state = match (run.is_finished(), run.is_training) {
        (true, _) => "finished",
        (false, true) => "training",
        (false, false) => "not finished",
    };
    let speed = run.curves.steps_per_s().map_or(String::new(), |speed| format!(", {} steps/s", whole(speed)));
    let age = age_s(run).map_or(String::new(), |age| format!(", updated {} ago", duration(age)));
    let (done, planned) = (whole(run.steps() as f64), whole(experiment.whole_steps() as f64));
    let logged = match run.curves.last_step() {
        logged if logged > run.steps() => format!(" (those after it, up to {}, are not saved)", whole(logged as f64)),
        _ => String::new(),
    };
    print_line(format!("{done} of {planned} steps{logged}, {state}{speed}{age}"))?;
    print_line(format!(
        "trained on {}, held out {}, {} in {}",
        experiment.train,
        experiment.test,
        counted(u64::from(experiment.arenas), "arena"),
        counted(u64::from(experiment.worlds), "World")
    ))?;
    for set in EntitySet::all_in(&info.observed) {
        print_line(format!("sees a set of {set}"))?;
    }
    print_line(describe_settings(experiment, games))?;
    for Checkpoint { path, summary } in &run.checkpoints {
        let value = rating(summary, &run.curves);
        print_line(format!("checkpoint: {} ({value})", path.display()))?;
    }
    print_line("")
}

/// Describes the run that a run began with, or, not being `first`, that its ancestor began with.
fn describe_ancestor(ancestor: &Ancestor, first: bool) -> String {
    let Ancestor { run, step, algorithm, checksum, taken, anew, new_inputs, .. } = ancestor;
    let what = if taken.is_empty() && algorithm.is_some() { "skills" } else { "weights" };
    let begun = if first { "begun with" } else { "which began with" };
    let mut text = format!("{begun} the {what} of {} at step {}", run.display(), whole(*step as f64));
    if let (Some(algorithm), Some(checksum)) = (algorithm, checksum) {
        text += &format!(" ({algorithm}, checksum {checksum})");
    }
    if *new_inputs > 0 {
        text += &format!(", with {} at weight 0", counted(*new_inputs as u64, "new input"));
    }
    if !anew.is_empty() {
        text += &format!(", anew: {}", anew.join(", "));
    }
    text
}

/// Describes the rating of a checkpoint in training. Before the 100th episode has ended only the log has it.
fn rating(summary: &CheckpointSummary, curves: &RunCurves) -> String {
    if let Some(elo) = summary.elo {
        return format!("rating {elo:.0}");
    }
    if let Some(value) = summary.episodic_return {
        return format!("return {value:.2}");
    }
    let logged = curves.curve(EPISODIC_RETURN).iter().find(|(step, value)| *step == summary.step && !value.is_nan());
    match logged {
        Some((_, value)) => format!("return {value:.2}, of fewer than 100 episodes"),
        None => "no episode yet".to_owned(),
    }
}

/// Describes the changed settings of an experiment: against the program's experiment, the game's, or the defaults of
/// all keys, whichever is nearest. A run does not note its base.
fn describe_settings(experiment: &Experiment, games: &Games) -> String {
    let own = games.get(&experiment.game).ok().and_then(default_experiment_of);
    let default = default_experiment_of(games.first()).into_iter().chain(own);
    let defaults = ("the defaults".to_owned(), with_defaults(experiment));
    let bases = default.map(|default| (default.origin, default.experiment)).chain([defaults]);
    let nearest = bases
        .map(|(origin, base)| (origin, changed_settings(experiment, &base)))
        .min_by_key(|(_, changed)| changed.len());
    let (origin, changed) = nearest.unwrap_or_default();
    let changed: Vec<String> = changed.iter().map(|(key, value)| format!("{key}={value}")).collect();
    match changed.is_empty() {
        true => format!("settings: those of {origin}"),
        false => format!("settings: those of {origin}, but for {}", changed.join(", ")),
    }
}

fn print_curves(curves: &[TaggedCurve]) -> Result<(), CliError> {
    for (tag, curve) in curves {
        let values: Vec<f64> = curve.iter().map(|(_, value)| *value).collect();
        print_line(format!("{tag}\n  {}", sparkline(&values, SPARKS)))?;
    }
    if curves.is_empty() { print_line("no episode has ended yet\n") } else { print_line("") }
}

/// Returns the first, the lowest, the highest and the last point that is a number; means over episodes begin at the
/// 100th episode.
fn extremes(curve: &[(u64, f64)]) -> Option<[(u64, f64); 4]> {
    let known = || curve.iter().copied().filter(|(_, value)| !value.is_nan());
    // The first of equal values is shown.
    let lowest = known().reduce(|best, point| if point.1 < best.1 { point } else { best })?;
    let highest = known().reduce(|best, point| if point.1 > best.1 { point } else { best })?;
    Some([known().next()?, lowest, highest, known().next_back()?])
}

fn metrics(run: &RunRecord) -> PlainTable {
    let columns = ["metric", "first", "lowest", "at step", "highest", "at step", "last"];
    let rows = run.curves.iter().map(|(tag, _)| {
        let Some([first, lowest, highest, last]) = extremes(run.curves.settled_or_all(tag)) else {
            return vec![tag.to_owned(), UNKNOWN.to_owned()];
        };
        let (low_step, high_step) = (whole(lowest.0 as f64), whole(highest.0 as f64));
        vec![
            tag.to_owned(),
            readable(first.1),
            readable(lowest.1),
            low_step,
            readable(highest.1),
            high_step,
            readable(last.1),
        ]
    });
    PlainTable { columns: columns.map(str::to_owned).to_vec(), rows: rows.collect(), ..PlainTable::default() }
}

fn full_json(run: &RunRecord) -> Value {
    let point = |(step, value): (u64, f64)| json!({ "step": step, "value": value });
    let metrics: serde_json::Map<String, Value> = run
        .curves
        .iter()
        .filter_map(|(tag, _)| {
            let [first, lowest, highest, last] = extremes(run.curves.settled_or_all(tag))?.map(point);
            Some((tag.to_owned(), json!({ "first": first, "lowest": lowest, "highest": highest, "last": last })))
        })
        .collect();
    let mut all = to_json(run);
    all["experiment"] = json!(run.experiment);
    all["metrics"] = Value::Object(metrics);
    all
}

fn chart(run: &RunRecord, tag: &str, curve: &[(u64, f64)]) -> Chart {
    let points = curve.iter().map(|(step, value)| (*step as f64, *value)).collect();
    Chart {
        title: format!("{}: {tag}", run.path.display()),
        x_label: "environment steps".to_owned(),
        y_label: format!("{} on {}, seed {}", run.info.algorithm, run.experiment.game, run.info.seed),
        curves: vec![Curve::new("", points)],
        y_range: range_of(tag),
        ..Chart::default()
    }
}

#[cfg(test)]
mod tests {
    use playbot_harness::{foreign::ForeignGame, game::Game};

    use super::*;
    use crate::arguments::experiment::ExperimentArgs;

    #[test]
    fn a_checkpoint_of_few_episodes_has_the_return_that_was_logged() {
        let folder = tempfile::tempdir().expect("a folder");
        let lines = "{\"step\":8,\"charts/episodic_return\":null}\n{\"step\":16,\"charts/episodic_return\":5.302}\n";
        std::fs::write(folder.path().join("metrics.jsonl"), lines).expect("writable");
        let curves = RunCurves::read(folder.path()).expect("readable");
        let rated = |step, episodic_return| {
            rating(&CheckpointSummary { step, episodic_return, ..CheckpointSummary::default() }, &curves)
        };
        let found = [rated(0, None), rated(8, None), rated(16, None), rated(16, Some(7.0))];
        let few = "return 5.30, of fewer than 100 episodes";
        assert_eq!(found, ["no episode yet", "no episode yet", few, "return 7.00"]);
    }

    #[test]
    fn only_what_somebody_set_is_named() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let games = [&game as &dyn Game];
        let games = Games::new(&games).expect("one game");
        let default = ExperimentArgs::default().load(&games, []).expect("that of the game");
        assert_eq!(describe_settings(&default, &games), "settings: those of the experiment of runner");
        let changed = default.with_set(&["ppo.gamma=0.5", "seed=7"]).expect("valid");
        let words = "settings: those of the experiment of runner, but for ppo.gamma=0.5, seed=7";
        assert_eq!(describe_settings(&changed, &games), words);
        // Of a game that the program does not have.
        let foreign = changed.with_set(&["game=chess", "train=a:0..3", "test=a:4..7", "demos=d", "steps=9"]);
        let words = "settings: those of the defaults, but for ppo.gamma=0.5, seed=7";
        assert_eq!(describe_settings(&foreign.expect("valid"), &games), words);
    }
}
