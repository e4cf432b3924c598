//! The data of an update: a rollout with its advantages, and its minibatches in host memory.

use crate::{
    ActionSpace, Augmentation, ObsKind, ObsSlice, Observations, Rollout,
    legal::{free_rows, logit_offsets},
    nn::{ActionBatch, ImageNet, ObsBatch, vector},
    norm::ObsStats,
    observation::augmented,
    policy::{InputBuilder, NetInput, joined_rows},
    ppo::{
        PpoConfig,
        objective::{PpoBatch, normalize_advantages},
        sequences::{Sequence, pieces, recall, rows_of},
        step::{Minibatch, UpdateSettings},
    },
    rng::{ChaCha8Rng, shuffle},
    score::TeacherOutput,
};
use burn::tensor::Device;
use std::{
    cell::{Cell, RefCell},
    time::{Duration, Instant},
};

/// A rollout with all other data that an update reads, one entry per row.
#[derive(Debug)]
pub(super) struct Batch<'a> {
    pub(super) rollout: &'a Rollout,
    /// The space of its actions.
    pub(super) space: ActionSpace,
    pub(super) advantages: Vec<f32>,
    pub(super) returns: Vec<f32>,
    /// Returns of intrinsic rewards; empty without curiosity.
    pub(super) intrinsic_returns: Vec<f32>,
    pub(super) teacher: Option<TeacherOutput>,
    /// Number of the rollout's skill values that the networks read: all or 0.
    pub(super) latent: usize,
    /// Input rows of vectors, joined and normalised once for all epochs.
    pub(super) joined: Option<JoinedRows>,
    pub(super) norm_adv: bool,
    /// Image augmentations, and their random generator.
    pub(super) augment: (Vec<Augmentation>, RefCell<ChaCha8Rng>),
    /// Time spent assembling minibatches.
    pub(super) gathering: Cell<Duration>,
}

/// Skills and normalised vectors of all rows of a rollout, side by side.
#[derive(Debug)]
pub(super) struct JoinedRows {
    rows: Vec<f32>,
    kind: ObsKind,
}

impl JoinedRows {
    /// Builds the rows of a rollout of vectors.
    pub(super) fn of(rollout: &Rollout, latent: usize, stats: Option<&ObsStats>) -> Option<Self> {
        let Observations::Vector(values) = &rollout.obs else { return None };
        let (width, all) = (rollout.obs_kind.numbers(), (0..rollout.rows()).collect::<Vec<_>>());
        let rows = joined_rows(&rollout.z, latent, values, width, stats, &all);
        Some(Self { rows, kind: ObsKind::Vector(latent + width) })
    }

    fn inputs(&self) -> InputBuilder<'_> {
        InputBuilder { z: &[], latent: 0, obs: ObsSlice::Vector(&self.rows), kind: &self.kind, stats: None }
    }
}

/// Returns the rows of each minibatch of an update: those of the rollout in an order that each epoch draws anew, in
/// equal parts. Only one epoch is in memory at a time.
pub(super) fn minibatches<'a>(
    config: &PpoConfig,
    n: usize,
    rng: &'a mut ChaCha8Rng,
) -> impl Iterator<Item = Vec<usize>> + use<'a> {
    let (epochs, parts) = (config.epochs, config.minibatches.min(n));
    let mut rows: Vec<usize> = (0..n).collect();
    (0..epochs).flat_map(move |_| {
        shuffle(&mut rows, rng);
        (0..parts).map(|part| rows[part * n / parts..(part + 1) * n / parts].to_vec()).collect::<Vec<_>>()
    })
}

impl Batch<'_> {
    pub(super) fn inputs(&self) -> InputBuilder<'_> {
        let Rollout { z, obs, obs_kind: kind, .. } = self.rollout;
        match &self.joined {
            Some(joined) => joined.inputs(),
            None => InputBuilder { z, latent: self.latent, obs: obs.as_slice(), kind, stats: None },
        }
    }

    /// Counts the time since `start` as spent assembling minibatches.
    pub(super) fn gathered(&self, start: Instant) {
        self.gathering.set(self.gathering.get() + start.elapsed());
    }

    /// Returns a minibatch in parts, each with its share of the rows: the activations of images take more memory than
    /// the rollout.
    pub(super) fn parts<'b>(
        &'b self,
        rows: &'b [usize],
        cnn: Option<&ImageNet>,
        moment: &UpdateSettings<'_>,
        device: &'b Device,
    ) -> impl Iterator<Item = (Minibatch, f64)> + 'b {
        let advantages = self.advantages_of(rows);
        // A loss that is no mean over rows has no parts.
        let most = cnn.filter(|_| moment.has_mean_loss()).map_or(rows.len(), ImageNet::images_at_a_time);
        (0..rows.len()).step_by(most.max(1)).map(move |first| {
            let start = Instant::now();
            let part = first..(first + most).min(rows.len());
            let share = part.len() as f64 / rows.len() as f64;
            let minibatch = self.minibatch(&rows[part.clone()], advantages[part].to_vec(), device);
            self.gathered(start);
            (minibatch, share)
        })
    }

    /// Does [`Self::parts`] for the rows of sequences. A part has whole sequences.
    pub(super) fn parts_of_sequences<'b>(
        &'b self,
        sequences: &'b [Sequence],
        cnn: Option<&ImageNet>,
        moment: &UpdateSettings<'_>,
        device: &'b Device,
    ) -> impl Iterator<Item = (Minibatch, f64)> + 'b {
        let rows = rows_of(sequences, self.rollout.envs);
        let mut advantages = self.advantages_of(&rows);
        let most = cnn.filter(|_| moment.has_mean_loss()).map_or(rows.len(), ImageNet::images_at_a_time);
        pieces(sequences, most).into_iter().map(move |piece| {
            let start = Instant::now();
            let part = rows_of(piece, self.rollout.envs);
            let share = part.len() as f64 / rows.len() as f64;
            let of_part = advantages.drain(..part.len()).collect();
            let recall = Some(recall(piece, self.rollout, &self.inputs(), device));
            let minibatch = Minibatch { recall, ..self.minibatch(&part, of_part, device) };
            self.gathered(start);
            (minibatch, share)
        })
    }

    /// Returns the advantages of a minibatch, normalised if they are to be.
    fn advantages_of(&self, rows: &[usize]) -> Vec<f32> {
        let start = Instant::now();
        let mut advantages: Vec<f32> = rows.iter().map(|&r| self.advantages[r]).collect();
        if self.norm_adv {
            normalize_advantages(&mut advantages);
        }
        self.gathered(start);
        advantages
    }

    /// Returns the images of these `rows` after augmentation, with their skills from `inputs`; `None` without
    /// augmentations.
    pub(super) fn augmented(&self, inputs: &NetInput, rows: &[usize], device: &Device) -> Option<NetInput> {
        let (augmentations, rng) = &self.augment;
        let (NetInput::Images { z, .. }, ObsSlice::Image(pixels), ObsKind::Image(shape)) =
            (inputs, self.rollout.obs.as_slice(), &self.rollout.obs_kind)
        else {
            return None;
        };
        if augmentations.is_empty() {
            return None;
        }
        let changed = augmented(pixels, shape, rows, augmentations, &mut rng.borrow_mut());
        let all: Vec<usize> = (0..rows.len()).collect();
        let pixels = ObsBatch::gather(&changed, [shape.channels, shape.height, shape.width], &all, device);
        Some(NetInput::Images { z: z.clone(), pixels })
    }

    fn minibatch(&self, rows: &[usize], advantages: Vec<f32>, device: &Device) -> Minibatch {
        let rollout = self.rollout;
        let pick = |values: &[f32]| -> Vec<f32> { rows.iter().map(|&r| values[r]).collect() };
        let inputs = self.inputs().input(rows, device);
        Minibatch {
            augmented: self.augmented(&inputs, rows, device),
            inputs,
            recall: None,
            left: (!rollout.left.is_empty()).then(|| vector(pick(&rollout.left), device)),
            logit_offsets: logit_offsets(&rollout.legal, rows, &self.space, device),
            free: free_rows(&rollout.legal, rows, &self.space, device),
            ppo: PpoBatch {
                actions: ActionBatch::new(&rollout.actions.gather(rows), device),
                old_log_probs: vector(pick(&rollout.log_probs), device),
                advantages: vector(advantages, device),
                old_values: vector(pick(&rollout.values), device),
                returns: vector(pick(&self.returns), device),
            },
            teacher: self.teacher.as_ref().map(|teacher| teacher.batch(rows, device)),
            intrinsic_returns: (!self.intrinsic_returns.is_empty())
                .then(|| vector(pick(&self.intrinsic_returns), device)),
        }
    }
}
