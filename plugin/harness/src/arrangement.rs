//! The distribution of arenas over Worlds.

use crate::game::Game;

/// Worlds of equal size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrangement {
    /// Number of Worlds.
    pub worlds: u32,
    /// Arenas in each of them, with one agent each; or the agents that share one arena.
    pub arenas: u32,
}

impl Arrangement {
    /// Distributes `arenas` over `worlds`, or over more of them if one World holds fewer arenas: see
    /// [`HostTools::arenas_per_world`](crate::game::HostTools::arenas_per_world).
    pub fn new(game: &dyn Game, arenas: u32, worlds: u32) -> Self {
        let wanted = (arenas / worlds.max(1)).max(1);
        let most = game.tools().host.arenas_per_world().unwrap_or(u32::MAX).max(1);
        if wanted <= most {
            return Self { worlds: worlds.max(1), arenas: wanted };
        }
        let total = wanted * worlds.max(1);
        let fitting = (1..=most).rev().find(|arenas| total.is_multiple_of(*arenas)).unwrap_or(1);
        Self { worlds: total / fitting, arenas: fitting }
    }

    /// Distributes `agents` over `worlds` as [`new`](Self::new) does. Agents that share an arena, as
    /// [`HostTools::agents_per_arena`](crate::game::HostTools::agents_per_arena) says, share a World. A number that is no
    /// multiple of theirs is rounded up.
    pub fn of_agents(game: &dyn Game, agents: u32, worlds: u32) -> Self {
        match game.tools().host.agents_per_arena() {
            0 | 1 => Self::new(game, agents, worlds),
            sharing => Self { worlds: agents.div_ceil(sharing).max(1), arenas: sharing },
        }
    }

    /// Returns the number of the first agent of each World.
    pub fn first_agents(self) -> impl Iterator<Item = u32> {
        (0..self.worlds).map(move |world| world * self.arenas)
    }

    /// Returns the number of arenas of all Worlds together.
    pub fn total(self) -> u32 {
        self.worlds * self.arenas
    }
}

/// Returns the largest number of arenas, up to `wanted`, that one World of the game holds.
pub fn at_most(game: &dyn Game, wanted: usize) -> usize {
    game.tools().host.arenas_per_world().map_or(wanted, |most| wanted.min(most.max(1) as usize))
}
