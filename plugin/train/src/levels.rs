//! The levels that the arenas of a training play next: lessons by success, and prioritised level replay.
//!
//! A [`LevelPlan`] gives each arena the queue of its levels. Between two rollouts it notes which episodes have ended, in an
//! order that does not depend on the number of threads, and decides whether a lesson is learned. All that it decides from
//! is in its [`LevelState`], which a checkpoint keeps.
//!
//! # Prioritised level replay
//!
//! Jiang, Grefenstette and Rocktäschel 2021, "Prioritized Level Replay". The score of a level is the mean size of the
//! advantages of its last episode. Its probability is a mixture of its rank by that score and of its staleness:
//!
//! P = (1 − ρ) P_S + ρ P_C, with P_S ∝ (1 / rank)^(1/β) and P_C ∝ c − C.
//!
//! c counts the episodes that have ended, and C is c when the level's last one had ended. Scores and counts change
//! between rollouts only. Within a rollout each arena draws from the same probabilities with its own random stream, so
//! the draws do not depend on the number of threads.

use crate::{
    experiment::{Experiment, LevelOrder},
    metrics_log::{LESSON, LESSON_SUCCESS},
};
use bevy_playbot::level::{LevelQueue, WeightedLevels};
use playbot_harness::split::LevelSplit;
use serde::{Deserialize, Serialize};
use std::{
    collections::{BTreeMap, VecDeque},
    ops::Range,
    sync::Arc,
};

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

// The scores of levels, and their probabilities.

/// Settings of the replay: β, ρ and the probability of a new level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlrSettings {
    /// β, above 0.
    pub temperature: f64,
    /// ρ, 0 to 1.
    pub staleness: f64,
    /// Probability of a level that was not played yet, while there are any.
    pub new: f64,
}

/// What is known of a played level.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct LevelScore {
    level: u64,
    /// Mean size of the advantages of its last episode.
    score: f64,
    /// The count of ended episodes when its last one had ended.
    played: u64,
}

/// The played levels of a lesson, with their scores.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct LevelScores {
    /// Episodes that have ended.
    episodes: u64,
    /// Played levels, ascending.
    levels: Vec<LevelScore>,
}

impl LevelScores {
    /// Notes an episode that has ended, with the mean size of its advantages. Without any, the level keeps its score.
    fn note(&mut self, level: u64, mean: Option<f64>) {
        self.episodes += 1;
        let played = self.episodes;
        match self.levels.binary_search_by_key(&level, |known| known.level) {
            Ok(at) => {
                let known = &mut self.levels[at];
                (known.score, known.played) = (mean.unwrap_or(known.score), played);
            }
            Err(at) => self.levels.insert(at, LevelScore { level, score: mean.unwrap_or(0.0), played }),
        }
    }

    /// Returns the probabilities of the played levels, in their order, which add up to 1.
    fn probabilities(&self, settings: PlrSettings) -> Vec<f64> {
        let count = self.levels.len();
        let mut by_score: Vec<usize> = (0..count).collect();
        // Equal scores keep the order of their levels.
        by_score.sort_by(|a, b| self.levels[*b].score.total_cmp(&self.levels[*a].score));
        let mut of_ranks = vec![0.0; count];
        for (rank, level) in by_score.into_iter().enumerate() {
            of_ranks[level] = libm::pow(1.0 / (rank + 1) as f64, 1.0 / settings.temperature);
        }
        let mut of_ages: Vec<f64> = self.levels.iter().map(|known| (self.episodes - known.played) as f64).collect();
        if of_ages.iter().all(|age| *age == 0.0) {
            of_ages.fill(1.0);
        }
        let (ranks, ages): (f64, f64) = (of_ranks.iter().sum(), of_ages.iter().sum());
        let mix = |(rank, age): (f64, f64)| (1.0 - settings.staleness) * rank / ranks + settings.staleness * age / ages;
        of_ranks.into_iter().zip(of_ages).map(mix).collect()
    }

    /// Returns the queue of the next rollout.
    fn queue(&self, lesson: &LevelSplit, settings: PlrSettings) -> WeightedLevels {
        let levels = self.levels.iter().map(|known| known.level);
        let weights = levels.zip(self.probabilities(settings));
        WeightedLevels::new(lesson.first, lesson.last, weights, settings.new)
    }

    /// Returns the metrics: levels that were played, their scores, and the number of equally likely levels whose
    /// entropy is that of the probabilities.
    fn scalars(&self, settings: PlrSettings) -> Vec<(&'static str, f64)> {
        let mut scalars = vec![("levels/played", self.levels.len() as f64)];
        if self.levels.is_empty() {
            return scalars;
        }
        let scores = || self.levels.iter().map(|known| known.score);
        let entropy: f64 = self.probabilities(settings).iter().filter(|p| **p > 0.0).map(|p| -p * libm::log(*p)).sum();
        scalars.push(("levels/score_mean", scores().sum::<f64>() / self.levels.len() as f64));
        scalars.push(("levels/score_max", scores().fold(0.0, f64::max)));
        scalars.push(("levels/effective", libm::exp(entropy)));
        scalars
    }
}

/// The advantages of the episodes that still run, by arena.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
struct RunningMeans(Vec<RunningMean>);

/// A mean that is not complete.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
struct RunningMean {
    sum: f64,
    count: u64,
}

/// An agent and a tick of a rollout, in which an episode has ended, with the mean size of its advantages. There is no mean
/// if no advantage was estimated in the episode.
type MeansOfEnds = BTreeMap<(usize, usize), Option<f64>>;

impl RunningMeans {
    /// Adds the advantages of a rollout, `[ticks, agents]`, and returns the means of the episodes that ended in it, by
    /// agent and tick. Parts of an episode in earlier rollouts count as they were estimated then.
    fn add(&mut self, sizes: &[Option<f32>], ends: &[bool], agents: usize) -> MeansOfEnds {
        self.0.resize(agents, RunningMean::default());
        let mut means = MeansOfEnds::new();
        for (row, (size, is_end)) in sizes.iter().zip(ends).enumerate() {
            let (tick, agent) = (row / agents.max(1), row % agents.max(1));
            let running = &mut self.0[agent];
            if let Some(size) = size {
                running.sum += f64::from(*size);
                running.count += 1;
            }
            if *is_end {
                let mean = (running.count > 0).then(|| running.sum / running.count as f64);
                means.insert((agent, tick), mean);
                *running = RunningMean::default();
            }
        }
        means
    }

    /// Forgets the episodes that still run, for arenas that begin others.
    fn clear(&mut self) {
        self.0.clear();
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

    const SETTINGS: PlrSettings = PlrSettings { temperature: 0.5, staleness: 0.25, new: 0.5 };

    /// Four episodes on three levels: 7, 5, 9 and 7 again.
    fn scores() -> LevelScores {
        let mut scores = LevelScores::default();
        for (level, mean) in [(7, 9.0), (5, 0.5), (9, 2.0), (7, 1.0)] {
            scores.note(level, Some(mean));
        }
        scores
    }

    #[test]
    fn probabilities_are_those_worked_out_by_hand() {
        // Scores of the levels 5, 7 and 9 are 0.5, 1 and 2, so their ranks are 3, 2 and 1. With β = 1/2 their weights are
        // 1/9, 1/4 and 1, of a sum of 49/36: P_S = 4/49, 9/49, 36/49. Their last episodes were the 2nd, 4th and 3rd of 4,
        // so their ages are 2, 0 and 1: P_C = 2/3, 0, 1/3. P = 3/4 P_S + 1/4 P_C.
        let expected = [12.0 / 196.0 + 2.0 / 12.0, 27.0 / 196.0, 108.0 / 196.0 + 1.0 / 12.0];
        let found = scores().probabilities(SETTINGS);
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-15, "{found} is not {expected}");
        }
        assert!((found.iter().sum::<f64>() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn scores_alone_and_ages_alone_are_the_ends_of_the_mixture() {
        let of = |staleness| scores().probabilities(PlrSettings { staleness, ..SETTINGS });
        let close = |found: Vec<f64>, expected: [f64; 3]| {
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-15)
        };
        assert!(close(of(0.0), [4.0 / 49.0, 9.0 / 49.0, 36.0 / 49.0]));
        assert!(close(of(1.0), [2.0 / 3.0, 0.0, 1.0 / 3.0]));
        let mut one = LevelScores::default();
        one.note(3, Some(0.0));
        assert_eq!(one.probabilities(PlrSettings { staleness: 1.0, ..SETTINGS }), [1.0], "it is not stale");
    }

    #[test]
    fn a_low_temperature_prefers_the_highest_score() {
        let cold = scores().probabilities(PlrSettings { temperature: 0.01, staleness: 0.0, new: 0.0 });
        assert!(cold[2] > 0.999_999, "{cold:?}");
        let hot = scores().probabilities(PlrSettings { temperature: 1e6, staleness: 0.0, new: 0.0 });
        assert!(hot.iter().all(|p| (p - 1.0 / 3.0).abs() < 1e-5), "{hot:?}");
    }

    #[test]
    fn equal_scores_rank_in_the_order_of_their_levels() {
        let mut scores = LevelScores::default();
        for level in [4, 2] {
            scores.note(level, Some(1.0));
        }
        // Ranks 1 and 2, with weights 1 and 1/4.
        assert_eq!(scores.probabilities(PlrSettings { staleness: 0.0, ..SETTINGS }), [0.8, 0.2]);
    }

    #[test]
    fn metrics_say_how_many_levels_are_in_play() {
        let scores = scores();
        let scalars: BTreeMap<_, _> = scores.scalars(PlrSettings { staleness: 0.0, ..SETTINGS }).into_iter().collect();
        // Entropy of 4/49, 9/49 and 36/49 in nats.
        let entropy = [4.0, 9.0, 36.0].map(|n: f64| -(n / 49.0) * libm::log(n / 49.0)).iter().sum::<f64>();
        assert_eq!((scalars["levels/played"], scalars["levels/score_max"]), (3.0, 2.0));
        assert!((scalars["levels/score_mean"] - 3.5 / 3.0).abs() < 1e-15);
        assert!((scalars["levels/effective"] - libm::exp(entropy)).abs() < 1e-12);
        assert_eq!(LevelScores::default().scalars(SETTINGS), [("levels/played", 0.0)]);
    }

    #[test]
    fn means_are_those_of_whole_episodes_over_rollouts() {
        // Two agents. The first ends after two ticks, and again in the next rollout; the second not before that.
        let mut running = RunningMeans::default();
        let sizes = |values: [f32; 6]| values.map(Some);
        let ends = [false, false, true, false, false, false];
        let means = running.add(&sizes([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), &ends, 2);
        assert_eq!(means, MeansOfEnds::from([((0, 1), Some(2.0))]));
        let ends = [true, false, false, true, false, false];
        let means = running.add(&sizes([7.0, 8.0, 0.0, 10.0, 0.0, 0.0]), &ends, 2);
        assert_eq!(means, MeansOfEnds::from([((0, 0), Some(6.0)), ((1, 1), Some(6.0))]));
    }

    #[test]
    fn rows_without_a_decision_do_not_count() {
        let mut running = RunningMeans::default();
        let means = running.add(&[Some(4.0), None, None, Some(2.0)], &[false, true, true, true], 1);
        assert_eq!(means, MeansOfEnds::from([((0, 1), Some(4.0)), ((0, 2), None), ((0, 3), Some(2.0))]));
        let mut scores = scores();
        scores.note(5, None);
        scores.note(6, None);
        let kept: Vec<_> = scores.levels.iter().map(|known| (known.level, known.score, known.played)).collect();
        assert_eq!(kept, [(5, 0.5, 5), (6, 0.0, 6), (7, 1.0, 4), (9, 2.0, 3)]);
    }
}
