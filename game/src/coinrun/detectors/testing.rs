//! Episodes under the detectors, for tests.

use crate::{
    coinrun::{CoinRun, DemonstratorBot, detectors::detectors, spawn_agent},
    watched,
};
use bevy::prelude::*;
use bevy_playbot::episode::EpisodeResult;
use playbot_harness::{
    defect::ChangeRules,
    detector::{DetectorTick, EpisodeWatcher, LevelAhead},
    prelude::*,
};
use std::{
    ops::Range,
    sync::{Arc, Mutex},
};

/// A player of the tests.
#[derive(Clone, Copy, Debug)]
pub(super) enum Bot {
    Search,
    Random,
    RightJump,
}

/// A defect of the rules, if any.
pub(super) type Rules = Option<(Arc<ChangeRules>, u32)>;

/// Returns the unchanged rules.
pub(super) fn sound() -> Rules {
    None
}

/// Returns a variant of a defect of the rules.
pub(super) fn planted(class: &str, variant: u32) -> Rules {
    Some((watched::planted(&CoinRun::default(), class), variant))
}

/// Returns the findings in the first episode on a hard level, or in its first ticks: names of detectors and ticks.
pub(super) fn findings(rules: &Rules, level: u64, bot: Bot, ticks: u32) -> Vec<(&'static str, u32)> {
    let mut app = bevy_playbot::prelude::headless_app();
    CoinRun::default().build(&mut app, "hard");
    if let Some((plant, variant)) = rules {
        plant(&mut app, *variant);
    }
    let agent = spawn_agent(app.world_mut(), 0);
    let mut entity = app.world_mut().entity_mut(agent);
    entity.insert((Control::Bot, LevelQueue::list([level])));
    match bot {
        Bot::Search => entity.insert(DemonstratorBot::new(0.0)),
        Bot::Random => entity.insert(BlindBot::Uniform),
        Bot::RightJump => entity.insert(BlindBot::Constant(ActionValue::Discrete(8))),
    };
    let ended = Arc::new(Mutex::new(None::<EpisodeResult>));
    let heard = ended.clone();
    app.add_observer(move |event: On<EpisodeEnded>| *heard.lock().expect("no thread panics") = Some(event.result));
    let ahead = LevelAhead { level, plan: None };
    let all = detectors();
    let mut watches: Vec<(&'static str, Box<dyn EpisodeWatcher>)> =
        all.iter().filter_map(|detector| detector.watch(&ahead).map(|watch| (detector.name(), watch))).collect();
    let (mut found, idle) = (Vec::new(), ActionValue::Discrete(0));
    for tick in 0..ticks {
        app.tick().expect("sound");
        let world = app.world();
        let result = *ended.lock().expect("no thread panics");
        let moment = DetectorTick { agent, level, tick, ..DetectorTick::of(world, &idle) };
        for (name, watch) in &mut watches {
            let message = watch.tick(&moment).or_else(|| result.and_then(|result| watch.end(&moment, &result)));
            found.extend(message.map(|_| (*name, tick)));
        }
        if result.is_some() {
            break;
        }
    }
    found
}

/// Returns the first of these levels with a finding.
pub(super) fn first_named(name: &str, rules: &Rules, bot: Bot, levels: Range<u64>) -> Option<u64> {
    levels.into_iter().find(|&level| findings(rules, level, bot, 200).iter().any(|(found, _)| *found == name))
}
