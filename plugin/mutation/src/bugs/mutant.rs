//! Games with a defect in their rules.

use crate::bugs::BugError;
use bevy::prelude::*;
use bevy_playbot::{action::ActionSpace, observation::ObservationSpace};
use playbot_harness::{
    defect::{ChangeLevel, ChangeRules, DefectKind, Plant},
    game::{Game, GameTools},
    inspect::{InspectError, LevelRequest},
};
use playbot_learner::rng::{ChaCha8Rng, shuffle};
use std::{collections::BTreeSet, ops::Deref, sync::Arc};

/// A defect of rules, in one of its variants.
#[derive(Clone)]
pub struct PlantedRules {
    /// The function that plants it.
    pub plant: Arc<ChangeRules>,
    /// Number of the variant.
    pub variant: u32,
}

/// A game with a defect in its rules, under the game's own name: what is planted is found by playing alone.
///
/// `G` points to the game: `&dyn Game` or `Arc<dyn Game>`.
///
/// ```
/// use bevy::prelude::*;
/// use playbot_harness::{defect::DefectKind, foreign::ForeignGame, prelude::*, worlds::build_world};
/// use playbot_mutation::bugs::Mutant;
///
/// #[derive(Resource)]
/// struct Gravity(f32);
///
/// let game = |app: &mut App| {
///     app.insert_resource(Gravity(9.8));
/// };
/// let game = ForeignGame::new("ball", 1, game).actions(ActionSpace::Discrete(2), || {}).observe(["x"], || [0.0]);
/// let weak = DefectKind::rules("weak-gravity", "things fall too slowly", 2, |app, variant| {
///     app.insert_resource(Gravity([2.0, 5.0][variant as usize]));
/// });
/// let mutant = Mutant::new(&game as &dyn Game, &weak, 1);
/// let (world, _) = build_world(&mutant, "default", 0, 0, 1);
/// assert_eq!(world.resource::<Gravity>().0, 5.0);
/// assert_eq!(mutant.name(), "ball");
/// ```
#[derive(Clone)]
pub struct Mutant<G> {
    game: G,
    rules: Option<PlantedRules>,
}

impl<G> Mutant<G> {
    /// A game with this variant of a defect. A defect of levels leaves the game as it is.
    pub fn new(game: G, kind: &DefectKind, variant: u32) -> Self {
        let rules = match &kind.plant {
            Plant::Rules { plant, .. } => Some(PlantedRules { plant: Arc::clone(plant), variant }),
            Plant::Level(_) => None,
        };
        Self { game, rules }
    }

    /// A game as it is.
    pub fn sound(game: G) -> Self {
        Self { game, rules: None }
    }

    /// The defect in its rules, if there is one.
    pub fn rules(&self) -> Option<&PlantedRules> {
        self.rules.as_ref()
    }
}

/// Its tools are those of the game: defects are in the rules alone.
impl<G: Deref<Target: Game> + Send + Sync> Game for Mutant<G> {
    fn name(&self) -> &'static str {
        self.game.name()
    }

    fn version(&self) -> u32 {
        self.game.version()
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

    fn build(&self, app: &mut App, mode: &str) {
        self.game.build(app, mode);
        if let Some(PlantedRules { plant, variant }) = &self.rules {
            plant(app, *variant);
        }
    }

    fn spawn_agent(&self, world: &mut World, index: u32) -> Entity {
        self.game.spawn_agent(world, index)
    }

    fn tools(&self) -> GameTools<'_> {
        // A planted defect may have state of its own, which the game's snapshots do not know.
        GameTools { snapshots: GameTools::default().snapshots, ..self.game.tools() }
    }

    fn built_anew(&self) -> Option<Arc<dyn Game>> {
        let game = self.game.built_anew()?;
        Some(Arc::new(Mutant { game, rules: self.rules.clone() }))
    }
}

// The search for a level that has a place for a defect.

/// A level with a defect.
#[derive(Debug)]
pub(super) struct BrokenLevel {
    /// Number of the unmutated level.
    pub(super) base: u64,
    /// Text of the broken level.
    pub(super) text: String,
    /// Hash of the broken level.
    pub(super) hash: u64,
}

/// Plants a defect into the first of these levels, in a random order, that has a place for it. The broken level must
/// not be in `taken`.
pub(super) fn plant_level(
    game: &dyn Game,
    class: &str,
    (mode, bases): (&str, &[u64]),
    change: &ChangeLevel,
    rng: &mut ChaCha8Rng,
    taken: &mut BTreeSet<u64>,
) -> Result<Option<BrokenLevel>, BugError> {
    let mut order = bases.to_vec();
    shuffle(&mut order, rng);
    for base in order {
        let sound = level_json(game, mode, base)?;
        let Some(text) = change(&sound, rng) else { continue };
        let hash_of = |text: &str| {
            let design = game.parse_level(text).map_err(|error| BugError::NoLevel {
                game: game.name().to_owned(),
                class: class.to_owned(),
                base: format!("{mode}:{base}"),
                why: error.what,
            })?;
            Ok::<_, BugError>(design.hash())
        };
        let hash = hash_of(&text)?;
        // A level that plays as before has no defect.
        if hash != hash_of(&sound)? && taken.insert(hash) {
            return Ok(Some(BrokenLevel { base, text, hash }));
        }
    }
    Ok(None)
}

/// Returns the text of a level, as `playbot level GAME --json` prints it. Games whose levels are maps take modes by
/// another name, and some maps have no numbers.
fn level_json(game: &dyn Game, mode: &str, level: u64) -> Result<String, InspectError> {
    let default = LevelRequest { mode: Some(mode), level: Some(level), ..LevelRequest::default() };
    let requests = [
        default,
        LevelRequest { mode: None, map: Some(mode), ..default },
        LevelRequest { mode: None, map: Some(mode), level: None, ..default },
    ];
    let mut first = None;
    for request in requests {
        match game.show_level(&request) {
            Ok(view) => return Ok(view.json),
            Err(error) => {
                first.get_or_insert(error);
            }
        }
    }
    Err(first.unwrap_or(InspectError::Closed))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::general::{general_defects, testing::Track};
    use playbot_harness::{
        foreign::{ForeignGame, Restart},
        worlds::build_world,
    };

    #[derive(Resource)]
    struct Planted(u32);

    fn planted() -> DefectKind {
        DefectKind::rules("planted", "something is planted", 3, |app, variant| {
            app.insert_resource(Planted(variant));
        })
    }

    #[test]
    fn what_is_planted_is_in_every_world_and_the_game_keeps_its_name() {
        let mutant = Mutant::new(&Track as &dyn Game, &planted(), 2);
        let (world, agents) = build_world(&mutant, "plain", 0, 0, 2);
        assert_eq!((world.resource::<Planted>().0, agents.len(), mutant.name()), (2, 2, "track"));
        let (world, _) = build_world(&Mutant::sound(&Track as &dyn Game), "plain", 0, 0, 1);
        assert!(!world.contains_resource::<Planted>());
        assert_eq!(general_defects(&mutant).len(), general_defects(&Track).len());
    }

    #[test]
    fn worlds_that_are_built_anew_have_it_too() {
        let game = ForeignGame::new("ball", 1, |_: &mut App| {})
            .keys([vec![], vec![KeyCode::Space]])
            .observe(["x"], || [0.0])
            .restart(Restart::Rebuild);
        let mutant = Mutant::new(Arc::new(game) as Arc<dyn Game>, &planted(), 1);
        let again = mutant.built_anew().expect("it is built for each episode");
        let (world, _) = build_world(&*again, "default", 0, 0, 1);
        assert_eq!(world.resource::<Planted>().0, 1);
    }
}
