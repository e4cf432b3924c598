//! Conversion of a frame's pixels to the bytes that a policy reads.

use super::ImageOptions;

/// Weights of red, green and blue in brightness (ITU-R BT.601), in 65536ths.
const BRIGHTNESS: [u32; 3] = [19595, 38470, 7471];

/// Writes a frame as `[colours, height, width]`.
pub(super) fn write_planes(pixels: &[[u8; 4]], options: &ImageOptions, out: &mut [u8]) {
    if options.grayscale {
        for (byte, pixel) in out.iter_mut().zip(pixels) {
            *byte = brightness(*pixel);
        }
        return;
    }
    for (colour, plane) in out.chunks_exact_mut(pixels.len()).enumerate() {
        for (byte, pixel) in plane.iter_mut().zip(pixels) {
            *byte = (u32::from_le_bytes(*pixel) >> (8 * colour)) as u8;
        }
    }
}

/// Returns the brightness, rounded to the nearest.
fn brightness([red, green, blue, _]: [u8; 4]) -> u8 {
    let [r, g, b] = BRIGHTNESS;
    ((r * u32::from(red) + g * u32::from(green) + b * u32::from(blue) + 0x8000) >> 16) as u8
}

/// Returns the columns of this many squares side by side. A pixel belongs to the square that
/// contains its centre.
pub(super) fn edge_of_squares(squares: usize, width: usize) -> usize {
    (2 * squares * width + 5) / 10
}

/// Paints two squares at the top left, each a fifth of the width, whose grey shows the velocity:
/// black for -1, white for 1. Grey keeps its value when converted to brightness, so the order of
/// the two steps is irrelevant.
pub(super) fn paint_velocity(velocity: [f32; 2], options: &ImageOptions, planes: &mut [u8]) {
    let (width, height) = (options.width as usize, options.height as usize);
    let edge = |squares: usize| edge_of_squares(squares, width);
    for (square, speed) in velocity.into_iter().enumerate() {
        let grey = (255.0 * (0.5 * speed.clamp(-1.0, 1.0) + 0.5)) as u8;
        for plane in planes.chunks_exact_mut(width * height) {
            for row in plane.chunks_exact_mut(width).take(edge(1)) {
                row[edge(square)..edge(square + 1)].fill(grey);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_become_planes() {
        let options = ImageOptions { width: 2, height: 1, ..Default::default() };
        let mut out = [0; 6];
        write_planes(&[[1, 2, 3, 255], [10, 20, 30, 255]], &options, &mut out);
        assert_eq!(out, [1, 10, 2, 20, 3, 30]);
    }

    #[test]
    fn brightness_has_the_weights_of_bt_601() {
        let options = ImageOptions { width: 5, height: 1, grayscale: true, ..Default::default() };
        let pixels = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [200, 100, 50, 255], [77, 77, 77, 255]];
        let mut out = [0; 5];
        write_planes(&pixels, &options, &mut out);
        // 76.245, 149.685, 29.07 and 124.2.
        assert_eq!(out, [76, 150, 29, 124, 77]);
    }

    #[test]
    fn velocity_is_two_grey_squares() {
        let options = ImageOptions { paint_velocity: true, ..Default::default() };
        let mut planes = vec![7; 3 * 64 * 64];
        paint_velocity([0.2, 0.0], &options, &mut planes);
        for plane in planes.chunks(64 * 64) {
            let at = |x: usize, y: usize| plane[y * 64 + x];
            // The squares have a side of 12.8 pixels.
            assert_eq!([at(0, 0), at(12, 12), at(13, 0), at(25, 12)], [153, 153, 127, 127]);
            assert_eq!([at(26, 0), at(0, 13), at(25, 13)], [7; 3]);
            assert_eq!(options.painted_corner(), Some([13, 26]));
        }
        paint_velocity([-9.0, 9.0], &options, &mut planes);
        assert_eq!([planes[0], planes[20]], [0, 255], "no faster than the fastest");
    }

    #[test]
    fn velocity_fits_pictures_that_are_wide_and_low() {
        let options = ImageOptions { width: 9, height: 1, paint_velocity: true, ..Default::default() };
        let mut planes = vec![7; 3 * 9];
        paint_velocity([1.0, -1.0], &options, &mut planes);
        assert_eq!(planes[..9], [255, 255, 0, 0, 7, 7, 7, 7, 7]);
    }
}
