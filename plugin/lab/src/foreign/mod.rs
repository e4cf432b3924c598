//! Games that are not written for this plugin.
//!
//! A [`ForeignGame`] wraps the function that adds a game to an app, as it is, and declares the agent's actions,
//! observations and rewards. In such a game one tick is one frame of a fixed length, headless and in a window: the
//! game's own schedules run as always. The agent's action presses keys before Bevy's own input systems run; reward and
//! end are read in `Last`.
//!
//! ```
//! use bevy::prelude::*;
//! use playbot_lab::{foreign::{ForeignGame, Restart}, prelude::*};
//!
//! #[derive(Component)]
//! struct Walker;
//!
//! /// The game, which is not changed.
//! fn game(app: &mut App) {
//!     app.add_systems(Startup, |mut commands: Commands| {
//!         commands.spawn((Walker, Transform::default()));
//!     })
//!     .add_systems(Update, |keys: Res<ButtonInput<KeyCode>>, mut walker: Single<&mut Transform, With<Walker>>| {
//!         walker.translation.x += f32::from(u8::from(keys.pressed(KeyCode::ArrowRight)));
//!     });
//! }
//!
//! fn walk() -> impl Game {
//!     ForeignGame::new("walk", 1, game)
//!         .keys([vec![], vec![KeyCode::ArrowRight]])
//!         .observe(["x"], |walker: Single<&Transform, With<Walker>>| [walker.translation.x])
//!         .reward_delta(|walker: Single<&Transform, With<Walker>>| walker.translation.x)
//!         .end(|walker: Single<&Transform, With<Walker>>| (walker.translation.x >= 5.0).then_some(EpisodeEnd::WON))
//!         .time_limit(20)
//!         .restart(Restart::Startup)
//! }
//!
//! let (mut world, agents) = playbot_lab::worlds::build_world(&walk(), "default", 0, 0, 1);
//! let right = BlindBot::Constant(ActionValue::Discrete(1));
//! world.entity_mut(agents[0]).insert((Control::Bot, right, LevelQueue::list([7])));
//! while world.get::<Control>(agents[0]) != Some(&Control::Idle) {
//!     world.tick().expect("the game keeps its contract");
//! }
//! let count = world.get::<EpisodeCount>(agents[0]).expect("an agent");
//! assert_eq!((count.finished, count.successes), (1, 1));
//! ```

mod builder;
mod convert;
mod demonstrator;
mod factory;
mod fingerprint;
mod game;
mod input;
mod install;
mod kept;
mod outcome;
mod paths;
mod place;
mod ready;
mod restart;
mod restart_kind;
mod runtime;
mod sense;

pub use convert::{IntoActionValue, IntoValues};
pub use game::ForeignGame;
pub use paths::PathError;
pub use restart_kind::Restart;
pub use runtime::LevelSeed;
