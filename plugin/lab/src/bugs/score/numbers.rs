//! Shares and numbers of a table.

use serde::Serialize;

use crate::{report::whole, verdict::wilson};

/// A count of a total, with the 95 % Wilson interval of the share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Share {
    /// The count.
    pub count: u64,
    /// The total.
    pub of: u64,
    /// Lower and upper bound of the share.
    pub interval: [f64; 2],
}

impl Share {
    /// Creates the share of a count of a total.
    pub fn new(count: u64, of: u64) -> Self {
        Self { count, of, interval: wilson(count, of) }
    }

    /// Counts the true values.
    pub fn of(list: impl IntoIterator<Item = bool>) -> Self {
        let (mut count, mut of) = (0, 0);
        for is in list {
            of += 1;
            count += u64::from(is);
        }
        Self::new(count, of)
    }

    /// Returns the share; `None` if the total is 0.
    pub fn share(&self) -> Option<f64> {
        (self.of > 0).then(|| self.count as f64 / self.of as f64)
    }

    /// Returns the share, the counts and the interval in words.
    pub fn describe(&self) -> String {
        let Some(share) = self.share() else { return "–".to_owned() };
        let [low, high] = self.interval.map(|end| 100.0 * end);
        format!("{:.1} % ({} of {}; {low:.1} to {high:.1})", 100.0 * share, self.count, self.of)
    }

    /// Returns the counts in words.
    pub fn short(&self) -> String {
        if self.of == 0 { "–".to_owned() } else { format!("{} of {}", self.count, self.of) }
    }
}

/// Formats a number with two or three significant digits.
pub(super) fn short_number(value: f64) -> String {
    let size = value.abs();
    let decimals = match size {
        _ if size >= 100.0 || size == 0.0 || !size.is_finite() => return whole(value),
        _ if size >= 10.0 => 1,
        _ if size >= 1.0 => 2,
        _ if size < 0.001 => return "under 0.001".to_owned(),
        // Two digits behind the zeros.
        _ => (1.0 - size.log10().floor()) as usize,
    };
    format!("{value:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_have_their_intervals() {
        let share = Share::of([true, false, true, true, true, true, true, true, false, true]);
        assert_eq!((share.count, share.of, share.share()), (8, 10, Some(0.8)));
        assert_eq!(share.describe(), "80.0 % (8 of 10; 49.0 to 94.3)");
        let nothing = Share::of([]);
        assert_eq!((nothing.share(), nothing.describe().as_str(), nothing.short().as_str()), (None, "–", "–"));
    }

    #[test]
    fn numbers_have_two_or_three_digits() {
        let told = [2160.0, 12.345, 1.234, 0.1234, 0.005_526, 0.000_02, 0.0].map(short_number);
        assert_eq!(told, ["2,160", "12.3", "1.23", "0.12", "0.0055", "under 0.001", "0"]);
    }
}
