//! Checks of settings and metrics, cheap enough for every update of a training.

use crate::{
    diagnose::{
        advice::Advice,
        evidence::{discount_and_norm, recent},
        finding::{LearningFinding, Sign},
    },
    experiment::{Algorithm, Experiment, LearnerKind},
    metrics_log::{EPISODES, EPISODIC_LENGTH, EPISODIC_RETURN, LESSON, LESSON_SUCCESS, SUCCESS_RATE, is_settled},
    runs::RunCurves,
    train_run::never_learns,
};
use playbot_learner::PpoConfig;
use playbot_report::{percent, readable, whole};

/// Updates over which a metric is averaged.
const RECENT: usize = 5;

/// Learning rates beyond which networks of this size keep nothing: a hundred times the default.
const HIGHEST_RATE: f64 = 0.02;
/// Learning rates and gradients under which nothing is learned in any number of steps.
const LOWEST_RATE: f64 = 1e-7;
/// Passes over a rollout from which on they are too many whatever the metrics say: ten times the usual number.
const MOST_PASSES: usize = 30;

/// A clip range beyond which nothing is clipped in practice.
const LARGEST_CLIP: f64 = 1.0;

/// Bounds of a mean KL divergence and clip share in an update. Schulman et al. (2017) aim at 0.003 to 0.03.
const LARGEST_KL: f64 = 0.5;
const LARGEST_CLIP_SHARE: f64 = 0.6;
const SMALLEST_KL: f64 = 1e-6;
/// A clip range within which a policy hardly moves.
const SMALLEST_CLIP: f64 = 1e-3;
/// The default learning rate of PPO, from which on a higher one is no advice.
const USUAL_RATE: f64 = 5e-4;
/// An entropy bonus of this weight outweighs advantages that are normalised to a deviation of 1.
const LARGEST_ENTROPY_WEIGHT: f64 = 0.5;
/// A value loss beyond what returns of deviation 1 cost.
const LARGEST_VALUE_LOSS: f64 = 2.0;
/// A penalty of this weight outweighs them too.
const LARGEST_PENALTY: f64 = 5.0;
/// A horizon of fewer ticks is short wherever episodes are longer.
const SHORT_HORIZON: f64 = 10.0;
/// Mean reward of a tick that is large without normalisation.
const LARGE_REWARD: f64 = 100.0;
/// Ticks of one arena in which at least one episode should end.
const LONG_EPISODE: u64 = 20_000;

/// Checks the settings and the metrics of a run. The order of the findings says nothing.
pub fn check(experiment: &Experiment, curves: &RunCurves) -> Vec<LearningFinding> {
    let tag = |name: &str| {
        let own = curves.curve(&format!("losses/{name}"));
        if own.is_empty() { curves.curve(&format!("spirl/{name}")) } else { own }
    };
    let success = curves.last(SUCCESS_RATE);
    let succeeds = success.is_some_and(|rate| rate >= 0.5);
    // Random actions may reach an easy goal in half of the episodes.
    let is_solved = success.is_some_and(|rate| rate >= 0.9);
    let mut found = settings(experiment, &tag);
    if experiment.algorithm.learner() == LearnerKind::Ppo {
        found.extend(steps_of_policy(experiment, &tag, is_solved));
        found.extend(critic(experiment, &tag, succeeds));
        found.extend(collapse(experiment, &tag, succeeds));
    }
    found.extend(rewards(experiment, curves, &tag));
    found.extend(lessons(experiment, curves));
    found.extend(episodes(experiment, curves));
    found
}

type Tag<'a> = dyn Fn(&str) -> &'a [(u64, f64)] + 'a;

fn last(tag: &Tag<'_>, name: &str) -> String {
    tag(name).last().map_or("unknown".to_owned(), |(_, value)| readable(*value))
}

fn largest(tag: &Tag<'_>, name: &str) -> String {
    let values = tag(name).iter().map(|(_, value)| *value);
    values.reduce(f64::max).map_or("unknown".to_owned(), readable)
}

/// Returns the end of a sentence with a KL divergence; nothing before the first update.
fn and_kl(tag: &Tag<'_>, what: &str, of: impl Fn(&Tag<'_>, &str) -> String) -> String {
    match tag("approx_kl") {
        [] => String::new(),
        _ => format!(", and the {what} is {}", of(tag, "approx_kl")),
    }
}

fn settings(experiment: &Experiment, tag: &Tag<'_>) -> Vec<LearningFinding> {
    let Experiment { ppo, sac, score, algorithm, .. } = experiment;
    let mut found = Vec::new();
    if let Some(words) = never_learns(experiment) {
        let cause = "the training ends before its policy begins to learn";
        found.push(LearningFinding::new(Sign::Unmoved, words, cause, &[Advice::TrainLonger, Advice::BeginAtOnce]));
    }
    let (rates, is_ppo) = match algorithm.learner() {
        LearnerKind::Ppo if *algorithm == Algorithm::Imitation => {
            (vec![("imitation.lr", experiment.imitation.lr)], false)
        }
        LearnerKind::Ppo => (vec![("ppo.lr", ppo.lr)], true),
        LearnerKind::Sac => (vec![("sac.actor_lr", sac.actor_lr), ("sac.critic_lr", sac.critic_lr)], false),
    };
    for (key, rate) in rates.into_iter().filter(|(_, rate)| *rate >= HIGHEST_RATE) {
        found.push(LearningFinding::new(
            Sign::LearningRate,
            format!("`{key}` is {}{}", readable(rate), and_kl(tag, "largest KL divergence of an update", largest)),
            "each step overwrites what the steps before have learned",
            &[Advice::LowerRate],
        ));
    }
    if is_ppo && ppo.epochs >= MOST_PASSES {
        let clip =
            if ppo.clip > LARGEST_CLIP { format!(", `ppo.clip` is {}", readable(ppo.clip)) } else { String::new() };
        found.push(LearningFinding::new(
            Sign::MovesTooFar,
            format!("`ppo.epochs` is {}{clip}{}", ppo.epochs, and_kl(tag, "KL divergence of the last update", last)),
            "each rollout is learned from until the policy fits what was chance in it",
            &[Advice::FewerPasses],
        ));
    }
    if is_ppo && *algorithm != Algorithm::SpirlPpo && ppo.ent_coef >= LARGEST_ENTROPY_WEIGHT {
        found.push(LearningFinding::new(
            Sign::EntropyWeight,
            format!("`ppo.ent_coef` is {}, and the last entropy is {}", readable(ppo.ent_coef), last(tag, "entropy")),
            "random actions earn more of the bonus than the reward can outweigh",
            &[Advice::LowerEntropy],
        ));
    }
    let is_score = matches!(algorithm, Algorithm::ScorePpo | Algorithm::ScoreSac);
    if is_score && score.kl && score.kl_coef.min(score.kl_coef_end.unwrap_or(score.kl_coef)) >= LARGEST_PENALTY {
        found.push(LearningFinding::new(
            Sign::HeldByDecoder,
            format!("`score.kl_coef` is {}, fifty times its default or more", readable(score.kl_coef)),
            "leaving the decoder costs more than any reward pays",
            &[Advice::LowerPenalty],
        ));
    }
    found
}

/// Returns the part of a curve before a learning rate that falls to 0 has nearly done so.
fn before_the_rate_is_0<'a>(experiment: &Experiment, curve: &'a [(u64, f64)]) -> &'a [(u64, f64)] {
    let until = if experiment.ppo.anneal_lr { experiment.steps - experiment.steps / 10 } else { u64::MAX };
    &curve[..curve.partition_point(|(step, _)| *step <= until)]
}

fn steps_of_policy(experiment: &Experiment, tag: &Tag<'_>, is_solved: bool) -> Vec<LearningFinding> {
    let ppo = &experiment.ppo;
    let mut found = Vec::new();
    let learned = tag("approx_kl").len() as u64;
    let of = |name: &str| recent(before_the_rate_is_0(experiment, tag(name)), 3);
    let (kl, clip) = (of("approx_kl"), of("clip_fraction"));
    if let (Some(kl), Some(clip)) = (kl, clip)
        && learned >= ppo.critic_warmup + 3
    {
        let evidence = format!(
            "in the last 3 updates that were looked at, the KL divergence is {} and {} of the actions are clipped",
            readable(kl),
            readable(clip)
        );
        // Steps that are too large can leave nothing that moves.
        let (at, worst) = largest_steps(experiment, tag("approx_kl"));
        let can_move = ppo.lr < HIGHEST_RATE;
        // A decoder may solve the task without a policy that learns.
        let is_held = ppo.lr < LOWEST_RATE || ppo.max_grad_norm < LOWEST_RATE;
        let hardly_moves = kl.abs() < if ppo.clip < SMALLEST_CLIP { ppo.clip } else { SMALLEST_KL };
        let is_still = hardly_moves && (!is_solved || is_held);
        if is_still && worst > LARGEST_KL {
            // The rate is reported already where it is beyond all bounds.
            found.extend(can_move.then(|| {
                LearningFinding::new(
                    Sign::MovesTooFar,
                    format!(
                        "around step {} the KL divergence of an update was {}, and by now it is {}: the policy has stopped",
                        whole(at as f64),
                        readable(worst),
                        readable(kl)
                    ),
                    too_much(ppo),
                    &[Advice::LowerRate, Advice::FewerPasses],
                )
            }));
        } else if is_still && can_move && (clip == 0.0 || ppo.clip < SMALLEST_CLIP) {
            let (cause, advice) = match () {
                () if ppo.lr < 1e-5 => (format!("`ppo.lr` is {}", readable(ppo.lr)), vec![Advice::RaiseRate]),
                () if ppo.clip < SMALLEST_CLIP => {
                    let clip = readable(ppo.clip);
                    (format!("`ppo.clip` is {clip}: hardly any action may become more likely"), vec![Advice::UsualClip])
                }
                () if ppo.max_grad_norm < 1e-3 => {
                    let bound = readable(ppo.max_grad_norm);
                    (
                        format!("`ppo.max_grad_norm` is {bound}: gradients are cut to nothing"),
                        vec![Advice::AllowGradients],
                    )
                }
                () => {
                    let norm = last(tag, "grad_norm");
                    let words = format!("nothing in a rollout is better than the rest (the gradient is {norm})");
                    let can_be_higher = ppo.lr < USUAL_RATE;
                    let raise = can_be_higher.then_some(Advice::RaiseRate);
                    (words, [Some(Advice::MeasureBots), raise].into_iter().flatten().collect())
                }
            };
            found.push(LearningFinding::new(Sign::Unmoved, evidence, cause, &advice));
        } else if !is_solved && ppo.epochs < MOST_PASSES && (kl > LARGEST_KL || clip > LARGEST_CLIP_SHARE) {
            found.push(LearningFinding::new(
                Sign::MovesTooFar,
                evidence,
                too_much(ppo),
                &[Advice::LowerRate, Advice::FewerPasses],
            ));
        }
    }
    found
}

/// Returns the largest mean KL divergence of three updates, and the step at which it was.
fn largest_steps(experiment: &Experiment, curve: &[(u64, f64)]) -> (u64, f64) {
    let updates = before_the_rate_is_0(experiment, curve).windows(3);
    let means = updates.map(|three| (three[1].0, three.iter().map(|(_, kl)| kl / 3.0).sum::<f64>()));
    means.fold((0, 0.0), |most, now| if now.1 > most.1 { now } else { most })
}

/// Says which settings let a policy move too far.
fn too_much(ppo: &PpoConfig) -> String {
    let clip =
        if ppo.clip > LARGEST_CLIP { format!(", or `ppo.clip` = {}", readable(ppo.clip)) } else { String::new() };
    format!("`ppo.lr` = {}, or `ppo.epochs` = {}{clip} is too much", readable(ppo.lr), ppo.epochs)
}

fn critic(experiment: &Experiment, tag: &Tag<'_>, succeeds: bool) -> Option<LearningFinding> {
    let explained = recent(tag("explained_variance"), RECENT);
    let ppo = &experiment.ppo;
    let words = explained.map_or("unknown".to_owned(), readable);
    if ppo.vf_coef < 1e-4 {
        return Some(LearningFinding::new(
            Sign::BlindCritic,
            format!("`ppo.vf_coef` is {}, and the explained variance is {words}", readable(ppo.vf_coef)),
            "nothing trains the critic, so advantages are noise",
            &[Advice::TrainCritic],
        ));
    }
    // Where nearly nothing is paid, estimates near 0 explain less than nothing, and do no harm.
    let is_costly = recent(tag("value_loss"), RECENT).is_some_and(|loss| loss > LARGEST_VALUE_LOSS);
    explained.filter(|explained| *explained < -1.0 && is_costly && !succeeds).map(|_| {
        LearningFinding::new(
            Sign::BlindCritic,
            format!(
                "the explained variance of the last {RECENT} updates is {words}; the value loss is {}",
                last(tag, "value_loss")
            ),
            "returns are far outside of what the critic estimates: their scale changes, or it learns too fast",
            &[Advice::NormaliseRewards, Advice::LowerRate],
        )
    })
}

fn collapse(experiment: &Experiment, tag: &Tag<'_>, succeeds: bool) -> Option<LearningFinding> {
    if experiment.algorithm.needs_skills() || succeeds {
        // The decoder of a demonstrator without noise has hardly any entropy, and is not collapsed.
        return None;
    }
    let curve = tag("entropy");
    let (first, now) = (curve.first()?.1, recent(curve, 3)?);
    (first > 0.0 && now < 0.02 * first).then(|| {
        LearningFinding::new(
            Sign::Collapsed,
            format!("the entropy fell from {} to {}, and the goal is rarely reached", readable(first), readable(now)),
            "the policy was certain before it knew, and tries nothing else",
            &[Advice::RaiseEntropy, Advice::LowerRate],
        )
    })
}

fn rewards(experiment: &Experiment, curves: &RunCurves, tag: &Tag<'_>) -> Vec<LearningFinding> {
    let mut found = Vec::new();
    let (_, is_normalised) = discount_and_norm(experiment);
    let episodes = curves.last(EPISODES).unwrap_or_default();
    let returns = curves.curve(EPISODIC_RETURN);
    if is_settled(episodes as u64) && !returns.is_empty() && returns.iter().all(|(_, value)| *value == 0.0) {
        found.push(LearningFinding::new(
            Sign::NoReward,
            format!("none of {} episodes had any reward", whole(episodes)),
            "the goal is not reached by chance, or the game never pays",
            &[Advice::UseRecordings, Advice::PayReward],
        ));
    }
    let (total, length) = (curves.last(EPISODIC_RETURN), curves.last(EPISODIC_LENGTH));
    if let (Some(total), Some(length), false) = (total, length, is_normalised)
        && total.abs() > LARGE_REWARD
        && (total.abs() / length.max(1.0) > LARGE_REWARD || recent(tag("value_loss"), 3).is_some_and(|loss| loss > 1e4))
    {
        let loss = last(tag, "value_loss");
        found.push(LearningFinding::new(
            Sign::RewardScale,
            format!("an episode earns {} in {} ticks, and the value loss is {loss}", readable(total), whole(length)),
            "rewards far from 1 are not normalised, so the critic's loss drowns the policy's",
            &[Advice::NormaliseRewards, Advice::ScaleInGame],
        ));
    }
    found
}

/// Finds that a training has ended before its last lesson.
fn lessons(experiment: &Experiment, curves: &RunCurves) -> Option<LearningFinding> {
    let lessons = &experiment.curriculum.lessons;
    let (lesson, success) = (curves.last(LESSON)?, curves.last(LESSON_SUCCESS));
    let at = (lesson as usize).checked_sub(1).filter(|at| *at < lessons.len())?;
    (curves.last_step() >= experiment.whole_steps()).then(|| {
        let wanted = lessons[at].success.unwrap_or(experiment.curriculum.success);
        LearningFinding::new(
            Sign::LessonNotLearned,
            format!(
                "the training ended in lesson {} of {}, with {} of its episodes won and {} wanted",
                at + 1,
                lessons.len() + 1,
                percent(success.unwrap_or_default()),
                percent(wanted)
            ),
            "the lesson is too hard for the steps, or more success is wanted than it allows",
            &[Advice::TrainLonger, Advice::EasierLesson],
        )
    })
}

fn episodes(experiment: &Experiment, curves: &RunCurves) -> Vec<LearningFinding> {
    let mut found = Vec::new();
    let (gamma, _) = discount_and_norm(experiment);
    let horizon = 1.0 / (1.0 - gamma).max(1e-9);
    if let Some(length) = curves.last(EPISODIC_LENGTH)
        && horizon < SHORT_HORIZON
        && length > 2.0 * horizon
    {
        found.push(LearningFinding::new(
            Sign::ShortHorizon,
            format!("γ = {gamma} looks {} ticks ahead, and an episode has {} ticks", readable(horizon), whole(length)),
            "a reward at the end does not reach the actions that lead there",
            &[Advice::LookAhead],
        ));
    }
    let ticks = curves.last_step() / u64::from(experiment.arenas.max(1));
    if curves.last(EPISODES) == Some(0.0) && ticks > LONG_EPISODE {
        found.push(LearningFinding::new(
            Sign::NoEpisodes,
            format!("no episode has ended in {} ticks of each arena", whole(ticks as f64)),
            "the game ends no episode, and has no time limit",
            &[Advice::RaiseTimeLimit],
        ));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::file::parse_experiment;
    use std::path::Path;

    fn experiment(algorithm: &str, rest: &str) -> Experiment {
        let text = format!(
            r#"(game: "coinrun", train: "hard:0..63", test: "hard:64..127", demos: "d", steps: 1000000, algorithm: "{algorithm}", {rest})"#
        );
        parse_experiment(&text, Path::new("x.ron")).expect("valid")
    }

    /// Curves with the same value in ten updates of 1000 steps.
    fn curves(values: &[(&str, f64)]) -> RunCurves {
        let mut curves = RunCurves::default();
        for update in 1..=10 {
            let healthy = [
                (EPISODES, 200.0),
                (EPISODIC_RETURN, 1.0),
                (EPISODIC_LENGTH, 50.0),
                (SUCCESS_RATE, 0.1),
                ("losses/approx_kl", 0.01),
                ("losses/clip_fraction", 0.1),
                ("losses/entropy", 1.0),
                ("losses/explained_variance", 0.3),
                ("losses/value_loss", 0.1),
                ("losses/grad_norm", 0.4),
            ];
            let value_of = |(tag, value): (&'static str, f64)| {
                let changed = values.iter().find(|(changed, _)| *changed == tag);
                (tag, changed.map_or(value, |(_, value)| *value))
            };
            curves.push(1000 * update, healthy.into_iter().map(value_of));
        }
        curves
    }

    fn signs(experiment: &Experiment, values: &[(&str, f64)]) -> Vec<Sign> {
        check(experiment, &curves(values)).into_iter().map(|finding| finding.sign).collect()
    }

    #[test]
    fn healthy_metrics_give_no_warning() {
        for algorithm in ["ppo", "score-ppo", "sac", "spirl-ppo", "rlpd"] {
            assert_eq!(signs(&experiment(algorithm, ""), &[]), [], "{algorithm}");
        }
    }

    #[test]
    fn each_wrong_setting_is_found() {
        for (algorithm, settings, sign) in [
            ("ppo", "ppo: (lr: 1.0)", Sign::LearningRate),
            ("sac", "sac: (actor_lr: 1.0)", Sign::LearningRate),
            ("ppo", "ppo: (ent_coef: 5.0)", Sign::EntropyWeight),
            ("score-ppo", "score: (kl_coef: 1000.0)", Sign::HeldByDecoder),
            ("ppo", "ppo: (vf_coef: 0.0)", Sign::BlindCritic),
            ("ppo", "ppo: (gamma: 0.5)", Sign::ShortHorizon),
            ("sac", "sac: (gamma: 0.5)", Sign::ShortHorizon),
            ("sac", "sac: (learning_starts: 2000000)", Sign::Unmoved),
            ("ppo", "ppo: (critic_warmup: 90000)", Sign::Unmoved),
        ] {
            assert_eq!(signs(&experiment(algorithm, settings), &[]), [sign], "{settings}");
        }
        assert_eq!(signs(&experiment("score-ppo", "score: (kl: false, kl_coef: 1000.0)"), &[]), [], "it is off");
    }

    #[test]
    fn each_sign_of_metrics_is_found() {
        let ppo = experiment("ppo", "");
        let still = [("losses/approx_kl", 0.0), ("losses/clip_fraction", 0.0)];
        assert_eq!(signs(&ppo, &still), [Sign::Unmoved]);
        let falling = Experiment { steps: 10_000, ..experiment("ppo", "ppo: (anneal_lr: true)") };
        assert_eq!(signs(&falling, &still), [Sign::Unmoved]);
        assert_eq!(signs(&Experiment { steps: 1000, ..falling }, &still), [], "the rate has fallen to nothing");
        let dead = experiment("ppo", "ppo: (lr: 1.0)");
        assert_eq!(signs(&dead, &still), [Sign::LearningRate], "no advice to raise it");
        let solved = [("losses/approx_kl", 0.0), ("losses/clip_fraction", 0.0), (SUCCESS_RATE, 0.99)];
        assert_eq!(signs(&ppo, &solved), [], "it has nothing to learn");
        assert_eq!(signs(&ppo, &[("losses/approx_kl", 2.0)]), [Sign::MovesTooFar]);
        let many = experiment("ppo", "ppo: (epochs: 40)");
        assert_eq!(signs(&many, &[(SUCCESS_RATE, 0.99)]), [Sign::MovesTooFar], "it may have been lucky");
        assert_eq!(signs(&many, &[("losses/approx_kl", 2.0)]), [Sign::MovesTooFar], "it is said once");
        let far = [("losses/explained_variance", -3.0), ("losses/value_loss", 9.0)];
        assert_eq!(signs(&ppo, &far), [Sign::BlindCritic]);
        assert_eq!(signs(&ppo, &[("losses/explained_variance", -3.0)]), [], "hardly anything is paid");
        assert_eq!(signs(&ppo, &[(EPISODIC_RETURN, 0.0)]), [Sign::NoReward]);
        assert_eq!(signs(&ppo, &[(EPISODIC_RETURN, 0.0), (EPISODES, 99.0)]), [], "too few episodes to say so");
        let raw = experiment("ppo", "ppo: (norm_reward: false)");
        assert_eq!(signs(&raw, &[(EPISODIC_RETURN, 10_000.0)]), [Sign::RewardScale]);
        assert_eq!(signs(&ppo, &[(EPISODIC_RETURN, 10_000.0)]), [], "they are normalised");
        let long = RunCurves::default();
        assert!(check(&ppo, &long).is_empty(), "nothing is known yet");
    }

    #[test]
    fn the_cause_of_a_policy_that_stands_still_is_the_setting_that_holds_it() {
        let still = curves(&[("losses/approx_kl", 0.0), ("losses/clip_fraction", 0.0)]);
        for (settings, words) in [
            ("ppo: (lr: 0.000000001)", "`ppo.lr` is"),
            ("ppo: (max_grad_norm: 0.00000001)", "`ppo.max_grad_norm` is"),
            ("ppo: (clip: 0.00001)", "`ppo.clip` is"),
            ("", "nothing in a rollout is better"),
        ] {
            let found = check(&experiment("ppo", settings), &still);
            assert!(found[0].cause.contains(words), "{}", found[0].cause);
        }
    }

    #[test]
    fn a_tiny_clip_holds_a_policy_though_all_actions_are_clipped() {
        let held = [("losses/approx_kl", 2e-6), ("losses/clip_fraction", 0.9)];
        assert_eq!(signs(&experiment("ppo", "ppo: (clip: 0.00001)"), &held), [Sign::Unmoved]);
    }

    #[test]
    fn a_policy_that_jumped_and_then_stopped_has_moved_too_far() {
        let mut curves = RunCurves::default();
        for update in 1..=10 {
            let kl = if update < 5 { 9.0 } else { 0.0 };
            curves.push(1000 * update, [("losses/approx_kl", kl), ("losses/clip_fraction", kl / 10.0)].into_iter());
        }
        let found = check(&experiment("ppo", "ppo: (lr: 0.01, clip: 100.0)"), &curves);
        assert_eq!(found.iter().map(|finding| finding.sign).collect::<Vec<_>>(), [Sign::MovesTooFar]);
        assert_eq!(
            found[0].evidence,
            "around step 2,000 the KL divergence of an update was 9.000, and by now it is 0: the policy has stopped"
        );
        assert!(
            found[0].cause.contains("`ppo.lr` = 0.01") && found[0].cause.contains("`ppo.clip` = 100"),
            "{:?}",
            found[0]
        );
    }

    #[test]
    fn a_lesson_that_is_never_left_is_found_at_the_end() {
        let lessons = r#"curriculum: (lessons: [(levels: "easy:0..9", success: 0.7)])"#;
        let experiment = Experiment { steps: 10_000, ..experiment("ppo", lessons) };
        let in_lesson = |lesson: f64, steps: u64| {
            let mut curves = RunCurves::default();
            curves.push(steps, [(LESSON, lesson), (LESSON_SUCCESS, 0.18)].into_iter());
            check(&experiment, &curves)
        };
        let found = in_lesson(1.0, experiment.whole_steps());
        assert_eq!(found.iter().map(|finding| finding.sign).collect::<Vec<_>>(), [Sign::LessonNotLearned]);
        let words = "the training ended in lesson 1 of 2, with 18.0 % of its episodes won and 70.0 % wanted";
        assert_eq!(found[0].evidence, words);
        assert!(in_lesson(1.0, 1000).is_empty(), "it goes on");
        assert!(in_lesson(2.0, experiment.whole_steps()).is_empty(), "it is the last one");
    }

    #[test]
    fn entropy_that_falls_to_nothing_is_a_collapse() {
        let mut curves = curves(&[]);
        for update in 11..=14 {
            curves.push(1000 * update, [("losses/entropy", 0.001)].into_iter());
        }
        let found = check(&experiment("ppo", ""), &curves);
        assert_eq!(found.iter().map(|finding| finding.sign).collect::<Vec<_>>(), [Sign::Collapsed]);
        assert!(check(&experiment("score-ppo", ""), &curves).is_empty(), "a decoder may be certain");
    }
}
