//! Pixels on a graphics card: sent as bytes, which saves transfer time, and converted to numbers when a network reads
//! them.

use burn::tensor::{Device, Int, Tensor, TensorData};

/// Bytes in a word; cards without a byte type have words of 32 bits.
const BYTES: usize = 4;

/// Images of bytes, four to a word.
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
        Self { words: Tensor::from_data(TensorData::new(words, shape), device), sides }
    }

    /// Returns some of the images, which may repeat.
    pub(crate) fn select(&self, rows: Tensor<1, Int>) -> Self {
        Self { words: self.words.clone().select(0, rows), sides: self.sides }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DeviceKind;
    use crate::nn::host;

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
}
