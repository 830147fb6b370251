//!include ground
// What lies on the ground at each height sample: water where it is low, rock where it is steep, snow where it is high, and meadow.

struct Params {
    /// Metres between columns and between rows.
    cell_m: vec2<f32>,
    /// Tangent of the steepest slope that is not rock.
    rock_slope: f32,
    /// Higher ground is under snow, lower ground under water.
    snow_m: f32,
    water_m: f32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read_write> surface_type: array<u32>;

const WATER: u32 = 0u;
const ROCK: u32 = 1u;
const SNOW: u32 = 2u;
const MEADOW: u32 = 3u;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= ground_size()) {
        return;
    }
    // at the border, one of two neighbours is the sample itself
    let low = max(id.xy, vec2(1u)) - 1u;
    let high = min(id.xy + 1u, ground_size() - 1u);
    let rise_m = vec2(ground_height(vec2(high.x, id.y)) - ground_height(vec2(low.x, id.y)),
                      ground_height(vec2(id.x, high.y)) - ground_height(vec2(id.x, low.y)));
    let height_m = ground_height(id.xy);
    var found = select(MEADOW, SNOW, height_m > params.snow_m);
    if length(rise_m / (vec2<f32>(high - low) * params.cell_m)) > params.rock_slope {
        found = ROCK;
    }
    if height_m <= params.water_m {
        found = WATER;
    }
    surface_type[id.y * GROUND_COLUMNS + id.x] = found;
}
