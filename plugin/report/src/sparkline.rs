//! Curves in one line of text.

const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// Draws the values as bars of different height, from the lowest to the highest value. Each of at most `width`
/// characters stands for the mean of its share of the values. Values that are not finite are left out; a share
/// without other values is a space.
pub fn sparkline(values: &[f64], width: usize) -> String {
    let size = values.len().div_ceil(width.max(1)).max(1);
    let means: Vec<f64> = values
        .chunks(size)
        .map(|chunk| {
            let known: Vec<f64> = chunk.iter().copied().filter(|value| value.is_finite()).collect();
            known.iter().sum::<f64>() / known.len() as f64
        })
        .collect();
    let low = means.iter().copied().fold(f64::NAN, f64::min);
    let high = means.iter().copied().fold(f64::NAN, f64::max);
    // A level curve is drawn at its bottom.
    let scale = if high > low { (BARS.len() - 1) as f64 / (high - low) } else { 0.0 };
    means.iter().map(|mean| if mean.is_nan() { ' ' } else { BARS[((mean - low) * scale).round() as usize] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_and_the_highest_value_are_the_ends() {
        assert_eq!(sparkline(&[0.0, 1.0, 7.0, f64::NAN, 3.6], 80), "▁▂█ ▅");
        assert_eq!(sparkline(&[0.0, 2.0, 6.0, 8.0, 8.0], 3), "▁▇█", "means of 1, 7 and 8");
        assert_eq!(sparkline(&[5.0, 5.0], 80), "▁▁");
        assert_eq!(sparkline(&[], 80), "");
        assert_eq!(sparkline(&[f64::INFINITY], 0), " ");
    }
}
