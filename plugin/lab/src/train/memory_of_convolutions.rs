//! How large networks over images are.

use playbot_learner::{ImageShape, nn::CnnKind};

use super::memory_parts::product;

/// Pixels of a kernel of IMPALA's network.
const KERNEL: u64 = 9;
/// Convolutions within a stage of it: those of two residual blocks.
const WITHIN: u64 = 4;
/// Channels that the last convolution of the other network gives.
const LAST: u64 = 64;

/// Numbers that such a network learns at least.
pub(super) fn convolution_numbers(cnn: &CnnKind, image: ImageShape) -> u64 {
    match cnn {
        CnnKind::Impala { channels, feature } => {
            let (mut numbers, mut inputs) = (0u64, image.channels as u64);
            let (mut height, mut width) = (image.height as u64, image.width as u64);
            for outputs in channels.iter().map(|outputs| *outputs as u64) {
                let first = product(&[KERNEL, inputs, outputs]);
                numbers = numbers.saturating_add(first).saturating_add(product(&[WITHIN, KERNEL, outputs, outputs]));
                (inputs, height, width) = (outputs, height.div_ceil(2), width.div_ceil(2));
            }
            numbers.saturating_add(product(&[inputs, height, width, *feature as u64]))
        }
        CnnKind::Nature { feature } => product(&[LAST, *feature as u64]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_networks_without_their_offsets() {
        let image = ImageShape { channels: 3, height: 64, width: 64 };
        // 3 → 16 → 32 → 32 channels, and 32 × 8 × 8 numbers to 256 features.
        let stages = [3 * 16 + 4 * 16 * 16, 16 * 32 + 4 * 32 * 32, 32 * 32 + 4 * 32 * 32].map(|weights| 9 * weights);
        let expected = stages.iter().sum::<u64>() + 32 * 8 * 8 * 256;
        assert_eq!(convolution_numbers(&CnnKind::default(), image), expected);
        let huge = usize::MAX;
        for cnn in [
            CnnKind::Impala { channels: vec![huge, 32], feature: 256 },
            CnnKind::Impala { channels: vec![16], feature: huge },
            CnnKind::Nature { feature: huge },
        ] {
            assert_eq!(convolution_numbers(&cnn, image), u64::MAX, "{cnn:?}");
        }
    }
}
