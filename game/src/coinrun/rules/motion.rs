//! Movement in small steps, one axis at a time.

use super::body::Body;
use super::constants::CORNER;
use crate::coinrun::tile::Corners;

/// Moves `body` by its velocity in at least four equal parts. `displace` moves it by (dx, dy), only one of which is not
/// 0, and tells whether something was in the way.
///
/// Each velocity component then keeps the share of the parts in which it was not blocked. So a fall that ends in the
/// last of five parts leaves 4/5 of the speed for the next step. Only a completely blocked step leaves 0.
#[inline]
pub(super) fn advance(body: &mut Body, x_first: bool, mut displace: impl FnMut(&mut Body, f32, f32) -> bool) {
    let parts = part_count(body.vx, body.vy);
    let share = 1.0 / parts as f32;
    let (mut free_x, mut free_y) = (0_u32, 0_u32);
    for _ in 0..parts {
        let (blocked_x, blocked_y);
        // The velocity is read for every part: a crate or a turn changes it on the way.
        if x_first {
            blocked_x = displace(body, body.vx * share, 0.0);
            blocked_y = displace(body, 0.0, body.vy * share);
        } else {
            blocked_y = displace(body, 0.0, body.vy * share);
            blocked_x = displace(body, body.vx * share, 0.0);
        }
        free_x += u32::from(!blocked_x);
        free_y += u32::from(!blocked_y);
        if blocked_x && blocked_y {
            break;
        }
    }
    body.vx *= free_x as f32 / parts as f32;
    body.vy *= free_y as f32 / parts as f32;
}

/// Returns the number of equal parts of a step: four per tile of speed, at least four.
#[inline]
pub(in crate::coinrun) fn part_count(vx: f32, vy: f32) -> u32 {
    let speed = (vx * vx + vy * vy).sqrt();
    ((4.0 * speed) as u32).max(4)
}

/// Returns the corners of `body` that are tested against tiles, if its centre were at (x, y).
#[inline]
pub(in crate::coinrun) fn corners(body: &Body, x: f32, y: f32) -> Corners {
    let (rx, ry) = (body.rx * CORNER, body.ry * CORNER);
    Corners { left: x - rx, right: x + rx, low: y - ry, high: y + ry }
}

/// Returns the centre of a body of half size `half` that was stopped on its way to `centre`: flush with the tile edge
/// in front of it.
#[inline]
pub(in crate::coinrun) fn flush(centre: f32, half: f32, moves_up: bool) -> f32 {
    if moves_up { (centre + half).floor() - half } else { (centre - half).ceil() + half }
}

/// Returns the centre of a body of half size `half` after it bounced off the tile edge that it would have crossed on
/// its way to `centre`.
#[inline]
pub(super) fn mirrored(centre: f32, half: f32, moves_up: bool) -> f32 {
    let excess =
        if moves_up { (centre + half).floor() - (centre + half) } else { (centre - half).ceil() - (centre - half) };
    centre + 2.0 * excess
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_bodies_move_in_more_parts() {
        assert_eq!(part_count(0.0, 0.0), 4);
        assert_eq!(part_count(0.5, -1.1), 4);
        assert_eq!(part_count(0.0, -1.3), 5);
        assert_eq!(part_count(0.0, 1.5), 6);
    }

    #[test]
    fn a_late_stop_leaves_most_of_the_speed() {
        let mut body = Body { vy: -1.3, ..Body::player() };
        let mut parts = 0;
        advance(&mut body, true, |_, _, dy| {
            parts += u32::from(dy != 0.0);
            dy != 0.0 && parts > 3
        });
        assert_eq!(body.vy, -1.3 * (3.0 / 5.0));
    }

    #[test]
    fn edges() {
        assert_eq!(flush(3.7, 0.5, true), 3.5);
        assert_eq!(flush(3.2, 0.5, false), 3.5);
        assert_eq!(mirrored(3.75, 0.5, true), 3.25);
        assert_eq!(mirrored(3.25, 0.5, false), 3.75);
    }
}
