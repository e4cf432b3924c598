//! All defects of Maze2D.

use playbot_lab::defect::DefectKind;

use super::{goal, motion, walls};
use crate::{maze::defects::of_levels, maze2d::level_text};

/// Returns the defects of the game, those of levels first.
pub(in crate::maze2d) fn defects() -> Vec<DefectKind> {
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
    use crate::maze2d::{DemonstratorBot, Maze2d, Maze2dLevel, Maze2dMode, game::spawn_agent, level_text::LevelText};

    const MODE: &str = "random";

    /// Returns the state of an episode of the game's bot after each tick, and whether it had reached the goal.
    fn trace(level: u64, plant: Option<(&ChangeRules, u32)>) -> Vec<(Vec<u64>, bool)> {
        let mut app = test_app();
        Maze2d::default().build(&mut app, MODE);
        if let Some((plant, variant)) = plant {
            plant(&mut app, variant);
        }
        let agent = spawn_agent(app.world_mut(), 0);
        let bot = DemonstratorBot::new(0.0);
        app.world_mut().entity_mut(agent).insert((Control::Bot, bot, LevelQueue::Always(level)));
        let mut trace = Vec::new();
        for _ in 0..1500 {
            let hash = app.hash_trace(1).expect("sound");
            trace.push((hash, app.world().get::<Episode>(agent).expect("every agent has one").is_success()));
        }
        assert_eq!(app.ambiguous_orders(&["playbot_games"]), [""; 0]);
        trace
    }

    #[test]
    fn every_defect_of_levels_is_planted_and_the_goal_is_proved_to_be_out_of_reach() {
        let mode: Maze2dMode = MODE.parse().expect("a mode");
        for kind in defects() {
            let Plant::Level(change) = &kind.plant else { continue };
            let mut planted = 0;
            for seed in 0..20 {
                let level = Maze2dLevel::new(&mode, seed).expect("a level");
                let text = serde_json::json!(LevelText::of(&level, &mode)).to_string();
                let Some(broken) = change(&text, &mut Streams::new(seed).stream("test", 0)) else { continue };
                let design = level_text::parse(&broken).expect("it reads back");
                assert_ne!(design.hash(), level_text::parse(&text).expect("it was printed").hash());
                planted += 1;
            }
            assert!(planted >= 5, "{}: {planted} of 20", kind.class);
        }
    }

    #[test]
    fn every_variant_of_the_rules_changes_some_episode() {
        let sound: Vec<_> = (0..6).map(|level| trace(level, None)).collect();
        assert!(sound.iter().all(|ticks| ticks.iter().any(|(_, is_success)| *is_success)), "the bot solves them");
        assert_eq!(trace(0, None), sound[0], "without a defect nothing changes");
        for kind in defects() {
            let Plant::Rules { variants, plant } = &kind.plant else { continue };
            assert!(*variants >= 3, "{}", kind.class);
            for variant in 0..*variants {
                let differs = |level: usize| trace(level as u64, Some((&**plant, variant))) != sound[level];
                // The bot keeps away from walls, also from missing ones.
                assert!(kind.class == "missing-collider" || (0..sound.len()).any(differs), "{} {variant}", kind.class);
            }
        }
    }
}
