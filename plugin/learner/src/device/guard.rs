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
    caught(work).unwrap_or_else(|reason| Err(LearnError::DeviceFailed { reason }))
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
}
