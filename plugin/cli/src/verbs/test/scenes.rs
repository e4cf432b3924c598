//! Findings as the game shows them, for the page of a test.

use crate::{
    error::CliError,
    pictures::episode_world::EpisodeStep,
    progress,
    progress::interrupt,
    verbs::replay::picture::{film, play, seen_as},
};
use bevy_playbot::vision::{ObservationConfig, ObservationKind};
use indicatif::ProgressBar;
use playbot_harness::game::Game;
use playbot_test::{
    findings::StoredFinding,
    verdict_report::{FindingScene, SceneTick},
};
use std::{
    cell::{Cell, OnceCell},
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

/// Enlargement of numbers, of a game without pictures.
const NUMBERS: u32 = 2;

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
        let most = ((SECONDS * game.tick_hz()) as usize).clamp(2, MOST_TICKS);
        let mut positions = Vec::new();
        let (steps, reach) = play(*game, finding, seen_as, most, &mut |world, _| {
            positions.push(world.position(*game).map(|position| position.to_array()));
        })?;
        self.played.set(self.played.get() + positions.len());
        let Some(last) = steps.last() else { return Ok(None) };
        let last_positions = &positions[positions.len() - steps.len()..];
        let tick = |(step, position): (&EpisodeStep, &Option<[f32; 2]>)| SceneTick {
            tick: step.tick,
            action: step.action.clone(),
            reward: step.reward,
            position: *position,
        };
        let ticks = steps.iter().zip(last_positions).map(tick).collect();
        let scale =
            if seen_as.is_image() { (LENGTH / seen_as.image.width.max(seen_as.image.height)).max(1) } else { NUMBERS };
        let film = film(*game, seen_as, scale, &reach)?;
        let (still, _) = film.captioned(last)?;
        let (moving, _) = film.animated(&steps, || {})?;
        Ok(Some(FindingScene { still, moving, ticks }))
    }
}

impl Drop for SceneMaker<'_> {
    fn drop(&mut self) {
        self.bar.get().iter().for_each(|bar| bar.finish_and_clear());
    }
}
