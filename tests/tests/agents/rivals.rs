//! Tests of a `Game` whose agents share an arena in teams: four pull at one rope.

use std::{ops::ControlFlow, path::Path, sync::Arc};

use bevy::prelude::*;
use bevy_playbot::{
    engine::{PlaysAlong, begin_beside},
    streams::AgentStreams,
};
use playbot::prelude::*;
use playbot_harness::{
    eval::Player,
    game::{GameTools, HostTools},
    randomise::Randomise,
    rivals::{
        Opposed, check_rivals,
        matches::{MatchOutcome, MatchPlan, play_matches},
    },
    worlds::build_world,
};
use playbot_learner::{
    Actions, Dataset, DatasetEpisode, DeviceKind, PolicyFile, Prior, SkillConfig, SkillDraw, SkillModel, SkillTrainer,
};
use playbot_tests::training::{check_resuming, run_info};
use playbot_train::{Trainer, checkpoint::CheckpointChoice, experiment::file::parse_experiment, run_dir::RunDir};

/// Names of the seats. Every other one is of the same team.
const SEATS: [&str; 4] = ["north", "east", "south", "west"];

/// Way of the rope that wins.
const WIN: i32 = 12;

/// The game, with its first agent on a seat.
#[derive(Clone)]
struct Tug {
    seat: usize,
    /// Actions of the agents of the second team.
    second: usize,
    teams: [usize; 4],
}

const TUG: Tug = Tug { seat: 0, second: 3, teams: [0, 1, 0, 1] };

/// The place of the rope, towards the first team above 0.
#[derive(Resource, Default)]
struct Rope(i32);

#[derive(Component, Clone, Copy)]
struct Seat(usize);

impl Game for Tug {
    fn name(&self) -> &'static str {
        "tug"
    }

    fn version(&self) -> u32 {
        1
    }

    fn modes(&self) -> &'static [&'static str] {
        &["default"]
    }

    fn tick_hz(&self) -> f64 {
        60.0
    }

    fn actions(&self) -> ActionSpace {
        ActionSpace::Discrete(3)
    }

    fn observation(&self) -> ObservationSpace {
        ObservationSpace { names: vec!["rope".to_owned()] }
    }

    fn build(&self, app: &mut App, _mode: &str) {
        app.init_resource::<Rope>()
            .add_observer(begin)
            .add_observer(end_others)
            .add_systems(ObserveSchedule, see)
            .add_systems(FixedUpdate, pull);
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        let seat = (self.seat + world.query::<&Agent>().iter(world).count()) % SEATS.len();
        let actions = ActionSpace::Discrete(if seat.is_multiple_of(2) { 3 } else { self.second });
        world.spawn((Agent::new(index, actions), VectorSensor::new(["rope"]), Seat(seat))).id()
    }

    fn tools(&self) -> GameTools<'_> {
        GameTools { host: self, ..GameTools::default() }
    }
}

impl HostTools for Tug {
    fn arenas_per_world(&self) -> Option<u32> {
        Some(1)
    }

    fn agents_per_arena(&self) -> u32 {
        SEATS.len() as u32
    }

    fn seats(&self) -> Vec<String> {
        SEATS.map(str::to_owned).to_vec()
    }

    fn teams(&self) -> Vec<usize> {
        self.teams.to_vec()
    }

    fn seated(&self, seat: usize) -> Option<Arc<dyn Game>> {
        (seat < SEATS.len()).then(|| Arc::new(Self { seat, ..self.clone() }) as Arc<dyn Game>)
    }

    fn seat_of(&self, world: &World, agent: Entity) -> usize {
        world.get::<Seat>(agent).map_or(0, |seat| seat.0)
    }

    fn add_agents_along(&self, world: &mut World) {
        let present: Vec<u32> = world.query::<&Agent>().iter(world).map(|agent| agent.index).collect();
        let Some(last) = present.iter().max() else { return };
        for number in 1..=(SEATS.len() - present.len()) as u32 {
            let other = self.spawn_agent(world, last + number);
            world.entity_mut(other).insert((PlaysAlong, BlindBot::Uniform));
        }
    }
}

fn begin(event: On<StartEpisode>, others: Query<(Entity, &Seat), With<PlaysAlong>>, mut commands: Commands) {
    if others.contains(event.entity) {
        return;
    }
    let (level, mut others) = (event.level, others.iter().map(|(it, seat)| (seat.0, it)).collect::<Vec<_>>());
    others.sort_unstable();
    commands.queue(move |world: &mut World| {
        world.resource_mut::<Rope>().0 = level as i32 % 3 - 1;
        for (seat, other) in others {
            begin_beside(world, other, level);
            world.entity_mut(other).insert(AgentStreams::new(level, seat as u32));
        }
    });
}

fn end_others(event: On<EpisodeEnded>, mut others: Query<&mut Control, With<PlaysAlong>>) {
    if let Ok(mut control) = others.get_mut(event.entity) {
        *control = Control::Idle;
    }
}

fn see(rope: Res<Rope>, mut agents: Query<(&Seat, &mut Observation)>) {
    for (seat, mut seen) in &mut agents {
        let towards = if seat.0.is_multiple_of(2) { rope.0 } else { -rope.0 };
        seen.set([towards as f32 / WIN as f32]);
    }
}

/// Pulls the rope to the side of an agent with action 1, and to the other one with action 2.
fn pull(
    mut rope: ResMut<Rope>,
    mut agents: Query<(&Seat, &Control, &Action, &mut Reward, &mut Episode, &mut StateHash)>,
) {
    for (seat, control, action, ..) in &agents {
        if control.is_active() {
            let force = [0, 1, -1][action.discrete().unwrap_or_default() as usize];
            rope.0 += if seat.0.is_multiple_of(2) { force } else { -force };
        }
    }
    for (seat, _, _, mut reward, mut episode, mut hash) in &mut agents {
        let towards = if seat.0.is_multiple_of(2) { rope.0 } else { -rope.0 };
        *hash = StateHash::of([rope.0 as u64, u64::from(episode.tick)]);
        if towards.abs() >= WIN {
            reward.add(towards.signum() as f32);
            episode.terminate(towards > 0);
        } else if episode.tick >= 60 {
            episode.truncate();
        }
    }
}

fn constant(action: u32) -> Player {
    Player::Blind(BlindBot::Constant(ActionValue::Discrete(action)))
}

fn outcomes(game: &Tug, player: u32, rival: u32) -> Vec<(usize, MatchOutcome, u32)> {
    let plan = MatchPlan {
        mode: "default".to_owned(),
        levels: vec![1],
        seats: Vec::new(),
        seed: 1,
        threads: 1,
        randomise: Randomise::default(),
    };
    let played = play_matches(game, &constant(player), &constant(rival), &plan, |_| {}).expect("playable");
    played.iter().map(|it| (it.seat, it.outcome, it.episode.ticks)).collect()
}

#[test]
fn teams_win_and_lose_together_from_every_seat() {
    // Two pull, and two do nothing: twelve steps of 2 from the middle take six ticks.
    let expected = |outcome, ticks| [0, 1, 2, 3].map(|seat| (seat, outcome, ticks)).to_vec();
    assert_eq!(outcomes(&TUG, 1, 0), expected(MatchOutcome::Win, 6), "mates pull with the player");
    assert_eq!(outcomes(&TUG, 0, 1), expected(MatchOutcome::Loss, 6));
    assert_eq!(outcomes(&TUG, 1, 1), expected(MatchOutcome::Draw, 61), "time is up");
    // With the third one as another mate, who pulls to the other side, a step is of 1.
    let alone = Tug { teams: [0, 1, 1, 1], ..TUG };
    assert_eq!(outcomes(&alone, 1, 0)[1], (1, MatchOutcome::Win, 12), "three of a team");
}

#[test]
fn mates_are_told_from_rivals() {
    let game = Opposed::new(&TUG, 3).expect("a seat").against(constant(2), constant(1));
    let (mut world, agents) = build_world(&game, "default", 0, 0, 1);
    assert_eq!(TUG.seat_of(&world, agents[0]), 3);
    let mut others: Vec<(usize, bool)> =
        game.others(&mut world).iter().map(|(it, is_mate)| (TUG.seat_of(&world, *it), *is_mate)).collect();
    others.sort_unstable();
    assert_eq!(others, [(0, false), (1, true), (2, false)]);
}

#[test]
fn teams_of_unequal_actions_and_games_of_one_team_are_refused_in_words() {
    assert_eq!(check_rivals(&TUG, "default"), Ok(()));
    let unequal = check_rivals(&Tug { second: 2, ..TUG }, "default").expect_err("other actions").to_string();
    assert_eq!(
        unequal,
        "agents of `tug` have 3 discrete actions on the seat `north` and 2 discrete actions on `east`: one policy plays on all \
         seats, so give them equal actions"
    );
    let one = check_rivals(&Tug { teams: [0; 4], ..TUG }, "default").expect_err("no rival").to_string();
    assert!(one.starts_with("all seats of `tug` are of one team"), "{one}");
    let text = r#"(game: "tug", train: "default:0..9", test: "default:10..19", algorithm: "ppo", steps: 512, arenas: 8,
        ppo: (num_steps: 32, minibatches: 2, hidden: [8]), self_play: (every: Some(256)))"#;
    let experiment = parse_experiment(text, Path::new("x.ron")).expect("readable");
    let refused = Trainer::new(&Tug { second: 2, ..TUG }, &experiment, None, DeviceKind::Flex, 1);
    let refused = refused.map(drop).expect_err("other actions").to_string();
    assert!(refused.contains("`self_play.every` is 256") && refused.contains("give them equal actions"), "{refused}");
}

fn trainer(threads: usize) -> Trainer {
    let text = r#"(game: "tug", train: "default:0..9", test: "default:10..19", algorithm: "ppo", steps: 1024, arenas: 8,
        worlds: 2, ppo: (num_steps: 32, minibatches: 2, hidden: [8], lr: 0.01),
        self_play: (every: Some(256), pool: 2, rivals: ["random"], matches: 1))"#;
    let experiment = parse_experiment(text, Path::new("x.ron")).expect("readable");
    Trainer::new(&TUG, &experiment, None, DeviceKind::Flex, threads).expect("it fits")
}

#[test]
fn self_play_in_teams_goes_on_bit_for_bit_and_learns_to_pull() {
    check_resuming(&TUG, trainer, 2);
    let mut trainer = trainer(1);
    while !trainer.is_done() {
        trainer.update().expect("it learns");
    }
    let ladder = trainer.ladder().expect("rivals");
    let rating =
        |name: &str| ladder.members.iter().find(|it| it.name == name).and_then(|it| it.rating).expect(name).elo;
    assert!(rating("step 1,024") > rating("random"), "{ladder:?}");
}

/// Returns a model of skills that each pull to one side for four ticks.
fn skills_of_pulling() -> SkillModel {
    let episode = |number: u32| {
        let actions: Vec<u32> = (0..32).map(|tick| 1 + (tick / 4 + number * 7 / 3) % 2).collect();
        let ropes = (0..32).map(|tick| ((tick + number) % 7) as f32 / 7.0 - 0.5);
        DatasetEpisode { observations: ropes.collect::<Vec<f32>>().into(), actions: Actions::Discrete(actions) }
    };
    let dataset = Dataset::new(1, ActionSpace::Discrete(3), (0..16).map(episode).collect()).expect("consistent");
    let config = SkillConfig {
        latent: 2,
        window: 5,
        hidden: vec![8],
        encoder_hidden: 8,
        gru_hidden: 8,
        gru_layers: 1,
        batch: 16,
        ..SkillConfig::default()
    };
    let mut trainer = SkillTrainer::new(config, dataset, 1, DeviceKind::Flex).expect("windows fit");
    trainer.train_epoch(&mut |_| ControlFlow::Continue(())).expect("finite");
    trainer.into_model()
}

#[test]
fn snapshots_of_a_policy_over_skills_keep_their_own_skills_and_go_on_bit_for_bit() {
    let skills = skills_of_pulling();
    let trainer = |threads: usize| {
        let text = r#"(game: "tug", train: "default:0..9", test: "default:10..19", algorithm: "spirl-ppo", steps: 1536,
            arenas: 8, worlds: 2, demos: "d", skills: (window: 5), score: (horizon: 4),
            ppo: (num_steps: 32, minibatches: 2, hidden: [8], lr: 0.01, memory: Gru(hidden: 4, sequence: 4)),
            self_play: (every: Some(256), pool: 2, matches: 2, latest: 0.2))"#;
        let experiment = parse_experiment(text, Path::new("x.ron")).expect("readable");
        Trainer::new(&TUG, &experiment, Some(&skills), DeviceKind::Flex, threads).expect("it fits")
    };
    check_resuming(&TUG, trainer, 3);
    let mut trainer = trainer(1);
    while !trainer.is_done() {
        trainer.update().expect("it learns");
    }
    let newest = trainer.skill_prior().expect("it has skills").prior;
    let folder = tempfile::tempdir().expect("a folder");
    let run = RunDir::create(&folder.path().join("run"), trainer.experiment(), &run_info(trainer.experiment()), false);
    let run = run.expect("fresh");
    run.save(&mut trainer).expect("writable");
    let saved = run.checkpoint(CheckpointChoice::Last).expect("saved").path;
    let drawn = |prior: &Prior| prior.sample(&[0.3, -0.2], 2, SkillDraw::Mean, &mut |_| 0.0).expect("finite");
    let of_snapshot = |number: usize| {
        let file = PolicyFile::load(&saved.join(format!("snapshot-{number:04}.policy")), DeviceKind::Flex);
        drawn(&file.expect("kept").skills.expect("it has skills").prior)
    };
    // Six updates, so the seventh snapshot is the newest.
    assert_eq!(of_snapshot(6), drawn(&newest));
    assert_ne!(of_snapshot(5), of_snapshot(6), "the policy over skills has learned meanwhile");
}
