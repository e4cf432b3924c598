//! MuJoCo's soft constraints: joint limits and contacts with friction as one-sided springs in acceleration.
//!
//! A row J asks for J·a no less than a reference acceleration -b·(J·v) - k·d·r, where r is the violation of the
//! constraint. It pulls with weight 1/R. Stiffness k, damping b and impedance d follow from MuJoCo's `solref` and
//! `solimp`. R follows from the impedance and from the weight of the row in the nominal pose.

use crate::ant::{
    contact::{Contact, Limb, MARGIN},
    dynamics::{ArrowMatrix, BASE, Coordinates, Factored, mass_matrix},
    kinematics::{Pose, Solids},
    skeleton::{HIP_AXIS, LEGS, joint_range},
};
use bevy::math::DVec3;

/// MuJoCo's `solref` time constant of 0.02 s, raised to two time steps as MuJoCo does, in seconds.
pub const TIME_CONSTANT: f64 = 0.04;

/// Impedance of contacts.
const CONTACT_IMPEDANCE: f64 = 0.8;

/// Impedance of joint limits, just reached and well beyond.
const LIMIT_IMPEDANCE: [f64; 2] = [0.9, 0.95];

/// Angle over which the impedance of limits rises, in radians.
const LIMIT_WIDTH: f64 = 0.001;

/// Coulomb friction of everything.
const FRICTION: f64 = 1.0;

/// A one-sided constraint.
#[derive(Clone, Copy, Debug)]
pub struct ConstraintRow {
    /// Its part over the torso's coordinates.
    pub base: [f64; BASE],
    /// The leg whose hinges take part.
    pub leg: usize,
    /// Its part over hip and ankle.
    pub hinges: [f64; 2],
    /// Least acceleration that it asks for.
    pub reference: f64,
    /// Weight 1/R.
    pub weight: f64,
}

impl ConstraintRow {
    /// Its scalar product with coordinates.
    pub fn dot(&self, x: &Coordinates) -> f64 {
        let base: f64 = self.base.iter().zip(&x.base).map(|(a, b)| a * b).sum();
        base + self.hinges[0] * x.legs[self.leg][0] + self.hinges[1] * x.legs[self.leg][1]
    }
}

/// Returns the stiffness and damping for a largest impedance.
fn spring(largest_impedance: f64) -> (f64, f64) {
    let scale = 1.0 / (largest_impedance * TIME_CONSTANT);
    (scale * scale, 2.0 * scale)
}

/// Mobility of limbs and hinges in the nominal pose: MuJoCo's `invweight0`.
#[derive(Clone, Copy, Debug)]
pub struct Mobility {
    torso: f64,
    fixed: f64,
    upper: f64,
    lower: f64,
    hinges: [f64; 2],
}

impl Mobility {
    /// Computes it for an ant with all joints at 0.
    pub fn new(solids: &Solids) -> Self {
        let pose = Pose::new(DVec3::ZERO, bevy::math::DQuat::IDENTITY, &[[0.0; 2]; LEGS]);
        let inverse = mass_matrix(solids, &pose.legs.map(|leg| solids.leg(&leg))).factor();
        let leg = &pose.legs[0];
        let mean = |limb, point| {
            let axes = [DVec3::X, DVec3::Y, DVec3::Z];
            axes.iter().map(|&axis| mobility(&inverse, &jacobian(&pose, limb, 0, point, axis))).sum::<f64>() / 3.0
        };
        let hinge = |k: usize| {
            let mut row = Coordinates::default();
            row.legs[0][k] = 1.0;
            mobility(&inverse, &row)
        };
        Self {
            torso: mean(Limb::Torso, DVec3::ZERO),
            fixed: mean(Limb::Fixed, leg.hip / 2.0),
            upper: mean(Limb::Upper, (leg.hip + leg.ankle) / 2.0),
            lower: mean(Limb::Lower, (leg.ankle + leg.foot) / 2.0),
            hinges: [hinge(0), hinge(1)],
        }
    }

    fn of(&self, limb: Limb) -> f64 {
        match limb {
            Limb::Torso => self.torso,
            Limb::Fixed => self.fixed,
            Limb::Upper => self.upper,
            Limb::Lower => self.lower,
        }
    }
}

fn mobility(inverse: &Factored, row: &Coordinates) -> f64 {
    row.dot(&inverse.solve(row))
}

/// Returns the velocity of a point of a limb along a direction, as a row over the coordinates. Both are in the torso's
/// frame.
fn jacobian(pose: &Pose, limb: Limb, leg: usize, point: DVec3, direction: DVec3) -> Coordinates {
    let turn = point.cross(direction);
    let mut row =
        Coordinates { base: [turn.x, turn.y, turn.z, direction.x, direction.y, direction.z], ..Coordinates::default() };
    let at = &pose.legs[leg];
    if matches!(limb, Limb::Upper | Limb::Lower) {
        row.legs[leg][0] = HIP_AXIS.cross(point - at.hip).dot(direction);
    }
    if limb == Limb::Lower {
        row.legs[leg][1] = at.ankle_axis.cross(point - at.ankle).dot(direction);
    }
    row
}

/// Adds a row for each joint that is beyond its limit.
pub fn limits(joints: &[[f64; 2]; LEGS], velocity: &Coordinates, mobility: &Mobility, rows: &mut Vec<ConstraintRow>) {
    let (stiffness, damping) = spring(LIMIT_IMPEDANCE[1]);
    for (leg, angles) in joints.iter().enumerate() {
        for (k, &angle) in angles.iter().enumerate() {
            let [low, high] = joint_range(2 * leg + k);
            let (gap, inwards) = if angle < low {
                (angle - low, 1.0)
            } else if angle > high {
                (high - angle, -1.0)
            } else {
                continue;
            };
            let impedance = limit_impedance(-gap);
            let mut hinges = [0.0; 2];
            hinges[k] = inwards;
            rows.push(ConstraintRow {
                base: [0.0; BASE],
                leg,
                hinges,
                reference: -damping * inwards * velocity.legs[leg][k] - stiffness * impedance * gap,
                weight: impedance / ((1.0 - impedance) * mobility.hinges[k]),
            });
        }
    }
}

fn limit_impedance(beyond: f64) -> f64 {
    let [least, most] = LIMIT_IMPEDANCE;
    let s = (beyond / LIMIT_WIDTH).min(1.0);
    let rise = if s <= 0.5 { 2.0 * s * s } else { 1.0 - 2.0 * (1.0 - s) * (1.0 - s) };
    least + (most - least) * rise
}

/// Adds the four edges of a contact's friction pyramid.
pub fn contact(
    touch: &Contact,
    pose: &Pose,
    velocity: &Coordinates,
    mobility: &Mobility,
    rows: &mut Vec<ConstraintRow>,
) {
    let (stiffness, damping) = spring(CONTACT_IMPEDANCE);
    let into_torso = pose.rotation.transpose();
    let point = into_torso * (touch.point - pose.position);
    let row = |direction: DVec3| jacobian(pose, touch.limb, touch.leg, point, into_torso * direction);
    let normal = row(touch.normal);
    let resistance =
        (1.0 - CONTACT_IMPEDANCE) / CONTACT_IMPEDANCE * mobility.of(touch.limb) * (1.0 + FRICTION * FRICTION);
    let weight = 1.0 / (2.0 * FRICTION * FRICTION * resistance);
    for tangent in tangents(touch.normal, touch.along) {
        let tangent = row(tangent);
        for sign in [FRICTION, -FRICTION] {
            let edge = normal.plus(sign, &tangent);
            rows.push(ConstraintRow {
                base: edge.base,
                leg: touch.leg,
                hinges: edge.legs[touch.leg],
                reference: -damping * edge.dot(velocity) - stiffness * CONTACT_IMPEDANCE * (touch.distance - MARGIN),
                weight,
            });
        }
    }
}

/// Returns two directions across a normal, the first as near as can be to `along`.
fn tangents(normal: DVec3, along: DVec3) -> [DVec3; 2] {
    let across = along - normal * normal.dot(along);
    let first = across.try_normalize().unwrap_or_else(|| normal.any_orthonormal_vector());
    [first, normal.cross(first)]
}

// Accelerations that obey mass, forces and one-sided constraints: Newton's method on a convex cost, as in MuJoCo.
//
// The cost is ½(a - a₀)·M·(a - a₀) + ½ Σ w·min(0, J·a - reference)², where a₀ are the accelerations without
// constraints. It is quadratic as long as the same rows push, so few iterations reach the exact minimum.

const ITERATIONS: usize = 30;

const LINE_ITERATIONS: usize = 20;

/// Scratch space of the solver.
#[derive(Clone, Debug, Default)]
pub struct ConstraintSolver {
    residuals: Vec<f64>,
    slopes: Vec<f64>,
}

impl ConstraintSolver {
    /// Minimises the cost, starting from `guess`.
    pub fn solve(
        &mut self,
        mass: &ArrowMatrix,
        free: &Coordinates,
        rows: &[ConstraintRow],
        guess: &Coordinates,
    ) -> Coordinates {
        let mut at = *guess;
        self.residuals.clear();
        self.residuals.extend(rows.iter().map(|row| row.dot(&at) - row.reference));
        for _ in 0..ITERATIONS {
            let pull = mass.times(&at.plus(-1.0, free));
            let gradient = self.gradient(&pull, rows);
            let hessian = self.hessian(mass, rows);
            let step = hessian.factor().solve(&gradient);
            // The step is a descent direction, taken with a minus sign.
            self.slopes.clear();
            self.slopes.extend(rows.iter().map(|row| -row.dot(&step)));
            let (length, settled) = self.search(-pull.dot(&step), step.dot(&mass.times(&step)), rows);
            at = at.plus(-length, &step);
            for (residual, slope) in self.residuals.iter_mut().zip(&self.slopes) {
                *residual += length * slope;
            }
            if settled {
                break;
            }
        }
        at
    }

    fn gradient(&self, pull: &Coordinates, rows: &[ConstraintRow]) -> Coordinates {
        let mut gradient = *pull;
        for (row, &residual) in rows.iter().zip(&self.residuals) {
            if residual < 0.0 {
                let force = row.weight * residual;
                for (g, j) in gradient.base.iter_mut().zip(&row.base) {
                    *g += force * j;
                }
                gradient.legs[row.leg][0] += force * row.hinges[0];
                gradient.legs[row.leg][1] += force * row.hinges[1];
            }
        }
        gradient
    }

    fn hessian(&self, mass: &ArrowMatrix, rows: &[ConstraintRow]) -> ArrowMatrix {
        let mut hessian = *mass;
        for (row, _) in rows.iter().zip(&self.residuals).filter(|(_, residual)| **residual < 0.0) {
            let [p, q] = row.hinges.map(|hinge| hinge * row.weight);
            for i in 0..BASE {
                let scaled = row.base[i] * row.weight;
                for j in 0..=i {
                    hessian.base[i][j] += scaled * row.base[j];
                }
                hessian.arms[row.leg][0][i] += p * row.base[i];
                hessian.arms[row.leg][1][i] += q * row.base[i];
            }
            let leg = &mut hessian.legs[row.leg];
            leg[0] += p * row.hinges[0];
            leg[1] += p * row.hinges[1];
            leg[2] += q * row.hinges[1];
        }
        hessian
    }

    /// Returns the step length at which the slope of the cost along the step vanishes. Also returns whether the step is
    /// whole with the same rows pushing throughout: then the minimum is reached.
    fn search(&self, start_slope: f64, curvature: f64, rows: &[ConstraintRow]) -> (f64, bool) {
        let along = |length: f64| {
            let (mut slope, mut bend, mut same) = (start_slope + length * curvature, curvature, true);
            for ((row, &residual), &change) in rows.iter().zip(&self.residuals).zip(&self.slopes) {
                let there = residual + length * change;
                same &= (there < 0.0) == (residual < 0.0);
                if there < 0.0 {
                    slope += row.weight * there * change;
                    bend += row.weight * change * change;
                }
            }
            (slope, bend, same)
        };
        let (mut low, mut high) = (0.0, f64::INFINITY);
        let mut length = 1.0;
        for _ in 0..LINE_ITERATIONS {
            let (slope, bend, same) = along(length);
            if length == 1.0 && same {
                return (1.0, true);
            }
            if slope < 0.0 {
                low = length
            } else {
                high = length
            }
            let next = length - slope / bend;
            let next = if next > low && next < high {
                next
            } else if high.is_finite() {
                (low + high) / 2.0
            } else {
                low * 2.0
            };
            if (next - length).abs() < 1e-6 * length {
                return (next, false);
            }
            length = next;
        }
        (length, false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ant::skeleton::LEGS;

    fn unit_mass() -> ArrowMatrix {
        let mut mass = ArrowMatrix { legs: [[1.0, 0.0, 1.0]; LEGS], ..ArrowMatrix::default() };
        for i in 0..BASE {
            mass.base[i][i] = 1.0;
        }
        mass
    }

    fn push(dimension: usize, sign: f64, reference: f64, weight: f64) -> ConstraintRow {
        let mut base = [0.0; BASE];
        base[dimension] = sign;
        ConstraintRow { base, leg: 0, hinges: [0.0; 2], reference, weight }
    }

    #[test]
    fn one_row_pulls_by_its_weight() {
        let free = Coordinates { base: [0.0, 0.0, 0.0, 0.0, 0.0, -10.0], ..Coordinates::default() };
        // Minimum of (a + 10)²/2 + 4·(a - 5)²/2 over a < 5.
        let a =
            ConstraintSolver::default().solve(&unit_mass(), &free, &[push(5, 1.0, 5.0, 4.0)], &Coordinates::default());
        assert!((a.base[5] - 2.0).abs() < 1e-12, "{a:?}");
    }

    #[test]
    fn rows_that_are_content_do_nothing() {
        let free = Coordinates { base: [0.0, 0.0, 0.0, 0.0, 0.0, 3.0], ..Coordinates::default() };
        let rows = [push(5, 1.0, -1.0, 50.0), push(5, -1.0, -8.0, 50.0)];
        // The guess is where the second row pushes.
        let guess = Coordinates { base: [0.0, 0.0, 0.0, 0.0, 0.0, 90.0], ..Coordinates::default() };
        let a = ConstraintSolver::default().solve(&unit_mass(), &free, &rows, &guess);
        assert!((a.base[5] - 3.0).abs() < 1e-9, "{a:?}");
    }

    #[test]
    fn opposed_rows_settle_between() {
        let free = Coordinates::default();
        let rows = [push(0, 1.0, 6.0, 1.0), push(0, -1.0, 6.0, 3.0)];
        // Minimum of a²/2 + (a - 6)²/2 + 3·(a + 6)²/2.
        let a = ConstraintSolver::default().solve(&unit_mass(), &free, &rows, &free);
        assert!((a.base[0] + 12.0 / 5.0).abs() < 1e-9, "{a:?}");
    }
}
