//! Settings of a training against rivals: snapshots of its own policy and scripted bots, with their checks.

use crate::experiment::{
    Experiment,
    checks::{ExperimentError, refuse},
};
use playbot_harness::{
    game::Game,
    rivals::{check_rivals, scripted_rival},
};
use playbot_learner::{settings, settings::Range};

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

    fn parse(changes: &str) -> crate::Experiment {
        let text = format!(
            r#"(game: "g", train: "default:0..9", test: "default:10..19", steps: 10000, arenas: 4, worlds: 2,
                ppo: (num_steps: 64, minibatches: 4), {changes})"#
        );
        parse_experiment(&text, Path::new("x.ron")).expect("readable")
    }

    fn check(changes: &str) -> Result<(), String> {
        parse(changes).check().map_err(|error| error.to_string())
    }

    #[test]
    fn settings_without_effect_and_impossible_ones_are_refused_with_what_to_do() {
        assert_eq!(check(r#"algorithm: "ppo", self_play: (every: Some(1000), rivals: ["chaos"])"#), Ok(()));
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
            let error = check(changes).expect_err(changes);
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
