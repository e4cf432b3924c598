//! Set-ups of trainings with a planted fault, for the measurement of `playbot diagnose`.

use std::sync::Arc;

use bevy::prelude::*;
use bevy_playbot::{
    engine::{TickSchedules, is_tick},
    legal::LegalActions,
};
use playbot::prelude::*;
use playbot_harness::game::{GameTools, idle_action};
use playbot_train::diagnose::Sign;

/// A fault of the game's rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RuleFault {
    /// No fault.
    None,
    /// All observed values are the same.
    ConstantObservation,
    /// The first half of the observed values is 0.
    HalfObservation,
    /// The first observed value is 100,000 times as large.
    LargeValue,
    /// Two actions are exchanged, or the first two numbers of a continuous one.
    SwappedActions,
    /// No action has an effect.
    DeadActions,
    /// Rewards are 1000 times as large.
    LargeReward,
    /// Nothing is paid.
    NoReward,
    /// Rewards have the wrong sign.
    NegativeReward,
    /// Each tick pays so much.
    TickPay(u16),
    /// A mask forbids what leads to the goal.
    Forbidden,
    /// Episodes are cut off after these ticks.
    CutOff(u32),
    /// The version of the rules is another one.
    OtherVersion,
}

/// A game with a fault.
pub struct PlantedGame {
    /// The game.
    pub game: Arc<dyn Game>,
    /// Its fault.
    pub fault: RuleFault,
    /// The actions that are exchanged, and those that are forbidden.
    pub needed: Vec<u32>,
}

/// The faults of a World.
#[derive(Resource, Clone)]
struct Planted {
    fault: RuleFault,
    needed: Vec<u32>,
    idle: ActionValue,
}

/// The action as the player chose it, while the game reads another one.
#[derive(Component, Clone)]
struct Chosen(ActionValue);

fn change_observation(planted: Res<Planted>, mut agents: Query<&mut Observation>) {
    for mut observation in &mut agents {
        let half = observation.vector.len().div_ceil(2);
        match planted.fault {
            RuleFault::ConstantObservation => observation.vector.fill(0.5),
            RuleFault::HalfObservation => observation.vector[..half].fill(0.0),
            RuleFault::LargeValue => observation.vector.iter_mut().take(1).for_each(|value| *value *= 1e5),
            _ => {}
        }
    }
}

fn forbid(planted: Res<Planted>, mut commands: Commands, agents: Query<(Entity, &Agent, Option<&LegalActions>)>) {
    for (entity, agent, mask) in &agents {
        if let (ActionSpace::Discrete(count), None) = (agent.actions, mask) {
            let mask = (0..count as u32).map(|action| !planted.needed.contains(&action));
            commands.entity(entity).insert(LegalActions::new(mask));
        }
    }
}

fn exchange(planted: Res<Planted>, mut commands: Commands, mut agents: Query<(Entity, &mut Action), With<Agent>>) {
    for (entity, mut action) in &mut agents {
        commands.entity(entity).insert(Chosen(action.0.clone()));
        let changed = match (&action.0, planted.fault) {
            (_, RuleFault::DeadActions) => planted.idle.clone(),
            (ActionValue::Discrete(number), _) => {
                let (one, other) = (planted.needed[0], planted.needed[1]);
                let exchanged = if *number == one {
                    other
                } else if *number == other {
                    one
                } else {
                    *number
                };
                ActionValue::Discrete(exchanged)
            }
            (ActionValue::Continuous(values), _) => {
                let mut values = values.clone();
                values.swap(0, 1);
                ActionValue::Continuous(values)
            }
            // No planted game makes several choices.
            (ActionValue::Mixed { .. }, _) => action.0.clone(),
        };
        action.0 = changed;
    }
}

fn restore(mut agents: Query<(&Chosen, &mut Action)>) {
    for (chosen, mut action) in &mut agents {
        action.0.clone_from(&chosen.0);
    }
}

fn change_reward(planted: Res<Planted>, mut agents: Query<(&mut Reward, &Episode, &Control)>) {
    for (mut reward, episode, control) in &mut agents {
        let paid = reward.get();
        if !control.is_active() || !(episode.is_running() || episode.end().is_some()) {
            continue;
        }
        match planted.fault {
            RuleFault::LargeReward => reward.add(paid * 999.0),
            RuleFault::NoReward => reward.add(-paid),
            RuleFault::NegativeReward => reward.add(-2.0 * paid),
            RuleFault::TickPay(pay) => reward.add(f32::from(pay)),
            _ => {}
        }
    }
}

fn cut_off(planted: Res<Planted>, mut agents: Query<&mut Episode>) {
    let RuleFault::CutOff(limit) = planted.fault else { return };
    for mut episode in agents.iter_mut().filter(|episode| episode.tick + 1 >= limit) {
        episode.truncate();
    }
}

impl Game for PlantedGame {
    fn name(&self) -> &'static str {
        self.game.name()
    }

    fn version(&self) -> u32 {
        self.game.version() + u32::from(self.fault == RuleFault::OtherVersion)
    }

    fn modes(&self) -> &'static [&'static str] {
        self.game.modes()
    }

    fn tick_hz(&self) -> f64 {
        self.game.tick_hz()
    }

    fn actions(&self) -> ActionSpace {
        self.game.actions()
    }

    fn observation(&self) -> ObservationSpace {
        self.game.observation()
    }

    fn tools(&self) -> GameTools<'_> {
        self.game.tools()
    }

    fn built_anew(&self) -> Option<Arc<dyn Game>> {
        let (fault, needed) = (self.fault, self.needed.clone());
        self.game.built_anew().map(|game| Arc::new(Self { game, fault, needed }) as Arc<dyn Game>)
    }

    fn build(&self, app: &mut App, mode: &str) {
        self.game.build(app, mode);
        let planted = Planted { fault: self.fault, needed: self.needed.clone(), idle: idle_action(&*self.game) };
        app.insert_resource(planted);
        let TickSchedules { decide, judge, .. } = TickSchedules::of(app);
        match self.fault {
            RuleFault::None | RuleFault::OtherVersion => {}
            RuleFault::ConstantObservation | RuleFault::HalfObservation | RuleFault::LargeValue => {
                // After all sensors, whatever their order.
                let after = change_observation.after(PlaybotSystems::Observe).before(PlaybotSystems::Decide);
                app.add_systems(decide, after.run_if(is_tick));
            }
            RuleFault::Forbidden => {
                app.add_systems(ObserveSchedule, forbid);
            }
            RuleFault::SwappedActions | RuleFault::DeadActions => {
                let between = exchange.after(PlaybotSystems::Decide).before(PlaybotSystems::Act).run_if(is_tick);
                app.add_systems(decide, between);
                app.add_systems(judge, restore.before(PlaybotSystems::Judge).run_if(is_tick));
            }
            RuleFault::CutOff(_) => {
                app.add_systems(judge, cut_off.before(PlaybotSystems::Judge).run_if(is_tick));
            }
            _ => {
                app.add_systems(judge, change_reward.before(PlaybotSystems::Judge).run_if(is_tick));
            }
        }
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        self.game.spawn_agent(world, index)
    }
}

/// The recordings of a set-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Taken {
    /// Of the game's demonstrator.
    Demonstrator,
    /// Of an agent that does nothing.
    Idle,
    /// Of random actions.
    Random,
}

/// A kind of fault.
#[derive(Clone, Copy, Debug)]
pub struct PlantedFault {
    /// Its name.
    pub name: &'static str,
    /// The fault of the rules.
    pub rule: RuleFault,
    /// Wrong settings.
    pub settings: &'static [&'static str],
    /// The recordings.
    pub taken: Taken,
    /// Algorithms with which it is a fault; any if empty.
    pub algorithms: &'static [&'static str],
    /// It needs discrete actions.
    pub is_discrete: bool,
    /// It shows by a demonstrator alone.
    pub needs_demonstrator: bool,
    /// Signs that name its true cause.
    pub signs: &'static [Sign],
}

const SOUND: PlantedFault = PlantedFault {
    name: "",
    rule: RuleFault::None,
    settings: &[],
    taken: Taken::Demonstrator,
    algorithms: &[],
    is_discrete: false,
    needs_demonstrator: false,
    signs: &[],
};

/// All kinds of faults.
pub const PLANTED_FAULTS: [PlantedFault; 24] = [
    PlantedFault {
        name: "constant observation",
        rule: RuleFault::ConstantObservation,
        signs: &[Sign::ConstantObservation],
        ..SOUND
    },
    PlantedFault {
        name: "half of the observation is 0",
        rule: RuleFault::HalfObservation,
        algorithms: &["score-ppo"],
        signs: &[Sign::ConstantObservation],
        ..SOUND
    },
    PlantedFault {
        name: "normaliser off",
        rule: RuleFault::LargeValue,
        settings: &["skills.norm_obs=false", "ppo.norm_obs=false"],
        signs: &[Sign::ObservationScale, Sign::OtherObservations],
        ..SOUND
    },
    PlantedFault {
        name: "exchanged keys",
        rule: RuleFault::SwappedActions,
        algorithms: &["score-ppo"],
        signs: &[Sign::NoReplay],
        ..SOUND
    },
    PlantedFault { name: "dead actions", rule: RuleFault::DeadActions, signs: &[Sign::DeadActions], ..SOUND },
    PlantedFault {
        name: "reward × 1000",
        rule: RuleFault::LargeReward,
        settings: &["ppo.norm_reward=false"],
        signs: &[Sign::RewardScale],
        ..SOUND
    },
    PlantedFault { name: "reward never paid", rule: RuleFault::NoReward, signs: &[Sign::NoReward], ..SOUND },
    PlantedFault {
        name: "reward with the wrong sign",
        rule: RuleFault::NegativeReward,
        needs_demonstrator: true,
        signs: &[Sign::RewardAgainst],
        ..SOUND
    },
    PlantedFault { name: "each tick pays", rule: RuleFault::TickPay(0), signs: &[Sign::IdlingPays], ..SOUND },
    PlantedFault {
        name: "mask that forbids the way",
        rule: RuleFault::Forbidden,
        is_discrete: true,
        signs: &[Sign::ForbiddenActions],
        ..SOUND
    },
    PlantedFault {
        name: "time limit too short",
        rule: RuleFault::CutOff(0),
        needs_demonstrator: true,
        signs: &[Sign::ShortTime],
        ..SOUND
    },
    PlantedFault {
        name: "recordings of another version",
        rule: RuleFault::OtherVersion,
        algorithms: &["score-ppo"],
        signs: &[Sign::OtherVersion],
        ..SOUND
    },
    PlantedFault {
        name: "idle recordings",
        taken: Taken::Idle,
        algorithms: &["score-ppo"],
        signs: &[Sign::IdleRecordings],
        ..SOUND
    },
    PlantedFault {
        name: "recordings of random actions",
        taken: Taken::Random,
        algorithms: &["score-ppo"],
        signs: &[Sign::Contradictory, Sign::NeverWon],
        ..SOUND
    },
    PlantedFault { name: "γ 0.5", settings: &["ppo.gamma=0.5"], signs: &[Sign::ShortHorizon], ..SOUND },
    PlantedFault { name: "γ 0.2", settings: &["ppo.gamma=0.2"], signs: &[Sign::ShortHorizon], ..SOUND },
    PlantedFault {
        name: "learning rate 1",
        settings: &["ppo.lr=1.0"],
        signs: &[Sign::LearningRate, Sign::MovesTooFar],
        ..SOUND
    },
    PlantedFault {
        name: "learning rate 0.05",
        settings: &["ppo.lr=0.05"],
        signs: &[Sign::LearningRate, Sign::MovesTooFar],
        ..SOUND
    },
    PlantedFault { name: "learning rate 1e-9", settings: &["ppo.lr=0.000000001"], signs: &[Sign::Unmoved], ..SOUND },
    PlantedFault {
        name: "gradients cut to 1e-9",
        settings: &["ppo.max_grad_norm=0.000000001"],
        signs: &[Sign::Unmoved],
        ..SOUND
    },
    PlantedFault { name: "entropy weight 10", settings: &["ppo.ent_coef=10"], signs: &[Sign::EntropyWeight], ..SOUND },
    PlantedFault {
        name: "KL weight 1000",
        settings: &["score.kl_coef=1000"],
        algorithms: &["score-ppo"],
        signs: &[Sign::HeldByDecoder],
        ..SOUND
    },
    PlantedFault { name: "critic not trained", settings: &["ppo.vf_coef=0"], signs: &[Sign::BlindCritic], ..SOUND },
    PlantedFault {
        name: "40 passes over a rollout",
        settings: &["ppo.epochs=40", "ppo.lr=0.01"],
        signs: &[Sign::MovesTooFar, Sign::LearningRate],
        ..SOUND
    },
];
