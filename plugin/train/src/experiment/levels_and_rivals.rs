//! Settings of what a training plays: levels, which are earlier lessons and their order, and rivals, with their checks.

use crate::{
    Algorithm, LearnerKind,
    experiment::{
        Experiment,
        checks::{ExperimentError, refuse},
    },
};
use playbot_harness::{
    game::Game,
    held_out::{HeldOut, seen_by_training},
    rivals::{check_rivals, scripted_rival},
    split::LevelSplit,
};
use playbot_learner::{SeenLevels, settings, settings::Range};
use serde::{Deserialize, Serialize};

// The levels.

/// Most levels of a training by [`LevelOrder::Plr`]: a score is kept of each.
pub const MOST_SCORED: u64 = 1 << 16;

/// Most lessons of a curriculum.
const MOST_LESSONS: usize = 64;

settings! {
    /// Lessons that come before the training levels. The training begins with the first one, and goes on to the next
    /// once most of its episodes succeed. After the last one come the levels of `train`.
    #[derive(Clone, Debug, PartialEq)]
    pub struct CurriculumConfig in "curriculum", read by &[];

    /// The lessons before `train`, in order: ranges of levels, also of other modes and of level files. Each may have a
    /// `success` of its own.
    lessons: Vec<CurriculumLesson> = Vec::new(), such as "[(levels: \"easy:0..63\", success: 0.8)]";
    /// Success rate at which a lesson is learned, for lessons without one of their own.
    success: f64 = 0.8, in Range::Within(0.01, 1.0);
    /// Last episodes of a lesson over which its success rate is taken. A lesson lasts for at least as many.
    window: usize = 100, in Range::Count(100_000);
    /// Share of the arenas that goes on with the lessons before the current one, so that they are not forgotten.
    mix: f64 = 0.0, in Range::Below(0.0, 1.0);
}

settings! {
    /// The choice among the levels of a lesson, or of `train`.
    #[derive(Clone, Debug, PartialEq)]
    pub struct LevelsConfig in "levels", read by &[];

    /// `Uniform`: each level is as likely as any other. `Plr(…)`: prioritised level replay, for PPO. A level is played
    /// again the sooner, the larger the critic's errors were on it. The guide to lessons explains its values.
    order: LevelOrder = LevelOrder::Uniform, such as "Plr(temperature: 0.1, staleness: 0.1, new: 0.5)";
}

/// One lesson of a curriculum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurriculumLesson {
    /// Its levels.
    pub levels: LevelSplit,
    /// Success rate at which it is learned; `curriculum.success` if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub success: Option<f64>,
}

/// The order in which levels are played.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum LevelOrder {
    /// Each level is as likely as any other.
    #[default]
    Uniform,
    /// Prioritised level replay (Jiang, Grefenstette and Rocktäschel 2021, "Prioritized Level Replay"), with scores by
    /// the mean size of the advantages of an episode, and priorities by rank.
    Plr {
        /// β, above 0: the weight of the level with the n-th highest score is (1/n)^(1/β). Lower ones prefer high
        /// scores more.
        #[serde(default = "tenth")]
        temperature: f64,
        /// ρ, 0 to 1: the share of levels that are drawn by the time since they were last played, instead of by their
        /// scores.
        #[serde(default = "tenth")]
        staleness: f64,
        /// Probability, 0 to 1, that the next level is one that was not played yet, while there are any.
        #[serde(default = "half")]
        new: f64,
    },
}

fn tenth() -> f64 {
    0.1
}

fn half() -> f64 {
    0.5
}

impl Experiment {
    /// Returns all lessons of the training with the success rate at which each is learned, the levels of `train` last.
    /// Those are never left.
    pub fn lessons(&self) -> Vec<(LevelSplit, Option<f64>)> {
        let CurriculumConfig { lessons, success, .. } = &self.curriculum;
        let before = lessons.iter().map(|lesson| (lesson.levels.clone(), Some(lesson.success.unwrap_or(*success))));
        before.chain([(self.train.clone(), None)]).collect()
    }

    /// Returns the levels that the training shows: those of all lessons.
    pub fn seen_by_training(&self, game: &dyn Game) -> SeenLevels {
        let mut seen = seen_by_training(game, &self.train);
        for lesson in &self.curriculum.lessons {
            seen.extend(&seen_by_training(game, &lesson.levels));
        }
        seen
    }

    /// Checks the settings of lessons and of their order.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub(crate) fn check_lessons(&self) -> Result<(), ExperimentError> {
        let CurriculumConfig { lessons, .. } = &self.curriculum;
        if lessons.is_empty() && self.curriculum != CurriculumConfig::default() {
            let why = "a curriculum has at least one lesson before `train`: name its levels, as in \
                       [(levels: \"easy:0..63\")], or leave the other keys of `curriculum` out";
            return refuse("curriculum.lessons", "[]", why);
        }
        if lessons.len() > MOST_LESSONS {
            let why = format!("a curriculum has at most {MOST_LESSONS} lessons");
            return refuse("curriculum.lessons", format!("a list of {}", lessons.len()), why);
        }
        for lesson in lessons {
            if lesson.levels.overlaps(&self.test) {
                let why = format!(
                    "it overlaps the held-out levels {}, which must not be trained on: choose ranges that share no level",
                    self.test
                );
                return refuse("curriculum.lessons", &lesson.levels, why);
            }
            if let Some(success) = lesson.success.filter(|success| !(0.01..=1.0).contains(success)) {
                let why = format!("`success` of the lesson {} must lie in 0.01..1", lesson.levels);
                return refuse("curriculum.lessons", success, why);
            }
        }
        let all = self.lessons();
        if let Some(pair) = all.windows(2).find(|pair| pair[0].0 == pair[1].0) {
            let why = "two lessons in a row have the same levels, the last one being `train`: leave one of them out";
            return refuse("curriculum.lessons", &pair[0].0, why);
        }
        self.check_order()
    }

    /// Checks that the learner estimates advantages, if levels are ordered by them.
    fn check_order(&self) -> Result<(), ExperimentError> {
        let LevelOrder::Plr { temperature, staleness, new } = self.levels.order else { return Ok(()) };
        let written = ron::to_string(&self.levels.order).unwrap_or_default();
        if !(temperature > 0.0 && temperature <= 1e6) {
            return refuse("levels.order", written, "`temperature` must be above 0 and at most 1e6");
        }
        for (name, share) in [("staleness", staleness), ("new", new)] {
            if !(0.0..=1.0).contains(&share) {
                return refuse("levels.order", written, format!("`{name}` must lie in 0..1"));
            }
        }
        let by_ppo = self.algorithm.learner() == LearnerKind::Ppo && self.algorithm.is_trained();
        if !by_ppo {
            let names = [Algorithm::ScorePpo, Algorithm::Ppo, Algorithm::SpirlPpo].map(Algorithm::name).join(", ");
            let why = format!(
                "{} estimates no advantages, by which levels are scored: take one of {names}, or set `levels.order` to Uniform",
                self.algorithm
            );
            return refuse("levels.order", written, why);
        }
        let largest = self.lessons().into_iter().map(|(levels, _)| levels).max_by_key(LevelSplit::len);
        match largest.filter(|levels| levels.len() > MOST_SCORED) {
            Some(levels) => {
                let why = format!(
                    "a score is kept of each level, and {levels} are {} of them: name at most {MOST_SCORED}, or set \
                     `levels.order` to Uniform",
                    levels.len()
                );
                refuse("levels.order", written, why)
            }
            None => Ok(()),
        }
    }

    /// Checks that the game has the levels of the lessons before `train`, and that no one of them is held out.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the levels.
    pub(crate) fn check_lesson_levels(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        let held_out = HeldOut::new(game, &self.test);
        for CurriculumLesson { levels, .. } in &self.curriculum.lessons {
            levels.check(game).map_err(|source| ExperimentError::Lesson {
                levels: Box::new(levels.clone()),
                source: Box::new(source),
            })?;
            if let Some(level) = held_out.first_of(levels) {
                let why = format!("its level {level} is one of the held-out levels {}: choose other levels", self.test);
                return refuse("curriculum.lessons", levels, why);
            }
            if held_out.are_all_in(levels) {
                let why = format!("each of the held-out levels {} has the layout of one of its levels", self.test);
                return refuse("curriculum.lessons", levels, why);
            }
        }
        Ok(())
    }
}

// The rivals: snapshots of the own policy and scripted bots.

/// Most snapshots of a training: each is rated against the others.
const MOST_SNAPSHOTS: u64 = 200;

settings! {
    /// A training against rivals, in a game whose agents share an arena. One agent of each arena learns, on each seat
    /// equally often. The others are rivals: snapshots of the policy, and bots of the game. Without `every` all agents
    /// of an arena learn, each of them against the others as they are.
    #[derive(Clone, Debug, PartialEq)]
    pub struct SelfPlayConfig in "self_play", read by &[];

    /// Environment steps after which a snapshot of the policy joins the rivals, as the newest of them; the first one
    /// does at the start, and the last one at the end. `None` is no training against rivals.
    every: Option<u64> = None, in Range::COUNT, such as "Some(200000)";
    /// Newest snapshots that stay rivals. With 0 the bots alone are rivals, and snapshots are rated only.
    pool: u64 = 10, in Range::Weight(1000.0);
    /// Probability that the rival of an episode is the newest snapshot. It is any other time one of all rivals, each as
    /// likely as another.
    latest: f64 = 0.5, in Range::SHARE;
    /// Bots of the game that are rivals too, by their names.
    rivals: Vec<String> = Vec::new(), such as "[\"follower\"]";
    /// Bots that snapshots are rated against, without being rivals of episodes that are learned from. The rating of the
    /// first of all bots is 1000.
    rated: Vec<String> = Vec::new(), such as "[\"follower\"]";
    /// Held-out levels, of the first of `test`, on which a new snapshot plays each earlier rival once on each seat, to
    /// rate it. 0 rates nothing.
    matches: u64 = 4, in Range::Weight(10000.0);
}

impl SelfPlayConfig {
    /// Returns the names of all bots on the ladder: rivals first.
    pub(crate) fn bots(&self) -> impl Iterator<Item = &String> {
        self.rivals.iter().chain(&self.rated)
    }
}

impl Experiment {
    /// Checks the settings of a training against rivals.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub(crate) fn check_self_play(&self) -> Result<(), ExperimentError> {
        let SelfPlayConfig { every, pool, rivals, .. } = &self.self_play;
        let Some(every) = *every else {
            if self.self_play != SelfPlayConfig::default() {
                let why = "the other keys of `self_play` have no effect without it: say after how many steps a snapshot \
                           of the policy joins the rivals, or leave them out";
                return refuse("self_play.every", "None", why);
            }
            return Ok(());
        };
        if !self.algorithm.is_trained() {
            let why = format!(
                "{} cannot be trained against rivals, as it plays no game to learn: take another algorithm, or leave `self_play` out",
                self.algorithm
            );
            return refuse("self_play.every", every, why);
        }
        if self.observation_config().is_image() {
            let why = "rivals see vectors, not pictures: set `observation` to Vector, or leave `self_play` out";
            return refuse("self_play.every", every, why);
        }
        if self.steps / every > MOST_SNAPSHOTS {
            let why = format!(
                "a training of {} steps has more than {MOST_SNAPSHOTS} snapshots then: take {} or more",
                self.steps,
                self.steps.div_ceil(MOST_SNAPSHOTS)
            );
            return refuse("self_play.every", every, why);
        }
        if *pool == 0 && rivals.is_empty() {
            let why = "without snapshots there is no rival: name a bot in `self_play.rivals`, or let snapshots stay";
            return refuse("self_play.pool", pool, why);
        }
        let bots: Vec<&String> = self.self_play.bots().collect();
        match bots.iter().enumerate().find(|(place, name)| bots[..*place].contains(name)) {
            Some((place, name)) => {
                let key = if place < rivals.len() { "self_play.rivals" } else { "self_play.rated" };
                refuse(key, name, "it is named twice: a rival is rated, too")
            }
            None => Ok(()),
        }
    }

    /// Checks that the game has seats for rivals, and these bots.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub(crate) fn check_rivals_of(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        let Some(every) = self.self_play.every else { return Ok(()) };
        let SelfPlayConfig { rivals, rated, .. } = &self.self_play;
        for (key, names) in [("self_play.rivals", rivals), ("self_play.rated", rated)] {
            for name in names {
                if let Err(unknown) = scripted_rival(game, name) {
                    return refuse(key, name, unknown.to_string());
                }
            }
        }
        check_rivals(game, &self.train.mode).or_else(|error| refuse("self_play.every", every, error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use crate::experiment::file::parse_experiment;
    use bevy::prelude::{App, KeyCode};
    use playbot_harness::foreign::ForeignGame;
    use std::path::Path;

    fn check(changes: &str) -> Result<(), String> {
        let text = format!(
            r#"(game: "g", train: "hard:0..99", test: "hard:100..199", algorithm: "ppo", steps: 1000, {changes})"#
        );
        let experiment = parse_experiment(&text, Path::new("x.ron")).map_err(|error| error.to_string())?;
        experiment.check().map_err(|error| error.to_string())
    }

    #[test]
    fn lessons_come_before_the_training_levels_each_with_its_success() {
        let text = r#"(game: "g", train: "hard:0..9", test: "hard:10..19", algorithm: "ppo", steps: 1000,
            curriculum: (lessons: [(levels: "easy:0..9", success: 0.5), (levels: "easy:10..19")], success: 0.9))"#;
        let experiment = parse_experiment(text, Path::new("x.ron")).expect("valid");
        assert_eq!(experiment.check(), Ok(()));
        let lessons: Vec<_> =
            experiment.lessons().into_iter().map(|(levels, success)| (levels.to_string(), success)).collect();
        let expected = [("easy:0..9", Some(0.5)), ("easy:10..19", Some(0.9)), ("hard:0..9", None)];
        assert_eq!(lessons, expected.map(|(levels, success)| (levels.to_owned(), success)));
        let again = parse_experiment(&experiment.to_ron().expect("text"), Path::new("y.ron")).expect("it reads back");
        assert_eq!(again, experiment);
    }

    #[test]
    fn an_experiment_without_lessons_is_written_as_before() {
        let text = r#"(game: "g", train: "hard:0..9", test: "hard:10..19", algorithm: "ppo", steps: 1000)"#;
        let written = parse_experiment(text, Path::new("x.ron")).expect("valid").to_ron().expect("text");
        assert!(!written.contains("curriculum") && !written.contains("levels:"), "{written}");
    }

    #[test]
    fn wrong_lessons_are_refused_with_what_to_do() {
        for (changes, words) in [
            ("curriculum: (success: 0.9)", "`curriculum.lessons` is []: a curriculum has at least one lesson"),
            (r#"curriculum: (lessons: [(levels: "hard:50..100")])"#, "overlaps the held-out levels hard:100..199"),
            (r#"curriculum: (lessons: [(levels: "hard:0..99")])"#, "two lessons in a row have the same levels"),
            (r#"curriculum: (lessons: [(levels: "easy:0..9", success: 2.0)])"#, "must lie in 0.01..1"),
            (r#"curriculum: (lessons: [(levels: "easy:9..0")])"#, "first level 9 is after last level 0"),
            (r#"curriculum: (lessons: [(levels: "easy:0..9")], mix: 1.0)"#, "`curriculum.mix` is 1"),
            (r#"curriculum: (lessons: [(levels: "easy:0..9")], window: 0)"#, "`curriculum.window` is 0"),
            (r#"curriculum: (lessons: [(levels: "files:no/such/*.json")])"#, "matches no file"),
        ] {
            let error = check(changes).expect_err(changes);
            assert!(error.contains(words), "{changes}: {error}");
        }
        assert_eq!(check(r#"curriculum: (lessons: [(levels: "easy:0..199")], mix: 0.25)"#), Ok(()));
    }

    #[test]
    fn orders_by_scores_need_a_learner_with_advantages_and_a_bounded_range() {
        assert_eq!(check("levels: (order: Plr())"), Ok(()));
        assert_eq!(check(r#"levels: (order: Plr(temperature: 1.0, staleness: 0.0, new: 1.0))"#), Ok(()));
        for (changes, words) in [
            ("levels: (order: Plr(temperature: 0.0))", "`temperature` must be above 0"),
            ("levels: (order: Plr(staleness: 1.5))", "`staleness` must lie in 0..1"),
            ("levels: (order: Plr(new: -0.1))", "`new` must lie in 0..1"),
            (r#"levels: (order: Plr()), curriculum: (lessons: [(levels: "easy:0..65536")])"#, "at most 65536"),
        ] {
            let error = check(changes).expect_err(changes);
            assert!(error.starts_with("`levels.order` is Plr(") && error.contains(words), "{changes}: {error}");
        }
        let text = r#"(game: "g", train: "a:0..9", test: "a:10..19", algorithm: "sac", steps: 1000,
            levels: (order: Plr()))"#;
        let sac = parse_experiment(text, Path::new("x.ron")).expect("valid").check().expect_err("no advantages");
        assert!(sac.to_string().contains("take one of score-ppo, ppo, spirl-ppo"), "{sac}");
    }

    fn parse(changes: &str) -> crate::Experiment {
        let text = format!(
            r#"(game: "g", train: "default:0..9", test: "default:10..19", steps: 10000, arenas: 4, worlds: 2,
                ppo: (num_steps: 64, minibatches: 4), {changes})"#
        );
        parse_experiment(&text, Path::new("x.ron")).expect("readable")
    }

    fn checked(changes: &str) -> Result<(), String> {
        parse(changes).check().map_err(|error| error.to_string())
    }

    #[test]
    fn settings_without_effect_and_impossible_ones_are_refused_with_what_to_do() {
        assert_eq!(checked(r#"algorithm: "ppo", self_play: (every: Some(1000), rivals: ["chaos"])"#), Ok(()));
        for (changes, words) in [
            (r#"algorithm: "ppo", self_play: (pool: 3)"#, "`self_play.every` is None: the other keys"),
            (r#"algorithm: "bc", demos: "d", self_play: (every: Some(1000))"#, "bc cannot be trained"),
            (r#"algorithm: "ppo", observation: Raster, self_play: (every: Some(1000))"#, "rivals see vectors"),
            (r#"algorithm: "ppo", self_play: (every: Some(9))"#, "more than 200 snapshots then: take 50 or more"),
            (
                r#"algorithm: "ppo", self_play: (every: Some(1000), pool: 0)"#,
                "`self_play.pool` is 0: without snapshots",
            ),
            (r#"algorithm: "ppo", self_play: (every: Some(0))"#, "`self_play.every` is 0"),
            (r#"algorithm: "ppo", self_play: (every: Some(1000), latest: 1.5)"#, "`self_play.latest` is 1.5"),
            (r#"algorithm: "ppo", self_play: (every: Some(1000), rivals: ["a", "a"])"#, "it is named twice"),
            (
                r#"algorithm: "ppo", self_play: (every: Some(1000), rivals: ["a"], rated: ["a"])"#,
                "`self_play.rated` is a",
            ),
        ] {
            let error = checked(changes).expect_err(changes);
            assert!(error.contains(words), "{changes}: {error}");
        }
    }

    #[test]
    fn an_experiment_without_rivals_is_written_as_before() {
        let written = parse(r#"algorithm: "ppo""#).to_ron().expect("text");
        assert!(!written.contains("self_play"), "{written}");
    }

    fn of_game(game: ForeignGame, changes: &str) -> String {
        let experiment = parse(&format!(r#"algorithm: "ppo", self_play: (every: Some(1000), {changes})"#));
        experiment.check_game(&game.observe(["x"], || [0.0])).expect_err("it does not fit").to_string()
    }

    #[test]
    fn a_game_of_one_agent_and_an_unknown_rival_are_refused_with_what_there_is() {
        let alone = || ForeignGame::new("g", 1, |_: &mut App| {}).keys([vec![], vec![KeyCode::KeyA]]);
        let text = of_game(alone(), "");
        assert!(text.contains("a World of `g` has one agent") && text.contains("with `.agents`"), "{text}");
        let two = alone().agents(["a", "b"]).keys_of("b", [vec![], vec![KeyCode::KeyB]]).demonstrator("follower", || 0);
        let text = of_game(two, r#"rivals: ["folower"]"#);
        assert!(text.contains("`self_play.rivals` is folower") && text.contains("follower"), "{text}");
    }
}
