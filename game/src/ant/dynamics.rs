//! Mass matrix and forces without contacts: the composite rigid body algorithm and a recursive Newton-Euler pass over a
//! torso with four legs of two limbs.
//!
//! Unknowns are the accelerations of the coordinates. These are the torso's angular acceleration and the acceleration
//! of its centre, both along the torso's axes, and those of the hinges.

use crate::ant::{
    kinematics::{Inertia, Leg, Pose, Solids, Spatial},
    skeleton::{ARMATURE, LEGS},
};
use bevy::{math::DVec3, reflect::Reflect};

/// Gravity, in m/s².
pub const GRAVITY: f64 = 9.81;

/// Returns the mass matrix of a pose, rotors included.
pub fn mass_matrix(solids: &Solids, legs: &[Leg; LEGS]) -> ArrowMatrix {
    let mut matrix = ArrowMatrix::default();
    let mut whole = solids.trunk;
    for (at, leg) in legs.iter().enumerate() {
        let both = leg.upper + leg.lower;
        whole = whole + both;
        let (by_hip, by_ankle) = (both.times(leg.hip), leg.lower.times(leg.ankle));
        matrix.arms[at] = [by_hip.to_array(), by_ankle.to_array()];
        matrix.legs[at] = [leg.hip.dot(by_hip) + ARMATURE, leg.hip.dot(by_ankle), leg.ankle.dot(by_ankle) + ARMATURE];
    }
    matrix.base = dense(&whole);
    matrix
}

fn dense(inertia: &Inertia) -> [[f64; BASE]; BASE] {
    let (t, m) = (inertia.tensor, inertia.moment);
    let mass = inertia.mass;
    [
        [t.x_axis.x, t.y_axis.x, t.z_axis.x, 0.0, -m.z, m.y],
        [t.x_axis.y, t.y_axis.y, t.z_axis.y, m.z, 0.0, -m.x],
        [t.x_axis.z, t.y_axis.z, t.z_axis.z, -m.y, m.x, 0.0],
        [0.0, m.z, -m.y, mass, 0.0, 0.0],
        [-m.z, 0.0, m.x, 0.0, mass, 0.0],
        [m.y, -m.x, 0.0, 0.0, 0.0, mass],
    ]
}

/// Forces that would hold the coordinates' velocities constant: Coriolis, centrifugal, and against gravity, in m/s².
pub fn bias(pose: &Pose, solids: &Solids, legs: &[Leg; LEGS], velocity: &Coordinates, gravity: f64) -> Coordinates {
    let base = Spatial::from_array(velocity.base);
    let up = pose.rotation.transpose() * DVec3::Z;
    // The centre's coordinates are accelerations of a point, which spatial accelerations are not: the difference is
    // ω×v.
    let start = Spatial { angular: DVec3::ZERO, linear: up * gravity - base.angular.cross(base.linear) };
    let mut total = solids.trunk.times(start) + base.carry_force(solids.trunk.times(base));
    let mut forces = Coordinates::default();
    for (at, leg) in legs.iter().enumerate() {
        let [by_hip, by_ankle] = [leg.hip * velocity.legs[at][0], leg.ankle * velocity.legs[at][1]];
        let upper = base + by_hip;
        let upper_rate = start + upper.carry_motion(by_hip);
        let lower = upper + by_ankle;
        let lower_rate = upper_rate + lower.carry_motion(by_ankle);
        let on_upper = leg.upper.times(upper_rate) + upper.carry_force(leg.upper.times(upper));
        let on_lower = leg.lower.times(lower_rate) + lower.carry_force(leg.lower.times(lower));
        let both = on_upper + on_lower;
        forces.legs[at] = [leg.hip.dot(both), leg.ankle.dot(on_lower)];
        total += both;
    }
    forces.base = total.to_array();
    forces
}

// Symmetric matrices in the shape of an arrow: the torso is coupled with every leg, the legs with the torso only.
//
// The mass matrix has this shape. It keeps it with contacts added, as each contact touches one leg. Eliminating the
// legs first leaves a 6×6 system.

/// Degrees of freedom of the torso.
pub const BASE: usize = 6;

/// A vector over all degrees of freedom.
#[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
pub struct Coordinates {
    /// Torso: angular, then linear.
    pub base: [f64; BASE],
    /// Hip and ankle of each leg.
    pub legs: [[f64; 2]; LEGS],
}

impl Coordinates {
    /// Returns `self + factor · other`.
    pub fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut sum = *self;
        for (s, o) in sum.base.iter_mut().zip(&other.base) {
            *s += factor * o;
        }
        for (s, o) in sum.legs.iter_mut().zip(&other.legs) {
            s[0] += factor * o[0];
            s[1] += factor * o[1];
        }
        sum
    }

    /// Returns the scalar product.
    pub fn dot(&self, other: &Self) -> f64 {
        let base: f64 = self.base.iter().zip(&other.base).map(|(a, b)| a * b).sum();
        let legs: f64 = self.legs.iter().zip(&other.legs).map(|(a, b)| a[0] * b[0] + a[1] * b[1]).sum();
        base + legs
    }
}

/// A symmetric matrix with blocks for the torso, each leg, and the torso with each leg.
#[derive(Clone, Copy, Debug, Default)]
pub struct ArrowMatrix {
    /// Torso with torso; the lower triangle is used.
    pub base: [[f64; BASE]; BASE],
    /// Torso with the hip and the ankle of each leg.
    pub arms: [[[f64; BASE]; 2]; LEGS],
    /// Hip with hip, hip with ankle, ankle with ankle, of each leg.
    pub legs: [[f64; 3]; LEGS],
}

impl ArrowMatrix {
    /// Returns the product with a vector.
    pub fn times(&self, x: &Coordinates) -> Coordinates {
        let mut out = Coordinates::default();
        for i in 0..BASE {
            for j in 0..BASE {
                out.base[i] += self.base[i.max(j)][i.min(j)] * x.base[j];
            }
        }
        for leg in 0..LEGS {
            let ([a, b], [c, d, e], [p, q]) = (self.arms[leg], self.legs[leg], x.legs[leg]);
            for i in 0..BASE {
                out.base[i] += a[i] * p + b[i] * q;
                out.legs[leg][0] += a[i] * x.base[i];
                out.legs[leg][1] += b[i] * x.base[i];
            }
            out.legs[leg][0] += c * p + d * q;
            out.legs[leg][1] += d * p + e * q;
        }
        out
    }

    /// Prepares to solve systems with this matrix, which must be positive definite.
    pub fn factor(&self) -> Factored {
        let mut schur = self.base;
        let mut inverse = [[0.0; 3]; LEGS];
        let mut gain = [[[0.0; BASE]; 2]; LEGS];
        for leg in 0..LEGS {
            let [c, d, e] = self.legs[leg];
            let scale = 1.0 / (c * e - d * d);
            let [ic, id, ie] = [e * scale, -d * scale, c * scale];
            inverse[leg] = [ic, id, ie];
            let [a, b] = &self.arms[leg];
            for i in 0..BASE {
                gain[leg][0][i] = ic * a[i] + id * b[i];
                gain[leg][1][i] = id * a[i] + ie * b[i];
            }
            let [g, h] = &gain[leg];
            for i in 0..BASE {
                for j in 0..=i {
                    schur[i][j] -= g[i] * a[j] + h[i] * b[j];
                }
            }
        }
        Factored { root: Cholesky::of(&schur), inverse, gain }
    }
}

/// An [`ArrowMatrix`] ready to be solved with.
#[derive(Clone, Copy, Debug)]
pub struct Factored {
    root: Cholesky,
    inverse: [[f64; 3]; LEGS],
    gain: [[[f64; BASE]; 2]; LEGS],
}

impl Factored {
    /// Returns the solution x of A·x = b.
    pub fn solve(&self, b: &Coordinates) -> Coordinates {
        let mut x = *b;
        for leg in 0..LEGS {
            let ([g, h], [p, q]) = (&self.gain[leg], b.legs[leg]);
            for i in 0..BASE {
                x.base[i] -= g[i] * p + h[i] * q;
            }
        }
        self.root.solve(&mut x.base);
        for leg in 0..LEGS {
            let ([g, h], [c, d, e], [p, q]) = (&self.gain[leg], self.inverse[leg], b.legs[leg]);
            let mut out = [c * p + d * q, d * p + e * q];
            for i in 0..BASE {
                out[0] -= g[i] * x.base[i];
                out[1] -= h[i] * x.base[i];
            }
            x.legs[leg] = out;
        }
        x
    }
}

/// Lower triangular root of a 6×6 matrix, with its diagonal inverted.
#[derive(Clone, Copy, Debug)]
struct Cholesky([[f64; BASE]; BASE]);

impl Cholesky {
    fn of(matrix: &[[f64; BASE]; BASE]) -> Self {
        let mut l = *matrix;
        for j in 0..BASE {
            for k in 0..j {
                let ljk = l[j][k];
                for row in l.iter_mut().skip(j) {
                    row[j] -= row[k] * ljk;
                }
            }
            let inverse = 1.0 / l[j][j].sqrt();
            l[j][j] = inverse;
            for row in l.iter_mut().skip(j + 1) {
                row[j] *= inverse;
            }
        }
        Self(l)
    }

    fn solve(&self, b: &mut [f64; BASE]) {
        let l = &self.0;
        for i in 0..BASE {
            for j in 0..i {
                b[i] -= l[i][j] * b[j];
            }
            b[i] *= l[i][i];
        }
        for i in (0..BASE).rev() {
            for j in i + 1..BASE {
                b[i] -= l[j][i] * b[j];
            }
            b[i] *= l[i][i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a matrix that is positive definite because its diagonal outweighs the rest.
    fn some_matrix() -> ArrowMatrix {
        let mut matrix = ArrowMatrix::default();
        for i in 0..BASE {
            for j in 0..BASE {
                matrix.base[i][j] = if i == j { 9.0 + i as f64 } else { 0.1 * (i + j) as f64 };
            }
            for leg in 0..LEGS {
                matrix.arms[leg][0][i] = 0.2 * (i + leg) as f64 - 0.3;
                matrix.arms[leg][1][i] = 0.1 * (i as f64 - leg as f64);
            }
        }
        matrix.legs = std::array::from_fn(|leg| [4.0 + leg as f64, 0.5, 3.0]);
        matrix
    }

    #[test]
    fn solving_undoes_multiplying() {
        let matrix = some_matrix();
        let x = Coordinates {
            base: [1.0, -2.0, 3.0, 0.5, -0.25, 4.0],
            legs: [[1.0, 2.0], [-3.0, 0.5], [0.0, 7.0], [2.5, -1.0]],
        };
        let solved = matrix.factor().solve(&matrix.times(&x));
        assert!(x.plus(-1.0, &solved).dot(&x.plus(-1.0, &solved)) < 1e-24, "{solved:?}");
    }

    #[test]
    fn the_product_is_symmetric() {
        let (matrix, mut x, mut y) = (some_matrix(), Coordinates::default(), Coordinates::default());
        (x.base[2], x.legs[1]) = (1.5, [0.5, -2.0]);
        (y.base[4], y.legs[1], y.legs[3]) = (-1.0, [1.0, 3.0], [2.0, 0.0]);
        assert!((x.dot(&matrix.times(&y)) - y.dot(&matrix.times(&x))).abs() < 1e-12);
    }
}
