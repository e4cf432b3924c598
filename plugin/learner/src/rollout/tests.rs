//! Tests of rollouts that are joined, and of rollouts that do not fit.

use crate::{ActionSpace, Actions, ObsKind, rollout::*};

fn part(envs: usize, base: f32) -> Rollout {
    let mut rollout = Rollout::new(envs, 1, 0, &ActionSpace::Discrete(9));
    for t in 0..2 {
        let row: Vec<f32> = (0..envs).map(|b| base + (t * 10 + b) as f32).collect();
        let actions = Actions::Discrete(vec![t as u32; envs]);
        let flags = vec![false; envs];
        let step = RolloutStep {
            obs: (&row).into(),
            z: &[],
            actions: &actions,
            log_probs: &row,
            values: &row,
            rewards: &row,
            terminated: &flags,
            truncated: &flags,
            final_values: &row,
        };
        rollout.push_step(step).expect("discrete");
    }
    rollout.push_cut(envs - 1, &[base], &[]).expect("vectors");
    rollout.next_values = vec![base; envs];
    rollout.ends.next_obs = vec![base; envs].into();
    rollout
}

#[test]
fn joined_rollouts_lie_side_by_side() {
    let joined = Rollout::join(vec![part(2, 0.0), part(1, 100.0)]).expect("they fit");
    assert_eq!((joined.steps, joined.envs), (2, 3));
    assert_eq!(joined.rewards, [0.0, 1.0, 100.0, 10.0, 11.0, 110.0]);
    assert_eq!(joined.next_values, [0.0, 0.0, 100.0]);
    assert!(joined.check().is_ok());
    assert_eq!(joined.ends.next_obs, joined.next_values.into());
    assert_eq!((joined.ends.cut_rows, joined.ends.cut_obs), (vec![4, 5], vec![0.0, 100.0].into()));
}

#[test]
fn masks_of_joined_rollouts_lie_side_by_side_and_allow_everything_where_there_are_none() {
    let mut masked = part(1, 100.0);
    masked.legal = [vec![true; 9], vec![false; 9]].concat();
    (masked.ends.cut_legal, masked.ends.next_legal) = (vec![false; 9], vec![false; 9]);
    let joined = Rollout::join(vec![part(2, 0.0), masked]).expect("they fit");
    let of_rows: Vec<bool> = joined.legal.chunks(9).map(|row| row[0]).collect();
    assert_eq!((joined.legal.len(), of_rows), (54, vec![true, true, true, true, true, false]));
    assert_eq!(joined.ends.next_legal, [vec![true; 18], vec![false; 9]].concat());
    assert_eq!(joined.ends.cut_legal, [vec![true; 9], vec![false; 9]].concat());
    let plain = Rollout::join(vec![part(2, 0.0), part(1, 100.0)]).expect("they fit");
    assert!(plain.legal.is_empty() && plain.ends.next_legal.is_empty() && plain.ends.cut_legal.is_empty());
}

#[test]
fn steps_without_a_mask_allow_everything_beside_others() {
    let mut rollout = part(2, 0.0);
    rollout.push_legal(&[]);
    assert!(rollout.legal.is_empty());
    rollout.push_legal(&[[true, false], [false, true]].concat());
    assert_eq!(rollout.legal, [true, true, true, true, true, false, false, true]);
}

#[test]
fn a_wrong_length_is_named() {
    let mut rollout = part(2, 0.0);
    rollout.rewards.pop();
    assert!(rollout.check().expect_err("too short").to_string().contains("rewards"));
}

#[test]
fn rollouts_with_ends_that_do_not_fit_are_not_joined() {
    let after = |change: fn(&mut EndStates)| {
        let mut rollout = part(2, 0.0);
        change(&mut rollout.ends);
        Rollout::join(vec![part(1, 5.0), rollout]).expect_err("does not fit").to_string()
    };
    assert!(after(|ends| ends.cut_obs.clear()).contains("cut_obs"));
    assert!(after(|ends| ends.cut_z.push(1.0)).contains("cut_z"));
    assert!(after(|ends| ends.cut_rows[0] = 4).contains("row 4"));
    assert!(after(|ends| (ends.cut_rows, ends.cut_obs) = (vec![3, 1], vec![0.0; 2].into())).contains("ascend"));
    let without = Rollout { ends: EndStates::new(&ObsKind::Vector(1)), ..part(2, 0.0) };
    assert!(Rollout::join(vec![without.clone(), without]).is_ok(), "PPO needs none");
}
