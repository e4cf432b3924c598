//! Golden tests: the learner against reference numbers computed with PyTorch in double precision.
//!
//! The cases lie in `tests/fixtures/numerics`, or in the folder that the environment variable `PLAYBOT_GOLDEN` names.

mod adam;
mod case;
mod fixed;
mod gae;
mod generated;
mod gru;
mod impala;
mod kl;
mod names;
mod norm;
mod ppo_loss;
mod sac;
mod update;
mod vae;
