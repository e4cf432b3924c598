//! Spatial vectors and inertias about the torso's centre, in the torso's axes (Featherstone, Rigid Body Dynamics
//! Algorithms, 2008).

use std::ops::{Add, AddAssign, Mul};

use bevy::math::{DMat3, DVec3};

/// A motion (angular and linear velocity or acceleration) or a force (moment and force).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spatial {
    /// Angular velocity, or moment about the origin.
    pub angular: DVec3,
    /// Velocity of the origin, or force.
    pub linear: DVec3,
}

impl Spatial {
    /// Returns the motion of a turn about an axis through a point.
    pub fn turn(axis: DVec3, through: DVec3) -> Self {
        Self { angular: axis, linear: through.cross(axis) }
    }

    /// Returns the power of a force along a motion.
    pub fn dot(self, other: Self) -> f64 {
        self.angular.dot(other.angular) + self.linear.dot(other.linear)
    }

    /// Returns the rate of change of a motion that is carried along by this motion.
    pub fn carry_motion(self, motion: Self) -> Self {
        Self {
            angular: self.angular.cross(motion.angular),
            linear: self.angular.cross(motion.linear) + self.linear.cross(motion.angular),
        }
    }

    /// Returns the rate of change of a momentum that is carried along by this motion.
    pub fn carry_force(self, force: Self) -> Self {
        Self {
            angular: self.angular.cross(force.angular) + self.linear.cross(force.linear),
            linear: self.angular.cross(force.linear),
        }
    }

    /// Returns the six numbers, angular first.
    pub fn to_array(self) -> [f64; 6] {
        let (a, l) = (self.angular, self.linear);
        [a.x, a.y, a.z, l.x, l.y, l.z]
    }

    /// Returns the vector with these numbers.
    pub fn from_array(v: [f64; 6]) -> Self {
        Self { angular: DVec3::new(v[0], v[1], v[2]), linear: DVec3::new(v[3], v[4], v[5]) }
    }
}

impl Add for Spatial {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }
}

impl AddAssign for Spatial {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul<f64> for Spatial {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        Self { angular: self.angular * factor, linear: self.linear * factor }
    }
}

/// Inertia of a rigid body about the origin.
#[derive(Clone, Copy, Debug)]
pub struct Inertia {
    /// Mass, in kg.
    pub mass: f64,
    /// Mass times centre of mass, in kg·m.
    pub moment: DVec3,
    /// Inertia tensor about the origin, in kg·m².
    pub tensor: DMat3,
}

impl Inertia {
    /// Takes a body with this mass and inertia about its centre of mass.
    pub fn of(mass: f64, centre: DVec3, about_centre: DMat3) -> Self {
        let outer = DMat3::from_cols(centre * centre.x, centre * centre.y, centre * centre.z);
        let steiner = (DMat3::from_diagonal(DVec3::splat(centre.length_squared())) - outer) * mass;
        Self { mass, moment: centre * mass, tensor: about_centre + steiner }
    }

    /// Returns the momentum of a motion.
    pub fn times(&self, motion: Spatial) -> Spatial {
        Spatial {
            angular: self.tensor * motion.angular + self.moment.cross(motion.linear),
            linear: motion.linear * self.mass - self.moment.cross(motion.angular),
        }
    }
}

impl Add for Inertia {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self { mass: self.mass + other.mass, moment: self.moment + other.moment, tensor: self.tensor + other.tensor }
    }
}
