//! The expensive loops one by one: forward, and forward with all gradients.

use burn::tensor::Tensor;
use criterion::Criterion;
use playbot_learner::{
    among_awake_workers,
    nn::{Activation, Adam, AdamConfig, CnnKind, Gru, ImageNet, Linear, NamedGrads, tracked},
};

use crate::data::{DEVICE, IMAGE, images as image_tensor, matrix, pixels, rng};

/// Measures a case without a gradient graph, as agents decide, and with one.
fn both(criterion: &mut Criterion, name: &str, plain: impl Fn() -> Tensor<2>, graph: impl Fn() -> Tensor<2> + Sync) {
    criterion.bench_function(&format!("kernel/{name}/forward"), |bencher| bencher.iter(&plain));
    criterion.bench_function(&format!("kernel/{name}/gradients"), |bencher| {
        among_awake_workers(|| bencher.iter(|| graph().sum().backward()));
    });
}

/// A layer with its activation, as in small networks, over the numbers of CoinRun, and after an image encoder.
pub fn dense(criterion: &mut Criterion) {
    for (rows, inputs, outputs) in [(64, 200, 200), (2048, 563, 200), (256, 2048, 256)] {
        let mut rng = rng("dense");
        let layer = Linear::new(inputs, outputs, 1.0, &mut rng, &DEVICE.plain());
        let (learning, x) = (tracked(&layer), matrix(rows, inputs, &mut rng));
        let tracked_x = x.clone().autodiff().require_grad();
        both(
            criterion,
            &format!("dense/{rows}x{inputs}-{outputs}"),
            || layer.activated(x.clone(), Activation::Relu),
            || learning.activated(tracked_x.clone(), Activation::Relu),
        );
    }
}

/// A layer of the paper's skill model: both directions, 10 steps, 50 windows.
pub fn gru(criterion: &mut Criterion) {
    let (inputs, hidden, steps, batch) = (400, 200, 10, 50);
    let mut rng = rng("gru");
    let layer = Gru::new(inputs, hidden, 1, true, &mut rng, &DEVICE.plain());
    let (learning, x) = (tracked(&layer), matrix(steps * batch, inputs, &mut rng));
    let tracked_x = x.clone().autodiff().require_grad();
    both(
        criterion,
        "gru/10x50x400-2x200",
        || layer.forward(x.clone(), steps, None).0,
        || learning.forward(tracked_x.clone(), steps, None).0,
    );
}

/// One, two and three stages of IMPALA, and the Nature-CNN, over 64 images; the last layer gives one number.
pub fn convolutions(criterion: &mut Criterion) {
    let stages = |channels: &[usize]| CnnKind::Impala { channels: channels.to_vec(), feature: 1 };
    let kinds = [
        ("impala-16", stages(&[16])),
        ("impala-16-32", stages(&[16, 32])),
        ("impala-16-32-32", stages(&[16, 32, 32])),
        ("nature", CnnKind::Nature { feature: 1 }),
    ];
    for (name, kind) in kinds {
        let mut rng = rng("convolutions");
        let net = ImageNet::new(&kind, IMAGE, &mut rng, &DEVICE.plain()).expect("fits");
        let (learning, x) = (tracked(&net), image_tensor(pixels(64, &mut rng)));
        both(criterion, &format!("convolutions/{name}/64"), || net.forward(x.clone()), || learning.forward(x.clone()));
    }
}

/// Loops that touch each number once: tanh, the norm of gradients, and Adam.
pub fn numbers(criterion: &mut Criterion) {
    let mut rng = rng("numbers");
    let (rows, columns) = (512, 512);
    let x = matrix(rows, columns, &mut rng);
    criterion.bench_function("kernel/tanh/262144", |bencher| bencher.iter(|| Activation::Tanh.forward(x.clone())));
    let mut layer = tracked(&Linear::new(rows, columns, 1.0, &mut rng, &DEVICE.plain()));
    let loss = layer.forward(x).sum();
    let grads = NamedGrads::take(&mut layer, "", loss.backward()).expect("finite");
    criterion.bench_function("kernel/norm/262656", |bencher| bencher.iter(|| grads.norm()));
    let mut adam = Adam::new(AdamConfig::default());
    criterion.bench_function("kernel/adam/262656", |bencher| {
        among_awake_workers(|| bencher.iter(|| adam.step(&mut layer, "", &grads, 3e-4, 1.0).expect("fits")));
    });
}
