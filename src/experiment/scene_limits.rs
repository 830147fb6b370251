//! What a scene may not say, each mistake where it was written.

use super::diagnostic::{Diagnostic, Origin};
use super::parameters;
use super::scene::{Camera, Detail, Scene};
use super::tree::{Kind, Node};

/// Sizes above these are refused before anything is allocated.
const LARGEST_VIEWPORT: u32 = 16_384;
const MOST_FRAMES: u32 = 100_000;
/// Metres, or degrees, of anything that a camera path says.
const FARTHEST: f64 = 1e9;
/// Pixels from the middle of the picture to where a ray leaves it at 45 degrees. Rays have 2^-24 of their length as their last digit, and
/// that many pixels of it are the hundredth of a pixel that the ground truth is good to.
const LARGEST_FOCAL_PX: f64 = 1e5;

pub fn check(scene: &Scene, node: &Node) -> Result<(), Diagnostic> {
    check_numbers(node)?;
    check_picture(scene, node)?;
    check_camera(scene, node)?;
    check_exclusive(node)?;
    if let Some(detail) = node.field("detail") {
        let values = serde_json::to_value(scene.detail).unwrap_or_default();
        parameters::check_ranges(&values, &parameters::schema::<Detail>(), detail)?;
    }
    if !(0.0..=1.0).contains(&scene.light.ambient) {
        let light = node.field("light").unwrap_or(node);
        let message = format!("a share of light of {}", scene.light.ambient);
        return Err(Diagnostic::input(message).at(origin(light, "ambient"), "expected 0 to 1"));
    }
    Ok(())
}

fn origin<'n>(node: &'n Node, field: &str) -> &'n Origin {
    node.field(field).map_or(&node.origin, |node| &node.origin)
}

/// The numbers of a node and of all in it, but for the value that means that nothing is there.
fn numbers(node: &Node) -> Vec<(f64, &Origin)> {
    match &node.kind {
        // RON allows underscores between digits; what is a name or a string is no number
        Kind::Leaf => {
            node.origin.text().replace('_', "").parse().map(|number| (number, &node.origin)).into_iter().collect()
        }
        Kind::Struct { fields, .. } => {
            let counts = fields.iter().filter(|field| field.name != "nodata_value");
            counts.flat_map(|field| numbers(&field.value)).collect()
        }
        Kind::Tuple { items, .. } | Kind::List(items) => items.iter().flat_map(numbers).collect(),
        Kind::Map(pairs) => pairs.iter().flat_map(|(_, value)| numbers(value)).collect(),
    }
}

fn check_numbers(node: &Node) -> Result<(), Diagnostic> {
    match numbers(node).into_iter().find(|(number, _)| !number.is_finite()) {
        None => Ok(()),
        Some((number, at)) => {
            Err(Diagnostic::input(format!("a scene cannot have the number {number}"))
                .at(at, "expected a finite number"))
        }
    }
}

fn check_picture(scene: &Scene, node: &Node) -> Result<(), Diagnostic> {
    let (width, height) = scene.viewport;
    if !(1..=LARGEST_VIEWPORT).contains(&width) || !(1..=LARGEST_VIEWPORT).contains(&height) {
        return Err(Diagnostic::input(format!("a viewport of {width} x {height} pixels cannot be drawn"))
            .at(origin(node, "viewport"), format!("each side is from 1 to {LARGEST_VIEWPORT} pixels")));
    }
    let fov_deg = scene.fov_deg;
    if !(fov_deg > 0.0 && fov_deg < 180.0) {
        return Err(Diagnostic::input(format!("a vertical field of view of {fov_deg} degrees has no picture"))
            .at(origin(node, "fov_deg"), "expected degrees above 0 and below 180"));
    }
    let half_px = 0.5 * f64::from(height);
    if half_px / (fov_deg.to_radians() / 2.0).tan() > LARGEST_FOCAL_PX {
        let least_deg = 2.0 * (half_px / LARGEST_FOCAL_PX).atan().to_degrees();
        return Err(Diagnostic::input(format!(
            "in a field of view of {fov_deg} degrees, {height} rows are too close for single precision"
        ))
        .at(origin(node, "fov_deg"), format!("expected at least {least_deg:.3} degrees for so many rows")));
    }
    Ok(())
}

fn check_camera(scene: &Scene, node: &Node) -> Result<(), Diagnostic> {
    let camera = node.field("camera").unwrap_or(node);
    if !(1..=MOST_FRAMES).contains(&scene.camera.frames()) {
        return Err(Diagnostic::input(format!("a camera path of {} frames", scene.camera.frames()))
            .at(&camera.head(), format!("expected 1 to {MOST_FRAMES} frames")));
    }
    if let Some((number, at)) = numbers(camera).into_iter().find(|(number, _)| number.abs() > FARTHEST) {
        return Err(Diagnostic::input(format!("a camera path cannot have {number:e}"))
            .at(at, format!("expected at most {FARTHEST:e} metres or degrees")));
    }
    let looks_at_itself = |eye: (f64, f64, f64), target: (f64, f64, f64)| eye == target;
    let pointless = match &scene.camera {
        Camera::Still(still) => still.look_at.is_some_and(|target| looks_at_itself(still.eye, target)),
        Camera::Orbit(orbit) => orbit.radius_m == 0.0 && orbit.height_m == 0.0,
        Camera::Flight(flight) => {
            flight.keys.is_empty() || flight.keys.iter().any(|key| looks_at_itself(key.eye, key.look_at))
        }
    };
    if pointless {
        return Err(Diagnostic::input("this camera path has no view direction")
            .at(&camera.head(), "an eye looks at itself, or there are no keys"));
    }
    Ok(())
}

/// Fields that say the same in two ways: one of them would be ignored.
const EXCLUSIVE: [(&str, &str, &[&str]); 2] =
    [("camera", "look_at", &["yaw_deg", "pitch_deg"]), ("terrain", "height_m", &["height_offset_m", "height_scale_m"])];

fn check_exclusive(node: &Node) -> Result<(), Diagnostic> {
    for (part, field, others) in EXCLUSIVE {
        let Some(part) = node.field(part).filter(|part| part.field(field).is_some()) else { continue };
        if let Some((other, found)) = others.iter().find_map(|other| Some((other, part.field(other)?))) {
            return Err(Diagnostic::input(format!("`{field}` and `{other}` exclude each other"))
                .at(&found.origin, format!("leave this out, or `{field}`"))
                .at(origin(part, field), "it is said here, too"));
        }
    }
    Ok(())
}
