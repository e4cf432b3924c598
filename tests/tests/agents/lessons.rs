//! Tests of lessons, of the order of levels, and of values that levels draw: decided alike on any number of threads, and
//! after a stop.

use std::path::Path;

use bevy::prelude::*;
use playbot::prelude::*;
use playbot_harness::{
    demo::{demonstration::DemonstrationPlan, verify_file},
    eval::{EvalPlan, Player, evaluate},
    randomise::Randomise,
    worlds::build_world,
};
use playbot_learner::{DeviceKind, ObsSlice, Rollout, SkillModel};
use playbot_tests::{
    Cell, Corridor, corridor_plugin,
    measuring::plan,
    recording::record_random,
    see_corridor, spawn_walker,
    training::{check_resuming, learn_skills, train, written},
};
use playbot_train::{Algorithm, Experiment, Trainer, experiment::file::parse_experiment, run_dir::RunDir};

/// The corridor with an easier mode, in which agents start beside the exit. The number `Pace.0` scales what they see.
#[derive(Clone, Copy, Debug, Default)]
struct Graded {
    /// Whether agents of the easier mode have one action more.
    has_other_actions: bool,
}

#[derive(Resource, Reflect)]
#[reflect(Resource)]
struct Pace(f64);

#[derive(Resource)]
struct MoreActions;

impl Game for Graded {
    fn name(&self) -> &'static str {
        "graded"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &["plain", "near"]
    }

    fn tick_hz(&self) -> f64 {
        10.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(3)
    }

    fn observation(&self) -> ObservationSpace {
        Corridor.observation()
    }

    fn build(&self, app: &mut App, mode: &str) {
        corridor_plugin(app);
        app.insert_resource(Pace(1.0)).register_type::<Pace>();
        app.add_systems(
            ObserveSchedule,
            (|pace: Res<Pace>, mut agents: Query<(&Cell, &mut Observation)>| {
                for (cell, mut seen) in &mut agents {
                    seen.set([cell.0 as f32 / 3.0 - 1.0, pace.0 as f32]);
                }
            })
            .after(see_corridor),
        );
        if mode == "near" {
            app.add_observer(|event: On<StartEpisode>, mut commands: Commands| {
                commands.entity(event.entity).insert(Cell(5));
            });
            if self.has_other_actions {
                app.insert_resource(MoreActions);
            }
        }
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let agent = spawn_walker(world, index);
        if world.contains_resource::<MoreActions>() {
            world.entity_mut(agent).insert(Agent::new(index, ActionSpace::Discrete(4)));
        }
        agent
    }
}

const EXPERIMENT: &str = r#"(
    game: "graded", train: "plain:0..7", test: "plain:8..15", demos: "unused", algorithm: "ppo",
    steps: 2048, arenas: 8, worlds: 2,
    skills: (window: 3, epochs: 4, batch: 16, hidden: [16, 16], encoder_hidden: 8, gru_hidden: 8, latent: 2, lr: 0.003),
    ppo: (num_steps: 32, minibatches: 4, hidden: [16, 16], lr: 0.003),
    sac: (num_steps: 8, batch: 32, buffer: 512, learning_starts: 200, hidden: [16, 16], updates_per_step: 0.1),
    score: (horizon: 3),
)"#;

const LESSONS: &str = r#"curriculum=(lessons: [(levels: "near:0..7", success: 0.3)], window: 80, mix: 0.25)"#;

const PLR: &str = "levels.order=Plr(temperature: 0.3, staleness: 0.2, new: 0.5)";

fn experiment(sets: &[&str]) -> Experiment {
    let experiment = parse_experiment(EXPERIMENT, Path::new("test.ron")).expect("valid").with_set(sets);
    let experiment = experiment.expect("valid");
    experiment.check().expect("valid");
    experiment
}

fn skills(folder: &Path) -> SkillModel {
    let path = folder.join("walk.demo");
    record_random(&Graded::default(), "plain", 5, &path, 16..76);
    learn_skills(&Graded::default(), &Experiment { demos: Some(path), ..experiment(&[]) }, 2)
}

fn trainer(experiment: &Experiment, skills: Option<&SkillModel>, threads: usize) -> Trainer {
    Trainer::new(&Graded::default(), experiment, skills, DeviceKind::Flex, threads).expect("fits")
}

/// The last value of a metric of a run.
fn last(run: &Path, tag: &str) -> Option<f64> {
    let text = std::fs::read_to_string(run.join("metrics.jsonl")).expect("written");
    let line: serde_json::Value = serde_json::from_str(text.lines().last()?).expect("JSON");
    line[tag].as_f64()
}

#[test]
fn lessons_and_scores_are_the_same_on_any_number_of_threads() {
    let folder = tempfile::tempdir().expect("a folder");
    let skills = skills(folder.path());
    for algorithm in [Algorithm::Ppo, Algorithm::ScorePpo, Algorithm::SpirlPpo] {
        let experiment = Experiment { algorithm, ..experiment(&[LESSONS, PLR]) };
        let results: Vec<_> = [1, 2, 4, 8]
            .into_iter()
            .map(|threads| {
                let run = folder.path().join(format!("{algorithm}-{threads}"));
                train(&run, trainer(&experiment, Some(&skills), threads), None);
                assert_eq!(last(&run, "levels/lesson"), Some(2.0), "{algorithm}: the first lesson was learned");
                assert!(last(&run, "levels/played").is_some_and(|played| played > 0.0), "{algorithm}");
                written(&run)
            })
            .collect();
        assert!(results.iter().all(|result| *result == results[0]), "{algorithm}: the number of threads counts");
    }
}

#[test]
fn a_training_goes_on_in_its_lesson_with_its_scores() {
    let folder = tempfile::tempdir().expect("a folder");
    let skills = skills(folder.path());
    for algorithm in [Algorithm::Ppo, Algorithm::SpirlPpo] {
        let experiment = Experiment { algorithm, ..experiment(&[LESSONS, PLR]) };
        // In the middle of the first lesson, and after it.
        for stop_after in [1, 6] {
            check_resuming(&Graded::default(), |threads| trainer(&experiment, Some(&skills), threads), stop_after);
        }
    }
    let experiment = Experiment { algorithm: Algorithm::Sac, ..experiment(&[LESSONS]) };
    check_resuming(&Graded::default(), |threads| trainer(&experiment, None, threads), 12);
}

#[test]
fn a_checkpoint_without_lessons_has_no_state_of_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let run = folder.path().join("plain");
    train(&run, trainer(&experiment(&[]), None, 1), Some(1));
    let [_, _, arenas] = written(&run);
    assert!(!String::from_utf8_lossy(&arenas).contains("\"levels\""), "older versions read it");
    assert_eq!((last(&run, "levels/lesson"), last(&run, "levels/played")), (None, None));
}

#[test]
fn lessons_are_levels_that_the_run_has_seen() {
    let seen = trainer(&experiment(&[LESSONS]), None, 1).seen().expect("known").to_string();
    assert_eq!(seen, "plain:0..7 and near:0..7");
}

#[test]
fn levels_with_larger_errors_of_the_critic_are_played_more_often() {
    let experiment = experiment(&["levels.order=Plr(temperature: 0.1, staleness: 0.1, new: 0.5)"]);
    let mut trainer = trainer(&experiment, None, 1);
    let mut reports = Vec::new();
    (0..6).for_each(|_| reports.push(trainer.update().expect("learns")));
    let value = |tag| reports.last().and_then(|report| report.levels.iter().find(|(known, _)| *known == tag));
    assert_eq!(value("levels/played"), Some(&("levels/played", 8.0)), "all levels were played");
    let effective = value("levels/effective").expect("measured").1;
    assert!((1.0..4.0).contains(&effective), "few of the levels are in play: {effective}");
}

#[test]
fn lessons_of_a_mode_with_other_actions_are_refused() {
    let other = Graded { has_other_actions: true };
    let made = Trainer::new(&other, &experiment(&[LESSONS]), None, DeviceKind::Flex, 1);
    let words = made.err().expect("one policy cannot have both").to_string();
    assert!(words.contains("`curriculum.lessons` is near:0..7") && words.contains("mode `near`"), "{words}");
}

#[test]
fn lessons_that_the_game_does_not_have_are_refused() {
    let lessons = r#"curriculum.lessons=[(levels: "neer:0..7")]"#;
    let made = Trainer::new(&Graded::default(), &experiment(&[lessons]), None, DeviceKind::Flex, 1);
    let words = made.err().expect("there is no such mode").to_string();
    assert!(words.contains("`curriculum.lessons` has neer:0..7") && words.contains("`near`"), "{words}");
    // Every mode of this game has levels of its own family, so the same numbers are other levels.
    let lessons = r#"curriculum.lessons=[(levels: "near:8..15")]"#;
    let made = Trainer::new(&Graded::default(), &experiment(&[lessons]), None, DeviceKind::Flex, 1);
    assert!(made.is_ok(), "{:?}", made.err().map(|error| error.to_string()));
}

// Values that levels draw.

fn pace() -> Randomise {
    Randomise::default().with("Pace.0".to_owned(), "0.5..2".parse().expect("factors"))
}

const RANDOMISED: &str = r#"randomise={"Pace.0": "0.5..2"}"#;

/// Returns the pace of each level, in order, as the agent has seen it in one World.
fn paces(randomise: &Randomise, levels: &[u64]) -> Vec<f64> {
    let (mut world, agents) = build_world(&Graded::default(), "plain", 0, 0, 1);
    randomise.install(&mut world);
    world.entity_mut(agents[0]).insert((Control::Bot, BlindBot::Uniform, LevelQueue::list(levels)));
    let mut seen = Vec::new();
    while Control::of(&world, agents[0]).is_active() {
        world.tick().expect("the path leads to a number");
        if world.get::<Episode>(agents[0]).is_some_and(|episode| episode.is_running() && episode.tick == 1) {
            seen.push(world.resource::<Pace>().0);
        }
    }
    seen
}

#[test]
fn a_level_has_the_same_value_whatever_was_played_before() {
    let [one, two, again, three, two_again] = paces(&pace(), &[1, 2, 1, 3, 2])[..] else { panic!("five episodes") };
    assert_eq!((one, two), (again, two_again));
    assert!(one != two && two != three, "levels differ");
    assert!([one, two, three].iter().all(|pace| (0.5..2.0).contains(pace)));
    let more = pace().with("Absent.0".to_owned(), "1..1".parse().expect("factors"));
    let factor = more.factors(1).find(|(path, _)| *path == "Pace.0").map(|(_, factor)| factor);
    assert_eq!(factor, Some(one), "another path changes nothing");
    assert_eq!(paces(&Randomise::default(), &[1, 2]), [1.0, 1.0]);
}

#[test]
fn a_recording_says_its_values_and_replays_with_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("paced.demo");
    let plan = DemonstrationPlan {
        mode: "plain".to_owned(),
        levels: vec![1, 3],
        noise: 0.0,
        seed: 1,
        steps: None,
        keep_observations: true,
        randomise: pace(),
    };
    let game = Graded::default();
    let writer = bevy_playbot::demo::file::DemoWriter::create(&path, plan.header(&game)).expect("writable");
    let player = Player::Blind(BlindBot::Constant(ActionValue::Discrete(1)));
    let observed = bevy_playbot::vision::ObservationConfig::default();
    let (mut world, agent) = plan.build_world_of(&game, &player, &observed, writer).expect("vectors");
    while Control::of(&world, agent).is_active() {
        world.tick().expect("sound");
    }
    drop(world);
    let reader = bevy_playbot::demo::file::DemoReader::open(&path).expect("readable");
    let episodes = reader.read_all().expect("whole");
    let values: Vec<f64> = episodes.iter().map(|episode| episode.randomised[0].value).collect();
    assert_eq!(values, paces(&pace(), &[1, 3]));
    let shown: Vec<f32> = episodes.iter().map(|episode| episode.observations[1]).collect();
    assert_eq!(shown, values.iter().map(|value| *value as f32).collect::<Vec<_>>(), "agents have seen them");
    let report = verify_file(&game, &path, |_| {}).expect("readable");
    assert_eq!((report.episodes, report.divergences), (2, Vec::new()));
    // A data set made from it has them, too, although its Worlds draw nothing.
    let experiment = experiment(&[]);
    let demos = playbot_train::demo::Demonstrations::of(&game, &experiment, &path).expect("readable");
    let rollouts = demos.rollouts(&game, 2, |_| {}).expect("they replay");
    let pace_of = |rollout: &Rollout| match rollout.obs.row(0, 2) {
        ObsSlice::Vector(values) => values[1],
        ObsSlice::Image(_) => panic!("vectors"),
    };
    let seen: Vec<f32> = rollouts.iter().map(pace_of).collect();
    assert_eq!(seen, shown);
}

#[test]
fn trainings_and_measurements_draw_the_values_of_their_levels() {
    let experiment = experiment(&[RANDOMISED]);
    let folder = tempfile::tempdir().expect("a folder");
    let results: Vec<_> = [1, 2, 8]
        .into_iter()
        .map(|threads| {
            let run = folder.path().join(threads.to_string());
            train(&run, trainer(&experiment, None, threads), None);
            written(&run)
        })
        .collect();
    assert!(results.iter().all(|result| *result == results[0]), "the number of threads counts");
    let plain = folder.path().join("plain");
    train(&plain, trainer(&self::experiment(&[]), None, 1), None);
    assert!(written(&plain)[0] != results[0][0], "agents see other numbers");
    check_resuming(&Graded::default(), |threads| trainer(&experiment, None, threads), 3);
    let run = RunDir::open(&folder.path().join("1")).expect("a run");
    assert_eq!(run.experiment, experiment, "the run keeps them");
    assert_eq!(run.experiment.eval_plan(&experiment.test, 1).randomise, pace(), "they are measured with");
    let evaluated = |randomise: Randomise, threads| {
        let policy = trainer(&experiment, None, 1).policy();
        let player = Player::Policy { policy, prior: None, draw: bevy_playbot::policy::ActionDraw::Sample };
        let plan = EvalPlan { randomise, threads, ..plan("plain:0..7") };
        evaluate(&Graded::default(), &player, &plan, |_| {}).expect("sound")
    };
    assert_eq!(evaluated(pace(), 1), evaluated(pace(), 4));
}

#[test]
fn paths_that_lead_to_no_number_are_named() {
    for (path, words) in [
        ("Speed.0", "`Speed.0` of `randomise` names neither"),
        ("Pace.1", "`Pace.1` of `randomise` leads nowhere"),
        ("Pace", "`Pace` of `randomise` leads to a Pace, which is not a number"),
    ] {
        let set = format!(r#"randomise={{"{path}": "0.5..2"}}"#);
        let made = Trainer::new(&Graded::default(), &experiment(&[&set]), None, DeviceKind::Flex, 1);
        let found = made.err().expect("it leads to no number").to_string();
        assert!(found.contains(words), "{found}");
    }
    for (factors, words) in [("2", "is not a range of factors"), ("2..0.5", "write least..most"), ("a..b", "0.8..1.2")]
    {
        let set = format!(r#"randomise={{"Pace.0": "{factors}"}}"#);
        let found = parse_experiment(EXPERIMENT, Path::new("x.ron")).expect("valid").with_set(&[&set]);
        let found = found.expect_err("no factors").to_string();
        assert!(found.contains(words), "{found}");
    }
}

#[test]
fn a_world_of_several_arenas_cannot_have_several_values() {
    let (mut world, agents) = build_world(&Graded::default(), "plain", 0, 0, 2);
    pace().install(&mut world);
    for (&agent, level) in agents.iter().zip([1, 2]) {
        world.entity_mut(agent).insert((Control::Bot, BlindBot::Uniform, LevelQueue::Always(level)));
    }
    let fault = world.tick().expect_err("both levels have a pace").to_string();
    assert!(fault.contains("plays another level too") && fault.contains("one arena each"), "{fault}");
}
