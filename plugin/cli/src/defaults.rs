//! Default mode and levels of every verb: those that `train` uses without options. The default mode of a game is that
//! of the training levels of its experiment. The default held-out levels are the experiment's.

use std::path::Path;

use playbot_lab::{
    game::Game,
    split::LevelSplit,
    train::{Experiment, config_file::parse_experiment, default_experiment::experiment_of},
};

/// The default experiment of a game.
pub struct UsualExperiment {
    /// Its origin, in words or as a path.
    pub origin: String,
    /// All its values.
    pub experiment: Experiment,
}

/// Returns the default experiment of a game; `None` if the game brings one that cannot be read.
pub fn usual_experiment(game: &dyn Game) -> Option<UsualExperiment> {
    let text = experiment_of(game);
    let experiment = parse_experiment(&text.text, Path::new(&*text.origin)).ok()?;
    Some(UsualExperiment { origin: text.origin.into_owned(), experiment })
}

/// Returns the default mode of every verb: the one of the training levels, without its options.
pub fn usual_mode(game: &dyn Game) -> &'static str {
    let modes = game.modes();
    let trained = usual_experiment(game).map(|usual| usual.experiment.train.mode).unwrap_or_default();
    let name = trained.split('+').next().unwrap_or_default();
    let known = |wanted: &str| modes.iter().copied().find(|mode| *mode == wanted);
    known(&trained).or_else(|| known(name)).or(modes.first().copied()).unwrap_or_default()
}

/// Returns the default held-out levels; `None` if the game brings none that it has.
pub fn usual_held_out(game: &dyn Game) -> Option<LevelSplit> {
    let test = usual_experiment(game)?.experiment.test;
    game.check_mode(&test.mode).is_ok().then_some(test)
}

/// Returns levels 0 to `last` of the [`usual_mode`].
pub fn first_levels(game: &dyn Game, last: u64) -> LevelSplit {
    LevelSplit { mode: usual_mode(game).to_owned(), first: 0, last }
}

#[cfg(test)]
mod tests {
    use playbot_lab::foreign::ForeignGame;

    use super::*;

    #[test]
    fn a_game_without_an_experiment_has_its_first_mode_and_other_levels_held_out() {
        let game = ForeignGame::new("runner", 1, |_: &mut bevy::prelude::App| {});
        let usual = usual_experiment(&game).expect("the plainest");
        assert_eq!(usual.origin, "the experiment of runner");
        assert_eq!(usual_mode(&game), game.modes()[0]);
        let held_out = usual_held_out(&game).expect("a mode of the game");
        assert_eq!(held_out, usual.experiment.test);
        assert!(!held_out.overlaps(&usual.experiment.train));
        assert_eq!(first_levels(&game, 9).to_string(), "default:0..9");
    }
}
