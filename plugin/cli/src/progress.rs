//! Progress on standard error, for all work that can take longer than two seconds: bars on a terminal, a plain line now
//! and then elsewhere.
//!
//! The folder, in reading order:
//!
//! - `interrupt`: Ctrl-C, and what it leaves.
//! - `console`: progress of trainings.

pub(crate) mod console;
pub(crate) mod interrupt;

use bevy_playbot::engine::SlowCalls;
use indicatif::{
    HumanDuration, MultiProgress, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle, WeakProgressBar,
};
use std::{
    collections::VecDeque,
    fmt::Write as _,
    io::{IsTerminal, Write as _, stderr},
    sync::{Arc, LazyLock, Mutex, MutexGuard, Once, OnceLock, PoisonError},
    thread,
    time::{Duration, Instant},
};

/// All bars, so that the bar of a part stands below that of the whole.
static BARS: LazyLock<MultiProgress> = LazyLock::new(|| {
    let target = if draws_bars() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    MultiProgress::with_draw_target(target)
});

/// Time between two plain lines.
const PAUSE: Duration = Duration::from_secs(10);

/// The work that is reported in plain lines.
static TEXT_PROGRESS: Mutex<Vec<TextProgress>> = Mutex::new(Vec::new());

static REPORTER: Once = Once::new();

/// Makes a bar with a title, a count, the time left and room for a message. A bar whose length grows with its position
/// shows no time left.
pub(crate) fn bar(title: &str, length: u64, unit: &str) -> ProgressBar {
    // A message that is wider than the rest of the terminal is cut off: a line that wraps would leave parts behind.
    let template = format!("{title:<22} [{{bar:20}}] {{human_pos}}/{{human_len}} {unit} {{left}}  {{wide_msg}}");
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    let pace = Arc::new(Mutex::new(Pace::default()));
    let left = move |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        let mut pace = pace.lock().unwrap_or_else(PoisonError::into_inner);
        let left = pace.left(Instant::now(), state.pos(), state.len().unwrap_or_default());
        // A failed write is not reported.
        let _ = out.write_str(&describe_left(left));
    };
    let bar = BARS.add(ProgressBar::new(length)).with_style(style.with_key("left", left).progress_chars("=> "));
    bar.enable_steady_tick(Duration::from_millis(250));
    if BARS.is_hidden() {
        text_progress().push(TextProgress {
            title: title.to_owned(),
            unit: unit.to_owned(),
            bar: bar.downgrade(),
            pace: Pace::default(),
        });
        start();
    }
    bar
}

/// Compares levels by their play, with a bar from the first one on: many games compare none so. The bar grows with the
/// episodes that are known to be needed.
pub(crate) fn comparing<T>(play: impl FnOnce(&(dyn Fn(u64, u64) + Sync)) -> T) -> T {
    let shown = OnceLock::new();
    let compared = play(&|played, more| {
        let shown = shown.get_or_init(|| bar("compare levels", 0, "episodes"));
        shown.inc_length(more);
        shown.inc(played);
    });
    if let Some(bar) = shown.get() {
        bar.finish_and_clear();
    }
    compared
}

/// Returns whether standard error is a terminal that can move its cursor, as bars need.
fn draws_bars() -> bool {
    stderr().is_terminal() && moves_cursor(std::env::var("TERM").ok().as_deref())
}

/// Returns whether a terminal of this name can move its cursor. Windows names none.
fn moves_cursor(term: Option<&str>) -> bool {
    cfg!(windows) || term.is_some_and(|name| !name.is_empty() && name != "dumb")
}

/// Describes the time that is left, if known and at least a second.
fn describe_left(left: Option<Duration>) -> String {
    let left = left.filter(|left| *left >= Duration::from_secs(1));
    left.map_or(String::new(), |left| format!("{:#} left", HumanDuration(left)))
}

/// A hidden bar, whose progress is reported in lines.
struct TextProgress {
    title: String,
    unit: String,
    bar: WeakProgressBar,
    pace: Pace,
}

impl TextProgress {
    /// Returns the progress, as `record: 1200 of 20000 steps`; `None` if the work is over.
    fn line(&mut self) -> Option<String> {
        let bar = self.bar.upgrade().filter(|bar| !bar.is_finished())?;
        let (title, unit, done) = (&self.title, &self.unit, bar.position());
        let mut line = match bar.length() {
            Some(length) if length > done => format!("{title}: {done} of {length} {unit}"),
            _ => format!("{title}: {done} {unit}"),
        };
        let left = describe_left(self.pace.left(Instant::now(), done, bar.length().unwrap_or_default()));
        if !left.is_empty() {
            let _ = write!(line, ", {left}");
        }
        let message = bar.message();
        if !message.is_empty() {
            let _ = write!(line, ", {message}");
        }
        Some(line)
    }
}

fn text_progress() -> MutexGuard<'static, Vec<TextProgress>> {
    TEXT_PROGRESS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reports running work from now on, and calls of games that take long.
pub(crate) fn start() {
    // Without a thread for it, nothing is reported.
    REPORTER.call_once(|| drop(thread::Builder::new().spawn(report)));
}

/// Reports all running work, in a loop.
fn report() {
    let mut slow = SlowCalls::default();
    loop {
        thread::park_timeout(PAUSE);
        let mut lines = String::new();
        text_progress().retain_mut(|progress| {
            let line = progress.line();
            line.iter().for_each(|line| lines.extend([line, "\n"]));
            line.is_some()
        });
        lines.push_str(&slow_lines(&mut slow));
        if !lines.is_empty() {
            // Standard error may be closed.
            BARS.suspend(|| drop(stderr().write_all(lines.as_bytes())));
        }
    }
}

/// Returns a line for each call of a game that has not returned since the last look. A call is named again when it has
/// taken twice as long.
fn slow_lines(slow: &mut SlowCalls) -> String {
    let named = slow.look().into_iter().filter(|call| call.looks.is_power_of_two());
    named.map(|call| format!("still {call} after {} s\n", PAUSE.as_secs() * u64::from(call.looks))).collect()
}

// Estimate of the time that is left, by the recent speed of the work.

/// Older progress does not count, as long as there is newer.
const WINDOW: Duration = Duration::from_secs(60);

/// Times and amounts of progress. Work that advances in leaps, such as a training after each update, does not count as
/// standing still in between.
#[derive(Default)]
pub struct Pace {
    steps: VecDeque<(Instant, u64)>,
}

impl Pace {
    /// Returns the time that is left at `now` from `done` to `length`; `None` before the second progress, and at the
    /// end.
    pub fn left(&mut self, now: Instant, done: u64, length: u64) -> Option<Duration> {
        let is_back = self.steps.back().is_some_and(|&(_, last)| last > done);
        if is_back {
            self.steps.clear();
        }
        if done > 0 && self.steps.back().is_none_or(|&(_, last)| last != done) {
            self.steps.push_back((now, done));
        }
        while self.steps.len() > 2 && now.duration_since(self.steps[1].0) >= WINDOW {
            self.steps.pop_front();
        }
        let (&(begin, first), &(end, last)) = (self.steps.front()?, self.steps.back()?);
        let way = length.checked_sub(last).filter(|&way| way > 0 && last > first)?;
        let needed = end.duration_since(begin).as_secs_f64() * way as f64 / (last - first) as f64;
        Duration::try_from_secs_f64(needed).ok()?.checked_sub(now.duration_since(end))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy_playbot::engine::GameCall;

    fn words(bar: &ProgressBar) -> Option<String> {
        let (title, unit) = ("record".to_owned(), "steps".to_owned());
        TextProgress { title, unit, bar: bar.downgrade(), pace: Pace::default() }.line()
    }

    #[test]
    fn a_terminal_that_cannot_move_its_cursor_has_lines() {
        assert!(moves_cursor(Some("xterm-256color")));
        assert!([None, Some(""), Some("dumb")].iter().all(|term| moves_cursor(*term) == cfg!(windows)));
    }

    #[test]
    fn work_that_goes_on_is_reported_in_words() {
        let bar = ProgressBar::hidden();
        bar.set_length(20_000);
        bar.set_position(1200);
        assert_eq!(words(&bar).as_deref(), Some("record: 1200 of 20000 steps"));
        bar.set_message("return 3.00");
        assert_eq!(words(&bar).as_deref(), Some("record: 1200 of 20000 steps, return 3.00"));
        bar.set_length(1200);
        bar.set_message("");
        assert_eq!(words(&bar).as_deref(), Some("record: 1200 steps"), "the length is not known");
        bar.finish_and_clear();
        assert_eq!(words(&bar), None, "it is over");
    }

    #[test]
    fn a_call_that_does_not_return_is_named_ever_less_often() {
        let _call = GameCall::begin("proving", [70_003]);
        let mut slow = SlowCalls::default();
        let mut line = || slow_lines(&mut slow).lines().find(|line| line.contains("70003")).map(str::to_owned);
        let lines = [line(), line(), line(), line(), line()].map(Option::unwrap_or_default);
        let after = |seconds: u32| format!("still proving level 70003 after {seconds} s");
        assert_eq!(lines, [String::new(), after(10), after(20), String::new(), after(40)]);
    }

    #[test]
    fn less_than_a_second_is_not_worth_a_word() {
        let words = [None, Some(Duration::from_millis(900)), Some(Duration::from_secs(5))].map(describe_left);
        assert_eq!(words, ["", "", "5s left"]);
    }

    #[test]
    fn work_that_leaps_does_not_stand_still_in_between() {
        let (start, mut pace) = (Instant::now(), Pace::default());
        let mut left = |seconds, done| pace.left(start + Duration::from_secs(seconds), done, 1000);
        assert_eq!(left(0, 0), None);
        // A training that was resumed at 100.
        assert_eq!((left(1, 100), left(5, 100)), (None, None));
        // 100 in 10 seconds: 80 for the rest, of which time goes by.
        assert_eq!((left(11, 200), left(14, 200)), (Some(Duration::from_secs(80)), Some(Duration::from_secs(77))));
        assert_eq!(left(200, 200), None, "it takes longer than was thought");
        // It has become slower: progress of more than a minute ago is forgotten.
        assert_eq!(left(211, 300), Some(Duration::from_secs(1400)));
        assert_eq!(left(300, 1000), None, "done");
        assert_eq!(left(301, 10), None, "begun anew");
    }
}
