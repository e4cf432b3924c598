//! Tests of the learner as a whole: learning, exactness, restarts.

#![allow(clippy::disallowed_methods, reason = "tests compare with the system's functions")]

mod augmentation;
mod begin_from;
mod checkpoint;
mod clock;
mod corridor;
mod critic_trunk;
mod curiosity;
mod damaged_files;
mod determinism;
mod entities;
mod errors;
mod field;
mod files;
#[cfg(feature = "wgpu")]
mod gpu;
mod held_out;
mod image_task;
mod images;
mod mixed;
mod noisy;
mod norm_obs;
mod norm_obs_files;
mod partial_demos;
mod pixel_files;
mod pixels;
mod point;
mod remembering;
mod rlpd;
mod sac;
mod score;
mod score_sac;
mod skill;
mod spirl;
mod state_heads;
mod switches;
mod tick;
mod toy;
mod walkers;
