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
    detectors::LogReader,
    findings::StoredFinding,
    verdict_report::{FindingScene, GameLogLine, SceneTick},
};
use std::{
    cell::{Cell, OnceCell},
    path::Path,
};
use tracing::Level;

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
        let (mut positions, mut log) = (Vec::new(), Vec::new());
        let reader = LogReader::down_to(Level::INFO);
        let lines = |tick: u32| reader.take().into_iter().map(move |line| GameLogLine { tick, line });
        let played = reader.listen(|| {
            play(*game, finding, seen_as, most, &mut |world, step| {
                positions.push(world.position(*game).map(|position| position.to_array()));
                log.extend(lines(step.tick));
            })
        });
        let (steps, reach) = played?;
        // Those of a tick in which the game broke, which was not played to its end.
        log.extend(lines(positions.len() as u32));
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
        let first = steps.first().map_or(0, |step| step.tick);
        log.retain(|line: &GameLogLine| line.tick >= first);
        Ok(Some(FindingScene { still, moving, ticks, log }))
    }
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
    use bevy_playbot::demo::file::{Decider, DemoEpisode, EpisodeActions};
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

    #[test]
    fn a_scene_has_the_lines_that_the_game_logged_in_its_ticks() {
        let game =
            ForeignGame::new("noisy", 1, noisy).keys([vec![], vec![KeyCode::ArrowRight]]).observe(["x"], || [0.0]);
        let header = game.demo_header("default");
        let mut episode = DemoEpisode::new(0, header.actions);
        episode.actions = EpisodeActions::Discrete(vec![0; TICKS]);
        (episode.rewards, episode.state_hashes) = (vec![0.0; TICKS], vec![0; TICKS]);
        episode.deciders = vec![Decider::Bot; TICKS];
        let head = FindingHead { tick: Some(TICKS as u32 - 1), ..FindingHead::new("default:0", "stuck", "it stays") };
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a.finding");
        StoredFinding { header, head, episode }.write(&file).expect("writable");
        let maker = SceneMaker::new(&game);
        let FindingScene { ticks, log, .. } = maker.scene(&file).expect("it is drawn as numbers");
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
