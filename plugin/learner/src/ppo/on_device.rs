//! An update on a graphics card: the rollout is sent once, and the numbers of all steps are read back together.

use crate::{
    LearnError, ObsKind, ObsSlice,
    legal::logit_offsets,
    nn::{ActionBatch, Adam, Dist, PackedPixels, host, matrix, vector},
    policy::NetInput,
    ppo::{
        PpoConfig, PpoNets, StepMetrics,
        batch::Batch,
        objective::{PpoBatch, PpoLoss},
        step::{Losses, Minibatch, UpdateSettings, augmentation_loss, outputs},
    },
    score::TeacherBatch,
};
use burn::tensor::{Device, Int, Tensor, TensorData};
use playbot_kernels::host_ops::exp;

/// A whole rollout on a device.
pub(super) struct SentRollout<'a> {
    batch: &'a Batch<'a>,
    states: States,
    left: Option<Tensor<1>>,
    logit_offsets: Option<Tensor<2>>,
    ppo: PpoBatch,
    teacher: Option<(Dist, Tensor<1>)>,
    device: Device,
}

#[expect(clippy::large_enum_variant, reason = "there is one per update")]
enum States {
    Joined(Tensor<2>),
    Images { z: Option<Tensor<2>>, pixels: PackedPixels },
}

impl<'a> SentRollout<'a> {
    pub(super) fn send(batch: &'a Batch<'a>, device: &Device) -> Self {
        let rollout = batch.rollout;
        let column = |values: &[f32]| vector(values.to_vec(), device);
        let all: Vec<usize> = (0..rollout.rows()).collect();
        Self {
            states: States::send(batch, &all, device),
            left: (!rollout.left.is_empty()).then(|| column(&rollout.left)),
            logit_offsets: logit_offsets(&rollout.legal, &all, rollout.choices(), device),
            ppo: PpoBatch {
                actions: ActionBatch::new(&rollout.actions, device),
                old_log_probs: column(&rollout.log_probs),
                advantages: column(&batch.advantages),
                old_values: column(&rollout.values),
                returns: column(&batch.returns),
            },
            teacher: batch.teacher.as_ref().map(|t| (t.dist.rows(&all, device), column(&t.confidence))),
            batch,
            device: device.clone(),
        }
    }

    pub(super) fn minibatch(&self, rows: &[usize]) -> Minibatch {
        let numbers = rows.iter().map(|&row| row as i32).collect();
        let at: Tensor<1, Int> = Tensor::from_data(TensorData::new(numbers, [rows.len()]), &self.device);
        let column = |values: &Tensor<1>| values.clone().select(0, at.clone());
        let advantages = column(&self.ppo.advantages);
        let inputs = self.states.select(&at);
        Minibatch {
            augmented: self.batch.augmented(&inputs, rows, &self.device),
            inputs,
            left: self.left.as_ref().map(column),
            logit_offsets: self.logit_offsets.as_ref().map(|offsets| offsets.clone().select(0, at.clone())),
            ppo: PpoBatch {
                actions: match &self.ppo.actions {
                    ActionBatch::Discrete(actions) => ActionBatch::Discrete(actions.clone().select(0, at.clone())),
                    ActionBatch::Continuous(actions) => ActionBatch::Continuous(actions.clone().select(0, at.clone())),
                },
                old_log_probs: column(&self.ppo.old_log_probs),
                advantages: if self.batch.norm_adv { normalized(advantages) } else { advantages },
                old_values: column(&self.ppo.old_values),
                returns: column(&self.ppo.returns),
            },
            teacher: self.teacher.as_ref().zip(self.batch.teacher.as_ref()).map(|((dist, confidence), host)| {
                TeacherBatch {
                    dist: dist.select(&at),
                    confidence: column(confidence),
                    mean_confidence: host.mean_confidence(rows),
                }
            }),
        }
    }
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
                Self::Images {
                    z: (batch.latent > 0).then(|| matrix(z.clone(), all.len(), batch.latent, device)),
                    pixels: PackedPixels::send(pixels, [image.channels, image.height, image.width], device),
                }
            }
            _ => match batch.inputs().input(all, device) {
                NetInput::Joined(x) => Self::Joined(x),
                NetInput::Images { .. } => unreachable!("images were sent as such"),
            },
        }
    }

    fn select(&self, rows: &Tensor<1, Int>) -> NetInput {
        match self {
            Self::Joined(x) => NetInput::Joined(x.clone().select(0, rows.clone())),
            Self::Images { z, pixels } => NetInput::Images {
                z: z.as_ref().map(|z| z.clone().select(0, rows.clone())),
                pixels: pixels.select(rows.clone()).numbers(),
            },
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
    /// Does [`crate::ppo::gradient_step`] with all results left on the device.
    pub(super) fn step(
        &mut self,
        nets: &mut PpoNets,
        adam: &mut Adam,
        batch: &Minibatch,
        config: &PpoConfig,
        moment: &UpdateSettings<'_>,
    ) -> Result<(), LearnError> {
        use Metric::{Known, OnDevice};
        let (dist, values) = outputs(nets, &batch.inputs, batch, config, moment)?;
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
        let total_loss = total.clone().inner();
        let grad_norm = adam.step_on_device(nets, total.backward(), moment.lr, config.max_grad_norm);
        let metrics = StepMetrics {
            policy_loss: OnDevice(policy_loss),
            value_loss: OnDevice(value_loss),
            entropy: OnDevice(entropy),
            decoder_kl,
            kl_penalty,
            total_loss: OnDevice(total_loss),
            approx_kl: OnDevice(approx_kl),
            clip_fraction: OnDevice(clip_fraction),
            confidence: Known(batch.teacher.as_ref().map_or(0.0, |teacher| teacher.mean_confidence)),
            augmentation_loss,
            grad_norm: OnDevice(grad_norm),
        };
        let mut numbers = Vec::new();
        self.known.push(metrics.map(|metric| match metric {
            OnDevice(number) => {
                numbers.push(number);
                None
            }
            Known(number) => Some(number),
        }));
        self.numbers.push(Tensor::cat(numbers, 0));
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
