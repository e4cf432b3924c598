//! Names for skills that are points of a continuous space.
//!
//! A skill is named after the nearest of several fixed directions: the positive and the negative half of each axis of
//! z. That is the number of z that is furthest from 0, and its sign. So a name is independent of levels and draws,
//! and is the same in every test of a policy.

/// Largest number of axes with a name: further ones are left out.
const MOST_NUMBERS: usize = 16;

/// Returns the number of names for skills of this length; 0 without a skill.
pub(super) fn skill_count(z: &[f32]) -> usize {
    2 * z.len().min(MOST_NUMBERS)
}

/// Returns the number of a skill's name, below [`skill_count`]; of equally large numbers the first counts.
pub(super) fn skill_number(z: &[f32]) -> Option<usize> {
    let mut nearest: Option<(usize, f32)> = None;
    for (number, value) in z.iter().take(MOST_NUMBERS).enumerate() {
        if nearest.is_none_or(|(_, longest)| value.abs() > longest.abs()) {
            nearest = Some((number, *value));
        }
    }
    nearest.map(|(number, value)| 2 * number + usize::from(value < 0.0))
}

/// Returns the name: `z3+` for a skill whose third number is furthest from 0, and is positive.
pub(super) fn skill_name(number: usize) -> String {
    format!("z{}{}", number / 2 + 1, if number.is_multiple_of(2) { '+' } else { '-' })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_skill_is_called_by_its_number_furthest_from_zero() {
        let name = |z: &[f32]| skill_number(z).map(skill_name);
        assert_eq!(name(&[0.1, -0.2, 1.5]).as_deref(), Some("z3+"));
        assert_eq!(name(&[0.1, -2.0, 1.5]).as_deref(), Some("z2-"));
        assert_eq!(name(&[1.0, -1.0]).as_deref(), Some("z1+"));
        assert_eq!(name(&[]), None);
        let mut long = [0.5; 40];
        long[30] = 9.0;
        assert_eq!((name(&long).as_deref(), skill_count(&long)), (Some("z1+"), 32));
        assert_eq!((skill_count(&[0.0; 3]), skill_count(&[])), (6, 0));
    }
}
