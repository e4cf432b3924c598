//! A game's demonstrator, or another player, about to be recorded.
//!
//! ```no_run
//! use bevy_playbot::demo::file::DemoWriter;
//! use playbot_lab::{demo::demonstration::DemonstrationPlan, prelude::*};
//! # fn record(game: &dyn Game) -> Result<(), Box<dyn std::error::Error>> {
//! let plan = DemonstrationPlan {
//!     mode: "easy".to_owned(),
//!     levels: (0..100).collect(),
//!     noise: 0.1,
//!     seed: 1,
//!     steps: None,
//!     keep_observations: false,
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

use bevy::prelude::*;
use bevy_playbot::{
    demo::file::{DemoHeader, DemoWriter},
    prelude::*,
    vision::{ObservationConfig, VisionError},
};

use super::action_noise::ActionNoise;
use crate::{
    eval::Player,
    game::Game,
    worlds::{build_observing_world, build_world},
};

/// What of a game's demonstrator is recorded.
#[derive(Clone, Debug)]
pub struct DemonstrationPlan {
    /// A mode that the game has.
    pub mode: String,
    /// Levels, in the order in which they are played.
    pub levels: Vec<u64>,
    /// The share of random actions, or the standard deviation of the noise on continuous ones.
    pub noise: f64,
    /// Seed of the noise.
    pub seed: u64,
    /// Steps after which nothing more is recorded: until then the levels are played again and again. `None` for each level
    /// once.
    pub steps: Option<u64>,
    /// Whether the recording keeps the observation vectors, which replaying would bring back.
    pub keep_observations: bool,
}

impl DemonstrationPlan {
    /// The head of the recording.
    pub fn header(&self, game: &dyn Game) -> DemoHeader {
        let mut header = game.demo_header(&self.mode);
        header.demonstrator = game.demonstrator().unwrap_or_default().to_owned();
        header.action_noise = self.noise;
        if self.keep_observations {
            header.observation_names = game.observation().names;
        }
        header
    }

    /// A World with an agent that the demonstrator plays, recorded by `writer` in each tick. After the last level the agent is
    /// idle. With a number of steps it plays on, and whoever ticks the World looks at [`Recorder::steps`].
    pub fn build_world(&self, game: &dyn Game, writer: DemoWriter) -> (World, Entity) {
        let (mut world, agents) = build_world(game, &self.mode, self.seed, 0, 1);
        let agent = agents[0];
        game.attach_demonstrator(&mut world, agent, self.noise);
        self.record(&mut world, agent, Control::Bot, writer);
        (world, agent)
    }

    /// [`build_world`](Self::build_world) with another player, such as a policy that has learned the game, which sees as
    /// `observation_config` says. [`header`](Self::header) names the demonstrator: put the player's name there.
    ///
    /// # Errors
    ///
    /// What it sees cannot be made: see [`VisionError`].
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

    /// Lets the agent play the levels and `writer` record it.
    fn record(&self, world: &mut World, agent: Entity, control: Control, writer: DemoWriter) {
        let recorder = Recorder::new(writer);
        let (recorder, levels) = match self.steps {
            Some(steps) => (recorder.with_step_limit(steps), LevelQueue::rounds(self.levels.clone())),
            None => (recorder, LevelQueue::list(self.levels.clone())),
        };
        world.insert_resource(recorder);
        world.entity_mut(agent).insert((control, Recording::default(), levels));
    }
}
