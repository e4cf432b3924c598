//! Fixed random data of the right shapes for the cases.

use std::time::Duration;

use burn::tensor::{Tensor, TensorData};
use criterion::Criterion;
use playbot_learner::{
    DeviceKind, ImageShape, Observations, Rollout,
    nn::ObsBatch,
    rng::{ChaCha8Rng, Streams, below, normal, unit},
};

/// The backend that is measured.
pub const DEVICE: DeviceKind = DeviceKind::Flex;
/// Shape of a camera's images.
pub const IMAGE: ImageShape = ImageShape { channels: 3, height: 64, width: 64 };
/// Actions of CoinRun.
pub const CHOICES: usize = 15;

/// Returns settings for this many samples of a case, in a few seconds.
pub fn measured(samples: usize) -> Criterion {
    Criterion::default()
        .sample_size(samples)
        .warm_up_time(Duration::from_secs(1))
        .measurement_time(Duration::from_secs(4))
}

/// Returns the random generator of a case.
pub fn rng(case: &str) -> ChaCha8Rng {
    Streams::new(1).stream(case, 0)
}

/// Returns numbers around 0.
pub fn normals(n: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..n).map(|_| normal(rng)).collect()
}

/// Returns mostly zeros and ones, like the grid of tiles around a character.
pub fn tiles(n: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..n).map(|_| if unit(rng) < 0.2 { 1.0 } else { 0.0 }).collect()
}

/// Returns random actions of CoinRun.
pub fn choices(n: usize, rng: &mut ChaCha8Rng) -> Vec<u32> {
    (0..n).map(|_| below(rng, CHOICES as u64) as u32).collect()
}

/// Returns the bytes of this many images.
pub fn pixels(images: usize, rng: &mut ChaCha8Rng) -> Vec<u8> {
    (0..images * IMAGE.numbers()).map(|_| below(rng, 256) as u8).collect()
}

/// Converts images to the input of a network.
pub fn images(pixels: Vec<u8>) -> Tensor<4> {
    let shape = [pixels.len() / IMAGE.numbers(), IMAGE.channels, IMAGE.height, IMAGE.width];
    match ObsBatch::pixels(pixels, shape, &DEVICE.plain()) {
        ObsBatch::Image(images) => images,
        ObsBatch::Vector(_) => unreachable!("made of pixels"),
    }
}

/// Returns a tensor of numbers around 0.
pub fn matrix(rows: usize, columns: usize, rng: &mut ChaCha8Rng) -> Tensor<2> {
    Tensor::from_data(TensorData::new(normals(rows * columns, rng), [rows, columns]), &DEVICE.plain())
}

/// Returns `rollout` with rewards, and with ends of episodes now and then.
pub fn lived(rollout: Rollout, envs: usize, rng: &mut ChaCha8Rng) -> Rollout {
    let rows = envs * rollout.steps;
    Rollout {
        rewards: normals(rows, rng),
        terminated: (0..rows).map(|_| unit(rng) < 0.01).collect(),
        truncated: vec![false; rows],
        final_values: vec![0.0; rows],
        next_values: vec![0.0; envs],
        ..rollout
    }
}

/// Returns bytes as observations.
pub fn seen(images: usize, rng: &mut ChaCha8Rng) -> Observations {
    pixels(images, rng).into()
}
