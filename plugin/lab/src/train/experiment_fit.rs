//! Checks that an experiment fits its game: levels, actions and observations.

use playbot_learner::{ActionSpace, Augmentation};

use super::{
    Algorithm,
    config::{Experiment, LearnerKind},
    experiment_error::{ExperimentError, refuse, settings},
};
use crate::{game::Game, held_out::HeldOut, sensors::GameSensors, split::LevelSplit};

impl Experiment {
    /// Checks the settings that depend on the game's levels, actions and observations, before hours are spent on
    /// skills.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub fn check_game(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        self.check_levels(game)?;
        self.check_agent(game)
    }

    /// Checks the settings that depend on the game's actions and observations: all that matters if no level is
    /// played.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub fn check_agent(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        self.check_actions(game.actions())?;
        self.check_observation(game)
    }

    /// Checks that the game has the modes, and that no held-out level is trained on, under any name
    /// ([`LevelTools::family`](crate::game::LevelTools::family), [`Game::fingerprint`]).
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the levels.
    pub fn check_levels(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        self.check_train(game)?;
        self.check_test(game)?;
        match HeldOut::new(game, &self.test).first_of(&self.train) {
            Some(level) => {
                let (train, test) = (Box::new(self.train.clone()), Box::new(self.test.clone()));
                Err(ExperimentError::Leak { train, level, test })
            }
            None => Ok(()),
        }
    }

    /// Checks that the game has the mode of the training levels.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Mode`].
    pub fn check_train(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        check_mode("train", &self.train, game)
    }

    /// Checks that the game has the mode of the held-out levels.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Mode`].
    pub fn check_test(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        check_mode("test", &self.test, game)
    }

    /// Checks that the observations support `skills.augment`, `ppo.augment` and `skills.state_weight`.
    fn check_observation(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        let kind = self.observation_config().obs_kind(game);
        self.check_painted_velocity()?;
        if self.algorithm.needs_skills() {
            self.skills.check_observation(kind).map_err(settings)?;
            if self.skills.tells_states() && game.observation().is_empty() {
                let why = "the game has no vector that its pictures could predict; leave it out";
                return refuse("skills.state_weight", self.skills.state_weight, why);
            }
        }
        match self.algorithm.learner() {
            LearnerKind::Ppo if self.algorithm.is_trained() => self.ppo.check_observation(&kind).map_err(settings),
            _ => Ok(()),
        }
    }

    /// Checks that augmentation leaves painted velocity alone: a changed one would be another velocity.
    fn check_painted_velocity(&self) -> Result<(), ExperimentError> {
        let config = self.observation_config();
        let Some([rows, columns]) = config.image.painted_corner().filter(|_| config.is_image()) else { return Ok(()) };
        for (key, augment) in [("skills.augment", &self.skills.augment), ("ppo.augment", &self.ppo.augment)] {
            let keeps = matches!(augment.last(), Some(Augmentation::Keep(r, c)) if *r >= rows && *c >= columns);
            if !augment.is_empty() && !keeps {
                let why = format!(
                    "would change the velocity that `image.paint_velocity` paints: end the list with Keep({rows}, {columns})"
                );
                return refuse(key, format!("{augment:?}"), why);
            }
        }
        Ok(())
    }

    /// Checks the settings that depend on the game's actions.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    fn check_actions(&self, space: ActionSpace) -> Result<(), ExperimentError> {
        self.skills.check_space(space).map_err(settings)?;
        if !(self.algorithm.needs_skills() && self.algorithm.is_trained()) {
            return Ok(());
        }
        self.score.check_space(space).map_err(settings)?;
        let squashed = match self.algorithm.learner() {
            LearnerKind::Ppo => false,
            LearnerKind::Sac => matches!(space, ActionSpace::Continuous(_)) && !self.algorithm.learns_prior(),
        };
        if squashed && self.score.init_from_decoder {
            let why = "SAC squashes continuous actions, so its policy cannot start as a copy of the decoder; set it to \
                       false (the penalty still ties the two together)";
            return refuse("score.init_from_decoder", true, why);
        }
        if self.algorithm == Algorithm::SpirlSac && !self.skills.tanh_latent {
            return refuse(
                "skills.tanh_latent",
                false,
                "SAC squashes the skills that it draws: they must lie in -1..1",
            );
        }
        Ok(())
    }
}

fn check_mode(key: &'static str, levels: &LevelSplit, game: &dyn Game) -> Result<(), ExperimentError> {
    let example = game.modes().first().copied().unwrap_or_default();
    levels.check(game).map_err(|source| ExperimentError::Mode {
        key,
        levels: Box::new(levels.clone()),
        source: Box::new(source),
        example,
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::train::config_file::parse_experiment;

    #[test]
    fn actions_are_checked_before_skills_are_learned() {
        let check = |changes: &str, space| {
            let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: 1000, demos: "d", {changes})"#);
            let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
            experiment.check_actions(space).map_err(|error| error.to_string())
        };
        for (changes, words) in [
            ("skills: (action_noise: 0.2)", "action_noise"),
            ("score: (penalty: LegacyCoinrun)", "LegacyCoinrun is for discrete actions only"),
            (r#"algorithm: "score-sac""#, "`score.init_from_decoder` is true: SAC squashes"),
        ] {
            let text = check(changes, ActionSpace::Continuous(8)).expect_err(changes);
            assert!(text.contains(words), "{text}");
            assert_eq!(check(changes, ActionSpace::Discrete(3)), Ok(()), "{changes}");
        }
        let untied = r#"algorithm: "sac", score: (penalty: LegacyCoinrun)"#;
        assert_eq!(check(untied, ActionSpace::Continuous(8)), Ok(()));
    }
}
