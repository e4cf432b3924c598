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
    detector::{self, Detector, LevelAhead, Watch, WorldMoment},
    detectors::{DetectorChoice, Detectors},
    game::Game,
};

impl Checks {
    /// Those of what tests of levels find, and of all detectors that look at this game, with their usual settings.
    pub fn of_game(game: &dyn Game) -> Self {
        let choice = DetectorChoice { with: vec!["all".to_owned()], ..DetectorChoice::default() };
        let all = Detectors::choose(game, &choice).unwrap_or_else(|_| Detectors::usual(game));
        Self::default().with_detectors(&all)
    }

    /// These and those of the detectors of a test, as they are set there. Detectors that hear what is logged, or look at whole
    /// levels, have none.
    #[must_use]
    pub fn with_detectors(self, detectors: &Detectors) -> Self {
        let hears = |detector: &Arc<dyn Detector>| detector.watch_world().is_some_and(|watch| watch.hears_errors());
        detectors.ticks.iter().filter(|detector| !hears(detector)).fold(self, |checks, detector| {
            let (name, detector) = (detector.name(), Arc::clone(detector));
            checks.with(name, Check::Ticks(Arc::new(move |_: &FindingHead| watcher(Arc::clone(&detector)))))
        })
    }
}

/// Looks as the detector does in a test.
fn watcher(detector: Arc<dyn Detector>) -> Watcher {
    let mut worlds = detector.watch_world();
    let mut begun: Option<Option<Box<dyn Watch>>> = None;
    Box::new(move |moment: &Moment| {
        let Moment { game, mode, world, agent, tick, end } = *moment;
        let (episode, action) = (world.get::<Episode>(agent)?, world.get::<Action>(agent)?);
        let level = episode.level;
        let watch =
            begun.get_or_insert_with(|| detector.watch(&LevelAhead { level, plan: game.floor_plan(mode, level) }));
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
        };
        let in_episode = watch.as_mut().and_then(|watch| {
            let now = watch.tick(&seen);
            now.or_else(|| end.and_then(|end| watch.end(&seen, &end)))
        });
        let in_world = || worlds.as_mut()?.tick(&WorldMoment { world, errors: &[] });
        in_episode.or_else(in_world).map(|_| tick)
    })
}
