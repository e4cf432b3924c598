//! The structure of the workspace, read from its sources as text: no circles, files of a readable length, nothing
//! hidden, an example for each concept, components and resources that are reflected.
//!
//! The sources are read and not compiled, so that every feature and every platform is seen at once; only what is
//! registered is asked of Bevy. Code for tests (`#[cfg(test)]`, `tests/`, `examples/`) may import what it likes; only
//! the length of its files is looked at.

mod circles;
mod doctests;
mod files;
mod imports;
mod items;
mod modules;
mod packages;
mod planted;
mod reflected;
mod resolve;
mod rules;
mod tokens;
mod use_tree;
mod writes;

/// Runs all tests, as continuous integration does.
const ALL_TESTS: &str = "cargo test --release --workspace --features screen";

/// Says what is missing, where the names of tests are listed: the harness holds back only what `print!` prints.
#[cfg(not(feature = "screen"))]
#[test]
fn without_feature_screen_tests_of_cameras_and_windows_are_left_out() {
    use std::io::Write;

    let note = format!(
        "\nLEFT OUT: tests of cameras and windows, which need a Vulkan driver, Xvfb and xdotool. CONTRIBUTING.md names \
         the packages.\nAll tests are run by `{ALL_TESTS}`\n\n"
    );
    std::io::stdout().write_all(note.as_bytes()).expect("standard output is open");
}

#[test]
fn the_command_that_runs_all_tests_is_the_one_of_continuous_integration() {
    let read = |file: &str| std::fs::read_to_string(packages::workspace().join(file)).expect("it is there");
    assert!(read(".ci/run").replace(" --locked", "").lines().any(|line| line == ALL_TESTS));
    assert!(read("CONTRIBUTING.md").lines().any(|line| line == ALL_TESTS));
}
