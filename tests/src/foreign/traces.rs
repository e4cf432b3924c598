//! Traces of a game's episodes.

use playbot::prelude::*;
use playbot_harness::{foreign::ForeignGame, worlds::build_world};

/// Returns the state hashes of the episodes of one agent with a constant action, on one level after the other in one
/// World.
pub fn traces(game: &ForeignGame, action: u32, levels: &[u64]) -> Vec<Vec<u64>> {
    let (mut world, agents) = build_world(game, "default", 0, 0, 1);
    let bot = BlindBot::Constant(ActionValue::Discrete(action));
    world.entity_mut(agents[0]).insert((Control::Bot, bot, LevelQueue::list(levels)));
    let (mut traces, mut trace) = (Vec::new(), Vec::new());
    while traces.len() < levels.len() {
        world.tick().expect("sound");
        trace.push(world.get::<StateHash>(agents[0]).expect("an agent").0);
        if world.get::<EpisodeCount>(agents[0]).expect("an agent").finished > traces.len() as u64 {
            traces.push(std::mem::take(&mut trace));
        }
    }
    traces
}
