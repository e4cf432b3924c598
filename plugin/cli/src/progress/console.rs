//! The observer of the command line: progress bars and messages for trainings, and Ctrl-C to stop them.

use crate::{
    error::CliError,
    progress,
    progress::{interrupt, interrupt::NothingToSave},
};
use indicatif::ProgressBar;
use playbot_harness::eval::EvalSummary;
use playbot_learner::SkillMetrics;
use playbot_report::{counted, whole};
use playbot_train::{
    UpdateReport,
    metrics_log::LESSON,
    run_observer::{CountedWork, Counter, KeptSkills, RecordingsSummary, RunEvent, RunObserver},
};

/// Receives the metrics of each epoch of skills.
type OnEpoch<'a> = Box<dyn FnMut(u64, &SkillMetrics) -> Result<(), CliError> + 'a>;

/// Receives the results of each update of training.
type OnUpdate<'a> = Box<dyn FnMut(&UpdateReport) + 'a>;

/// Reports the progress of trainings, and stops them after Ctrl-C.
#[derive(Default)]
pub struct Console<'a> {
    /// Title of the progress bar of training.
    title: String,
    /// Command that resumes the learning of skills, if it differs from the noted one.
    go_on: Option<String>,
    on_epoch: Option<OnEpoch<'a>>,
    on_update: Option<OnUpdate<'a>>,
    /// Recordings are being read.
    reading: Option<NothingToSave>,
    /// The bar of training or of learning skills.
    bar: Option<ProgressBar>,
    /// The bar of work on several threads.
    shared_bar: Option<ProgressBar>,
    /// Error of `on_epoch`.
    failed: Option<CliError>,
}

impl<'a> Console<'a> {
    /// Makes an observer, with the title of training's progress bar.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// Changes the title of training's progress bar.
    pub fn set_title(&mut self, title: String) {
        self.title = title;
    }

    /// Names the command that resumes the learning of skills.
    pub fn going_on_with(self, command: &str) -> Self {
        Self { go_on: Some(command.to_owned()), ..self }
    }

    /// Calls a function after each epoch of skills. Its error stops the work, see [`result`](Self::result).
    pub fn on_epoch(self, then: impl FnMut(u64, &SkillMetrics) -> Result<(), CliError> + 'a) -> Self {
        Self { on_epoch: Some(Box::new(then)), ..self }
    }

    /// Calls a function after each update of training.
    pub fn on_update(self, then: impl FnMut(&UpdateReport) + 'a) -> Self {
        Self { on_update: Some(Box::new(then)), ..self }
    }

    /// Returns the error that stopped the work, if one did.
    pub fn result(self) -> Result<(), CliError> {
        self.failed.map_or(Ok(()), Err)
    }

    fn end_bar(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }

    fn end_shared_bar(&mut self) {
        if let Some(bar) = self.shared_bar.take() {
            bar.finish_and_clear();
        }
    }

    fn epoch_ended(&mut self, epoch: u64, metrics: &SkillMetrics) {
        let apart = metrics.held_out_nll().map_or(String::new(), |nll| format!(", held-out NLL {nll:.3}"));
        if let Some(bar) = &self.bar {
            bar.set_message(format!("NLL {:.3} KL {:.2}{apart}", metrics.nll, metrics.kl));
        }
        if let Some(on_epoch) = &mut self.on_epoch
            && let Err(error) = on_epoch(epoch, metrics)
        {
            self.failed = Some(error);
        }
    }

    fn updated(&mut self, report: &UpdateReport, steps_per_update: u64) {
        if let Some(bar) = &self.bar {
            bar.set_position(report.step);
            bar.set_message(speed_and_return(report, steps_per_update));
        }
        if let Some(on_update) = &mut self.on_update {
            on_update(report);
        }
    }
}

impl RunObserver for Console<'_> {
    fn stopped(&self) -> bool {
        self.failed.is_some() || interrupt::asked()
    }

    fn observe(&mut self, event: RunEvent<'_>) {
        match event {
            RunEvent::RecordingsElsewhere { named, found } => {
                report!(
                    "recordings are taken from {}, since there are none at {} here",
                    found.display(),
                    named.display()
                );
            }
            // Ctrl-C then ends the program: replays leave nothing.
            RunEvent::ReadingRecordings => self.reading = Some(NothingToSave::listen()),
            RunEvent::RecordingsOpened(summary) => report_recordings(&summary),
            RunEvent::OtherModes { recorded, trained } => report!(
                "some recordings are of {}, and the training is of {trained}: their rewards are those of their own mode",
                recorded.join(", ")
            ),
            RunEvent::RecordingsRead => {
                self.end_shared_bar();
                self.reading = None;
            }
            RunEvent::MasksUnknown { episodes, of } => report!(
                "masks are unknown in {episodes} of {}, because no replay restores them: every action counts as legal there",
                counted(of as u64, "recorded episode")
            ),
            RunEvent::SkillsResumed { epoch, epochs } => report!("going on in epoch {epoch} of {epochs}"),
            RunEvent::SkillsBegun { done, batches } => {
                let bar = progress::bar("learn skills", batches, "batches");
                bar.set_position(done);
                self.bar = Some(bar);
            }
            RunEvent::SkillBatch => self.bar.iter().for_each(|bar| bar.inc(1)),
            RunEvent::SkillEpoch { epoch, metrics } => self.epoch_ended(epoch, metrics),
            RunEvent::SkillsSaved { checkpoint, epochs } => {
                self.go_on.iter().for_each(|command| interrupt::go_on_with(command.clone()));
                let epochs = counted(epochs, "whole epoch");
                interrupt::leave(format!("{} is kept, after {epochs}", checkpoint.display()));
            }
            RunEvent::SkillsEnded { kept } => {
                self.end_bar();
                kept.iter().for_each(report_held_out);
            }
            RunEvent::TrainingBegun { experiment } => {
                interrupt::listen();
                self.bar = Some(progress::bar(&self.title, experiment.whole_steps(), "steps"));
            }
            RunEvent::UpdateBegun { step } => self.bar.iter().for_each(|bar| bar.set_position(step)),
            RunEvent::Updated { report, steps_per_update } => self.updated(report, steps_per_update),
            RunEvent::Saved { run, step } => {
                let step = whole(step as f64);
                interrupt::leave(format!("the last checkpoint of {} is that of step {step}", run.display()));
            }
            RunEvent::TrainingEnded => self.end_bar(),
            RunEvent::KnownLevels { test, known, is_measured } => {
                let what = if is_measured { "measured apart" } else { "left out" };
                let levels = counted(known, "level");
                report!("{what} of {test}: {levels} of a layout that some run trains on or learns from recordings of");
            }
            RunEvent::Measured(summary) => {
                self.end_shared_bar();
                report_clipped(summary);
            }
            RunEvent::StudyRunBegun { .. } | RunEvent::StudyRunAdvanced { .. } | RunEvent::StudyRunEnded { .. } => {}
        }
    }

    fn counter(&mut self, work: CountedWork<'_>) -> Counter {
        let bar = match work {
            CountedWork::Replay { steps } => progress::bar("replay recordings", steps, "steps"),
            CountedWork::Measure { name, episodes } => progress::bar(&format!("test {name}"), episodes, "episodes"),
        };
        self.shared_bar = Some(bar.clone());
        Box::new(move |units| bar.inc(units))
    }
}

/// Reports the contents of recordings, and how much memory their pictures will take.
fn report_recordings(summary: &RecordingsSummary<'_>) {
    let RecordingsSummary { path, steps, episodes, observation, bytes, .. } = summary;
    let exceeds = match summary.exceeds_request {
        true => " (more than was asked for: episodes are kept whole)",
        false => "",
    };
    let gib = *bytes as f64 / f64::from(1 << 30);
    let memory = match *bytes {
        0 => String::new(),
        bytes if bytes == summary.picture_bytes => format!(": {observation} take {gib:.2} GiB"),
        _ => format!(": {observation} and the states that they show take {gib:.2} GiB"),
    };
    let (steps, episodes) = (counted(*steps, "step"), counted(*episodes, "episode"));
    report!("{steps} in {episodes} from {}{exceeds}{memory}", path.display());
}

/// Reports the loss of the kept model on the held-out episodes.
fn report_held_out(kept: &KeptSkills) {
    let KeptSkills { epoch, epochs, held_out_nll: nll, is_best } = kept;
    if *is_best {
        report!("held-out NLL {nll:.2} after epoch {epoch}, the best of {epochs}, whose model is kept");
    } else {
        report!("held-out NLL {nll:.2} after epoch {epoch}, the last, whose model is kept");
    }
}

fn speed_and_return(report: &UpdateReport, steps_per_update: u64) -> String {
    let sps = steps_per_update as f64 / (report.timing.collect_s + report.timing.learn_s);
    let current = report.episodic_return.map_or("-".to_owned(), |value| format!("{value:.2}"));
    let lesson = report.levels.iter().find(|(tag, _)| *tag == LESSON);
    let lesson = lesson.map_or_else(String::new, |(_, lesson)| format!(", lesson {lesson}"));
    format!("{sps:.0} steps/s, return {current}{lesson}")
}

/// Reports it if actions of a measured player were clipped.
pub(crate) fn report_clipped(summary: &EvalSummary) {
    if summary.clipped > 0.0 {
        report!(
            "{} on {}: {:.1} % of the actions lay outside the game's range and were clipped",
            summary.method,
            summary.split,
            100.0 * summary.clipped
        );
    }
}
