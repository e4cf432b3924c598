//! Two pictures of the same thing, compared.

use bevy::prelude::*;
use bevy_playbot::vision::Frame;

/// How far two pictures are apart, over all that were compared.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Sum of absolute differences of all channels, 255ths.
    sum: u64,
    /// Channels.
    channels: u64,
    /// Pixels of which each channel is at most 8/255 off.
    near: u64,
}

impl Difference {
    /// Compares the frames of two agents.
    pub fn of(world: &World, one: Entity, other: Entity) -> Self {
        let pixels = |agent| &world.get::<Frame>(agent).expect("an eye").pixels;
        let (one, other) = (pixels(one), pixels(other));
        assert_eq!(one.len(), other.len());
        let mut difference = Self::default();
        for (a, b) in one.iter().zip(other) {
            let off = [0, 1, 2].map(|channel| a[channel].abs_diff(b[channel]));
            difference.sum += off.iter().map(|off| u64::from(*off)).sum::<u64>();
            difference.near += u64::from(off.iter().all(|off| *off <= 8));
            difference.channels += 3;
        }
        difference
    }

    /// Adds another comparison.
    pub fn add(&mut self, other: Self) {
        self.sum += other.sum;
        self.channels += other.channels;
        self.near += other.near;
    }

    /// Mean absolute difference, 255ths.
    pub fn mean(&self) -> f64 {
        self.sum as f64 / self.channels as f64
    }

    /// Share of pixels of which each channel is at most 8/255 off.
    pub fn near(&self) -> f64 {
        3.0 * self.near as f64 / self.channels as f64
    }
}
