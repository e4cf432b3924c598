//! An update on a graphics card: the rollout is sent once, and the numbers of all steps are read back together.

use super::augmented::augmentation_loss;
use super::batch::Batch;
use super::objective::{PpoBatch, PpoLoss};
use super::step::{Losses, Minibatch, Moment, outputs};
use super::{PpoConfig, PpoNets, StepMetrics};
use crate::nn::{ActionBatch, Adam, Dist, PackedPixels, check_loss, host, matrix, vector};
use crate::policy::NetInput;
use crate::score::TeacherBatch;
use crate::{LearnError, ObsKind, ObsSlice};
use burn::tensor::{Device, Int, Tensor, TensorData};

/// A whole rollout on a device.
pub(super) struct SentRollout<'a> {
    batch: &'a Batch<'a>,
    states: States,
    left: Option<Tensor<1>>,
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

/// As [`super::normalize_advantages`].
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

/// What the steps of an update report, still on the device.
#[derive(Default)]
pub(super) struct Reports {
    numbers: Vec<Tensor<1>>,
    confidences: Vec<f64>,
}

/// Numbers of a step's report.
const NUMBERS: usize = 10;

impl Reports {
    /// As [`super::gradient_step`], with everything left on the device.
    pub(super) fn step(
        &mut self,
        nets: &mut PpoNets,
        adam: &mut Adam,
        batch: &Minibatch,
        config: &PpoConfig,
        moment: &Moment<'_>,
    ) -> Result<(), LearnError> {
        let (dist, values) = outputs(nets, &batch.inputs, batch, config, moment)?;
        let augmentation = augmentation_loss(nets, &dist, &values, batch, config, moment)?;
        let Losses { ppo, penalty, mut total } = Losses::of(&dist, values, batch, config, moment)?;
        let PpoLoss { policy_loss, value_loss, entropy, log_ratio } = ppo;
        let zero = || Tensor::zeros([1], &log_ratio.device().inner());
        let (kl, term) = match penalty {
            Some(penalty) => (penalty.kl.mean().inner(), penalty.term.inner()),
            None => (zero(), zero()),
        };
        let log_ratio = log_ratio.clone().inner();
        let moved = log_ratio.clone().exp() - 1.0;
        let approx_kl = (moved.clone() - log_ratio).mean();
        let clipped = moved.abs().greater_elem(config.clip).float().mean();
        let losses = [policy_loss, value_loss, entropy].map(Tensor::inner);
        let augmentation = match augmentation {
            Some(loss) => {
                total = total + loss.clone() * config.augment_coef;
                loss.inner()
            }
            None => zero(),
        };
        let whole = total.clone().inner();
        let norm = adam.step_on_device(nets, total.backward(), moment.lr, config.max_grad_norm);
        let [policy_loss, value_loss, entropy] = losses;
        let all = vec![policy_loss, value_loss, entropy, kl, term, whole, approx_kl, clipped, norm, augmentation];
        self.numbers.push(Tensor::cat(all, 0));
        self.confidences.push(batch.teacher.as_ref().map_or(0.0, |teacher| teacher.mean_confidence));
        Ok(())
    }

    /// The sum over all steps, read at once; `before` optimizer steps were made before the first.
    ///
    /// # Errors
    /// [`LearnError::NotFinite`] or [`LearnError::Exploded`] for the first step whose losses or gradient ran away; which
    /// parameter it was is not known here. Weights that the last step spoils show in the next update.
    pub(super) fn sum(self, before: u64) -> Result<StepMetrics, LearnError> {
        let mut sum = StepMetrics::default();
        let numbers = host(Tensor::cat(self.numbers, 0))?;
        for (step, (row, confidence)) in numbers.chunks_exact(NUMBERS).zip(self.confidences).enumerate() {
            let steps = before + step as u64;
            let names = ["policy_loss", "value_loss", "entropy", "decoder_kl", "kl_penalty", "total_loss"];
            for (name, value) in names.into_iter().zip(row) {
                check_loss(name, *value, steps)?;
            }
            let number = |at: usize| f64::from(row[at]);
            if !number(8).is_finite() {
                return Err(LearnError::NotFinite { tensor: "gradient".to_owned(), steps: Some(steps) });
            }
            let step = StepMetrics {
                policy_loss: number(0),
                value_loss: number(1),
                entropy: number(2),
                decoder_kl: number(3),
                kl_penalty: number(4),
                total_loss: number(5),
                approx_kl: number(6),
                clip_fraction: number(7),
                grad_norm: number(8),
                augmentation_loss: number(9),
                confidence,
            };
            sum.add(&step, 1.0);
        }
        Ok(sum)
    }
}
