//! Golden tests: the learner against reference numbers computed in double precision, with PyTorch or from first
//! principles.
//!
//! The cases of PyTorch lie in `tests/fixtures/numerics`, or in the folder that the environment variable
//! `PLAYBOT_GOLDEN` names; those of variants of SAC, of curiosity, of memory, of sets and of action spaces lie in
//! `tests/fixtures/sac_variants`, `curiosity`, `memory`, `entities` and `action_spaces`, beside the scripts that make them.

#![allow(clippy::disallowed_methods, reason = "tests compare with the system's functions")]

mod action_spaces;
mod adam;
mod case;
mod curiosity;
mod entities;
mod fixed;
mod gae;
mod generated;
mod gru;
mod impala;
mod kl;
mod memory;
mod names;
mod norm;
mod ppo_loss;
mod sac;
mod sac_variants;
mod update;
mod vae;
