//! Chart of where agents went.

use bevy::math::{Rect, Vec2};

use super::layout;
use crate::{drawing::Drawing, eval::Trail, floor_plan::FloorPlan};

/// Trajectories and visits of one or more players on one or more floors.
#[derive(Clone, Debug, PartialEq)]
pub struct TrailChart {
    /// Title of the chart.
    pub title: String,
    /// The floors, below each other. Only the first 6 are drawn.
    pub floors: Vec<Floor>,
}

/// Levels with the same walls, and the players that walked there.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Description of the levels.
    pub name: String,
    /// The bounds and the walls.
    pub plan: FloorPlan,
    /// Start positions of agents on these levels.
    pub starts: Vec<Vec2>,
    /// Goal positions on these levels.
    pub goals: Vec<Vec2>,
    /// The players, side by side.
    pub walkers: Vec<Walker>,
}

/// One player on one floor.
#[derive(Clone, Debug, PartialEq)]
pub struct Walker {
    /// Name of the player.
    pub name: String,
    /// Its episodes.
    pub trails: Vec<Trail>,
}

impl Floor {
    /// Returns the bounds of the plan, extended to everything that was walked on.
    pub(super) fn extent(&self) -> Rect {
        let places = self.walkers.iter().flat_map(|walker| &walker.trails).flat_map(|trail| &trail.places);
        places.filter(|place| place.is_finite()).fold(self.plan.bounds, |extent, &place| extent.union_point(place))
    }
}

impl TrailChart {
    /// Draws the chart: for each player its trajectories, and a map of the squares visited in all its episodes.
    /// Trajectories are coloured lines, one per episode and at most 24.
    pub fn draw(&self) -> Drawing {
        layout::draw(self)
    }
}
