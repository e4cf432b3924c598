//! Runs of a study that go on side by side, each on a thread of its own.

use crate::{
    run_observer::{Advance, RunEvent, RunObserver},
    study::{StudyRun, table::CostClock},
    study_runner::{AllEnded, Ended, StudyRunError, StudyRunner},
};
use playbot_harness::eval::EvalSummary;
use std::{
    collections::{BTreeSet, VecDeque},
    path::{Path, PathBuf},
    sync::{
        Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Receiver, RecvTimeoutError, Sender},
    },
    thread,
    time::Duration,
};

/// Longest time between two looks at whether to stop.
const PAUSE: Duration = Duration::from_millis(100);

impl StudyRunner<'_> {
    /// Brings runs to their ends on this many threads, each with its share of those that compute. An error lets the other
    /// runs save what they have.
    pub(super) fn run_side_by_side(
        &self,
        runs: &[StudyRun],
        lanes: usize,
        observer: &mut dyn RunObserver,
    ) -> Result<AllEnded, StudyRunError> {
        let files = runs.iter().map(|run| match run.experiment.algorithm.needs_skills() {
            true => self.skill_file(run).map(Some),
            false => Ok(None),
        });
        let files: Vec<_> = files.collect::<Result<_, _>>()?;
        let threads = self.setup.threads / lanes;
        let (waiting, stop) = (Mutex::new((0..runs.len()).collect::<VecDeque<_>>()), AtomicBool::new(false));
        let all = thread::scope(|scope| {
            let (sender, news) = mpsc::channel();
            for _ in 0..lanes {
                let (mut lane, files, waiting) =
                    (Lane { run: 0, batches: (0, 0), news: sender.clone(), stop: &stop }, &files, &waiting);
                scope.spawn(move || {
                    while let Some(index) = self.next(files, waiting).filter(|_| !lane.stopped()) {
                        lane.run = index;
                        lane.tell(News::Begun);
                        let clock = CostClock::start_beside_others(threads);
                        let ended = self.run(&runs[index], clock, threads, &mut lane);
                        lane.tell(News::Ended(Box::new(ended)));
                    }
                });
            }
            drop(sender);
            hear(&news, runs, &stop, observer)
        });
        // An error counts more than the runs that it has stopped.
        let ended = all.into_iter().map(|one| Ok(one.transpose()?.flatten()));
        let ended: Vec<Ended> = ended.collect::<Result<_, StudyRunError>>()?;
        Ok(ended.into_iter().collect())
    }

    /// Takes the first waiting run whose skills no other run is learning, or else the first.
    fn next(&self, files: &[Option<PathBuf>], waiting: &Mutex<VecDeque<usize>>) -> Option<usize> {
        let mut waiting = lock(waiting);
        let is_free = |&run: &usize| files[run].as_ref().is_none_or(|file| !self.skills.is_taken(file));
        let place = waiting.iter().position(is_free).unwrap_or(0);
        waiting.remove(place)
    }
}

/// Tells the observer what all runs have to say, until the last of them is over, and the runs whether to stop. Returns how
/// each run ended; `None` for those that never began.
fn hear(
    news: &Receiver<(usize, News)>,
    runs: &[StudyRun],
    stop: &AtomicBool,
    observer: &mut dyn RunObserver,
) -> Vec<Option<Result<Ended, StudyRunError>>> {
    let mut all: Vec<_> = runs.iter().map(|_| None).collect();
    loop {
        match news.recv_timeout(PAUSE) {
            Ok((index, News::Ended(ended))) => {
                let run = &runs[index];
                match &*ended {
                    Ok(Some((result, _))) => observer.observe(RunEvent::StudyRunEnded { run, result }),
                    // The others save what they have.
                    Ok(None) | Err(_) => stop.store(true, Ordering::Relaxed),
                }
                all[index] = Some(*ended);
            }
            Ok((index, news)) => news.pass_on(index, &runs[index], observer),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return all,
        }
        if observer.stopped() {
            stop.store(true, Ordering::Relaxed);
        }
    }
}

/// The skill models of a study, by their files.
#[derive(Default)]
pub(super) struct SkillFiles {
    /// Those that were learned already.
    learned: Mutex<BTreeSet<PathBuf>>,
    /// Those that some run learns, or looks at.
    taken: Mutex<BTreeSet<PathBuf>>,
    /// Told when one of them is left.
    left: Condvar,
}

impl SkillFiles {
    /// Waits until no other run learns these skills, and keeps the others from it.
    pub(super) fn take(&self, file: &Path) -> TakenSkills<'_> {
        let taken = self.left.wait_while(lock(&self.taken), |taken| taken.contains(file));
        taken.unwrap_or_else(PoisonError::into_inner).insert(file.to_owned());
        TakenSkills { files: self, file: file.to_owned() }
    }

    fn is_taken(&self, file: &Path) -> bool {
        lock(&self.taken).contains(file)
    }

    /// Returns whether this study has learned these skills.
    pub(super) fn is_learned(&self, file: &Path) -> bool {
        lock(&self.learned).contains(file)
    }

    pub(super) fn note_learned(&self, file: &Path) {
        lock(&self.learned).insert(file.to_owned());
    }
}

/// Skills that a run learns, until it is dropped.
pub(super) struct TakenSkills<'a> {
    files: &'a SkillFiles,
    file: PathBuf,
}

impl Drop for TakenSkills<'_> {
    fn drop(&mut self) {
        lock(&self.files.taken).remove(&self.file);
        self.files.left.notify_all();
    }
}

/// Locks what no thread leaves half done.
pub(super) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a run that goes on beside others tells the thread of the observer.
enum News {
    Begun,
    Advanced(Advance),
    /// Modes of the recordings, and that of the training.
    OtherModes(Vec<String>, String),
    /// Number of episodes whose masks are unknown, and of all.
    MasksUnknown(usize, usize),
    Measured(Box<EvalSummary>),
    Ended(Box<Result<Ended, StudyRunError>>),
}

impl News {
    fn pass_on(&self, index: usize, run: &StudyRun, observer: &mut dyn RunObserver) {
        match self {
            Self::Begun => observer.observe(RunEvent::StudyRunBegun { index, run }),
            Self::Advanced(done) => observer.observe(RunEvent::StudyRunAdvanced { run, done: *done }),
            Self::OtherModes(recorded, trained) => {
                let recorded: Vec<&str> = recorded.iter().map(String::as_str).collect();
                observer.observe(RunEvent::OtherModes { recorded: &recorded, trained });
            }
            &Self::MasksUnknown(episodes, of) => observer.observe(RunEvent::MasksUnknown { episodes, of }),
            Self::Measured(summary) => observer.observe(RunEvent::Measured(summary)),
            Self::Ended(_) => {}
        }
    }
}

/// The observer of a run that goes on beside others.
struct Lane<'a> {
    /// Index of the run.
    run: usize,
    /// Batches of skills that are done, and all of them.
    batches: (u64, u64),
    news: Sender<(usize, News)>,
    stop: &'a AtomicBool,
}

impl Lane<'_> {
    fn tell(&self, news: News) {
        // The receiver is gone only if its thread has panicked, which ends the program.
        let _ = self.news.send((self.run, news));
    }
}

impl RunObserver for Lane<'_> {
    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn observe(&mut self, event: RunEvent<'_>) {
        match event {
            RunEvent::SkillsBegun { done, batches } => self.batches = (done, batches),
            RunEvent::SkillBatch => {
                self.batches.0 += 1;
                let (batches, of) = self.batches;
                self.tell(News::Advanced(Advance::Skills { batches, of }));
            }
            RunEvent::Updated { report, .. } => self.tell(News::Advanced(Advance::Steps(report.step))),
            RunEvent::OtherModes { recorded, trained } => {
                let recorded = recorded.iter().map(|&mode| mode.to_owned()).collect();
                self.tell(News::OtherModes(recorded, trained.to_owned()));
            }
            RunEvent::MasksUnknown { episodes, of } => self.tell(News::MasksUnknown(episodes, of)),
            RunEvent::Measured(summary) => self.tell(News::Measured(Box::new(summary.clone()))),
            _ => {}
        }
    }
}
