//! Variants of a defect: first its positions along the path, then its strengths. So testers that get further find more.

/// Places: at the start, further on and late.
pub(crate) const PLACES: u32 = 3;

/// Returns the place of a variant, from 0.
pub(crate) fn place(variant: u32) -> usize {
    (variant % PLACES) as usize
}

/// Returns the strength of a variant.
pub(crate) fn pick<T: Copy>(strengths: &[T], variant: u32) -> T {
    strengths[(variant / PLACES) as usize % strengths.len()]
}

/// Returns the number of variants of a defect with so many strengths.
pub(crate) const fn variants(strengths: usize) -> u32 {
    PLACES * strengths as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_go_through_the_places_and_then_through_the_strengths() {
        assert_eq!((0..6).map(place).collect::<Vec<_>>(), [0, 1, 2, 0, 1, 2]);
        assert_eq!((variants(2), [2, 3].map(|variant| pick(&['a', 'b'], variant))), (6, ['a', 'b']));
    }
}
