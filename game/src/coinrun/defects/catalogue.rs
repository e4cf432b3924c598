//! All defects of CoinRun.

use playbot_lab::defect::DefectKind;

use super::{cells, hazards, motion, out_of_reach, pits, trap, walls};

/// Returns the defects of the game, those of levels first.
pub(in crate::coinrun) fn defects() -> Vec<DefectKind> {
    [
        walls::defects(),
        pits::defects(),
        out_of_reach::defects(),
        trap::defects(),
        motion::defects(),
        cells::defects(),
        hazards::defects(),
    ]
    .concat()
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, sync::Arc};

    use bevy::prelude::*;
    use bevy_playbot::test_app::PlaybotTestExt;
    use playbot_lab::{
        defect::{ChangeLevel, ChangeRules, Plant},
        prelude::*,
    };
    use playbot_learner::rng::{ChaCha8Rng, Streams};

    use super::*;
    use crate::coinrun::{
        CoinRun, Mode, Plan, PlannerConfig, Sim, game::spawn_agent, generate, level::Level, level_text, plan,
        proof::prove,
    };

    fn rng(seed: u64) -> ChaCha8Rng {
        Streams::new(seed).stream("defects of coinrun", 0)
    }

    fn text(seed: u32) -> String {
        serde_json::json!(generate(Mode::Hard, seed).to_level_text()).to_string()
    }

    fn of_levels() -> Vec<(&'static str, Arc<ChangeLevel>)> {
        let kinds = defects().into_iter();
        let levels = kinds.filter_map(|kind| match kind.plant {
            Plant::Level(change) => Some((kind.class, change)),
            Plant::Rules { .. } => None,
        });
        levels.collect()
    }

    fn of_rules() -> Vec<(&'static str, u32, Arc<ChangeRules>)> {
        let kinds = defects().into_iter();
        let rules = kinds.filter_map(|kind| match kind.plant {
            Plant::Rules { variants, plant } => Some((kind.class, variants, plant)),
            Plant::Level(_) => None,
        });
        rules.collect()
    }

    /// Returns the game in an app, with one agent that runs and hops in this level.
    fn app(level: u64, plant: Option<(&ChangeRules, u32)>) -> App {
        let mut app = bevy_playbot::test_app::test_app();
        CoinRun::default().build(&mut app, "hard");
        if let Some((plant, variant)) = plant {
            plant(&mut app, variant);
        }
        let agent = spawn_agent(app.world_mut(), 0);
        let bot = BlindBot::Constant(ActionValue::Discrete(8));
        app.world_mut().entity_mut(agent).insert((Control::Bot, bot, LevelQueue::Always(level)));
        app
    }

    #[test]
    fn classes_are_different_and_rules_have_variants() {
        let classes: BTreeSet<_> = defects().iter().map(|kind| kind.class).collect();
        assert_eq!(classes.len(), defects().len());
        assert!(classes.len() >= 15, "{classes:?}");
        assert!(of_rules().iter().all(|(_, variants, _)| *variants >= 3));
    }

    #[test]
    fn every_defect_of_levels_is_planted_into_some_and_each_reads_back() {
        for (class, change) in of_levels() {
            let mut planted = 0;
            for seed in 0..40 {
                let sound = text(seed);
                let Some(broken) = change(&sound, &mut rng(seed.into())) else { continue };
                planted += 1;
                let design =
                    level_text::parse(&broken).unwrap_or_else(|error| panic!("{class} {seed}: {}", error.what));
                assert_ne!(design.hash(), level_text::parse(&sound).expect("it was printed").hash(), "{class} {seed}");
                assert_eq!(change(&sound, &mut rng(seed.into())), Some(broken), "{class} {seed}: the same again");
            }
            assert!(planted >= 5, "{class}: {planted} of 40");
        }
    }

    #[test]
    fn walls_and_coins_in_the_sky_are_proved_to_be_out_of_reach() {
        for (class, change) in of_levels() {
            if !["walled-goal", "sealed-start", "goal-in-the-sky"].contains(&class) {
                continue;
            }
            for seed in 0..40 {
                let Some(broken) = change(&text(seed), &mut rng(seed.into())) else { continue };
                let level = level_text::parse(&broken).expect("it reads back").level::<Level>().expect("a level");
                assert!(prove(level).why_unsolvable().is_some(), "{class} {seed}");
            }
        }
    }

    #[test]
    fn no_plan_leads_across_what_is_too_wide_or_deadly() {
        for (class, change) in of_levels() {
            if !["wide-pit", "missing-floor", "hazard-wall"].contains(&class) {
                continue;
            }
            for seed in 0..12 {
                let Some(broken) = change(&text(seed), &mut rng(seed.into())) else { continue };
                let level = level_text::parse(&broken).expect("it reads back").level::<Level>().expect("a level");
                let found = plan(&Sim::new(level), &PlannerConfig::default());
                assert!(!matches!(found, Plan::Found(_)), "{class} {seed}: {found:?}");
            }
        }
    }

    #[test]
    fn without_a_defect_nothing_changes_and_every_variant_is_built_without_ambiguous_orders() {
        let sound = app(0, None).hash_trace(30).expect("sound");
        assert_eq!(sound, app(0, None).hash_trace(30).expect("sound"));
        for (class, variants, plant) in of_rules() {
            for variant in 0..variants {
                let mut app = app(0, Some((&*plant, variant)));
                app.hash_trace(30).unwrap_or_else(|error| panic!("{class} {variant}: {error}"));
                assert_eq!(app.ambiguous_orders(&["playbot_games"]), [""; 0], "{class} {variant}");
            }
        }
    }

    #[test]
    fn every_defect_of_the_rules_changes_some_episode() {
        for (class, variants, plant) in of_rules() {
            for variant in 0..variants {
                let differs = |level: u64| {
                    let sound = app(level, None).hash_trace(250).expect("sound");
                    app(level, Some((&*plant, variant))).hash_trace(250).ok() != Some(sound)
                };
                assert!((0..60).any(differs), "{class} {variant}");
            }
        }
    }
}
