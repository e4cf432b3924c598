//! How a game begins anew.

use std::{any::type_name, sync::Arc};

use bevy::{prelude::*, state::state::FreelyMutableState};

use super::factory::SystemFactory;

/// How a foreign game begins anew, for each episode.
#[derive(Clone)]
#[non_exhaustive]
pub enum Restart {
    /// Everything that the game has spawned since the program began is despawned, the clock is set back to 0, and
    /// `PreStartup`, `Startup` and `PostStartup` run again. Resources stay as they are, unless those systems insert them:
    /// set back what counts in [`ForeignGame::level`](super::ForeignGame::level).
    Startup,
    /// The World is built anew, as if the program were started again for each episode: the last resort, for games whose
    /// resources, `Local`s or timers survive [`Startup`](Self::Startup). It takes far longer, loads assets again, and is for
    /// Worlds without a window only. `Startup` already finds the level in [`LevelSeed`](super::LevelSeed).
    Rebuild,
    /// The game's own way: see [`Restart::system`] and [`Restart::state`].
    Own(OwnRestart),
}

/// A game's own way to begin anew.
#[derive(Clone)]
pub struct OwnRestart(pub(super) OwnRestartKind);

#[derive(Clone)]
pub(super) enum OwnRestartKind {
    System(SystemFactory<()>),
    State(Arc<dyn Fn(&mut World) -> Result<(), String> + Send + Sync>),
}

impl Restart {
    /// A system that begins the game anew. The clock is set back to 0 before it.
    pub fn system<M: 'static>(system: impl IntoSystem<(), (), M> + Clone + Send + Sync + 'static) -> Self {
        Self::Own(OwnRestart(OwnRestartKind::System(SystemFactory::new(system, |()| ()))))
    }

    /// The state in which the game begins: it is left, if the game is in it, and entered again, with everything that the
    /// game does on the way. The clock is set back to 0 before it.
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
