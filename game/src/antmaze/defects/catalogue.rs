//! All defects of AntMaze.

use playbot_lab::defect::DefectKind;

use super::{goal, motion, walls};
use crate::{antmaze::level_text, maze::defects::of_levels};

/// Returns the defects of the game, those of levels first.
pub(in crate::antmaze) fn defects() -> Vec<DefectKind> {
    let levels = of_levels(|text| level_text::parse(text).is_ok());
    [levels, goal::defects(), walls::defects(), motion::defects()].concat()
}

#[cfg(test)]
mod tests {
    use bevy::prelude::*;
    use bevy_playbot::test_app::{PlaybotTestExt, test_app};
    use playbot_lab::{
        defect::{ChangeRules, Plant},
        prelude::*,
    };
    use playbot_learner::rng::Streams;

    use super::*;
    use crate::antmaze::{AntMaze, DemonstratorBot, game::spawn_agent, generate, level_text::LevelText};

    /// Mode of the levels. The game's bot solves nine in ten of them in a few hundred ticks.
    const MODE: &str = "umaze+sparse";
    const TICKS: u64 = 600;

    /// Returns the state hashes of the game's bot, the number of its won episodes, and the fault that stopped it, if
    /// one did.
    fn trace(level: u64, plant: Option<(&ChangeRules, u32)>) -> (Result<Vec<u64>, String>, u64) {
        let mut app = test_app();
        AntMaze.build(&mut app, MODE);
        if let Some((plant, variant)) = plant {
            plant(&mut app, variant);
        }
        let agent = spawn_agent(app.world_mut(), 0);
        let bot = DemonstratorBot::new(0.0);
        app.world_mut().entity_mut(agent).insert((Control::Bot, bot, LevelQueue::Always(level)));
        let hashes = app.hash_trace(TICKS).map_err(|fault| fault.to_string());
        assert_eq!(app.ambiguous_orders(&["playbot_games"]), [""; 0]);
        (hashes, app.world().get::<EpisodeCount>(agent).expect("every agent has one").successes)
    }

    #[test]
    fn every_defect_of_levels_is_planted_and_reads_back() {
        let mode = "random".parse().expect("a mode");
        for kind in defects() {
            let Plant::Level(change) = &kind.plant else { continue };
            let mut planted = 0;
            for seed in 0..20 {
                let text = serde_json::json!(LevelText::of(&generate(&mode, seed).expect("a level"))).to_string();
                let Some(broken) = change(&text, &mut Streams::new(seed).stream("test", 0)) else { continue };
                let design = level_text::parse(&broken).expect("it reads back");
                assert_ne!(design.hash(), level_text::parse(&text).expect("it was printed").hash());
                planted += 1;
            }
            assert!(planted >= 5, "{}: {planted} of 20", kind.class);
        }
    }

    #[test]
    fn every_variant_of_the_rules_changes_an_episode() {
        let mut traces = (0..4).map(|level| (level, trace(level, None)));
        let (level, sound) = traces.find(|(_, sound)| sound.1 > 0).expect("the bot solves one");
        assert_eq!(trace(level, None), sound, "without a defect nothing changes");
        for kind in defects() {
            let Plant::Rules { variants, plant } = &kind.plant else { continue };
            assert!(*variants >= 3, "{}", kind.class);
            for variant in 0..*variants {
                // The bot keeps away from walls, also from missing ones.
                if kind.class != "missing-collider" {
                    assert_ne!(trace(level, Some((&**plant, variant))), sound, "{} {variant}", kind.class);
                }
            }
        }
    }
}
