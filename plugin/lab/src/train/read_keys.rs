//! Which settings of an experiment its algorithm reads.

use super::{
    algorithm::{Algorithm, LearnerKind},
    config::Experiment,
};

impl Experiment {
    /// Whether a value of this key, or of some key in this section, changes anything for the algorithm. Keys that are of no algorithm
    /// are for all, and what a value of another key makes idle, such as `score.kl_coef` with `score.kl` off, is not looked for.
    pub fn reads(&self, key: &str) -> bool {
        let (section, name) = key.split_once('.').unwrap_or((key, ""));
        let algorithm = self.algorithm;
        let is_by = |learner| algorithm.is_trained() && algorithm.learner() == learner;
        // What is tied to a decoder is a policy over actions; one over skills has a decoder below it only if that is to learn.
        let moves_actions = !algorithm.learns_prior() || self.spirl.learn_decoder;
        match section {
            "ppo" if algorithm == Algorithm::SpirlSac => moves_actions,
            "ppo" => is_by(LearnerKind::Ppo) && (moves_actions || name != "ent_coef"),
            "sac" => is_by(LearnerKind::Sac) && !Self::has_own(algorithm, name),
            "skills" => algorithm.needs_skills(),
            "score" if !algorithm.is_trained() => matches!(name, "" | "horizon" | "skill_draw"),
            "score" if !moves_actions => matches!(name, "" | "horizon" | "skill_draw" | "prior"),
            "score" => algorithm.needs_skills(),
            "spirl" => algorithm.learns_prior(),
            "rlpd" => algorithm.trains_on_demos(),
            _ => true,
        }
    }

    /// Whether an algorithm has a value of its own in the place of this one of SAC.
    fn has_own(algorithm: Algorithm, name: &str) -> bool {
        match algorithm {
            Algorithm::Rlpd => matches!(name, "critics" | "target_critics" | "layer_norm"),
            Algorithm::SpirlSac => matches!(name, "entropy" | "random_start"),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::train::config_file::parse_experiment;

    /// Those of the keys that an experiment reads.
    fn read(settings: &str, keys: &[&'static str]) -> Vec<&'static str> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", demos: "d", steps: 10, {settings})"#);
        let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
        keys.iter().copied().filter(|key| experiment.reads(key)).collect()
    }

    #[test]
    fn sections_of_other_algorithms_are_not_read() {
        let keys = ["steps", "ppo.lr", "sac", "skills.latent", "score.kl", "spirl.kl_coef", "rlpd.critics"];
        let of = |algorithm: &str| read(&format!("algorithm: {algorithm:?}"), &keys);
        assert_eq!(of("ppo"), ["steps", "ppo.lr"]);
        assert_eq!(of("score-ppo"), ["steps", "ppo.lr", "skills.latent", "score.kl"]);
        assert_eq!(of("score-sac"), ["steps", "sac", "skills.latent", "score.kl"]);
        assert_eq!(of("spirl-ppo"), ["steps", "ppo.lr", "skills.latent", "spirl.kl_coef"]);
        assert_eq!(of("spirl-sac"), ["steps", "sac", "skills.latent", "spirl.kl_coef"]);
        assert_eq!(of("rlpd"), ["steps", "sac", "rlpd.critics"]);
        assert_eq!(of("bc"), ["steps", "skills.latent"]);
    }

    #[test]
    fn nor_is_what_an_algorithm_has_in_their_place() {
        let keys = [
            "sac.critics",
            "sac.layer_norm",
            "sac.entropy",
            "sac.tau",
            "ppo.ent_coef",
            "ppo.lr",
            "score.kl_coef",
            "score.horizon",
        ];
        let of = |settings: &str| read(settings, &keys);
        assert_eq!(of(r#"algorithm: "rlpd""#), ["sac.entropy", "sac.tau"]);
        assert_eq!(of(r#"algorithm: "sac""#), ["sac.critics", "sac.layer_norm", "sac.entropy", "sac.tau"]);
        assert_eq!(of(r#"algorithm: "spirl-ppo""#), ["ppo.lr", "score.horizon"]);
        let learns = "spirl: (learn_decoder: true)";
        assert_eq!(
            of(&format!(r#"algorithm: "spirl-ppo", {learns}"#)),
            ["ppo.ent_coef", "ppo.lr", "score.kl_coef", "score.horizon"]
        );
        assert_eq!(of(r#"algorithm: "spirl-sac""#), ["sac.critics", "sac.layer_norm", "sac.tau", "score.horizon"]);
        let both =
            ["sac.critics", "sac.layer_norm", "sac.tau", "ppo.ent_coef", "ppo.lr", "score.kl_coef", "score.horizon"];
        assert_eq!(of(&format!(r#"algorithm: "spirl-sac", {learns}"#)), both);
        assert_eq!(of(r#"algorithm: "bc""#), ["score.horizon"]);
    }
}
