//! Colours on white paper, distinct for every kind of colour vision.

use crate::drawing::Rgb;

pub const INK: Rgb = [31, 35, 40];
pub const SOFT: Rgb = [87, 96, 106];
pub const PAPER: Rgb = [255, 255, 255];
pub const WALL: Rgb = [190, 195, 201];
pub const HAZARD: Rgb = [236, 148, 138];
pub const PLATFORM: Rgb = [226, 209, 176];

/// The colours of lines, those of the other charts.
pub const LINES: [Rgb; 7] =
    [[0, 114, 178], [213, 94, 0], [0, 158, 115], [178, 82, 155], [201, 133, 0], [58, 155, 220], [91, 91, 91]];

/// From rarely to often visited: darker at every step.
const HEAT: [Rgb; 5] = [[255, 237, 160], [254, 178, 76], [240, 82, 40], [177, 0, 60], [68, 1, 52]];

/// Returns the colour of a share, 0 to 1, of the most visits.
pub fn heat(share: f64) -> Rgb {
    let place = share.clamp(0.0, 1.0) * (HEAT.len() - 1) as f64;
    let below = (place as usize).min(HEAT.len() - 2);
    let part = place - below as f64;
    std::array::from_fn(|channel| {
        let (from, to) = (f64::from(HEAT[below][channel]), f64::from(HEAT[below + 1][channel]));
        (from + part * (to - from)).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_visits_are_darker() {
        let light = |share: f64| {
            let [red, green, blue] = heat(share).map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        for step in 1..=100 {
            assert!(light(f64::from(step) / 100.0) < light(f64::from(step - 1) / 100.0), "{step}");
        }
        assert_eq!((heat(-1.0), heat(2.0)), (HEAT[0], HEAT[4]));
    }
}
