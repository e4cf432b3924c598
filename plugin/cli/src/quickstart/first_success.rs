//! Steps to success of each method, over several seeds.

use playbot_lab::{
    game::Game,
    report::{statistics::median, whole},
    train::{
        Algorithm, Experiment,
        learn_skills::learn,
        train_run::{Reached, TrainingSetup, train_to_success},
    },
};
use playbot_learner::Dataset;

use crate::{console::Console, error::CliError};

/// The steps until a method's success rate in training first reached the experiment's threshold.
pub(super) struct FirstSuccess {
    pub(super) algorithm: Algorithm,
    /// The steps of each seed, `None` where the threshold was not reached.
    pub(super) steps: Vec<Option<u64>>,
}

impl FirstSuccess {
    /// Returns the median over the seeds. A seed that never succeeds counts as the largest.
    fn median(&self) -> Option<u64> {
        let steps = self.steps.iter().map(|steps| steps.map_or(f64::INFINITY, |steps| steps as f64));
        median(steps.collect()).filter(|steps| steps.is_finite()).map(|steps| steps as u64)
    }
}

/// Trains `algorithms` with another seed, its own skills included, until each mostly succeeds. Only the number of steps
/// is kept. `None` after Ctrl-C.
///
/// # Errors
///
/// A loss is not a number, or the game broke its contract.
pub(super) fn steps_of_seed(
    game: &dyn Game,
    experiment: &Experiment,
    algorithms: &[Algorithm],
    dataset: &Dataset,
    setup: &TrainingSetup<'_>,
) -> Result<Option<Vec<Option<u64>>>, CliError> {
    let learned = learn(experiment, dataset.clone(), setup.device, None, &mut Console::default())?;
    let Some(skills) = learned else { return Ok(None) };
    let mut all = Vec::new();
    for &algorithm in algorithms {
        let experiment = Experiment { algorithm, ..experiment.clone() };
        let mut console = Console::new(format!("train {algorithm}, seed {}", experiment.seed));
        let skills = algorithm.needs_skills().then_some(&skills);
        match train_to_success(game, &experiment, skills, setup, &mut console)? {
            Reached::After(steps) => all.push(Some(steps)),
            Reached::Never => all.push(None),
            Reached::Stopped => return Ok(None),
        }
    }
    Ok(Some(all))
}

/// Describes the median of each method, and its seeds.
pub(super) fn headline(methods: &[FirstSuccess], seeds: &[u64], threshold: f64) -> String {
    let words = |steps: Option<u64>| steps.map_or("not reached".to_owned(), |steps| whole(steps as f64));
    let each = methods.iter().map(|method| format!("{} {}", method.algorithm, words(method.median())));
    let headline =
        format!("steps to {:.0} % success in training: {}", 100.0 * threshold, each.collect::<Vec<_>>().join(", "));
    if seeds.len() < 2 {
        return headline;
    }
    let by_seed = methods.iter().map(|FirstSuccess { algorithm, steps }| {
        format!("{algorithm} {}", steps.iter().map(|steps| words(*steps)).collect::<Vec<_>>().join(" and "))
    });
    let seeds = seeds.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    format!("{headline} (the medians of seeds {seeds}: {})", by_seed.collect::<Vec<_>>().join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_headline_has_medians_and_every_seed() {
        let method = |algorithm, steps: &[u64]| FirstSuccess {
            algorithm,
            steps: steps.iter().map(|&steps| (steps > 0).then_some(steps)).collect(),
        };
        let one = [method(Algorithm::ScorePpo, &[16_384]), method(Algorithm::Ppo, &[0])];
        assert_eq!(headline(&one, &[7], 0.8), "steps to 80 % success in training: score-ppo 16,384, ppo not reached");
        let three = [method(Algorithm::ScorePpo, &[16_384, 8_192, 24_576]), method(Algorithm::Ppo, &[278_528, 0, 0])];
        assert_eq!(
            headline(&three, &[1, 2, 3], 0.8),
            "steps to 80 % success in training: score-ppo 16,384, ppo not reached (the medians of seeds 1, 2, 3: score-ppo \
             16,384 and 8,192 and 24,576; ppo 278,528 and not reached and not reached)"
        );
    }
}
