//! A rapier2d context of an arena's own: the walls as colliders, the ball as a body.
//!
//! The owner of the context steps it, so arenas are independent and can be stepped on any thread. Under
//! [`ContactModel::Rapier`](super::mode::ContactModel) it computes the contacts of the ball. Under
//! [`ContactModel::Soft`](super::mode::ContactModel) it only follows the ball, for sensors and rays of a game's own.

use crate::maze2d::{
    ball::{Ball, MASS, RADIUS, STEP, Vec2d},
    walls::{HALF, Walls},
};
use bevy::prelude::{Component, Reflect};
use bevy_rapier2d::rapier::prelude::{
    ColliderBuilder, ColliderHandle, IVector, IntegrationParameters, PhysicsWorld, Real, RigidBodyBuilder,
    RigidBodyHandle, Vector,
};

/// Distance ahead of a fast ball at which contacts are looked for, m: more than it can move in a step.
const AHEAD: Real = 0.06;

/// The context. Coordinates are those of the observation.
// Without `#[reflect(Component)]`: rapier's types are not reflected, so nothing of it could be compared, and `playbot
// doctor` must not count it as compared. The ball itself is in `MazeBall`, which is.
#[derive(Component, Reflect)]
#[reflect(from_reflect = false)]
pub struct MazePhysics {
    /// The contents of the context. Add bodies and sensors as you like; the game makes the steps.
    #[reflect(ignore)]
    pub world: PhysicsWorld,
    #[reflect(ignore)]
    ball: RigidBodyHandle,
    #[reflect(ignore)]
    walls: ColliderHandle,
}

impl MazePhysics {
    /// Makes walls, and a ball that they stop.
    pub fn solving(walls: &Walls, ball: &Ball) -> Self {
        let body = RigidBodyBuilder::dynamic().can_sleep(false).lock_rotations().soft_ccd_prediction(AHEAD);
        Self::new(walls, ball, body)
    }

    /// Makes walls, and a ball that follows the game's.
    pub fn following(walls: &Walls, ball: &Ball) -> Self {
        Self::new(walls, ball, RigidBodyBuilder::kinematic_position_based().can_sleep(false))
    }

    fn new(walls: &Walls, ball: &Ball, body: RigidBodyBuilder) -> Self {
        let mut world = PhysicsWorld { gravity: Vector::ZERO, ..PhysicsWorld::default() };
        world.integration_parameters = IntegrationParameters {
            dt: STEP as Real,
            // A contact may be taken over from the step before only if little has moved; here a ball moves its radius.
            contact_recycling: false,
            ..IntegrationParameters::default()
        };
        // One shape for all walls: a ball that slides along them must not meet the seams.
        let cells: Vec<IVector> = walls.cells().map(|(row, column)| IVector::new(row, column)).collect();
        let corner = walls.centre(0, 0).map(|along| along - HALF);
        let shape = ColliderBuilder::voxels(Vector::ONE, &cells).translation(vector(corner)).friction(0.0);
        let walls = world.colliders.insert(shape);
        let ball_shape = ColliderBuilder::ball(RADIUS as Real).mass(MASS as Real).friction(0.0).restitution(0.0);
        let (ball, _) = world.insert(body.translation(vector(ball.position)), ball_shape);
        // Rays find nothing before the first step.
        world.step();
        Self { world, ball, walls }
    }

    /// Returns the body of the ball.
    pub fn ball(&self) -> RigidBodyHandle {
        self.ball
    }

    /// Returns the collider of all walls.
    pub fn walls(&self) -> ColliderHandle {
        self.walls
    }

    /// Makes one step of a ball under a force. Its flight is the original's; rapier solves the contacts.
    pub(super) fn step(&mut self, ball: &mut Ball, force: Vec2d) {
        let body = &mut self.world.bodies[self.ball];
        body.set_translation(vector(ball.position), true);
        body.set_linvel(vector(ball.velocity_under(force)), true);
        self.world.step();
        let body = &self.world.bodies[self.ball];
        let [position, velocity] = [body.translation(), body.linvel()];
        *ball = Ball {
            position: [position.x, position.y].map(f64::from),
            velocity: [velocity.x, velocity.y].map(f64::from),
        };
    }

    /// Sets the context's ball to the game's.
    pub(super) fn follow(&mut self, ball: &Ball) {
        self.world.bodies[self.ball].set_next_kinematic_translation(vector(ball.position));
        self.world.step();
    }
}

fn vector([x, y]: Vec2d) -> Vector {
    Vector::new(x as Real, y as Real)
}
