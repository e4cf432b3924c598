//! The formulas of intrinsic rewards: endless advantages, and their sum with those of the game.

use crate::ppo::objective::Advantages;

/// Computes generalised advantage estimates as [`crate::ppo::gae`] does, of a return that no end of an episode cuts:
///
/// δ = r + γ v' - V(s), A = δ + γ λ A'. v' is always the next row's value, also that of another episode.
///
/// `rewards` and `values` are `[T, envs]`, row-major. `next_values`, `[envs]`, are those after the last row.
///
/// # Panics
/// If there are fewer values than rewards.
pub fn endless_gae(rewards: &[f32], values: &[f32], next_values: &[f32], gamma: f64, lambda: f64) -> Advantages {
    let envs = next_values.len();
    let mut advantages = vec![0.0; rewards.len()];
    for (env, &next_value) in next_values.iter().enumerate() {
        let (mut following, mut next_value) = (0.0, f64::from(next_value));
        for row in (env..rewards.len()).step_by(envs).rev() {
            let value = f64::from(values[row]);
            following = f64::from(rewards[row]) + gamma * next_value - value + gamma * lambda * following;
            advantages[row] = following as f32;
            next_value = value;
        }
    }
    let returns = advantages.iter().zip(values).map(|(a, v)| a + v).collect();
    Advantages { advantages, returns }
}

/// Computes [`endless_gae`] of environments whose rows follow one another. `chains` holds the end of each, exclusive, and
/// `next_values` the value behind it.
pub(super) fn chained_gae(
    rewards: &[f32],
    values: &[f32],
    next_values: &[f32],
    chains: &[usize],
    (gamma, lambda): (f64, f64),
) -> Advantages {
    let mut all = Advantages { advantages: Vec::new(), returns: Vec::new() };
    let mut start = 0;
    for (&end, &next_value) in chains.iter().zip(next_values) {
        let of_chain = endless_gae(&rewards[start..end], &values[start..end], &[next_value], gamma, lambda);
        all.advantages.extend(of_chain.advantages);
        all.returns.extend(of_chain.returns);
        start = end;
    }
    all
}

/// Returns w · A + v · B for advantages A of the game and B of intrinsic rewards, and their `weights` (w, v).
pub fn combined_advantages(extrinsic: &[f32], intrinsic: &[f32], weights: (f64, f64)) -> Vec<f32> {
    let sum = |(&a, &b): (&f32, &f32)| (weights.0 * f64::from(a) + weights.1 * f64::from(b)) as f32;
    extrinsic.iter().zip(intrinsic).map(sum).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_hand() {
        // One environment, γ = λ = ½, V = 2 and 4, r = 1 and 3, next value 8.
        // Second step: 3 + 8/2 - 4 = 3. First: 1 + 4/2 - 2 + 3/4 = 1.75.
        let found = endless_gae(&[1.0, 3.0], &[2.0, 4.0], &[8.0], 0.5, 0.5);
        assert_eq!((found.advantages, found.returns), (vec![1.75, 3.0], vec![3.75, 7.0]));
        // A second environment lies between the rows of the first.
        let found = endless_gae(&[1.0, 0.0, 3.0, 0.0], &[2.0, 0.0, 4.0, 0.0], &[8.0, 0.0], 0.5, 0.5);
        assert_eq!(found.advantages, [1.75, 0.0, 3.0, 0.0]);
        // The same behind a chain of one row: 1 + 2/2 - 0 = 2.
        let (rewards, values, next_values) = ([1.0, 1.0, 3.0], [0.0, 2.0, 4.0], [2.0, 8.0]);
        let found = chained_gae(&rewards, &values, &next_values, &[1, 3], (0.5, 0.5));
        assert_eq!((found.advantages, found.returns), (vec![2.0, 1.75, 3.0], vec![2.0, 3.75, 7.0]));
    }

    #[test]
    fn advantages_are_weighed() {
        assert_eq!(combined_advantages(&[1.0, -2.0], &[4.0, 8.0], (2.0, 0.5)), [4.0, 0.0]);
    }
}
