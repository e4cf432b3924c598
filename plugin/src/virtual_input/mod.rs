//! Virtual input: an agent's action presses keys, mouse buttons and gamepads, through Bevy's own input.
//!
//! A game that reads `ButtonInput<KeyCode>`, mouse, gamepad or an input manager needs no change to be played by a
//! bot. Its agent carries a [`VirtualInput`]: the inputs that each action holds down. In
//! [`PlaybotSystems::Act`](crate::systems::PlaybotSystems::Act) the plugin presses the new inputs of this tick's
//! action, keeps holding those it still needs, and releases the rest.
//!
//! - It plays for [`Control::Policy`](crate::control::Control::Policy), [`Bot`](crate::control::Control::Bot) and
//!   [`Replay`](crate::control::Control::Replay), never for people: under `Human` and `Idle` everything is released.
//!   The exception are agents with [`PressesForPeople`], for people whose own devices do not reach the game.
//! - Everything is released at the end of an episode and at the start of the next. An episode begins with nothing
//!   held, and replays the same alone.
//! - A World has one keyboard and one mouse: two agents that claim the same key or motion are a fault. Every agent has a
//!   gamepad of its own.
//! - The route is a setting: see [`InputRoute`].
//! - With the features `leafwing-input-manager` and `bevy_enhanced_input`, actions of these input managers can also be
//!   driven without any key. Keys drive them without these features.
//!
//! ```
//! use bevy::{input::InputPlugin, prelude::*};
//! use bevy_playbot::{prelude::*, virtual_input::{VirtualInput, VirtualInputPlugin}};
//!
//! /// A game without any knowledge of agents.
//! fn walk(keys: Res<ButtonInput<KeyCode>>, mut player: Single<&mut Transform, With<Agent>>) {
//!     if keys.pressed(KeyCode::ArrowRight) {
//!         player.translation.x += 1.0;
//!     }
//! }
//!
//! let mut app = headless_app();
//! app.add_plugins((InputPlugin, VirtualInputPlugin::default())).add_systems(FixedUpdate, walk);
//! let input = VirtualInput::keys([vec![], vec![KeyCode::ArrowLeft], vec![KeyCode::ArrowRight]]);
//! let bot = BlindBot::Constant(ActionValue::Discrete(2));
//! let agent = (Agent::new(0, input.space()), input, Control::Bot, bot, Transform::default());
//! let agent = app.world_mut().spawn(agent).id();
//! app.ticks(3).expect("no agent broke its contract");
//! assert_eq!(app.world().get::<Transform>(agent).expect("spawned with it").translation.x, 3.0);
//! ```

mod act;
mod action_axis;
mod axis;
mod button;
mod claims;
mod component;
mod devices;
mod direct;
#[cfg(feature = "bevy_enhanced_input")]
pub mod enhanced_input;
mod gamepad;
mod gamepad_messages;
mod held;
mod input_state;
#[cfg(feature = "leafwing-input-manager")]
pub mod leafwing;
mod logical_key;
mod messages;
mod names;
mod person;
mod plugin;
mod route;

pub use action_axis::ActionAxis;
pub use axis::VirtualAxis;
pub use button::{UnknownInput, VirtualButton};
pub use component::VirtualInput;
pub use devices::VirtualDevices;
pub use gamepad::VirtualGamepad;
pub use held::HeldInput;
pub use person::PressesForPeople;
pub use plugin::VirtualInputPlugin;
pub use route::InputRoute;
