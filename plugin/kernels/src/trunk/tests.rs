//! Tests of the trunk against burn's own operations, finite differences, other batches and other numbers of threads.

use crate::{
    among_workers::{Workers, among_awake_workers},
    elementwise::{Activation, Write},
    trunk::{grid::ConvShape, winograd::PointBuffers, *},
};
use burn::tensor::{Tensor, TensorData};
use playbot_learner::{
    DeviceKind,
    nn::{Conv2d, host, max_pool, vector},
    rng::{Streams, normal},
};

/// A stage of a test: outputs, kernel, stride.
#[derive(Clone, Copy, Debug)]
enum Part {
    Relu(usize, usize, usize),
    Same(usize, usize),
    Pool(usize),
    Residual,
}

/// A layer of the tensor path as the kernels read it.
fn view(conv: &Conv2d) -> Conv<'_> {
    Conv { weight: &conv.weight, bias: &conv.bias, stride: conv.stride, padding: conv.padding }
}

/// Convolutions in the order in which they are applied, two for a residual block.
struct Net {
    parts: Vec<Part>,
    convs: Vec<Conv2d>,
}

impl Net {
    fn new(parts: &[Part], mut channels: usize) -> Self {
        let device = DeviceKind::Flex.plain();
        let mut rng = Streams::new(3).stream("net", 0);
        let mut conv = |inputs, outputs, kernel| {
            let mut conv = Conv2d::new(inputs, outputs, kernel, 1.2, &mut rng, &device);
            let bias = (0..outputs).map(|_| 0.1 * normal(&mut rng)).collect();
            conv.bias = vector(bias, &device).autodiff().require_grad();
            conv.weight = conv.weight.autodiff().require_grad();
            conv
        };
        let mut convs = Vec::new();
        for part in parts {
            match *part {
                Part::Relu(outputs, kernel, stride) => {
                    convs.push(conv(channels, outputs, kernel).with_stride(stride));
                    channels = outputs;
                }
                Part::Same(outputs, kernel) => {
                    convs.push(conv(channels, outputs, kernel).with_padding(kernel / 2));
                    channels = outputs;
                }
                Part::Pool(outputs) => {
                    convs.push(conv(channels, outputs, 3).with_padding(1));
                    channels = outputs;
                }
                Part::Residual => convs.extend([0, 1].map(|_| conv(channels, channels, 3).with_padding(1))),
            }
        }
        Self { parts: parts.to_vec(), convs }
    }

    fn trunk(&self, pixels: &Tensor<4>) -> Tensor<2> {
        let mut convs = self.convs.iter();
        let mut next = || view(convs.next().expect("one for each part"));
        let stages = self.parts.iter().map(|part| match part {
            Part::Relu(..) | Part::Same(..) => TrunkStage::Relu(next()),
            Part::Pool(_) => TrunkStage::Pool(next()),
            Part::Residual => TrunkStage::Residual(next(), next()),
        });
        features(pixels, &stages.collect::<Vec<_>>()).expect("these stages fit")
    }

    fn plain(&self, pixels: &Tensor<4>) -> Tensor<2> {
        let relu = |x| Activation::Relu.forward(x);
        let mut convs = self.convs.iter();
        let mut next = |x| convs.next().expect("one for each part").forward(x);
        let x = self.parts.iter().fold(pixels.clone(), |x, part| match part {
            Part::Relu(..) | Part::Same(..) => relu(next(x)),
            Part::Pool(_) => max_pool(next(x), 3, 2, 1),
            Part::Residual => {
                let inner = relu(next(relu(x.clone())));
                x + next(inner)
            }
        });
        relu(x).flatten(1, 3)
    }

    /// Features, and the gradients of all parameters for features times `probe`.
    fn results(&self, features: Tensor<2>) -> Vec<Vec<f32>> {
        let [n, width] = features.dims();
        let probe = normals(n * width, 7);
        let probe = Tensor::from_data(TensorData::new(probe, [n, width]), &DeviceKind::Flex.plain());
        let grads = (features.clone() * probe).sum().backward();
        let mut results = vec![host(features.inner()).expect("readable")];
        for conv in &self.convs {
            results.push(host(conv.weight.grad(&grads).expect("tracked")).expect("readable"));
            results.push(host(conv.bias.grad(&grads).expect("tracked")).expect("readable"));
        }
        results
    }
}

fn normals(n: usize, seed: u64) -> Vec<f32> {
    let mut rng = Streams::new(seed).stream("numbers", 0);
    (0..n).map(|_| normal(&mut rng)).collect()
}

fn images(shape: [usize; 4]) -> Tensor<4> {
    Tensor::from_data(TensorData::new(normals(shape.iter().product(), 5), shape), &DeviceKind::Flex.plain())
}

const NATURE: [Part; 3] = [Part::Relu(32, 8, 4), Part::Relu(64, 4, 2), Part::Relu(64, 3, 1)];

const SMALL: [Part; 4] = [Part::Pool(4), Part::Residual, Part::Residual, Part::Pool(19)];

#[test]
fn features_and_gradients_are_those_of_separate_operations() {
    let valid = [Part::Relu(5, 5, 3), Part::Relu(18, 2, 2), Part::Relu(33, 1, 1)];
    let wide = [Part::Same(17, 3), Part::Pool(20), Part::Residual];
    // Blocks of 16 channels and even sides: with fewer products.
    let blocks = [Part::Pool(16), Part::Residual, Part::Pool(48), Part::Residual, Part::Same(32, 3)];
    let cases: [(&[Part], [usize; 4]); 12] = [
        (&NATURE, [1, 3, 64, 64]),
        (&NATURE, [11, 4, 36, 45]),
        (&valid, [3, 2, 29, 23]),
        (&valid, [300, 1, 11, 8]),
        (&SMALL, [1, 3, 17, 33]),
        (&SMALL, [19, 2, 6, 5]),
        (&SMALL, [2, 1, 1, 1]),
        (&[Part::Residual, Part::Pool(2)], [2, 3, 4, 2]),
        (&wide, [2, 3, 9, 12]),
        (&blocks, [3, 2, 16, 24]),
        (&blocks, [9, 16, 4, 8]),
        (&blocks, [2, 1, 40, 8]),
    ];
    for (parts, shape) in cases {
        let (net, pixels) = (Net::new(parts, shape[1]), images(shape));
        let (got, want) = (net.results(net.trunk(&pixels)), net.results(net.plain(&pixels)));
        for (k, (got, want)) in got.iter().zip(&want).enumerate() {
            let size = want.iter().fold(0.0f32, |size, x| size.max(x.abs()));
            assert!(size > 0.0 && got.len() == want.len(), "{parts:?} {shape:?} {k}");
            for (got, want) in got.iter().zip(want) {
                assert!((got - want).abs() < 2e-5 * size.max(1.0), "{parts:?} {shape:?} {k}: {got} is not {want}");
            }
        }
    }
    // Unsupported: the output of a ReLU is needed again, and a block would change it.
    let changed = Net::new(&[Part::Same(4, 3), Part::Residual], 1);
    let stages = [
        TrunkStage::Relu(view(&changed.convs[0])),
        TrunkStage::Residual(view(&changed.convs[1]), view(&changed.convs[2])),
    ];
    assert!(features(&images([1, 1, 6, 6]), &stages).is_none());
    // Unsupported, too: a border without keeping the size. The encoders then use burn's operations.
    let odd = Net::new(&[Part::Same(2, 5), Part::Pool(2)], 1);
    let unfit = odd.convs[1].clone().with_stride(2);
    let stages = [TrunkStage::Relu(view(&odd.convs[0])), TrunkStage::Relu(view(&unfit))];
    assert!(features(&images([1, 1, 6, 6]), &stages).is_none());
}

#[test]
fn gradients_are_slopes() {
    for parts in [&SMALL[..2], &[Part::Relu(3, 3, 2), Part::Relu(2, 2, 1)]] {
        let (mut net, pixels) = (Net::new(parts, 2), images([2, 2, 7, 8]));
        let found = net.results(net.trunk(&pixels));
        let probe = normals(found[0].len(), 7);
        for layer in 0..net.convs.len() {
            let shape = net.convs[layer].weight.dims();
            let weight = host(net.convs[layer].weight.clone().inner()).expect("readable");
            let size = found[1 + 2 * layer].iter().fold(0.0f32, |size, x| size.max(x.abs()));
            for k in (0..weight.len()).step_by(5) {
                let mut loss = |step: f32| -> f64 {
                    let mut weight = weight.clone();
                    weight[k] += step;
                    net.convs[layer].weight =
                        Tensor::from_data(TensorData::new(weight, shape), &DeviceKind::Flex.plain());
                    let features = host(net.trunk(&pixels)).expect("readable");
                    features.iter().zip(&probe).map(|(x, p)| f64::from(*x) * f64::from(*p)).sum()
                };
                let (left, here, right) = (loss(-2e-3), loss(0.0), loss(2e-3));
                // A ReLU or a largest pixel may change on one side.
                let slopes = [(here - left) / 2e-3, (right - here) / 2e-3];
                let got = f64::from(found[1 + 2 * layer][k]);
                let near = slopes.iter().any(|slope| (got - slope).abs() < 0.02 * f64::from(size));
                assert!(near, "{parts:?} {layer} {k}: {got} is none of {slopes:?}");
            }
            let weight = Tensor::from_data(TensorData::new(weight, shape), &DeviceKind::Flex.plain());
            net.convs[layer].weight = weight.autodiff().require_grad();
        }
    }
}

#[test]
fn an_image_is_the_same_in_any_batch_and_on_any_number_of_threads() {
    for (parts, side) in [(&NATURE[..], 40), (&SMALL[..], 20), (&[Part::Pool(16), Part::Residual], 24)] {
        let (net, pixels) = (Net::new(parts, 3), images([41, 3, side, side]));
        let on =
            |threads: usize| Workers::new(threads).bound(|| among_awake_workers(|| net.results(net.trunk(&pixels))));
        let whole = on(1);
        assert!(on(3) == whole, "{parts:?}: threads change bits");
        let width = whole[0].len() / 41;
        for (first, n) in [(0, 1), (40, 1), (7, 2), (9, 30)] {
            let part = host(net.trunk(&pixels.clone().narrow(0, first, n)).inner()).expect("readable");
            assert!(part == whole[0][first * width..(first + n) * width], "{parts:?}: {n} images from {first}");
        }
        // Without a graph the blocks of a stage share their memory.
        let frozen = net.convs.iter().map(|conv| Conv2d {
            weight: conv.weight.clone().inner(),
            bias: conv.bias.clone().inner(),
            stride: conv.stride,
            padding: conv.padding,
        });
        let frozen = Net { parts: net.parts.clone(), convs: frozen.collect() };
        assert!(host(frozen.trunk(&pixels)).expect("readable") == whole[0], "{parts:?}: without a graph");
    }
}

#[test]
fn what_is_no_number_is_not_hidden() {
    for parts in [&NATURE[..], &SMALL[..]] {
        let net = Net::new(parts, 1);
        let mut pixels = vec![0.5; 40 * 40];
        pixels[17 * 40 + 17] = f32::NAN;
        let pixels = Tensor::from_data(TensorData::new(pixels, [1, 1, 40, 40]), &DeviceKind::Flex.plain());
        let features = host(net.trunk(&pixels).inner()).expect("readable");
        assert!(features.iter().any(|x| x.is_nan()), "{parts:?}");
    }
}

#[test]
fn fewer_products_stay_near_the_numbers_of_double_precision() {
    for (inputs, outputs, height, width) in [(16, 16, 2, 2), (32, 48, 6, 14), (48, 32, 10, 4), (64, 64, 8, 8)] {
        let conv = ConvShape { inputs, outputs, kernel: 3, stride: 1, padding: 1 };
        assert!(crate::trunk::winograd::fits(conv, height, width));
        let layer = crate::trunk::layer::Layer::new(conv, height, width).expect("a convolution");
        let params: Vec<f32> = normals(layer.params(), 11).iter().map(|x| x / (3.0 * inputs as f32).sqrt()).collect();
        let image = normals(inputs * height * width, 12);
        let mut x = vec![0.0; layer.input.len()];
        layer.input.read(&image, &mut x);
        let mut y = vec![0.0; layer.output.len()];
        layer.forward(&x, &layer.weights(&params, false), &mut PointBuffers::default(), Write(&mut y));
        let mut got = vec![0.0; outputs * height * width];
        layer.output.write(&y, &mut got, |x| x);
        let (weights, bias) = params.split_at(outputs * inputs * 9);
        let exact = |o: usize, row: usize, column: usize| -> f64 {
            let mut sum = f64::from(bias[o]);
            for (number, weight) in weights[o * inputs * 9..][..inputs * 9].iter().enumerate() {
                let (i, dy, dx) = (number / 9, number % 9 / 3, number % 3);
                let (row, column) = (row + dy, column + dx);
                if (1..=height).contains(&row) && (1..=width).contains(&column) {
                    sum += f64::from(*weight) * f64::from(image[(i * height + row - 1) * width + column - 1]);
                }
            }
            sum
        };
        let want: Vec<f64> =
            (0..got.len()).map(|n| exact(n / (height * width), n / width % height, n % width)).collect();
        let size = want.iter().fold(0.0f64, |size, x| size.max(x.abs()));
        for (got, want) in got.iter().zip(&want) {
            let error = (f64::from(*got) - want).abs() / size;
            assert!(error < 1e-6, "{inputs} to {outputs}, {height} x {width}: {got} is not {want}");
        }
    }
}
