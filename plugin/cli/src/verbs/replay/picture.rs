//! Pictures of a finding: its last tick, or an animation.

use crate::{
    error::CliError,
    output,
    pictures::{
        Film,
        caption::{NumberBars, Reach},
        episode_world::{EpisodeStep, EpisodeWorld},
        plot,
        plot::PlotFile,
    },
    progress,
};
use bevy_playbot::{
    fault::Fault,
    vision::{ObservationConfig, ObservationKind},
};
use playbot_harness::{
    game::Game,
    inspect::{LevelPicture, LevelRequest},
    sensors::GameSensors,
};
use playbot_test::findings::StoredFinding;
use std::{collections::VecDeque, path::Path};

/// Most ticks to draw, counted from the end.
const MOST_TICKS: usize = 3600;

/// The requested pictures.
pub struct Pictures<'a> {
    /// File for a picture of the last tick.
    pub still: Option<&'a Path>,
    /// File for an animated picture.
    pub animated: Option<&'a Path>,
    /// Enlargement of the bots' picture.
    pub scale: u32,
}

impl Pictures<'_> {
    /// Tests whether the files can be written.
    ///
    /// # Errors
    ///
    /// One of them cannot.
    pub fn prepare(&self) -> Result<(), CliError> {
        self.still.into_iter().chain(self.animated).try_for_each(output::prepare)
    }

    /// Returns whether there are any.
    pub fn are_wanted(&self) -> bool {
        self.still.is_some() || self.animated.is_some()
    }

    /// Draws and writes them.
    ///
    /// # Errors
    ///
    /// The game cannot be drawn, the pictures are too large, or the disk fails.
    pub fn write(&self, game: &dyn Game, finding: &StoredFinding) -> Result<(), CliError> {
        if !self.are_wanted() {
            return Ok(());
        }
        let seen_as = seen_as(game);
        let bar = progress::bar("play", finding.episode.len() as u64, "ticks");
        let played = play(game, finding, &seen_as, MOST_TICKS, &mut |_, _| bar.inc(1));
        bar.finish_and_clear();
        let (steps, reach) = played?;
        let Some(last) = steps.last() else { return self.write_level(game, finding) };
        let film = film(game, &seen_as, self.scale, &reach)?;
        if let Some(path) = self.still {
            output::write(path, &film.captioned(last)?.0)?;
            report!("picture: {} shows tick {}", path.display(), last.tick);
        }
        if let Some(path) = self.animated {
            let bar = progress::bar("draw", steps.len() as u64, "frames");
            let drawn = film.animated(&steps, || bar.inc(1));
            bar.finish_and_clear();
            output::write(path, &drawn?.0)?;
            report!("animation: {} shows ticks {} to {}", path.display(), steps[0].tick, last.tick);
        }
        Ok(())
    }

    /// Writes the level, for a finding before the end of the first tick, such as an unsolvable level.
    fn write_level(&self, game: &dyn Game, finding: &StoredFinding) -> Result<(), CliError> {
        let why = "it was found before the first tick was over";
        let Some(level) = picture_of(game, &finding.header.mode, finding.episode.level_seed) else {
            report!("nothing is drawn: {why}");
            return Ok(());
        };
        for path in self.still.into_iter().chain(self.animated) {
            plot::write(&PlotFile::new(path)?, &level, game.tick_hz())?;
            report!("picture: {} shows the level: {why}", path.display());
        }
        Ok(())
    }
}

/// Returns a picture of the last tick of a finding as a PNG whose longer side has about `length` pixels.
/// Of a finding before the end of the first tick it is the level; `None` if the game draws none.
///
/// # Errors
///
/// The game cannot be drawn, or the picture is too large.
pub(crate) fn last_tick(game: &dyn Game, finding: &StoredFinding, length: u32) -> Result<Option<Vec<u8>>, CliError> {
    const NUMBERS: u32 = 3;
    let seen_as = seen_as(game);
    let (steps, reach) = play(game, finding, &seen_as, 1, &mut |_, _| {})?;
    let Some(last) = steps.last() else {
        let level = picture_of(game, &finding.header.mode, finding.episode.level_seed);
        return level.map(|level| plot::png(&level, game.tick_hz())).transpose();
    };
    let side = seen_as.image.width.max(seen_as.image.height).max(1);
    let scale = if seen_as.is_image() { (length / side).clamp(1, 32) } else { NUMBERS };
    Ok(Some(film(game, &seen_as, scale, &reach)?.captioned(last)?.0))
}

/// Returns a level as the game draws it; `None` if it draws none.
fn picture_of(game: &dyn Game, mode: &str, level: u64) -> Option<LevelPicture> {
    let request = LevelRequest { mode: Some(mode), level: Some(level), picture: true, ..LevelRequest::default() };
    game.show_level(&request).ok()?.picture
}

/// Returns the pictures that a game has, or else its numbers.
pub(crate) fn seen_as(game: &dyn Game) -> ObservationConfig {
    let of = |kind| ObservationConfig { kind, ..ObservationConfig::default() };
    if game.tools().pictures.picture().is_some() {
        return of(ObservationKind::Raster);
    }
    let camera = of(ObservationKind::Camera);
    if game.tools().pictures.has_camera() && camera.check(game).is_ok() { camera } else { of(ObservationKind::Vector) }
}

/// Returns the film of a game in these pictures, or of its numbers, enlarged.
///
/// # Errors
///
/// The pictures are too large.
pub(crate) fn film(game: &dyn Game, seen_as: &ObservationConfig, scale: u32, reach: &Reach) -> Result<Film, CliError> {
    if seen_as.is_image() {
        return Film::new(seen_as.image, scale, game.tick_hz());
    }
    Ok(Film::of_numbers(NumberBars::new(game.observation().names, scale, reach), game.tick_hz()))
}

/// Plays the last ticks up to the finding, `most` at most, and calls `each` after each tick that is played. A game that
/// breaks ends it.
///
/// # Errors
///
/// The pictures cannot be made.
pub(crate) fn play(
    game: &dyn Game,
    finding: &StoredFinding,
    seen_as: &ObservationConfig,
    most: usize,
    each: &mut dyn FnMut(&EpisodeWorld, &EpisodeStep),
) -> Result<(Vec<EpisodeStep>, Reach), CliError> {
    let mut world = EpisodeWorld::replaying(game, &finding.header.mode, seen_as, finding.episode.clone())?;
    world.keep_no_panic_files();
    let (mut steps, mut reach) = (VecDeque::new(), Reach::default());
    loop {
        match world.next() {
            Ok(Some(step)) => {
                reach.include(&step.vector);
                each(&world, &step);
                steps.push_back(step);
                if steps.len() > most {
                    steps.pop_front();
                }
            }
            Ok(None) => break,
            Err(error) if error.is::<Fault>() => break,
            Err(error) => return Err(error),
        }
    }
    Ok((steps.into(), reach))
}
