//! Image augmentations: random changes that do not matter to the task, so that networks become insensitive to them.

use crate::{
    LearnError, SettingError,
    observation::{ImageShape, ObsKind},
    rng::unit,
};
use playbot_kernels::kept_memory::{OF_A_MOVE, share};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// A random change of an image. All pictures of a stack are changed alike.
#[derive(Serialize, Deserialize, Clone, Copy, PartialEq, Debug)]
pub enum Augmentation {
    /// Moves it by up to this many pixels along each axis; the pixels of its edges fill the gap.
    Translate(usize),
    /// Multiplies contrast, brightness and each of three colours by factors within 1 ± this share.
    ColorJitter(f32),
    /// Covers a rectangle of up to this share of each side with one colour.
    Cutout(f32),
    /// Restores this many rows and columns at the top left after all changes. Values painted there, such as velocity,
    /// are no part of the scene, and the policy must be able to read them.
    Keep(usize, usize),
}

impl Augmentation {
    /// Checks that it applies to such observations.
    ///
    /// # Errors
    /// [`LearnError::Setting`] if these are no images, or if `setting` has a number out of its range.
    pub(crate) fn check(self, setting: &'static str, observation: &ObsKind) -> Result<(), LearnError> {
        let bad = |why: String| Err(SettingError::new(setting, format!("{self:?} {why}")).into());
        let ObsKind::Image(shape) = observation else {
            return bad(format!("changes images, and observations are {observation}; leave it out"));
        };
        match self {
            Self::Translate(pixels) if pixels == 0 || pixels >= shape.width.min(shape.height) => bad(format!(
                "must move {observation} by 1 to {} pixels",
                shape.width.min(shape.height).saturating_sub(1)
            )),
            Self::ColorJitter(share) if !(share > 0.0 && share < 1.0) => {
                bad("needs a share above 0 and below 1".into())
            }
            Self::Keep(rows, columns)
                if !((1..=shape.height).contains(&rows) && (1..=shape.width).contains(&columns)) =>
            {
                bad(format!("must keep 1 to {} rows and 1 to {} columns", shape.height, shape.width))
            }
            Self::Cutout(share) if !(share > 0.0 && share <= 1.0) => bad("needs a share above 0 and up to 1".into()),
            _ => Ok(()),
        }
    }

    fn apply(self, image: &mut [u8], original: &[u8], shape: &ImageShape, rng: &mut ChaCha8Rng) {
        match self {
            Self::Keep(rows, columns) => put_back(image, original, shape, [rows, columns]),
            Self::Translate(most) => translate(image, shape, [offset(most, rng), offset(most, rng)]),
            Self::ColorJitter(share) => jitter(image, shape, share, rng),
            Self::Cutout(share) => cut_out(image, shape, share, rng),
        }
    }
}

/// Returns the images in these `rows` of many, each after all `augmentations`; the same on any number of threads.
pub(crate) fn augmented(
    pixels: &[u8],
    shape: &ImageShape,
    rows: &[usize],
    augmentations: &[Augmentation],
    rng: &mut ChaCha8Rng,
) -> Vec<u8> {
    let size = shape.numbers();
    let seeds: Vec<u64> = rows.iter().map(|_| rng.next_u64()).collect();
    let mut changed = vec![0; rows.len() * size];
    let moves = changed.len() * augmentations.len() * OF_A_MOVE;
    share(&mut changed, size.max(1), moves, |number, image| {
        let original = &pixels[rows[number] * size..][..size];
        image.copy_from_slice(original);
        let mut rng = ChaCha8Rng::seed_from_u64(seeds[number]);
        augmentations.iter().for_each(|augmentation| augmentation.apply(image, original, shape, &mut rng));
    });
    changed
}

fn put_back(image: &mut [u8], original: &[u8], shape: &ImageShape, [rows, columns]: [usize; 2]) {
    let size = shape.height * shape.width;
    for (channel, before) in image.chunks_exact_mut(size).zip(original.chunks_exact(size)) {
        let pairs = channel.chunks_exact_mut(shape.width).zip(before.chunks_exact(shape.width));
        pairs.take(rows).for_each(|(row, before)| row[..columns].copy_from_slice(&before[..columns]));
    }
}

/// Returns a whole number of pixels in -most..=most.
fn offset(most: usize, rng: &mut ChaCha8Rng) -> isize {
    (unit(rng) * (2 * most + 1) as f64) as isize - most as isize
}

/// Returns a factor within 1 ± share.
fn factor(share: f32, rng: &mut ChaCha8Rng) -> f32 {
    1.0 + share * (2.0 * unit(rng) as f32 - 1.0)
}

fn translate(image: &mut [u8], shape: &ImageShape, [down, right]: [isize; 2]) {
    let (height, width) = (shape.height, shape.width);
    let near = |at: usize, by: isize, len: usize| at.saturating_add_signed(-by).min(len - 1);
    let mut before = vec![0; height * width];
    for channel in image.chunks_exact_mut(height * width) {
        before.copy_from_slice(channel);
        for (y, row) in channel.chunks_exact_mut(width).enumerate() {
            let from = &before[near(y, down, height) * width..][..width];
            row.iter_mut().enumerate().for_each(|(x, to)| *to = from[near(x, right, width)]);
        }
    }
}

/// Returns the number of colours of each picture of a stack: three, or one of grey.
fn colours(shape: &ImageShape) -> usize {
    if shape.channels.is_multiple_of(3) { 3 } else { 1 }
}

fn jitter(image: &mut [u8], shape: &ImageShape, share: f32, rng: &mut ChaCha8Rng) {
    let [contrast, brightness] = [(); 2].map(|()| factor(share, rng));
    let tints = [(); 3].map(|()| factor(share, rng));
    let mean = image.iter().map(|&x| u64::from(x)).sum::<u64>() as f32 / image.len() as f32;
    for (channel, pixels) in image.chunks_exact_mut(shape.height * shape.width).enumerate() {
        let gain = brightness * tints[channel % colours(shape)];
        // Casts of numbers beyond 0..=255 saturate.
        let table: [u8; 256] = std::array::from_fn(|x| (((x as f32 - mean) * contrast + mean) * gain + 0.5) as u8);
        pixels.iter_mut().for_each(|x| *x = table[usize::from(*x)]);
    }
}

fn cut_out(image: &mut [u8], shape: &ImageShape, share: f32, rng: &mut ChaCha8Rng) {
    let mut span = |side: usize| {
        let len = (unit(rng) * f64::from(share) * side as f64).ceil() as usize;
        let from = (unit(rng) * (side - len + 1) as f64) as usize;
        from..from + len
    };
    let (rows, columns) = (span(shape.height), span(shape.width));
    let colour = [(); 3].map(|()| (unit(rng) * 256.0) as u8);
    for (channel, pixels) in image.chunks_exact_mut(shape.height * shape.width).enumerate() {
        for row in rows.clone() {
            pixels[row * shape.width..][columns.clone()].fill(colour[channel % colours(shape)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Streams;

    const SHAPE: ImageShape = ImageShape { channels: 6, height: 9, width: 7 };

    fn image() -> Vec<u8> {
        (0..SHAPE.numbers()).map(|i| (i * 37 % 251) as u8).collect()
    }

    fn changed(augmentation: Augmentation, draw: u64) -> Vec<u8> {
        let mut rng = Streams::new(1).stream("augment", draw);
        augmented(&image(), &SHAPE, &[0], &[augmentation], &mut rng)
    }

    #[test]
    fn moved_pictures_keep_their_pixels() {
        let mut picture = image();
        translate(&mut picture, &SHAPE, [2, -1]);
        let at = |pixels: &[u8], c: usize, y: usize, x: usize| pixels[(c * 9 + y) * 7 + x];
        for c in 0..6 {
            assert_eq!(at(&picture, c, 5, 3), at(&image(), c, 3, 4));
            assert_eq!(at(&picture, c, 0, 6), at(&image(), c, 0, 6), "the edge fills the gap");
        }
        let seen: Vec<_> = (0..200).map(|draw| changed(Augmentation::Translate(1), draw)).collect();
        let kinds: std::collections::BTreeSet<_> = seen.into_iter().collect();
        assert_eq!(kinds.len(), 9, "each of nine places comes up");
    }

    #[test]
    fn pictures_of_a_stack_are_changed_alike() {
        let half = SHAPE.numbers() / 2;
        let twice = [&image()[..half], &image()[..half]].concat();
        for augmentation in [Augmentation::Translate(3), Augmentation::ColorJitter(0.5), Augmentation::Cutout(0.8)] {
            for draw in 0..20 {
                let mut rng = Streams::new(2).stream("augment", draw);
                let got = augmented(&twice, &SHAPE, &[0], &[augmentation], &mut rng);
                assert_eq!(got[..half], got[half..], "{augmentation:?}");
            }
        }
    }

    #[test]
    fn colours_change_within_their_bounds_and_rectangles_cover_a_part() {
        let grey = vec![100; SHAPE.numbers()];
        for draw in 0..50 {
            let mut rng = Streams::new(3).stream("augment", draw);
            let jittered = augmented(&grey, &SHAPE, &[0], &[Augmentation::ColorJitter(0.2)], &mut rng);
            // (1 ± 0.2)² of 100, and contrast does nothing to a single shade.
            assert!(jittered.iter().all(|x| (64..=144).contains(x)), "{jittered:?}");
            let cut = augmented(&grey, &SHAPE, &[0], &[Augmentation::Cutout(0.5)], &mut rng);
            let covered = cut[..63].iter().filter(|x| **x != 100).count();
            assert!(covered <= 5 * 4, "{covered} pixels are covered");
        }
        assert_ne!(changed(Augmentation::Cutout(0.5), 0), changed(Augmentation::Cutout(0.5), 1));
    }

    #[test]
    fn what_is_written_at_the_top_left_is_kept_and_nothing_else() {
        let all = [
            Augmentation::Translate(3),
            Augmentation::ColorJitter(0.9),
            Augmentation::Cutout(1.0),
            Augmentation::Keep(2, 4),
        ];
        for draw in 0..20 {
            let stream = || Streams::new(5).stream("augment", draw);
            let kept = augmented(&image(), &SHAPE, &[0], &all, &mut stream());
            let lost = augmented(&image(), &SHAPE, &[0], &all[..3], &mut stream());
            for (i, pixel) in kept.iter().enumerate() {
                let (row, column) = (i % 63 / 7, i % 7);
                let expected = if row < 2 && column < 4 { image()[i] } else { lost[i] };
                assert_eq!(*pixel, expected, "row {row}, column {column}");
            }
        }
    }

    #[test]
    fn each_row_draws_its_own() {
        let both = [image(), image()].concat();
        let mut rng = Streams::new(4).stream("augment", 0);
        let got = augmented(&both, &SHAPE, &[1, 0, 1], &[Augmentation::ColorJitter(0.5)], &mut rng);
        let [a, b, c] = [0, 1, 2].map(|row| &got[row * SHAPE.numbers()..][..SHAPE.numbers()]);
        assert!(a != b && b != c && a != c);
    }

    #[test]
    fn a_misfit_is_reported() {
        let error = |augmentation: Augmentation, kind: ObsKind| {
            augmentation.check("ppo.augment", &kind).expect_err("does not fit").to_string()
        };
        let vectors = error(Augmentation::Cutout(0.3), ObsKind::Vector(5));
        assert!(vectors.contains("`ppo.augment` Cutout(0.3) changes images") && vectors.contains("vectors of 5"));
        assert!(error(Augmentation::Translate(7), SHAPE.into()).contains("1 to 6 pixels"));
        for share in [0.0, f32::NAN, 1.5] {
            assert!(error(Augmentation::ColorJitter(share), SHAPE.into()).contains("share"));
            assert!(error(Augmentation::Cutout(share), SHAPE.into()).contains("share"));
        }
        assert!(error(Augmentation::Keep(2, 8), SHAPE.into()).contains("1 to 9 rows and 1 to 7 columns"));
        assert!(Augmentation::Translate(6).check("ppo.augment", &SHAPE.into()).is_ok());
    }
}
