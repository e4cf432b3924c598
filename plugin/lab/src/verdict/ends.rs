//! Where episodes ended without the aim.

use std::collections::BTreeMap;

use bevy::math::{Rect, Vec2};

use super::level_verdict::EndPlace;

/// Squares along the longer side of a floor plan to which [`EndPlace`]s are rounded.
pub const END_SQUARES: f32 = 32.0;

/// The squares of a floor plan in which something ended, row by row from below. `ended` has places, and whether time was up
/// there. Places outside the plan belong to squares outside; what is no number is left out.
pub(super) fn end_places(bounds: Rect, ended: &[(Vec2, bool)]) -> Vec<EndPlace> {
    let side = bounds.width().max(bounds.height()) / END_SQUARES;
    if !(side.is_finite() && side > 0.0) {
        return Vec::new();
    }
    let mut counts: BTreeMap<(i32, i32), (u64, u64)> = BTreeMap::new();
    for (place, is_timed_out) in ended.iter().filter(|(place, _)| place.is_finite()) {
        let square = ((*place - bounds.min) / side).floor();
        let (lost, timed_out) = counts.entry((square.y as i32, square.x as i32)).or_default();
        *(if *is_timed_out { timed_out } else { lost }) += 1;
    }
    let place = |((row, column), (lost, timed_out)): ((i32, i32), (u64, u64))| EndPlace {
        x: bounds.min.x + (column as f32 + 0.5) * side,
        y: bounds.min.y + (row as f32 + 0.5) * side,
        lost,
        timed_out,
    };
    counts.into_iter().map(place).collect()
}
#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_counted_by_square_and_kind() {
        let bounds = Rect::new(-1.0, 0.0, 63.0, 10.0);
        let at = |x: f32, y: f32, is_timed_out| (Vec2::new(x, y), is_timed_out);
        let ended = [at(-0.5, 3.0, false), at(0.9, 2.5, true), at(5.0, 0.0, false), at(f32::NAN, 0.0, false)];
        let place = |x, y, lost, timed_out| EndPlace { x, y, lost, timed_out };
        assert_eq!(end_places(bounds, &ended), [place(6.0, 1.0, 1, 0), place(0.0, 3.0, 1, 1)]);
        assert!(end_places(Rect::new(0.0, 0.0, 0.0, 0.0), &ended).is_empty());
    }
}
