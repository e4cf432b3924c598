//! Convolution and pooling over images `[n, channels, height, width]`.

use crate::{
    ObsKind, Observations,
    device::send,
    nn::{
        matrix,
        params::{Init, ParamSource, ParamVisitor, Parameters, RandomInit, path},
    },
};
use burn::tensor::{
    Device, Int, Tensor, TensorData,
    module::{conv2d, max_pool2d},
    ops::{ConvOptions, MaxPoolOptions},
};
use playbot_kernels::{
    host_numbers::is_host,
    kept_memory::{OF_A_MOVE, share},
    trunk::Conv,
};
use rand::Rng;

/// A two-dimensional convolution (cross-correlation) with a square kernel.
#[derive(Clone, Debug)]
pub struct Conv2d {
    /// `[outputs, inputs, kernel, kernel]`.
    pub weight: Tensor<4>,
    /// `[outputs]`.
    pub bias: Tensor<1>,
    /// Pixels from one position of the kernel to the next.
    pub stride: usize,
    /// Zeros around the image.
    pub padding: usize,
}

impl Conv2d {
    /// Creates a layer of `inputs` to `outputs` channels, stride 1, no padding. Orthogonal weights times `gain` (one
    /// row of the matrix per output channel), zero bias.
    pub fn new<R: Rng + ?Sized>(
        inputs: usize,
        outputs: usize,
        kernel: usize,
        gain: f64,
        rng: &mut R,
        device: &Device,
    ) -> Self {
        let Ok(layer) = Self::build(&mut RandomInit { rng, device }, "", inputs, outputs, kernel, gain);
        layer
    }

    /// Creates a layer as [`Self::new`], with parameters out of `source`.
    pub(crate) fn build<S: ParamSource>(
        source: &mut S,
        prefix: &str,
        inputs: usize,
        outputs: usize,
        kernel: usize,
        gain: f64,
    ) -> Result<Self, S::Error> {
        let shape = [outputs, inputs, kernel, kernel];
        Ok(Self {
            weight: source.param(&path(prefix, "weight"), shape, Init::Orthogonal(gain))?,
            bias: source.param(&path(prefix, "bias"), [outputs], Init::Zeros)?,
            stride: 1,
            padding: 0,
        })
    }

    /// Sets another stride.
    pub fn with_stride(self, stride: usize) -> Self {
        Self { stride, ..self }
    }

    /// Sets the zeros around the image.
    pub fn with_padding(self, padding: usize) -> Self {
        Self { padding, ..self }
    }

    /// Returns the layer as the kernels read it.
    pub(super) fn view(&self) -> Conv<'_> {
        Conv { weight: &self.weight, bias: &self.bias, stride: self.stride, padding: self.padding }
    }

    /// Maps `[n, inputs, height, width]` to `[n, outputs, height', width']`, each side by
    /// [`window_places`](crate::nn::window_places).
    pub fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let options = ConvOptions::new([self.stride; 2], [self.padding; 2], [1; 2], 1);
        conv2d(x, self.weight.clone(), Some(self.bias.clone()), options)
    }
}

impl Parameters for Conv2d {
    fn visit<V: ParamVisitor>(&mut self, prefix: &str, visitor: &mut V) {
        visitor.visit(&path(prefix, "weight"), &mut self.weight);
        visitor.visit(&path(prefix, "bias"), &mut self.bias);
    }
}

/// Returns the largest number in each square of `kernel` pixels; padding is never the largest.
pub fn max_pool(x: Tensor<4>, kernel: usize, stride: usize, padding: usize) -> Tensor<4> {
    let options = MaxPoolOptions::new([kernel; 2]).with_stride([stride; 2]).with_padding([padding; 2]);
    max_pool2d(x, options)
}

/// Bytes in a word; cards without a byte type have words of 32 bits.
const BYTES: usize = 4;

/// Images of bytes, four to a word. They are sent to a graphics card as bytes, which saves transfer time, and converted
/// to numbers when a network reads them.
#[derive(Clone, Debug)]
pub(crate) struct PackedPixels {
    /// `[n, words]`; the last word of an image may have unused bytes.
    words: Tensor<2, Int>,
    sides: [usize; 3],
}

impl PackedPixels {
    /// Sends images `[n, channels, height, width]` of `sides` = `[channels, height, width]` to `device`.
    pub(crate) fn send(pixels: &[u8], sides: [usize; 3], device: &Device) -> Self {
        let size = sides.iter().product::<usize>().max(1);
        let word = |bytes: &[u8]| {
            let mut whole = [0; BYTES];
            whole[..bytes.len()].copy_from_slice(bytes);
            i32::from_le_bytes(whole)
        };
        let words: Vec<i32> = pixels.chunks(size).flat_map(|image| image.chunks(BYTES).map(word)).collect();
        let shape = [pixels.len() / size, size.div_ceil(BYTES)];
        Self { words: send(TensorData::new(words, shape), device), sides }
    }

    /// Returns some of the images, which may repeat.
    pub(crate) fn select(&self, rows: Tensor<1, Int>) -> Self {
        Self { words: self.words.clone().select(0, rows), sides: self.sides }
    }

    /// Returns images of the same size, one after the other.
    ///
    /// # Panics
    /// If there are none.
    pub(crate) fn joined(mut parts: Vec<Self>) -> Self {
        match parts.len() {
            1 => parts.remove(0),
            _ => Self {
                sides: parts[0].sides,
                words: Tensor::cat(parts.into_iter().map(|part| part.words).collect(), 0),
            },
        }
    }

    /// Returns numbers in 0..1, `[n, channels, height, width]`.
    pub(crate) fn numbers(self) -> Tensor<4> {
        let ([n, words], [channels, height, width]) = (self.words.dims(), self.sides);
        let byte = |place: usize| -> Tensor<3, Int> {
            let shifted = self.words.clone().bitwise_right_shift_scalar((8 * place) as i64);
            shifted.bitwise_and_scalar(255).unsqueeze_dim(2)
        };
        let bytes = Tensor::cat((0..BYTES).map(byte).collect(), 2).reshape([n, words * BYTES]);
        let bytes = bytes.narrow(1, 0, channels * height * width);
        bytes.float().reshape([n, channels, height, width]) / 255.0
    }
}

/// A batch of observations on a device, one per row.
#[derive(Clone, Debug)]
pub enum ObsBatch {
    /// `[n, width]`.
    Vector(Tensor<2>),
    /// Pixels divided by 255, `[n, channels, height, width]`.
    Image(Tensor<4>),
}

impl ObsBatch {
    /// Moves whole observations of `kind` to `device`.
    pub(crate) fn new(observations: Observations, kind: &ObsKind, device: &Device) -> Self {
        let rows = observations.numbers() / kind.numbers().max(1);
        match (observations, kind) {
            (Observations::Vector(values), _) => Self::Vector(matrix(values, rows, kind.numbers(), device)),
            (Observations::Image(pixels), ObsKind::Image(shape)) => {
                Self::pixels(pixels, [rows, shape.channels, shape.height, shape.width], device)
            }
            (Observations::Image(_), ObsKind::Vector(_)) => {
                unreachable!("observations are checked to be of their kind")
            }
        }
    }

    /// Creates images from their pixels, row-major in `shape` = `[n, channels, height, width]`.
    ///
    /// # Panics
    /// If the number of pixels does not match the shape.
    pub fn pixels(pixels: Vec<u8>, shape: [usize; 4], device: &Device) -> Self {
        let [rows, sides @ ..] = shape;
        Self::Image(Self::gather(&pixels, sides, &(0..rows).collect::<Vec<_>>(), device))
    }

    /// Returns the tensor of [`Self::pixels`] for some `rows` of many images of `sides` = `[channels, height,
    /// width]`: from the bytes to the numbers in one pass.
    ///
    /// # Panics
    /// If a row does not exist.
    pub(crate) fn gather(pixels: &[u8], sides: [usize; 3], rows: &[usize], device: &Device) -> Tensor<4> {
        let [channels, height, width] = sides;
        let size = channels * height * width;
        if !is_host(device) {
            let bytes: Vec<u8> = rows.iter().flat_map(|&row| &pixels[row * size..(row + 1) * size]).copied().collect();
            return PackedPixels::send(&bytes, sides, device).numbers();
        }
        let mut numbers = vec![0.0f32; rows.len() * size];
        let moves = numbers.len() * OF_A_MOVE;
        share(&mut numbers, size.max(1), moves, |image, numbers| {
            let bytes = &pixels[rows[image] * size..][..size];
            numbers.iter_mut().zip(bytes).for_each(|(x, &byte)| *x = f32::from(byte) / 255.0);
        });
        send(TensorData::new(numbers, [rows.len(), channels, height, width]), device)
    }

    /// Returns the number of observations.
    pub fn rows(&self) -> usize {
        match self {
            Self::Vector(x) => x.dims()[0],
            Self::Image(x) => x.dims()[0],
        }
    }

    /// Returns the first `n` observations.
    pub fn first(&self, n: usize) -> Self {
        match self {
            Self::Vector(x) => Self::Vector(x.clone().narrow(0, 0, n)),
            Self::Image(x) => Self::Image(x.clone().narrow(0, 0, n)),
        }
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;
    use crate::{
        DeviceKind,
        nn::{host, vector, window_places},
        rng::Streams,
    };

    #[test]
    fn a_convolution_by_hand() {
        for kind in DeviceKind::CPU {
            let device = kind.plain();
            let mut conv = Conv2d::new(1, 1, 2, 1.0, &mut Streams::new(1).stream("c", 0), &device).with_stride(2);
            conv.weight = Tensor::from_data(TensorData::new(vec![1.0f32, 10.0, 100.0, 1000.0], [1, 1, 2, 2]), &device);
            conv.bias = vector(vec![0.5], &device);
            let x = Tensor::from_data(TensorData::new((0..16).map(|i| i as f32).collect(), [1, 1, 4, 4]), &device);
            // The corners of the four squares: 0 1 4 5 | 2 3 6 7 | 8 9 12 13 | 10 11 14 15.
            let y = conv.forward(x.clone());
            assert_eq!(host(y).expect("readable"), [5410.5, 7632.5, 14298.5, 16520.5]);
            // Of the padded pooling windows the first sees 0 1 4 5, the last 5 6 7 9 10 11 13 14 15.
            let pooled = max_pool(x.neg(), 3, 2, 1);
            assert_eq!(pooled.dims(), [1, 1, 2, 2]);
            assert_eq!(host(pooled).expect("readable"), [0.0, -1.0, -4.0, -5.0]);
        }
    }

    #[test]
    fn windows_must_fit() {
        assert_eq!(window_places(64, 3, 2, 1), Some(32));
        assert_eq!(window_places(7, 8, 4, 0), None);
        assert_eq!(window_places(8, 8, 4, 0), Some(1));
    }

    #[test]
    fn bytes_come_back_as_numbers_on_every_device() {
        for kind in DeviceKind::BUILT.iter().filter(|kind| kind.check().is_ok()) {
            let device = kind.plain();
            let pixels: Vec<u8> = (0..3 * 15).map(|i| (i * 91 % 256) as u8).collect();
            let packed = PackedPixels::send(&pixels, [3, 1, 5], &device);
            let rows = Tensor::from_data(TensorData::new(vec![2i32, 0], [2]), &device);
            let images = packed.select(rows).numbers();
            assert_eq!(images.dims(), [2, 3, 1, 5]);
            let want = pixels[30..].iter().chain(&pixels[..15]).map(|&byte| f32::from(byte) / 255.0);
            for (found, want) in host(images).expect("readable").into_iter().zip(want) {
                assert!((found - want).abs() < 1e-6, "{kind}: {found} for {want}");
            }
        }
    }

    #[test]
    fn rows_of_bytes_become_numbers_from_0_to_1() {
        let bytes: Vec<u8> = (0..=255).collect();
        for kind in DeviceKind::CPU {
            let device = kind.plain();
            let x = ObsBatch::gather(&bytes, [2, 4, 8], &[3, 0, 3], &device);
            assert_eq!(x.dims(), [3, 2, 4, 8]);
            let want: Vec<f32> =
                [3, 0, 3].iter().flat_map(|row| row * 64..row * 64 + 64).map(|i| i as f32 / 255.0).collect();
            assert_eq!(host(x).expect("readable"), want);
            let whole = ObsBatch::pixels(bytes.clone(), [4, 2, 4, 8], &device);
            assert_eq!(whole.rows(), 4);
        }
    }
}
