//! Memory that a training needs, checked before it starts.
//!
//! The sum is a lower bound: an experiment that is refused here could not have run.

#[cfg(test)]
mod tests;

use crate::experiment::{Experiment, ExperimentError, LearnerKind, checks::refuse};
use playbot_harness::{
    arrangement::Arrangement,
    game::Game,
    machine::{MemoryPart, ThreadLimit, check_parts, free_memory, product},
    sensors::GameSensors,
};
use playbot_learner::{ActionSpace, ImageShape, ObsKind, nn::CnnKind};

impl Experiment {
    /// Checks that the data of a training fit into the free memory. These are networks with their gradients and
    /// moments, minibatches, rollouts, the replay buffer of SAC, and Worlds. Each World plays on a thread of its own.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Memory`] with the largest part and the keys to lower, [`ExperimentError::Value`] if there are
    /// more Worlds than the system starts threads.
    pub fn check_memory(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        self.check_memory_within(game, &Room { memory: free_memory(), threads: ThreadLimit::now() })
    }

    /// Checks that the data of learning skills fit into the free memory, as [`check_memory`](Self::check_memory) does.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Memory`] with the largest part and the keys to lower.
    pub fn check_skill_memory(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        Ok(check_parts(&self.skill_parts(&self.sizes(game)), free_memory())?)
    }

    fn check_memory_within(&self, game: &dyn Game, room: &Room) -> Result<(), ExperimentError> {
        let sizes = self.sizes(game);
        // Skills are learned before, and their moments are dropped.
        if self.algorithm.needs_skills() {
            check_parts(&self.skill_parts(&sizes), room.memory)?;
        }
        if !self.algorithm.is_trained() {
            return Ok(());
        }
        let arrangement = Arrangement::new(game, self.arenas, self.worlds);
        let mut parts = vec![MemoryPart::of_worlds(arrangement), self.rollout_part(&sizes)];
        match self.algorithm.learner() {
            LearnerKind::Ppo => parts.extend(self.ppo_parts(&sizes)),
            LearnerKind::Sac => parts.extend(self.sac_parts(&sizes)),
        }
        check_parts(&parts, room.memory)?;
        self.check_threads(arrangement, room.threads)
    }

    /// Checks that each World gets a thread of its own, since Worlds wait for one another.
    fn check_threads(&self, arrangement: Arrangement, limit: ThreadLimit) -> Result<(), ExperimentError> {
        let (worlds, ThreadLimit { most, whose }) = (arrangement.worlds, limit);
        if worlds == 1 || u64::from(worlds) <= most {
            return Ok(());
        }
        let why =
            format!("{worlds} Worlds play on a thread each, and {whose} leaves room for {most} threads: lower it");
        // If a game allows few arenas in a World, the arenas decide how many Worlds there are.
        match worlds == self.worlds {
            true => refuse("worlds", worlds, why),
            false => refuse("arenas", self.arenas, why),
        }
    }

    fn sizes(&self, game: &dyn Game) -> Sizes {
        let kind: ObsKind = self.observation_config().obs_kind(game);
        let numbers = kind.numbers() as u64;
        let (action, outputs) = match game.actions() {
            ActionSpace::Discrete(choices) => (choices as u64, choices as u64),
            ActionSpace::Continuous(dims) => (dims as u64, 2 * dims as u64),
        };
        let (image, observation, inputs) = match kind {
            ObsKind::Image(shape) => (Some(shape), numbers, 0),
            ObsKind::Vector(_) => (None, numbers.saturating_mul(4), numbers),
        };
        Sizes { image, observation, inputs, action, outputs }
    }

    fn rollout_part(&self, sizes: &Sizes) -> MemoryPart {
        let (arenas, steps, observation) = (u64::from(self.arenas), self.rollout_steps() as u64, sizes.observation);
        let learner = self.algorithm.learner().key();
        let image = if sizes.image.is_some() { ", `image.width`, `image.height` or `image.stack`" } else { "" };
        MemoryPart {
            what: format!("rollouts of {arenas} arenas × {steps} steps × {observation} bytes"),
            bytes: product(&[arenas, steps, observation]),
            keys: format!("`arenas`, `{learner}.num_steps`{image}"),
        }
    }

    fn ppo_parts(&self, sizes: &Sizes) -> Vec<MemoryPart> {
        let inputs = sizes.inputs.saturating_add(self.latent());
        let (actor, key) = match self.algorithm.needs_skills() && self.score.init_from_decoder {
            true => (&self.skills.hidden, "`skills.hidden` or `ppo.hidden`"),
            false => (&self.ppo.hidden, "`ppo.hidden`"),
        };
        let numbers = layers(inputs, actor, sizes.outputs).saturating_add(layers(inputs, &self.ppo.hidden, 1));
        let rows = product(&[u64::from(self.arenas), self.ppo.num_steps as u64]) / (self.ppo.minibatches as u64).max(1);
        let row = sizes.observation.saturating_add(product(&[4, sum(actor).saturating_add(sum(&self.ppo.hidden))]));
        let mut parts = vec![networks(numbers, key), minibatch(rows, row, "`ppo.hidden`; or more `ppo.minibatches`")];
        parts.extend(sizes.convolutions(&self.ppo.cnn, 1, "`ppo.cnn`"));
        parts
    }

    fn sac_parts(&self, sizes: &Sizes) -> [MemoryPart; 3] {
        let sac = match self.algorithm.trains_on_demos() {
            true => self.rlpd.over(self.sac.clone()),
            false => self.sac.clone(),
        };
        let inputs = sizes.inputs.saturating_add(self.latent());
        let critic = layers(inputs.saturating_add(sizes.action), &sac.hidden, 1);
        let numbers = layers(inputs, &sac.hidden, sizes.outputs).saturating_add(product(&[critic, sac.critics as u64]));
        let transitions = (sac.buffer as u64).min(self.steps);
        let row = product(&[2, sizes.observation]).saturating_add(product(&[4, sum(&sac.hidden), sac.critics as u64]));
        let buffer = MemoryPart {
            what: format!(
                "the slots of a replay buffer of {transitions} transitions × 2 × {} bytes",
                sizes.observation
            ),
            bytes: product(&[transitions, 2, sizes.observation]),
            keys: "`sac.buffer`".to_owned(),
        };
        let key = if self.algorithm.trains_on_demos() {
            "`sac.hidden`, `rlpd.critics`"
        } else {
            "`sac.hidden`, `sac.critics`"
        };
        let row_keys = format!("`sac.batch`, {key}");
        [networks(numbers, key), minibatch(sac.batch as u64, row, &row_keys), buffer]
    }

    fn skill_parts(&self, sizes: &Sizes) -> Vec<MemoryPart> {
        let skills = &self.skills;
        let (latent, gru, encoder) = (skills.latent as u64, skills.gru_hidden as u64, skills.encoder_hidden as u64);
        let first = layers(sizes.inputs.saturating_add(sizes.action), &[skills.encoder_hidden], 0);
        let between = product(&[3, gru, gru.saturating_add(gru)]);
        let recurrent = product(&[3, gru, encoder.saturating_add(gru)])
            .saturating_add(product(&[between, (skills.gru_layers as u64).saturating_sub(1)]));
        let prior = layers(sizes.inputs, &skills.hidden, 2 * latent.min(u64::MAX / 2));
        let decoder = layers(sizes.inputs.saturating_add(latent), &skills.hidden, sizes.outputs);
        let numbers = [first, recurrent, product(&[2, latent, gru]), prior, decoder];
        let row = sizes
            .observation
            .saturating_add(product(&[4, gru, skills.gru_layers as u64]))
            .saturating_add(4 * encoder.min(u64::MAX / 4));
        let rows = product(&[skills.batch as u64, skills.window as u64]);
        // Encoder, decoder and prior have convolutions of their own.
        let convolutions = sizes.convolutions(&skills.cnn, 3, "`skills.cnn`");
        let keys =
            "`skills.hidden`, `skills.encoder_hidden`, `skills.gru_hidden`, `skills.gru_layers`, `skills.latent`";
        let numbers = numbers.iter().fold(0u64, |sum, part| sum.saturating_add(*part));
        let row_keys =
            "`skills.batch`, `skills.window`, `skills.encoder_hidden`, `skills.gru_hidden` or `skills.gru_layers`";
        [networks(numbers, keys), minibatch(rows, row, row_keys)].into_iter().chain(convolutions).collect()
    }

    /// Returns the numbers of a skill that the policy reads.
    fn latent(&self) -> u64 {
        if self.algorithm.needs_skills() { self.skills.latent as u64 } else { 0 }
    }
}

/// Resources that the machine has left.
struct Room {
    /// Bytes of memory.
    memory: u64,
    threads: ThreadLimit,
}

/// Bytes of a learned number: the number, its gradient and the two moments of Adam.
const LEARNED: u64 = 16;

/// Sizes of the game's observations and actions.
struct Sizes {
    image: Option<ImageShape>,
    /// Bytes of an observation.
    observation: u64,
    /// Numbers of an observation that a layer reads; 0 for images, which are read by convolutions.
    inputs: u64,
    /// Numbers of an action, and numbers of its distribution.
    action: u64,
    outputs: u64,
}

impl Sizes {
    /// Returns the memory of the convolutions of so many networks, where there are pictures.
    fn convolutions(&self, cnn: &CnnKind, networks: u64, key: &str) -> Option<MemoryPart> {
        let numbers = convolution_numbers(cnn, self.image?);
        Some(MemoryPart {
            what: format!("convolutions of {networks} × {numbers} numbers with gradients and moments"),
            bytes: product(&[numbers, networks, LEARNED]),
            keys: key.to_owned(),
        })
    }
}

fn networks(numbers: u64, keys: &str) -> MemoryPart {
    let what = format!("networks of {numbers} numbers with gradients and moments");
    MemoryPart { what, bytes: product(&[numbers, LEARNED]), keys: keys.to_owned() }
}

fn minibatch(rows: u64, row: u64, keys: &str) -> MemoryPart {
    let what = format!("minibatches of {rows} rows × {row} bytes");
    MemoryPart { what, bytes: product(&[rows, row]), keys: keys.to_owned() }
}

/// Returns the least number of weights of a convolutional network.
fn convolution_numbers(cnn: &CnnKind, image: ImageShape) -> u64 {
    // Pixels of a kernel and convolutions in the residual blocks of a stage of IMPALA's network, and output channels of
    // the last convolution of the other one.
    const KERNEL: u64 = 9;
    const WITHIN: u64 = 4;
    const LAST: u64 = 64;
    match cnn {
        CnnKind::Impala { channels, feature } => {
            let (mut numbers, mut inputs) = (0u64, image.channels as u64);
            let (mut height, mut width) = (image.height as u64, image.width as u64);
            for outputs in channels.iter().map(|outputs| *outputs as u64) {
                let first = product(&[KERNEL, inputs, outputs]);
                numbers = numbers.saturating_add(first).saturating_add(product(&[WITHIN, KERNEL, outputs, outputs]));
                (inputs, height, width) = (outputs, height.div_ceil(2), width.div_ceil(2));
            }
            numbers.saturating_add(product(&[inputs, height, width, *feature as u64]))
        }
        CnnKind::Nature { feature } => product(&[LAST, *feature as u64]),
    }
}

/// Returns the numbers of a network of dense layers.
fn layers(inputs: u64, hidden: &[usize], outputs: u64) -> u64 {
    let (mut numbers, mut width) = (0u64, inputs);
    for next in hidden.iter().map(|width| *width as u64).chain([outputs]) {
        numbers = numbers.saturating_add(product(&[width.saturating_add(1), next]));
        width = next;
    }
    numbers
}

fn sum(widths: &[usize]) -> u64 {
    widths.iter().fold(0, |sum, width| sum.saturating_add(*width as u64))
}
