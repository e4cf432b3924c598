//! The ant as a moving body: Runge-Kutta's method of fourth order over the accelerations of mass, hinges and contacts.

use crate::ant::{
    constraint,
    constraint::{ConstraintRow, ConstraintSolver, Mobility},
    contact,
    contact::{Contact, WallBox, Walls},
    dynamics::{Coordinates, GRAVITY, bias, mass_matrix},
    kinematics::{Pose, Solids, turn},
    skeleton::{ACTUATED, AntState, HINGE_DAMPING, JOINTS, LEGS, LIMB_RADIUS, TORQUE, TORSO_RADIUS},
};
use bevy::{
    math::{DQuat, DVec3, Quat, Vec3},
    reflect::Reflect,
};

/// Time of one control step, in seconds.
pub const CONTROL_STEP: f64 = 0.1;

/// Physics steps in a control step.
pub const SUBSTEPS: usize = 5;

/// Torques or angles of all hinges, by leg.
type Hinges = [[f64; 2]; LEGS];

/// Positions: the integrals of velocities.
#[derive(Clone, Copy, Debug, Reflect)]
struct JointPositions {
    position: DVec3,
    orientation: DQuat,
    joints: Hinges,
}

impl JointPositions {
    fn moved(&self, h: f64, rates: &Rates) -> Self {
        Self {
            position: self.position + h * rates.centre,
            orientation: (self.orientation * spun(h * rates.spin)).normalize(),
            joints: plus(&self.joints, h, &rates.joints),
        }
    }
}

/// Returns the rotation whose axis and angle are a vector's direction and length.
fn spun(turned: DVec3) -> DQuat {
    let angle = turned.length();
    if angle > 0.0 { turn(turned / angle, angle) } else { DQuat::IDENTITY }
}

/// Velocities, or accelerations. `centre` is along the world's axes, `spin` along the torso's.
#[derive(Clone, Copy, Debug, Default, Reflect)]
struct Rates {
    centre: DVec3,
    spin: DVec3,
    joints: Hinges,
}

impl Rates {
    fn plus(&self, h: f64, other: &Self) -> Self {
        Self {
            centre: self.centre + h * other.centre,
            spin: self.spin + h * other.spin,
            joints: plus(&self.joints, h, &other.joints),
        }
    }
}

fn plus(a: &Hinges, h: f64, b: &Hinges) -> Hinges {
    std::array::from_fn(|leg| std::array::from_fn(|k| a[leg][k] + h * b[leg][k]))
}

/// MuJoCo's weights of Runge-Kutta's four slopes.
const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];

/// The quadruped among walls.
///
/// Reflection sees its whole state. It leaves out constant parts, such as the walls, since rapier's types are not
/// reflected, and values that each step computes anew.
#[derive(Reflect)]
#[reflect(from_reflect = false)]
pub struct AntBody {
    #[reflect(ignore)]
    solids: Solids,
    #[reflect(ignore)]
    mobility: Mobility,
    #[reflect(ignore)]
    walls: Walls,
    gravity: f64,
    place: JointPositions,
    rates: Rates,
    /// Accelerations of the last solution, the first guess of the next.
    warm: Coordinates,
    #[reflect(ignore)]
    near: Vec<WallBox>,
    #[reflect(ignore)]
    contacts: Vec<Contact>,
    #[reflect(ignore)]
    rows: Vec<ConstraintRow>,
    #[reflect(ignore)]
    solver: ConstraintSolver,
}

impl AntBody {
    /// Returns an ant in the nominal pose on a floor at height 0 with these walls.
    pub fn new(walls: &[WallBox]) -> Self {
        let solids = Solids::default();
        let mut body = Self {
            mobility: Mobility::new(&solids),
            solids,
            walls: Walls::new(walls),
            gravity: GRAVITY,
            place: JointPositions { position: DVec3::ZERO, orientation: DQuat::IDENTITY, joints: Hinges::default() },
            rates: Rates::default(),
            warm: Coordinates::default(),
            near: Vec::new(),
            contacts: Vec::new(),
            rows: Vec::new(),
            solver: ConstraintSolver::default(),
        };
        body.set_state(&AntState::nominal());
        body
    }

    /// Returns the same without gravity, for comparisons with other engines.
    pub fn weightless(mut self) -> Self {
        self.gravity = 0.0;
        self
    }

    /// Sets the ant's state and forgets earlier steps.
    pub fn set_state(&mut self, state: &AntState) {
        let (q, v) = (state.qpos.map(f64::from), state.qvel.map(f64::from));
        self.place = JointPositions {
            position: DVec3::new(q[0], q[1], q[2]),
            orientation: DQuat::from_xyzw(q[4], q[5], q[6], q[3]).normalize(),
            joints: std::array::from_fn(|leg| [q[7 + 2 * leg], q[8 + 2 * leg]]),
        };
        self.rates = Rates {
            centre: DVec3::new(v[0], v[1], v[2]),
            spin: DVec3::new(v[3], v[4], v[5]),
            joints: std::array::from_fn(|leg| [v[6 + 2 * leg], v[7 + 2 * leg]]),
        };
        self.warm = Coordinates::default();
    }

    /// Copies the position and motion of another ant, to the last digit: among the same walls both go on alike.
    pub fn follow(&mut self, other: &Self) {
        (self.place, self.rates, self.warm) = (other.place, other.rates, other.warm);
    }

    /// Returns the ant's positions and velocities.
    pub fn state(&self) -> AntState {
        let (p, o) = (self.place.position, self.place.orientation);
        let (v, w) = (self.rates.centre, self.rates.spin);
        let mut state = AntState::nominal();
        state.qpos[..7].copy_from_slice(&[p.x, p.y, p.z, o.w, o.x, o.y, o.z].map(|value| value as f32));
        state.qvel[..6].copy_from_slice(&[v.x, v.y, v.z, w.x, w.y, w.z].map(|value| value as f32));
        for joint in 0..JOINTS {
            state.qpos[7 + joint] = self.place.joints[joint / 2][joint % 2] as f32;
            state.qvel[6 + joint] = self.rates.joints[joint / 2][joint % 2] as f32;
        }
        state
    }

    /// Returns the mass of the ant, in kg.
    pub fn mass(&self) -> f64 {
        self.solids.mass()
    }

    /// Returns the walls around it.
    pub fn walls(&self) -> &Walls {
        &self.walls
    }

    /// Returns the ball and the limbs in the world.
    pub fn parts(&self) -> [Part; PARTS] {
        parts(&self.pose(&self.place))
    }

    /// Returns the position of the torso's centre and its rotation.
    pub fn torso(&self) -> (Vec3, Quat) {
        (self.place.position.as_vec3(), self.place.orientation.as_quat())
    }

    /// Makes one control step of [`CONTROL_STEP`]. The torques are 30 N·m times an action in -1..1, which is clipped,
    /// in the order of [`ACTUATED`].
    pub fn step(&mut self, action: &[f32; JOINTS]) {
        let mut torques = Hinges::default();
        for (&share, joint) in action.iter().zip(ACTUATED) {
            torques[joint / 2][joint % 2] = TORQUE * f64::from(share.clamp(-1.0, 1.0));
        }
        self.walls.near(self.place.position, &mut self.near);
        for _ in 0..SUBSTEPS {
            self.advance(&torques, CONTROL_STEP / SUBSTEPS as f64);
        }
    }

    fn advance(&mut self, torques: &Hinges, h: f64) {
        let (place, rates) = (self.place, self.rates);
        let (mut velocity, mut slope) = (Rates::default(), Rates::default());
        let (mut place_there, mut rates_there) = (place, rates);
        for (stage, weight) in WEIGHTS.into_iter().enumerate() {
            let acceleration = self.acceleration(&place_there, &rates_there, torques);
            velocity = velocity.plus(weight, &rates_there);
            slope = slope.plus(weight, &acceleration);
            let reach = if stage < 2 { h / 2.0 } else { h };
            place_there = place.moved(reach, &rates_there);
            rates_there = rates.plus(reach, &acceleration);
        }
        self.place = place.moved(h, &velocity);
        self.rates = rates.plus(h, &slope);
    }

    fn pose(&self, place: &JointPositions) -> Pose {
        Pose::new(place.position, place.orientation, &place.joints)
    }

    fn acceleration(&mut self, place: &JointPositions, rates: &Rates, torques: &Hinges) -> Rates {
        let pose = self.pose(place);
        let legs = pose.legs.map(|leg| self.solids.leg(&leg));
        let (spin, centre) = (rates.spin, pose.rotation.transpose() * rates.centre);
        let velocity = Coordinates { base: [spin.x, spin.y, spin.z, centre.x, centre.y, centre.z], legs: rates.joints };
        let hinge_forces = Coordinates { legs: plus(torques, -HINGE_DAMPING, &rates.joints), ..Coordinates::default() };
        let forces = hinge_forces.plus(-1.0, &bias(&pose, &self.solids, &legs, &velocity, self.gravity));
        let mass = mass_matrix(&self.solids, &legs);
        let free = mass.factor().solve(&forces);
        self.constrain(place, &pose, &velocity);
        self.warm = if self.rows.is_empty() { free } else { self.solver.solve(&mass, &free, &self.rows, &self.warm) };
        let [a, b, c, d, e, f] = self.warm.base;
        Rates { spin: DVec3::new(a, b, c), centre: pose.rotation * DVec3::new(d, e, f), joints: self.warm.legs }
    }

    fn constrain(&mut self, place: &JointPositions, pose: &Pose, velocity: &Coordinates) {
        self.rows.clear();
        constraint::limits(&place.joints, velocity, &self.mobility, &mut self.rows);
        contact::find(pose, &self.near, &mut self.contacts);
        for touch in &self.contacts {
            constraint::contact(touch, pose, velocity, &self.mobility, &mut self.rows);
        }
    }
}

// The ant's shapes in the world, for drawing.

/// Number of parts: the torso, and three limbs for each leg.
pub const PARTS: usize = 1 + 3 * LEGS;

/// A ball or a capsule.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Centre, in metres.
    pub centre: Vec3,
    /// Turns the y axis into the direction of the capsule.
    pub rotation: Quat,
    /// Radius, in metres.
    pub radius: f32,
    /// Half the distance of a capsule's ends, in metres; 0 for a ball.
    pub half_length: f32,
}

/// Returns the torso, then fixed, upper and lower limb of each leg.
pub fn parts(pose: &Pose) -> [Part; PARTS] {
    std::array::from_fn(|part| {
        let Some(limb) = part.checked_sub(1) else {
            let turned = Quat::from_mat3(&pose.rotation.as_mat3());
            let centre = pose.position.as_vec3();
            return Part { centre, rotation: turned, radius: TORSO_RADIUS as f32, half_length: 0.0 };
        };
        let leg = &pose.legs[limb / 3];
        let (from, to) = [(DVec3::ZERO, leg.hip), (leg.hip, leg.ankle), (leg.ankle, leg.foot)][limb % 3];
        capsule(pose.to_world(from), pose.to_world(to))
    })
}

fn capsule(from: DVec3, to: DVec3) -> Part {
    let along = (to - from).as_vec3();
    Part {
        centre: ((from + to) / 2.0).as_vec3(),
        rotation: Quat::from_rotation_arc(Vec3::Y, along.normalize()),
        radius: LIMB_RADIUS as f32,
        half_length: along.length() / 2.0,
    }
}

#[cfg(test)]
mod tests {
    use bevy::reflect::GetPath;

    use super::*;

    #[test]
    fn an_ant_that_follows_goes_on_like_the_other() {
        let (mut one, mut other) = (AntBody::new(&[]), AntBody::new(&[]));
        for _ in 0..40 {
            one.step(&[0.7; JOINTS]);
        }
        other.follow(&one);
        for _ in 0..10 {
            one.step(&[-0.3; JOINTS]);
            other.step(&[-0.3; JOINTS]);
            assert_eq!(one.state(), other.state());
        }
        other.set_state(&one.state());
        one.step(&[0.5; JOINTS]);
        other.step(&[0.5; JOINTS]);
        assert_ne!(one.state(), other.state(), "rounded numbers are not enough");
    }

    /// Lets `playbot doctor` name differences.
    #[test]
    fn reflection_sees_where_the_ant_is() {
        let mut body = AntBody::new(&[]);
        let height = |body: &AntBody| *body.path::<f64>(".place.position.z").expect("it is reflected");
        assert_eq!(height(&body), f64::from(body.state().qpos[2]));
        body.step(&[1.0; JOINTS]);
        assert_ne!(height(&body), 0.75, "it moves");
        assert!(body.path::<f64>(".place.joints[0][1]").is_ok() && body.path::<f64>(".rates.spin.x").is_ok());
    }
}
