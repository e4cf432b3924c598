//! What is drawn of where agents went.

use bevy::math::{Rect, Vec2};

use super::layout;
use crate::{drawing::Drawing, eval::Trail, floor_plan::FloorPlan};

/// Trajectories and visits of one or more players on one or more floors.
#[derive(Clone, Debug, PartialEq)]
pub struct TrailChart {
    /// What it shows.
    pub title: String,
    /// The floors, below each other. Only the first 6 are drawn.
    pub floors: Vec<Floor>,
}

/// Levels with the same walls, and who walked there.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// The levels, for people.
    pub name: String,
    /// The bounds and the walls.
    pub plan: FloorPlan,
    /// Where agents start, on one level or another.
    pub starts: Vec<Vec2>,
    /// Where they should go, on one level or another.
    pub goals: Vec<Vec2>,
    /// Who walked, side by side.
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
    /// The bounds of the plan, and around them whatever else was walked on.
    pub(super) fn extent(&self) -> Rect {
        let places = self.walkers.iter().flat_map(|walker| &walker.trails).flat_map(|trail| &trail.places);
        places.filter(|place| place.is_finite()).fold(self.plan.bounds, |extent, &place| extent.union_point(place))
    }
}

impl TrailChart {
    /// The chart: for each player its trajectories, one coloured line per episode and at most 24 of them, and a map of
    /// the places that all its episodes visited.
    pub fn draw(&self) -> Drawing {
        layout::draw(self)
    }
}
