//! Documentation tests of this package: the Rust code of the documents.

/// Its name says, close to the end of what `cargo test` prints, what was left out.
#[cfg(all(doctest, not(feature = "screen")))]
mod tests_of_cameras_and_windows_are_left_out {
    /// ```
    /// let contributing = std::fs::read_to_string("../CONTRIBUTING.md").expect("beside this package");
    /// assert!(contributing.contains("cargo test --release --workspace --features screen"));
    /// ```
    fn run_them_with_features_screen() {}
}

#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

#[cfg(doctest)]
#[doc = include_str!("../../docs/tutorial/test-your-levels.md")]
struct TestYourLevels;

#[cfg(doctest)]
#[doc = include_str!("../../docs/tutorial/train-a-bot.md")]
struct TrainABot;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/adapt-your-game.md")]
struct AdaptYourGame;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/entities.md")]
struct Entities;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/explore.md")]
struct Explore;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/large-maps.md")]
struct LargeMaps;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/detectors.md")]
struct Detectors;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/hand-made-levels.md")]
struct HandMadeLevels;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/recording-in-builds.md")]
struct RecordingInBuilds;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/teach.md")]
struct Teach;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/findings.md")]
struct Findings;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/cargo-test.md")]
struct CargoTest;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/planted-defects.md")]
struct PlantedDefects;
