//! Guards that turn the failure of a graphics card into an error instead of a panic.

use super::is_host;
use crate::{LearnError, among_awake_workers};
use burn::tensor::Device;
use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::sync::Once;

thread_local! {
    /// Number of guards that this thread is in.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
    /// Position of its last guarded panic.
    static PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Runs `work`, and returns the message and position of a panic in this thread instead of printing it.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    listen();
    DEPTH.set(DEPTH.get() + 1);
    let result = catch_unwind(AssertUnwindSafe(work));
    DEPTH.set(DEPTH.get() - 1);
    result.map_err(|payload| {
        let words = payload.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no reason given");
        let words = words.split_whitespace().collect::<Vec<_>>().join(" ");
        format!("{words} (at {})", PLACE.take())
    })
}

/// Installs a panic hook before the present one, once: otherwise guards of several threads would restore each other's
/// hooks.
fn listen() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = take_hook();
        set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
            if DEPTH.get() == 0 {
                return before(info);
            }
            let place = info.location().map_or_else(|| "an unknown position".to_owned(), ToString::to_string);
            PLACE.replace(place);
        }));
    });
}

/// Runs `work` on `device`. A graphics card that is lost, or out of memory, is an error. Work in host memory is
/// unaffected.
pub(crate) fn guarded<T>(device: &Device, work: impl FnOnce() -> Result<T, LearnError>) -> Result<T, LearnError> {
    if is_host(device) {
        return work();
    }
    failures(work)
}

/// Runs the work of an update on `device`: in host memory among workers that wait awake, on a graphics card as
/// [`guarded`].
pub(crate) fn update_on<T: Send>(
    device: &Device,
    work: impl FnOnce() -> Result<T, LearnError> + Send,
) -> Result<T, LearnError> {
    if is_host(device) { among_awake_workers(work) } else { failures(work) }
}

/// Runs `work` as [`guarded`] does on a graphics card.
fn failures<T>(work: impl FnOnce() -> Result<T, LearnError>) -> Result<T, LearnError> {
    match caught(work) {
        Ok(Err(LearnError::Device(said))) => Err(LearnError::DeviceFailed { reason: first_cause(&said) }),
        Ok(result) => result,
        Err(reason) => Err(LearnError::DeviceFailed { reason }),
    }
}

/// Returns the first cause: a failing driver prints it last, after all errors that follow from it.
fn first_cause(said: &str) -> String {
    let is_filler = |line: &&str| {
        let fillers = ["Caused by:", "Asked at:", "No backtrace available", "skipped ", "("];
        line.is_empty() || fillers.iter().any(|filler| line.starts_with(filler))
    };
    said.lines().map(str::trim).rfind(|line| !is_filler(line)).unwrap_or("no reason given").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn panics_become_words() {
        assert_eq!(caught(|| 7), Ok(7));
        let said = |work: fn()| caught(work).expect_err("it panics");
        assert!(said(|| panic!("out of\n  memory")).starts_with("out of memory (at "));
        let here = said(|| panic!("{} left", 3));
        assert!(here.starts_with("3 left (at ") && here.contains("guard.rs:"), "{here}");
    }

    #[test]
    fn whatever_a_card_does_is_one_kind_of_error() {
        let reason = |work: fn() -> Result<(), LearnError>| match failures(work) {
            Err(LearnError::DeviceFailed { reason }) => reason,
            other => panic!("{other:?}"),
        };
        assert!(reason(|| panic!("the device was lost")).starts_with("the device was lost"));
        assert_eq!(reason(|| Err(LearnError::Device("Caused by:\n  no memory".to_owned()))), "no memory");
        let other = failures::<()>(|| Err(LearnError::Config("too few".to_owned())));
        assert!(matches!(other, Err(LearnError::Config(_))), "an error of our own stays what it is");
    }

    #[test]
    fn guards_of_several_threads_leave_the_hook_alone() {
        static HEARD: AtomicUsize = AtomicUsize::new(0);
        listen();
        let before = take_hook();
        set_hook(Box::new(move |info: &PanicHookInfo<'_>| {
            HEARD.fetch_add(1, Ordering::Relaxed);
            before(info);
        }));
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| (0..50).for_each(|_| assert!(caught(|| panic!("here")).is_err())));
            }
        });
        let heard = HEARD.load(Ordering::Relaxed);
        assert!(catch_unwind(|| panic!("outside")).is_err());
        assert!(HEARD.load(Ordering::Relaxed) > heard, "whoever listened still does");
    }

    #[test]
    fn what_it_came_from_is_told() {
        let said = "An error happened\nCaused by:\n  An IO error happened\n  skipped `Kernel`: it failed\nCaused by:\n  \
                    can't allocate buffer of size: 268435456\nNo backtrace available\nAsked at:\nNo backtrace available";
        assert_eq!(first_cause(said), "can't allocate buffer of size: 268435456");
        assert_eq!(first_cause("no memory"), "no memory");
        assert_eq!(first_cause(""), "no reason given");
    }
}
