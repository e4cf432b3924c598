//! Who may decide: the person, and whoever the person hands over to.

use bevy::prelude::*;
use playbot_lab::eval::Player;
use playbot_lab::prelude::*;

/// Whoever takes over from the person, and gives back.
pub struct Partner {
    /// Its name, for people.
    pub name: String,
    /// A policy or a bot.
    pub player: Player,
}

/// The agent of the window and those who play it.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
pub(super) struct Seats {
    /// The agent.
    pub agent: Entity,
    partner: Option<(String, Control)>,
}

impl Seats {
    /// Prepares the agent for the partner; nobody decides yet.
    pub fn new(game: &dyn Game, world: &mut World, agent: Entity, partner: Option<Partner>) -> Self {
        let partner = partner.map(|Partner { name, player }| {
            player.install(world);
            (name, player.seat(game, world, agent))
        });
        Self { agent, partner }
    }

    /// Who decides after a change; `None` if there is nobody to change with.
    pub fn other(&self, control: Control) -> Option<Control> {
        let (_, partner) = self.partner.as_ref()?;
        Some(if control == Control::Human { *partner } else { Control::Human })
    }

    /// Who decides, in words.
    pub fn who(&self, control: Control) -> String {
        match (&self.partner, control) {
            (_, Control::Human) => "you play".to_owned(),
            (Some((name, partner)), control) if *partner == control => format!("{name} plays"),
            _ => "nobody plays".to_owned(),
        }
    }
}
