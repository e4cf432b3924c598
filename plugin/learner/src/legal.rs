//! Masks of discrete actions in learning: illegal choices have probability 0.
//!
//! A mask has an entry for each choice of each state, row by row: true if the choice is legal. An empty mask allows
//! everything and costs nothing. A state without any legal choice counts as one in which all are legal: no action is
//! taken there.

use crate::{ActionSpace, Actions, LearnError, nn::matrix};
use burn::tensor::{Device, Tensor};

/// The logit of an illegal choice. Unlike -∞ it makes no NaN in a product with its probability, which is 0.
const ILLEGAL: f32 = -1e8;

/// Returns whether some choices of a row are illegal, and some are not.
fn is_mixed(legal: &[bool]) -> bool {
    legal.contains(&true) && legal.contains(&false)
}

/// Removes the illegal choices from normalised log-probabilities, `[n, choices]`: the legal ones share their
/// probability. Rows without illegal choices keep their bits.
pub(crate) fn restrict(log_probs: &mut [f32], choices: usize, legal: &[bool]) {
    let width = choices.max(1);
    for (row, legal) in log_probs.chunks_exact_mut(width).zip(legal.chunks_exact(width)) {
        if !is_mixed(legal) {
            continue;
        }
        let allowed = || row.iter().zip(legal).filter_map(|(&x, &is_legal)| is_legal.then_some(x));
        let top = f64::from(allowed().fold(f32::NEG_INFINITY, f32::max));
        let total: f64 = allowed().map(|x| libm::exp(f64::from(x) - top)).sum();
        let even = -libm::log(allowed().count() as f64);
        for (x, &is_legal) in row.iter_mut().zip(legal) {
            *x = match is_legal {
                true if top.is_finite() => (f64::from(*x) - top - libm::log(total)) as f32,
                // All legal choices had probability 0.
                true => even as f32,
                false => ILLEGAL,
            };
        }
    }
}

/// Returns the numbers that are added to the logits of these rows, `[rows, choices]`: 0 for legal choices. `None`
/// without a mask.
pub(crate) fn logit_offsets(legal: &[bool], rows: &[usize], choices: usize, device: &Device) -> Option<Tensor<2>> {
    if legal.is_empty() {
        return None;
    }
    let mut offsets = Vec::with_capacity(rows.len() * choices);
    for &row in rows {
        let legal = &legal[row * choices..(row + 1) * choices];
        let illegal = if is_mixed(legal) { ILLEGAL } else { 0.0 };
        offsets.extend(legal.iter().map(|&is_legal| if is_legal { 0.0 } else { illegal }));
    }
    Some(matrix(offsets, rows.len(), choices, device))
}

/// Returns the mean over all rows of the largest entropy that the legal choices allow, as a share of that of all
/// choices: 1 without a mask.
pub(crate) fn entropy_share(legal: &[bool], choices: usize) -> f64 {
    if legal.is_empty() || choices < 2 {
        return 1.0;
    }
    let largest = |legal: &[bool]| match legal.iter().filter(|&&is_legal| is_legal).count() {
        0 => 1.0,
        count => libm::log(count as f64) / libm::log(choices as f64),
    };
    let rows = legal.len() / choices;
    legal.chunks_exact(choices).map(largest).sum::<f64>() / rows as f64
}

/// Adds `rows` rows to a mask that may not exist yet: those of `more`, or rows in which everything is legal. `before`
/// is the number of its rows so far.
pub(crate) fn extend(mask: &mut Vec<bool>, before: usize, more: &[bool], rows: usize, choices: usize) {
    if mask.is_empty() && more.is_empty() {
        return;
    }
    mask.resize(before * choices, true);
    mask.extend_from_slice(more);
    mask.resize((before + rows) * choices, true);
}

/// Checks a mask for `actions`: its length, and that each action is legal.
///
/// # Errors
/// [`LearnError::Shape`] for another length; [`LearnError::Action`] names the first row with an illegal action.
pub(crate) fn check(legal: &[bool], space: &ActionSpace, actions: &Actions) -> Result<(), LearnError> {
    if legal.is_empty() {
        return Ok(());
    }
    let (Actions::Discrete(actions), ActionSpace::Discrete(choices)) = (actions, *space) else {
        return Err(LearnError::Action(format!("a mask is for discrete actions, not for {space}")));
    };
    LearnError::check("rollout legal", actions.len() * choices, legal.len())?;
    match actions.iter().zip(legal.chunks_exact(choices.max(1))).position(|(&a, legal)| !legal[a as usize]) {
        Some(row) => Err(LearnError::Action(format!("row {row} is {}, which its mask forbids", actions[row]))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        ActionValue, DeviceKind, PolicyOutput,
        nn::{ActionBatch, Dist, host},
    };

    fn close(got: &[f32], want: &[f32]) {
        let near = got.len() == want.len() && got.iter().zip(want).all(|(got, want)| (got - want).abs() < 1e-6);
        assert!(near, "{got:?}, expected {want:?}");
    }

    #[test]
    fn legal_choices_share_the_probability_of_illegal_ones() {
        let mut log_probs = [0.5f32, 0.2, 0.3].map(f32::ln);
        restrict(&mut log_probs, 3, &[true, false, true]);
        close(&log_probs.map(f32::exp), &[0.625, 0.0, 0.375]);
    }

    #[test]
    fn rows_in_which_everything_or_nothing_is_legal_keep_their_bits() {
        let before = [0.3f32, 0.7, 0.9, 0.1].map(f32::ln);
        let mut after = before;
        restrict(&mut after, 2, &[true, true, false, false]);
        assert_eq!(after, before);
        restrict(&mut after, 2, &[]);
        assert_eq!(after, before);
    }

    #[test]
    fn the_only_legal_choice_is_certain() {
        let mut output = PolicyOutput {
            space: ActionSpace::Discrete(3),
            squashed: false,
            head: [0.9f32, 0.09, 0.01].map(f32::ln).to_vec(),
            log_std: Vec::new(),
            values: vec![4.0],
            memory: Vec::new(),
        };
        output.restrict(&[false, false, true]);
        let mut rng = crate::Streams::new(1).stream("draw", 0);
        assert!((0..200).all(|_| output.sample(0, &mut rng) == (ActionValue::Discrete(2), 0.0)));
        assert_eq!(output.greedy(0), ActionValue::Discrete(2));
        assert_eq!(output.values, [4.0], "values do not depend on the mask");
    }

    /// Returns a distribution of two rows, of which the second one has an illegal choice, and its logits.
    fn masked() -> (Dist, Tensor<2>) {
        let device = DeviceKind::Flex.plain();
        let logits = matrix(vec![0.1, 0.2, 0.3, 1.0, 5.0, 2.0], 2, 3, &device.clone().autodiff()).require_grad();
        let offsets = logit_offsets(&[true, true, true, true, false, true], &[0, 1], 3, &device).expect("a mask");
        (Dist::categorical(logits.clone() + offsets), logits)
    }

    #[test]
    fn log_probability_and_entropy_are_those_of_the_legal_choices() {
        let (dist, _) = masked();
        let device = DeviceKind::Flex.plain();
        let fewer = Dist::categorical(matrix(vec![1.0, 2.0], 1, 2, &device));
        let log_prob = |dist: &Dist, actions: Vec<u32>| {
            let actions = ActionBatch::new(&Actions::Discrete(actions), &device);
            host(dist.log_prob(&actions).expect("choices").inner()).expect("readable")
        };
        close(&log_prob(&dist, vec![0, 2])[1..], &log_prob(&fewer, vec![1]));
        let entropy = |dist: &Dist| host(dist.entropy().inner()).expect("readable");
        close(&entropy(&dist)[1..], &entropy(&fewer));
        assert!(entropy(&dist).iter().all(|x| x.is_finite()));
    }

    #[test]
    fn divergences_of_equal_masks_are_those_of_the_legal_choices() {
        let device = DeviceKind::Flex.plain();
        let of = |logits: [f32; 3]| {
            let offsets = logit_offsets(&[true, false, true], &[0], 3, &device).expect("a mask");
            Dist::categorical(matrix(logits.to_vec(), 1, 3, &device) + offsets)
        };
        let fewer = |logits: [f32; 2]| Dist::categorical(matrix(logits.to_vec(), 1, 2, &device));
        let kl = |p: Dist, q: Dist| host(p.kl(&q).expect("choices")).expect("readable");
        close(&kl(of([1.0, 9.0, 2.0]), of([0.5, -9.0, 0.1])), &kl(fewer([1.0, 2.0]), fewer([0.5, 0.1])));
    }

    #[test]
    fn illegal_logits_have_no_gradient() {
        let (dist, logits) = masked();
        let device = DeviceKind::Flex.plain();
        let actions = ActionBatch::new(&Actions::Discrete(vec![0, 2]), &device);
        let loss = dist.log_prob(&actions).expect("choices").mean() + dist.entropy().mean();
        let grads = host(logits.grad(&loss.backward()).expect("tracked")).expect("readable");
        assert!(grads[4].abs() < 1e-20, "{grads:?}");
        assert!(grads[3].abs() > 1e-3 && grads[5].abs() > 1e-3, "{grads:?}");
    }

    #[test]
    fn masks_grow_by_rows_in_which_everything_is_legal() {
        let mut mask = Vec::new();
        extend(&mut mask, 0, &[], 2, 2);
        assert!(mask.is_empty());
        extend(&mut mask, 2, &[false, true], 1, 2);
        extend(&mut mask, 3, &[], 1, 2);
        assert_eq!(mask, [true, true, true, true, false, true, true, true]);
    }

    #[test]
    fn the_share_of_entropy_is_that_of_the_legal_choices() {
        assert_eq!(entropy_share(&[], 4), 1.0);
        let mask = [[true; 4], [true, true, false, false], [false, true, false, false]].concat();
        // 1, ½ and 0.
        assert!((entropy_share(&mask, 4) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn an_illegal_action_is_named_with_its_row() {
        let space = ActionSpace::Discrete(2);
        let actions = Actions::Discrete(vec![0, 1]);
        assert!(check(&[], &space, &actions).is_ok());
        assert!(check(&[true, false, true, true], &space, &actions).is_ok());
        let text = check(&[true, true, true, false], &space, &actions).expect_err("illegal").to_string();
        assert!(text.contains("row 1 is 1, which its mask forbids"), "{text}");
        assert!(check(&[true], &space, &actions).expect_err("too short").to_string().contains("rollout legal"));
    }
}
