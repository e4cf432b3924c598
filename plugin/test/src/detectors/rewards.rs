//! Rewards that are higher without the goal.

use crate::{
    detectors::{LevelDefect, LevelDetector, TestedLevel},
    explore::CellGrid,
};
use bevy_playbot::episode::EpisodeEnd;
use playbot_harness::detector::{Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LevelAhead};
use std::collections::BTreeMap;

/// A finding for episodes with more reward at the time limit than any solved one.
pub struct RewardFarm {
    factor: f64,
}

impl Default for RewardFarm {
    fn default() -> Self {
        Self { factor: 1.5 }
    }
}

impl LevelDetector for RewardFarm {
    fn name(&self) -> &'static str {
        "reward-farm"
    }

    fn describe(&self) -> &'static str {
        "an episode that was not solved brings more reward than the solved ones"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new("factor", &mut self.factor, "times the reward of the best solved episode")]
    }

    fn compares_testers(&self) -> bool {
        true
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let solved = level.episodes().filter(|(_, _, result)| result.success);
        let best = solved.map(|(_, _, result)| result.total_reward).max_by(f64::total_cmp);
        let Some(best) = best.filter(|best| *best > 0.0) else { return Vec::new() };
        let is_farm = |end: EpisodeEnd, total: f64| end == EpisodeEnd::Truncated && total > self.factor * best;
        let found = level.episodes().find(|(_, _, result)| !result.success && is_farm(result.end, result.total_reward));
        let defect = found.map(|(tester, episode, result)| LevelDefect {
            tester: Some(tester.to_owned()),
            episode: Some(episode),
            tick: result.ticks.checked_sub(1),
            settings: Vec::new(),
            message: format!(
                "a reward of {} until time was up, and at most {best} for reaching the goal",
                result.total_reward
            ),
        });
        defect.into_iter().collect()
    }
}

/// A finding for agents that earn again and again for coming back to the same spot or staying there. A reward for
/// getting nearer to something pays nothing on the path back. Payments of less than a thousandth of the largest reward of
/// a tick do not count. It is opt-in, because a game that pays for each tick does so everywhere.
pub struct RewardLoop {
    times: f64,
    spot: f64,
}

impl Default for RewardLoop {
    fn default() -> Self {
        Self { times: 10.0, spot: 0.02 }
    }
}

/// Least sum of rewards that is more than rounding.
const SOMETHING: f32 = 1e-4;

/// Least payment, as a share of the largest reward of a tick so far: an agent that physics pushes on within the spot is
/// paid a little for the way.
const LITTLE: f32 = 1e-3;

/// The earnings of an agent between its visits to a spot.
#[derive(Default)]
struct Visits {
    /// The sum of all rewards at the last visit.
    last: f32,
    /// Number of visits with a higher sum.
    paid: u32,
}

struct Earning {
    times: u32,
    grid: CellGrid,
    sum: f32,
    /// The largest reward of a tick.
    largest: f32,
    spots: BTreeMap<(i32, i32), Visits>,
}

impl Detector for RewardLoop {
    fn name(&self) -> &'static str {
        "reward-loop"
    }

    fn describe(&self) -> &'static str {
        "the agent is paid again and again for coming back to the same spot or staying there"
    }

    fn is_default(&self) -> bool {
        false
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("times", &mut self.times, "payments for one spot that are too many").at_least(2.0),
            DetectorSetting::new("spot", &mut self.spot, "side of a spot, in tiles").at_least(0.001),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let tile = CellGrid::new(level.plan.as_ref(), None).size;
        let grid = CellGrid::new(level.plan.as_ref(), Some(self.spot as f32 * tile));
        Some(Box::new(Earning { times: self.times as u32, grid, sum: 0.0, largest: 0.0, spots: BTreeMap::new() }))
    }
}

impl EpisodeWatcher for Earning {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        if moment.is_success {
            return None;
        }
        self.sum += moment.reward;
        self.largest = self.largest.max(moment.reward.abs());
        let position = moment.position?;
        let cell = self.grid.cell_at(position)?;
        let &[column, row] = cell.0.as_slice() else { return None };
        let is_first = !self.spots.contains_key(&(column, row));
        let visits = self.spots.entry((column, row)).or_default();
        let earned = self.sum - std::mem::replace(&mut visits.last, self.sum);
        visits.paid += u32::from(!is_first && earned > SOMETHING.max(LITTLE * self.largest));
        (visits.paid >= self.times).then(|| {
            format!(
                "the agent was paid {} times for coming back to {:.1}, {:.1} or staying there, {earned} the last time",
                visits.paid, position.x, position.y
            )
        })
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
        assert_eq!(tick, 50, "the first payment is none for coming back");
        assert!(message.contains("10 times for coming back to 4.5, 4.5"), "{message}");
    }

    #[test]
    fn coins_along_the_way_and_the_goal_are_sound() {
        let coins = steps(40, |tick| Step { reward: 1.0, ..Step::at(tick, tick as f32 / 5.0, 4.5) });
        assert_eq!(found(&RewardLoop::default(), &room(), &coins), None);
        let goal = steps(40, |tick| Step { reward: 1.0, is_success: true, ..Step::at(tick, 8.5, 8.5) });
        assert_eq!(found(&RewardLoop::default(), &room(), &goal), None);
    }

    #[test]
    fn who_is_pushed_on_within_a_spot_is_paid_for_the_way() {
        let creep = |fruit: f32| {
            let reward = |tick: usize| if tick == 0 { fruit } else { 2e-4 };
            let steps =
                steps(40, |tick| Step { reward: reward(tick), ..Step::at(tick, 4.501 + tick as f32 * 2e-4, 4.5) });
            found(&RewardLoop::default(), &room(), &steps)
        };
        assert_eq!(creep(1.0), None);
        assert!(creep(0.0).is_some(), "there is no larger reward");
    }

    #[test]
    fn who_goes_to_and_fro_earns_nothing_where_the_way_back_costs_what_the_way_there_pays() {
        let along = |tick: usize| [2.0, 3.0, 4.0, 3.0][tick % 4];
        let paid = |tick: usize| if tick == 0 { 0.0 } else { along(tick) - along(tick - 1) };
        let fro = steps(200, |tick| Step { reward: paid(tick), ..Step::at(tick, along(tick), 4.5) });
        assert_eq!(found(&RewardLoop::default(), &room(), &fro), None);
        let free = steps(200, |tick| Step { reward: paid(tick).max(0.0), ..Step::at(tick, along(tick), 4.5) });
        assert!(found(&RewardLoop::default(), &room(), &free).is_some(), "the way back is free");
    }
}
