//! Benchmarks of learning, at the sizes of the paper and of the experiments: single kernels, one training step, and
//! whole updates.
//!
//! `cargo bench -p playbot_learner`; a word after it runs only the cases whose names contain it (`-- impala`). Tests
//! check that the numbers are the same on any number of threads.

mod data;
mod kernels;
mod steps;
mod updates;

criterion::criterion_group! {
    name = kernels;
    config = data::measured(20);
    targets = kernels::dense, kernels::gru, kernels::convolutions, kernels::numbers
}
criterion::criterion_group! {
    name = steps;
    config = data::measured(20);
    targets = steps::skill, steps::mlp, steps::ppo, steps::entities, steps::images
}
criterion::criterion_group! {
    name = updates;
    config = data::measured(10);
    targets = updates::skill_epoch, updates::vectors, updates::images
}

/// As the programs do, so that a machine can be timed as one with narrower vectors.
fn main() {
    playbot_learner::limit_by_environment().expect("a set of instructions");
    kernels();
    steps();
    updates();
    criterion::Criterion::default().configure_from_args().final_summary();
}
