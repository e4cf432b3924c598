//! After how many steps each method mostly succeeds, over several seeds.

use playbot_lab::{
    game::Game,
    report::{statistics::median, whole},
    train::{Algorithm, Experiment, Trainer},
};
use playbot_learner::{Dataset, DeviceKind, SkillModel};

use super::{interrupt, learn_skills, progress};
use crate::error::CliError;

/// The steps until a method's success rate in training first was at the experiment's threshold.
pub(super) struct FirstSuccess {
    pub(super) algorithm: Algorithm,
    /// For each seed, `None` where it never was.
    pub(super) steps: Vec<Option<u64>>,
}

impl FirstSuccess {
    /// The seed in the middle. One that never got there needs more than any other.
    fn median(&self) -> Option<u64> {
        let steps = self.steps.iter().map(|steps| steps.map_or(f64::INFINITY, |steps| steps as f64));
        median(steps.collect()).filter(|steps| steps.is_finite()).map(|steps| steps as u64)
    }
}

/// Trains `algorithms` with another seed, its own skills included, until each mostly succeeds: nothing is kept but the number
/// of steps. `None` after Ctrl-C.
///
/// # Errors
///
/// A loss is not a number, or the game broke its contract.
pub(super) fn steps_of_seed(
    game: &dyn Game,
    experiment: &Experiment,
    algorithms: &[Algorithm],
    dataset: &Dataset,
    threads: usize,
) -> Result<Option<Vec<Option<u64>>>, CliError> {
    let learned = learn_skills::learn(experiment, dataset.clone(), DeviceKind::default(), None, |_, _| Ok(()))?;
    let Some(skills) = learned else { return Ok(None) };
    let mut all = Vec::new();
    for &algorithm in algorithms {
        let experiment = Experiment { algorithm, ..experiment.clone() };
        match train_to_success(game, &experiment, &skills, threads)? {
            Reached::After(steps) => all.push(Some(steps)),
            Reached::Never => all.push(None),
            Reached::Stopped => return Ok(None),
        }
    }
    Ok(Some(all))
}

/// How a training ended that goes on until it mostly succeeds.
enum Reached {
    /// It did after so many steps.
    After(u64),
    /// Not in all the steps that it had.
    Never,
    /// Ctrl-C.
    Stopped,
}

fn train_to_success(
    game: &dyn Game,
    experiment: &Experiment,
    skills: &SkillModel,
    threads: usize,
) -> Result<Reached, CliError> {
    let skills = experiment.algorithm.needs_skills().then_some(skills);
    let mut trainer = Trainer::new(game, experiment, skills, DeviceKind::default(), threads)?;
    let title = format!("train {}, seed {}", experiment.algorithm, experiment.seed);
    let bar = progress::bar(&title, experiment.whole_steps(), "steps");
    let reached = loop {
        if trainer.is_done() {
            break Reached::Never;
        }
        if interrupt::asked() {
            break Reached::Stopped;
        }
        let report = trainer.update()?;
        bar.set_position(report.step);
        if report.mostly_succeeds(experiment.study.threshold) {
            break Reached::After(report.step);
        }
    };
    bar.finish_and_clear();
    Ok(reached)
}

/// The median of each method, and its seeds.
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
