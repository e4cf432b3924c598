// A grid of tiles on one rectangle: each pixel looks its tile up.

#import bevy_sprite::mesh2d_functions::{
    get_world_from_local,
    mesh2d_position_local_to_clip,
}

const EMPTY: u32 = 0xffffu;
const OPAQUE: f32 = 127.5 / 255.0;

// Columns, rows, and the tile outside the grid.
@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<uniform> grid: vec4<u32>;
// A tile number per cell, bottom row first.
@group(#{MATERIAL_BIND_GROUP}) @binding(1) var cells: texture_2d<u32>;
// Square tiles, one below the other.
@group(#{MATERIAL_BIND_GROUP}) @binding(2) var tileset: texture_2d<f32>;

struct Corner {
    @builtin(instance_index) instance: u32,
    @location(0) place: vec3<f32>,
}

struct Point {
    @builtin(position) clip: vec4<f32>,
    // In cells, up and to the right from the bottom left corner of the grid.
    @location(0) place: vec2<f32>,
}

@vertex
fn vertex(corner: Corner) -> Point {
    var point: Point;
    let world_from_local = get_world_from_local(corner.instance);
    point.clip = mesh2d_position_local_to_clip(world_from_local, vec4<f32>(corner.place, 1.0));
    point.place = corner.place.xy;
    return point;
}

@fragment
fn fragment(point: Point) -> @location(0) vec4<f32> {
    let cell = floor(point.place);
    var tile = grid.z;
    if all(cell >= vec2<f32>(0.0)) && all(cell < vec2<f32>(grid.xy)) {
        tile = textureLoad(cells, vec2<i32>(cell), 0).x;
    }
    if tile == EMPTY {
        discard;
    }
    let side = textureDimensions(tileset).x;
    let within = point.place - cell;
    let texel = vec2<u32>(vec2<f32>(within.x, 1.0 - within.y) * f32(side));
    let inside = min(texel, vec2<u32>(side - 1u));
    let colour = textureLoad(tileset, vec2<u32>(inside.x, tile * side + inside.y), 0);
    if colour.a < OPAQUE {
        discard;
    }
    return vec4<f32>(colour.rgb, 1.0);
}
