//! Working memory of a thread.

use super::plan::Plan;
use super::winograd::PointBuffers;

/// Buffers that are needed only briefly, for one image at a time.
#[derive(Debug)]
pub(super) struct Workspace {
    /// Stages before their pooling.
    pub(super) wides: Vec<Vec<f32>>,
    /// Convolutions with fewer products.
    pub(super) points: PointBuffers,
}

impl Workspace {
    pub(super) fn new(plan: &Plan) -> Self {
        let wides = plan.wides.iter().map(|grid| vec![0.0; grid.len()]).collect();
        Self { wides, points: PointBuffers::default() }
    }
}
