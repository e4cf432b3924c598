//! The ways to restart a foreign game.

use std::{any::type_name, sync::Arc};

use bevy::{prelude::*, state::state::FreelyMutableState};

use super::factory::SystemFactory;

/// The way in which a foreign game restarts for each episode.
#[derive(Clone)]
#[non_exhaustive]
pub enum Restart {
    /// Despawns everything that the game has spawned since the program started, resets the clock to 0, and runs
    /// `PreStartup`, `Startup` and `PostStartup` again. Resources stay unchanged, unless those systems insert them:
    /// reset them in [`ForeignGame::level`](super::ForeignGame::level).
    Startup,
    /// Rebuilds the World, as if the program were started again for each episode. It is the last resort, for games
    /// whose resources, `Local`s or timers survive [`Startup`](Self::Startup). It takes far longer, loads assets again,
    /// and works only in Worlds without a window. `Startup` already finds the level in [`LevelSeed`](super::LevelSeed).
    Rebuild,
    /// The game's own restart: see [`Restart::system`] and [`Restart::state`].
    Own(OwnRestart),
}

/// A game's own restart.
#[derive(Clone)]
pub struct OwnRestart(pub(super) OwnRestartKind);

#[derive(Clone)]
pub(super) enum OwnRestartKind {
    System(SystemFactory<()>),
    State(Arc<dyn Fn(&mut World) -> Result<(), String> + Send + Sync>),
}

impl Restart {
    /// Restarts the game with a system. The clock is reset to 0 before it.
    pub fn system<M: 'static>(system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static) -> Self {
        Self::Own(OwnRestart(OwnRestartKind::System(SystemFactory::new(system, |()| ()))))
    }

    /// Restarts the game by a state: the state is left, if the game is in it, and entered again, with all systems of
    /// these transitions. The clock is reset to 0 before it.
    pub fn state<S: FreelyMutableState + Clone>(state: S) -> Self {
        Self::Own(OwnRestart(OwnRestartKind::State(Arc::new(move |world: &mut World| enter(world, state.clone())))))
    }
}

fn enter<S: FreelyMutableState>(world: &mut World, state: S) -> Result<(), String> {
    let Some(mut next) = world.get_resource_mut::<NextState<S>>() else {
        return Err(format!("the game has no state of the type `{}`: it must call `init_state`", type_name::<S>()));
    };
    next.set(state);
    world.try_run_schedule(StateTransition).map_err(|_| "the game has no `StatesPlugin`".to_owned())
}
