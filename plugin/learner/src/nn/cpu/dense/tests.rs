//! The operation against plain tensor operations.

use super::dense;
use crate::DeviceKind;
use crate::nn::{Activation, host, matrix, vector};
use crate::rng::{ChaCha8Rng, Streams, below, normal};
use burn::tensor::{Device, Tensor, module::linear};
use rayon::ThreadPoolBuilder;

type Layer = fn(&Tensor<2>, &Tensor<2>, &Tensor<1>, Option<Activation>) -> Tensor<2>;

fn own(x: &Tensor<2>, weight: &Tensor<2>, bias: &Tensor<1>, activation: Option<Activation>) -> Tensor<2> {
    dense(x, weight, bias, activation).expect("flex has it")
}

fn plain(x: &Tensor<2>, weight: &Tensor<2>, bias: &Tensor<1>, activation: Option<Activation>) -> Tensor<2> {
    let y = linear(x.clone(), weight.clone(), Some(bias.clone()));
    match activation {
        None => y,
        Some(activation) => activation.forward(y),
    }
}

/// What goes in.
struct Case {
    shape: [usize; 3],
    activation: Option<Activation>,
    x: Vec<f32>,
    weight: Vec<f32>,
    bias: Vec<f32>,
    wanted: Vec<f32>,
}

impl Case {
    fn new(shape: [usize; 3], activation: Option<Activation>, rng: &mut ChaCha8Rng) -> Self {
        let [n, inputs, outputs] = shape;
        let size = 1.0 / (inputs as f32).sqrt();
        let mut numbers = |count: usize, size: f32| -> Vec<f32> { (0..count).map(|_| size * normal(rng)).collect() };
        let (x, weight) = (numbers(n * inputs, 1.0), numbers(inputs * outputs, size));
        Self { shape, activation, x, weight, bias: numbers(outputs, 0.1), wanted: numbers(n * outputs, 1.0) }
    }

    /// The output, and the gradients of input, weights and biases.
    fn run(&self, layer: Layer) -> [Vec<f32>; 4] {
        let device: Device = DeviceKind::Flex.plain();
        let [n, inputs, outputs] = self.shape;
        let x = matrix(self.x.clone(), n, inputs, &device).autodiff().require_grad();
        let weight = matrix(self.weight.clone(), inputs, outputs, &device).autodiff().require_grad();
        let bias = vector(self.bias.clone(), &device).autodiff().require_grad();
        let y = layer(&x, &weight, &bias, self.activation);
        let wanted = matrix(self.wanted.clone(), n, outputs, &device).autodiff();
        let grads = (y.clone() * wanted).sum().backward();
        let read = |tensor: Option<Tensor<2>>| host(tensor.expect("tracked")).expect("readable");
        let of_bias = host(bias.grad(&grads).expect("tracked")).expect("readable");
        [host(y.inner()).expect("readable"), read(x.grad(&grads)), read(weight.grad(&grads)), of_bias]
    }
}

fn cases() -> impl Iterator<Item = Case> {
    let mut rng = Streams::new(5).stream("dense", 0);
    let mut shapes = vec![[1, 1, 1], [1, 37, 200], [64, 200, 200], [65, 37, 16], [130, 563, 15], [600, 40, 33]];
    shapes.extend((0..30).map(|_| [150, 90, 70].map(|most| 1 + below(&mut rng, most) as usize)));
    let kinds = [None, Some(Activation::Relu), Some(Activation::Tanh)];
    shapes.into_iter().enumerate().map(move |(number, shape)| Case::new(shape, kinds[number % 3], &mut rng))
}

#[test]
fn outputs_and_gradients_agree_with_plain_operations() {
    for case in cases() {
        let pairs = case.run(own).into_iter().zip(case.run(plain));
        for (what, (got, want)) in ["output", "input", "weights", "biases"].iter().zip(pairs) {
            assert_eq!(got.len(), want.len());
            let size = want.iter().fold(1.0f32, |size, x| size.max(x.abs()));
            let worst = got.iter().zip(&want).map(|(got, want)| (got - want).abs()).fold(0.0, f32::max);
            assert!(worst <= 4e-6 * size, "{what} of {:?}: {worst} of {size}", case.shape);
        }
    }
}

#[test]
fn a_row_does_not_depend_on_the_others_and_nothing_on_threads() {
    for case in cases() {
        let on = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| case.run(own))
        };
        let alone = on(1);
        assert!(alone == on(3), "{:?}", case.shape);
        let [n, inputs, outputs] = case.shape;
        let row = below(&mut Streams::new(n as u64).stream("row", 0), n as u64) as usize;
        let of = |numbers: &[f32], width: usize| numbers[row * width..][..width].to_vec();
        let one = Case {
            shape: [1, inputs, outputs],
            x: of(&case.x, inputs),
            wanted: of(&case.wanted, outputs),
            weight: case.weight.clone(),
            bias: case.bias.clone(),
            ..case
        };
        let [y, of_x, ..] = one.run(own);
        assert!(y == of(&alone[0], outputs) && of_x == of(&alone[1], inputs), "{:?}", case.shape);
    }
}

#[test]
fn what_is_constant_has_no_gradient_and_nan_stays() {
    let device = DeviceKind::Flex.plain();
    let (weight, bias) = (matrix(vec![1.0; 6], 3, 2, &device), vector(vec![0.5; 2], &device));
    let weight = weight.autodiff().require_grad();
    let x = matrix(vec![1.0, 2.0, f32::NAN], 1, 3, &device).autodiff();
    let y = own(&x, &weight, &bias.clone().autodiff(), Some(Activation::Relu));
    assert!(host(y.clone().inner()).expect("readable").iter().all(|y| y.is_nan()));
    let grads = y.sum().backward();
    assert!(weight.grad(&grads).is_some() && x.grad(&grads).is_none());
    let empty = Tensor::<2>::zeros([0, 3], &device);
    assert!(dense(&empty, &weight.inner(), &bias, None).is_none());
}
