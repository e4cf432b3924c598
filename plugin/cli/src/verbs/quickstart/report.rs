//! The report of the quickstart.

use crate::{
    error::CliError,
    verbs::quickstart::{CurvePoint, Trained},
};
use playbot_report::{Chart, Curve, Report, ResultRow, ResultTable, Section, Table, times};
use playbot_train::{
    Experiment,
    metrics_log::{SUCCESS_RATE, range_of},
};
use std::path::Path;

/// Writes the report as one HTML file.
pub(super) fn write_report(
    path: &Path,
    experiment: &Experiment,
    trained: &[Trained],
    rows: &[ResultRow],
    comparison: &str,
    seconds: f64,
) -> Result<(), CliError> {
    let curve = |value: fn(&CurvePoint) -> f64| -> Vec<Curve> {
        let points = |one: &Trained| one.curve.iter().map(|point| (point.step as f64, value(point))).collect();
        trained.iter().map(|one| Curve::new(one.algorithm.name(), points(one))).collect()
    };
    let chart = |title: &str, y_label: &str, curves| Chart {
        title: title.to_owned(),
        x_label: "environment steps".to_owned(),
        y_label: y_label.to_owned(),
        curves,
        y_range: None,
        ..Chart::default()
    };
    let references = paper_rows(&experiment.game);
    let orientation = match references.is_empty() {
        true => "",
        false => "The paper does not say which unseen levels it used; its figures are shown for orientation. ",
    };
    let times = times(experiment.eval.episodes_per_level);
    let table = ResultTable {
        caption: format!(
            "Return per episode on {}, each level {times}, ± one standard error over the levels; steps/s are those of the \
             training where there was one",
            experiment.test
        ),
        rows: rows.to_vec(),
        references,
    };
    let config = ron::ser::to_string_pretty(experiment, ron::ser::PrettyConfig::default())
        .map_err(|error| CliError::Io(format!("cannot write the experiment as RON: {error}")))?;
    let faulty = trained.iter().filter(|one| !one.diagnosis.is_healthy());
    let why = faulty.map(|one| {
        let section = one.diagnosis.section();
        Section { heading: format!("{}: {}", one.algorithm, section.heading), ..section }
    });
    let report = Report {
        title: format!("{}: skills from recordings, tested on unseen levels", experiment.game),
        subtitle: format!(
            "{} steps on {}, seed {}, {seconds:.0} seconds on this machine",
            experiment.steps, experiment.train, experiment.seed
        ),
        sections: why
            .chain([
                Section {
                    heading: "Unseen levels".to_owned(),
                    text: format!(
                        "{comparison}.\n\n{orientation}A blind player is a baseline that any learner must beat."
                    ),
                    tables: vec![Table::Results(table)],
                    ..Section::default()
                },
                Section {
                    heading: "Learning curves".to_owned(),
                    text: "Means over the last 100 training episodes.".to_owned(),
                    charts: vec![
                        chart("Return on training levels", "return", curve(|point| point.episodic_return)),
                        Chart {
                            y_range: range_of(SUCCESS_RATE),
                            ..chart("Success on training levels", "success rate", curve(|point| point.success_rate))
                        },
                    ],
                    ..Section::default()
                },
                Section { heading: "Experiment".to_owned(), code: vec![config], ..Section::default() },
            ])
            .collect(),
    };
    report.write(path).map_err(|error| CliError::Io(error.to_string()))
}

/// The game of the paper's measurements.
const GAME_OF_THE_PAPER: &str = "coinrun";

/// Returns Table 3 of the paper: 64 unseen hard levels, 100,000 steps of evaluation. Empty for other games.
fn paper_rows(game: &str) -> Vec<ResultRow> {
    if game != GAME_OF_THE_PAPER {
        return Vec::new();
    }
    let row = |method: &str, return_mean, return_se| ResultRow {
        method: method.to_owned(),
        split: "64 unseen hard levels".to_owned(),
        episodes: 0,
        return_mean,
        return_se,
        level_returns: Vec::new(),
        success: f64::NAN,
        length_mean: f64::NAN,
        steps_per_s: None,
    };
    vec![row("SCORE-PPO, paper", 5.32, 0.0), row("PPO, paper", 1.63, 0.03)]
}
