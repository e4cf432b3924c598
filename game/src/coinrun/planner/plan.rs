//! Plans: the way to the coin, that there is none, or that none was found.

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
        (Found::Progress(_), _) if coin_is_unreachable(sim) => Plan::ProvedUnsolvable,
        (Found::Progress(_), expansions) => Plan::GaveUp { expansions },
    }
}

/// Searches with the whole margin, with half of it, and at last by the exact rules alone.
pub(super) fn plan_or_progress(sim: &Sim, config: &PlannerConfig) -> (Found, usize) {
    let mut expansions = 0;
    let mut attempts = Vec::new();
    if config.margin > 0.0 || config.caution > 0.0 {
        let margin = config.margin / 2.0;
        let max_expansions = config.max_cautious_expansions;
        attempts.push(PlannerConfig { max_expansions, ..*config });
        attempts.push(PlannerConfig { max_expansions, margin, ..*config });
    }
    for attempt in attempts {
        let (found, more) = search(sim, &attempt, &COARSE);
        expansions += more;
        if matches!(found, Found::Coin(_)) {
            return (found, expansions);
        }
    }
    let exact = PlannerConfig { margin: 0.0, caution: 0.0, ..*config };
    let (found, more) = search(sim, &exact, &COARSE);
    expansions += more;
    // Few states mean that the player is in a tight spot, not that the way is long.
    if matches!(found, Found::Progress(_)) && more < config.max_expansions {
        let (found, more) = search(sim, &exact, &FINE);
        return (found, expansions + more);
    }
    (found, expansions)
}
