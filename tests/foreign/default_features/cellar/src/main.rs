//! Cellar, a walk through rooms that are drawn in LDtk, without any code for playbot, with every verb of it.

mod defects;
mod game;
mod rules;

use std::process::ExitCode;

use bevy::{asset::AssetPlugin, prelude::*};
use bevy_ecs_ldtk::prelude::LevelSelection;
use game::{Room, Screen, WAYS};
use playbot::harness::foreign::{EditorLevel, ForeignGame, MapLegend};
use playbot::prelude::EpisodeEnd;

/// The folder of the rooms, so that the program finds them from any folder.
const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/assets");

fn main() -> ExitCode {
    let legend = MapLegend::default().walls(["wall"]).hazards(["pit"]).start("Walker").goal("Exit").in_cells();
    let views = (0..25).map(|cell| format!("cell {cell}"));
    playbot::main(&[&rules::add_to(ForeignGame::new("cellar", 1, game::game))
        .default_plugins(|plugins| plugins.set(AssetPlugin { file_path: ASSETS.to_owned(), ..default() }))
        .ldtk(format!("{ASSETS}/cellar.ldtk"), legend)
        .level(|level: Res<EditorLevel>, mut chosen: ResMut<LevelSelection>, mut next: ResMut<NextState<Screen>>| {
            *chosen = LevelSelection::Identifier(level.name.clone());
            next.set(Screen::Loading);
        })
        .ready(in_state(Screen::Walking))
        .keys([vec![]].into_iter().chain(WAYS.map(|(key, _)| vec![key])))
        .observe(["x", "y", "keys"].map(str::to_owned).into_iter().chain(views), |room: Res<Room>| {
            let [x, y] = (room.exit - room.at).as_vec2().to_array().map(|length| length / 10.0);
            [vec![x, y, room.keys as f32], room.around().map(f32::from).to_vec()].concat()
        })
        .position(|room: Res<Room>| room.at.as_vec2() + 0.5)
        .reward(|screen: Res<State<Screen>>| f32::from(u8::from(**screen == Screen::Out)))
        .end(|screen: Res<State<Screen>>| match **screen {
            Screen::Out => Some(EpisodeEnd::WON),
            Screen::Fallen => Some(EpisodeEnd::LOST),
            _ => None,
        })
        .time_limit(900)
        .demonstrator("guide", |room: Res<Room>| room.hint().map_or(0, |way| way + 1))])
}
