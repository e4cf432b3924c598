//! Named parameters: a visitor over the tensors of a network.

use crate::{
    LearnError,
    device::{read, send},
    rng::{normal, unit},
};
use burn::tensor::{Device, Tensor, TensorData};
use rand::Rng;
use std::convert::Infallible;

/// A function that is applied to each parameter of a network in turn.
pub trait ParamVisitor {
    /// Visits a parameter. Called once per parameter, always in the same order. `name` is unique in the network.
    fn visit<const D: usize>(&mut self, name: &str, tensor: &mut Tensor<D>);
}

/// A network (or a part of one) that can name its parameters.
pub trait Parameters {
    /// Calls `visitor` with every parameter; `prefix` (may be empty) goes before each name.
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V);
}

/// Returns `prefix.name`, or `name` without a prefix.
pub(crate) fn path(prefix: &str, name: &str) -> String {
    if prefix.is_empty() { name.to_owned() } else { format!("{prefix}.{name}") }
}

struct Track;

impl ParamVisitor for Track {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        *tensor = tensor.clone().inner().autodiff().require_grad();
    }
}

struct Freeze;

impl ParamVisitor for Freeze {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        *tensor = tensor.clone().inner();
    }
}

/// Returns a copy of `network` whose parameters receive gradients. The numbers are shared, not copied.
pub fn tracked<M: Parameters + Clone>(network: &M) -> M {
    let mut copy = network.clone();
    copy.visit("", &mut Track);
    copy
}

/// Returns a copy of `network` for inference, outside of any gradient graph. The numbers are shared, not copied.
pub fn frozen<M: Parameters + Clone>(network: &M) -> M {
    let mut copy = network.clone();
    copy.visit("", &mut Freeze);
    copy
}

struct Move<'a>(&'a Device, Option<LearnError>);

impl ParamVisitor for Move<'_> {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        match read::<f32, _, _>(tensor.clone().inner()) {
            Ok(numbers) => *tensor = send(numbers, self.0),
            Err(error) => self.1 = Some(error),
        }
    }
}

/// Returns a copy with the same weights on `device`, without gradients.
///
/// # Errors
/// [`LearnError::Device`] if they cannot be read.
pub(crate) fn moved<M: Parameters + Clone>(network: &M, device: &Device) -> Result<M, LearnError> {
    let mut copy = network.clone();
    let mut visitor = Move(device, None);
    copy.visit("", &mut visitor);
    visitor.1.map_or(Ok(copy), Err)
}

struct Count(usize);

impl ParamVisitor for Count {
    fn visit<const D: usize>(&mut self, _: &str, tensor: &mut Tensor<D>) {
        self.0 += tensor.dims().iter().product::<usize>();
    }
}

/// Returns how many numbers the parameters of `network` hold.
pub fn parameter_count<M: Parameters + Clone>(network: &M) -> usize {
    let mut count = Count(0);
    network.clone().visit("", &mut count);
    count.0
}

// Sources of a new network's parameters: a generator or a file.

/// Starting values of a parameter.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Init {
    /// Zeros.
    Zeros,
    /// Ones.
    Ones,
    /// A matrix of `shape[0]` rows with orthonormal rows or columns, times this gain.
    Orthogonal(f64),
    /// Uniform in ± this bound.
    Uniform(f64),
}

/// A source of a network's parameters while it is made.
///
/// Only the function that makes a network knows its sizes. From a generator it makes a fresh network, from a file the
/// stored one. A file whose contents do not match its header is refused at the first tensor, before memory of a size
/// from the header is allocated. Since sizes may come from such a header, sums and products of them saturate.
pub(crate) trait ParamSource {
    /// The reason why a parameter is unavailable.
    type Error;

    /// Returns the parameter called `name`, of `shape`.
    ///
    /// # Errors
    /// [`Self::Error`] if there is no such parameter.
    fn param<const D: usize>(&mut self, name: &str, shape: [usize; D], init: Init) -> Result<Tensor<D>, Self::Error>;
}

/// Starting weights from a generator; no parameter is ever missing.
#[derive(Debug)]
pub(crate) struct RandomInit<'a, R: ?Sized> {
    pub(crate) rng: &'a mut R,
    pub(crate) device: &'a Device,
}

impl<R: Rng + ?Sized> ParamSource for RandomInit<'_, R> {
    type Error = Infallible;

    fn param<const D: usize>(&mut self, _: &str, shape: [usize; D], init: Init) -> Result<Tensor<D>, Infallible> {
        let numbers: usize = shape.iter().product();
        let values = match init {
            Init::Zeros => vec![0.0; numbers],
            Init::Ones => vec![1.0; numbers],
            Init::Orthogonal(gain) => orthogonal(shape[0], shape[1..].iter().product(), gain, self.rng),
            Init::Uniform(bound) => uniform(numbers, bound, self.rng),
        };
        Ok(send(TensorData::new(values, shape), self.device))
    }
}

// Starting weights.

/// Returns a `[inputs, outputs]` matrix, row-major, with orthonormal rows or columns (whichever are fewer) times
/// `gain`.
///
/// Saxe et al. 2013, "Exact solutions to the nonlinear dynamics of learning in deep linear neural networks".
/// Made by Gram and Schmidt's process (applied twice for accuracy) on normal numbers in double precision.
pub fn orthogonal<R: Rng + ?Sized>(inputs: usize, outputs: usize, gain: f64, rng: &mut R) -> Vec<f32> {
    let (count, length) = (inputs.min(outputs), inputs.max(outputs));
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(count);
    while basis.len() < count {
        let mut v: Vec<f64> = (0..length).map(|_| f64::from(normal(rng))).collect();
        for _ in 0..2 {
            for b in &basis {
                let along = dot(&v, b);
                v.iter_mut().zip(b).for_each(|(x, y)| *x -= along * y);
            }
        }
        let norm = dot(&v, &v).sqrt();
        if norm > 1e-6 {
            v.iter_mut().for_each(|x| *x /= norm);
            basis.push(v);
        }
    }
    let mut out = vec![0.0; inputs * outputs];
    for (k, b) in basis.iter().enumerate() {
        for (j, x) in b.iter().enumerate() {
            let at = if inputs <= outputs { k * outputs + j } else { j * outputs + k };
            out[at] = (x * gain) as f32;
        }
    }
    out
}

/// Returns `len` numbers uniform in [-bound, bound).
pub(crate) fn uniform<R: Rng + ?Sized>(len: usize, bound: f64, rng: &mut R) -> Vec<f32> {
    (0..len).map(|_| ((2.0 * unit(rng) - 1.0) * bound) as f32).collect()
}

/// Returns the dot product over eight lanes, so that the compiler can vectorise it.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut lanes = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(x, y)| x * y).sum();
    for (a, b) in a.zip(b) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(lane, (x, y))| *lane += x * y);
    }
    lanes.iter().sum::<f64>() + rest
}

// Conversion between flat host memory and tensors.

/// Creates a `[rows, width]` tensor.
pub fn matrix(values: Vec<f32>, rows: usize, width: usize, device: &Device) -> Tensor<2> {
    send(TensorData::new(values, [rows, width]), device)
}

/// Creates a `[len]` tensor.
pub fn vector(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let len = values.len();
    send(TensorData::new(values, [len]), device)
}

/// Returns the numbers of a tensor, row-major.
pub fn host<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, LearnError> {
    read::<f32, _, _>(tensor)?.try_into_vec().map_err(|e| LearnError::Device(e.to_string()))
}

/// Returns the number of a tensor of one element.
pub fn scalar(tensor: Tensor<1>) -> Result<f32, LearnError> {
    match host(tensor)?[..] {
        [number] => Ok(number),
        ref numbers => Err(LearnError::Device(format!("{} numbers instead of one", numbers.len()))),
    }
}

/// Value beyond which a loss has exploded: single precision cannot resolve its changes.
const EXPLODED: f32 = 1e12;

/// Returns the number of a `[1]` tensor, tracked or not, which must be finite and not have exploded; `steps`
/// optimizer steps were done before.
pub(crate) fn finite(name: &str, tensor: &Tensor<1>, steps: u64) -> Result<f64, LearnError> {
    let value = scalar(tensor.clone().inner())?;
    check_loss(name, value, steps)?;
    Ok(f64::from(value))
}

/// Checks that a loss is finite and has not exploded.
pub(crate) fn check_loss(name: &str, value: f32, steps: u64) -> Result<(), LearnError> {
    let tensor = name.to_owned();
    match value {
        value if !value.is_finite() => Err(LearnError::NotFinite { tensor, steps: Some(steps) }),
        value if value.abs() > EXPLODED => Err(LearnError::Exploded { tensor, value, steps }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Streams;

    #[test]
    fn columns_are_orthonormal_times_gain() {
        for (inputs, outputs) in [(7, 4), (4, 7), (5, 5)] {
            let w = orthogonal(inputs, outputs, 2.0, &mut Streams::new(1).stream("w", 0));
            let few = inputs.min(outputs);
            let vector = |k: usize| -> Vec<f64> {
                if inputs <= outputs {
                    (0..outputs).map(|j| f64::from(w[k * outputs + j])).collect()
                } else {
                    (0..inputs).map(|i| f64::from(w[i * outputs + k])).collect()
                }
            };
            for a in 0..few {
                for b in 0..few {
                    let want = if a == b { 4.0 } else { 0.0 };
                    assert!((dot(&vector(a), &vector(b)) - want).abs() < 1e-5);
                }
            }
        }
    }

    #[test]
    fn losses_that_ran_away_are_named() {
        assert!(check_loss("loss", -1e9, 7).is_ok());
        for (value, words) in [(f32::NAN, "`loss` is not finite after 7"), (-1e13, "`loss` has exploded: it is -1e13")]
        {
            let error = check_loss("loss", value, 7).expect_err("ran away");
            assert!(error.is_divergence() && error.to_string().contains(words), "{error}");
        }
    }
}
