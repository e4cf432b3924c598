//! View from above, with sprites.

use crate::{
    ant::{
        body::Part,
        view::{AntPose, AntViewSystems, ArenaGround, GoalMark, OnGround},
    },
    pictures::ArenaGrid,
};
use bevy::{image::ImageSampler, prelude::*};
use bevy_playbot::vision::{Stage, TileLayer};
use playbot_harness::prelude::*;

/// Draws ants and grounds with sprites.
pub struct FlatViewPlugin;

impl Plugin for FlatViewPlugin {
    fn build(&self, app: &mut App) {
        let mut images = app.world_mut().get_resource_or_init::<Assets<Image>>();
        let art = Art::add_to(&mut images);
        app.insert_resource(art).init_resource::<ArenaGrid>().add_systems(
            ObserveSchedule,
            (stages, tiles, follow, spawn, pose, goals).chain().in_set(AntViewSystems::Draw),
        );
    }
}

// Drawings of a disc and of two tiles, made texel by texel.

/// Side of a cell's tile, texels: 16 to the metre.
const TILE: u32 = 64;

/// Side of the square that the disc fills, texels.
const DISC: u32 = 32;

/// Numbers of the tiles on the strip.
pub(crate) const FLOOR: u16 = 0;

pub(crate) const WALL: u16 = 1;

type Texel = [u8; 4];

/// Handles of all drawings.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource)]
pub struct Art {
    /// A white disc.
    pub disc: Handle<Image>,
    /// Floor and wall, one below the other.
    pub tiles: Handle<Image>,
}

impl Art {
    /// Adds the drawings to an app.
    pub fn add_to(images: &mut Assets<Image>) -> Self {
        let tile = |x, y| if y < TILE { floor(x, y) } else { wall(x, y - TILE) };
        Self { disc: images.add(image(DISC, DISC, disc)), tiles: images.add(image(TILE, 2 * TILE, tile)) }
    }
}

/// Returns the floor of one cell.
#[cfg(feature = "view3d")]
pub(crate) fn floor_tile() -> Image {
    image(TILE, TILE, floor)
}

/// Returns an image, texel by texel, top row first.
fn image(width: u32, height: u32, texel: impl Fn(u32, u32) -> Texel) -> Image {
    // The type of an image's size has no name in a program without a renderer.
    let mut image = Image::default();
    image.texture_descriptor.size.width = width;
    image.texture_descriptor.size.height = height;
    image.data =
        Some((0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect());
    image.sampler = ImageSampler::nearest();
    image
}

fn disc(x: u32, y: u32) -> Texel {
    let off = |at: u32| 2 * i64::from(at) + 1 - i64::from(DISC);
    let inside = off(x).pow(2) + off(y).pow(2) <= i64::from(DISC).pow(2);
    if inside { [255; 4] } else { [255, 255, 255, 0] }
}

/// Draws light squares of one metre, which make motion visible.
fn floor(x: u32, y: u32) -> Texel {
    let metre = TILE / 4;
    if (x / metre + y / metre).is_multiple_of(2) { [201, 207, 196, 255] } else { [186, 193, 181, 255] }
}

/// Draws a dark tile, with a rim to the cell.
fn wall(x: u32, y: u32) -> Texel {
    let rim = x.min(y).min(TILE - 1 - x).min(TILE - 1 - y) < 2;
    if rim { [66, 70, 84, 255] } else { [84, 88, 104, 255] }
}

// Arenas as stages with floor and walls.

/// Distance from the corner of one arena to the corner of the next, metres. Cameras see several arenas where mazes have
/// more than 120 cells to the side; sensors that draw by themselves never do.
const SPACING: f32 = 512.0;

/// The tiles of an arena.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Tiling(Entity);

/// Makes new arenas into stages.
pub(crate) fn stages(
    new: Query<Entity, (With<ArenaGround>, Without<Tiling>)>,
    mut grid: ResMut<ArenaGrid>,
    mut commands: Commands,
) {
    for arena in &new {
        let tiling = commands.spawn((ChildOf(arena), Transform::default())).id();
        commands.entity(arena).insert((Stage, grid.next(SPACING), Tiling(tiling)));
    }
}

/// Lays the tiles of new grounds.
pub(crate) fn tiles(
    changed: Query<(&ArenaGround, &Tiling), Or<(Changed<ArenaGround>, Added<Tiling>)>>,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (ground, tiling) in &changed {
        let number = |is_wall| if is_wall { WALL } else { FLOOR };
        let layer = TileLayer {
            tileset: art.tiles.clone(),
            columns: ground.columns,
            rows: ground.is_wall.len() as u32 / ground.columns.max(1),
            cells: ground.is_wall.iter().map(|&is_wall| number(is_wall)).collect(),
            outside: number(ground.walled),
        };
        let [x, y] = ground.corner;
        let place = Transform::from_xyz(x, y, GROUND).with_scale(Vec3::new(ground.cell, ground.cell, 1.0));
        commands.entity(tiling.0).insert((layer, place));
    }
}

/// Keeps the origin of an open floor's tiles within half a cell of its ant. All tiles are alike, so the moves are
/// invisible, and the floor has no visible edge.
pub(crate) fn follow(
    ants: Query<(&AntPose, &OnGround)>,
    grounds: Query<(&ArenaGround, &Tiling)>,
    mut tilings: Query<&mut Transform, With<TileLayer>>,
) {
    for (pose, on_ground) in &ants {
        let Ok((ground, tiling)) = grounds.get(on_ground.0) else { continue };
        let Ok(mut place) = tilings.get_mut(tiling.0) else { continue };
        if !ground.is_wall.is_empty() {
            continue;
        }
        let corner = Vec2::from(ground.corner);
        let cells = ((pose.0[0].centre.truncate() - corner) / ground.cell).round();
        let at = (corner + cells * ground.cell).extend(GROUND);
        if place.translation != at {
            place.translation = at;
        }
    }
}

// Width of the picture, and order of its layers.

/// Metres from the left to the right edge of an agent's picture: four cells of a maze.
pub const VIEW: f32 = 16.0;

/// Layers, the farthest first.
pub(crate) const GROUND: f32 = -2.0;

pub(crate) const GOAL: f32 = -1.0;

pub(crate) const LIMBS: f32 = 0.0;

// Ants from above: a disc for the torso, a bar for each limb, and a disc for the goal.

/// Torso, seen from above and, of an ant that lies on its back, from below.
const TORSO: Color = Color::srgb(0.66, 0.26, 0.20);

const BELLY: Color = Color::srgb(0.95, 0.80, 0.55);

/// Legs: the first is lighter than the others, so that the ant's heading shows.
const FIRST_LEG: Color = Color::srgb(0.93, 0.55, 0.22);

const LEG: Color = Color::srgb(0.45, 0.20, 0.17);

pub(crate) const GOAL_COLOUR: Color = Color::srgb(0.20, 0.62, 0.32);

/// Each leg has three limbs.
const LIMBS_OF_A_LEG: usize = 3;

/// Factor by which a part grows per metre of height.
const NEARER: f32 = 0.1;

/// The sprites of an ant: limbs in the order of its parts, without the torso, which is the agent itself; then the goal.
#[derive(Component, Reflect)]
#[reflect(Component)]
pub struct Sprites {
    limbs: Vec<Entity>,
    goal: Entity,
}

/// Returns the colour of a limb, by its number among the parts of an ant.
pub(crate) fn colour(number: usize) -> Color {
    match number {
        0 => TORSO,
        1..=LIMBS_OF_A_LEG => FIRST_LEG,
        _ => LEG,
    }
}

/// Makes sprites of new ants.
pub(crate) fn spawn(
    new: Query<(Entity, &OnGround, &AntPose), Without<Sprites>>,
    art: Res<Art>,
    mut commands: Commands,
) {
    for (agent, ground, pose) in &new {
        let limb = |number| {
            let sprite = Sprite::from_color(colour(number), Vec2::ZERO);
            commands.spawn((ChildOf(ground.0), sprite, Transform::default())).id()
        };
        let limbs = (1..pose.0.len()).map(limb).collect();
        let disc = |diameter, color| Sprite {
            color,
            custom_size: Some(Vec2::splat(diameter)),
            ..Sprite::from_image(art.disc.clone())
        };
        let hidden = (disc(0.0, GOAL_COLOUR), Visibility::Hidden, Transform::default());
        let goal = commands.spawn((ChildOf(ground.0), hidden)).id();
        let torso = disc(2.0 * pose.0[0].radius, TORSO);
        commands.entity(agent).insert((ChildOf(ground.0), torso, Transform::default(), Sprites { limbs, goal }));
    }
}

/// Moves torso and limbs to their poses.
pub(crate) fn pose(
    mut ants: Query<(&AntPose, &Sprites, &mut Transform, &mut Sprite)>,
    mut limbs: Query<(&mut Transform, &mut Sprite), Without<Sprites>>,
) {
    for (pose, sprites, mut transform, mut sprite) in &mut ants {
        let [torso, legs @ ..] = &pose.0;
        transform.translation = place(torso);
        let upright = (torso.rotation * Vec3::Z).z > 0.0;
        sprite.color = if upright { TORSO } else { BELLY };
        for (limb, &entity) in legs.iter().zip(&sprites.limbs) {
            let Ok((mut transform, mut sprite)) = limbs.get_mut(entity) else { continue };
            let along = (limb.rotation * Vec3::Y * limb.half_length).truncate();
            transform.translation = place(limb);
            transform.rotation = Quat::from_rotation_arc_2d(Vec2::X, along.try_normalize().unwrap_or(Vec2::X));
            sprite.custom_size = Some(2.0 * Vec2::new(along.length() + limb.radius, limb.radius));
        }
    }
}

fn place(part: &Part) -> Vec3 {
    part.centre.truncate().extend(LIMBS + NEARER * (part.centre.z + part.radius))
}

/// Moves the discs to the goals.
pub(crate) fn goals(
    changed: Query<(&GoalMark, &Sprites), Or<(Changed<GoalMark>, Added<Sprites>)>>,
    mut discs: Query<(&mut Transform, &mut Sprite, &mut Visibility)>,
) {
    for (goal, sprites) in &changed {
        let Ok((mut transform, mut sprite, mut visibility)) = discs.get_mut(sprites.goal) else { continue };
        let [x, y] = goal.at;
        transform.translation = Vec3::new(x, y, GOAL);
        sprite.custom_size = Some(Vec2::splat(2.0 * goal.radius));
        *visibility = Visibility::Inherited;
    }
}
