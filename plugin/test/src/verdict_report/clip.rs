//! Clips: the path of a failure as an animated PNG of the plan with a dot and its trail.

use crate::verdict::{EpisodePath, LevelMaps};
use bevy::math::{Rect, Vec2};
use playbot_harness::{drawing::Rgb, floor_plan::FloorPlan};
use png::{BitDepth, ColorType, Compression, Encoder, EncodingError, Filter};

/// Largest size of a clip, bytes.
const MOST_BYTES: usize = 30_000;

/// Pixels of the longer side of a level, unless its squares become smaller than [`SMALLEST`].
const LENGTH: u64 = 192;

/// Pixels of a square's side.
const SMALLEST: u64 = 2;

const LARGEST: u64 = 8;

/// Most squares along a side.
const MOST_SQUARES: u64 = 256;

/// Longest clip, in milliseconds; longer play is shown faster.
const LONGEST: f64 = 10_000.0;

/// Shortest and longest time for a square, in milliseconds.
const PACE: [f64; 2] = [30.0, 800.0];

/// Returns the clip of a level's failure, which plays once; `None` without a failure or anything to draw. Of a path
/// that is too long for a clip, the end is shown.
pub(crate) fn clip(plan: &FloorPlan, maps: &LevelMaps, tick_hz: f64) -> Option<Vec<u8>> {
    let EpisodePath { path, .. } = maps.failure.as_ref()?;
    let all = maps.columns.checked_mul(maps.rows)?;
    let is_drawn = maps.columns.max(maps.rows) <= MOST_SQUARES && all > 0 && maps.side > 0.0 && tick_hz > 0.0;
    if !is_drawn || path.iter().any(|[square, _]| *square >= all) {
        return None;
    }
    let mut path = path.as_slice();
    while !path.is_empty() {
        let bytes = Clip::new(plan, maps, tick_hz).encode(path).ok()?;
        if bytes.len() <= MOST_BYTES {
            return Some(bytes);
        }
        path = &path[path.len() / 2 + 1..];
    }
    None
}

struct Clip {
    canvas: Canvas,
    columns: u64,
    rows: u64,
    /// Pixels of a square's side.
    scale: u64,
    /// Milliseconds of a tick.
    tick: f64,
}

impl Clip {
    fn new(plan: &FloorPlan, maps: &LevelMaps, tick_hz: f64) -> Self {
        let (columns, rows) = (maps.columns, maps.rows);
        let scale = (LENGTH / columns.max(rows)).clamp(SMALLEST, LARGEST);
        let mut canvas = Canvas::new((columns * scale) as usize, (rows * scale) as usize);
        let (origin, unit) = (Vec2::new(maps.x, maps.y), scale as f32 / maps.side);
        let height = canvas.height as f32;
        let on_canvas = |area: &Rect| {
            let (min, max) = ((area.min - origin) * unit, (area.max - origin) * unit);
            Rect::from_corners(Vec2::new(min.x, height - max.y), Vec2::new(max.x, height - min.y))
        };
        let kinds = [
            (&plan.walls, ClipColour::Wall),
            (&plan.platforms, ClipColour::Platform),
            (&plan.hazards, ClipColour::Hazard),
        ];
        for (areas, colour) in kinds {
            areas.iter().for_each(|area| canvas.area(on_canvas(area), colour));
        }
        let half = Vec2::splat(maps.side / 2.0);
        canvas.area(on_canvas(&Rect::from_corners(plan.goal - half, plan.goal + half)), ClipColour::Goal);
        Self { canvas, columns, rows, scale, tick: 1000.0 / tick_hz }
    }

    /// Returns left, top, right and bottom of a square, in pixels.
    fn pixels(&self, square: u64) -> [usize; 4] {
        let (column, row) = (square % self.columns, self.rows - 1 - square / self.columns);
        [column, row, column + 1, row + 1].map(|edge| (edge * self.scale) as usize)
    }

    fn encode(&mut self, path: &[[u64; 2]]) -> Result<Vec<u8>, EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = Encoder::new(&mut bytes, self.canvas.width as u32, self.canvas.height as u32);
        encoder.set_color(ColorType::Indexed);
        encoder.set_depth(BitDepth::Four);
        encoder.set_palette(PALETTE.as_flattened().to_vec());
        // The paper is that of the page, light or dark.
        encoder.set_trns(vec![0]);
        encoder.set_compression(Compression::Balanced);
        encoder.set_filter(Filter::NoFilter);
        encoder.set_animated(path.len() as u32, 1)?;
        let mut writer = encoder.write_header()?;
        let total = path.iter().map(|[_, ticks]| *ticks as f64).sum::<f64>() * self.tick;
        let speed = (total / LONGEST).max(1.0);
        let mut before: Option<[usize; 4]> = None;
        for [square, ticks] in path {
            let now = self.pixels(*square);
            let mut changed = [0, 0, self.canvas.width, self.canvas.height];
            if let Some(before) = before {
                self.canvas.block(before, ClipColour::Trail);
                changed = [before[0].min(now[0]), before[1].min(now[1]), before[2].max(now[2]), before[3].max(now[3])];
            }
            self.canvas.block(now, ClipColour::Agent);
            let [left, top, right, bottom] = changed.map(|edge| edge as u32);
            let pause = (*ticks as f64 * self.tick / speed).clamp(PACE[0], PACE[1]);
            writer.set_frame_delay(pause.round() as u16, 1000)?;
            // At the corner any size fits.
            writer.set_frame_position(0, 0)?;
            writer.set_frame_dimension(right - left, bottom - top)?;
            writer.set_frame_position(left, top)?;
            writer.write_image_data(&self.canvas.packed(changed))?;
            before = Some(now);
        }
        writer.finish()?;
        Ok(bytes)
    }
}

// Canvas of pixels in a few colours.

/// All colours. The first one is transparent, all others are visible on light and on dark paper.
pub(crate) const PALETTE: [Rgb; 7] =
    [[255, 255, 255], [128, 136, 146], [176, 148, 98], [204, 82, 70], [86, 150, 200], [230, 120, 0], [0, 158, 115]];

/// A colour of the palette.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipColour {
    Paper,
    Wall,
    Platform,
    Hazard,
    Trail,
    Agent,
    Goal,
}

/// A picture, row by row from the top.
pub struct Canvas {
    pub width: usize,
    pub height: usize,
    pixels: Vec<u8>,
}

impl Canvas {
    /// Makes empty paper.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![ClipColour::Paper as u8; width * height] }
    }

    /// Fills the pixels whose middle lies in an area, and at least one.
    pub fn area(&mut self, area: Rect, colour: ClipColour) {
        if !(area.min.is_finite() && area.max.is_finite()) {
            return;
        }
        let edge = |at: f32, most: usize| at.round().clamp(0.0, most as f32) as usize;
        let (left, top) = (edge(area.min.x, self.width), edge(area.min.y, self.height));
        let (right, bottom) = (edge(area.max.x, self.width), edge(area.max.y, self.height));
        let is_seen = area.max.min_element() > 0.0 && left < self.width && top < self.height;
        if is_seen {
            self.block([left, top, right.max(left + 1), bottom.max(top + 1)], colour);
        }
    }

    /// Fills the pixels between left, top, right and bottom, which lie on the canvas.
    pub fn block(&mut self, [left, top, right, bottom]: [usize; 4], colour: ClipColour) {
        for row in top..bottom {
            self.pixels[row * self.width + left..row * self.width + right].fill(colour as u8);
        }
    }

    /// Returns the pixels of a part, two to a byte; each row begins with a new one.
    pub fn packed(&self, [left, top, right, bottom]: [usize; 4]) -> Vec<u8> {
        let rows = (top..bottom).map(|row| &self.pixels[row * self.width + left..row * self.width + right]);
        rows.flat_map(|row| row.chunks(2).map(|pair| (pair[0] << 4) | pair.get(1).copied().unwrap_or(0))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict_report::testing::garden;
    use std::io::Cursor;

    fn maps(path: Vec<[u64; 2]>) -> LevelMaps {
        let failure = Some(EpisodePath { tester: "random".to_owned(), episode: 0, path });
        LevelMaps { side: 1.0, columns: 64, rows: 16, failure, ..LevelMaps::default() }
    }

    #[test]
    fn a_dot_goes_the_way_and_every_frame_can_be_read() {
        let path: Vec<[u64; 2]> = (65..85).map(|square| [square, 3]).collect();
        let bytes = clip(&garden(), &maps(path), 15.0).expect("a path");
        assert!(bytes.len() < 4_000, "{} bytes", bytes.len());
        let mut reader = png::Decoder::new(Cursor::new(&bytes)).read_info().expect("a picture");
        assert_eq!((reader.info().width, reader.info().height), (192, 48));
        let control = reader.info().animation_control.expect("it moves");
        assert_eq!((control.num_frames, control.num_plays), (20, 1));
        let mut buffer = vec![0; 192 * 48];
        for number in 0..20 {
            let frame = reader.next_frame(&mut buffer).expect("whole");
            // From the second on, a frame is two squares of 3 pixels.
            let size = if number == 0 { (192, 48) } else { (6, 3) };
            assert_eq!((frame.width, frame.height), size, "frame {number}");
        }
        // Of the last frame, two pixels to a byte: the trail on the left, the agent on the right.
        let (trail, agent) = (ClipColour::Trail as u8, ClipColour::Agent as u8);
        assert_eq!(buffer[..3], [(trail << 4) | trail, (trail << 4) | agent, (agent << 4) | agent]);
        let again: Vec<[u64; 2]> = (65..85).map(|square| [square, 3]).collect();
        assert_eq!(clip(&garden(), &maps(again), 15.0).as_deref(), Some(bytes.as_slice()), "the same bytes");
    }

    #[test]
    fn long_ways_stay_small() {
        let path: Vec<[u64; 2]> = (0..200).map(|step| [(step * 37) % 1024, 500]).collect();
        let bytes = clip(&garden(), &maps(path), 15.0).expect("a path");
        assert!(bytes.len() <= MOST_BYTES, "{} bytes", bytes.len());
    }

    #[test]
    fn what_cannot_be_drawn_has_no_clip() {
        assert_eq!(clip(&garden(), &maps(vec![[1024, 1]]), 15.0), None, "no such square");
        assert_eq!(clip(&garden(), &maps(Vec::new()), 15.0), None);
        assert_eq!(clip(&garden(), &LevelMaps::default(), 15.0), None);
        let huge = LevelMaps { columns: u64::MAX, ..maps(vec![[0, 1]]) };
        assert_eq!(clip(&garden(), &huge, 15.0), None);
    }

    #[test]
    fn areas_are_clipped_and_rows_are_padded() {
        let mut canvas = Canvas::new(3, 2);
        canvas.area(Rect::new(-5.0, 1.0, 2.0, 9.0), ClipColour::Wall);
        canvas.area(Rect::new(2.2, 0.1, 2.3, 0.2), ClipColour::Goal);
        for outside in [Rect::new(3.0, 0.0, 4.0, 1.0), Rect::new(-4.0, 0.0, -1.0, 2.0)] {
            canvas.area(outside, ClipColour::Hazard);
        }
        canvas.area(Rect { min: bevy::math::Vec2::NAN, max: bevy::math::Vec2::ONE }, ClipColour::Hazard);
        assert_eq!(canvas.packed([0, 0, 3, 2]), [0x00, 0x60, 0x11, 0x00]);
        assert_eq!(canvas.packed([2, 0, 3, 1]), [0x60]);
    }
}
