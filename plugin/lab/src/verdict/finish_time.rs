//! Times of solved episodes.

use serde::{Deserialize, Serialize};

/// Ticks of solved episodes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FinishTime {
    /// A quarter of the episodes took at most so many ticks.
    pub lower_quartile: f64,
    /// Half of the episodes took at most so many ticks.
    pub median: f64,
    /// Three quarters of the episodes took at most so many ticks.
    pub upper_quartile: f64,
}

impl FinishTime {
    /// Computes the quartiles of these episodes; `None` without episodes. Interpolates between two values (type 7 of
    /// Hyndman and Fan 1996, as in R's `quantile`).
    pub fn of(mut ticks: Vec<u32>) -> Option<Self> {
        ticks.sort_unstable();
        let last = ticks.len().checked_sub(1)?;
        let at = |share: f64| {
            let place = share * last as f64;
            let below = place.floor() as usize;
            let (low, high) = (f64::from(ticks[below]), f64::from(ticks[last.min(below + 1)]));
            low + (place - below as f64) * (high - low)
        };
        Some(Self { lower_quartile: at(0.25), median: at(0.5), upper_quartile: at(0.75) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quartiles_lie_between_the_values() {
        let of = |ticks: &[u32]| FinishTime::of(ticks.to_vec());
        let time = |lower_quartile, median, upper_quartile| FinishTime { lower_quartile, median, upper_quartile };
        assert_eq!(of(&[4, 1, 3, 2]), Some(time(1.75, 2.5, 3.25)));
        assert_eq!(of(&[30, 10, 20, 50, 40]), Some(time(20.0, 30.0, 40.0)));
        assert_eq!(of(&[7]), Some(time(7.0, 7.0, 7.0)));
        assert_eq!(of(&[]), None);
    }
}
