//! Tests that steps reuse the memory of the steps before them. Free memory goes to the first caller in the whole
//! program, so these tests are a program of their own and take turns.

use std::sync::{Mutex, PoisonError};

use allocation_counter::{AllocationInfo, measure};
use burn::tensor::{Tensor, TensorData};
use playbot_learner::{
    DeviceKind, ImageShape, Workers,
    nn::{Activation, Adam, AdamConfig, CnnKind, ImageNet, Mlp, NamedGrads, ObsBatch, Parameters, tracked},
    rng::{ChaCha8Rng, Streams, below, normal},
};

/// Returns the allocations of the third step, on one thread.
fn of_a_step(mut step: impl FnMut()) -> AllocationInfo {
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    Workers::new(1).bound(|| {
        (0..2).for_each(|_| step());
        measure(step)
    })
}

fn learn<M: Parameters>(net: &mut M, adam: &mut Adam, loss: Tensor<1>) {
    let grads = NamedGrads::take(net, "", loss.backward()).expect("finite");
    adam.step(net, "", &grads, 3e-4, 1.0).expect("fits");
}

fn matrix(rows: usize, columns: usize, rng: &mut ChaCha8Rng) -> Tensor<2> {
    let numbers = (0..rows * columns).map(|_| normal(rng)).collect::<Vec<f32>>();
    Tensor::from_data(TensorData::new(numbers, [rows, columns]), &DeviceKind::Flex.plain())
}

#[test]
fn a_step_of_a_dense_network_asks_for_less_than_half_of_what_it_computes() {
    let mut rng = Streams::new(1).stream("mlp", 0);
    let device = DeviceKind::Flex.plain();
    let net = Mlp::new(37, &[200, 200], 8, Activation::Tanh, 1.0, &mut rng, &device);
    let mut of_batch = |batch: usize| {
        let (mut net, mut adam) = (tracked(&net), Adam::new(AdamConfig::default()));
        let (x, target) = (matrix(batch, 37, &mut rng), matrix(batch, 8, &mut rng));
        of_a_step(move || {
            let loss = (net.forward(x.clone()) - target.clone()).square().mean();
            learn(&mut net, &mut adam, loss);
        })
    };
    let (few, many) = (of_batch(16), of_batch(64));
    // The gradients alone are 196 kB, the hidden layers' outputs for 64 rows are 102 kB.
    assert!(many.bytes_total < 100_000, "{many:?}");
    // Outputs and positions of a row, and not the hidden layers' outputs, which are 1,600 bytes.
    assert!(many.bytes_total < few.bytes_total + 48 * 400, "{few:?}, {many:?}");
    assert!(many.count_total < 600, "{many:?}");
}

#[test]
fn another_image_costs_a_step_little_more_than_its_features() {
    let image = ImageShape { channels: 3, height: 64, width: 64 };
    let mut rng = Streams::new(1).stream("images", 0);
    let device = DeviceKind::Flex.plain();
    for kind in [CnnKind::Nature { feature: 256 }, CnnKind::default()] {
        let net = ImageNet::new(&kind, image, &mut rng, &device).expect("fits");
        let mut of_batch = |batch: usize| {
            let bytes: Vec<u8> = (0..batch * image.numbers()).map(|_| below(&mut rng, 256) as u8).collect();
            let shape = [batch, image.channels, image.height, image.width];
            let ObsBatch::Image(x) = ObsBatch::pixels(bytes, shape, &device) else { unreachable!("made of pixels") };
            let (mut net, target) = (tracked(&net), matrix(batch, kind.features(), &mut rng));
            let mut adam = Adam::new(AdamConfig::default());
            of_a_step(move || {
                let loss = (net.forward(x.clone()) - target.clone()).square().mean();
                learn(&mut net, &mut adam, loss);
            })
        };
        let (few, many) = (of_batch(16), of_batch(48));
        // The layers' outputs for an image, and its gradients, are 590 kB and more in the larger one.
        assert!(many.bytes_total < few.bytes_total + 32 * 64_000, "{kind:?}: {few:?}, {many:?}");
        assert!(many.count_total < few.count_total + 32, "{kind:?}: {few:?}, {many:?}");
    }
}
