//! Tests of the operation against plain tensor operations.

use crate::{
    among_workers::among_awake_workers,
    dense::{Dense, dense},
    elementwise::Activation,
};
use burn::tensor::{Device, Tensor, module::linear};
use playbot_learner::{
    DeviceKind,
    nn::{host, matrix, vector},
    rng::{ChaCha8Rng, Streams, below, normal},
};
use rayon::ThreadPoolBuilder;

type Chain = fn(&Tensor<2>, &[Dense<'_>]) -> Tensor<2>;

fn own(x: &Tensor<2>, layers: &[Dense<'_>]) -> Tensor<2> {
    dense(x, layers).expect("flex has it")
}

fn plain(x: &Tensor<2>, layers: &[Dense<'_>]) -> Tensor<2> {
    layers.iter().fold(x.clone(), |x, layer| {
        let y = linear(x, layer.weight.clone(), Some(layer.bias.clone()));
        match layer.activation {
            None => y,
            Some(activation) => activation.forward(y),
        }
    })
}

/// A chain of layers with its input.
#[derive(Clone)]
struct Case {
    n: usize,
    /// Numbers before the first layer and after each.
    widths: Vec<usize>,
    activations: Vec<Option<Activation>>,
    x: Vec<f32>,
    params: Vec<(Vec<f32>, Vec<f32>)>,
    wanted: Vec<f32>,
}

impl Case {
    fn new(n: usize, widths: &[usize], activations: &[Option<Activation>], rng: &mut ChaCha8Rng) -> Self {
        let mut numbers = |count: usize, size: f32| -> Vec<f32> { (0..count).map(|_| size * normal(rng)).collect() };
        let x = numbers(n * widths[0], 1.0);
        let params = widths.windows(2).map(|pair| {
            let size = 1.0 / (pair[0] as f32).sqrt();
            (numbers(pair[0] * pair[1], size), numbers(pair[1], 0.1))
        });
        let params = params.collect();
        let wanted = numbers(n * widths[widths.len() - 1], 1.0);
        Self { n, widths: widths.to_vec(), activations: activations.to_vec(), x, params, wanted }
    }

    /// Returns the output, and the gradients of the input and of each layer's weights and biases.
    fn run(&self, chain: Chain) -> Vec<Vec<f32>> {
        let device: Device = DeviceKind::Flex.plain();
        let (inputs, outputs) = (self.widths[0], self.widths[self.widths.len() - 1]);
        let x = matrix(self.x.clone(), self.n, inputs, &device).autodiff().require_grad();
        let params = self.params.iter().zip(self.widths.windows(2)).map(|((weight, bias), pair)| {
            let weight = matrix(weight.clone(), pair[0], pair[1], &device).autodiff().require_grad();
            (weight, vector(bias.clone(), &device).autodiff().require_grad())
        });
        let params: Vec<_> = params.collect();
        let layers = params.iter().zip(&self.activations);
        let layers = layers.map(|((weight, bias), &activation)| Dense { weight, bias, activation });
        let y = chain(&x, &layers.collect::<Vec<_>>());
        let wanted = matrix(self.wanted.clone(), self.n, outputs, &device).autodiff();
        let grads = (y.clone() * wanted).sum().backward();
        let mut found = vec![host(y.inner()).expect("readable"), read(x.grad(&grads))];
        for (weight, bias) in params {
            found.extend([read(weight.grad(&grads)), read(bias.grad(&grads))]);
        }
        found
    }
}

fn read<const D: usize>(grad: Option<Tensor<D>>) -> Vec<f32> {
    host(grad.expect("tracked")).expect("readable")
}

/// Returns single layers and chains of them, in odd shapes. With this seed no sum is so close to the kink of a ReLU
/// that another order of adding moves it across.
fn cases() -> impl Iterator<Item = Case> {
    let mut rng = Streams::new(6).stream("dense", 0);
    let mut shapes = vec![
        (1, vec![1, 1]),
        (1, vec![37, 200]),
        (64, vec![200, 200]),
        (65, vec![37, 16]),
        (130, vec![563, 15]),
        (600, vec![40, 33]),
        (64, vec![37, 200, 200, 8]),
        (33, vec![1, 1, 1, 1, 1, 1]),
        (600, vec![9, 50, 17, 31, 64, 3]),
    ];
    shapes.extend((0..40).map(|_| {
        let mut up_to = |most: u64| 1 + below(&mut rng, most) as usize;
        let layers = up_to(6);
        (up_to(150), (0..=layers).map(|_| up_to(90)).collect())
    }));
    let kinds = [None, Some(Activation::Relu), Some(Activation::Tanh)];
    shapes.into_iter().enumerate().map(move |(number, (n, widths))| {
        let activations: Vec<_> = (1..widths.len()).map(|layer| kinds[(number + layer) % 3]).collect();
        Case::new(n, &widths, &activations, &mut rng)
    })
}

#[test]
fn outputs_and_gradients_agree_with_plain_operations() {
    for case in cases() {
        for (place, (got, want)) in case.run(own).into_iter().zip(case.run(plain)).enumerate() {
            assert_eq!(got.len(), want.len());
            let size = want.iter().fold(1.0f32, |size, x| size.max(x.abs()));
            let worst = got.iter().zip(&want).map(|(got, want)| (got - want).abs()).fold(0.0, f32::max);
            assert!(worst <= 4e-6 * size, "number {place} of {} x {:?}: {worst} of {size}", case.n, case.widths);
        }
    }
}

#[test]
fn a_row_does_not_depend_on_the_others_and_nothing_on_threads() {
    for case in cases() {
        let on = |threads: usize| {
            let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
            pool.install(|| among_awake_workers(|| case.run(own)))
        };
        let alone = on(1);
        assert!(alone == on(3), "{:?}", case.widths);
        let row = below(&mut Streams::new(case.n as u64).stream("row", 0), case.n as u64) as usize;
        let of = |numbers: &[f32], width: usize| numbers[row * width..][..width].to_vec();
        let (inputs, outputs) = (case.widths[0], case.widths[case.widths.len() - 1]);
        let one = Case { n: 1, x: of(&case.x, inputs), wanted: of(&case.wanted, outputs), ..case.clone() }.run(own);
        assert!(one[0] == of(&alone[0], outputs) && one[1] == of(&alone[1], inputs), "{:?}", case.widths);
    }
}

#[test]
fn what_is_constant_has_no_gradient_and_nan_stays() {
    let device = DeviceKind::Flex.plain();
    let (weight, bias) = (matrix(vec![1.0; 6], 3, 2, &device), vector(vec![0.5; 2], &device));
    let (weight, bias) = (weight.autodiff().require_grad(), bias.autodiff());
    let layers = [Dense { weight: &weight, bias: &bias, activation: Some(Activation::Relu) }];
    let x = matrix(vec![1.0, 2.0, f32::NAN], 1, 3, &device).autodiff();
    let y = own(&x, &layers);
    assert!(host(y.clone().inner()).expect("readable").iter().all(|y| y.is_nan()));
    let grads = y.sum().backward();
    assert!(weight.grad(&grads).is_some() && x.grad(&grads).is_none() && bias.grad(&grads).is_none());
    let x = x.require_grad();
    let (weight, bias) = (weight.inner().autodiff(), bias.inner().autodiff());
    let layers = [Dense { weight: &weight, bias: &bias, activation: None }];
    let grads = own(&x, &layers).sum().backward();
    assert!(weight.grad(&grads).is_none() && x.grad(&grads).is_some());
    assert!(dense(&Tensor::<2>::zeros([0, 3], &device), &layers).is_none());
}
