//! Studies as Markdown: means over the seeds, the numbers of every seed, and the command to run again; the experiment
//! beside them; and the cost of their runs.

use crate::{
    run_dir::COST,
    study::{StudyReport, StudyResult, StudyRun, TestResult, TrainingResult},
};
use playbot_harness::{
    brief::shell_word,
    sealed_file::{SealedFileError, read_sealed, write_atomically, write_sealed},
};
use playbot_learner::HasExitCode;
use playbot_report::{
    counted,
    number::{UNKNOWN, fixed, mean_and_error},
    statistics::mean_and_sd,
    to_svg, whole,
};
use serde::{Deserialize, Serialize};
use std::{
    fmt::Write,
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};
use thiserror::Error;

/// The name of the experiment beside the table.
pub const EXPERIMENT: &str = "experiment.ron";

/// The first words of the experiment beside a table. Other files of that name do not begin with them.
pub const EXPERIMENT_HEAD: &str = "// The experiment of the table beside it, with all values: ";

impl StudyReport {
    /// Returns the page: command, tables, the plot `curves.svg`, the changes of each variant, and a link to the
    /// [experiment](Self::to_ron).
    pub fn to_markdown(&self) -> String {
        let experiment = &self.experiment;
        let mut page = format!("# {}: {}\n\n", experiment.game, self.variants().join(", "));
        let _ = write!(page, "```sh\n{}\n```\n\n{}\n\n{}\n", self.command, self.conditions(), self.summary());
        page += &self.differences();
        page += &self.intervals();
        page += &self.with_seen();
        page += &self.drawn_words();
        page += "![Learning curves](curves.svg)\n\n## Each seed\n\n";
        let _ = write!(page, "± is the standard error of a measurement, over its levels.\n\n{}\n", self.every_seed());
        page += "## The experiment\n\n";
        for variant in &experiment.variants {
            let changes = variant.set.iter().map(|set| format!("`{set}`")).collect::<Vec<_>>();
            let changes = if changes.is_empty() { "as in the file".to_owned() } else { changes.join(", ") };
            let _ = writeln!(page, "- **{}**: {changes}", variant.name);
        }
        let blank = if experiment.variants.is_empty() { "" } else { "\n" };
        let _ = writeln!(page, "{blank}All values are in [{EXPERIMENT}]({EXPERIMENT}).");
        page
    }

    /// Says which variants the plot shows, if it does not show all that were trained.
    fn drawn_words(&self) -> String {
        match self.drawn() {
            (drawn, others @ 1..) => format!(
                "The picture shows the first {} of {} trained variants: {}. The other {others} are in the tables.\n\n",
                drawn.len(),
                drawn.len() + others,
                drawn.join(", ")
            ),
            _ => String::new(),
        }
    }

    /// Returns the experiment with all its values, seeds and variants, for a file in `folder`. It begins with the
    /// command that repeats the study.
    ///
    /// # Errors
    ///
    /// The path of the demonstrations is not Unicode.
    pub fn to_ron(&self, folder: &Path) -> Result<String, ron::Error> {
        let experiment = &self.experiment;
        let program = self.command.split_once(" study").map_or("playbot", |(program, _)| program);
        let file = shell_word(&folder.join(EXPERIMENT).display().to_string()).replace(['\n', '\r'], "?");
        let demos =
            experiment.demos.as_deref().filter(|_| self.results.iter().any(|run| run.algorithm.learns_from_demos()));
        let demos = demos.map_or(String::new(), |path| {
            format!(" Its recordings, {:?}, have to be there.", path.display().to_string())
        });
        let seeds: Vec<String> = experiment.seeds.iter().map(u64::to_string).collect();
        let mut variants = String::new();
        for variant in &experiment.variants {
            let set = variant.set.iter().map(ron::to_string).collect::<Result<Vec<_>, _>>()?;
            let _ =
                writeln!(variants, "        (name: {}, set: [{}]),", ron::to_string(&variant.name)?, set.join(", "));
        }
        // Seeds and variants are lists to read: all seeds in one line, and each variant in one.
        let mut text = experiment.without_study().to_ron()?.replace("\r\n", "\n");
        text = text.replacen("\n    seeds: [],", &format!("\n    seeds: [{}],", seeds.join(", ")), 1);
        if !variants.is_empty() {
            text = text.replacen("\n    variants: [],", &format!("\n    variants: [\n{variants}    ],"), 1);
        }
        Ok(format!("{EXPERIMENT_HEAD}`{program} study --experiment {file}`\n// repeats it.{demos}\n{text}\n"))
    }

    /// Returns the table of means over the seeds, one row for each variant.
    pub fn summary(&self) -> String {
        let threshold = format!("steps to {} success", rate_cell(self.experiment.study.threshold));
        let headings =
            ["variant", &threshold, "training success", "training return", "held-out success", "held-out return"];
        let rows = self.variants().into_iter().map(|variant| {
            let runs = self.of(variant);
            let trained = |value: fn(&TrainingResult) -> Option<f64>| {
                let values: Vec<f64> = runs.iter().filter_map(|run| value(run.training.as_ref()?)).collect();
                values
            };
            let tested = |value: fn(&StudyResult) -> f64| runs.iter().map(|run| value(run)).collect::<Vec<f64>>();
            vec![
                variant.to_owned(),
                steps_cell(&runs),
                share_cell(&trained(|training| training.success)),
                mean_cell(&trained(|training| training.episodic_return), 2),
                share_cell(&tested(|run| run.test.success)),
                mean_cell(&tested(|run| run.test.return_mean), 2),
            ]
        });
        markdown_table(&headings, rows)
    }

    /// Returns the table of all held-out levels, with those that some run knows; empty if they were not measured.
    pub fn with_seen(&self) -> String {
        let rows = self.variants().into_iter().map(|variant| {
            let runs: Option<Vec<_>> = self.of(variant).iter().map(|run| run.with_seen.as_ref()).collect();
            let runs = runs?;
            let values = |value: fn(&TestResult) -> f64| runs.iter().map(|test| value(test)).collect::<Vec<f64>>();
            let (success, returns) = (values(|test| test.success), values(|test| test.return_mean));
            Some(vec![variant.to_owned(), share_cell(&success), mean_cell(&returns, 2)])
        });
        let Some(rows) = rows.collect::<Option<Vec<_>>>().filter(|rows| !rows.is_empty()) else {
            return String::new();
        };
        let (test, known) = (&self.experiment.test, self.known_levels().len() as u64);
        format!(
            "All {} of {test}, with the {} that some run knows. The figures are means ± standard deviations over the seeds, \
             and no measure of new levels.\n\n{}\n",
            count_of(test.len(), "level"),
            whole(known as f64),
            markdown_table(&["variant", "success on all", "return on all"], rows.into_iter())
        )
    }

    fn every_seed(&self) -> String {
        let headings = [
            "variant",
            "seed",
            "steps to threshold",
            "training success",
            "training return",
            "held-out success",
            "held-out return",
            "held-out length",
        ];
        let rows = self.results.iter().map(|run| {
            let training = |value: fn(&TrainingResult) -> Option<f64>| run.training.as_ref().and_then(value);
            let test = &run.test;
            vec![
                run.variant.clone(),
                run.seed.to_string(),
                steps_cell(&[run]),
                training(|training| training.success).map_or(UNKNOWN.to_owned(), rate_cell),
                fixed(training(|training| training.episodic_return).unwrap_or(f64::NAN), 2),
                format!("{}%", mean_and_error(100.0 * test.success, 100.0 * test.success_se, 1)),
                mean_and_error(test.return_mean, test.return_se, 2),
                fixed(test.length_mean, 1),
            ]
        });
        markdown_table(&headings, rows)
    }
}

/// Formats the steps to the threshold of the runs that reached it, with their number if some did not.
fn steps_cell(runs: &[&StudyResult]) -> String {
    let trained: Vec<&TrainingResult> = runs.iter().filter_map(|run| run.training.as_ref()).collect();
    let reached: Vec<f64> = trained.iter().filter_map(|run| run.steps_to_threshold).map(|step| step as f64).collect();
    match (trained.len(), reached.len()) {
        (0, _) => UNKNOWN.to_owned(),
        (_, 0) => "not reached".to_owned(),
        (all, n) if n < all => format!("{} ({n} of {all})", mean_cell(&reached, 0)),
        _ => mean_cell(&reached, 0),
    }
}

/// Formats mean and standard deviation; a single value has no deviation.
fn mean_cell(values: &[f64], decimals: usize) -> String {
    let (mean, sd) = mean_and_sd(values);
    mean_and_error(mean, if values.len() > 1 { sd } else { f64::NAN }, decimals)
}

/// Counts things with groups of digits.
pub(super) fn count_of(count: u64, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{} {what}s", whole(count as f64)) }
}

/// Formats a success rate as in the cells below it, `70.0 ± 14.1%`: a blank before the sign would widen every column.
pub fn rate_cell(share: f64) -> String {
    format!("{}%", fixed(100.0 * share, 1))
}

fn share_cell(values: &[f64]) -> String {
    if values.is_empty() {
        return UNKNOWN.to_owned();
    }
    let percents: Vec<f64> = values.iter().map(|share| 100.0 * share).collect();
    format!("{}%", mean_cell(&percents, 1))
}

/// Formats a table with its first column to the left and the others to the right, padded to be readable as text.
pub fn markdown_table(headings: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut lines = vec![headings.iter().map(|heading| (*heading).to_owned()).collect::<Vec<_>>()];
    lines.extend(rows);
    let width = |column: usize| lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..headings.len()).map(width).collect();
    let mut table = String::new();
    for (index, line) in lines.iter().enumerate() {
        for (column, (cell, &width)) in line.iter().zip(&widths).enumerate() {
            let _ = if column == 0 { write!(table, "| {cell:<width$} ") } else { write!(table, "| {cell:>width$} ") };
        }
        table += "|\n";
        if index == 0 {
            for (column, &width) in widths.iter().enumerate() {
                let dashes = "-".repeat(width + 1);
                let _ = if column == 0 { write!(table, "|:{dashes}") } else { write!(table, "|{dashes}:") };
            }
            table += "|\n";
        }
    }
    table
}

// The cost of a study's runs.

/// Time that was spent on a run, over all resumptions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct Cost {
    /// Seconds of all processors together; `None` where the system does not report it.
    cpu_s: Option<f64>,
    /// Seconds by the clock.
    wall_s: f64,
}

/// A clock that runs while a run is worked on.
pub(crate) struct CostClock {
    begun: Instant,
    meter: Meter,
    cpu: Option<Duration>,
}

/// Whose time a run is.
#[derive(Clone, Copy)]
enum Meter {
    /// All of the process's.
    Process,
    /// That of the thread that reads the clock.
    Thread,
    /// So many threads have no other work, however long they wait.
    Threads(u32),
}

impl Meter {
    /// Returns the time so far, where Linux reports it.
    fn read(self, begun: Instant) -> Option<Duration> {
        match self {
            Self::Process => cpu_time("/proc/self/stat"),
            Self::Thread => cpu_time("/proc/thread-self/stat"),
            Self::Threads(threads) => Some(begun.elapsed() * threads),
        }
    }
}

impl CostClock {
    /// Starts the clock of a run that has the process to itself.
    pub(crate) fn start() -> Self {
        Self::of(Meter::Process)
    }

    /// Starts the clock of a run on so many threads of a process that works on others, too.
    pub(crate) fn start_beside_others(threads: usize) -> Self {
        Self::of(if threads == 1 { Meter::Thread } else { Meter::Threads(threads as u32) })
    }

    fn of(meter: Meter) -> Self {
        let begun = Instant::now();
        Self { begun, meter, cpu: meter.read(begun) }
    }

    /// Adds the elapsed time to the cost of the run in `folder`.
    ///
    /// # Errors
    ///
    /// It cannot be written.
    pub(crate) fn note(&self, folder: &Path) -> Result<(), SealedFileError> {
        let spent =
            self.cpu.zip(self.meter.read(self.begun)).map(|(before, now)| now.saturating_sub(before).as_secs_f64());
        let before = Cost::of(folder);
        let cost = Cost {
            cpu_s: match before {
                Some(before) => before.cpu_s.zip(spent).map(|(before, spent)| before + spent),
                None => spent,
            },
            wall_s: before.unwrap_or_default().wall_s + self.begun.elapsed().as_secs_f64(),
        };
        write_sealed(&folder.join(COST), &cost)
    }
}

impl Cost {
    /// Reads the cost of the run in `folder` so far; `None` if there is no note, or the note is damaged.
    fn of(folder: &Path) -> Option<Self> {
        let file = folder.join(COST);
        if !file.exists() {
            return None;
        }
        read_sealed(&file)
            .inspect_err(|error| tracing::warn!("{error}; the earlier cost of the run is unknown"))
            .map_or(None, |(cost, _)| Some(cost))
    }
}

/// Formats a table of the cost of each variant, over its seeds, and the command.
pub(crate) fn cost_table(runs: &[StudyRun], folder: &Path, command: &str, threads: usize) -> String {
    let mut rows = Vec::new();
    let mut total = (0.0, 0.0, true);
    let mut variants: Vec<&str> = runs.iter().map(|run| run.variant.as_str()).collect();
    variants.dedup();
    for variant in variants {
        let of_variant: Vec<&StudyRun> = runs.iter().filter(|run| run.variant == variant).collect();
        let costs: Vec<Option<Cost>> = of_variant.iter().map(|run| Cost::of(&folder.join(run.id()))).collect();
        let sum = |of: fn(&Cost) -> Option<f64>| -> Option<f64> {
            costs.iter().map(|cost| cost.as_ref().and_then(of)).sum::<Option<f64>>()
        };
        let (cpu, wall) = (sum(|cost| cost.cpu_s), sum(|cost| Some(cost.wall_s)));
        let trained = of_variant.iter().filter(|run| run.experiment.algorithm.is_trained());
        let steps: u64 = trained.map(|run| run.experiment.whole_steps()).sum();
        total = (total.0 + cpu.unwrap_or(0.0), total.1 + wall.unwrap_or(0.0), total.2 && cpu.is_some());
        rows.push(vec![variant.to_owned(), of_variant.len().to_string(), steps.to_string(), hours(cpu), hours(wall)]);
    }
    let cpu = if total.2 { hours(Some(total.0)) } else { format!("at least {}", hours(Some(total.0))) };
    format!(
        "# What the study has cost\n\n```sh\n{command} --threads {threads}\n```\n\n{}\n{cpu} CPU hours in all, {} by the clock, with \
         {}. A skill model is learned within the first run that needs it. Hours are those of each run, also where several go on at a \
         time.\n",
        markdown_table(&["variant", "runs", "environment steps", "CPU hours", "hours"], rows.into_iter()),
        hours(Some(total.1)),
        counted(threads as u64, "thread"),
    )
}

fn hours(seconds: Option<f64>) -> String {
    seconds.map_or("–".to_owned(), |seconds| format!("{:.3}", seconds / 3600.0))
}

/// Returns the time that all processors have spent on the process or thread of this file, where Linux reports it.
fn cpu_time(stat: &str) -> Option<Duration> {
    // The name in brackets may hold anything.
    let stat = fs::read_to_string(stat).ok()?;
    let mut fields = stat.rsplit_once(')')?.1.split_ascii_whitespace().skip(11);
    let ticks: u64 = fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?;
    // The kernel counts these in hundredths of a second for every program, whatever its own clock does.
    Some(Duration::from_millis(ticks * 10))
}

// The files of a study.

/// The file of results.
pub const RESULTS: &str = "results.json";

const TABLE: &str = "table.md";

/// Failure to write the files of a study.
#[derive(Debug, Error)]
pub enum StudyOutputError {
    /// The experiment cannot be written as text.
    #[error("cannot write the experiment: {0}")]
    Experiment(String),
    /// A file in the place of the experiment was not written by a study.
    #[error(
        "{} is not from a study, and the experiment of this one would replace it: rename it, or choose another folder with \
         --out", .0.display()
    )]
    OtherExperiment(PathBuf),
    /// The results of an earlier study cannot be written as a table.
    #[error("{file}: {message}")]
    Results {
        /// Their file.
        file: String,
        /// The problem.
        message: String,
    },
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] SealedFileError),
}

impl HasExitCode for StudyOutputError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Experiment(_) | Self::OtherExperiment(_) | Self::Results { .. } => 3,
            Self::File(error) => error.exit_code(),
        }
    }
}

/// Writes `table.md`, `experiment.ron`, `curves.svg` and `results.json`.
///
/// # Errors
///
/// A file cannot be written, or an `experiment.ron` that is not a study's is in the folder.
pub fn write_report(folder: &Path, report: &StudyReport) -> Result<(), StudyOutputError> {
    let json = report.to_json().map_err(|error| StudyOutputError::Experiment(error.to_string()))?;
    write_table(folder, report)?;
    write_atomically(&folder.join("curves.svg"), to_svg(&report.charts()).as_bytes())?;
    Ok(write_atomically(&folder.join(RESULTS), json.as_bytes())?)
}

/// Writes `table.md`, and the `experiment.ron` that it links.
fn write_table(folder: &Path, report: &StudyReport) -> Result<(), StudyOutputError> {
    check_experiment_file(folder)?;
    let experiment = report.to_ron(folder).map_err(|error| StudyOutputError::Experiment(error.to_string()))?;
    write_atomically(&folder.join(EXPERIMENT), experiment.as_bytes())?;
    Ok(write_atomically(&folder.join(TABLE), report.to_markdown().as_bytes())?)
}

/// Checks that no `experiment.ron` is in the folder, except for one that a study wrote. Another one may be the very
/// experiment of the study, or that of a run.
///
/// # Errors
///
/// [`StudyOutputError::OtherExperiment`].
pub fn check_experiment_file(folder: &Path) -> Result<(), StudyOutputError> {
    let path = folder.join(EXPERIMENT);
    let is_own = fs::read(&path).is_ok_and(|text| text.starts_with(EXPERIMENT_HEAD.as_bytes()));
    if is_own || !path.exists() { Ok(()) } else { Err(StudyOutputError::OtherExperiment(path)) }
}

/// Writes `table.md` and `experiment.ron` again from `results.json`. Learning curves are not in there, so `curves.svg`
/// stays as it is.
///
/// # Errors
///
/// There are no results, they are damaged, or an `experiment.ron` that is not a study's is in the folder.
pub fn rewrite_table(folder: &Path) -> Result<(), StudyOutputError> {
    let path = folder.join(RESULTS);
    let refused = |message: String| StudyOutputError::Results { file: path.display().to_string(), message };
    if !path.exists() {
        let message = "there is no such file: run the study, or name the folder of one that is done";
        return Err(refused(message.to_owned()));
    }
    let (report, _) = read_sealed::<StudyReport>(&path)?;
    write_table(folder, &report)
}

/// Writes `cost.md`: the cost of each variant, over its seeds, and the command.
///
/// # Errors
///
/// It cannot be written.
pub fn write_cost(
    folder: &Path,
    runs: &[StudyRun],
    runs_folder: &Path,
    command: &str,
    threads: usize,
) -> Result<(), SealedFileError> {
    write_atomically(&folder.join("cost.md"), cost_table(runs, runs_folder, command, threads).as_bytes())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Algorithm, experiment::file::parse_experiment, study::LearningCurves};

    /// Makes learning curves with points at 512 and 1,024 steps.
    fn learned(success: [f64; 2], returns: [f64; 2]) -> LearningCurves {
        let over = |values: [f64; 2]| [512, 1024].into_iter().zip(values).collect();
        LearningCurves { success: over(success), returns: over(returns) }
    }

    fn report() -> StudyReport {
        let text = r#"(game: "corridor", train: "plain:0..7", test: "plain:8..15", demos: "unused", steps: 2048,
            variants: [(name: "full"), (name: "cloned", set: ["algorithm=bc"])])"#;
        let run = |variant: &str, seed, reached, success, return_mean| StudyResult {
            variant: variant.into(),
            algorithm: if variant == "full" { Algorithm::ScorePpo } else { Algorithm::BehaviourCloning },
            seed,
            training: (variant == "full").then_some(TrainingResult {
                steps: 2048,
                steps_to_threshold: reached,
                success: Some(success),
                episodic_return: Some(return_mean),
            }),
            left_out: Vec::new(),
            with_seen: None,
            test: TestResult {
                layouts: None,
                seen: 0,
                episodes: 100,
                success,
                success_se: (success * (1.0 - success) / 100.0f64).sqrt(),
                return_mean,
                return_se: 0.25,
                length_mean: 12.0,
                level_returns: vec![return_mean - 1.0, return_mean + 1.0],
            },
        };
        StudyReport {
            command: "playbot study --out x".into(),
            experiment: parse_experiment(text, Path::new("x.ron")).expect("valid"),
            results: vec![
                run("full", 1, Some(1024), 0.8, 8.0),
                run("full", 2, None, 0.6, 6.0),
                run("cloned", 1, None, 0.5, 5.0),
                run("cloned", 2, None, 0.5, 5.0),
            ],
            curves: vec![
                learned([0.2, 0.8], [2.0, 8.0]),
                learned([0.4, 0.6], [4.0, 6.0]),
                LearningCurves::default(),
                LearningCurves::default(),
            ],
        }
    }

    #[test]
    fn means_and_deviations_are_over_the_seeds() {
        let summary = report().summary();
        let rows: Vec<Vec<&str>> =
            summary.lines().map(|line| line.split('|').map(str::trim).filter(|c| !c.is_empty()).collect()).collect();
        assert_eq!(rows[0][1], "steps to 80.0% success");
        // Deviation of 80 and 60 per cent: 10 √2.
        assert_eq!(rows[2], ["full", "1,024 (1 of 2)", "70.0 ± 14.1%", "7.00 ± 1.41", "70.0 ± 14.1%", "7.00 ± 1.41"]);
        assert_eq!(rows[3], ["cloned", "–", "–", "–", "50.0 ± 0.0%", "5.00 ± 0.00"]);
    }

    #[test]
    fn the_page_has_the_command_every_seed_and_what_variants_change() {
        let page = report().to_markdown();
        assert!(page.contains("```sh\nplaybot study --out x\n```"), "{page}");
        let seed = page.lines().find(|line| line.contains("| full ") && line.contains("not reached"));
        assert!(seed.is_some_and(|line| line.contains("60.0 ± 4.9%") && line.contains("6.00 ± 0.25")), "{page}");
        // The seeds differ by 3 and 1, the levels by nothing: a mean square of 2 · 2, over four cells.
        let difference = page.lines().find(|line| line.starts_with("| cloned ") && line.contains("2.00 ± 1.00"));
        assert!(difference.is_some_and(|line| line.contains("no difference that is clear")), "{page}");
        // The middle half of the seeds' 8 and 6; and each run of the first is above those of the other on both levels.
        let middle = page.lines().find(|line| line.starts_with("| full ") && line.contains(" 7.00 ["));
        assert!(middle.is_some(), "{page}");
        assert!(page.lines().any(|line| line.starts_with("| cloned ") && line.contains("1.00 [1.00, 1.00]")), "{page}");
        assert!(page.contains("- **full**: as in the file\n- **cloned**: `algorithm=bc`\n"), "{page}");
        assert!(page.ends_with("\nAll values are in [experiment.ron](experiment.ron).\n"), "{page}");
        assert!(!page.contains("```ron") && !page.contains("The picture shows"), "{page}");
    }

    #[test]
    fn the_experiment_beside_the_table_is_that_of_the_study() {
        let mut report = report();
        report.experiment.seeds = vec![1, 2];
        report.experiment.variants[1].set.push(r#"train="quoted:0..3""#.to_owned());
        let text = report.to_ron(Path::new("my studies")).expect("Unicode");
        assert!(text.starts_with(EXPERIMENT_HEAD), "{text}");
        let command = "`playbot study --experiment 'my studies/experiment.ron'`\n// repeats it.";
        assert!(text.replace('\\', "/").contains(command), "{text}");
        let lines = [
            r"    seeds: [1, 2],",
            r#"        (name: "full", set: []),"#,
            r#"        (name: "cloned", set: ["algorithm=bc", "train=\"quoted:0..3\""]),"#,
        ];
        assert!(lines.iter().all(|line| text.lines().any(|other| other == *line)), "{text}");
        let read = parse_experiment(&text, Path::new("experiment.ron")).expect("valid");
        assert_eq!(read, report.experiment);

        // Without variants, seeds and recordings there is nothing to add.
        report.experiment = report.experiment.without_study();
        report.experiment.demos = None;
        report.experiment.algorithm = Algorithm::Ppo;
        let text = report.to_ron(Path::new("")).expect("Unicode");
        assert!(text.contains("--experiment experiment.ron`\n// repeats it.\n("), "{text}");
        let read = parse_experiment(&text, Path::new("experiment.ron"));
        assert!(read.is_ok_and(|read| read == report.experiment), "{text}");
    }

    #[test]
    fn at_most_seven_variants_are_drawn_and_the_number_of_the_others_is_named() {
        let mut report = report();
        let (run, curves) = (report.results[0].clone(), report.curves[0].clone());
        let more = |number: usize| StudyResult { variant: format!("v{number}"), ..run.clone() };
        let last = report.results.split_off(2);
        report.curves.truncate(2);
        report.results.extend((2..8).map(more));
        report.results.extend(last);
        report.curves.extend((2..8).map(|_| curves.clone()));
        report.curves.extend([LearningCurves::default(), LearningCurves::default()]);
        // Seven were trained.
        for chart in report.charts() {
            let labels: Vec<&str> = chart.curves.iter().map(|curve| curve.label.as_str()).collect();
            assert_eq!(labels, ["full", "v2", "v3", "v4", "v5", "v6", "v7"]);
            assert_eq!(chart.notes.len(), 1, "{:?}", chart.notes);
        }
        assert!(!report.to_markdown().contains("The picture shows"));

        // Nine were trained.
        report.results.extend([more(8), more(9)]);
        report.curves.extend([curves.clone(), curves]);
        for chart in report.charts() {
            assert_eq!(chart.curves.last().map(|curve| curve.label.as_str()), Some("v7"));
            let words = "The first 7 of 9 trained variants are drawn; the other 2 are in the tables.";
            assert_eq!(chart.notes.last().map(String::as_str), Some(words));
        }
        let words = "The picture shows the first 7 of 9 trained variants: full, v2, v3, v4, v5, v6, v7. The other 2 are in the \
                     tables.\n\n![Learning curves](curves.svg)";
        let page = report.to_markdown();
        assert!(page.contains(words) && page.contains("| v9 "), "{page}");
    }

    #[test]
    fn a_trained_variant_without_a_hundred_episodes_is_named_below_the_chart() {
        let mut report = report();
        report.curves.fill(LearningCurves::default());
        let svg = playbot_report::to_svg(&report.charts());
        for words in
            ["no data", "Curves begin once 100 training episodes have ended.", "Without any value to draw: full."]
        {
            assert_eq!(svg.matches(words).count(), 2, "{words}: {svg}");
        }
    }

    #[test]
    fn known_levels_that_were_measured_have_a_table_of_their_own() {
        let mut report = report();
        assert_eq!(report.with_seen(), "");
        for run in &mut report.results {
            run.left_out = vec![9, 12];
            run.with_seen = Some(TestResult { success: run.test.success + 0.1, return_mean: 9.0, ..run.test.clone() });
        }
        let page = report.to_markdown();
        assert!(page.contains("All 8 levels of plain:8..15, with the 2 that some run knows."), "{page}");
        let row = page.lines().find(|line| line.starts_with("| full ") && line.contains("9.00 ± 0.00"));
        assert!(row.is_some_and(|row| row.contains("80.0 ± 14.1%")), "{page}");
        assert!(page.contains("Measured on 6 levels of plain:8..15, each level once. 2 levels are left out"), "{page}");
        // A table of some variants alone would compare nothing.
        report.results[3].with_seen = None;
        assert_eq!(report.with_seen(), "");
    }

    #[test]
    fn a_single_seed_has_no_interval() {
        let alone = |variants: &[&str]| {
            let mut report = report();
            report.results.retain(|run| run.seed == 1 || !variants.contains(&run.variant.as_str()));
            report.to_markdown()
        };
        let page = alone(&["full", "cloned"]);
        assert!(!page.contains("95 %") && !page.contains("interquartile"), "{page}");
        assert!(page.contains("one seed is too few"), "{page}");
        let page = alone(&["cloned"]);
        assert!(page.lines().any(|line| line.starts_with("| full ") && line.contains(" 7.00 [")), "{page}");
        assert!(!page.lines().any(|line| line.starts_with("| cloned ") && line.contains('[')), "{page}");
    }

    #[test]
    fn the_charts_have_the_trained_variants_with_their_spread() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        for (chart, scale) in report().charts().iter().zip([1.0, 10.0]) {
            let [full] = &chart.curves[..] else { panic!("one curve, not {}", chart.curves.len()) };
            assert_eq!(full.label, "full");
            let means = [(512.0, 0.3 * scale), (1024.0, 0.7 * scale)];
            assert!(full.points.iter().zip(means).all(|(a, b)| near(a.0, b.0) && near(a.1, b.1)), "{:?}", full.points);
            let (low, high) = full.band.as_ref().expect("two seeds")[1];
            assert!(near(low, 0.6 * scale) && near(high, 0.8 * scale), "{low} to {high}");
        }
    }

    #[test]
    fn what_is_gone_on_with_costs_more() {
        let folder = tempfile::tempdir().expect("a folder");
        let clock = CostClock::start();
        let mut sum = 0u64;
        while clock.begun.elapsed() < Duration::from_millis(60) {
            sum = sum.wrapping_add(1);
        }
        assert!(sum > 0);
        clock.note(folder.path()).expect("writable");
        let once = Cost::of(folder.path()).expect("noted");
        clock.note(folder.path()).expect("writable");
        let twice = Cost::of(folder.path()).expect("noted");
        assert!(once.wall_s >= 0.06 && twice.wall_s >= 2.0 * once.wall_s, "{once:?}, {twice:?}");
        if cfg!(target_os = "linux") {
            assert!(twice.cpu_s.expect("Linux says it") >= 2.0 * once.cpu_s.expect("Linux says it"));
        }
    }

    #[test]
    fn an_experiment_that_no_study_wrote_is_not_replaced() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join(EXPERIMENT);
        check_experiment_file(folder.path()).expect("none is there");
        fs::write(&file, "(game: \"mine\")").expect("writable");
        let error = check_experiment_file(folder.path()).expect_err("it would be lost");
        assert!(matches!(&error, StudyOutputError::OtherExperiment(path) if *path == file), "{error}");
        assert_eq!(error.exit_code(), 3);
        fs::write(&file, format!("{EXPERIMENT_HEAD}`…`\n()")).expect("writable");
        check_experiment_file(folder.path()).expect("a study's");
    }
}
