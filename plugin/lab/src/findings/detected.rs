//! Checks of detectors that watch play.

use std::{cell::RefCell, rc::Rc, sync::Arc};

use bevy_playbot::{action::Action, episode::Episode, observation::Observation, reward::Reward, state_hash::StateHash};

use super::{
    check::Check,
    checks::Checks,
    moment::{Moment, Watcher},
};
use crate::{
    detector::{self, Detector, LevelAhead, Watch, WorldMoment, WorldWatch},
    detectors::{DetectorChoice, Detectors, GameProofs, ShownBy},
    game::Game,
};

impl Checks {
    /// Returns the checks of general findings, and of all detectors of this game with their default settings.
    pub fn of_game(game: &dyn Game) -> Self {
        let choice = DetectorChoice { with: vec!["all".to_owned()], ..DetectorChoice::default() };
        let all = Detectors::choose(game, &choice).unwrap_or_else(|_| Detectors::usual(game));
        Self::default().with_detectors(&all)
    }

    /// Adds the checks of the detectors of a test, with their settings. Detectors of whole levels have a check if a
    /// level or the end of an episode [reproduces](ShownBy) their findings.
    #[must_use]
    pub fn with_detectors(self, detectors: &Detectors) -> Self {
        let checks = self.with_records(detectors.record(), &detectors.settings);
        let checks = detectors
            .ticks
            .iter()
            .fold(checks, |checks, detector| checks.with(detector.name(), Check::Detector(Arc::clone(detector))));
        let shown = detectors.levels.iter().filter(|detector| detector.shown_by() != ShownBy::Nothing);
        shown.fold(checks, |checks, detector| checks.with(detector.name(), Check::WholeLevel(Arc::clone(detector))))
    }
}

/// Runs the detector as in a test. The second value holds its message, once it has seen something.
pub(super) fn watcher(detector: Arc<dyn Detector>) -> (Watcher, Rc<RefCell<Option<String>>>) {
    let said = Rc::<RefCell<Option<String>>>::default();
    let (mut looking, heard) = (Looking::new(detector), Rc::clone(&said));
    let watcher: Watcher = Box::new(move |moment: &Moment| {
        let words = looking.look(moment)?;
        *heard.borrow_mut() = Some(words);
        Some(moment.tick)
    });
    (watcher, said)
}

/// A detector at work in the World of one episode.
pub(super) struct Looking {
    detector: Arc<dyn Detector>,
    worlds: Option<Box<dyn WorldWatch>>,
    /// `None` before the first tick.
    begun: Option<Option<Box<dyn Watch>>>,
}

impl Looking {
    pub fn new(detector: Arc<dyn Detector>) -> Self {
        let worlds = detector.watch_world();
        Self { detector, worlds, begun: None }
    }

    /// Examines a tick. Returns a message if something is wrong.
    pub fn look(&mut self, moment: &Moment) -> Option<String> {
        let Moment { game, mode, world, agent, tick, end, errors } = *moment;
        let (episode, action) = (world.get::<Episode>(agent)?, world.get::<Action>(agent)?);
        let level = episode.level;
        let ahead = || LevelAhead { level, plan: game.tools().levels.floor_plan(mode, level) };
        let watch = self.begun.get_or_insert_with(|| self.detector.watch(&ahead()));
        let proofs = GameProofs { game, mode, level, world, agent };
        let seen = detector::Moment {
            world,
            agent,
            level,
            tick,
            action: &action.0,
            observation: world.get::<Observation>(agent).map_or(&[][..], |seen| seen.vector.as_slice()),
            state_hash: world.get::<StateHash>(agent).map_or(0, |hash| hash.0),
            reward: world.get::<Reward>(agent).map_or(0.0, Reward::get),
            place: game.tools().state.position(world, agent),
            is_success: end.map_or_else(|| episode.is_success(), |end| end.success),
            proofs: &proofs,
        };
        let in_episode = watch.as_mut().and_then(|watch| {
            let now = watch.tick(&seen);
            now.or_else(|| end.and_then(|end| watch.end(&seen, &end)))
        });
        in_episode.or_else(|| self.worlds.as_mut()?.tick(&WorldMoment { world, errors }))
    }
}
