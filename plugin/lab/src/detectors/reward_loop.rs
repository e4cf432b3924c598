//! Rewards that can be had again and again.

use std::collections::BTreeMap;

use crate::{
    detector::{Detector, LevelAhead, Moment, Setting, Watch},
    explore::CellGrid,
};

/// The same reward is paid again and again on the same tile, and the aim is not reached. A game that pays for each tick does
/// so everywhere, so it is not usual.
pub struct RewardLoop {
    times: f64,
}

impl Default for RewardLoop {
    fn default() -> Self {
        Self { times: 10.0 }
    }
}

struct Paid {
    times: u32,
    grid: CellGrid,
    /// By tile and bits of the reward.
    payments: BTreeMap<(i32, i32, u32), u32>,
}

impl Detector for RewardLoop {
    fn name(&self) -> &'static str {
        "reward-loop"
    }

    fn describe(&self) -> &'static str {
        "the same reward is paid again and again on the same tile"
    }

    fn is_usual(&self) -> bool {
        false
    }

    fn settings(&mut self) -> Vec<Setting<'_>> {
        vec![Setting::new("times", &mut self.times, "payments on one tile that are too many").at_least(2.0)]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn Watch>> {
        let grid = CellGrid::new(level.plan.as_ref(), None);
        Some(Box::new(Paid { times: self.times as u32, grid, payments: BTreeMap::new() }))
    }
}

impl Watch for Paid {
    fn tick(&mut self, moment: &Moment<'_>) -> Option<String> {
        if moment.is_success || moment.reward <= 0.0 {
            return None;
        }
        let cell = self.grid.cell_at(moment.place?)?;
        let &[column, row] = cell.0.as_slice() else { return None };
        let payments = self.payments.entry((column, row, moment.reward.to_bits())).or_default();
        *payments += 1;
        (*payments >= self.times)
            .then(|| format!("a reward of {} was paid {payments} times on tile {cell}", moment.reward))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{Step, found, room};

    fn steps(count: usize, step: impl Fn(usize) -> Step) -> Vec<Step> {
        (0..count).map(step).collect()
    }

    #[test]
    fn a_coin_that_comes_back_is_found() {
        let paid = |tick: usize| if tick.is_multiple_of(5) { 1.0 } else { 0.0 };
        let farm = steps(100, |tick| Step { reward: paid(tick), ..Step::at(tick, 4.5, 4.5) });
        let (tick, message) = found(&RewardLoop::default(), &room(), &farm).expect("it comes back");
        assert_eq!(tick, 45, "the tenth payment");
        assert!(message.contains("10 times on tile 4,4"), "{message}");
    }

    #[test]
    fn coins_along_the_way_and_the_goal_are_sound() {
        let coins = steps(40, |tick| Step { reward: 1.0, ..Step::at(tick, tick as f32 / 5.0, 4.5) });
        assert_eq!(found(&RewardLoop::default(), &room(), &coins), None);
        let goal = steps(40, |tick| Step { reward: 1.0, is_success: true, ..Step::at(tick, 8.5, 8.5) });
        assert_eq!(found(&RewardLoop::default(), &room(), &goal), None);
    }
}
