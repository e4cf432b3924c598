//! Findings as the game shows them, for the page of a test: the ticks before a finding, or those around the tick since which
//! something is wrong.

use crate::{
    error::CliError,
    pictures::episode_world::EpisodeStep,
    progress,
    progress::interrupt,
    verbs::replay::{film, play, seen_as},
};
use bevy_playbot::{
    demo::file::DemoEnd,
    vision::{ObservationConfig, ObservationKind},
};
use indicatif::ProgressBar;
use playbot_harness::game::Game;
use playbot_test::{
    detectors::LogReader,
    findings::StoredFinding,
    verdict_report::{FindingScene, GameLogLine, SceneFilm, SceneTick, tick_since},
};
use png::{BitDepth, ColorType, Compression, Decoder, Encoder, EncodingError, Filter};
use std::{
    cell::{Cell, OnceCell},
    io::Cursor,
    path::Path,
};
use tracing::Level;

/// Seconds of a scene.
const SECONDS: f64 = 3.0;

/// Share of the ticks of a scene that lie after the tick since which something is wrong: one of so many.
const AFTER: usize = 3;

/// Most ticks of a scene.
const MOST_TICKS: usize = 180;

/// Ticks that are played for all scenes of a page. Later findings have no scene: a page is to be there soon.
const MOST_PLAYED: usize = 60_000;

/// Scenes that a camera draws, each of which takes a second or more.
const MOST_CAMERAS: usize = 12;

/// Length of the longer side of a picture, pixels.
const LENGTH: u32 = 192;

/// Most pixels of all pictures of a scene. Of larger ones, the last ticks are shown: a browser holds them all at once.
const MOST_PIXELS: usize = 1 << 23;

/// Bytes of a pixel.
const CHANNELS: usize = 3;

/// Shortest and longest time for which a page shows a tick, milliseconds.
const PAUSE: [f64; 2] = [15.0, 1_000.0];

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

    /// Plays the finding in a file, and draws its last ticks, or those around the tick since which something is wrong.
    /// `None` if it cannot be played, is not drawn, or enough were.
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
        let since = earlier_tick(finding, most);
        let cut = since.map(|since| up_to(finding, since as usize + 1 + most / AFTER));
        let finding = cut.as_ref().unwrap_or(finding);
        let (mut positions, mut entities, mut log) = (Vec::new(), Vec::new(), Vec::new());
        let reader = LogReader::down_to(Level::INFO);
        let lines = |tick: u32| reader.take().into_iter().map(move |line| GameLogLine { tick, line });
        let played = reader.listen(|| {
            play(*game, finding, seen_as, most, &mut |world, step| {
                positions.push(world.position(*game).map(|position| position.to_array()));
                entities.push(world.entities());
                log.extend(lines(step.tick));
            })
        });
        let (steps, reach) = played?;
        // Those of a tick in which the game broke, which was not played to its end.
        log.extend(lines(positions.len() as u32));
        self.played.set(self.played.get() + positions.len());
        let Some(last) = steps.last() else { return Ok(None) };
        let first = positions.len() - steps.len();
        let tick = |((step, position), entities): ((&EpisodeStep, &Option<[f32; 2]>), &u32)| SceneTick {
            tick: step.tick,
            action: step.action.clone(),
            reward: step.reward,
            position: *position,
            entities: *entities,
        };
        let ticks = steps.iter().zip(&positions[first..]).zip(&entities[first..]).map(tick).collect();
        let scale =
            if seen_as.is_image() { (LENGTH / seen_as.image.width.max(seen_as.image.height)).max(1) } else { NUMBERS };
        let film = film(*game, seen_as, scale, &reach)?;
        let still = since.and_then(|since| steps.iter().find(|step| step.tick == since));
        let (still, [width, height]) = film.captioned(still.unwrap_or(last))?;
        let shown = steps.len().min(MOST_PIXELS / (width * height).max(1));
        let pictures = if shown > 1 {
            let (moving, size) = film.animated(&steps[steps.len() - shown..], || {})?;
            film_of(&moving, shown, size, game.tick_hz())
        } else {
            None
        };
        let first = steps.first().map_or(0, |step| step.tick);
        log.retain(|line: &GameLogLine| line.tick >= first);
        let path = positions.into_iter().flatten().collect();
        Ok(Some(FindingScene { still, film: pictures, ticks, since, path, log }))
    }
}

/// Returns the tick since which something is wrong, if it lies before the last `most` ticks of a finding, in which nothing
/// may happen any more.
fn earlier_tick(finding: &StoredFinding, most: usize) -> Option<u32> {
    let last = finding.episode.len().checked_sub(1)?;
    let found = finding.head.tick.unwrap_or(u32::try_from(last).unwrap_or(u32::MAX));
    tick_since(&finding.head.message, found).filter(|since| *since as usize + most <= last)
}

/// Returns a finding without the ticks after the first ones.
fn up_to(finding: &StoredFinding, ticks: usize) -> StoredFinding {
    let mut cut = finding.clone();
    let episode = &mut cut.episode;
    // Columns of an observation. An episode without ticks has no observations.
    let columns = episode.observations.len() / episode.len().max(1);
    episode.actions.truncate(ticks);
    episode.rewards.truncate(ticks);
    episode.state_hashes.truncate(ticks);
    episode.deciders.truncate(ticks);
    episode.observations.truncate(ticks.saturating_mul(columns));
    episode.end = DemoEnd::Aborted;
    cut
}

/// Puts the pictures of an animated PNG side by side into one. `None` if they cannot be read.
fn film_of(moving: &[u8], pictures: usize, [width, height]: [usize; 2], tick_hz: f64) -> Option<SceneFilm> {
    let columns = (1..pictures).find(|columns| columns * columns >= pictures).unwrap_or(1);
    let (row, all_rows) = (columns * width * CHANNELS, pictures.div_ceil(columns) * height);
    let mut all = vec![0; row * all_rows];
    let mut picture = vec![0; width * height * CHANNELS];
    let mut reader = Decoder::new(Cursor::new(moving)).read_info().ok()?;
    for number in 0..pictures {
        reader.next_frame(&mut picture).ok()?;
        let corner = number / columns * height * row + number % columns * width * CHANNELS;
        for (line, pixels) in picture.chunks_exact(width * CHANNELS).enumerate() {
            let begin = corner + line * row;
            all[begin..begin + pixels.len()].copy_from_slice(pixels);
        }
    }
    let png = encoded(&all, [columns * width, all_rows]).ok()?;
    let pause = 1000.0 / tick_hz;
    let pause = if pause.is_finite() { pause.clamp(PAUSE[0], PAUSE[1]) } else { PAUSE[1] };
    Some(SceneFilm { png, pictures, columns, size: [width, height], pause: pause.round() as u32 })
}

fn encoded(pixels: &[u8], [width, height]: [usize; 2]) -> Result<Vec<u8>, EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Balanced);
    // Enlarged pixels repeat the row above.
    encoder.set_filter(Filter::Up);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(bytes)
}

impl Drop for SceneMaker<'_> {
    fn drop(&mut self) {
        self.bar.get().iter().for_each(|bar| bar.finish_and_clear());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::prelude::*;
    use bevy_playbot::{
        action::Actions,
        demo::file::{Decider, DemoEpisode},
    };
    use playbot_harness::foreign::ForeignGame;
    use playbot_test::findings::FindingHead;

    /// Ticks of the finding's episode.
    const TICKS: usize = 200;

    fn noisy(app: &mut App) {
        app.add_systems(Update, |mut run: Local<u32>| {
            *run += 1;
            tracing::debug!(target: "noisy_game", "run {}", *run);
            tracing::warn!(target: "noisy_game", run = *run, "the door jams");
            tracing::error!(target: "bevy_ecs::world", "of the engine");
        });
    }

    fn noisy_game() -> ForeignGame {
        ForeignGame::new("noisy", 1, noisy).keys([vec![], vec![KeyCode::ArrowRight]]).observe(["x"], || [0.0])
    }

    /// Makes a finding with this message in the last of all ticks.
    fn stored(game: &dyn Game, message: &str) -> StoredFinding {
        let header = game.demo_header("default");
        let mut episode = DemoEpisode::new(0, header.actions);
        episode.actions = Actions::Discrete(vec![0; TICKS]);
        (episode.rewards, episode.state_hashes) = (vec![0.0; TICKS], vec![0; TICKS]);
        episode.deciders = vec![Decider::Bot; TICKS];
        let head = FindingHead { tick: Some(TICKS as u32 - 1), ..FindingHead::new("default:0", "stuck", message) };
        StoredFinding { header, head, episode }
    }

    #[test]
    fn a_scene_is_around_the_tick_that_the_message_names() {
        let game = noisy_game();
        let most = ((SECONDS * game.tick_hz()) as usize).clamp(2, MOST_TICKS);
        let earlier = |message: &str| earlier_tick(&stored(&game, message), most);
        let last = TICKS - 1;
        assert_eq!(earlier(&format!("since tick {} it is locked", last - most)), Some((last - most) as u32));
        assert_eq!(earlier(&format!("since tick {} it is locked", last - most + 1)), None, "the last ticks show it");
        assert_eq!((earlier("it stays"), earlier("since tick 5000 it is locked")), (None, None));
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.finding");
        stored(&game, "since tick 5 at the latest it is locked").write(&file).expect("writable");
        let scene = SceneMaker::new(&game).scene(&file).expect("it is drawn as numbers");
        let [first, last] = [scene.ticks.first(), scene.ticks.last()].map(|tick| tick.expect("it has ticks").tick);
        assert_eq!(scene.since, Some(5).filter(|since| *since as usize + most < TICKS));
        if scene.since.is_some() {
            assert!(first <= 5 && last as usize == 5 + most / AFTER, "{first} to {last}");
        }
        // Numbers of actions that are no choices are cut with their ticks.
        let mut many = stored(&game, "it stays");
        many.episode.actions = Actions::Continuous { dim: 2, values: vec![0.5; 2 * TICKS] };
        many.episode.observations = vec![0.0; 3 * TICKS];
        let cut = up_to(&many, 7).episode;
        assert_eq!((cut.len(), cut.observations.len(), cut.rewards.len(), cut.deciders.len()), (7, 21, 7, 7));
        assert_eq!(cut.actions, Actions::Continuous { dim: 2, values: vec![0.5; 14] });
    }

    #[test]
    fn a_scene_has_the_lines_that_the_game_logged_in_its_ticks() {
        let game = noisy_game();
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.finding");
        stored(&game, "it stays").write(&file).expect("writable");
        let maker = SceneMaker::new(&game);
        let FindingScene { ticks, log, film, still, .. } = maker.scene(&file).expect("it is drawn as numbers");
        let film = film.expect("it has several ticks");
        let [width, height] = film.size;
        assert_eq!((film.pictures, film.pause), (ticks.len(), (1000.0 / game.tick_hz()).round() as u32));
        let pixels = |png: &[u8]| {
            let mut reader = Decoder::new(Cursor::new(png)).read_info().expect("a picture");
            let size = [reader.info().width as usize, reader.info().height as usize];
            let mut pixels = vec![0; size[0] * size[1] * CHANNELS];
            reader.next_frame(&mut pixels).expect("whole");
            (pixels, size)
        };
        let ((all, all_size), (last, last_size)) = (pixels(&film.png), pixels(&still));
        let rows = film.pictures.div_ceil(film.columns);
        assert_eq!((all_size, last_size), ([film.columns * width, rows * height], film.size));
        let corner = [(film.pictures - 1) % film.columns * width, (rows - 1) * height];
        for (line, pixels) in last.chunks_exact(width * CHANNELS).enumerate() {
            let begin = ((corner[1] + line) * all_size[0] + corner[0]) * CHANNELS;
            assert_eq!(all[begin..begin + pixels.len()], *pixels, "line {line} of the last tick");
        }
        let [first, last] = [ticks.first(), ticks.last()].map(|tick| tick.expect("it has ticks").tick);
        assert!(first > 0 && last == TICKS as u32 - 1, "the first of {TICKS} ticks are left out: {first} to {last}");
        assert_eq!([log.first(), log.last()].map(|line| line.map(|line| line.tick)), [Some(first), Some(last)]);
        assert!(log.len() >= ticks.len(), "one in each tick: {} in {}", log.len(), ticks.len());
        for GameLogLine { line, .. } in &log {
            assert!(line.level == Level::WARN && line.message.starts_with("the door jams run="), "{line:?}");
        }
        assert_eq!(maker.scene(&folder.path().join("none.finding")), None);
    }
}
