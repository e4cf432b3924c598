//! Checks of an experiment whose policy chooses skills.

use playbot_learner::{PriorKind, SkillDraw, TimeLimit};

use super::{
    config::{Experiment, LearnerKind},
    experiment_error::{ExperimentError, refuse},
};

impl Experiment {
    /// Checks that skills are whole and drawn, as a policy over skills needs them.
    pub(super) fn check_skill_draws(&self) -> Result<(), ExperimentError> {
        if !self.algorithm.learns_prior() {
            return Ok(());
        }
        if self.score.prior != PriorKind::Learned {
            return refuse("score.prior", "StandardNormal", "a policy over skills starts as the learned prior");
        }
        if self.score.skill_draw != SkillDraw::Sample {
            return refuse("score.skill_draw", "Mean", "a policy over skills learns from skills that are drawn");
        }
        let (key, steps, limit_key, limit) = match self.algorithm.learner() {
            LearnerKind::Ppo => ("ppo.num_steps", self.ppo.num_steps, "ppo.time_limit", self.ppo.time_limit),
            LearnerKind::Sac => ("sac.num_steps", self.sac.num_steps, "sac.time_limit", self.sac.time_limit),
        };
        if limit != TimeLimit::Bootstrap {
            return refuse(limit_key, "Legacy", "a policy over skills needs Bootstrap: its rollouts are cut anyway");
        }
        let least = self.score.horizon.saturating_mul(2);
        if steps < least {
            let why =
                format!("a policy over skills learns from whole skills: use at least 2 × `score.horizon` = {least}");
            return refuse(key, steps, why);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::train::config_file::parse_experiment;

    fn check(changes: &str) -> Result<(), String> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: 1000, demos: "d", {changes})"#);
        parse_experiment(&text, Path::new("x.ron")).expect("valid").check().map_err(|error| error.to_string())
    }

    #[test]
    fn a_policy_over_skills_needs_skills_that_are_drawn_and_played_to_their_ends() {
        for (changes, words) in [
            (r#"algorithm: "spirl-ppo", score: (skill_draw: Mean)"#, "`score.skill_draw` is Mean"),
            (r#"algorithm: "spirl-sac", score: (prior: StandardNormal)"#, "`score.prior` is StandardNormal"),
            (r#"algorithm: "spirl-ppo", ppo: (time_limit: Legacy)"#, "`ppo.time_limit` is Legacy"),
            (r#"algorithm: "spirl-sac", sac: (num_steps: 15)"#, "`sac.num_steps` is 15: a policy over skills learns"),
            (r#"algorithm: "spirl-ppo", ppo: (norm_obs: true)"#, "`ppo.norm_obs` is true"),
            (r#"algorithm: "spirl-ppo", spirl: (target_kl: Some(0.0))"#, "`spirl.target_kl` must be positive"),
            (r#"algorithm: "rlpd", rlpd: (demo_share: 1.0)"#, "`rlpd.demo_share` must lie between"),
            (r#"algorithm: "rlpd", observation: Raster"#, "`observation` is Raster: rlpd learns from vectors only"),
        ] {
            let text = check(changes).expect_err(changes);
            assert!(text.contains(words), "{changes}: {text}");
        }
        assert_eq!(check(r#"algorithm: "spirl-sac", sac: (num_steps: 16), ppo: (time_limit: Legacy)"#), Ok(()));
        assert_eq!(check(r#"algorithm: "score-ppo", score: (skill_draw: Mean)"#), Ok(()));
    }
}
