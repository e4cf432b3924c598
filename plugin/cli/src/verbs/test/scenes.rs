//! Findings as the game shows them, for the page of a test.

use crate::{
    error::CliError,
    pictures::{
        Film,
        caption::{NumberBars, Reach},
        episode_world::{EpisodeStep, EpisodeWorld},
    },
    progress,
    progress::interrupt,
    verbs::replay::picture::seen_as,
};
use bevy_playbot::{
    fault::Fault,
    vision::{ObservationConfig, ObservationKind},
};
use indicatif::ProgressBar;
use playbot_harness::game::Game;
use playbot_test::{
    findings::StoredFinding,
    verdict_report::{FindingScene, SceneTick},
};
use std::{
    cell::{Cell, OnceCell},
    collections::VecDeque,
    path::Path,
};

/// Seconds of a scene.
const SECONDS: f64 = 3.0;

/// Most ticks of a scene.
const MOST_TICKS: usize = 180;

/// Ticks that are played for all scenes of a page. Later findings have no scene: a page is to be there soon.
const MOST_PLAYED: usize = 60_000;

/// Scenes that a camera draws, each of which takes a second or more.
const MOST_CAMERAS: usize = 12;

/// Length of the longer side of a picture, pixels.
const LENGTH: u32 = 192;

/// Draws the scenes of a page.
pub(crate) struct SceneMaker<'a> {
    game: &'a dyn Game,
    seen_as: ObservationConfig,
    played: Cell<usize>,
    made: Cell<usize>,
    bar: OnceCell<ProgressBar>,
}

impl<'a> SceneMaker<'a> {
    /// Makes one for the findings of a game.
    pub fn new(game: &'a dyn Game) -> Self {
        Self { game, seen_as: seen_as(game), played: Cell::new(0), made: Cell::new(0), bar: OnceCell::new() }
    }

    /// Plays the finding in a file, and draws its last ticks. `None` if it cannot be played, is not drawn, or enough were.
    pub fn scene(&self, file: &Path) -> Option<FindingScene> {
        let is_camera = self.seen_as.kind == ObservationKind::Camera;
        let is_enough = self.played.get() >= MOST_PLAYED || (is_camera && self.made.get() >= MOST_CAMERAS);
        if is_enough || interrupt::asked() {
            return None;
        }
        let finding = StoredFinding::read(file).ok().filter(|finding| finding.header.game == self.game.name())?;
        let finding = finding.seen_from(self.game, file);
        if finding.check_playable(self.game).is_err() || finding.episode.is_empty() {
            return None;
        }
        self.bar.get_or_init(|| progress::bar("draw findings", 0, "findings")).inc(1);
        self.made.set(self.made.get() + 1);
        self.draw(&finding).ok().flatten()
    }

    fn draw(&self, finding: &StoredFinding) -> Result<Option<FindingScene>, CliError> {
        let Self { game, seen_as, .. } = self;
        let mode = &finding.header.mode;
        let mut world = EpisodeWorld::replaying(*game, mode, seen_as, finding.episode.clone())?;
        world.keep_no_panic_files();
        let most = ((SECONDS * game.tick_hz()) as usize).clamp(2, MOST_TICKS);
        let (mut steps, mut ticks, mut reach) = (VecDeque::new(), VecDeque::new(), Reach::default());
        loop {
            match world.next() {
                Ok(Some(step)) => {
                    self.played.set(self.played.get() + 1);
                    reach.include(&step.vector);
                    let position = world.position(*game).map(|position| position.to_array());
                    let EpisodeStep { tick, action, reward, .. } = &step;
                    ticks.push_back(SceneTick { tick: *tick, action: action.clone(), reward: *reward, position });
                    steps.push_back(step);
                    if steps.len() > most {
                        steps.pop_front();
                        ticks.pop_front();
                    }
                }
                Ok(None) => break,
                // That is the finding.
                Err(error) if error.is::<Fault>() => break,
                Err(error) => return Err(error),
            }
        }
        let steps: Vec<EpisodeStep> = steps.into();
        let Some(last) = steps.last() else { return Ok(None) };
        let film = if seen_as.is_image() {
            let longest = seen_as.image.width.max(seen_as.image.height);
            Film::new(seen_as.image, (LENGTH / longest).max(1), game.tick_hz())?
        } else {
            Film::of_numbers(NumberBars::new(game.observation().names, 2, &reach), game.tick_hz())
        };
        let (still, _) = film.captioned(last)?;
        let (moving, _) = film.animated(&steps, || {})?;
        Ok(Some(FindingScene { still, moving, ticks: ticks.into() }))
    }
}

impl Drop for SceneMaker<'_> {
    fn drop(&mut self) {
        self.bar.get().iter().for_each(|bar| bar.finish_and_clear());
    }
}
