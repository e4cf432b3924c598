//! Games that stand still.

use bevy::{app::MainScheduleOrder, ecs::schedule::ScheduleLabel, prelude::*};
use bevy_playbot::{
    control::Control,
    episode::Episode,
    placement::{TickPlacement, TickSchedules, is_tick},
    systems::PlaybotSystems,
};

use super::{
    history::{History, remember},
    when::{When, one_of},
};
use crate::defect::DefectKind;

const VARIANTS: [When; 4] = [When::Tick(30), When::Held(7), When::Later { episode: 2, tick: 5 }, When::Tick(60)];
/// Tick of the time limit in a frozen game: its clock goes on, so that testers can finish the episode.
const LAST_TICK: u32 = 800;

/// Stops every movement.
pub(super) fn frozen_world() -> DefectKind {
    let about = "the game stands still, whatever the agent does";
    DefectKind::rules("frozen-world", about, VARIANTS.len() as u32, |app, variant| {
        remember(app);
        let when = one_of(&VARIANTS, variant);
        let TickSchedules { placement, decide, judge } = TickSchedules::of(app);
        match placement {
            TickPlacement::Fixed => {
                // Games leave the arena of an idle agent alone.
                let idle_agents = move |mut agents: Query<(&mut Control, &Episode, &mut History)>| {
                    for (mut control, episode, mut history) in &mut agents {
                        if control.is_active() && episode.is_running() && when.is_now(&history, episode) {
                            history.control = Some(*control);
                            *control = Control::Idle;
                        }
                    }
                };
                app.add_systems(decide, idle_agents.after(PlaybotSystems::Act))
                    .add_systems(judge, wake_agents.before(PlaybotSystems::Judge));
            }
            // These games have no agents of the plugin's own, and one arena in a World.
            TickPlacement::Frame => {
                app.add_plugins(FreezePlugin(when));
            }
        }
        let time_is_up = move |mut agents: Query<(&Control, &History, &mut Episode)>| {
            for (control, history, mut episode) in &mut agents {
                let is_late = episode.tick + 1 >= LAST_TICK && control.is_active();
                if is_late && when.is_now(history, &episode) {
                    episode.truncate();
                }
            }
        };
        let after = time_is_up.after(wake_agents).before(PlaybotSystems::Judge);
        app.add_systems(judge, after.run_if(is_tick));
    })
}

fn wake_agents(mut agents: Query<(&mut Control, &mut History)>) {
    for (mut control, mut history) in &mut agents {
        if let Some(before) = history.control.take() {
            *control = before;
        }
    }
}

/// Skips the schedules that games run in a frame.
struct FreezePlugin(When);

/// The label under which a schedule of the game is kept.
#[derive(ScheduleLabel, Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum UnlessFrozen {
    FixedLoop,
    Update,
}

impl Plugin for FreezePlugin {
    fn build(&self, app: &mut App) {
        let pairs = [(UnlessFrozen::FixedLoop, RunFixedMainLoop.intern()), (UnlessFrozen::Update, Update.intern())];
        let when = self.0;
        for (instead, label) in pairs {
            app.add_systems(instead, move |world: &mut World| {
                let mut agents = world.query::<(&Control, &Episode, &History)>();
                let is_frozen = agents.iter(world).any(|(control, episode, history)| {
                    control.is_active() && episode.is_running() && when.is_now(history, episode)
                });
                if !is_frozen {
                    // Some programs have nothing in it.
                    let _ = world.try_run_schedule(label);
                }
            });
        }
    }

    /// Runs after all plugins are built, because they find their places by the names of these schedules.
    fn finish(&self, app: &mut App) {
        let mut order = app.world_mut().resource_mut::<MainScheduleOrder>();
        for label in &mut order.labels {
            if *label == RunFixedMainLoop.intern() {
                *label = UnlessFrozen::FixedLoop.intern();
            } else if *label == Update.intern() {
                *label = UnlessFrozen::Update.intern();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bugs::general::testing::{play, play_sound};

    #[test]
    fn nothing_moves_from_its_moment_on() {
        let kind = frozen_world();
        let slowly = |tick: u32| u32::from(tick.is_multiple_of(3));
        assert_eq!(play_sound(75, slowly).place, 25);
        assert_eq!(play(&kind, 0, 75, slowly).place, 10);
        assert_eq!(play(&kind, 1, 29, |_| 1).place, 6);
        assert_eq!(play(&kind, 2, 55, |_| 1).place, 5);
        assert_eq!(play(&kind, 3, 75, slowly).place, 20);
    }
}
