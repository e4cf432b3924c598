//! Settings of the skill model.

use super::{ActionInput, WindowRule};
use crate::error::brief_number;
use crate::nn::CnnKind;
use crate::policy::StdKind;
use crate::{ActionSpace, Augmentation, LearnError, ObsKind};
use serde::{Deserialize, Serialize};

/// How the terms of the loss are summed.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reduction {
    /// NLL: sum over time, mean over the batch; KL: mean over the batch. No clamps.
    Standard,
    /// The released code: NLL: mean over time and batch; KL: sum over the batch; both clamped to ±100, without a
    /// gradient beyond. For replication only.
    Legacy,
}

/// Hyperparameters of the skill model.
///
/// The defaults are the paper's, with an encoder small enough for a CPU (the paper's is 200 wide with 4 layers).
#[derive(Serialize, Deserialize, Clone, PartialEq, Debug)]
#[serde(deny_unknown_fields, default)]
pub struct SkillConfig {
    /// Dimensions of z.
    pub latent: usize,
    /// Steps in a window.
    pub window: usize,
    /// Where windows are cut.
    pub windows: WindowRule,
    /// β, the weight of the KL term.
    pub beta: f64,
    /// Hidden layers of the decoder and of the prior, ReLU.
    pub hidden: Vec<usize>,
    /// Width of the encoder's three per-step layers over vectors.
    pub encoder_hidden: usize,
    /// The convolutions over images; each of the three networks has its own. Not used for vectors.
    pub cnn: CnnKind,
    /// How the encoder reads discrete actions.
    pub action_input: ActionInput,
    /// Width of each direction of the encoder's recurrent layers.
    pub gru_hidden: usize,
    /// Number of the encoder's recurrent layers.
    pub gru_layers: usize,
    /// Learning rate of Adam.
    pub lr: f64,
    /// Whether the rate falls in a line to nothing over all epochs, so that the last batches settle what the first have
    /// found.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub anneal_lr: bool,
    /// Windows per batch.
    pub batch: usize,
    /// Passes over the demonstrations.
    pub epochs: usize,
    /// Bound of the gradient's Euclidean norm over all parameters.
    pub max_grad_norm: f64,
    /// Whether the decoder sees tanh(z) and not z.
    pub tanh_latent: bool,
    /// Weight of the mean Euclidean norm of the decoder's latent.
    pub latent_reg: f64,
    /// How the prior's standard deviation is made. By state, so that it can be narrow where players agree and wide
    /// where they do not.
    pub prior_std: StdKind,
    /// How the decoder's standard deviation σ is made; only for continuous actions.
    ///
    /// σ starts at 1 and becomes the spread of what players did in a state under a skill, their noise included: of a
    /// demonstrator's Gaussian noise of deviation n it keeps n, or less where actions were clipped. A policy that starts
    /// as a copy of the decoder explores with this σ and learns it further.
    ///
    /// By `Vector` a dimension has one σ for all states. It falls by a factor of about exp(-lr) a batch at most, so that
    /// short trainings leave it too large. By `State` a state has its own, in e⁻¹⁰..e², which is found sooner, but where
    /// players always do the very same (a bot without noise, or at the end of its range) nothing but that bound keeps it
    /// from shrinking: gradients grow with 1/σ, and a copy of such a decoder hardly explores.
    pub decoder_std: StdKind,
    /// Share of the demonstrator's discrete actions that were replaced by uniformly random ones, as the recording's
    /// header says; 0 to imitate the noise too, as the paper does. Must be 0 for continuous actions, of whose recordings
    /// the header gives the deviation of Gaussian noise: that becomes part of σ (see `decoder_std`).
    pub action_noise: f64,
    /// How the terms of the loss are summed.
    pub reduction: Reduction,
    /// Whether the three networks see normalised observations, for games whose values differ in scale (a place in metres
    /// beside an angle in radians): clip((x - mean) / deviation, ±10), by the mean and deviation of each value over all
    /// demonstrations, which are computed once and never change. Values that do not vary are centred only. A policy that
    /// is tied to the skill model sees the same numbers, its critic too. Vectors only.
    pub norm_obs: bool,
    /// Changes that are made to images before they are learned from, all of them to each; none if empty.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub augment: Vec<Augmentation>,
    /// Decoupled weight decay of Adam: a weight loses lr · weight_decay of itself in each step.
    #[serde(skip_serializing_if = "is_zero")]
    pub weight_decay: f64,
    /// Weight of the squared error with which the trunks of decoder and prior tell, of a picture, the game's state vector:
    /// the mean over its numbers, each by its mean and deviation over the demonstrations, summed over a window as the NLL
    /// is. What a trunk has learned to see so, it sees on levels that were never recorded. Pictures only.
    #[serde(skip_serializing_if = "is_zero")]
    pub state_weight: f64,
    /// Share of the episodes that is not learned from, but measured after each epoch.
    #[serde(skip_serializing_if = "is_zero")]
    pub held_out: f64,
    /// Epochs without a lower NLL on those after which learning stops; the model is then that of the epoch with the least.
    /// `None` learns for all epochs, and the model is that of the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub patience: Option<usize>,
}

/// Settings that do nothing are not written: files and studies find what was learned before there were any.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde wants it")]
fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

impl Default for SkillConfig {
    fn default() -> Self {
        Self {
            latent: 8,
            window: 10,
            windows: WindowRule::default(),
            beta: 0.1,
            hidden: vec![200, 200],
            encoder_hidden: 64,
            cnn: CnnKind::default(),
            action_input: ActionInput::default(),
            gru_hidden: 64,
            gru_layers: 1,
            lr: 3e-4,
            anneal_lr: false,
            batch: 50,
            epochs: 100,
            max_grad_norm: 0.5,
            tanh_latent: true,
            latent_reg: 0.0,
            prior_std: StdKind::State,
            decoder_std: StdKind::Vector,
            action_noise: 0.0,
            reduction: Reduction::Standard,
            norm_obs: false,
            augment: Vec::new(),
            weight_decay: 0.0,
            state_weight: 0.0,
            held_out: 0.0,
            patience: None,
        }
    }
}

impl SkillConfig {
    /// Whether what networks make of pictures learns to tell the game's state, too: with a [`Self::state_weight`].
    pub fn tells_states(&self) -> bool {
        self.state_weight > 0.0
    }

    /// `Ok` if these settings can work.
    ///
    /// # Errors
    /// [`LearnError::Config`] names the first setting that cannot.
    pub fn validate(&self) -> Result<(), LearnError> {
        let counts = [
            ("latent", self.latent),
            ("window", self.window),
            ("encoder_hidden", self.encoder_hidden),
            ("gru_hidden", self.gru_hidden),
            ("gru_layers", self.gru_layers),
            ("batch", self.batch),
            ("epochs", self.epochs),
            ("hidden", self.hidden.iter().copied().min().unwrap_or(1)),
            ("cnn", self.cnn.smallest()),
        ];
        if let Some((name, _)) = counts.iter().find(|(_, n)| *n == 0) {
            return Err(LearnError::Config(format!("skill {name} must be at least 1")));
        }
        let positive = [("lr", self.lr), ("max_grad_norm", self.max_grad_norm)];
        if let Some((name, x)) = positive.iter().find(|(_, x)| !(*x > 0.0 && x.is_finite())) {
            return Err(LearnError::Config(format!("skill {name} must be positive, not {}", brief_number(*x))));
        }
        if !(0.0..1.0).contains(&self.action_noise) {
            let found = brief_number(self.action_noise);
            return Err(LearnError::Config(format!("skill action_noise must be at least 0 and below 1, not {found}")));
        }
        if !(0.0..=0.9).contains(&self.held_out) {
            let found = brief_number(self.held_out);
            return Err(LearnError::Config(format!("skill held_out must lie in 0..0.9, not {found}")));
        }
        match self.patience {
            Some(0) => return Err(LearnError::Config("skill patience must be at least 1".to_owned())),
            Some(_) if self.held_out == 0.0 => {
                let text =
                    "skill patience needs demonstrations that are kept apart: set skill held_out, such as to 0.05";
                return Err(LearnError::Config(text.to_owned()));
            }
            _ => {}
        }
        let weights = [
            ("beta", self.beta),
            ("latent_reg", self.latent_reg),
            ("weight_decay", self.weight_decay),
            ("state_weight", self.state_weight),
        ];
        if let Some((name, x)) = weights.iter().find(|(_, x)| !(*x >= 0.0 && x.is_finite())) {
            return Err(LearnError::Config(format!("skill {name} must not be negative, but is {}", brief_number(*x))));
        }
        Ok(())
    }

    /// The learning rate after so many epochs, of which the running one counts as far as it has come.
    pub fn lr_at(&self, epochs_done: f64) -> f64 {
        match self.anneal_lr {
            true => self.lr * (1.0 - epochs_done / self.epochs as f64).max(0.0),
            false => self.lr,
        }
    }

    /// `Ok` if a model of these settings can learn actions of `space`.
    ///
    /// # Errors
    /// [`LearnError::Config`] if a share of continuous actions shall have been replaced.
    pub fn check_space(&self, space: ActionSpace) -> Result<(), LearnError> {
        match space {
            ActionSpace::Continuous(_) if self.action_noise > 0.0 => Err(LearnError::Config(format!(
                "skill action_noise is the share of discrete actions that were replaced and must be 0 for continuous \
                 ones, not {}: Gaussian noise on those becomes part of the decoder's standard deviation",
                self.action_noise
            ))),
            _ => Ok(()),
        }
    }

    /// `Ok` if a model of these settings can see `observation`s.
    ///
    /// # Errors
    /// [`LearnError::Config`] if images shall be normalised, or what is no image changed as one or used to tell the state.
    pub fn check_observation(&self, observation: ObsKind) -> Result<(), LearnError> {
        self.augment.iter().try_for_each(|augmentation| augmentation.check("skill augment", &observation))?;
        match observation {
            ObsKind::Image(_) if self.norm_obs => {
                let text = "skill norm_obs is for vectors: the pixels of images are divided by 255 instead";
                Err(LearnError::Config(text.to_owned()))
            }
            ObsKind::Vector(_) if self.tells_states() => {
                let text = "skill state_weight is for pictures: who sees the state vector need not learn to tell it";
                Err(LearnError::Config(text.to_owned()))
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_settings_and_zero_sizes_are_refused() {
        assert!(serde_json::from_str::<SkillConfig>(r#"{"latnet": 4}"#).is_err());
        let config: SkillConfig = serde_json::from_str(r#"{"latent": 4}"#).expect("one setting");
        assert_eq!((config.latent, config.window), (4, 10));
        let error = SkillConfig { batch: 0, ..SkillConfig::default() }.validate();
        assert!(error.expect_err("no windows").to_string().contains("batch"));
        let error = SkillConfig { epochs: 0, ..SkillConfig::default() }.validate();
        assert!(error.expect_err("an untrained model").to_string().contains("epochs must be at least 1"));
    }
}
