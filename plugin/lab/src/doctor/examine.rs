//! The whole examination.

use super::{
    finding::findings,
    game_copy::{Plan, bare_world},
    observed::{ObservationMonitor, ObservationReport},
    report::{Comparison, ComparisonReport, DoctorReport},
    safety::assess_safety,
    trial::Trial,
    types::{KnownTypes, TypesReport},
};
use crate::{game::Game, mode::ModeError};

/// The settings of an examination.
#[derive(Clone, Debug)]
pub struct DoctorOptions {
    /// Mode of the game.
    pub mode: String,
    /// Ticks that each comparison plays.
    pub ticks: u32,
    /// The level.
    pub level: u64,
    /// Random seed of the World and of the actions.
    pub seed: u64,
    /// Components and resources whose path contains one of these are ignored, such as a high score that should last.
    pub ignored: Vec<String>,
}

impl DoctorOptions {
    /// Creates options for 300 ticks of a mode.
    pub fn new(mode: impl Into<String>) -> Self {
        Self { mode: mode.into(), ticks: 300, level: 0, seed: 0, ignored: Vec::new() }
    }
}

/// Plays copies of a game with the same random actions, compares them after every tick, and reports the differences.
/// `progress` receives the next comparison.
///
/// # Errors
///
/// The game has no such mode. Every other problem of the game is in the report.
pub fn examine(
    game: &dyn Game,
    options: &DoctorOptions,
    mut progress: impl FnMut(Comparison),
) -> Result<DoctorReport, ModeError> {
    game.check_mode(&options.mode)?;
    let plan = Plan { mode: &options.mode, level: options.level, seed: options.seed };
    let mut known_types = KnownTypes::new(&bare_world());
    let mut comparisons: Vec<ComparisonReport> = Vec::new();
    let (mut observation, mut types) = (ObservationReport::default(), TypesReport::default());
    let mut suspicions = Vec::new();
    for comparison in Comparison::ALL {
        if let Some(why) = reason_to_skip(comparison, game, &comparisons) {
            comparisons.push(skipped(comparison, why));
            continue;
        }
        progress(comparison);
        let mut trial = Trial::new(comparison, game, &plan, options.ticks);
        let is_first = comparison == Comparison::Repeat;
        let mut monitor = is_first.then(|| ObservationMonitor::new(trial.copies[0].observed_names()));
        let result = trial.run(options.ticks, &mut known_types, &options.ignored, monitor.as_mut());
        if let Some(monitor) = monitor {
            observation = monitor.report();
            types = known_types.report(&trial.copies[0], &result.incomparable);
            suspicions = known_types.suspicions(&trial.copies[0]);
        }
        comparisons.push(result.report);
    }
    Ok(DoctorReport {
        game: game.name().to_owned(),
        version: game.version(),
        mode: options.mode.clone(),
        level: options.level,
        seed: options.seed,
        ticks: options.ticks,
        safety: assess_safety(&comparisons, &observation),
        findings: findings(&comparisons, &observation, &suspicions),
        comparisons,
        observation,
        types,
        ticks_per_second: None,
    })
}

/// A game that differs from itself differs in every comparison, and no comparison could name a cause.
fn reason_to_skip(comparison: Comparison, game: &dyn Game, done: &[ComparisonReport]) -> Option<String> {
    if comparison == Comparison::Arenas && game.tools().host.arenas_per_world() == Some(1) {
        return Some("a World of this game holds only one arena (its `arenas_per_world` is 1)".to_owned());
    }
    let broken = done.iter().find(|of| of.comparison == Comparison::Repeat && of.same() == Some(false))?;
    Some(match broken.fault.is_some() {
        true => "the game has a fault, which must be repaired first".to_owned(),
        false => "the game already differs from itself without this, which must be repaired first".to_owned(),
    })
}

fn skipped(comparison: Comparison, why: String) -> ComparisonReport {
    ComparisonReport {
        comparison,
        skipped: Some(why),
        ticks: 0,
        episodes: 0,
        first: None,
        others: Vec::new(),
        effect: None,
        unmatched: 0,
        fault: None,
    }
}
