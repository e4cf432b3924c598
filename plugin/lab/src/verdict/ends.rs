//! Positions and causes of episodes that ended without the goal.

use std::collections::BTreeMap;

use bevy::math::{Rect, Vec2};

use super::level_verdict::EndPlace;

/// Squares along the longer side of a floor plan to which [`EndPlace`]s are rounded.
pub const END_SQUARES: f32 = 32.0;

/// The end of an episode without the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FailedEnd {
    /// Position, if the game reports it.
    pub place: Option<Vec2>,
    /// True if time was up.
    pub is_timed_out: bool,
    /// Cause, if the game reports it.
    pub cause: Option<&'static str>,
}

/// Returns the squares of a floor plan in which episodes ended, row by row from below. Positions outside the plan
/// belong to squares outside; positions that are not finite are left out.
pub(super) fn end_places(bounds: Rect, ended: &[FailedEnd]) -> Vec<EndPlace> {
    let side = bounds.width().max(bounds.height()) / END_SQUARES;
    if !(side.is_finite() && side > 0.0) {
        return Vec::new();
    }
    let mut counts: BTreeMap<(i32, i32), EndPlace> = BTreeMap::new();
    for end in ended {
        let Some(place) = end.place.filter(|place| place.is_finite()) else { continue };
        let square = ((place - bounds.min) / side).floor();
        let (column, row) = (square.x as i32, square.y as i32);
        let counted = counts.entry((row, column)).or_insert_with(|| EndPlace {
            x: bounds.min.x + (column as f32 + 0.5) * side,
            y: bounds.min.y + (row as f32 + 0.5) * side,
            ..EndPlace::default()
        });
        *(if end.is_timed_out { &mut counted.timed_out } else { &mut counted.lost }) += 1;
        add_cause(&mut counted.causes, end.cause);
    }
    counts.into_values().collect()
}

/// Returns how often each cause ended an episode, anywhere.
pub(super) fn causes(ended: &[FailedEnd]) -> BTreeMap<String, u64> {
    let mut causes = BTreeMap::new();
    ended.iter().for_each(|end| add_cause(&mut causes, end.cause));
    causes
}

fn add_cause(causes: &mut BTreeMap<String, u64>, cause: Option<&'static str>) {
    if let Some(cause) = cause {
        *causes.entry(cause.to_owned()).or_default() += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_counted_by_square_kind_and_cause() {
        let bounds = Rect::new(-1.0, 0.0, 63.0, 10.0);
        let at = |x: f32, y: f32, is_timed_out, cause| FailedEnd { place: Some(Vec2::new(x, y)), is_timed_out, cause };
        let nowhere = FailedEnd { place: None, is_timed_out: false, cause: Some("saw") };
        let ended = [
            at(-0.5, 3.0, false, Some("saw")),
            at(0.9, 2.5, true, None),
            at(5.0, 0.0, false, Some("lava")),
            at(f32::NAN, 0.0, false, None),
            nowhere,
        ];
        let place = |x, y, lost, timed_out, cause: &str| EndPlace {
            x,
            y,
            lost,
            timed_out,
            causes: BTreeMap::from([(cause.to_owned(), 1)]),
        };
        assert_eq!(end_places(bounds, &ended), [place(6.0, 1.0, 1, 0, "lava"), place(0.0, 3.0, 1, 1, "saw")]);
        assert!(end_places(Rect::new(0.0, 0.0, 0.0, 0.0), &ended).is_empty());
        assert_eq!(causes(&ended), BTreeMap::from([("lava".to_owned(), 1), ("saw".to_owned(), 2)]));
    }
}
