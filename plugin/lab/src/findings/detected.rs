//! Checks of detectors that look while somebody plays.

use std::sync::Arc;

use bevy_playbot::{action::Action, episode::Episode, observation::Observation, reward::Reward, state_hash::StateHash};

use super::{
    check::Check,
    checks::Checks,
    head::FindingHead,
    moment::{Moment, Watcher},
};
use crate::{
    detector::{self, Detector, LevelAhead, Watch, WorldMoment, WorldWatch},
    detectors::{DetectorChoice, Detectors, GameProofs, ShownBy},
    game::Game,
};

impl Checks {
    /// Those of what tests of levels find, and of all detectors that look at this game, with their usual settings.
    pub fn of_game(game: &dyn Game) -> Self {
        let choice = DetectorChoice { with: vec!["all".to_owned()], ..DetectorChoice::default() };
        let all = Detectors::choose(game, &choice).unwrap_or_else(|_| Detectors::usual(game));
        Self::default().with_detectors(&all)
    }

    /// These and those of the detectors of a test, as they are set there. Detectors that look at whole levels have one if
    /// a level or the end of an episode [shows](ShownBy) what they find.
    #[must_use]
    pub fn with_detectors(self, detectors: &Detectors) -> Self {
        let checks = detectors.ticks.iter().fold(self, |checks, detector| {
            let (name, detector) = (detector.name(), Arc::clone(detector));
            checks.with(name, Check::Ticks(Arc::new(move |_: &FindingHead| watcher(Arc::clone(&detector)))))
        });
        let shown = detectors.levels.iter().filter(|detector| detector.shown_by() != ShownBy::Nothing);
        shown.fold(checks, |checks, detector| checks.with(detector.name(), Check::WholeLevel(Arc::clone(detector))))
    }
}

/// Looks as the detector does in a test.
fn watcher(detector: Arc<dyn Detector>) -> Watcher {
    let mut looking = Looking::new(detector);
    Box::new(move |moment: &Moment| looking.look(moment).map(|_| moment.tick))
}

/// A detector at work in the World of one episode.
pub(super) struct Looking {
    detector: Arc<dyn Detector>,
    worlds: Option<Box<dyn WorldWatch>>,
    /// Nothing before the first tick.
    begun: Option<Option<Box<dyn Watch>>>,
}

impl Looking {
    pub fn new(detector: Arc<dyn Detector>) -> Self {
        let worlds = detector.watch_world();
        Self { detector, worlds, begun: None }
    }

    /// Looks at a tick. What is wrong, if anything.
    pub fn look(&mut self, moment: &Moment) -> Option<String> {
        let Moment { game, mode, world, agent, tick, end, errors } = *moment;
        let (episode, action) = (world.get::<Episode>(agent)?, world.get::<Action>(agent)?);
        let level = episode.level;
        let ahead = || LevelAhead { level, plan: game.floor_plan(mode, level) };
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
            place: game.whereabouts(world, agent),
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
