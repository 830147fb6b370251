//!include ground
// How steep the ground is at each height sample, and which way it falls. Beyond the border the ground goes on as it is there.
// Differences after Horn 1981, Hill shading and the reflectance map.

struct Params {
    /// Metres between columns and between rows.
    cell_m: vec2<f32>,
}

@group(0) @binding(0) var<uniform> params: Params;
/// Degrees from level.
@group(0) @binding(1) var<storage, read_write> slope: array<f32>;
/// Degrees clockwise from north; -1 where the ground is level.
@group(0) @binding(2) var<storage, read_write> aspect: array<f32>;

/// Differences of the rows and columns beside count half as much as those through the sample; without, not at all.
override HORN: bool = true;
override WRITE_SLOPE: bool = true;
override WRITE_ASPECT: bool = true;

fn at(sample: vec2<i32>) -> f32 {
    let inside = vec2<u32>(clamp(sample, vec2(0), vec2<i32>(ground_size()) - 1));
    return ground_height(inside);
}

/// From one side of a sample to the other, `along` being a step there.
fn difference(sample: vec2<i32>, along: vec2<i32>) -> f32 {
    return at(sample + along) - at(sample - along);
}

/// Clockwise from north, where `down` points: the way that water runs.
fn falls_to(down: vec2<f32>) -> f32 {
    // of zeros WGSL promises nothing in atan2, and there are adapters that take south for north
    if down.x == 0.0 {
        return select(180.0, 0.0, down.y > 0.0);
    }
    if down.y == 0.0 {
        return select(270.0, 90.0, down.x > 0.0);
    }
    let clockwise = degrees(atan2(down.x, down.y));
    return select(clockwise, clockwise + 360.0, clockwise < 0.0);
}

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= ground_size()) {
        return;
    }
    let sample = vec2<i32>(id.xy);
    let east = vec2(1, 0);
    let north = vec2(0, -1);
    var rise = vec2(difference(sample, east), difference(sample, north)) * 0.5;
    if HORN {
        let beside = vec2(difference(sample + north, east) + difference(sample - north, east),
                          difference(sample + east, north) + difference(sample - east, north));
        rise = 0.5 * rise + 0.125 * beside;
    }
    let gradient = rise / params.cell_m;
    let index = id.y * GROUND_COLUMNS + id.x;
    if WRITE_SLOPE {
        slope[index] = degrees(atan(length(gradient)));
    }
    if WRITE_ASPECT {
        aspect[index] = select(falls_to(-gradient), -1.0, all(gradient == vec2(0.0)));
    }
}
