//! Contact as MuJoCo 3.1.6 solves it for D4RL's ball and walls, in closed form.
//!
//! MuJoCo's contacts are soft constraints: each has a reference acceleration that brings the surfaces apart like a
//! damped spring, and a weight. The acceleration is the one with the least cost: the smallest deviation from the free
//! acceleration and from the references that it falls short of. With MuJoCo's defaults (`solref` 0.02 1, `solimp` 0.9
//! 0.95 0.001, margin 0.002) and two dimensions there is little left to solve.

use super::{
    ball::{Ball, DAMPING, MASS, Vec2d, add, dot, scale, sub},
    walls::{Touches, Walls},
};

/// Contacts act when the surfaces are closer than this, m.
pub const MARGIN: f64 = 0.002;
/// Least and most impedance, and the depth at which it is most, m.
const IMPEDANCE: [f64; 2] = [0.9, 0.95];
const DEPTH: f64 = 0.001;
/// Time constant of the reference, s; its damping ratio is 1.
const TIME: f64 = 0.02;

/// One contact of the step.
#[derive(Clone, Copy, Default)]
struct Contact {
    normal: Vec2d,
    /// Requested acceleration along the normal.
    target: f64,
    /// Cost of falling short of it.
    weight: f64,
}

/// Most contacts at once: more walls than these cannot be within the margin of a ball that is outside of all.
const MOST: usize = 4;

/// Returns the force of the walls on a ball that is driven by `drive`, N.
pub fn contact_force(ball: &Ball, drive: Vec2d, walls: &Walls) -> Vec2d {
    let touches = walls.touches(ball.position, MARGIN);
    if touches.as_slice().is_empty() {
        return [0.0; 2];
    }
    let (contacts, count) = contacts(ball, &touches);
    let contacts = &contacts[..count];
    let free = sub(scale(drive, 1.0 / MASS), scale(ball.velocity, DAMPING / MASS));
    let acceleration = least_cost(free, contacts);
    let force_of = |contact: &Contact| {
        let short = (contact.target - dot(contact.normal, acceleration)).max(0.0);
        scale(contact.normal, contact.weight * short)
    };
    contacts.iter().map(force_of).fold([0.0; 2], add)
}

fn contacts(ball: &Ball, touches: &Touches) -> ([Contact; MOST], usize) {
    let mut contacts = [Contact::default(); MOST];
    let mut count = 0;
    for (contact, touch) in contacts.iter_mut().zip(touches.as_slice()) {
        let depth = touch.gap - MARGIN;
        let impedance = impedance(depth.abs() / DEPTH);
        let (damping, stiffness) = (2.0 / (IMPEDANCE[1] * TIME), 1.0 / (IMPEDANCE[1] * TIME).powi(2));
        *contact = Contact {
            normal: touch.normal,
            target: -damping * dot(touch.normal, ball.velocity) - stiffness * impedance * depth,
            weight: MASS * impedance / (1.0 - impedance),
        };
        count += 1;
    }
    (contacts, count)
}

/// Returns the impedance at a depth in units of [`DEPTH`]: from least to most along two parabolas.
fn impedance(depth: f64) -> f64 {
    let rise = match depth {
        ..=0.5 => 2.0 * depth * depth,
        0.5..1.0 => 1.0 - 2.0 * (1.0 - depth) * (1.0 - depth),
        _ => 1.0,
    };
    IMPEDANCE[0] + (IMPEDANCE[1] - IMPEDANCE[0]) * rise
}

/// Returns the acceleration with the least cost.
///
/// The cost is convex and, for each choice of contacts that push, quadratic: the choice that is consistent with its own
/// minimum is the right one.
fn least_cost(free: Vec2d, contacts: &[Contact]) -> Vec2d {
    let mut best = free;
    for pushing in 0..1_u32 << contacts.len() {
        let pushes = |index: usize| pushing & 1 << index != 0;
        let acceleration = minimum(free, contacts, pushes);
        let is_consistent =
            |(index, contact): (usize, &Contact)| (dot(contact.normal, acceleration) < contact.target) == pushes(index);
        if contacts.iter().enumerate().all(is_consistent) {
            return acceleration;
        }
        best = acceleration;
    }
    // Rounding has left no choice consistent: all push.
    best
}

/// Returns the minimum of the cost if exactly these contacts push: two linear equations.
fn minimum(free: Vec2d, contacts: &[Contact], pushes: impl Fn(usize) -> bool) -> Vec2d {
    let (mut xx, mut xy, mut yy) = (MASS, 0.0, MASS);
    let mut right = scale(free, MASS);
    for (_, contact) in contacts.iter().enumerate().filter(|&(index, _)| pushes(index)) {
        let Contact { normal: [x, y], target, weight } = *contact;
        xx += weight * x * x;
        xy += weight * x * y;
        yy += weight * y * y;
        right = add(right, scale(contact.normal, weight * target));
    }
    let determinant = xx * yy - xy * xy;
    [(yy * right[0] - xy * right[1]) / determinant, (xx * right[1] - xy * right[0]) / determinant]
}
