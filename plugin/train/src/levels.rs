//! The levels that the arenas of a training play next: lessons by success, and prioritised level replay.
//!
//! A [`LevelPlan`] gives each arena the queue of its levels. Between two rollouts it notes which episodes have ended, in an
//! order that does not depend on the number of threads, and decides whether a lesson is learned. All that it decides from
//! is in its [`LevelState`], which a checkpoint keeps. The folder:
//!
//! - `plr`: scores of levels, and their probabilities.

mod plr;

use crate::{
    experiment::{Experiment, LevelOrder},
    levels::plr::{LevelScores, PlrSettings, RunningMeans},
    metrics_log::{LESSON, LESSON_SUCCESS},
};
use bevy_playbot::level::LevelQueue;
use playbot_harness::split::LevelSplit;
use serde::{Deserialize, Serialize};
use std::{collections::VecDeque, ops::Range, sync::Arc};

/// The levels of each arena, and what they are decided from.
#[derive(Clone, Debug)]
pub(crate) struct LevelPlan {
    /// The lessons, those of `train` last, each with the success rate at which it is learned.
    lessons: Vec<(LevelSplit, Option<f64>)>,
    window: usize,
    mix: f64,
    plr: Option<PlrSettings>,
    /// Agents that share an arena, and so a level.
    sharing: usize,
    agents: usize,
    state: LevelState,
}

/// What the levels are decided from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct LevelState {
    /// The current lesson, from 0 on.
    lesson: usize,
    /// Whether its last episodes succeeded, the oldest first.
    recent: VecDeque<bool>,
    /// Its levels, for prioritised level replay.
    scores: LevelScores,
    running: RunningMeans,
}

/// An episode that ended in a rollout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EndedEpisode {
    /// Its agent, as a column of the rollout.
    pub(crate) agent: usize,
    /// Its last tick, of the rollout.
    pub(crate) tick: usize,
    pub(crate) level: u64,
    pub(crate) success: bool,
}

impl LevelPlan {
    /// Makes the plan of an experiment, at its first lesson. `sharing` agents share an arena.
    pub(crate) fn new(experiment: &Experiment, agents: usize, sharing: usize) -> Self {
        let plr = match experiment.levels.order {
            LevelOrder::Uniform => None,
            LevelOrder::Plr { temperature, staleness, new } => Some(PlrSettings { temperature, staleness, new }),
        };
        let (window, mix) = (experiment.curriculum.window, experiment.curriculum.mix);
        let (lessons, sharing, state) = (experiment.lessons(), sharing.max(1), LevelState::default());
        Self { lessons, window, mix, plr, sharing, agents, state }
    }

    /// Returns whether anything is decided: otherwise all arenas play all levels of `train` alike, and there is no state.
    pub(crate) fn decides(&self) -> bool {
        self.lessons.len() > 1 || self.plr.is_some()
    }

    /// Returns what a checkpoint keeps; `None` if nothing is decided.
    pub(crate) fn state(&self) -> Option<LevelState> {
        self.decides().then(|| self.state.clone())
    }

    /// Goes on from the state of a checkpoint. Without one, such as in a checkpoint of an older version, it begins anew.
    pub(crate) fn restored(self, state: Option<LevelState>) -> Self {
        let mut state = state.unwrap_or_default();
        state.lesson = state.lesson.min(self.lessons.len() - 1);
        Self { state, ..self }
    }

    /// Returns the current lesson, from 0 on, and the number of lessons.
    pub(crate) fn lesson(&self) -> (usize, usize) {
        (self.state.lesson, self.lessons.len())
    }

    /// Returns the lesson that an agent's arena plays while `current` is the current one: the last arenas go on with the
    /// lessons before it, the latest of those first.
    fn lesson_of(&self, agent: usize, current: usize) -> usize {
        let (arenas, arena) = (self.agents / self.sharing, agent / self.sharing);
        if current == 0 || self.mix <= 0.0 || arenas < 2 {
            return current;
        }
        // At least one arena of each kind.
        let earlier = ((arenas as f64 * self.mix).round() as usize).clamp(1, arenas - 1);
        match arena.checked_sub(arenas - earlier) {
            Some(back) => current - 1 - back * current / earlier,
            None => current,
        }
    }

    /// Returns the mode in which an agent plays while `current` is the current lesson.
    fn mode_of(&self, agent: usize, current: usize) -> &str {
        &self.lessons[self.lesson_of(agent, current)].0.mode
    }

    /// Returns the lessons from the current one on at whose beginning some arena changes its mode, the current one first.
    pub(crate) fn changes_of_mode(&self) -> Vec<usize> {
        let modes = |lesson: usize| (0..self.agents).map(move |agent| self.mode_of(agent, lesson));
        let mut changes = vec![self.state.lesson];
        for lesson in self.state.lesson + 1..self.lessons.len() {
            let last = changes.last().copied().unwrap_or_default();
            if !modes(lesson).eq(modes(last)) {
                changes.push(lesson);
            }
        }
        changes
    }

    /// Splits neighbouring agents by their modes in a lesson. Returns each part with the levels of its first agent.
    pub(crate) fn parts_by_mode(&self, agents: Range<usize>, lesson: usize) -> Vec<(Range<usize>, &LevelSplit)> {
        let mut parts: Vec<(Range<usize>, &LevelSplit)> = Vec::new();
        for agent in agents {
            let levels = &self.lessons[self.lesson_of(agent, lesson)].0;
            match parts.last_mut() {
                Some((part, before)) if before.mode == levels.mode => part.end = agent + 1,
                _ => parts.push((agent..agent + 1, levels)),
            }
        }
        parts
    }

    /// Returns the queues of all agents' levels until the next rollout has ended.
    pub(crate) fn queues(&self) -> Vec<LevelQueue> {
        let current = self.state.lesson;
        let levels = &self.lessons[current].0;
        let scored = self.plr.map(|settings| Arc::new(self.state.scores.queue(levels, settings)));
        let queue_of = |agent: usize| {
            let lesson = self.lesson_of(agent, current);
            match &scored {
                Some(scored) if lesson == current => LevelQueue::Weighted(scored.clone()),
                _ => {
                    let levels = &self.lessons[lesson].0;
                    LevelQueue::Uniform { first: levels.first, last: levels.last }
                }
            }
        };
        (0..self.agents).map(queue_of).collect()
    }

    /// Notes the episodes that have ended in a rollout, in order, with the sizes of its advantages and the ends of its
    /// rows, `[ticks, agents]`. Returns whether another lesson begins.
    pub(crate) fn note(&mut self, ended: &[EndedEpisode], sizes: &[Option<f32>], ends: &[bool]) -> bool {
        let current = self.state.lesson;
        let means = match self.plr {
            Some(_) => self.state.running.add(sizes, ends, self.agents),
            None => Default::default(),
        };
        let levels = self.lessons[current].0.clone();
        // An episode that began in the lesson before may be of another level, and arenas may repeat earlier lessons.
        let is_own = |episode: &&EndedEpisode| {
            self.lesson_of(episode.agent, current) == current && levels.contains(&levels.mode, episode.level)
        };
        let own: Vec<EndedEpisode> = ended.iter().filter(is_own).copied().collect();
        for episode in own {
            if self.plr.is_some() {
                let mean = means.get(&(episode.agent, episode.tick)).copied().flatten();
                self.state.scores.note(episode.level, mean);
            }
            if self.lessons.len() > 1 {
                self.state.recent.push_back(episode.success);
                let surplus = self.state.recent.len().saturating_sub(self.window);
                self.state.recent.drain(..surplus);
            }
        }
        if !self.is_learned() {
            return false;
        }
        self.state.lesson += 1;
        self.state.recent.clear();
        self.state.scores = LevelScores::default();
        true
    }

    /// Notes that all arenas begin new episodes.
    pub(crate) fn begin_anew(&mut self) {
        self.state.running.clear();
    }

    /// Returns the success rate of the last episodes of the current lesson; `None` before the first one.
    fn success(&self) -> Option<f64> {
        let recent = &self.state.recent;
        let successes = recent.iter().filter(|success| **success).count();
        (!recent.is_empty()).then(|| successes as f64 / recent.len() as f64)
    }

    fn is_learned(&self) -> bool {
        let wanted = self.lessons[self.state.lesson].1;
        let is_full = self.state.recent.len() >= self.window;
        is_full && self.success().zip(wanted).is_some_and(|(success, wanted)| success >= wanted)
    }

    /// Returns the metrics by their tags; none if nothing is decided.
    pub(crate) fn scalars(&self) -> Vec<(&'static str, f64)> {
        let mut scalars = Vec::new();
        if self.lessons.len() > 1 {
            scalars.push((LESSON, (self.state.lesson + 1) as f64));
            scalars.push(("levels/lesson_episodes", self.state.recent.len() as f64));
            scalars.extend(self.success().map(|success| (LESSON_SUCCESS, success)));
        }
        if let Some(settings) = self.plr {
            scalars.extend(self.state.scores.scalars(settings));
        }
        scalars
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::file::parse_experiment;
    use std::path::Path;

    fn plan(changes: &str, agents: usize, sharing: usize) -> LevelPlan {
        let text = format!(
            r#"(game: "g", train: "hard:0..9", test: "hard:10..19", algorithm: "ppo", steps: 1000, {changes})"#
        );
        LevelPlan::new(&parse_experiment(&text, Path::new("x.ron")).expect("valid"), agents, sharing)
    }

    const LESSONS: &str = r#"curriculum: (lessons: [(levels: "easy:0..4"), (levels: "hard:20..29", success: 1.0)],
        success: 0.75, window: 4, mix: 0.5)"#;

    fn ended(agent: usize, tick: usize, level: u64, success: bool) -> EndedEpisode {
        EndedEpisode { agent, tick, level, success }
    }

    #[test]
    fn without_lessons_and_order_nothing_is_decided() {
        let plan = plan("", 4, 1);
        assert!(!plan.decides() && plan.state().is_none() && plan.scalars().is_empty());
        assert_eq!(format!("{:?}", plan.queues()[3]), "Uniform { first: 0, last: 9 }");
        assert_eq!(plan.changes_of_mode(), [0]);
    }

    #[test]
    fn a_lesson_ends_when_enough_of_its_own_last_episodes_succeed() {
        let mut plan = plan(LESSONS, 4, 1);
        let three = [ended(0, 0, 1, true), ended(1, 0, 2, true), ended(2, 0, 3, true)];
        assert!(!plan.note(&three, &[], &[]), "the window is not full");
        assert!(!plan.note(&[ended(3, 0, 99, true)], &[], &[]), "level 99 is not of the lesson");
        assert!(plan.note(&[ended(3, 0, 0, false)], &[], &[]), "three of four");
        assert_eq!((plan.lesson(), plan.scalars()[1]), ((1, 3), ("levels/lesson_episodes", 0.0)));
        // Half of the arenas repeat the first lesson, and their episodes say nothing about the second.
        let all = [0, 1, 2, 3].map(|agent| ended(agent, 1, 20, true));
        assert!(!plan.note(&all, &[], &[]));
        assert!(!plan.note(&[ended(0, 2, 20, true), ended(1, 2, 20, false)], &[], &[]), "this one wants all");
        assert!(!plan.note(&[ended(0, 3, 20, true), ended(1, 3, 20, true), ended(0, 4, 20, true)], &[], &[]));
        assert!(plan.note(&[ended(0, 5, 20, true)], &[], &[]));
        assert!(!plan.note(&[0; 9].map(|agent| ended(agent, 6, 5, true)), &[], &[]), "the last one is never left");
        assert_eq!(plan.lesson(), (2, 3));
    }

    #[test]
    fn the_last_arenas_repeat_earlier_lessons() {
        let plan = plan(LESSONS, 8, 1);
        let lessons = |current| (0..8).map(|agent| plan.lesson_of(agent, current)).collect::<Vec<_>>();
        assert_eq!(lessons(0), [0; 8]);
        assert_eq!(lessons(1), [1, 1, 1, 1, 0, 0, 0, 0]);
        assert_eq!(lessons(2), [2, 2, 2, 2, 1, 1, 0, 0]);
        assert_eq!(plan.changes_of_mode(), [0, 1, 2], "the last arenas play hard, and then some of them easy again");
        let parts = plan.parts_by_mode(4..8, 2);
        assert_eq!(
            parts.iter().map(|(part, levels)| (part.clone(), levels.mode.as_str())).collect::<Vec<_>>(),
            [(4..6, "hard"), (6..8, "easy")]
        );
    }

    #[test]
    fn agents_that_share_an_arena_share_its_lesson() {
        let plan = plan(LESSONS, 6, 2);
        let lessons: Vec<_> = (0..6).map(|agent| plan.lesson_of(agent, 1)).collect();
        assert_eq!(lessons, [1, 1, 0, 0, 0, 0], "half of three arenas, rounded up");
        let alone = plan_of_one();
        assert_eq!(alone.lesson_of(0, 1), 1, "a single arena repeats nothing");
    }

    fn plan_of_one() -> LevelPlan {
        plan(LESSONS, 1, 1)
    }

    #[test]
    fn scores_are_those_of_the_current_lesson_and_go_on_from_a_checkpoint() {
        let changes = format!("{LESSONS}, levels: (order: Plr())");
        let mut plan = plan(&changes, 2, 1);
        let note = |plan: &mut LevelPlan| {
            let sizes = [1.0, 2.0, 3.0, 4.0].map(Some);
            plan.note(&[ended(0, 1, 3, true)], &sizes, &[false, false, true, false])
        };
        note(&mut plan);
        assert!(matches!(&plan.queues()[1], LevelQueue::Weighted(_)));
        let scalars = plan.scalars();
        assert!(
            scalars.contains(&("levels/played", 1.0)) && scalars.contains(&("levels/score_mean", 2.0)),
            "{scalars:?}"
        );
        let text = serde_json::to_string(&plan.state()).expect("a text");
        let mut restored = plan_with(&changes).restored(serde_json::from_str(&text).expect("the same"));
        assert_eq!(restored.state(), plan.state());
        for plan in [&mut plan, &mut restored] {
            (0..2).for_each(|_| assert!(!note(plan)));
            assert!(note(plan), "four of four");
        }
        assert_eq!(restored.state(), plan.state());
        assert!(plan.scalars().contains(&("levels/played", 0.0)), "another lesson has other levels");
        let queues = plan.queues();
        assert!(matches!(
            (&queues[0], &queues[1]),
            (LevelQueue::Weighted(_), LevelQueue::Uniform { first: 0, last: 4 })
        ));
    }

    fn plan_with(changes: &str) -> LevelPlan {
        plan(changes, 2, 1)
    }
}
