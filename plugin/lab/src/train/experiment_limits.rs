//! Numbers beyond which nothing useful lies: a training would not end, or its sums would not be numbers.

use playbot_learner::{EntropyCoef, brief_number};

use super::{
    config::Experiment,
    experiment_error::{ExperimentError, refuse},
    free_threads::MOST_WORLDS,
};

/// Most steps of one rollout, over all arenas.
const MOST_ROWS: u64 = 1 << 40;

impl Experiment {
    /// Checks that no number is beyond all use. Whether a size fits into memory is for
    /// [`check_memory`](Self::check_memory) to say.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Value`] with the key.
    pub(super) fn check_limits(&self) -> Result<(), ExperimentError> {
        if u64::from(self.worlds) > MOST_WORLDS {
            let why = format!(
                "must be at most {MOST_WORLDS}, since each World plays on a thread of its own; `arenas` can share Worlds"
            );
            return refuse("worlds", self.worlds, why);
        }
        let rows = u64::from(self.arenas).checked_mul(self.rollout_steps() as u64);
        if rows.is_none_or(|rows| rows > MOST_ROWS) {
            let key = if self.algorithm.learner().key() == "ppo" { "ppo.num_steps" } else { "sac.num_steps" };
            let why = format!(
                "with `arenas` = {} that is more than {MOST_ROWS} steps before anything is learned",
                self.arenas
            );
            return refuse(key, self.rollout_steps(), why);
        }
        let counts = [
            // Numbers in metrics and plots are floating-point ones.
            ("steps", self.steps, 1 << 53),
            ("ppo.epochs", self.ppo.epochs as u64, 1_000_000),
            ("skills.epochs", self.skills.epochs as u64, 1_000_000),
            ("skills.window", self.skills.window as u64, 1_000_000),
        ];
        for (key, value, most) in counts {
            if value > most {
                return refuse(key, value, format!("must be at most {most}"));
            }
        }
        for (key, value, (least, most)) in self.numbers() {
            if !(least..=most).contains(&value) {
                let range = format!("must lie in {least}..{}", brief_number(most));
                return refuse(key, brief_number(value), range);
            }
        }
        Ok(())
    }

    /// The numbers with the ranges of what is of use; whether they must be positive is checked before.
    fn numbers(&self) -> Vec<(&'static str, f64, (f64, f64))> {
        const WEIGHT: (f64, f64) = (0.0, 1e6);
        // Numbers of single precision; a rate beyond all reason is for the training to find out.
        const RATE: (f64, f64) = (0.0, 1e30);
        const NORM: (f64, f64) = RATE;
        let (ppo, sac, skills) = (&self.ppo, &self.sac, &self.skills);
        let mut numbers = vec![
            ("ppo.lr", ppo.lr, RATE),
            ("ppo.clip", ppo.clip, WEIGHT),
            ("ppo.vf_coef", ppo.vf_coef, WEIGHT),
            ("ppo.ent_coef", ppo.ent_coef, WEIGHT),
            ("ppo.max_grad_norm", ppo.max_grad_norm, NORM),
            ("ppo.adam_eps", ppo.adam_eps, (0.0, 1.0)),
            ("ppo.weight_decay", ppo.weight_decay, RATE),
            ("ppo.augment_coef", ppo.augment_coef, WEIGHT),
            ("sac.actor_lr", sac.actor_lr, RATE),
            ("sac.critic_lr", sac.critic_lr, RATE),
            ("sac.temperature_lr", sac.temperature_lr, RATE),
            ("sac.adam_eps", sac.adam_eps, (0.0, 1.0)),
            ("sac.updates_per_step", sac.updates_per_step, (0.0, 1e4)),
            ("skills.lr", skills.lr, RATE),
            ("skills.max_grad_norm", skills.max_grad_norm, NORM),
            ("skills.beta", skills.beta, WEIGHT),
            ("skills.latent_reg", skills.latent_reg, WEIGHT),
            ("skills.weight_decay", skills.weight_decay, RATE),
            ("skills.state_weight", skills.state_weight, WEIGHT),
            ("score.kl_coef", self.score.kl_coef, WEIGHT),
            ("spirl.kl_coef", self.spirl.kl_coef, WEIGHT),
        ];
        numbers.extend(self.score.kl_coef_end.map(|end| ("score.kl_coef_end", end, WEIGHT)));
        numbers.extend(self.spirl.target_kl.map(|target| ("spirl.target_kl", target, WEIGHT)));
        match sac.entropy {
            EntropyCoef::Auto { initial, target_scale } => {
                numbers.push(("sac.entropy", initial, WEIGHT));
                numbers.extend(target_scale.map(|scale| ("sac.entropy", scale, (-1e6, 1e6))));
            }
            EntropyCoef::Fixed(temperature) => numbers.push(("sac.entropy", temperature, WEIGHT)),
        }
        numbers
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::train::config_file::parse_experiment;

    fn check(changes: &str) -> Result<(), String> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: 1000, algorithm: "ppo", {changes})"#);
        parse_experiment(&text, Path::new("x.ron")).expect("valid").check().map_err(|error| error.to_string())
    }

    #[test]
    fn what_would_never_end_or_run_away_is_refused() {
        for (changes, key) in [
            ("ppo: (epochs: 18446744073709551615)", "ppo.epochs"),
            ("ppo: (num_steps: 18446744073709551615)", "ppo.num_steps"),
            ("ppo: (num_steps: 4611686018427387904, minibatches: 3)", "ppo.num_steps"),
            ("arenas: 100000, worlds: 100000, ppo: (num_steps: 8)", "worlds"),
            ("arenas: 100000, worlds: 100000, ppo: (num_steps: 1000000000)", "worlds"),
            ("ppo: (ent_coef: -1)", "ppo.ent_coef"),
            ("ppo: (adam_eps: 1e308)", "ppo.adam_eps"),
            ("ppo: (max_grad_norm: 1e308)", "ppo.max_grad_norm"),
            ("sac: (updates_per_step: 1e300)", "sac.updates_per_step"),
            ("skills: (epochs: 18446744073709551615)", "skills.epochs"),
            ("score: (kl_coef: 1e308)", "score.kl_coef"),
        ] {
            let text = check(changes).expect_err(changes);
            assert!(text.starts_with(&format!("`{key}` is ")), "{changes}: {text}");
        }
        let long = check("sac: (updates_per_step: 1e300)").expect_err("far too many");
        assert_eq!(long, "`sac.updates_per_step` is 1e300: must lie in 0..10000");
        assert_eq!(check("ppo: (max_grad_norm: 1e9, ent_coef: 0, epochs: 100)"), Ok(()));
    }
}
