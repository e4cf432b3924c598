//! Detectors of wrong goals and wrong paths. They find goals that are reached from afar or without an effect, parts of
//! a level that cannot be reached, and shortcuts.

use crate::{
    detectors::{LevelDefect, LevelDetector, ShownBy, TestedLevel},
    explore::{CellGrid, ExplorePlan, explore},
};
use bevy::math::Vec2;
use bevy_playbot::episode::EpisodeResult;
use playbot_harness::{
    detector::{Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LevelAhead},
    eval::{EvalPlan, Player, evaluate},
    game::Game,
    split::LevelSplit,
};
use playbot_report::counted;
use std::ops::ControlFlow;

/// A finding for agents that succeed far from the goal of their level's plan.
///
/// In some games success does not depend on the position. So it is a default detector only for games that declare
/// [the distance of their goals](Self::beyond).
pub struct FarGoal {
    distance: f64,
    is_default: bool,
}

impl Default for FarGoal {
    fn default() -> Self {
        Self { distance: 3.0, is_default: false }
    }
}

impl FarGoal {
    /// Creates the detector for [a game's own detectors](playbot_harness::game::TestTools::detectors): no agent farther
    /// from the goal than this, in tiles, can reach it.
    pub fn beyond(distance: f64) -> Self {
        Self { distance, is_default: true }
    }
}

struct Away {
    goal: Vec2,
    distance: f32,
    was_success: bool,
}

impl Detector for FarGoal {
    fn name(&self) -> &'static str {
        "far-goal"
    }

    fn describe(&self) -> &'static str {
        "the agent succeeds far from the goal"
    }

    fn is_default(&self) -> bool {
        self.is_default
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![DetectorSetting::new("distance", &mut self.distance, "how far the goal may reach, in tiles")]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let plan = level.plan.as_ref()?;
        let distance = self.distance as f32 * CellGrid::new(Some(plan), None).size;
        Some(Box::new(Away { goal: plan.goal, distance, was_success: false }))
    }
}

impl EpisodeWatcher for Away {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let is_first = moment.is_success && !self.was_success;
        self.was_success |= moment.is_success;
        let away = moment.position.filter(|_| is_first)?.distance(self.goal);
        (away > self.distance).then(|| format!("the agent succeeds {away:.1} from the goal"))
    }
}

/// A finding for agents that are at the goal of their level's plan without success.
///
/// Some goals need more than a position, such as a key. So it is a default detector only for games that declare
/// [the distance of their goals](Self::within).
pub struct GoalIgnored {
    distance: f64,
    ticks: f64,
    is_default: bool,
}

impl Default for GoalIgnored {
    fn default() -> Self {
        Self { distance: 0.1, ticks: 10.0, is_default: false }
    }
}

impl GoalIgnored {
    /// Creates the detector for [a game's own detectors](playbot_harness::game::TestTools::detectors): an agent within
    /// this distance of the goal after a tick, in tiles, has reached it in this tick.
    pub fn within(distance: f64) -> Self {
        Self { distance, ticks: 1.0, is_default: true }
    }
}

struct Near {
    goal: Vec2,
    distance: f32,
    ticks: u32,
    stayed: u32,
}

impl Detector for GoalIgnored {
    fn name(&self) -> &'static str {
        "goal-ignored"
    }

    fn describe(&self) -> &'static str {
        "the agent is at the goal and that is no success"
    }

    fn is_default(&self) -> bool {
        self.is_default
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("distance", &mut self.distance, "how far the goal reaches, in tiles"),
            DetectorSetting::new("ticks", &mut self.ticks, "ticks in a row at the goal").at_least(1.0),
        ]
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let plan = level.plan.as_ref()?;
        let distance = self.distance as f32 * CellGrid::new(Some(plan), None).size;
        Some(Box::new(Near { goal: plan.goal, distance, ticks: self.ticks as u32, stayed: 0 }))
    }
}

impl EpisodeWatcher for Near {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let away = moment.position?.distance(self.goal);
        self.stayed = if away <= self.distance && !moment.is_success { self.stayed + 1 } else { 0 };
        (self.stayed >= self.ticks)
            .then(|| format!("the agent is {away:.2} from the goal for {} ticks, and has not reached it", self.stayed))
    }
}

/// A finding for tiles that an explorer does not reach, though no wall cuts them off from the start. It is opt-in,
/// because it is no proof and takes some seconds for each level.
pub struct UnreachableRegion {
    steps: f64,
    share: f64,
    every: f64,
}

/// Most tiles that are named.
const NAMED: usize = 4;

impl Default for UnreachableRegion {
    fn default() -> Self {
        Self { steps: 100_000.0, share: 0.05, every: 1.0 }
    }
}

impl UnreachableRegion {
    /// Returns the message about tiles that an explorer does not reach.
    fn missed(&self, game: &dyn Game, mode: &str, level: u64, stop: &dyn Fn() -> bool) -> Option<String> {
        // Without a plan, the open tiles are unknown.
        game.tools().levels.floor_plan(mode, level)?;
        let plan =
            ExplorePlan { steps: self.steps as u64, arenas: 8, worlds: 1, threads: 1, ..ExplorePlan::new(mode, level) };
        // Other detectors report a game that panics or does not replay.
        let go_on = |_| if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let found = explore(game, &plan, |_| {}, go_on).ok()?;
        let coverage = found.coverage().filter(|coverage| 1.0 - coverage > self.share)?;
        let missed: Vec<String> = found.missed().take(NAMED).map(ToString::to_string).collect();
        Some(format!(
            "an explorer of {} steps reached {:.0} % of the open tiles, and not {}",
            found.steps,
            100.0 * coverage,
            missed.join(" or ")
        ))
    }
}

impl LevelDetector for UnreachableRegion {
    fn name(&self) -> &'static str {
        "unreachable-region"
    }

    fn describe(&self) -> &'static str {
        "an explorer does not get to tiles that no wall cuts off"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("steps", &mut self.steps, "steps of the explorer on a level").at_least(1.0),
            DetectorSetting::new("share", &mut self.share, "share of the tiles that it may miss"),
            DetectorSetting::new("every", &mut self.every, "look at every n-th level of the range").at_least(1.0),
        ]
    }

    fn depends_on_testers(&self) -> bool {
        false
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        if !level.is_sample(self.every) {
            return Vec::new();
        }
        let missed = self.missed(level.game, level.mode, level.level, level.stop);
        missed.map(|message| LevelDefect { message, ..LevelDefect::default() }).into_iter().collect()
    }

    fn shown_by(&self) -> ShownBy {
        ShownBy::Level
    }

    fn is_in_level(&self, game: &dyn Game, mode: &str, level: u64) -> bool {
        self.missed(game, mode, level, &|| false).is_some()
    }
}

/// A finding for testers that solve a level in far fewer ticks than expected. The expected number is the par of the
/// level, by the designer or by demonstrations, or else the ticks of the game's demonstrator.
pub struct Shortcut {
    factor: f64,
    par: f64,
}

impl Default for Shortcut {
    fn default() -> Self {
        Self { factor: 0.5, par: 0.0 }
    }
}

impl Shortcut {
    /// Returns the ticks that the level should take.
    fn par(&self, level: &TestedLevel<'_>) -> Option<f64> {
        if self.par > 0.0 {
            return Some(self.par);
        }
        if level.par.is_some() {
            return level.par;
        }
        level.game.tools().bots.demonstrator()?;
        let split = LevelSplit { mode: level.mode.to_owned(), first: level.level, last: level.level };
        let plan = EvalPlan::of_bot(split, 1, 1);
        // Other detectors report a panic.
        let results = evaluate(level.game, &Player::Demonstrator, &plan, |_| {}).ok()?;
        results.iter().find(|result| result.success).map(|result| f64::from(result.ticks))
    }
}

impl LevelDetector for Shortcut {
    fn name(&self) -> &'static str {
        "shortcut"
    }

    fn describe(&self) -> &'static str {
        "the level is solved far faster than by the demonstrator, or than its par"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new("factor", &mut self.factor, "share of the par that is too fast"),
            DetectorSetting::new(
                "par",
                &mut self.par,
                "ticks that a level should take; 0 for those of --par, or of the demonstrator",
            ),
        ]
    }

    fn inspect(&self, level: &TestedLevel<'_>) -> Vec<LevelDefect> {
        let solved = level.episodes().filter(|(_, _, result)| result.success);
        let Some((tester, episode, fastest)) = solved.min_by_key(|(_, _, result)| result.ticks) else {
            return Vec::new();
        };
        let Some(par) = self.par(level) else { return Vec::new() };
        if !is_too_fast(fastest, par, self.factor) {
            return Vec::new();
        }
        let message = format!("solved in {}, where {par} are expected", counted(u64::from(fastest.ticks), "tick"));
        let (tester, episode, tick) = (Some(tester.to_owned()), Some(episode), fastest.ticks.checked_sub(1));
        let settings = vec![format!("shortcut.par={par}")];
        vec![LevelDefect { tester, episode, tick, message, settings }]
    }

    fn shown_by(&self) -> ShownBy {
        ShownBy::Episode
    }

    /// Findings store their level's par. In older ones without it, an episode that is as fast counts.
    fn is_in_episode(&self, result: &EpisodeResult, tick: Option<u32>) -> bool {
        let is_fast = if self.par > 0.0 {
            is_too_fast(result, self.par, self.factor)
        } else {
            tick.is_none_or(|tick| result.ticks <= tick.saturating_add(1))
        };
        result.success && is_fast
    }
}

fn is_too_fast(result: &EpisodeResult, par: f64, factor: f64) -> bool {
    f64::from(result.ticks) < par * factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::detectors::testing::{LOST, Step, WON, found, inspected, room};

    /// From the goal at 8.5, 8.5 to the left, with success in one tick.
    fn leave(success: usize) -> Vec<Step> {
        (0..16)
            .map(|tick| Step { is_success: tick >= success, ..Step::at(tick, 8.5 - 0.5 * tick as f32, 8.5) })
            .collect()
    }

    #[test]
    fn success_far_from_the_goal_is_found_when_it_comes() {
        let (tick, message) = found(&FarGoal::default(), &room(), &leave(8)).expect("4 tiles away");
        assert_eq!(tick, 8);
        assert!(message.contains("4.0 from the goal"), "{message}");
        assert!(found(&FarGoal::beyond(1.0), &room(), &leave(3)).is_some());
    }

    #[test]
    fn success_at_the_goal_is_sound_wherever_the_agent_goes_then() {
        assert_eq!(found(&FarGoal::default(), &room(), &leave(2)), None);
        assert_eq!(found(&FarGoal::default(), &room(), &leave(99)), None, "no success");
        assert_eq!(found(&FarGoal::default(), &LevelAhead::default(), &leave(8)), None, "no plan");
        assert!(!FarGoal::default().is_default() && FarGoal::beyond(1.0).is_default());
    }

    /// Towards the goal at 8.5, 8.5, where the agent stays.
    fn arrive(is_success: bool) -> Vec<Step> {
        let step = |tick: usize| {
            let along = (0.5 * tick as f32).min(8.5);
            Step { is_success: is_success && along == 8.5, ..Step::at(tick, along, along) }
        };
        (0..60).map(step).collect()
    }

    #[test]
    fn a_goal_that_does_nothing_is_found() {
        let (tick, message) = found(&GoalIgnored::default(), &room(), &arrive(false)).expect("it is there");
        // It arrives in tick 17, which is the first of ten.
        assert_eq!(tick, 26);
        assert!(message.contains("0.00 from the goal"), "{message}");
        assert_eq!(found(&GoalIgnored::within(0.3), &room(), &arrive(false)).map(|(tick, _)| tick), Some(17));
    }

    #[test]
    fn a_goal_that_works_and_one_that_is_passed_by_are_sound() {
        assert_eq!(found(&GoalIgnored::within(0.3), &room(), &arrive(true)), None);
        let by: Vec<Step> = (0..60).map(|tick| Step::at(tick, 0.5 * (tick % 18) as f32, 8.5)).collect();
        assert_eq!(found(&GoalIgnored::default(), &room(), &by), None, "one tick in 18");
        assert_eq!(found(&GoalIgnored::default(), &LevelAhead::default(), &arrive(false)), None, "no plan");
        assert!(!GoalIgnored::default().is_default() && GoalIgnored::within(0.3).is_default());
    }

    #[test]
    fn a_level_that_is_solved_far_faster_than_its_par_has_a_shortcut() {
        let episodes = [(WON, 90, [1.0; 2]), (WON, 40, [1.0; 2]), (LOST, 3, [1.0; 2])];
        let found = inspected(&Shortcut::default(), &episodes, Some(100.0));
        assert_eq!((found.len(), found[0].episode, found[0].tick), (1, Some(1), Some(39)));
        assert!(inspected(&Shortcut::default(), &episodes, Some(80.0)).is_empty(), "half the par is no shortcut");
        assert!(inspected(&Shortcut::default(), &episodes, None).is_empty(), "it is not demonstrated");
    }

    #[test]
    fn an_episode_that_is_too_fast_for_its_par_shows_it_again() {
        let found = inspected(&Shortcut::default(), &[(WON, 40, [1.0; 2])], Some(100.0));
        assert_eq!(found[0].settings, ["shortcut.par=100"]);
        let ended =
            |end, ticks| EpisodeResult { level: 0, end, success: end == WON, ticks, clipped: 0, total_reward: 0.0 };
        let shows = |end, ticks| Shortcut::default().is_in_episode(&ended(end, ticks), Some(39));
        assert!(shows(WON, 40) && shows(WON, 12) && !shows(WON, 41) && !shows(LOST, 12));
        let shows = |factor, end, ticks| Shortcut { factor, par: 100.0 }.is_in_episode(&ended(end, ticks), Some(39));
        assert!(shows(0.5, WON, 49) && !shows(0.5, WON, 50) && !shows(0.5, LOST, 40) && !shows(0.3, WON, 40));
    }
}
