//! Plans: a path to the coin, a proof that there is none, or neither.

use super::{
    config::PlannerConfig,
    reach::coin_is_unreachable,
    search::{COARSE, FINE, Found, search},
};
use crate::coinrun::sim::Sim;

/// The result of planning.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Plan {
    /// These actions reach the coin, one per step.
    Found(Vec<u8>),
    /// Nothing was found.
    GaveUp {
        /// Number of states that were expanded.
        expansions: usize,
    },
    /// No sequence of actions reaches the coin, not even without hazards and time limit.
    ProvedUnsolvable,
}

/// Searches for actions that lead from the state of `sim` to the coin.
///
/// The plan is exact: played from this state, it ends with the coin. An episode that is over has
/// no plan.
pub fn plan(sim: &Sim, config: &PlannerConfig) -> Plan {
    if sim.end().is_some() {
        return Plan::GaveUp { expansions: 0 };
    }
    match plan_or_progress(sim, config) {
        (Found::Coin(actions), _) => Plan::Found(actions),
        (Found::Hopeless(_), _) => Plan::ProvedUnsolvable,
        (Found::Progress(_), expansions) => Plan::GaveUp { expansions },
    }
}

/// Searches with the whole margin, with half of it, and at last by the exact rules alone, unless there is no path at
/// all.
pub(super) fn plan_or_progress(sim: &Sim, config: &PlannerConfig) -> (Found, usize) {
    let exact = PlannerConfig { margin: 0.0, caution: 0.0, ..*config };
    let mut attempts = vec![exact];
    if config.margin > 0.0 || config.caution > 0.0 {
        let cautious = PlannerConfig { max_expansions: config.max_cautious_expansions, ..*config };
        let less_cautious = PlannerConfig { margin: config.margin / 2.0, ..cautious };
        attempts = vec![cautious, less_cautious, exact];
    }
    let mut all = 0;
    for (number, attempt) in attempts.iter().enumerate() {
        let (found, expansions) = search(sim, attempt, &COARSE);
        all += expansions;
        match found {
            // The proof takes no longer than a short search, and saves the long ones.
            Found::Progress(actions) if number == 0 && coin_is_unreachable(sim) => {
                return (Found::Hopeless(actions), all);
            }
            Found::Progress(actions) if number + 1 == attempts.len() && expansions == config.max_expansions => {
                return (Found::Progress(actions), all);
            }
            Found::Progress(_) => {}
            found => return (found, all),
        }
    }
    // Few states mean that the player is in a tight spot, not that the path is long.
    let (found, expansions) = search(sim, &exact, &FINE);
    (found, all + expansions)
}
