//! What the check runs: the registry's examples over terrains and views, kind and unkind.

use crate::experiment::diagnostic::Diagnostic;
use crate::experiment::scene::Surface;
use crate::stages::{self, Example, REGISTRY};

/// A scene and the chains that run over it.
pub struct Case {
    pub name: String,
    /// What stands between `scene: (` and `)`.
    pub scene: String,
    pub examples: Vec<&'static Example>,
}

impl Case {
    /// Stages that know samples only refuse octaves over them.
    pub fn may_be_refused(&self) -> bool {
        self.scene.contains("octaves: ")
    }
}

/// The examples of all stages, less those that are part of another one: a chain whose stages all stand in a longer one, in their order, is
/// checked there.
pub fn examples() -> Vec<&'static Example> {
    let all: Vec<&'static Example> = REGISTRY.iter().flat_map(|entry| entry.info.examples).collect();
    let stages: Vec<Vec<String>> = all.iter().map(|example| stages_of(example.chain)).collect();
    let is_part = |part: usize, whole: usize| {
        let mut rest = stages[whole].iter();
        let is_covered = stages[part].iter().all(|stage| rest.any(|other| other == stage));
        let is_equal = stages[part] == stages[whole];
        let serves = all[whole].only_on.is_none() || all[whole].only_on == all[part].only_on;
        part != whole && serves && is_covered && (!is_equal || whole < part)
    };
    (0..all.len()).filter(|&at| !(0..all.len()).any(|other| is_part(at, other))).map(|at| all[at]).collect()
}

/// The stages of a chain as they are written.
pub fn stages_of(chain: &str) -> Vec<String> {
    let mut stages = vec![String::new()];
    let mut depth = 0;
    for letter in chain.trim_start_matches('[').trim_end_matches(']').chars().filter(|letter| !letter.is_whitespace()) {
        match letter {
            ',' if depth == 0 => {
                stages.push(String::new());
                continue;
            }
            '(' | '{' => depth += 1,
            ')' | '}' => depth -= 1,
            _ => {}
        }
        if let Some(stage) = stages.last_mut() {
            stage.push(letter);
        }
    }
    stages
}

fn case(name: String, terrain: &str, surface: Surface, camera: &str, examples: &[&'static Example]) -> Case {
    let fits = |example: &&&'static Example| example.only_on.is_none_or(|only| only == surface);
    let examples = examples.iter().filter(fits).copied().collect();
    let scene = format!("terrain: {terrain}, surface: {surface:?}, camera: {camera}, viewport: (67, 45)");
    Case { name: format!("{name} {surface:?}"), scene, examples }
}

/// The examples of one stage, or of all.
fn wanted(stage: Option<&str>) -> Result<Vec<&'static Example>, Diagnostic> {
    let Some(name) = stage else { return Ok(examples()) };
    match stages::find(name) {
        Some(entry) => Ok(entry.info.examples.iter().collect()),
        None => Err(Diagnostic::input(format!("there is no stage `{name}`"))
            .suggest(name, REGISTRY.iter().map(|entry| entry.info.name))),
    }
}

/// Terrains from 2 x 2 samples to large, kind and unkind; cameras above, below, beside, far, near and slow. With the examples of one stage,
/// or of all.
pub fn cases(stage: Option<&str>) -> Result<Vec<Case>, Diagnostic> {
    let examples = wanted(stage)?;
    let terrains = [
        ("smallest", "Shape(kind: Ramp, size: (2, 2), cell_m: 500.0, height_m: (0, 100))"),
        ("strip", "Shape(kind: Sine, size: (2, 65), cell_m: 30.0, height_m: (0, 50), period_cells: 9)"),
        ("odd", "Noise(kind: Fbm, seed: 1, size: (37, 53), cell_m: 30.0, height_m: (0, 400), wavelength_m: 700)"),
        (
            "anisotropic",
            "Noise(kind: Ridged, seed: 2, size: (130, 97), cell_m: (20.0, 31.5), height_m: (200, 900), wavelength_m: 1500)",
        ),
        (
            "large",
            "Noise(kind: Billow, seed: 3, size: (1025, 515), cell_m: 10.0, height_m: (-300, 700), wavelength_m: 3000)",
        ),
        ("flat", "Shape(kind: Flat, size: (65, 65), height_m: (120, 120))"),
        ("spike", "Shape(kind: Spike, size: (65, 65), cell_m: 30.0, height_m: (0, 8000))"),
        ("cliff", "Shape(kind: Cliff, size: (64, 64), cell_m: 1.0, height_m: (0, 3000))"),
        (
            "checkerboard",
            "Shape(kind: Checkerboard, size: (100, 100), cell_m: 30.0, height_m: (0, 300), period_cells: 8)",
        ),
        ("high", "Shape(kind: Sine, size: (129, 129), cell_m: 0.5, height_m: (8000, 8001), period_cells: 30)"),
    ];
    let surfaces = [Surface::Triangles, Surface::Bilinear];
    let orbit = "Orbit(frames: 2, turns: 0.6666666666666666, center: (600, 600, 0), radius_m: 900, height_m: 700, clearance_m: 20)";
    let rough = terrains[3].1;
    let gentle = "Noise(kind: Billow, seed: 5, size: (151, 150), cell_m: 10.0, height_m: (0, 150), wavelength_m: 700)";
    let views = [
        ("view ground", rough, "Still(eye: (1300, 1500, 0), yaw_deg: 30, pitch_deg: 1, clearance_m: 2)"),
        ("view down", rough, "Still(eye: (1300, 1500, 3000), pitch_deg: -90)"),
        ("view rolled", rough, "Still(eye: (900, 900, 1200), yaw_deg: 200, pitch_deg: -20, roll_deg: 35)"),
        ("view far", rough, "Still(eye: (-40000, -30000, 9000), look_at: (1300, 1500, 500))"),
        ("view under", rough, "Still(eye: (1300, 1500, -500), yaw_deg: 10, pitch_deg: 30)"),
        ("view sky", rough, "Still(eye: (1300, 1500, 2000), pitch_deg: 60)"),
        // looked at along gentle slopes, the pixels of a column are near enough for one ray
        ("gentle", gentle, "Still(eye: (700, 50, 0), yaw_deg: 5, pitch_deg: -4, clearance_m: 60)"),
        // most of what was found in a frame holds in the next
        (
            "slow",
            rough,
            "Flight(frames: 4, clearance_m: 20, keys: [(eye: (200, 200, 1500), look_at: (1300, 1500, 300)), (eye: (260, 230, 1490), look_at: (1320, 1500, 300))])",
        ),
    ];
    // what stands behind the terrain is part of the scene, too
    let detailed = |detail: &str| format!("{rough}, detail: ({detail})");
    let six = detailed("octaves: 6, amplitude_m: 2.5, seed: 3");
    let thirty = detailed("octaves: 30, amplitude_m: 4, persistence: 0.45, origin: (10000000, -10000000)");
    let smallest = format!("{}, detail: (octaves: 5, amplitude_m: 3, persistence: 1)", terrains[0].1);
    let coloured = format!("{six}, colour: Cover(rock_deg: 25)");
    let views = views.into_iter().chain([
        ("octaves coloured", coloured.as_str(), orbit),
        ("octaves", &six, orbit),
        ("octaves ground", &six, "Still(eye: (1300, 1500, 0), yaw_deg: 30, pitch_deg: -20, clearance_m: 2)"),
        ("octaves far", &six, "Still(eye: (-40000, -30000, 9000), look_at: (1300, 1500, 500))"),
        ("octaves under", &six, "Still(eye: (1300, 1500, -500), yaw_deg: 10, pitch_deg: 30)"),
        ("octaves down", &six, "Still(eye: (1300, 1500, 0), pitch_deg: -90, clearance_m: 30)"),
        ("octaves smallest", &smallest, "Still(eye: (200, 200, 0), yaw_deg: 30, pitch_deg: -40, clearance_m: 20)"),
        ("octaves thirty", &thirty, "Still(eye: (1300, 1500, 0), yaw_deg: 30, pitch_deg: -30, clearance_m: 0.5)"),
    ]);
    let of_terrains = terrains.into_iter().map(|(name, terrain)| (name, terrain, orbit));
    let all = of_terrains.chain(views);
    let case = |(name, terrain, camera): (&str, &str, &str)| {
        surfaces.map(|surface| case(name.into(), terrain, surface, camera, &examples))
    };
    Ok(all.flat_map(case).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_example_is_checked_somewhere_and_none_twice() {
        let kept = examples();
        for entry in REGISTRY {
            let module = entry.module;
            assert!(!entry.info.examples.is_empty(), "{module} has no example");
            for example in entry.info.examples {
                let stages = stages_of(example.chain);
                let last = stages.last().map(String::as_str).unwrap_or_default();
                assert!(last.starts_with(entry.info.name), "an example of {module} ends in another stage: {last}");
                let covers = |kept: &&Example| {
                    let mut rest = stages_of(kept.chain).into_iter();
                    stages.iter().all(|stage| rest.any(|other| other == *stage))
                };
                assert!(kept.iter().any(covers), "{module}: {}", example.chain);
            }
        }
        assert!(kept.len() < REGISTRY.iter().map(|entry| entry.info.examples.len()).sum());
    }
}
