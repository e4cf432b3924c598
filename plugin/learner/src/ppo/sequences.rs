//! Sequences of a rollout, through which the memory of a policy is trained.
//!
//! A sequence is a run of ticks of one environment within one episode. It begins with the state that was remembered
//! when it was played. That state stems from the weights of then. A burn-in reads some earlier ticks of the episode
//! again, with the present weights (Kapturowski et al. 2019, "Recurrent experience replay in distributed reinforcement
//! learning").

use crate::{
    Rollout,
    nn::matrix,
    policy::{BurnIn, Grid, InputBuilder, Recall, send_rows},
    rng::{ChaCha8Rng, shuffle},
};
use burn::tensor::Device;

/// Ticks `first..first + len` of environment `env`, after a burn-in of the `burn_in` ticks before them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Sequence {
    env: usize,
    first: usize,
    len: usize,
    burn_in: usize,
}

/// Returns the sequences of a rollout, each of at most `length` ticks. Together they are all of its rows.
pub(super) fn sequences(rollout: &Rollout, length: usize, burn_in: usize) -> Vec<Sequence> {
    let (steps, envs, done) = (rollout.steps, rollout.envs, rollout.done());
    let mut all = Vec::new();
    for env in 0..envs {
        // First tick of the present episode in this rollout, and of the sequence.
        let (mut begun, mut first) = (0, 0);
        for tick in 0..steps {
            let (ends, len) = (done[tick * envs + env], tick + 1 - first);
            if ends || len == length || tick + 1 == steps {
                all.push(Sequence { env, first, len, burn_in: burn_in.min(first - begun) });
                first = tick + 1;
                begun = if ends { first } else { begun };
            }
        }
    }
    all
}

/// Returns the sequences of each minibatch of an update, in an order that each epoch draws anew. All minibatches of an
/// epoch have about as many sequences.
pub(super) fn minibatches_of(
    mut sequences: Vec<Sequence>,
    epochs: usize,
    parts: usize,
    rng: &mut ChaCha8Rng,
) -> impl Iterator<Item = Vec<Sequence>> {
    let n = sequences.len();
    (0..epochs).flat_map(move |_| {
        shuffle(&mut sequences, rng);
        (0..parts).map(|part| sequences[part * n / parts..(part + 1) * n / parts].to_vec()).collect::<Vec<_>>()
    })
}

/// Splits sequences into pieces of at most `most` rows each, if one sequence has no more.
pub(super) fn pieces(sequences: &[Sequence], most: usize) -> Vec<&[Sequence]> {
    let (mut all, mut start, mut rows) = (Vec::new(), 0, 0);
    for (i, sequence) in sequences.iter().enumerate() {
        if rows > 0 && rows + sequence.len > most {
            all.push(&sequences[start..i]);
            (start, rows) = (i, 0);
        }
        rows += sequence.len;
    }
    all.push(&sequences[start..]);
    all
}

/// Returns the rows of the rollout in these sequences, one sequence after the other.
pub(super) fn rows_of(sequences: &[Sequence], envs: usize) -> Vec<usize> {
    sequences.iter().flat_map(|s| (s.first..s.first + s.len).map(move |tick| tick * envs + s.env)).collect()
}

/// Returns how the rows of these sequences, in the order of [`rows_of`], are remembered. `inputs` are those of the
/// rollout.
pub(super) fn recall(sequences: &[Sequence], rollout: &Rollout, inputs: &InputBuilder<'_>, device: &Device) -> Recall {
    let (envs, width) = (rollout.envs, rollout.memory_width());
    let first_row = |s: &Sequence| (s.first - s.burn_in) * envs + s.env;
    let stored = |s: &Sequence| &rollout.memory[first_row(s) * width..(first_row(s) + 1) * width];
    let initial = sequences.iter().flat_map(stored).copied().collect();
    let lengths: Vec<usize> = sequences.iter().map(|s| s.len).collect();
    let recall = Recall::new(matrix(initial, sequences.len(), width, device), &lengths);
    Recall { burn_in: burn_in(sequences, envs, inputs, device), ..recall }
}

fn burn_in(sequences: &[Sequence], envs: usize, inputs: &InputBuilder<'_>, device: &Device) -> Option<BurnIn> {
    let rows = |s: &Sequence| {
        let env = s.env;
        (s.first - s.burn_in..s.first).map(move |tick| tick * envs + env)
    };
    let rows: Vec<usize> = sequences.iter().flat_map(rows).collect();
    if rows.is_empty() {
        return None;
    }
    let count = sequences.len();
    let lengths: Vec<usize> = sequences.iter().map(|s| s.burn_in).collect();
    let (grid, _) = Grid::of(&lengths, device);
    let last = |(i, s): (usize, &Sequence)| if s.burn_in == 0 { i } else { s.burn_in * count + i };
    let last: Vec<usize> = sequences.iter().enumerate().map(last).collect();
    Some(BurnIn { inputs: inputs.input(&rows, device), grid, last: send_rows(&last, device) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ActionSpace, rng::Streams};

    /// Returns a rollout of 7 ticks of two environments. The first one ends an episode at tick 2, the second at 6.
    fn rollout() -> Rollout {
        let mut rollout = Rollout::new(2, 1, 0, &ActionSpace::Discrete(2));
        rollout.steps = 7;
        rollout.terminated = vec![false; 14];
        rollout.truncated = vec![false; 14];
        rollout.terminated[4] = true;
        rollout.truncated[13] = true;
        rollout
    }

    fn of(env: usize, first: usize, len: usize, burn_in: usize) -> Sequence {
        Sequence { env, first, len, burn_in }
    }

    #[test]
    fn sequences_end_with_episodes_and_are_never_too_long() {
        let want = [of(0, 0, 3, 0), of(0, 3, 3, 0), of(0, 6, 1, 2), of(1, 0, 3, 0), of(1, 3, 3, 2), of(1, 6, 1, 2)];
        assert_eq!(sequences(&rollout(), 3, 2), want);
        assert_eq!(sequences(&rollout(), 100, 0), [of(0, 0, 3, 0), of(0, 3, 4, 0), of(1, 0, 7, 0)]);
    }

    #[test]
    fn each_epoch_has_every_row_once() {
        let all = sequences(&rollout(), 3, 0);
        let mut rng = Streams::new(1).stream("order", 0);
        let minibatches: Vec<_> = minibatches_of(all, 2, 4, &mut rng).collect();
        assert_eq!(minibatches.len(), 8);
        for epoch in minibatches.chunks(4) {
            let mut rows: Vec<usize> = epoch.iter().flat_map(|sequences| rows_of(sequences, 2)).collect();
            rows.sort_unstable();
            assert_eq!(rows, (0..14).collect::<Vec<_>>());
        }
        assert_ne!(minibatches[..4], minibatches[4..], "another order");
    }

    #[test]
    fn rows_of_a_sequence_follow_one_another() {
        assert_eq!(rows_of(&[of(1, 3, 3, 2), of(0, 0, 2, 0)], 2), [7, 9, 11, 0, 2]);
        let pieces = pieces(&[of(0, 0, 3, 0), of(1, 0, 3, 0), of(0, 3, 4, 0)], 6).len();
        assert_eq!(pieces, 2);
    }
}
