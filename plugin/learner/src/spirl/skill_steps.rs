//! Conversion of a rollout of ticks to one of skills.

use crate::{ActionSpace, Actions, EndStates, LearnError, Rollout, sac::check_ends};

/// The state after a skill.
#[derive(Clone, Copy, PartialEq, Debug)]
enum After {
    /// No state: the game was over.
    Nothing,
    /// A row in which the next skill was drawn.
    Row(usize),
    /// The last state of an episode that was cut off, by its index among [`EndStates::cut_rows`].
    Cut(usize),
    /// The state in which the rollout of this environment stopped.
    End(usize),
}

/// A skill that was drawn and played to its end within the rollout.
#[derive(Clone, Copy, PartialEq, Debug)]
struct SkillStep {
    /// The row in which it was drawn.
    row: usize,
    /// Σ γᵗ r over its ticks.
    reward: f64,
    /// γᵏ with k the ticks that it was played: the discount of the next state.
    discount: f64,
    after: After,
}

/// The rollout that a policy over skills learns from.
#[derive(Debug)]
pub(super) struct SkillRollout {
    /// Each row is a skill.
    pub(super) rows: Rollout,
    /// γᵏ of each row with k the ticks that the skill was played: fewer than the skill interval if an episode ended.
    pub(super) discounts: Vec<f64>,
    /// The row of the rollout of ticks in which each skill was drawn.
    pub(super) drawn_at: Vec<usize>,
    /// The end of each environment's rows, exclusive, for environments that played a skill.
    pub(super) chains: Vec<usize>,
}

/// Returns the rollout in terms of skills, in one environment: each row is a state in which a skill was drawn. The
/// action is that skill (`Actions::Continuous`, as the decoder read it), and its reward is the sum of `rewards` over
/// its ticks, discounted by `gamma`.
///
/// The skills of an environment follow one another. Behind its last one, and wherever an episode was cut off, the row
/// counts as truncated, with the next state among the ends. Skills drawn fewer than `skill_interval` ticks before the
/// end of the rollout are left out however they ended. Otherwise skills that end an episode would be learned from more
/// often than others. The state in which the first of them was drawn is the next state of its predecessor.
/// Log-probabilities and values stay 0.
///
/// # Errors
/// [`LearnError::Shape`] or [`LearnError::Config`] if the rollout does not hold the remaining shares of skills, or no
/// environment drew a skill and played it to its end.
pub(super) fn skill_rollout(
    rollout: &Rollout,
    rewards: &[f32],
    gamma: f64,
    skill_interval: usize,
) -> Result<SkillRollout, LearnError> {
    check_ends(rollout)?;
    LearnError::check("rollout left", rollout.rows(), rollout.left.len())?;
    LearnError::check("rollout ends next_left", rollout.envs, rollout.ends.next_left.len())?;
    LearnError::check("rewards of skills", rollout.rows(), rewards.len())?;
    let latent = rollout.latent;
    let mut skills = Rollout { envs: 1, ..Rollout::new(1, rollout.obs_kind, 0, &ActionSpace::Continuous(latent)) };
    let (mut drawn, mut discounts, mut drawn_at, mut chains) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for env in 0..rollout.envs {
        let steps = skill_steps(rollout, rewards, env, gamma, skill_interval);
        for (i, step) in steps.iter().enumerate() {
            let next = steps.get(i + 1).map(|next| next.row);
            push(&mut skills, rollout, step, next)?;
            drawn.extend_from_slice(&rollout.z[step.row * latent..(step.row + 1) * latent]);
            discounts.push(step.discount);
            drawn_at.push(step.row);
        }
        if !steps.is_empty() {
            chains.push(skills.steps);
        }
    }
    if skills.steps == 0 {
        let text = "no skill was played to its end: rollouts must be at least twice as long as the skill interval";
        return Err(LearnError::Config(text.to_owned()));
    }
    let n = skills.steps;
    skills.actions = Actions::Continuous { dim: latent, values: drawn };
    (skills.log_probs, skills.values, skills.final_values) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    skills.next_values = vec![0.0];
    skills.ends.next_obs.push(rollout.obs.row(0, rollout.obs_kind.numbers()))?;
    skills.ends.next_memory = vec![0.0; rollout.memory_width()];
    Ok(SkillRollout { rows: skills, discounts, drawn_at, chains })
}

/// Returns the skills that an environment has played to their ends, among those with enough time for it.
fn skill_steps(rollout: &Rollout, rewards: &[f32], env: usize, gamma: f64, skill_interval: usize) -> Vec<SkillStep> {
    let (mut steps, mut open): (Vec<SkillStep>, Option<SkillStep>) = (Vec::new(), None);
    let mut close = |open: &mut Option<SkillStep>, after| {
        steps.extend(open.take().map(|step| SkillStep { after, ..step }));
    };
    for (tick, row) in (env..rollout.rows()).step_by(rollout.envs).enumerate() {
        // A newly drawn skill has all of its ticks left.
        if rollout.left[row] >= 1.0 {
            close(&mut open, After::Row(row));
            if tick + skill_interval > rollout.steps {
                return steps;
            }
            open = Some(SkillStep { row, reward: 0.0, discount: 1.0, after: After::Nothing });
        }
        if let Some(step) = &mut open {
            step.reward += step.discount * f64::from(rewards[row]);
            step.discount *= gamma;
        }
        if rollout.terminated[row] {
            close(&mut open, After::Nothing);
        } else if let Ok(cut) = rollout.ends.cut_rows.binary_search(&row) {
            close(&mut open, After::Cut(cut));
        }
    }
    if rollout.ends.next_left[env] >= 1.0 {
        close(&mut open, After::End(env));
    }
    steps
}

/// Adds one skill; `next` is the row of the one that is added behind it.
fn push<'a>(
    skills: &mut Rollout,
    rollout: &'a Rollout,
    step: &SkillStep,
    next: Option<usize>,
) -> Result<(), LearnError> {
    let (width, remembered) = (rollout.obs_kind.numbers(), rollout.memory_width());
    let EndStates { cut_obs, next_obs, cut_memory, next_memory, .. } = &rollout.ends;
    skills.obs.push(rollout.obs.row(step.row, width))?;
    let memory_of = |all: &'a [f32], row: usize| all.get(row * remembered..(row + 1) * remembered).unwrap_or_default();
    skills.memory.extend_from_slice(memory_of(&rollout.memory, step.row));
    skills.rewards.push(step.reward as f32);
    skills.terminated.push(step.after == After::Nothing);
    let state = match step.after {
        After::Nothing => None,
        After::Row(row) if Some(row) == next => None,
        After::Row(row) => Some((rollout.obs.row(row, width), memory_of(&rollout.memory, row))),
        After::Cut(cut) => Some((cut_obs.row(cut, width), memory_of(cut_memory, cut))),
        After::End(env) => Some((next_obs.row(env, width), memory_of(next_memory, env))),
    };
    skills.truncated.push(state.is_some());
    skills.steps += 1;
    match state {
        Some((state, memory)) => {
            skills.ends.cut_memory.extend_from_slice(memory);
            skills.push_cut(0, state, &[])
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a rollout of one environment of nine ticks, with skills of two ticks. The first tick ends an earlier
    /// skill, an episode terminates after one tick of its skill, another is cut off, and the last skill has only
    /// begun.
    fn rollout(next_left: f32) -> Rollout {
        let n = 9;
        let mut rollout = Rollout {
            steps: n,
            obs: (0..9u8).map(f32::from).collect::<Vec<f32>>().into(),
            z: (0..9u8).map(|i| f32::from(i) * 0.1).collect(),
            left: vec![0.5, 1.0, 0.5, 1.0, 1.0, 0.5, 1.0, 1.0, 0.5],
            actions: Actions::Discrete(vec![0; n]),
            log_probs: vec![0.0; n],
            values: vec![0.0; n],
            rewards: vec![1.0; n],
            terminated: (0..n).map(|row| row == 3).collect(),
            truncated: (0..n).map(|row| row == 6).collect(),
            final_values: vec![0.0; n],
            next_values: vec![0.0],
            ..Rollout::new(1, 1, 1, &ActionSpace::Discrete(2))
        };
        rollout.ends.cut_rows = vec![6];
        rollout.ends.cut_obs.push(&[60.0]).expect("vectors");
        (rollout.ends.cut_z, rollout.ends.next_z) = (vec![0.0], vec![0.0]);
        rollout.ends.next_obs.push(&[90.0]).expect("vectors");
        rollout.ends.next_left = vec![next_left];
        rollout.check().expect("it fits");
        rollout
    }

    fn skills_of(rollout: &Rollout, skill_interval: usize) -> Result<SkillRollout, LearnError> {
        skill_rollout(rollout, &rollout.rewards, 0.5, skill_interval)
    }

    #[test]
    fn by_hand() {
        let SkillRollout { rows: skills, discounts, drawn_at, chains } =
            skills_of(&rollout(1.0), 2).expect("there are some");
        assert_eq!((drawn_at, chains), (vec![1, 3, 4, 6, 7], vec![5]));
        assert_eq!(discounts, [0.25, 0.5, 0.25, 0.5, 0.25], "the second and the fourth were played for one tick");
        skills.check().expect("it fits");
        assert_eq!(skills.obs, vec![1.0, 3.0, 4.0, 6.0, 7.0].into());
        assert_eq!(skills.rewards, [1.5, 1.0, 1.5, 1.0, 1.5]);
        assert_eq!(skills.terminated, [false, true, false, false, false]);
        assert_eq!(skills.truncated, [false, false, false, true, true]);
        assert_eq!((skills.ends.cut_rows, skills.ends.cut_obs), (vec![3, 4], vec![60.0, 90.0].into()));
        let Actions::Continuous { dim: 1, values } = skills.actions else { panic!("skills") };
        assert_eq!(values, [0.1, 0.3, 0.4, 0.6, 0.7].map(|z: f64| z as f32));
    }

    #[test]
    fn a_skill_that_the_rollout_cuts_is_only_the_state_behind_the_one_before() {
        let mut rollout = rollout(0.5);
        (rollout.truncated[6], rollout.ends.cut_rows) = (false, Vec::new());
        rollout.ends.cut_obs.clear();
        rollout.ends.cut_z.clear();
        let skills = skills_of(&rollout, 2).expect("there are some").rows;
        assert_eq!(skills.obs, vec![1.0, 3.0, 4.0, 6.0].into());
        assert_eq!((skills.ends.cut_rows, skills.ends.cut_obs), (vec![3], vec![7.0].into()));
    }

    #[test]
    fn skills_that_end_early_are_not_counted_more_often() {
        let mut rollout = rollout(0.5);
        // The last skill is drawn a tick before the end, so only a termination could have ended it.
        rollout.left = vec![0.5, 1.0, 0.5, 1.0, 1.0, 0.5, 1.0, 0.5, 1.0];
        (rollout.truncated[6], rollout.ends.cut_rows) = (false, Vec::new());
        rollout.ends.cut_obs.clear();
        rollout.ends.cut_z.clear();
        for is_over in [false, true] {
            rollout.terminated[8] = is_over;
            let skills = skills_of(&rollout, 2).expect("there are some").rows;
            assert_eq!(skills.obs, vec![1.0, 3.0, 4.0, 6.0].into());
            assert_eq!((skills.ends.cut_rows, skills.ends.cut_obs), (vec![3], vec![8.0].into()), "what it might earn");
        }
    }

    #[test]
    fn rollouts_without_a_whole_skill_are_refused() {
        let mut rollout = rollout(0.5);
        rollout.left = vec![0.5; 9];
        assert!(skills_of(&rollout, 2).expect_err("none").to_string().contains("twice as long"));
        rollout.left.clear();
        assert!(skills_of(&rollout, 2).expect_err("who knows").to_string().contains("left"));
    }
}
