//! The corridor as a picture.

use bevy::{
    asset::RenderAssetUsages,
    image::Image,
    prelude::*,
    render::render_resource::{Extent3d, TextureDimension, TextureFormat},
};
use bevy_playbot::vision::{Picture, Stage, VisionSystems};
use playbot::prelude::*;
use playbot_harness::game::PictureTools;

use crate::corridor::Cell;

/// [`Corridor`](crate::Corridor) with pictures: a green agent with a camera, a white exit at the right end and a red
/// pit at the left one, a unit for each cell. The pictures carry the same information as the first number of the
/// vector.
#[derive(Clone, Copy, Debug, Default)]
pub struct PaintedCorridor;

/// An image of one colour for each of the three.
#[derive(Resource)]
struct Paints([Handle<Image>; 3]);

const COLOURS: [[u8; 4]; 3] = [[0, 160, 0, 255], [255, 255, 255, 255], [200, 0, 0, 255]];

impl FromWorld for Paints {
    fn from_world(world: &mut World) -> Self {
        let mut images = world.get_resource_or_init::<Assets<Image>>();
        let size = Extent3d { width: 2, height: 2, depth_or_array_layers: 1 };
        let format = TextureFormat::Rgba8UnormSrgb;
        let plain = |colour: [u8; 4]| {
            Image::new_fill(size, TextureDimension::D2, &colour, format, RenderAssetUsages::default())
        };
        Self(COLOURS.map(|colour| images.add(plain(colour))))
    }
}

/// Gives new agents a stage of their own with all its sprites.
fn spawn_pictures(
    new: Query<(Entity, &Agent), (With<Cell>, Without<Sprite>)>,
    paints: Res<Paints>,
    mut commands: Commands,
) {
    for (entity, agent) in &new {
        let sprite =
            |paint: usize| Sprite { custom_size: Some(Vec2::ONE), ..Sprite::from_image(paints.0[paint].clone()) };
        let stage = commands.spawn((Stage, Transform::from_xyz(0.0, 100.0 * agent.index as f32, 0.0))).id();
        commands.spawn((sprite(1), Transform::from_xyz(6.0, 0.0, 0.0), ChildOf(stage)));
        commands.spawn((sprite(2), Transform::default(), ChildOf(stage)));
        commands.entity(entity).insert((sprite(0), Transform::from_xyz(0.0, 0.0, 1.0), ChildOf(stage)));
    }
}

fn follow(mut agents: Query<(&Cell, &mut Transform)>) {
    for (cell, mut transform) in &mut agents {
        transform.translation.x = cell.0 as f32;
    }
}

impl Game for PaintedCorridor {
    crate::as_corridor!();

    fn tools(&self) -> GameTools<'_> {
        GameTools { pictures: self, ..GameTools::default() }
    }
}

impl PictureTools for PaintedCorridor {
    fn picture(&self) -> Option<Picture> {
        Some(Picture { width: 8.0, least_height: 0.0 })
    }

    fn build_picture(&self, app: &mut App) {
        app.init_resource::<Paints>()
            .add_systems(ObserveSchedule, (spawn_pictures, follow).chain().in_set(VisionSystems::Sync));
    }
}
