//! The recording of a game's demonstrator, or of another player.
//!
//! ```no_run
//! use bevy_playbot::demo::file::DemoWriter;
//! use playbot_harness::{demo::demonstration::DemonstrationPlan, prelude::*, randomise::Randomise};
//! # fn record(game: &dyn Game) -> Result<(), Box<dyn std::error::Error>> {
//! let plan = DemonstrationPlan {
//!     mode: "easy".to_owned(),
//!     levels: (0..100).collect(),
//!     noise: 0.1,
//!     seed: 1,
//!     steps: None,
//!     keep_observations: false,
//!     randomise: Randomise::default(),
//! };
//! let writer = DemoWriter::create("easy.demo", plan.header(game))?;
//! let (mut world, agent) = plan.build_world(game, writer);
//! while Control::of(&world, agent).is_active() {
//!     world.tick()?;
//! }
//! println!("{} episodes", world.resource::<Recorder>().episodes());
//! # Ok(())
//! # }
//! ```

use crate::{
    eval::Player,
    game::Game,
    randomise::Randomise,
    worlds::{build_observing_world, build_world},
};
use bevy::prelude::*;
use bevy_playbot::{
    bot::with_noise,
    demo::file::{DemoHeader, DemoWriter},
    engine::{TickSchedules, is_tick},
    legal::LegalActions,
    prelude::*,
    vision::{ObservationConfig, VisionError},
};
use playbot_learner::{Streams, rng::ChaCha8Rng};

/// A plan of the recording of a game's demonstrator.
#[derive(Clone, Debug)]
pub struct DemonstrationPlan {
    /// A mode that the game has.
    pub mode: String,
    /// Levels, in the order in which they are played.
    pub levels: Vec<u64>,
    /// The share of random actions, or the standard deviation of the noise on continuous ones.
    pub noise: f64,
    /// Random seed of the noise.
    pub seed: u64,
    /// Steps after which the recording stops. Until then the levels are repeated. `None` plays each level once.
    pub steps: Option<u64>,
    /// True if the recording keeps the observation vectors. Without them a replay restores them.
    pub keep_observations: bool,
    /// Values of the game that each level draws anew. The recording keeps them.
    pub randomise: Randomise,
}

impl DemonstrationPlan {
    /// Returns the header of the recording.
    pub fn header(&self, game: &dyn Game) -> DemoHeader {
        let mut header = game.demo_header(&self.mode);
        header.demonstrator = game.tools().bots.demonstrator().unwrap_or_default().to_owned();
        header.action_noise = self.noise;
        if self.keep_observations {
            header.observation_names = game.observation().names;
        }
        if self.randomise.is_empty() { header } else { header.with_randomised_values() }
    }

    /// Builds a World with an agent that the demonstrator plays, recorded by `writer` in each tick. After the last
    /// level the agent is idle. With a number of steps it plays on, and the caller checks [`Recorder::steps`].
    pub fn build_world(&self, game: &dyn Game, writer: DemoWriter) -> (World, Entity) {
        let (mut world, agents) = build_world(game, &self.mode, self.seed, 0, 1);
        let agent = agents[0];
        game.tools().bots.attach_demonstrator(&mut world, agent, self.noise);
        self.record(&mut world, agent, Control::Bot, writer);
        (world, agent)
    }

    /// Builds a World as [`build_world`](Self::build_world) does, with another player, such as a trained policy, and
    /// the observation of `observation_config`. [`header`](Self::header) names the demonstrator: replace the name by
    /// the player's.
    ///
    /// # Errors
    ///
    /// The observation cannot be made: see [`VisionError`].
    pub fn build_world_of(
        &self,
        game: &dyn Game,
        player: &Player,
        observation_config: &ObservationConfig,
        writer: DemoWriter,
    ) -> Result<(World, Entity), VisionError> {
        let (mut world, agents) = build_observing_world(game, &self.mode, observation_config, self.seed, 0, 1)?;
        let agent = agents[0];
        player.install(&mut world);
        let control = player.seat(game, &mut world, agent);
        if self.noise > 0.0 {
            ActionNoise::install(&mut world);
            world.entity_mut(agent).insert(ActionNoise::new(self.noise, self.seed));
        }
        self.record(&mut world, agent, control, writer);
        Ok((world, agent))
    }

    /// Makes the agent play the levels and `writer` record it.
    fn record(&self, world: &mut World, agent: Entity, control: Control, writer: DemoWriter) {
        self.randomise.install(world);
        let recorder = Recorder::new(writer);
        let (recorder, levels) = match self.steps {
            Some(steps) => (recorder.with_step_limit(steps), LevelQueue::rounds(self.levels.clone())),
            None => (recorder, LevelQueue::list(self.levels.clone())),
        };
        world.insert_resource(recorder);
        world.entity_mut(agent).insert((control, Recording::default(), levels));
    }
}

/// Replaces some of an agent's actions, or adds noise to them, for any controller: recordings then also show how to
/// recover.
#[derive(Component, Clone, Debug, Reflect)]
#[reflect(opaque)]
#[reflect(Component, Clone, Debug)]
pub(super) struct ActionNoise {
    noise: f64,
    rng: ChaCha8Rng,
}

impl ActionNoise {
    /// Creates noise with this share of random actions, or with this standard deviation for continuous ones, drawn from
    /// `seed`.
    pub(super) fn new(noise: f64, seed: u64) -> Self {
        Self { noise, rng: Streams::new(seed).stream("demo.noise", 0) }
    }

    /// Installs the system in a World. It runs after the controllers, and before the game reads the action.
    pub(super) fn install(world: &mut World) {
        let TickSchedules { decide, .. } = *world.resource::<TickSchedules>();
        let system = add_noise.after(PlaybotSystems::Decide).before(PlaybotSystems::Act).run_if(is_tick);
        world.resource_mut::<Schedules>().add_systems(decide, system);
    }
}

fn add_noise(mut agents: Query<(&Agent, &Episode, Option<&LegalActions>, &mut ActionNoise, &mut Action)>) {
    for (agent, episode, legal, mut noise, mut action) in &mut agents {
        if episode.is_running() {
            let share = noise.noise;
            action.0 = with_noise(action.0.clone(), &agent.actions, legal, share, &mut noise.rng);
        }
    }
}
