//! System sets for agents that see pictures.

use bevy::ecs::schedule::SystemSet;

/// Parts of [`ObserveSchedule`](crate::systems::ObserveSchedule) for agents that see pictures, in this order.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum VisionSystems {
    /// The game updates the drawn components: transforms, sprites, tiles.
    Sync,
    /// Sensors fill each agent's [`Frame`](super::Frame).
    Render,
    /// The frame's tick is checked, and the observation made from it.
    Compose,
}
