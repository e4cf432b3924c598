//! What a graphics card does to a program that it fails: an error, not a panic.

use super::is_host;
use crate::LearnError;
use burn::tensor::Device;
use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};

/// Does `work`, and gives what a panic said instead of printing it.
pub(super) fn caught<T>(work: impl FnOnce() -> T) -> Result<T, String> {
    let hook = take_hook();
    set_hook(Box::new(|_| {}));
    let result = catch_unwind(AssertUnwindSafe(work));
    set_hook(hook);
    result.map_err(|payload| {
        let words = payload.downcast_ref::<String>().map(String::as_str);
        let words = words.or_else(|| payload.downcast_ref::<&str>().copied()).unwrap_or("no reason given");
        words.split_whitespace().collect::<Vec<_>>().join(" ")
    })
}

/// Does `work` on `device`. A graphics card that is lost, or has no memory left, is an error; what computes in host memory
/// is left alone.
pub(crate) fn guarded<T>(device: &Device, work: impl FnOnce() -> Result<T, LearnError>) -> Result<T, LearnError> {
    if is_host(device) {
        return work();
    }
    match caught(work) {
        Ok(Err(LearnError::Device(said))) => Err(LearnError::DeviceFailed { reason: first_cause(&said) }),
        Ok(result) => result,
        Err(reason) => Err(LearnError::DeviceFailed { reason }),
    }
}

/// What it all came from: a driver that fails tells it last, after everything that could not be done any more.
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

    #[test]
    fn panics_become_words() {
        assert_eq!(caught(|| 7), Ok(7));
        assert_eq!(caught(|| panic!("out of\n  memory")), Err::<(), _>("out of memory".to_owned()));
        let number = 3;
        assert_eq!(caught(|| panic!("{number} left")), Err::<(), _>("3 left".to_owned()));
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
