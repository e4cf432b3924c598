//! Drawings of the levels in the table.

use super::{base64::base64, clip::clip, picture::picture, plans::Plans};
use crate::verdict::LevelVerdict;

/// Largest number of levels with a picture, the worst ones.
const MOST_PICTURES: usize = 200;
/// Largest number of levels with a clip.
const MOST_CLIPS: usize = 60;
/// Largest number of letters of all clips together.
const MOST_LETTERS: usize = 1_200_000;

/// Drawing of a level.
pub struct Drawn {
    /// Its picture, as SVG.
    pub picture: String,
    /// Its failure as an animated PNG, in base64.
    pub clip: Option<String>,
}

/// Drawer of levels, within the size limits of the page.
pub struct Drawer<'a> {
    plans: &'a Plans<'a>,
    levels: usize,
    clips: usize,
    letters: usize,
    /// Number of pictures drawn.
    pub pictures: usize,
    /// Number of those with maps.
    pub maps: usize,
}

impl<'a> Drawer<'a> {
    /// Makes a drawer for a page without pictures so far.
    pub fn new(plans: &'a Plans<'a>) -> Self {
        Self { plans, levels: 0, clips: 0, letters: 0, pictures: 0, maps: 0 }
    }

    /// Draws the next level of the table; `None` if it has no plan, or enough were drawn.
    pub fn draw(&mut self, level: &LevelVerdict) -> Option<Drawn> {
        self.levels += 1;
        let plan = if self.levels <= MOST_PICTURES { self.plans.get(level)? } else { return None };
        let picture = picture(&plan, level)?;
        self.pictures += 1;
        self.maps += usize::from(level.maps.is_some());
        let is_room = self.clips < MOST_CLIPS && self.letters < MOST_LETTERS;
        let clip = level.maps.as_ref().filter(|_| is_room).and_then(|maps| clip(&plan, maps, self.plans.tick_hz()?));
        let text = clip.map(|bytes| base64(&bytes));
        self.letters += text.as_ref().map_or(0, String::len);
        // The first clip without room is the last one that is tried.
        let clip = text.filter(|_| self.letters <= MOST_LETTERS);
        self.clips += usize::from(clip.is_some());
        Some(Drawn { picture, clip })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        verdict::{FailureWay, LevelMaps},
        verdict_report::testing::{Garden, level, record},
    };

    #[test]
    fn pictures_and_clips_are_limited() {
        let tested = record("hard:0..299", None);
        let plans = Plans::of(Some(&Garden), &tested);
        let mut drawer = Drawer::new(&plans);
        let failure = Some(FailureWay { tester: "random".to_owned(), episode: 0, way: vec![[65, 3], [66, 1]] });
        let maps = LevelMaps { side: 1.0, columns: 64, rows: 16, failure, ..LevelMaps::default() };
        let mut clips = 0;
        for index in 0..300 {
            let maps = (index % 2 == 0).then(|| maps.clone());
            let drawn = drawer.draw(&LevelVerdict { maps, ..level(index, 0, 1, 0) });
            assert_eq!(drawn.is_some(), index < 200);
            let clip = drawn.and_then(|drawn| drawn.clip);
            assert!(clip.as_ref().is_none_or(|clip| clip.starts_with("iVBORw0KGgo")), "the head of a PNG");
            clips += usize::from(clip.is_some());
        }
        assert_eq!((drawer.pictures, drawer.maps, clips), (200, 100, MOST_CLIPS));
    }
}
