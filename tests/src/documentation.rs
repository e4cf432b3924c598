//! What the documentation shows in Rust is compiled: these are documentation tests of this package.

#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
struct Readme;

#[cfg(doctest)]
#[doc = include_str!("../../docs/tutorial.md")]
struct Tutorial;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/own-game.md")]
struct OwnGame;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/detectors.md")]
struct Detectors;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/level-files.md")]
struct LevelFiles;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/recording-in-builds.md")]
struct RecordingInBuilds;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/findings.md")]
struct Findings;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/cargo-test.md")]
struct CargoTest;

#[cfg(doctest)]
#[doc = include_str!("../../docs/how-to/planted-defects.md")]
struct PlantedDefects;
