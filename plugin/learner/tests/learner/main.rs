//! The learner as a whole: does it learn, is it exact, does it survive a restart.

mod checkpoint;
mod corridor;
mod determinism;
mod errors;
mod files;
mod half;
mod images;
mod noisy;
mod pixel_files;
mod pixels;
mod point;
mod sac;
mod scaled;
mod score;
mod score_sac;
mod skill;
mod spots;
mod toy;
