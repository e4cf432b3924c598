//! Checks of an experiment, alone, against its game, and against the machine's memory.

#[cfg(test)]
mod memory_tests;

use crate::{
    Algorithm,
    experiment::{Experiment, LearnerKind},
};
use playbot_harness::{
    game::Game,
    held_out::HeldOut,
    machine::{MemoryError, MemoryPart, ThreadLimit, check_parts, free_memory, product},
    mode::ModeError,
    sensors::GameSensors,
    split::LevelSplit,
    worlds::Arrangement,
};
use playbot_learner::{
    ActionSpace, Augmentation, Curiosity, HasExitCode, ImageShape, LearnError, ObsKind, PriorKind, SettingError,
    SkillDraw, TimeLimit, nn::CnnKind, settings::Settings,
};
use std::path::Path;
use thiserror::Error;

/// Most steps of one rollout, over all arenas.
const MOST_ROWS: u64 = 1 << 40;

impl Experiment {
    /// Checks the ranges of all settings and the relations between them.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub fn check(&self) -> Result<(), ExperimentError> {
        // Level 0 may be a game's only one: `check_levels` knows.
        let may_be_only = self.train == self.test && self.train.last == 0;
        if self.train.overlaps(&self.test) && !may_be_only {
            return Err(ExperimentError::Overlap { train: self.train.clone(), test: self.test.clone() });
        }
        let own = [
            self.check_ranges(),
            self.eval.check_ranges(),
            self.imitation.check_ranges(),
            self.checkpoints.check_ranges(),
            self.study.check_ranges(),
        ];
        let of_levels = [self.curriculum.check_ranges(), self.levels.check_ranges(), self.self_play.check_ranges()];
        own.into_iter().chain(of_levels).collect::<Result<(), _>>().map_err(out_of_range)?;
        let of_image =
            |error| ExperimentError::Settings { key: Some("image".to_owned()), words: format!("`image`: {error}") };
        self.image.check().map_err(of_image)?;
        self.skills.validate().map_err(settings)?;
        self.score.validate().map_err(settings)?;
        self.sac.validate().map_err(settings)?;
        self.ppo_config().validate().map_err(settings)?;
        self.spirl.validate().map_err(settings)?;
        self.rlpd.validate().map_err(settings)?;
        self.check_rollout()?;
        self.check_lessons()?;
        self.check_self_play()?;
        if self.algorithm.learns_from_demos() {
            self.recordings()?;
        }
        let by_sac = self.algorithm.is_trained() && self.algorithm.learner() == LearnerKind::Sac;
        if by_sac && self.observation_config().is_image() {
            let why = format!("{} learns from vectors only; with PPO pictures can be learned from", self.algorithm);
            return refuse("observation", format!("{:?}", self.observation), why);
        }
        self.check_normalisers()?;
        self.check_end_of_penalty()?;
        self.check_skill_draws()?;
        self.check_batches()
    }

    /// Returns the path of the recordings.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::NoDemos`] if none are named.
    pub fn recordings(&self) -> Result<&Path, ExperimentError> {
        self.demos.as_deref().ok_or(ExperimentError::NoDemos)
    }

    /// Checks the normalisers here, since the learner would refuse them only after its skills are learned.
    fn check_normalisers(&self) -> Result<(), ExperimentError> {
        if self.skills.norm_obs && self.observation_config().is_image() {
            return refuse("skills.norm_obs", true, "is for vectors; the pixels of images are divided by 255 instead");
        }
        let (key, running) = match self.algorithm.learner() {
            LearnerKind::Ppo => ("ppo.norm_obs", self.ppo.norm_obs),
            LearnerKind::Sac => ("sac.norm_obs", self.sac.norm_obs),
        };
        if !(running && self.algorithm.needs_skills() && self.algorithm.is_trained()) {
            return Ok(());
        }
        if self.skills.norm_obs {
            return refuse(
                key,
                true,
                "with `skills.norm_obs` the policy sees through the frozen normaliser of its skills",
            );
        }
        if self.score.init_from_decoder || self.algorithm.learns_prior() {
            let why = "a policy that starts as a copy of decoder or prior must see what they saw; set \
                       `skills.norm_obs` instead, which normalises for both";
            return refuse(key, true, why);
        }
        Ok(())
    }

    /// Checks that only SCORE-PPO, or a decoder of SPiRL that goes on learning, has a falling penalty.
    fn check_end_of_penalty(&self) -> Result<(), ExperimentError> {
        let Some(end) = self.score.kl_coef_end else { return Ok(()) };
        let why = match self.algorithm {
            Algorithm::ScoreSac => "with SAC the penalty keeps its weight, `score.kl_coef`; leave it out, or take PPO",
            Algorithm::SpirlPpo | Algorithm::SpirlSac if !self.spirl.learn_decoder => {
                "the decoder stays as it is and pays no penalty; leave it out, or set `spirl.learn_decoder`"
            }
            Algorithm::ScorePpo | Algorithm::SpirlPpo | Algorithm::SpirlSac if !self.score.kl => {
                "there is no penalty that could end, since `score.kl` is false; leave it out"
            }
            _ => return Ok(()),
        };
        refuse("score.kl_coef_end", end, why)
    }

    fn check_batches(&self) -> Result<(), ExperimentError> {
        let (arenas, worlds) = (u64::from(self.arenas), u64::from(self.worlds));
        if !arenas.is_multiple_of(worlds) {
            let why = format!("must divide `arenas` = {arenas}; {} does", nearest_divisor(arenas, worlds));
            return refuse("worlds", worlds, why);
        }
        // A decoder that goes on learning does so by PPO, even if SAC learns the skills above it.
        match self.algorithm.learner() {
            LearnerKind::Sac if !(self.algorithm == Algorithm::SpirlSac && self.spirl.learn_decoder) => Ok(()),
            _ => self.check_minibatches(arenas),
        }
    }

    /// Checks that a rollout comes to an end.
    fn check_rollout(&self) -> Result<(), ExperimentError> {
        let rows = u64::from(self.arenas).checked_mul(self.rollout_steps() as u64);
        if rows.is_some_and(|rows| rows <= MOST_ROWS) {
            return Ok(());
        }
        let key = match self.algorithm.learner() {
            LearnerKind::Ppo => "ppo.num_steps",
            LearnerKind::Sac => "sac.num_steps",
        };
        let why =
            format!("with `arenas` = {} that is more than {MOST_ROWS} steps before anything is learned", self.arenas);
        refuse(key, self.rollout_steps(), why)
    }

    /// Checks that PPO can split a rollout into minibatches.
    fn check_minibatches(&self, arenas: u64) -> Result<(), ExperimentError> {
        let (batch, minibatches) = (arenas * self.ppo.num_steps as u64, self.ppo.minibatches as u64);
        if !batch.is_multiple_of(minibatches) {
            let (steps, near) = (self.ppo.num_steps, nearest_divisor(batch, minibatches));
            let why = format!("must divide `arenas` × `ppo.num_steps` = {arenas} × {steps} = {batch}; {near} does");
            return refuse("ppo.minibatches", minibatches, why);
        }
        Ok(())
    }
}

/// Returns the divisor of `n` nearest to `wanted`, the larger one of two.
fn nearest_divisor(n: u64, wanted: u64) -> u64 {
    let distance = |divisor: &u64| (divisor.abs_diff(wanted), u64::MAX - divisor);
    let small = (1..).take_while(|d| d * d <= n).filter(|d| n.is_multiple_of(*d));
    small.flat_map(|d| [d, n / d]).min_by_key(distance).unwrap_or(1)
}

impl Experiment {
    /// Checks the settings that depend on the game's levels, actions and observations, before hours are spent on
    /// skills.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub fn check_game(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        self.check_levels(game)?;
        self.check_sharing(game)?;
        self.check_rivals_of(game)?;
        self.check_agent(game)
    }

    /// Checks that each World of a game whose agents play together gets all of them.
    fn check_sharing(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        let sharing = game.tools().host.agents_per_arena().max(1);
        if !self.algorithm.is_trained() || self.arenas.is_multiple_of(sharing) {
            return Ok(());
        }
        let near = self.arenas.div_ceil(sharing).saturating_mul(sharing);
        let why = format!(
            "must be a multiple of {sharing}, since that many agents of `{}` play together in each World; {near} is",
            game.name()
        );
        refuse("arenas", self.arenas, why)
    }

    /// Checks the settings that depend on the game's actions and observations: all that matters if no level is
    /// played.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    pub fn check_agent(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        self.check_actions(game.actions())?;
        self.check_observation(game)
    }

    /// Checks that the game has the modes, that no held-out level is trained on
    /// ([`LevelTools::family`](playbot_harness::game::LevelTools::family)), and that not all of them have the layout of a
    /// training level.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the levels.
    pub fn check_levels(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        self.check_train(game)?;
        self.check_test(game)?;
        self.check_lesson_levels(game)?;
        let held_out = HeldOut::new(game, &self.test);
        let (train, test) = (Box::new(self.train.clone()), Box::new(self.test.clone()));
        match held_out.first_of(&self.train) {
            Some(level) => Err(ExperimentError::Leak { train, level, test }),
            None if held_out.are_all_in(&self.train) => Err(ExperimentError::SameLayouts { train, test }),
            None => Ok(()),
        }
    }

    /// Checks that the game has the mode of the training levels.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Mode`].
    pub fn check_train(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        check_mode("train", &self.train, game)
    }

    /// Checks that the game has the mode of the held-out levels.
    ///
    /// # Errors
    ///
    /// [`ExperimentError::Mode`].
    pub fn check_test(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        check_mode("test", &self.test, game)
    }

    /// Checks that the observations support `skills.augment`, `ppo.augment` and `skills.state_weight`.
    fn check_observation(&self, game: &dyn Game) -> Result<(), ExperimentError> {
        let kind = self.observation_config().obs_kind(game);
        let with_sets = self.with_sets(game);
        self.check_painted_velocity()?;
        if self.algorithm.needs_skills() {
            with_sets.skills.check_observation(kind).map_err(settings)?;
            if self.skills.tells_states() && game.observation().is_empty() {
                let why = "the game has no vector that its pictures could predict; leave it out";
                return refuse("skills.state_weight", self.skills.state_weight, why);
            }
        }
        match self.algorithm.learner() {
            LearnerKind::Ppo if self.algorithm.is_trained() => with_sets.ppo.check_observation(&kind).map_err(settings),
            _ => Ok(()),
        }
    }

    /// Checks that augmentation leaves painted velocity alone: a changed one would be another velocity.
    fn check_painted_velocity(&self) -> Result<(), ExperimentError> {
        let config = self.observation_config();
        let Some([rows, columns]) = config.image.painted_corner().filter(|_| config.is_image()) else { return Ok(()) };
        for (key, augment) in [("skills.augment", &self.skills.augment), ("ppo.augment", &self.ppo.augment)] {
            let keeps = matches!(augment.last(), Some(Augmentation::Keep(r, c)) if *r >= rows && *c >= columns);
            if !augment.is_empty() && !keeps {
                let why = format!(
                    "would change the velocity that `image.paint_velocity` paints: end the list with Keep({rows}, {columns})"
                );
                return refuse(key, format!("{augment:?}"), why);
            }
        }
        Ok(())
    }

    /// Checks the settings that depend on the game's actions.
    ///
    /// # Errors
    ///
    /// [`ExperimentError`] with the key to change.
    fn check_actions(&self, space: ActionSpace) -> Result<(), ExperimentError> {
        self.skills.check_space(space).map_err(settings)?;
        if !(self.algorithm.needs_skills() && self.algorithm.is_trained()) {
            return Ok(());
        }
        self.score.check_space(space).map_err(settings)?;
        let squashed = match self.algorithm.learner() {
            LearnerKind::Ppo => false,
            LearnerKind::Sac => matches!(space, ActionSpace::Continuous(_)) && !self.algorithm.learns_prior(),
        };
        if squashed && self.score.init_from_decoder {
            let why = "SAC squashes continuous actions, so its policy cannot start as a copy of the decoder; set it to \
                       false (the penalty still ties the two together)";
            return refuse("score.init_from_decoder", true, why);
        }
        if self.algorithm == Algorithm::SpirlSac && !self.skills.tanh_latent {
            return refuse(
                "skills.tanh_latent",
                false,
                "SAC squashes the skills that it draws: they must lie in -1..1",
            );
        }
        Ok(())
    }
}

fn check_mode(key: &'static str, levels: &LevelSplit, game: &dyn Game) -> Result<(), ExperimentError> {
    let example = game.modes().first().copied().unwrap_or_default();
    levels.check(game).map_err(|source| ExperimentError::Mode {
        key,
        levels: Box::new(levels.clone()),
        source: Box::new(source),
        example,
    })
}

impl Experiment {
    /// Checks that skills are whole and drawn, as a policy over skills needs them.
    pub(crate) fn check_skill_draws(&self) -> Result<(), ExperimentError> {
        if !self.algorithm.learns_prior() {
            return Ok(());
        }
        if self.score.prior != PriorKind::Learned {
            return refuse("score.prior", "StandardNormal", "a policy over skills starts as the learned prior");
        }
        if self.score.skill_draw != SkillDraw::Sample {
            return refuse("score.skill_draw", "Mean", "a policy over skills learns from skills that are drawn");
        }
        let (key, steps, limit_key, limit) = match self.algorithm.learner() {
            LearnerKind::Ppo => ("ppo.num_steps", self.ppo.num_steps, "ppo.time_limit", self.ppo.time_limit),
            LearnerKind::Sac => ("sac.num_steps", self.sac.num_steps, "sac.time_limit", self.sac.time_limit),
        };
        if limit != TimeLimit::Bootstrap {
            return refuse(limit_key, "Legacy", "a policy over skills needs Bootstrap: its rollouts are cut anyway");
        }
        let least = self.score.skill_interval.saturating_mul(2);
        if steps < least {
            let why =
                format!("a policy over skills learns from whole skills: use at least 2 × `score.horizon` = {least}");
            return refuse(key, steps, why);
        }
        Ok(())
    }
}

// Memory that a training needs. The sum is a lower bound: an experiment that is refused here could not have run.

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

    /// Returns an estimate of the memory that the data of a run take at a time, in bytes.
    pub fn memory(&self, game: &dyn Game) -> u64 {
        let sizes = self.sizes(game);
        let sum = |parts: Vec<MemoryPart>| parts.iter().fold(0, |sum: u64, part| sum.saturating_add(part.bytes));
        let skills = if self.algorithm.needs_skills() { sum(self.skill_parts(&sizes)) } else { 0 };
        let training = if self.algorithm.is_trained() { sum(self.training_parts(game, &sizes)) } else { 0 };
        skills.max(training)
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
        let parts = self.training_parts(game, &sizes);
        check_parts(&parts, room.memory)?;
        self.check_threads(self.arrangement(game), room.threads)
    }

    /// Returns the Worlds of a training: one for each arena if levels draw values, which are those of a World, and one for
    /// each learning agent that has rivals.
    pub(crate) fn arrangement(&self, game: &dyn Game) -> Arrangement {
        if self.self_play.every.is_some() {
            return Arrangement { worlds: self.arenas, arenas: 1 };
        }
        let shared = Arrangement::of_agents(game, self.arenas, self.worlds);
        if self.randomise.is_empty() { shared } else { shared.apart(game) }
    }

    fn training_parts(&self, game: &dyn Game, sizes: &Sizes) -> Vec<MemoryPart> {
        let mut parts = vec![MemoryPart::of_worlds(self.arrangement(game)), self.rollout_part(sizes)];
        match self.algorithm.learner() {
            LearnerKind::Ppo => parts.extend(self.ppo_parts(sizes)),
            LearnerKind::Sac => parts.extend(self.sac_parts(sizes)),
        }
        parts
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
        let space = game.actions();
        let (action, outputs) = (space.dim() as u64, (space.dim() + space.numbers()) as u64);
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
        // Target and predictor of curiosity have convolutions of their own.
        let convolutions = match &self.ppo.curiosity {
            Curiosity::Off => 1,
            Curiosity::Rnd { hidden, features, .. } => {
                let twice: Vec<usize> = [&hidden[..], hidden].concat();
                let features = *features as u64;
                let both =
                    layers(sizes.inputs, hidden, features).saturating_add(layers(sizes.inputs, &twice, features));
                parts.push(networks(both, "`ppo.curiosity`"));
                3
            }
        };
        parts.extend(sizes.convolutions(&self.ppo.cnn, convolutions, "`ppo.cnn`"));
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

// Errors of an experiment.

/// An invalid experiment.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum ExperimentError {
    /// Training and held-out levels share a level.
    #[error("training levels {train} and held-out levels {test} overlap: choose ranges that share no level")]
    Overlap {
        /// Training levels.
        train: LevelSplit,
        /// Held-out levels.
        test: LevelSplit,
    },
    /// A training level is equal to a held-out level in content.
    #[error("level {level} of the training levels {train} is one of the held-out levels {test}: choose others")]
    Leak {
        /// Training levels.
        train: Box<LevelSplit>,
        /// The first such level.
        level: u64,
        /// Held-out levels.
        test: Box<LevelSplit>,
    },
    /// No held-out level has a layout of its own.
    #[error("each of the held-out levels {test} has the layout of one of the training levels {train}: choose others")]
    SameLayouts {
        /// Training levels.
        train: Box<LevelSplit>,
        /// Held-out levels.
        test: Box<LevelSplit>,
    },
    /// The game lacks this mode.
    #[error("`{key}` is {levels}: {source}; name levels of this game, as in `--set {key}={example}:0..63`")]
    Mode {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        levels: Box<LevelSplit>,
        /// The error of the mode.
        source: Box<ModeError>,
        /// A mode that the game has.
        example: &'static str,
    },
    /// The game does not have a lesson's mode or levels.
    #[error("`curriculum.lessons` has {levels}: {source}")]
    Lesson {
        /// The lesson.
        levels: Box<LevelSplit>,
        /// The error of the mode.
        source: Box<ModeError>,
    },
    /// Training needs more memory than the machine has.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A number is out of range.
    #[error("`{key}` is {value}: {why}")]
    Value {
        /// Key in the file.
        key: &'static str,
        /// Its value.
        value: String,
        /// The condition on the value.
        why: String,
    },
    /// No recordings to learn from.
    #[error("`demos` is missing, and this experiment learns from recordings: name a file or a folder of recordings")]
    NoDemos,
    /// The learner refuses its settings.
    #[error("{words}")]
    Settings {
        /// Key or section in the file, if known.
        key: Option<String>,
        /// The error.
        words: String,
    },
}

impl HasExitCode for ExperimentError {}

impl ExperimentError {
    /// Returns the keys or sections to look at, the first one first.
    pub fn keys(&self) -> Vec<&str> {
        match self {
            Self::Overlap { .. } | Self::Leak { .. } | Self::SameLayouts { .. } => vec!["train", "test"],
            Self::Mode { key, .. } | Self::Value { key, .. } => vec![key],
            // Keys are named between backticks.
            Self::Memory(MemoryError { keys, .. }) => keys.split('`').skip(1).step_by(2).collect(),
            Self::Lesson { .. } => vec!["curriculum.lessons"],
            Self::NoDemos => vec!["algorithm"],
            Self::Settings { key, .. } => key.as_deref().into_iter().collect(),
        }
    }
}

/// Converts a learner's error about its settings.
pub(crate) fn settings(error: LearnError) -> ExperimentError {
    match error {
        LearnError::Setting(error) => {
            ExperimentError::Settings { key: Some(error.path.to_owned()), words: error.to_string() }
        }
        LearnError::Config(words) => ExperimentError::Settings { key: None, words },
        other => ExperimentError::Settings { key: None, words: other.to_string() },
    }
}

/// Converts the error of a value that is out of its range.
pub(crate) fn out_of_range(error: SettingError) -> ExperimentError {
    let SettingError { path, value, why } = error;
    ExperimentError::Value { key: path, value: value.unwrap_or_default(), why }
}

pub(crate) fn refuse(key: &'static str, value: impl ToString, why: impl Into<String>) -> Result<(), ExperimentError> {
    Err(ExperimentError::Value { key, value: value.to_string(), why: why.into() })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Algorithm, experiment::file::parse_experiment};

    fn check(changes: &str) -> Result<(), String> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: 1000, {changes})"#);
        parse_experiment(&text, Path::new("x.ron")).expect("valid").check().map_err(|error| error.to_string())
    }

    #[test]
    fn only_methods_that_learn_skills_need_demonstrations() {
        for algorithm in Algorithm::ALL {
            let without = check(&format!(r#"algorithm: "{algorithm}""#));
            assert_eq!(without, check(&format!(r#"algorithm: "{algorithm}", demos: None"#)));
            match algorithm.learns_from_demos() {
                true => {
                    assert!(without.expect_err("nothing to learn from").contains("`demos` is missing"), "{algorithm}")
                }
                false => assert_eq!(without, Ok(())),
            }
            let score = "score: (init_from_decoder: false)";
            assert_eq!(check(&format!(r#"algorithm: "{algorithm}", demos: "d", {score}"#)), Ok(()));
        }
    }

    #[test]
    fn what_only_ppo_has_is_refused_for_sac() {
        let sac = r#"algorithm: "score-sac", demos: "d""#;
        let end = "score: (kl_coef_end: Some(0.0))";
        let text = check(&format!("{sac}, {end}")).expect_err("does nothing");
        assert!(text.starts_with("`score.kl_coef_end` is ") && text.contains("PPO"), "{text}");
        assert_eq!(check(&format!(r#"demos: "d", {end}"#)), Ok(()));
        assert_eq!(check(&format!("{sac}, score: (critic_clock: true)")), Ok(()), "both have critics that count");
    }

    #[test]
    fn a_penalty_that_is_never_paid_has_no_end() {
        for algorithm in ["spirl-ppo", "spirl-sac"] {
            let spirl = |learn| {
                format!(
                    r#"algorithm: "{algorithm}", demos: "d", score: (kl_coef_end: Some(0.0)), spirl: (learn_decoder: {learn})"#
                )
            };
            assert_eq!(check(&spirl(true)), Ok(()));
            assert!(check(&spirl(false)).expect_err("does nothing").contains("`spirl.learn_decoder`"));
        }
        let text = check(r#"demos: "d", score: (kl: false, kl_coef_end: Some(0.0))"#).expect_err("does nothing");
        assert!(text.contains("`score.kl` is false"), "{text}");
    }

    #[test]
    fn only_ppo_learns_from_pictures() {
        for algorithm in Algorithm::ALL {
            let found = check(&format!(
                r#"algorithm: "{algorithm}", demos: "d", observation: Raster, score: (init_from_decoder: false)"#
            ));
            match ["sac", "score-sac", "spirl-sac", "rlpd"].contains(&algorithm.name()) {
                true => assert!(found.expect_err("vectors").starts_with("`observation` is Raster"), "{algorithm}"),
                false => assert_eq!(found, Ok(()), "{algorithm}"),
            }
        }
    }

    #[test]
    fn a_decoder_that_goes_on_learning_has_minibatches() {
        let spirl = |learn| {
            format!(
                r#"algorithm: "spirl-sac", demos: "d", ppo: (num_steps: 64, minibatches: 7), spirl: (learn_decoder: {learn})"#
            )
        };
        assert_eq!(check(&spirl(false)), Ok(()));
        assert!(check(&spirl(true)).expect_err("7 divides nothing").contains("`ppo.minibatches` is 7"));
    }

    #[test]
    fn no_arenas_and_no_worlds_are_refused() {
        // Not with the learning rate that cannot fall over no updates.
        let text = check(r#"algorithm: "ppo", arenas: 0, ppo: (anneal_lr: true)"#).expect_err("refused");
        assert_eq!(text, "`arenas` is 0: must be at least 1");
        let text = check(r#"algorithm: "ppo", worlds: 0"#).expect_err("nowhere");
        assert!(text.starts_with("`worlds` is 0"), "{text}");
    }

    #[test]
    fn one_normaliser_at_a_time() {
        let frozen = r#"demos: "d", skills: (norm_obs: true)"#;
        assert_eq!(check(frozen), Ok(()));
        for (changes, words) in [
            (r#"observation: Raster"#, "`skills.norm_obs` is true: is for vectors"),
            (r#"ppo: (norm_obs: true)"#, "`ppo.norm_obs` is true: with `skills.norm_obs`"),
            (
                r#"ppo: (norm_obs: true), score: (init_from_decoder: false)"#,
                "`ppo.norm_obs` is true: with `skills.norm_obs`",
            ),
            (r#"algorithm: "score-sac", sac: (norm_obs: true)"#, "`sac.norm_obs` is true: with `skills.norm_obs`"),
        ] {
            let text = check(&format!("{frozen}, {changes}")).expect_err(changes);
            assert!(text.starts_with(words), "{text}");
        }
        let text = check(r#"demos: "d", ppo: (norm_obs: true)"#).expect_err("the decoder sees raw ones");
        assert!(text.starts_with("`ppo.norm_obs` is true") && text.contains("set `skills.norm_obs`"), "{text}");
        // Algorithms that are not tied to skills may normalise, and the other family's key is not looked at.
        for changes in [
            r#"algorithm: "ppo", ppo: (norm_obs: true)"#,
            r#"algorithm: "bc", ppo: (norm_obs: true)"#,
            r#"sac: (norm_obs: true)"#,
        ] {
            assert_eq!(check(&format!("{frozen}, {changes}")), Ok(()), "{changes}");
        }
        assert_eq!(check(r#"demos: "d", ppo: (norm_obs: true), score: (init_from_decoder: false)"#), Ok(()));
    }

    #[test]
    fn the_nearest_divisor_is_one() {
        assert_eq!(nearest_divisor(8192, 7), 8);
        assert_eq!(nearest_divisor(64, 3), 4, "2 and 4 are equally near");
        assert_eq!(nearest_divisor(60, 0), 1);
        assert_eq!(nearest_divisor(7, 1000), 7);
    }

    #[test]
    fn what_would_never_end_or_run_away_is_refused() {
        let ppo = |changes: &str| format!(r#"algorithm: "ppo", {changes}"#);
        for (changes, key) in [
            ("ppo: (epochs: 18446744073709551615)", "ppo.epochs"),
            ("ppo: (num_steps: 18446744073709551615)", "ppo.num_steps"),
            ("ppo: (num_steps: 4611686018427387904, minibatches: 3)", "ppo.num_steps"),
            ("arenas: 100000, worlds: 100000, ppo: (num_steps: 8)", "worlds"),
            ("arenas: 100000, worlds: 100000, ppo: (num_steps: 1000000000)", "worlds"),
            ("ppo: (ent_coef: -1)", "ppo.ent_coef"),
            ("ppo: (adam_eps: 1e308)", "ppo.adam_eps"),
            ("ppo: (max_grad_norm: 1e308)", "ppo.max_grad_norm"),
            ("sac: (updates_per_step: 1e300)", "sac.updates_per_step"),
            ("skills: (epochs: 18446744073709551615)", "skills.epochs"),
            ("score: (kl_coef: 1e308)", "score.kl_coef"),
        ] {
            let text = check(&ppo(changes)).expect_err(changes);
            assert!(text.starts_with(&format!("`{key}` ")), "{changes}: {text}");
        }
        let long = check(&ppo("sac: (updates_per_step: 1e300)")).expect_err("far too many");
        assert_eq!(long, "`sac.updates_per_step` must lie in 0..10000, but is 1e300");
        assert_eq!(check(&ppo("ppo: (max_grad_norm: 1e9, ent_coef: 0, epochs: 100)")), Ok(()));
    }

    #[test]
    fn actions_are_checked_before_skills_are_learned() {
        let check = |changes: &str, space| {
            let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: 1000, demos: "d", {changes})"#);
            let experiment = parse_experiment(&text, Path::new("x.ron")).expect("valid");
            experiment.check_actions(space).map_err(|error| error.to_string())
        };
        for (changes, words) in [
            ("skills: (action_noise: 0.2)", "action_noise"),
            ("score: (penalty: LegacyCoinrun)", "LegacyCoinrun is for discrete actions only"),
            (r#"algorithm: "score-sac""#, "`score.init_from_decoder` is true: SAC squashes"),
        ] {
            let text = check(changes, ActionSpace::Continuous(8)).expect_err(changes);
            assert!(text.contains(words), "{text}");
            assert_eq!(check(changes, ActionSpace::Discrete(3)), Ok(()), "{changes}");
        }
        let untied = r#"algorithm: "sac", score: (penalty: LegacyCoinrun)"#;
        assert_eq!(check(untied, ActionSpace::Continuous(8)), Ok(()));
    }

    fn check_with_demos(changes: &str) -> Result<(), String> {
        let text = format!(r#"(game: "g", train: "a:0..3", test: "a:4..7", steps: 1000, demos: "d", {changes})"#);
        parse_experiment(&text, Path::new("x.ron")).expect("valid").check().map_err(|error| error.to_string())
    }

    #[test]
    fn a_policy_over_skills_needs_skills_that_are_drawn_and_played_to_their_ends() {
        for (changes, words) in [
            (r#"algorithm: "spirl-ppo", score: (skill_draw: Mean)"#, "`score.skill_draw` is Mean"),
            (r#"algorithm: "spirl-sac", score: (prior: StandardNormal)"#, "`score.prior` is StandardNormal"),
            (r#"algorithm: "spirl-ppo", ppo: (time_limit: Legacy)"#, "`ppo.time_limit` is Legacy"),
            (r#"algorithm: "spirl-sac", sac: (num_steps: 15)"#, "`sac.num_steps` is 15: a policy over skills learns"),
            (r#"algorithm: "spirl-ppo", ppo: (norm_obs: true)"#, "`ppo.norm_obs` is true"),
            (r#"algorithm: "spirl-ppo", spirl: (target_kl: Some(0.0))"#, "`spirl.target_kl` must be positive"),
            (r#"algorithm: "rlpd", rlpd: (demo_share: 1.0)"#, "`rlpd.demo_share` must lie between"),
            (r#"algorithm: "rlpd", observation: Raster"#, "`observation` is Raster: rlpd learns from vectors only"),
        ] {
            let text = check_with_demos(changes).expect_err(changes);
            assert!(text.contains(words), "{changes}: {text}");
        }
        assert_eq!(
            check_with_demos(r#"algorithm: "spirl-sac", sac: (num_steps: 16), ppo: (time_limit: Legacy)"#),
            Ok(())
        );
        assert_eq!(check_with_demos(r#"algorithm: "score-ppo", score: (skill_draw: Mean)"#), Ok(()));
    }
}
