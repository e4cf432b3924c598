//! Cameras that see nothing.

use bevy_playbot::{agent::AgentOrder, vision::BlankEpisodes};

use crate::detector::{Detector, WorldMoment, WorldWatch};

/// A finding for episodes in which every picture was of one colour. Only testers with pictures have any. An agent that
/// never gets an observation is a fault of the game, which is a finding of its own.
#[derive(Default)]
pub struct BlankPicture;

/// The blank episodes so far.
#[derive(Default)]
struct Counted(u64);

impl Detector for BlankPicture {
    fn name(&self) -> &'static str {
        "blank-picture"
    }

    fn describe(&self) -> &'static str {
        "every picture that the agent sees in an episode is of a single colour"
    }

    fn watch_world(&self) -> Option<Box<dyn WorldWatch>> {
        Some(Box::<Counted>::default())
    }
}

impl WorldWatch for Counted {
    fn tick(&mut self, moment: &WorldMoment<'_>) -> Option<String> {
        let agents = moment.world.get_resource::<AgentOrder>()?.entities();
        let count = agents.iter().filter_map(|agent| moment.world.get::<BlankEpisodes>(*agent));
        let count = count.map(|blank| blank.episodes).sum();
        let before = std::mem::replace(&mut self.0, count);
        (count > before).then(|| "each picture of the episode was of a single colour".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use bevy::prelude::Entity;
    use bevy_playbot::{headless::headless_app, prelude::*};

    use super::*;

    #[test]
    fn an_episode_without_a_picture_of_anything_is_found_once() {
        let mut app = headless_app();
        let agent: Entity = app.world_mut().spawn(Agent::new(0, ActionSpace::Discrete(2))).id();
        app.tick().expect("one agent");
        let mut watch = BlankPicture.watch_world().expect("it looks at Worlds");
        let mut told = |app: &bevy::app::App| watch.tick(&WorldMoment { world: app.world(), errors: &[] });
        assert_eq!(told(&app), None, "who has no eyes is not blind");
        app.world_mut().entity_mut(agent).insert(BlankEpisodes::default());
        assert_eq!(told(&app), None);
        if let Some(mut blank) = app.world_mut().get_mut::<BlankEpisodes>(agent) {
            blank.episodes = 1;
        }
        assert!(told(&app).is_some_and(|message| message.contains("single colour")));
        assert_eq!(told(&app), None);
    }
}
