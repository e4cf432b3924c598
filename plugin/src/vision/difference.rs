//! The difference between two pictures of the same state.

use serde::Serialize;

/// A difference, out of 255, that a person does not see and a policy should not mind.
pub const CLOSE: u8 = 8;

/// The difference between two pictures of the same size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Difference {
    /// Mean absolute difference over pixels and the three colours, of 255.
    pub mean: f64,
    /// Share of pixels whose three colours are all within [`CLOSE`] of each other.
    pub close: f64,
}

impl Difference {
    /// Compares pixel by pixel, ignoring the fourth byte. Returns `None` if the sizes differ or are
    /// 0.
    pub fn between(a: &[[u8; 4]], b: &[[u8; 4]]) -> Option<Self> {
        if a.len() != b.len() || a.is_empty() {
            return None;
        }
        let (mut sum, mut close) = (0_u64, 0_u64);
        for (a, b) in a.iter().zip(b) {
            let apart = [0, 1, 2].map(|colour| a[colour].abs_diff(b[colour]));
            sum += apart.iter().map(|&d| u64::from(d)).sum::<u64>();
            close += u64::from(apart.iter().all(|&d| d <= CLOSE));
        }
        let pixels = a.len() as f64;
        Some(Self { mean: sum as f64 / (3.0 * pixels), close: close as f64 / pixels })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_colours_and_pixels() {
        let a = [[10, 20, 30, 255], [0, 0, 0, 255]];
        let b = [[18, 20, 30, 0], [0, 9, 3, 0]];
        let difference = Difference::between(&a, &b).expect("one size");
        assert_eq!(difference, Difference { mean: 20.0 / 6.0, close: 0.5 });
        assert_eq!(Difference::between(&a, &b[..1]), None);
        assert_eq!(Difference::between(&[], &[]), None);
    }
}
