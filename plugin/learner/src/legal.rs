//! Masks of actions in learning: illegal options have probability 0, and numbers that are held count for nothing.
//!
//! A mask has an entry for each option of each choice of each state, row by row: true if the option is legal. A discrete
//! action is one choice. In a space with numbers each row has one entry more: false if the numbers are those of an
//! earlier tick, which the game holds. An empty mask allows everything and costs nothing. A choice without any legal
//! option counts as one in which all are legal: no action is taken there.

use crate::{
    ActionSpace, Actions, LearnError,
    nn::{matrix, vector},
};
use burn::tensor::{Device, Tensor};

/// The logit of an illegal choice. Unlike -∞ it makes no NaN in a product with its probability, which is 0.
const ILLEGAL: f32 = -1e8;

/// Returns whether some choices of a row are illegal, and some are not.
fn is_mixed(legal: &[bool]) -> bool {
    legal.contains(&true) && legal.contains(&false)
}

/// Removes the illegal options from normalised log-probabilities, `[n, dim]`: the legal ones of a choice share its
/// probability. Choices without illegal options keep their bits, and so do the means of a vector behind the options.
pub(crate) fn restrict(head: &mut [f32], space: &ActionSpace, legal: &[bool]) {
    let (dim, width, choices) = (space.dim().max(1), space.mask_width().max(1), space.choices());
    for (row, legal) in head.chunks_exact_mut(dim).zip(legal.chunks_exact(width)) {
        choices.ranges().for_each(|at| restrict_choice(&mut row[at.clone()], &legal[at]));
    }
}

fn restrict_choice(row: &mut [f32], legal: &[bool]) {
    if !is_mixed(legal) {
        return;
    }
    let allowed = || row.iter().zip(legal).filter_map(|(&x, &is_legal)| is_legal.then_some(x));
    let top = f64::from(allowed().fold(f32::NEG_INFINITY, f32::max));
    let total: f64 = allowed().map(|x| libm::exp(f64::from(x) - top)).sum();
    let even = -libm::log(allowed().count() as f64);
    for (x, &is_legal) in row.iter_mut().zip(legal) {
        *x = match is_legal {
            true if top.is_finite() => (f64::from(*x) - top - libm::log(total)) as f32,
            // All legal options had probability 0.
            true => even as f32,
            false => ILLEGAL,
        };
    }
}

/// Returns the numbers that are added to the logits of these rows, `[rows, options]`: 0 for legal options. `None`
/// without a mask.
pub(crate) fn logit_offsets(legal: &[bool], rows: &[usize], space: &ActionSpace, device: &Device) -> Option<Tensor<2>> {
    let (options, width, choices) = (space.options(), space.mask_width(), space.choices());
    if legal.is_empty() || options == 0 {
        return None;
    }
    let mut offsets = Vec::with_capacity(rows.len() * options);
    for &row in rows {
        let legal = &legal[row * width..(row + 1) * width];
        for at in choices.ranges() {
            let illegal = if is_mixed(&legal[at.clone()]) { ILLEGAL } else { 0.0 };
            offsets.extend(legal[at].iter().map(|&is_legal| if is_legal { 0.0 } else { illegal }));
        }
    }
    Some(matrix(offsets, rows.len(), options, device))
}

/// Returns whether the numbers of each row of a mask are held. Empty if none are.
pub(crate) fn held_rows(legal: &[bool], space: &ActionSpace) -> Vec<bool> {
    if space.numbers() == 0 {
        return Vec::new();
    }
    let held: Vec<bool> = legal.chunks_exact(space.mask_width()).map(|row| row.last() == Some(&false)).collect();
    if held.contains(&true) { held } else { Vec::new() }
}

/// Returns 0 for each of these rows whose numbers are held, and 1 for the others, `[rows]`. `None` if none are.
pub(crate) fn free_rows(legal: &[bool], rows: &[usize], space: &ActionSpace, device: &Device) -> Option<Tensor<1>> {
    let width = space.mask_width();
    if legal.is_empty() || space.numbers() == 0 {
        return None;
    }
    let is_free = |row: &usize| legal[(row + 1) * width - 1];
    let is_all = rows.iter().all(is_free);
    (!is_all).then(|| vector(rows.iter().map(|row| f32::from(u8::from(is_free(row)))).collect(), device))
}

/// Returns the mean over all rows of the largest entropy that the legal options allow, as a share of that of all
/// options: 1 without a mask. The entropies of several choices are added.
pub(crate) fn entropy_share(legal: &[bool], space: &ActionSpace) -> f64 {
    let choices = space.choices();
    let of_all: f64 = choices.sizes().iter().map(|&size| libm::log(f64::from(size.max(1)))).sum();
    if legal.is_empty() || of_all == 0.0 {
        return 1.0;
    }
    let of_choice = |legal: &[bool]| match legal.iter().filter(|&&is_legal| is_legal).count() {
        0 => libm::log(legal.len() as f64),
        count => libm::log(count as f64),
    };
    let largest = |legal: &[bool]| choices.ranges().map(|at| of_choice(&legal[at])).sum::<f64>() / of_all;
    let width = space.mask_width();
    legal.chunks_exact(width).map(largest).sum::<f64>() / (legal.len() / width) as f64
}

/// Adds `rows` rows of so many entries to a mask that may not exist yet: those of `more`, or rows in which everything is
/// legal. `before` is the number of its rows so far.
pub(crate) fn extend(mask: &mut Vec<bool>, before: usize, more: &[bool], rows: usize, width: usize) {
    if mask.is_empty() && more.is_empty() {
        return;
    }
    mask.resize(before * width, true);
    mask.extend_from_slice(more);
    mask.resize((before + rows) * width, true);
}

/// Checks a mask for `actions`: its length, and that each action is legal.
///
/// # Errors
/// [`LearnError::Shape`] for another length; [`LearnError::Action`] names the first row with an illegal action.
pub(crate) fn check(legal: &[bool], space: &ActionSpace, actions: &Actions) -> Result<(), LearnError> {
    if legal.is_empty() {
        return Ok(());
    }
    let (width, choices) = (space.mask_width(), space.choices());
    space.check(actions)?;
    LearnError::check("rollout legal", actions.len() * width, legal.len())?;
    for (row, legal) in legal.chunks_exact(width.max(1)).enumerate() {
        for (at, &option) in choices.ranges().zip(actions.chosen(row)) {
            if !legal[at][option as usize] {
                return Err(LearnError::Action(format!("row {row} is {option}, which its mask forbids")));
            }
        }
    }
    Ok(())
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
        restrict(&mut log_probs, &ActionSpace::Discrete(3), &[true, false, true]);
        close(&log_probs.map(f32::exp), &[0.625, 0.0, 0.375]);
    }

    #[test]
    fn rows_in_which_everything_or_nothing_is_legal_keep_their_bits() {
        let before = [0.3f32, 0.7, 0.9, 0.1].map(f32::ln);
        let mut after = before;
        restrict(&mut after, &ActionSpace::Discrete(2), &[true, true, false, false]);
        assert_eq!(after, before);
        restrict(&mut after, &ActionSpace::Discrete(2), &[]);
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
            held: Vec::new(),
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
        let offsets =
            logit_offsets(&[true, true, true, true, false, true], &[0, 1], &ActionSpace::Discrete(3), &device)
                .expect("a mask");
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
            let offsets =
                logit_offsets(&[true, false, true], &[0], &ActionSpace::Discrete(3), &device).expect("a mask");
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
        assert_eq!(entropy_share(&[], &ActionSpace::Discrete(4)), 1.0);
        let mask = [[true; 4], [true, true, false, false], [false, true, false, false]].concat();
        // 1, ½ and 0.
        assert!((entropy_share(&mask, &ActionSpace::Discrete(4)) - 0.5).abs() < 1e-12);
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

    #[test]
    fn each_of_several_choices_has_its_own_mask() {
        let space = ActionSpace::mixed([2, 3], 1);
        let mut head = [0.5f32.ln(), 0.5f32.ln(), 0.5f32.ln(), 0.2f32.ln(), 0.3f32.ln(), 7.0];
        // Nothing is legal of the first choice: it is left alone, as all of it.
        restrict(&mut head, &space, &[false, false, true, false, true, true]);
        close(&head[..5].iter().map(|x| x.exp()).collect::<Vec<_>>(), &[0.5, 0.5, 0.625, 0.0, 0.375]);
        assert_eq!(head[5], 7.0, "a number has no mask");
        let actions =
            |options: &[u32]| Actions::Mixed { choices: 2, options: options.to_vec(), dim: 1, values: vec![0.0] };
        let legal = [true, false, true, true, false, true];
        assert!(check(&legal, &space, &actions(&[0, 1])).is_ok());
        assert!(check(&legal, &space, &actions(&[1, 1])).is_err());
        assert!(check(&legal, &space, &actions(&[0, 2])).is_err());
        // ln 1 + ln 2 of ln 2 + ln 3.
        let share = entropy_share(&legal, &space);
        assert!((share - 2f64.ln() / 6f64.ln()).abs() < 1e-12, "{share}");
    }

    #[test]
    fn the_last_entry_of_a_row_says_whether_numbers_are_held() {
        let space = ActionSpace::mixed([2], 2);
        let legal = [[true, true, true], [false, true, false], [true, true, true]].concat();
        assert_eq!(held_rows(&legal, &space), [false, true, false]);
        assert_eq!(held_rows(&[true; 6], &space), [false; 0]);
        assert_eq!(held_rows(&legal[..2], &ActionSpace::Discrete(2)), [false; 0]);
        let device = DeviceKind::Flex.plain();
        let free = |rows: &[usize]| free_rows(&legal, rows, &space, &device).map(|free| host(free).expect("readable"));
        assert_eq!((free(&[1, 2]), free(&[2, 0]), free(&[])), (Some(vec![0.0, 1.0]), None, None));
        let steer = ActionSpace::Continuous(1);
        let actions = Actions::Continuous { dim: 1, values: vec![0.5, 0.5] };
        assert!(check(&[true, false], &steer, &actions).is_ok());
        assert!(check(&[true], &steer, &actions).is_err());
    }
}
