//! Drawing tile layers with Bevy's renderer.

use crate::{fault::Faults, vision::TileLayer};
use bevy::{
    asset::{AssetEventSystems, RenderAssetUsages, embedded_asset, embedded_path},
    image::ImageSampler,
    mesh::{Indices, PrimitiveTopology},
    prelude::*,
    render::render_resource::{AsBindGroup, Extent3d, TextureDimension, TextureFormat},
    shader::ShaderRef,
    sprite_render::{AlphaMode2d, Material2d, Material2dPlugin, MeshMaterial2d},
};

/// Draws [`TileLayer`]s, for windows and for sensors alike. Each layer is one rectangle, and its pixels look up their
/// tile.
///
/// Added by [`CameraSensorPlugin`](crate::camera::CameraSensorPlugin). It needs Bevy's renderer for sprites.
#[derive(Clone, Copy, Debug, Default)]
pub struct TileLayerPlugin;

/// World units that a [`TileLayer`] is drawn beyond its grid, with its `outside` tile. A grid without cells is drawn
/// as far around its origin, and half a cell more.
///
/// Sensors raise it to half of their width. This is the most that an agent in the grid can see of the outside, and
/// does not cover a neighbouring arena.
#[derive(Resource, Clone, Copy, Debug, PartialEq, Reflect)]
#[reflect(Resource)]
pub struct TileBorder(pub f32);

impl Default for TileBorder {
    fn default() -> Self {
        Self(8.0)
    }
}

impl Plugin for TileLayerPlugin {
    fn build(&self, app: &mut App) {
        embedded_asset!(app, "tiles.wgsl");
        app.init_resource::<TileBorder>()
            .init_resource::<Faults>()
            .add_plugins(Material2dPlugin::<TileMaterial>::default())
            .add_systems(PostUpdate, update_tile_meshes.before(AssetEventSystems));
    }
}

/// The data of a layer for the shader.
#[derive(Asset, TypePath, AsBindGroup, Clone, Debug)]
struct TileMaterial {
    /// Columns, rows, tile outside.
    #[uniform(0)]
    grid: UVec4,
    #[texture(1, sample_type = "u_int")]
    cells: Handle<Image>,
    #[texture(2)]
    tileset: Handle<Image>,
}

impl Material2d for TileMaterial {
    fn vertex_shader() -> ShaderRef {
        shader()
    }

    fn fragment_shader() -> ShaderRef {
        shader()
    }

    fn alpha_mode(&self) -> AlphaMode2d {
        // Among the sprites, by depth. Its pixels are opaque or absent, never mixed.
        AlphaMode2d::Blend
    }
}

fn shader() -> ShaderRef {
    bevy::asset::AssetPath::from_path_buf(embedded_path!("tiles.wgsl")).with_source("embedded").into()
}

/// Updates the drawing of changed layers.
fn update_tile_meshes(
    border: Res<TileBorder>,
    layers: Query<(Entity, Ref<TileLayer>, &Transform)>,
    drawn: Query<(&Mesh2d, &MeshMaterial2d<TileMaterial>)>,
    mut meshes: ResMut<Assets<Mesh>>,
    mut images: ResMut<Assets<Image>>,
    mut materials: ResMut<Assets<TileMaterial>>,
    mut faults: ResMut<Faults>,
    mut commands: Commands,
) {
    for (entity, layer, transform) in &layers {
        if !layer.is_changed() && !border.is_changed() {
            continue;
        }
        if !layer.is_complete() {
            let TileLayer { columns, rows, cells, .. } = &*layer;
            faults.report(format!(
                "tile layer {entity} has {} cells; with {columns} columns and {rows} rows it needs one for each",
                cells.len()
            ));
            continue;
        }
        let mesh = rectangle(&layer, border.0 / transform.scale.x.abs().max(f32::EPSILON));
        let grid = UVec4::new(layer.columns, layer.rows, layer.outside.into(), 0);
        let before = drawn.get(entity).ok();
        let material = before.and_then(|(_, material)| materials.get_mut(&material.0));
        if let (Some((old_mesh, _)), Some(mut material)) = (before, material)
            && images.insert(&material.cells, cell_image(&layer)).is_ok()
            && meshes.insert(&old_mesh.0, mesh.clone()).is_ok()
        {
            material.grid = grid;
            material.tileset = layer.tileset.clone();
            continue;
        }
        let cells = images.add(cell_image(&layer));
        let material = TileMaterial { grid, cells, tileset: layer.tileset.clone() };
        commands.entity(entity).insert((Mesh2d(meshes.add(mesh)), MeshMaterial2d(materials.add(material))));
    }
}

/// Returns the grid with its border, in cells.
fn rectangle(layer: &TileLayer, border: f32) -> Mesh {
    let border = match layer.outside {
        TileLayer::EMPTY => 0.0,
        // Without cells: the view's centre is at most half a cell from the origin.
        _ if layer.cells.is_empty() => border.ceil() + 1.0,
        _ => border.ceil(),
    };
    let (left, right) = (-border, layer.columns as f32 + border);
    let (bottom, top) = (-border, layer.rows as f32 + border);
    let corners = vec![[left, bottom, 0.0], [right, bottom, 0.0], [right, top, 0.0], [left, top, 0.0]];
    Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, corners)
        .with_inserted_indices(Indices::U16(vec![0, 1, 2, 0, 2, 3]))
}

fn cell_image(layer: &TileLayer) -> Image {
    // A texture cannot be empty: a grid without cells gets one that is never looked up.
    let (cells, width, height) = match &*layer.cells {
        [] => (&[TileLayer::EMPTY][..], 1, 1),
        cells => (cells, layer.columns, layer.rows),
    };
    let size = Extent3d { width, height, depth_or_array_layers: 1 };
    let bytes = cells.iter().flat_map(|cell| cell.to_ne_bytes()).collect();
    let mut image = Image::new(size, TextureDimension::D2, bytes, TextureFormat::R16Uint, RenderAssetUsages::default());
    image.sampler = ImageSampler::nearest();
    image
}
