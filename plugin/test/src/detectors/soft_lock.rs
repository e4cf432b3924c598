//! Agents that can no longer win.

use crate::explore::{CellGrid, ExploredCell};
use bevy::math::Vec2;
use bevy_playbot::episode::{EpisodeEnd, EpisodeResult};
use playbot_harness::detector::{Detector, DetectorSetting, DetectorTick, EpisodeWatcher, LeastEpisode, LevelAhead};
use std::collections::BTreeMap;

/// A finding for episodes that go on after the game [proves](playbot_harness::game::StateTools::prove_from) that their
/// agent can no longer reach the goal.
///
/// An agent that falls to its death cannot win either, so the episode must go on for a while. For a level that is
/// unsolvable from its start, that is reported instead.
pub struct SoftLock {
    every: f64,
    ticks: f64,
}

/// A position is asked about again after this many times the ticks between two questions: a door may have closed
/// meanwhile.
const STALE: u32 = 20;

impl Default for SoftLock {
    fn default() -> Self {
        Self { every: 50.0, ticks: 100.0 }
    }
}

struct Asking {
    every: u32,
    ticks: u32,
    grid: CellGrid,
    /// The next tick with a question; `None` if there is no further one.
    next: Option<u32>,
    /// Ticks of the questions, by tile and whether the agent rested there.
    asked: BTreeMap<(ExploredCell, bool), u32>,
    last: Option<Vec2>,
    /// The tick since which the goal is out of reach, and why.
    locked: Option<(u32, String)>,
}

impl Detector for SoftLock {
    fn name(&self) -> &'static str {
        "soft-lock"
    }

    fn describe(&self) -> &'static str {
        "the agent provably can no longer reach its goal, and the episode goes on"
    }

    fn settings(&mut self) -> Vec<DetectorSetting<'_>> {
        vec![
            DetectorSetting::new(
                "every",
                &mut self.every,
                "ticks between two questions to the game; more, later in an episode",
            )
            .at_least(1.0),
            DetectorSetting::new("ticks", &mut self.ticks, "ticks that the episode goes on without hope"),
        ]
    }

    /// After the first question half the ticks are enough if time is up then.
    fn least_episode(&self) -> LeastEpisode {
        let ticks = (self.every as u32).saturating_add(self.ticks as u32 / 2).saturating_add(1);
        LeastEpisode { needs_proofs: true, ..LeastEpisode::of_ticks(ticks) }
    }

    fn setting_for(&self, ticks: u32) -> Option<String> {
        let left = ticks.saturating_sub(self.every as u32).saturating_sub(1);
        (left > 0).then(|| format!("ticks={}", left.saturating_mul(2)))
    }

    fn watch(&self, level: &LevelAhead) -> Option<Box<dyn EpisodeWatcher>> {
        let every = self.every as u32;
        Some(Box::new(Asking {
            every,
            ticks: self.ticks as u32,
            grid: CellGrid::new(level.plan.as_ref(), None),
            // At the start the level's own proof counts.
            next: Some(every),
            asked: BTreeMap::new(),
            last: None,
            locked: None,
        }))
    }
}

impl Asking {
    /// Returns whether this position was never asked about, or so long ago that the answer may have changed.
    fn is_unknown(&mut self, moment: &DetectorTick<'_>, rests: bool) -> bool {
        let Some(cell) = moment.position.and_then(|position| self.grid.cell_at(position)) else { return true };
        let asked = (cell, rests);
        let stale = self.every.saturating_mul(STALE);
        let is_known = self.asked.get(&asked).is_some_and(|last| moment.tick.saturating_sub(*last) < stale);
        if !is_known {
            self.asked.insert(asked, moment.tick);
        }
        !is_known
    }

    fn ask(&mut self, moment: &DetectorTick<'_>) {
        // A locked agent stays locked, so rarer questions are enough later.
        self.next = moment.tick.checked_add(self.every.max(moment.tick / 2));
        let proof = moment.proofs.of_state();
        let Some(why) = proof.why_unsolvable() else { return };
        if moment.proofs.of_level().why_unsolvable().is_some() {
            self.next = None;
        } else {
            self.locked = Some((moment.tick, why.to_owned()));
        }
    }

    /// Returns the message once the episode has gone on for this many ticks.
    fn reported(&self, moment: &DetectorTick<'_>, ticks: u32) -> Option<String> {
        let (since, why) = self.locked.as_ref()?;
        (moment.tick >= since.saturating_add(ticks)).then(|| format!("since tick {since} at the latest {why}"))
    }
}

impl EpisodeWatcher for Asking {
    fn tick(&mut self, moment: &DetectorTick<'_>) -> Option<String> {
        let rests = moment.position.is_some() && moment.position == self.last;
        self.last = moment.position;
        if moment.is_success {
            (self.next, self.locked) = (None, None);
        }
        if self.locked.is_some() {
            return self.reported(moment, self.ticks);
        }
        if self.next.is_some_and(|next| moment.tick >= next) && self.is_unknown(moment, rests) {
            self.ask(moment);
        }
        None
    }

    /// The time limit came while the goal was out of reach. Half the ticks are enough then, since nothing kills there.
    fn end(&mut self, moment: &DetectorTick<'_>, result: &EpisodeResult) -> Option<String> {
        let is_late = result.end == EpisodeEnd::Truncated && !result.success;
        is_late.then(|| self.reported(moment, self.ticks / 2)).flatten()
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell as Counter;

    use super::*;
    use crate::detectors::testing::{Step, found, found_proving, room, timed_out_proving};
    use playbot_harness::detector::{LevelProof, Proofs};

    /// A goal that is out of reach from one question on, and perhaps from the start of the level.
    #[derive(Default)]
    struct Trap {
        asked: Counter<u32>,
        from: u32,
        is_whole_level: bool,
    }

    fn lost() -> LevelProof {
        LevelProof::Unsolvable { why: "the door is shut".to_owned() }
    }

    impl Proofs for Trap {
        fn of_level(&self) -> LevelProof {
            if self.is_whole_level { lost() } else { LevelProof::Unknown }
        }

        fn of_state(&self) -> LevelProof {
            self.asked.set(self.asked.get() + 1);
            if self.asked.get() > self.from { lost() } else { LevelProof::Unknown }
        }
    }

    fn wander(count: usize) -> Vec<Step> {
        (0..count).map(|tick| Step::at(tick, 1.0 + (tick / 10) as f32 % 8.0, 2.0)).collect()
    }

    fn quick() -> SoftLock {
        SoftLock { every: 10.0, ticks: 30.0 }
    }

    #[test]
    fn who_goes_on_without_hope_is_found() {
        let trap = Trap { from: 2, ..Trap::default() };
        let (tick, message) = found_proving(&quick(), &room(), &wander(100), &trap).expect("the door is shut");
        // There are questions at ticks 10, 20 and 30, and then the episode goes on for 30 ticks.
        assert_eq!((tick, trap.asked.get()), (60, 3));
        assert!(message.contains("since tick 30") && message.contains("the door is shut"), "{message}");
        let trap = Trap::default();
        assert!(timed_out_proving(&quick(), &room(), &wander(27), &trap).is_some(), "16 ticks and time is up");
        assert!(timed_out_proving(&quick(), &room(), &wander(20), &trap).is_none(), "9 ticks may be a fall");
    }

    #[test]
    fn it_says_how_long_an_episode_must_be() {
        let found = |detector: &SoftLock, ticks: u32| {
            timed_out_proving(detector, &room(), &wander(ticks as usize), &Trap::default()).is_some()
        };
        let least = quick().least_episode().ticks;
        assert_eq!((least, SoftLock::default().least_episode().ticks), (26, 101));
        assert!(found(&quick(), least) && !found(&quick(), least - 1));
        assert_eq!(quick().setting_for(13).as_deref(), Some("ticks=4"));
        assert!(found(&SoftLock { every: 10.0, ticks: 4.0 }, 13));
        assert_eq!(quick().setting_for(11), None, "the first question is too late");
    }

    #[test]
    fn who_may_still_win_has_won_or_never_could_is_silent() {
        assert_eq!(found(&quick(), &room(), &wander(500)), None);
        assert_eq!(found_proving(&quick(), &room(), &wander(35), &Trap::default()), None, "it ends before");
        let never = Trap { is_whole_level: true, ..Trap::default() };
        assert_eq!(found_proving(&quick(), &room(), &wander(500), &never), None);
        assert_eq!(never.asked.get(), 1, "once is enough");
        let won: Vec<Step> = wander(500).into_iter().map(|step| Step { is_success: true, ..step }).collect();
        assert_eq!(found_proving(&quick(), &room(), &won, &Trap::default()), None);
    }

    #[test]
    fn a_position_is_asked_about_once_in_a_while() {
        let rests: Vec<Step> = (0..201).map(|tick| Step::at(tick, 2.0, 2.0)).collect();
        let hopeful = Trap { from: 1000, ..Trap::default() };
        assert_eq!(found_proving(&quick(), &room(), &rests, &hopeful), None);
        assert_eq!(hopeful.asked.get(), 1, "for 200 ticks");
    }
}
