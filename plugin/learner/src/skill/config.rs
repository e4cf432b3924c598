//! Settings of the skill model.

use crate::{
    ActionSpace, Actions, Augmentation, EntityBlock, LearnError, ObsKind, SettingError,
    nn::CnnKind,
    policy::{EntityKind, StdKind},
    settings,
    settings::{Range, Reader, Settings, is_off},
    skill::WindowRule,
};
use serde::{Deserialize, Serialize};

/// The reduction of the loss terms.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reduction {
    /// NLL: sum over time, mean over the batch; KL: mean over the batch. No clamps.
    Standard,
    /// The released code: NLL: mean over time and batch; KL: sum over the batch; both clamped to ±100, without a
    /// gradient beyond. For replication only.
    Legacy,
}

settings! {
    /// Hyperparameters of the skill model.
    ///
    /// The defaults are the paper's, with an encoder small enough for a CPU (the paper's is 200 wide with 4 layers).
    #[derive(Clone, PartialEq, Debug)]
    pub struct SkillConfig in "skills", read by Reader::WITH_SKILLS;

    /// Dimensions of z.
    latent: usize = 8, in Range::COUNT;
    /// Steps in a window.
    window: usize = 10, in Range::PASSES;
    /// The rule by which windows are cut.
    windows: WindowRule = WindowRule::default();
    /// β, the weight of the KL term.
    beta: f64 = 0.1, in Range::WEIGHT;
    /// Hidden layers of the decoder and of the prior, ReLU.
    hidden: Vec<usize> = vec![200, 200], in Range::COUNT;
    /// The way in which the three networks read sets of things: as `ppo.entities`. A policy that starts as a copy of the
    /// decoder has its encoder. SAC reads values only, so with it the slots are always `Flat`.
    entities: EntityKind = EntityKind::default(), in Range::COUNT, off "is_off";
    /// Width of the encoder's three per-step layers over vectors.
    encoder_hidden: usize = 64, in Range::COUNT;
    /// The convolutions over images; each of the three networks has its own. Not used for vectors.
    cnn: CnnKind = CnnKind::default(), in Range::COUNT;
    /// The encoder's representation of discrete actions.
    action_input: ActionInput = ActionInput::default();
    /// Width of each direction of the encoder's recurrent layers.
    gru_hidden: usize = 64, in Range::COUNT;
    /// Number of the encoder's recurrent layers.
    gru_layers: usize = 1, in Range::COUNT;
    /// Learning rate of Adam.
    lr: f64 = 3e-4, in Range::RATE;
    /// True if the rate decreases linearly to 0 over all epochs, so that the last batches settle the result.
    anneal_lr: bool = false, off "is_off";
    /// Windows per batch.
    batch: usize = 50, in Range::COUNT;
    /// Passes over the demonstrations.
    epochs: usize = 100, in Range::PASSES;
    /// Bound of the gradient's Euclidean norm over all parameters.
    max_grad_norm: f64 = 0.5, in Range::RATE;
    /// True if the decoder sees tanh(z) and not z.
    tanh_latent: bool = true;
    /// Weight of the mean Euclidean norm of the decoder's latent.
    latent_reg: f64 = 0.0, in Range::WEIGHT;
    /// The source of the prior's standard deviation. By `State` it can be narrow where demonstrators agree and wide
    /// where they do not.
    prior_std: StdKind = StdKind::State;
    /// The source of the decoder's standard deviation σ; only for continuous actions.
    ///
    /// σ starts at 1 and becomes the spread of the demonstrators' actions in a state under a skill, their noise
    /// included. Of a demonstrator's Gaussian noise of deviation n it keeps n, or less where actions were clipped. A
    /// policy that starts as a copy of the decoder explores with this σ and learns it further.
    ///
    /// By `Vector` a dimension has one σ for all states. It decreases by a factor of about exp(-lr) a batch at most,
    /// so short runs leave it too large. By `State` a state has its own, in e⁻¹⁰..e², which is found sooner. Where
    /// demonstrators always act alike (a bot without noise, or at the end of its range), only that bound keeps it
    /// from shrinking: gradients grow with 1/σ, and a copy of such a decoder hardly explores.
    decoder_std: StdKind = StdKind::Vector;
    /// Share of the demonstrator's discrete actions that were replaced by uniformly random ones, from the recording's
    /// header; 0 to imitate the noise too, as the paper does. Must be 0 for continuous actions: the Gaussian noise in
    /// their recordings becomes part of σ (see `skills.decoder_std`).
    action_noise: f64 = 0.0, in Range::Below(0.0, 1.0);
    /// The reduction of the loss terms.
    reduction: Reduction = Reduction::Standard;
    /// True if the three networks see normalised observations, for games whose values differ in scale (a position in
    /// metres beside an angle in radians): clip((x - mean) / deviation, ±10). Mean and deviation of each value are
    /// computed once, over all demonstrations, and never change. Constant values are only centred. A policy that is
    /// tied to the skill model sees the same numbers, and so does its critic. Vectors only.
    norm_obs: bool = false;
    /// Image augmentations for training, all of them applied to each image.
    augment: Vec<Augmentation> = Vec::new(), such as "[Translate(1)]", off "is_off";
    /// Decoupled weight decay of Adam: a weight loses lr · weight_decay of itself in each step.
    weight_decay: f64 = 0.0, in Range::Weight(1e30), off "is_off";
    /// Weight of the squared error with which the trunks of decoder and prior predict the game's state vector from a
    /// picture. It is the mean over the vector's numbers, each normalised over the demonstrations, summed over a
    /// window as the NLL is. The trunks then recognise the state on levels that were never recorded, too. Pictures
    /// only.
    state_weight: f64 = 0.0, in Range::WEIGHT, off "is_off";
    /// Share of the episodes that is held out of training, and measured after each epoch.
    held_out: f64 = 0.0, in Range::Within(0.0, 0.9), off "is_off";
    /// Epochs without a lower NLL on held-out episodes after which training stops. The model is then that of the best
    /// epoch. `None` trains for all epochs, and the model is that of the last.
    patience: Option<usize> = None, in Range::COUNT, off "is_off";
}

impl SkillConfig {
    /// Returns whether the trunks learn to predict the game's state, too: with a [`Self::state_weight`].
    pub fn tells_states(&self) -> bool {
        self.state_weight > 0.0
    }

    /// Checks that these settings are possible.
    ///
    /// # Errors
    /// [`LearnError::Setting`] names the first impossible setting.
    pub fn validate(&self) -> Result<(), LearnError> {
        self.check_ranges()?;
        if self.patience.is_some() && self.held_out == 0.0 {
            let why = "needs demonstrations that are kept apart: set `skills.held_out`, such as to 0.05";
            return Err(SettingError::new("skills.patience", why).into());
        }
        Ok(())
    }

    /// Returns the learning rate after this many epochs, with the fraction of the running one.
    pub fn lr_at(&self, epochs_done: f64) -> f64 {
        match self.anneal_lr {
            true => self.lr * (1.0 - epochs_done / self.epochs as f64).max(0.0),
            false => self.lr,
        }
    }

    /// Checks that a model of these settings can learn actions of `space`.
    ///
    /// # Errors
    /// [`LearnError::Setting`] if `skills.action_noise` is not 0 for continuous actions.
    pub fn check_space(&self, space: ActionSpace) -> Result<(), LearnError> {
        match space {
            ActionSpace::Continuous(_) | ActionSpace::Mixed(_) if self.action_noise > 0.0 => {
                let why = format!(
                    "is the share of discrete actions that were replaced and must be 0 for {space}, not {}: the \
                     noise on those becomes part of the decoder",
                    self.action_noise
                );
                Err(SettingError::new("skills.action_noise", why).into())
            }
            _ => Ok(()),
        }
    }

    /// Checks that a model of these settings can see `observation`s.
    ///
    /// # Errors
    /// [`LearnError::Setting`] if images are to be normalised, or vectors are to be augmented or used to predict the
    /// state.
    pub fn check_observation(&self, observation: ObsKind) -> Result<(), LearnError> {
        self.augment.iter().try_for_each(|augmentation| augmentation.check("skills.augment", &observation))?;
        EntityBlock::check_all(self.entities.blocks(), &observation)?;
        match observation {
            ObsKind::Image(_) if self.norm_obs => {
                let why = "is for vectors: the pixels of images are divided by 255 instead";
                Err(SettingError::new("skills.norm_obs", why).into())
            }
            ObsKind::Vector(_) if self.tells_states() => {
                let why = "is for pictures: a policy that sees the state vector need not learn to predict it";
                Err(SettingError::new("skills.state_weight", why).into())
            }
            _ => Ok(()),
        }
    }
}

/// The encoder's representation of a discrete action, or of each of several choices. Numbers are read unchanged.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum ActionInput {
    /// One number per choice: 1 for the one taken, else 0.
    #[default]
    OneHot,
    /// The number of the choice divided by that of the last one, in 0..1 (the paper's released code for CoinRun).
    ScaledIndex,
}

impl ActionInput {
    /// Returns the width of an action of `space`.
    pub fn width(self, space: ActionSpace) -> usize {
        match (self, space) {
            (Self::ScaledIndex, ActionSpace::Discrete(_)) => 1,
            (Self::ScaledIndex, ActionSpace::Mixed(space)) => space.choices.sizes().len() + space.numbers,
            _ => space.dim(),
        }
    }

    /// Returns `actions` of `space` as the encoder reads them, row-major, `[n, width]`.
    ///
    /// # Errors
    /// [`LearnError::Action`] names the first action that is not in `space`.
    pub fn encode(self, actions: &Actions, space: ActionSpace) -> Result<Vec<f32>, LearnError> {
        space.check(actions)?;
        let scaled = |option: u32, size: usize| (f64::from(option) / size.saturating_sub(1).max(1) as f64) as f32;
        Ok(match (actions, self) {
            (Actions::Continuous { values, .. }, _) => values.clone(),
            (Actions::Discrete(values), Self::OneHot) => {
                let dim = space.dim();
                let mut out = vec![0.0; values.len() * dim];
                for (row, &a) in values.iter().enumerate() {
                    out[row * dim + a as usize] = 1.0;
                }
                out
            }
            (Actions::Discrete(values), Self::ScaledIndex) => values.iter().map(|&a| scaled(a, space.dim())).collect(),
            (Actions::Mixed { .. }, form) => {
                let choices = space.choices();
                let mut out = Vec::with_capacity(actions.len() * self.width(space));
                for row in 0..actions.len() {
                    for (at, &option) in choices.ranges().zip(actions.chosen(row)) {
                        match form {
                            Self::OneHot => {
                                out.extend((0..at.len()).map(|i| f32::from(u8::from(i == option as usize))))
                            }
                            Self::ScaledIndex => out.push(scaled(option, at.len())),
                        }
                    }
                    out.extend_from_slice(actions.vector(row));
                }
                out
            }
        })
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
        assert!(error.expect_err("an untrained model").to_string().contains("`skills.epochs` must be at least 1"));
    }

    #[test]
    fn each_form_by_hand() {
        let encode = |input: ActionInput, actions, space| input.encode(actions, space).expect("in the space");
        let (space, actions) = (ActionSpace::Discrete(3), Actions::Discrete(vec![2, 1]));
        assert_eq!(encode(ActionInput::OneHot, &actions, space), [0.0, 0.0, 1.0, 0.0, 1.0, 0.0]);
        assert_eq!(encode(ActionInput::ScaledIndex, &actions, space), [1.0, 0.5]);
        let outside = ActionInput::OneHot.encode(&Actions::Discrete(vec![0, 3]), space);
        assert!(matches!(outside, Err(LearnError::Action(text)) if text.contains("row 1")));
        let (space, actions) = (ActionSpace::Continuous(2), Actions::Continuous { dim: 2, values: vec![0.3, -2.0] });
        for input in [ActionInput::OneHot, ActionInput::ScaledIndex] {
            assert_eq!(input.width(space), 2);
            assert_eq!(encode(input, &actions, space), [0.3, -2.0]);
        }
        assert_eq!(encode(ActionInput::ScaledIndex, &Actions::Discrete(vec![0]), ActionSpace::Discrete(1)), [0.0]);
    }
}
