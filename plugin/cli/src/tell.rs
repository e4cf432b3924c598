//! What is said to people, on standard error.

/// A line on standard error. Whoever has closed it, or keeps it on a disk that is full, misses the words: work does not end
/// because nobody listens, as it would with `eprintln!`.
macro_rules! tell {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr().lock(), $($words)*);
    }};
}

/// The beginning of a line, see [`tell`].
macro_rules! begin_to_tell {
    ($($words:tt)*) => {{
        use std::io::Write as _;
        let _ = write!(std::io::stderr().lock(), $($words)*);
    }};
}
