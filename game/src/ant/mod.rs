//! The quadruped of AntMaze, and the game `ant` in which it learns to walk.
//!
//! [`AntBody`] moves exactly as D4RL's ant does in MuJoCo: free flight to the last printed digit, and contacts too, as
//! `tests/ant_golden.rs` shows. Its dynamics are written here, over joint coordinates, for lack of an engine that has
//! them: a hinge of this ant carries a rotor of 1 kg·m² while a limb has 0.01 kg·m². rapier's impulse joints with a
//! motor in the rotor's place reach 40 % of the right joint speed at 4 solver iterations and 75 % at 16. Its multibody
//! joints, which support rotors, let the ant rest at 0.49 m instead of 0.37 m and take ten times as long. rapier is
//! used here to hold floor and walls, find those nearby, and answer rays ([`walls`]).
//!
//! The parts, from the bottom: [`skeleton`] has the measures, [`kinematics`] the pose, [`dynamics`] the mass matrix and
//! the forces without contacts. [`contact`] finds contacts, [`constraint`] and [`constraint_solver`] turn joint limits
//! and contacts into accelerations, [`body`] integrates. [`pilot`] is the shipped walking policy, [`view`] draws ants.

pub mod arrow_matrix;
pub mod body;
pub mod constraint;
pub mod constraint_solver;
pub mod contact;
pub mod dynamics;
pub mod game;
pub mod kinematics;
pub mod parts;
pub mod picture;
pub mod pilot;
pub mod sense;
pub mod skeleton;
pub mod spatial;
pub mod state;
pub mod steering;
pub mod view;
pub mod walk;
pub mod walls;

pub use body::AntBody;
pub use contact::WallBox;
pub use game::{Ant, AntPlugin, AntSystems};
pub use parts::{PARTS, Part};
pub use pilot::{Pilot, PilotError};
pub use state::AntState;
pub use walls::Walls;
