//! An update on a graphics card: the rollout is sent once, with the rows of all minibatches, and the numbers of all steps
//! are read back together.
//!
//! No buffer is larger than [`LARGEST`], since drivers refuse those of two gigabytes and more. So pixels are sent in pieces, and
//! the gradient of a large minibatch of images is the sum over its parts.

use crate::{
    LearnError, ObsKind, ObsSlice,
    device::send,
    legal::{free_rows, logit_offsets},
    nn::{ActionBatch, Adam, Dist, FlatGrads, PackedPixels, host, matrix, vector},
    policy::NetInput,
    ppo::{
        PpoConfig, PpoNets, StepMetrics,
        batch::Batch,
        objective::{PpoBatch, PpoLoss, intrinsic_value_loss},
        step::{Losses, Minibatch, Outputs, UpdateSettings, augmentation_loss, outputs},
    },
    score::TeacherBatch,
};
use burn::tensor::{Device, Int, Tensor, TensorData};
use playbot_kernels::host_ops::exp;

/// Most bytes of a tensor of images, or of what a network makes of them.
const LARGEST: usize = 256 << 20;

/// A whole rollout on a device.
pub(super) struct SentRollout<'a> {
    batch: &'a Batch<'a>,
    /// The rows of each minibatch, in ascending order.
    order: Vec<Vec<usize>>,
    /// The same on the device, one after the other.
    rows: Tensor<1, Int>,
    states: States,
    left: Option<Tensor<1>>,
    logit_offsets: Option<Tensor<2>>,
    free: Option<Tensor<1>>,
    ppo: PpoBatch,
    teacher: Option<(Dist, Tensor<1>)>,
    intrinsic_returns: Option<Tensor<1>>,
    device: Device,
}

enum States {
    Joined(Tensor<2>),
    /// Pixels in pieces of so many images.
    Images {
        z: Option<Tensor<2>>,
        pixels: Vec<PackedPixels>,
        piece: usize,
    },
}

impl<'a> SentRollout<'a> {
    /// Sends a rollout, and the rows of its minibatches.
    pub(super) fn send(batch: &'a Batch<'a>, minibatches: impl Iterator<Item = Vec<usize>>, device: &Device) -> Self {
        let rollout = batch.rollout;
        let column = |values: &[f32]| vector(values.to_vec(), device);
        let all: Vec<usize> = (0..rollout.rows()).collect();
        let mut order: Vec<Vec<usize>> = minibatches.collect();
        // The order within a minibatch means nothing. In this one the images of a piece follow one another.
        order.iter_mut().for_each(|rows| rows.sort_unstable());
        let rows: Vec<i32> = order.iter().flatten().map(|&row| row as i32).collect();
        let shape = [rows.len()];
        Self {
            rows: send(TensorData::new(rows, shape), device),
            order,
            states: States::send(batch, &all, device),
            left: (!rollout.left.is_empty()).then(|| column(&rollout.left)),
            logit_offsets: logit_offsets(&rollout.legal, &all, &batch.space, device),
            free: free_rows(&rollout.legal, &all, &batch.space, device),
            ppo: PpoBatch {
                actions: ActionBatch::new(&rollout.actions, device),
                old_log_probs: column(&rollout.log_probs),
                advantages: column(&batch.advantages),
                old_values: column(&rollout.values),
                returns: column(&batch.returns),
            },
            teacher: batch.teacher.as_ref().map(|t| (t.dist.rows(&all, device), column(&t.confidence))),
            intrinsic_returns: (!batch.intrinsic_returns.is_empty()).then(|| column(&batch.intrinsic_returns)),
            batch,
            device: device.clone(),
        }
    }

    /// Returns each minibatch in parts of equal size, each with its share of the rows. A part is gathered when it is
    /// asked for.
    pub(super) fn minibatches<'b>(
        &'b self,
        images_at_a_time: Option<usize>,
    ) -> impl Iterator<Item = impl Iterator<Item = (Minibatch, f64)> + 'b> + 'b {
        let mut first = 0;
        self.order.iter().map(move |rows| {
            let at = self.rows.clone().narrow(0, first, rows.len());
            first += rows.len();
            let advantages = self.ppo.advantages.clone().select(0, at.clone());
            let advantages = if self.batch.norm_adv { normalized(advantages) } else { advantages };
            let parts = rows.len().div_ceil(images_at_a_time.unwrap_or(rows.len()).max(1)).max(1);
            let size = rows.len().div_ceil(parts);
            let part = move |first: usize| {
                let n = size.min(rows.len() - first);
                let (at, advantages) = (at.clone(), advantages.clone());
                let (at, advantages) = match parts {
                    1 => (at, advantages),
                    _ => (at.narrow(0, first, n), advantages.narrow(0, first, n)),
                };
                (self.minibatch(&rows[first..first + n], &at, advantages), n as f64 / rows.len() as f64)
            };
            (0..rows.len()).step_by(size.max(1)).map(part)
        })
    }

    fn minibatch(&self, rows: &[usize], at: &Tensor<1, Int>, advantages: Tensor<1>) -> Minibatch {
        let column = |values: &Tensor<1>| values.clone().select(0, at.clone());
        let inputs = self.states.select(rows, at);
        Minibatch {
            augmented: self.batch.augmented(&inputs, rows, &self.device),
            inputs,
            recall: None,
            left: self.left.as_ref().map(column),
            free: self.free.as_ref().map(column),
            logit_offsets: self.logit_offsets.as_ref().map(|offsets| offsets.clone().select(0, at.clone())),
            ppo: PpoBatch {
                actions: self.ppo.actions.select(at),
                old_log_probs: column(&self.ppo.old_log_probs),
                advantages,
                old_values: column(&self.ppo.old_values),
                returns: column(&self.ppo.returns),
            },
            teacher: self.teacher.as_ref().zip(self.batch.teacher.as_ref()).map(|((dist, confidence), host)| {
                TeacherBatch {
                    dist: dist.select(at),
                    confidence: column(confidence),
                    mean_confidence: host.mean_confidence(rows),
                }
            }),
            intrinsic_returns: self.intrinsic_returns.as_ref().map(column),
        }
    }
}

/// Returns how many images a network learns from at a time; `None` for all of a minibatch.
pub(super) fn images_at_a_time(batch: &Batch<'_>, nets: &PpoNets, moment: &UpdateSettings<'_>) -> Option<usize> {
    let ObsKind::Image(shape) = &batch.rollout.obs_kind else { return None };
    let cnn = nets.actor.cnn.as_ref().filter(|_| moment.has_mean_loss())?;
    let widest = cnn.widest([shape.channels, shape.height, shape.width]) * size_of::<f32>();
    Some((LARGEST / widest.max(1)).max(1))
}

/// Normalises advantages as [`crate::ppo::normalize_advantages`] does.
fn normalized(advantages: Tensor<1>) -> Tensor<1> {
    let [n] = advantages.dims();
    let centred = advantages.clone() - advantages.mean();
    let std = (centred.clone().square().sum() / (n as f64 - 1.0).max(1.0)).sqrt();
    centred / (std + 1e-8)
}

impl States {
    fn send(batch: &Batch<'_>, all: &[usize], device: &Device) -> Self {
        match (batch.rollout.obs.as_slice(), &batch.rollout.obs_kind) {
            (ObsSlice::Image(pixels), ObsKind::Image(image)) => {
                let z = &batch.rollout.z;
                let sides = [image.channels, image.height, image.width];
                let size = sides.iter().product::<usize>().max(1);
                let piece = (LARGEST / size).max(1);
                Self::Images {
                    z: (batch.latent > 0).then(|| matrix(z.clone(), all.len(), batch.latent, device)),
                    piece,
                    pixels: pixels.chunks(piece * size).map(|piece| PackedPixels::send(piece, sides, device)).collect(),
                }
            }
            _ => match batch.inputs().input(all, device) {
                NetInput::Joined(x) => Self::Joined(x),
                NetInput::Images { .. } => unreachable!("images were sent as such"),
            },
        }
    }

    /// Returns these rows, which are `at` on the device.
    fn select(&self, rows: &[usize], at: &Tensor<1, Int>) -> NetInput {
        match self {
            Self::Joined(x) => NetInput::Joined(x.clone().select(0, at.clone())),
            Self::Images { z, pixels, piece } => {
                let mut first = 0;
                let mut found = Vec::new();
                for (pixels, begin) in pixels.iter().zip((0..).step_by(*piece)) {
                    let n = rows[first..].partition_point(|&row| row < begin + piece);
                    if n > 0 {
                        let at = if n == rows.len() { at.clone() } else { at.clone().narrow(0, first, n) };
                        found.push(pixels.select(if begin == 0 { at } else { at - begin as i64 }));
                    }
                    first += n;
                }
                NetInput::Images {
                    z: z.as_ref().map(|z| z.clone().select(0, at.clone())),
                    pixels: PackedPixels::joined(found).numbers(),
                }
            }
        }
    }
}

/// Metrics of the steps of an update, still on the device.
#[derive(Default)]
pub(super) struct Reports {
    /// For each step the metrics that are on the device, in the order of the fields.
    numbers: Vec<Tensor<1>>,
    /// For each step the metrics that are known without the device.
    known: Vec<StepMetrics<Option<f64>>>,
}

/// A metric of a step.
#[allow(clippy::large_enum_variant, reason = "a dozen at a time, which are moved at once")]
enum Metric {
    OnDevice(Tensor<1>),
    Known(f64),
}

impl Reports {
    /// Does [`crate::ppo::gradient_step`] on a minibatch in parts, with all results left on the device.
    pub(super) fn step(
        &mut self,
        nets: &mut PpoNets,
        adam: &mut Adam,
        parts: impl Iterator<Item = (Minibatch, f64)>,
        config: &PpoConfig,
        moment: &UpdateSettings<'_>,
    ) -> Result<(), LearnError> {
        let (mut sums, mut known, mut confidence) = (None, StepMetrics::default(), 0.0);
        for (part, share) in parts {
            confidence += part.teacher.as_ref().map_or(0.0, |teacher| teacher.mean_confidence) * share;
            let (metrics, total) = metrics_and_loss(nets, &part, config, moment)?;
            let mut numbers = Vec::new();
            known = metrics.map(|metric| match metric {
                Metric::OnDevice(number) => {
                    numbers.push(number);
                    None
                }
                Metric::Known(number) => Some(number),
            });
            // A whole minibatch is not multiplied by 1.
            let total = if share < 1.0 { total * share } else { total };
            let (numbers, grads) = (Tensor::cat(numbers, 0), FlatGrads::take(nets, total.backward()));
            sums = Some(match sums {
                None if share < 1.0 => (numbers * share, grads),
                None => (numbers, grads),
                Some((sum, of_grads)) => (sum + numbers * share, of_grads + grads),
            });
        }
        let Some((numbers, grads)) = sums else { return Ok(()) };
        let grad_norm = adam.step_on_device(nets, grads, moment.lr, config.max_grad_norm);
        // The norm is the last of the fields.
        self.numbers.push(Tensor::cat(vec![numbers, grad_norm], 0));
        self.known.push(StepMetrics { confidence: Some(confidence), grad_norm: None, ..known });
        Ok(())
    }

    /// Returns the sum over all steps, read at once; `before` optimizer steps were made before the first.
    ///
    /// # Errors
    /// [`LearnError::NotFinite`] or [`LearnError::Exploded`] for the first step whose losses or gradient diverged;
    /// the parameter is not known here. Weights that the last step spoils show in the next update.
    pub(super) fn sum(self, before: u64) -> Result<StepMetrics, LearnError> {
        let mut sum = StepMetrics::default();
        let mut numbers = host(Tensor::cat(self.numbers, 0))?.into_iter().map(f64::from);
        for (step, known) in self.known.into_iter().enumerate() {
            let steps = before + step as u64;
            let metrics = known.map(|known| known.or_else(|| numbers.next()).unwrap_or(f64::NAN));
            metrics.check_losses(steps)?;
            if !metrics.grad_norm.is_finite() {
                return Err(LearnError::NotFinite { tensor: "gradient".to_owned(), steps: Some(steps) });
            }
            sum.add(&metrics, 1.0);
        }
        Ok(sum)
    }
}

/// Computes the loss of some rows, `[1]`, and their metrics but for the norm of the gradient.
fn metrics_and_loss(
    nets: &PpoNets,
    batch: &Minibatch,
    config: &PpoConfig,
    moment: &UpdateSettings<'_>,
) -> Result<(StepMetrics<Metric>, Tensor<1>), LearnError> {
    use Metric::{Known, OnDevice};
    let Outputs { dist, values, intrinsic } = outputs(nets, &batch.inputs, batch, config, moment)?;
    let augmentation = augmentation_loss(nets, &dist, &values, batch, config, moment)?;
    let Losses { ppo, penalty, mut total } = Losses::of(&dist, values, batch, config, moment)?;
    let PpoLoss { policy_loss, value_loss, entropy, log_ratio } = ppo;
    let [policy_loss, value_loss, entropy] = [policy_loss, value_loss, entropy].map(Tensor::inner);
    let (decoder_kl, kl_penalty) = match penalty {
        Some(penalty) => (OnDevice(penalty.kl.mean().inner()), OnDevice(penalty.term.inner())),
        None => (Known(0.0), Known(0.0)),
    };
    let log_ratio = log_ratio.inner();
    let moved = exp(log_ratio.clone()) - 1.0;
    let approx_kl = (moved.clone() - log_ratio).mean();
    let clip_fraction = moved.abs().greater_elem(config.clip).float().mean();
    let augmentation_loss = match augmentation {
        Some(loss) => {
            total = total + loss.clone() * config.augment_coef;
            OnDevice(loss.inner())
        }
        None => Known(0.0),
    };
    let intrinsic_value_loss = match intrinsic.zip(batch.intrinsic_returns.clone()) {
        Some((values, returns)) => {
            let loss = intrinsic_value_loss(values, returns);
            total = total + loss.clone() * config.vf_coef;
            OnDevice(loss.inner())
        }
        None => Known(0.0),
    };
    let metrics = StepMetrics {
        policy_loss: OnDevice(policy_loss),
        value_loss: OnDevice(value_loss),
        entropy: OnDevice(entropy),
        decoder_kl,
        kl_penalty,
        total_loss: OnDevice(total.clone().inner()),
        approx_kl: OnDevice(approx_kl),
        clip_fraction: OnDevice(clip_fraction),
        confidence: Known(0.0),
        augmentation_loss,
        intrinsic_value_loss,
        grad_norm: Known(0.0),
    };
    Ok((metrics, total))
}
